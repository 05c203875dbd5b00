/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/plan/technology.h"

#include <stdlib.h>

#include "nc/toolpath/stepover.h"

#define PLUNGE 0.4
/* Ground up to half a degree off counts as level, or as a wall; a flat tool bears so much other. */
#define SINE_LEVEL 0.0087
#define COSINE_LEVEL 0.99996
#define FLAT_SLANTING 0.02

/* Radii are sampled on the surfaces: a corner as wide as the fillet fits it. */
#define SAMPLED 1e-3

/* Rates that differ by no more are the same. */
#define SAME_RATE 0.01

/* Tools are compared by about so many samples of a region. */
#define TRIAL_SAMPLES 1500

/* The share of a region whose step-over is narrower than what its passes are spaced by. */
#define NARROWEST 0.1

static int compare_doubles(const void *a, const void *b);
static NcReach reach_of(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                        size_t stride, uint8_t *reached);

NcReach nc_technology_reach(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                            uint8_t *reached)
{
    return reach_of(planner, region, tool, 1, reached);
}

static NcReach reach_of(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                        size_t stride, uint8_t *reached)
{
    const CfgRecipe *recipe = planner->input->recipe;
    NcBody body = nc_body(tool, recipe->stock_to_leave_mm, recipe->allowance_mm);
    return nc_reach(planner->terrain, region, &body, planner->floor_mm, recipe->tolerance_mm,
                    stride, reached);
}

/* What one tool does in a region. */
typedef struct {
    NcReach reach;
    double left_mm2;  /* not reached because of the tool */
    double floor_mm2; /* not reached because the tip would go below the part */
    double time_s;    /* of its passes */
    bool suits;       /* its kind does */
    bool fits;        /* its corner is not larger than the smallest concave radius */
} Trial;

/* A flat end leaves steps on ground that is neither level nor a wall. */
static bool suits_form(const CfgTool *tool, const NcRegion *region, const uint8_t *reached)
{
    if (tool->kind != CFG_TOOL_FLAT)
        return true;
    double slanting = 0, all = 0;
    for (size_t i = 0; i < region->n_samples; i++) {
        double up = region->samples[i].normal.z;
        all += reached[i];
        slanting += reached[i] && up > SINE_LEVEL && up < COSINE_LEVEL;
    }
    return slanting <= FLAT_SLANTING * all;
}

static Trial try_tool(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool)
{
    g_autofree uint8_t *reached = g_new(uint8_t, region->n_samples + 1);
    size_t stride = region->n_samples / TRIAL_SAMPLES + 1;
    Trial trial = {.reach = reach_of(planner, region, tool, stride, reached)};
    trial.floor_mm2 = trial.reach.floor_mm2;
    trial.left_mm2 = nc_reach_unreachable_mm2(&trial.reach) - trial.floor_mm2;
    trial.time_s = nc_technology_time_s(planner, region, tool, reached);
    trial.suits = suits_form(tool, region, reached);
    trial.fits = nc_cutter(tool).corner_radius_mm <= region->min_concave_radius_mm * (1 + SAMPLED);
    return trial;
}

/* Drops the tools whose form does not suit, unless that drops all. */
static void keep_suitable(Trial *trials, guint n)
{
    bool any = false;
    for (guint i = 0; i < n; i++)
        any |= trials[i].suits && isfinite(trials[i].time_s);
    for (guint i = 0; i < n && any; i++)
        if (!trials[i].suits)
            trials[i].time_s = trials[i].left_mm2 = trials[i].floor_mm2 = INFINITY;
}

/* How much more of the region than the best tools each tool leaves beyond what a tool that suits
 * may leave; 0 for those that suit. */
static double excess_of(const Trial *trials, guint n, guint tool, double area_mm2)
{
    double left = INFINITY, floor_mm2 = INFINITY;
    for (guint i = 0; i < n; i++) {
        left = fmin(left, trials[i].left_mm2);
        floor_mm2 = fmin(floor_mm2, trials[i].floor_mm2);
    }
    if (isinf(trials[tool].left_mm2))
        return area_mm2;
    return fmax(trials[tool].left_mm2 - left - NC_SUITS * area_mm2, 0) +
           fmax(trials[tool].floor_mm2 - floor_mm2 - NC_SUITS_FLOOR * area_mm2, 0);
}

/* Time for the area that is reached. */
static double rate_of(const Trial *trial)
{
    return trial->time_s / (trial->reach.requested_mm2 - trial->left_mm2 - trial->floor_mm2);
}

/* Is tool i to be preferred: less excess; then a corner that fits the valleys (what a wider one
 * leaves of them is no more than a tool that suits may leave); then less time, if the difference is
 * worth the name; then width? */
static bool is_better(GPtrArray *tools, const Trial *trials, const double *excess, guint i,
                      guint best)
{
    const CfgTool *tool = tools->pdata[i], *other = tools->pdata[best];
    if (excess[i] != excess[best])
        return excess[i] < excess[best];
    if (trials[i].fits != trials[best].fits)
        return trials[i].fits;
    double rate = rate_of(&trials[i]), least = rate_of(&trials[best]);
    if (fabs(rate - least) > SAME_RATE * least)
        return rate < least;
    return tool->diameter_mm > other->diameter_mm;
}

static const CfgTool *best_of(GPtrArray *tools, const Trial *trials, const double *excess)
{
    guint best = tools->len;
    for (guint i = 0; i < tools->len; i++)
        if (isfinite(trials[i].time_s) &&
            (best == tools->len || is_better(tools, trials, excess, i, best)))
            best = i;
    return best < tools->len ? tools->pdata[best] : tools->pdata[0];
}

