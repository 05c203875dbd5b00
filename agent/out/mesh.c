/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/mesh.h"

#include "config/config.h"

static void append_vertex(GString *out, SegVec3 p)
{
    const double coordinates[3] = {p.x, p.y, p.z};
    g_string_append_c(out, 'v');
    for (int i = 0; i < 3; i++) {
        g_string_append_c(out, ' ');
        cfg_number_append(out, coordinates[i]);
    }
    g_string_append_c(out, '\n');
}

char *agent_regions_obj(const SegPart *part, const SegSegmentation *segmentation)
{
    GString *out = g_string_new("# segmill: regions of the part, mm\n");
    for (int32_t i = 0; i < part->n_vertices; i++)
        append_vertex(out, part->vertices[i].position);
    for (size_t r = 0; r < segmentation->n_regions; r++) {
        const SegRegion *region = &segmentation->regions[r];
        g_string_append_printf(out, "g %s\n", region->name);
        for (size_t i = 0; i < region->n_triangles; i++) {
            const int32_t *v = part->triangles[region->triangles[i]].vertex;
            g_string_append_printf(out, "f %d %d %d\n", v[0] + 1, v[1] + 1, v[2] + 1);
        }
    }
    return g_string_free(out, false);
}
