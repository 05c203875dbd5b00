/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/regions_json.h"

#include <string.h>

#include "agent/out/json.h"

static void write_region(AgentJson *json, const SegPart *part, const SegRegion *region);
static void write_piece(AgentJson *json, const SegPart *part, const SegPiece *piece);

char *agent_regions_json(const SegPart *part, const SegSegmentation *segmentation)
{
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_string(json, "part_sha256", part->sha256);
    agent_json_string(json, "method", segmentation->method);
    agent_json_object(json, "parameters");
    for (char **parameter = segmentation->parameters; parameter && *parameter; parameter++) {
        g_auto(GStrv) sides = g_strsplit(*parameter, "=", 2);
        agent_json_string(json, sides[0], sides[1] ? sides[1] : "");
    }
    agent_json_end(json);
    agent_json_array(json, "regions");
    for (size_t i = 0; i < segmentation->n_regions; i++)
        write_region(json, part, &segmentation->regions[i]);
    agent_json_end(json);
    agent_json_array(json, "dropped");
    for (size_t i = 0; i < segmentation->n_dropped; i++) {
        agent_json_object(json, NULL);
        agent_json_integer(json, "face", segmentation->dropped[i].face);
        agent_json_string(json, "reason", segmentation->dropped[i].reason);
        agent_json_end(json);
    }
    agent_json_end(json);
    return agent_json_finish(json);
}

static void write_region(AgentJson *json, const SegPart *part, const SegRegion *region)
{
    agent_json_object(json, NULL);
    agent_json_integer(json, "id", region->id);
    agent_json_string(json, "name", region->name);
    agent_json_string(json, "kind", seg_region_kind_name(region->kind));
    agent_json_array(json, "pieces");
    for (size_t i = 0; i < region->n_pieces; i++)
        write_piece(json, part, &region->pieces[i]);
    agent_json_end(json);
    agent_json_number(json, "area_mm2", region->area_mm2);
    agent_json_numbers(json, "feature_size_mm", region->feature_size_mm, 4);
    agent_json_number(json, "min_concave_radius_mm", region->min_concave_radius_mm);
    agent_json_row(json, "neighbours");
    for (size_t i = 0; i < region->n_neighbours; i++)
        agent_json_integer(json, NULL, region->neighbours[i]);
    agent_json_end(json);
    agent_json_end(json);
}

static void write_loop(AgentJson *json, const SegLoopPolygon *loop)
{
    agent_json_row(json, NULL);
    for (size_t k = 0; k < loop->n; k++)
        agent_json_numbers(json, NULL, loop->uv[k], 2);
    agent_json_end(json);
}

/* A piece without loops is the whole face: then the face's own loops bound it. */
static void write_face_loops(AgentJson *json, const SegPart *part, const SegFace *face)
{
    for (int32_t i = 0; i < face->n_loops; i++) {
        SegLoopPolygon loop = seg_loop_polygon(part, face->first_loop + i, part->chord_mm);
        write_loop(json, &loop);
        g_free(loop.uv);
    }
}

static void write_piece(AgentJson *json, const SegPart *part, const SegPiece *piece)
{
    int32_t entity = part->faces[piece->face].iges_de;
    agent_json_object(json, NULL);
    agent_json_integer(json, "face", piece->face);
    if (entity > 0)
        agent_json_integer(json, "iges_de", entity);
    else
        agent_json_string(json, "iges_de", NULL);
    agent_json_array(json, "loops_uv");
    for (size_t i = 0; i < piece->n_loops; i++)
        write_loop(json, &piece->loops[i]);
    if (piece->n_loops == 0)
        write_face_loops(json, part, &part->faces[piece->face]);
    agent_json_end(json);
    agent_json_end(json);
}
