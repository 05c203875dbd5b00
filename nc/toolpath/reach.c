/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/reach.h"

#include <string.h>

#define HOLDER_CLEARANCE_MM 0.5
#define ROUNDING_MM 1e-6
/* Places tried for a flat bottom on level ground: the axis over the point, and around it. */
#define PLACES 13
/* Ground counts as level up to this sine of its slope. */
#define LEVEL 1e-3

typedef enum { REACHED, DOWNWARD, CUTTER, BODY, FLOOR } Verdict;

static Verdict touch(const NcTerrain *terrain, const NcSample *sample, bool downward,
                     const NcBody *body, double floor_mm, double tolerance_mm);

NcBody nc_body(const CfgTool *tool, double leave_mm, double allowance_mm)
{
    NcCutter cutter = nc_cutter(tool);
    double off = leave_mm - allowance_mm;
    return (NcBody){
        .tool = cutter,
        .cutter = {cutter.radius_mm + leave_mm, cutter.corner_radius_mm + leave_mm},
        .shank = {cutter.radius_mm + allowance_mm, 0},
        .holder = {tool->holder_diameter_mm / 2 + allowance_mm + HOLDER_CLEARANCE_MM, 0},
        .leave_mm = leave_mm,
        .depth_mm = tool->max_depth_of_cut_mm,
        .shank_mm = tool->flute_length_mm + off,
        .holder_mm = tool->stickout_mm + off - HOLDER_CLEARANCE_MM,
    };
}

bool nc_body_clear(const NcTerrain *terrain, const NcBody *body, SegVec3 tip)
{
    SegVec3 min, max;
    nc_terrain_bounds(terrain, &min, &max);
    if (tip.z + fmin(body->shank_mm, body->holder_mm) >= max.z)
        return true;
    SegVec3 shank = {tip.x, tip.y, tip.z + body->shank_mm};
    SegVec3 holder = {tip.x, tip.y, tip.z + body->holder_mm};
    return nc_sweep_clear(terrain, body->shank, shank, shank, 0) &&
           nc_sweep_clear(terrain, body->holder, holder, holder, 0);
}

double nc_body_least_z(const NcTerrain *terrain, const NcBody *body, SegVec3 tip)
{
    double shank = nc_drop(terrain, body->shank, tip.x, tip.y, NULL, NULL) - body->shank_mm;
    double holder = nc_drop(terrain, body->holder, tip.x, tip.y, NULL, NULL) - body->holder_mm;
    return fmax(shank, holder) + ROUNDING_MM;
}

double nc_reach_unreachable_mm2(const NcReach *reach)
{
    return reach->downward_mm2 + reach->cutter_mm2 + reach->body_mm2 + reach->floor_mm2;
}

NcReach nc_reach(const NcTerrain *terrain, const NcRegion *region, const NcBody *body,
                 double floor_mm, double tolerance_mm, size_t stride, uint8_t *reached)
{
    g_autofree Verdict *verdict = g_new(Verdict, region->n_samples + 1);
#pragma omp parallel for schedule(dynamic, 32)
    for (size_t i = 0; i < region->n_samples; i += stride) {
        const NcSample *sample = &region->samples[i];
        verdict[i] = touch(terrain, sample, region->facets[sample->facet].downward, body, floor_mm,
                           tolerance_mm);
    }
    NcReach reach = {.requested_mm2 = region->area_mm2};
    if (reached)
        memset(reached, 0, region->n_samples);
    size_t n = (region->n_samples + stride - 1) / stride;
    double area = n > 0 ? region->area_mm2 / (double)n : 0;
    for (size_t i = 0; i < region->n_samples; i += stride) {
        reach.downward_mm2 += verdict[i] == DOWNWARD ? area : 0;
        reach.cutter_mm2 += verdict[i] == CUTTER ? area : 0;
        reach.body_mm2 += verdict[i] == BODY ? area : 0;
        reach.floor_mm2 += verdict[i] == FLOOR ? area : 0;
        if (reached)
            reached[i] = verdict[i] == REACHED;
    }
    return reach;
}

bool nc_reach_point(const NcTerrain *terrain, SegVec3 point, SegVec3 normal, const NcBody *body,
                    double floor_mm, double tolerance_mm)
{
    NcSample sample = {.point = point, .normal = normal};
    return touch(terrain, &sample, false, body, floor_mm, tolerance_mm) == REACHED;
}

/* The verdict of the best place from which the cutter touches the sample. */
static Verdict touch(const NcTerrain *terrain, const NcSample *sample, bool downward,
                     const NcBody *body, double floor_mm, double tolerance_mm)
{
    double r = body->cutter.corner_radius_mm, flat = body->cutter.radius_mm - r;
    SegVec3 n = sample->normal;
    SegVec3 c = seg_along(sample->point, n, r + tolerance_mm);
    double slope = hypot(n.x, n.y);
    bool level = slope < LEVEL;
    int places = level && flat > 0 ? PLACES : 1;
    Verdict best = downward ? DOWNWARD : CUTTER;
    if (c.z - r < floor_mm - tolerance_mm)
        return FLOOR;
    for (int k = 0; k < places; k++) {
        double reach = level && k == 0 ? 0 : flat;
        double angle = 2 * G_PI * k / (PLACES - 1);
        SegVec3 side =
            level ? seg_vec3(cos(angle), sin(angle), 0) : seg_vec3(n.x / slope, n.y / slope, 0);
        SegVec3 tip = seg_along(seg_vec3(c.x, c.y, c.z - r), side, reach);
        if (!nc_sweep_clear(terrain, body->cutter, tip, tip, 0))
            continue;
        if (nc_body_clear(terrain, body, tip))
            return REACHED;
        best = BODY;
    }
    return best;
}