const CfgTool *nc_technology_tool(const NcPlanner *planner, const NcRegion *region)
{
    g_autoptr(GPtrArray) tools = nc_planner_tools(planner, NULL);
    g_autofree Trial *trials = g_new(Trial, tools->len + 1);
    g_autofree double *excess = g_new(double, tools->len + 1);
    for (guint i = 0; i < tools->len; i++)
        trials[i] = try_tool(planner, region, tools->pdata[i]);
    keep_suitable(trials, tools->len);
    for (guint i = 0; i < tools->len; i++)
        excess[i] = excess_of(trials, tools->len, i, region->area_mm2);
    return best_of(tools, trials, excess);
}

const CfgTool *nc_technology_one_tool(const NcPlanner *planner, NcRegion *const *regions,
                                      size_t n_regions, const NcRegion *whole)
{
    g_autoptr(GPtrArray) tools = nc_planner_tools(planner, NULL);
    g_autofree Trial *trials = g_new(Trial, tools->len + 1);
    g_autofree double *excess = g_new0(double, tools->len + 1);
    for (size_t r = 0; r < n_regions; r++) {
        for (guint i = 0; i < tools->len; i++)
            trials[i] = try_tool(planner, regions[r], tools->pdata[i]);
        keep_suitable(trials, tools->len);
        for (guint i = 0; i < tools->len; i++)
            excess[i] += excess_of(trials, tools->len, i, regions[r]->area_mm2);
    }
    for (guint i = 0; i < tools->len; i++)
        trials[i] = try_tool(planner, whole, tools->pdata[i]);
    return best_of(tools, trials, excess);
}

double nc_technology_time_s(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                            const uint8_t *reached)
{
    NcCutter cutter = nc_cutter(tool);
    double scallop = planner->input->recipe->scallop_mm, area = 0;
    g_autofree double *steps = g_new(double, region->n_samples + 1);
    size_t n_steps = 0;
    for (size_t i = 0; i < region->n_samples; i++) {
        if (!reached[i])
            continue;
        const NcPatch *facet = &region->facets[region->samples[i].facet];
        SegVec3 n = facet->normal;
        double slope = hypot(n.x, n.y);
        SegVec3 up =
            slope > 0 ? seg_vec3(-n.x * n.z / slope, -n.y * n.z / slope, slope) : seg_vec3(1, 0, 0);
        steps[n_steps++] = nc_contact_step_mm(cutter, scallop, tool->max_depth_of_cut_mm, n,
                                              nc_bend_along(&facet->bend, up), up);
        area += region->samples[i].area_mm2;
    }
    if (n_steps == 0)
        return INFINITY;
    /* A pass is as close to the next as its narrowest place asks, which is what a bull pays for on
     * ground that is level here and slanting there. */
    qsort(steps, n_steps, sizeof *steps, compare_doubles);
    double length = area / fmax(steps[(size_t)(NARROWEST * (double)n_steps)], 1e-6);
    /* Without cutting data, which is an error for the tool that is taken, lengths are compared. */
    NcOperation operation = {.tool = tool};
    bool known = nc_technology_cutting(planner, NULL, &operation, NULL);
    return 60 * length / (known ? operation.feed_mm_min : 1);
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* ------------------------------------------------------------------------ cutting */

static const CfgCutting *cutting_of(const CfgTool *tool, const char *material)
{
    for (size_t i = 0; i < tool->n_cutting; i++)
        if (g_ascii_strcasecmp(tool->cutting[i].material, material) == 0)
            return &tool->cutting[i];
    return NULL;
}

bool nc_technology_cutting(const NcPlanner *planner, const CfgRegion *wish, NcOperation *operation,
                           GError **error)
{
    const CfgMachine *machine = planner->input->machine;
    const CfgTool *tool = operation->tool;
    double rpm = wish ? wish->spindle_rpm : 0, feed = wish ? wish->feed_mm_min : 0;
    const CfgCutting *cutting = cutting_of(tool, planner->input->recipe->material);
    if (!cutting && (rpm <= 0 || feed <= 0)) {
        g_autofree char *name = nc_planner_tool_name(tool);
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "region %d '%s': %s has no cutting data for stock.material = %s; add it to the "
                    "tool table, or set feed and spindle in [region.%s]",
                    operation->region, operation->region_name, name,
                    planner->input->recipe->material, operation->region_name);
        return false;
    }
    if (rpm <= 0)
        rpm = rint(1000 * cutting->cutting_speed_m_min / (G_PI * tool->diameter_mm));
    operation->spindle_rpm = fmin(fmax(rpm, machine->spindle_min_rpm), machine->spindle_max_rpm);
    if (feed <= 0)
        feed = fmax(rint(operation->spindle_rpm * tool->flutes * cutting->feed_per_tooth_mm), 1);
    for (int i = 0; i < 3; i++)
        feed = fmin(feed, machine->axis[i].max_mm_min);
    operation->feed_mm_min = feed;
    operation->plunge_mm_min = PLUNGE * feed;
    return true;
}

bool nc_technology_depth(const NcPlanner *planner, const NcOperation *operation, GError **error)
{
    const CfgRecipe *recipe = planner->input->recipe;
    double depth = recipe->allowance_mm - recipe->stock_to_leave_mm;
    if (depth <= operation->tool->max_depth_of_cut_mm)
        return true;
    g_autofree char *name = nc_planner_tool_name(operation->tool);
    g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                "region %d '%s': %g mm of stock is more than %s may take in one cut (%g mm); lower "
                "stock.allowance_mm or choose another tool in [region.%s]",
                operation->region, operation->region_name, depth, name,
                operation->tool->max_depth_of_cut_mm, operation->region_name);
    return false;
}
