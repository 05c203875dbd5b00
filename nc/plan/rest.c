/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/plan/rest.h"

#include "nc/plan/technology.h"

/* A strip has short passes: as much way between them as on them. */
#define STRIP 2

/* What one tool reaches of a region, looked at in the samples and in the middle of every facet: a
 * facet may have no sample. */
typedef struct {
    const CfgTool *tool;
    uint8_t *middles;
    uint8_t *samples;
} Trial;

static bool trial_init(Trial *trial, const NcPlanner *planner, const NcRegion *region,
                       const NcRegion *middles, const CfgTool *tool);
static void trial_clear(Trial *trial);
static NcRegion middles_of(const NcRegion *region);
static void weigh(const NcPlanner *planner, const NcRegion *region, const Trial *whole,
                  const Trial *wide, const Trial *fine, double *least_s, NcAllotment *best);
static double pair_time_s(const NcPlanner *planner, const NcRegion *region, const Trial *whole,
                          const Trial *wide, const Trial *fine, uint8_t *rest);
static double time_s(const NcPlanner *planner, const NcRegion *region, const Trial *trial);

NcAllotment nc_allot(const NcPlanner *planner, const NcRegion *region, const CfgTool *whole,
                     const CfgTool *const *finer, size_t n_finer)
{
    NcAllotment best = {.tool = whole};
    if (n_finer == 0)
        return best;
    g_autoptr(GPtrArray) tools = nc_planner_tools(planner, NULL);
    NcRegion middles = middles_of(region);
    Trial own;
    g_autofree Trial *fine = g_new0(Trial, n_finer + 1);
    bool usable = trial_init(&own, planner, region, &middles, whole);
    for (size_t i = 0; i < n_finer; i++)
        usable &= trial_init(&fine[i], planner, region, &middles, finer[i]);
    double least_s = usable ? (1 - NC_REST_GAIN) * time_s(planner, region, &own) : 0;
    for (guint t = 0; usable && t < tools->len; t++) {
        const CfgTool *tool = tools->pdata[t];
        if (tool->kind != whole->kind || tool->diameter_mm <= whole->diameter_mm)
            continue;
        Trial wide;
        if (trial_init(&wide, planner, region, &middles, tool))
            for (size_t i = 0; i < n_finer; i++)
                weigh(planner, region, &own, &wide, &fine[i], &least_s, &best);
        trial_clear(&wide);
    }
    trial_clear(&own);
    for (size_t i = 0; i < n_finer; i++)
        trial_clear(&fine[i]);
    g_free(middles.samples);
    return best;
}

/* Takes the pair as the best where it is faster than `least_s`. */
static void weigh(const NcPlanner *planner, const NcRegion *region, const Trial *whole,
                  const Trial *wide, const Trial *fine, double *least_s, NcAllotment *best)
{
    if (fine->tool->diameter_mm >= wide->tool->diameter_mm)
        return;
    g_autofree uint8_t *rest = g_new0(uint8_t, region->n_facets + 1);
    double s = pair_time_s(planner, region, whole, wide, fine, rest);
    if (s >= *least_s)
        return;
    *least_s = s;
    g_free(best->rest);
    *best = (NcAllotment){wide->tool, fine->tool, g_steal_pointer(&rest)};
}

/* ------------------------------------------------------------------------- trials */

static bool trial_init(Trial *trial, const NcPlanner *planner, const NcRegion *region,
                       const NcRegion *middles, const CfgTool *tool)
{
    *trial = (Trial){.tool = tool};
    NcOperation operation = {.tool = tool};
    if (!nc_technology_cutting(planner, NULL, &operation, NULL))
        return false;
    trial->middles = g_new(uint8_t, region->n_facets + 1);
    trial->samples = g_new(uint8_t, region->n_samples + 1);
    nc_technology_reach(planner, middles, tool, trial->middles);
    nc_technology_reach(planner, region, tool, trial->samples);
    return true;
}

static void trial_clear(Trial *trial)
{
    g_free(trial->middles);
    g_free(trial->samples);
}

/* The region with one sample a facet, in its middle; only `samples` is its own. */
static NcRegion middles_of(const NcRegion *region)
{
    NcRegion middles = *region;
    middles.n_samples = region->n_facets;
    middles.samples = g_new(NcSample, region->n_facets + 1);
    for (size_t f = 0; f < region->n_facets; f++) {
        const NcPatch *facet = &region->facets[f];
        middles.samples[f] = (NcSample){
            .point = seg_scale(seg_add(facet->a, seg_add(facet->b, facet->c)), 1.0 / 3),
            .normal = facet->normal,
            .facet = f,
            .area_mm2 = facet->area_mm2,
        };
    }
    return middles;
}

static double time_s(const NcPlanner *planner, const NcRegion *region, const Trial *trial)
{
    return nc_technology_time_s(planner, region, trial->tool, trial->samples);
}

/* Time of the wide tool and, on the facets that go to the fine one (marked in `rest`), of that;
 * INFINITY where both together leave more than the whole tool may. */
static double pair_time_s(const NcPlanner *planner, const NcRegion *region, const Trial *whole,
                          const Trial *wide, const Trial *fine, uint8_t *rest)
{
    double lost_mm2 = 0;
    bool any = false;
    for (size_t f = 0; f < region->n_facets; f++)
        any |= rest[f] = !wide->middles[f] && fine->middles[f];
    for (size_t i = 0; i < region->n_samples; i++) {
        if (wide->samples[i])
            continue;
        if (fine->samples[i])
            any |= rest[region->samples[i].facet] = 1;
        else if (whole->samples[i])
            lost_mm2 += region->samples[i].area_mm2;
    }
    if (!any || lost_mm2 > NC_SUITS * region->area_mm2)
        return INFINITY;
    Trial strip = {.tool = fine->tool};
    strip.samples = g_new(uint8_t, region->n_samples + 1);
    for (size_t i = 0; i < region->n_samples; i++)
        strip.samples[i] = rest[region->samples[i].facet];
    double s = time_s(planner, region, wide) + STRIP * time_s(planner, region, &strip);
    g_free(strip.samples);
    return s;
}
