/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/plan/technology.h"

#include "nc/toolpath/stepover.h"

#define PLUNGE 0.4

static double pass_length(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                          const uint8_t *reached);

NcReach nc_technology_reach(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                            uint8_t *reached)
{
    const CfgRecipe *recipe = planner->input->recipe;
    NcBody body = nc_body(tool, recipe->stock_to_leave_mm, recipe->allowance_mm);
    return nc_reach(planner->terrain, region, &body, planner->floor_mm, recipe->tolerance_mm,
                    reached);
}

static bool suits_curvature(const CfgTool *tool, const NcRegion *region)
{
    return tool->kind == CFG_TOOL_FLAT ||
           nc_cutter(tool).corner_radius_mm <= region->min_concave_radius_mm * (1 + 1e-6);
}

const CfgTool *nc_technology_tool(const NcPlanner *planner, const NcRegion *region, NcReach *reach)
{
    g_autoptr(GPtrArray) tools = nc_planner_tools(planner, NULL);
    g_autofree NcReach *each = g_new0(NcReach, tools->len + 1);
    g_autofree uint8_t *reached = g_new(uint8_t, region->n_samples + 1);
    g_autofree double *length = g_new(double, tools->len + 1);
    double least = INFINITY;
    bool curved = false;
    for (guint i = 0; i < tools->len; i++) {
        each[i] = nc_technology_reach(planner, region, tools->pdata[i], reached);
        length[i] = pass_length(planner, region, tools->pdata[i], reached);
        double left = nc_reach_unreachable_mm2(&each[i]);
        if (left < least) {
            least = left;
            *reach = each[i];
        }
    }
    double most = least + NC_SUITS * region->area_mm2;
    for (guint i = 0; i < tools->len; i++)
        curved |=
            nc_reach_unreachable_mm2(&each[i]) <= most && suits_curvature(tools->pdata[i], region);
    const CfgTool *best = NULL;
    double shortest = INFINITY;
    for (guint i = 0; i < tools->len; i++) {
        const CfgTool *tool = tools->pdata[i];
        if (nc_reach_unreachable_mm2(&each[i]) > most || (curved && !suits_curvature(tool, region)))
            continue;
        bool equal = best && fabs(length[i] - shortest) <= 1e-9 * shortest;
        if (equal ? tool->diameter_mm > best->diameter_mm : length[i] < shortest) {
            best = tool;
            shortest = length[i];
            *reach = each[i];
        }
    }
    return best;
}

const CfgTool *nc_technology_one_tool(const NcPlanner *planner, NcRegion *const *regions,
                                      size_t n_regions, const NcRegion *whole, NcReach *reach)
{
    g_autoptr(GPtrArray) tools = nc_planner_tools(planner, NULL);
    g_autofree double *left = g_new0(double, n_regions * tools->len + 1);
    g_autofree uint8_t *reached = g_new(uint8_t, whole->n_samples + 1);
    for (size_t r = 0; r < n_regions; r++)
        for (guint i = 0; i < tools->len; i++) {
            NcReach one = nc_technology_reach(planner, regions[r], tools->pdata[i], NULL);
            left[r * tools->len + i] = nc_reach_unreachable_mm2(&one);
        }
    /* In lexical order: regions not suited, then what is left where none suits all, then length. */
    const CfgTool *best = NULL;
    double best_excess = INFINITY, best_length = INFINITY;
    for (guint i = 0; i < tools->len; i++) {
        double excess = 0;
        for (size_t r = 0; r < n_regions; r++) {
            double least = INFINITY;
            for (guint k = 0; k < tools->len; k++)
                least = fmin(least, left[r * tools->len + k]);
            double over = left[r * tools->len + i] - least;
            excess += over > NC_SUITS * regions[r]->area_mm2 ? over : 0;
        }
        NcReach one = nc_technology_reach(planner, whole, tools->pdata[i], reached);
        double length = pass_length(planner, whole, tools->pdata[i], reached);
        if (!isfinite(length) || excess > best_excess ||
            (excess == best_excess && length >= best_length))
            continue;
        best = tools->pdata[i];
        best_excess = excess;
        best_length = length;
        *reach = one;
    }
    return best;
}

/* Length of passes over what is reached, for planes that lie worst: along the slope. INFINITY where
 * nothing is reached. Walls count by the corner's step. */
static double pass_length(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                          const uint8_t *reached)
{
    NcCutter cutter = nc_cutter(tool);
    double scallop = planner->input->recipe->scallop_mm, length = 0;
    bool any = false;
    for (size_t i = 0; i < region->n_samples; i++) {
        if (!reached[i])
            continue;
        const NcFacet *facet = &region->facets[region->samples[i].facet];
        SegVec3 n = facet->normal;
        double slope = hypot(n.x, n.y);
        SegVec3 up =
            slope > 0 ? seg_vec3(-n.x * n.z / slope, -n.y * n.z / slope, slope) : seg_vec3(1, 0, 0);
        double step = nc_contact_step_mm(cutter, scallop, n, nc_bend_along(&facet->bend, up), up);
        length += region->samples[i].area_mm2 / fmax(step, 1e-6);
        any = true;
    }
    return any ? length : INFINITY;
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
