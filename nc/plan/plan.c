/* SPDX-License-Identifier: Apache-2.0 */
/* The plan: a tool and a toolpath for every region, in the order of the program. */
#include <string.h>

#include "nc/plan/estimate.h"
#include "nc/plan/rest.h"
#include "nc/plan/technology.h"

/* A region on its way to one operation, or to two where a neighbour's tool takes its rest. */
typedef struct {
    const SegRegion *from;
    const CfgRegion *wish; /* the recipe's, may be NULL */
    NcRegion *region;      /* NULL: nothing to cut */
    const CfgTool *tool;   /* that reaches all of it that can be reached, or the wish */
} Job;

static NcPlan *plan_of(NcPlanner *planner, CfgMethod method, GArray *operations);
static bool job_init(Job *job, const NcPlanner *planner, const SegRegion *from, GError **error);
static bool job_cut(const NcPlanner *planner, const Job *jobs, size_t n_jobs, const Job *job,
                    GArray *operations, GError **error);
static bool add_operation(const NcPlanner *planner, const NcRegion *region, const CfgRegion *wish,
                          NcOperation *operation, GArray *operations, GError **error);
static void sort_operations(GArray *operations);
static void operation_clear(void *operation);

NcPlan *nc_plan_new(const NcPlanInput *input, GError **error)
{
    NcPlanner planner;
    if (!nc_planner_init(&planner, input, error))
        return NULL;
    GArray *operations = g_array_new(FALSE, TRUE, sizeof(NcOperation));
    g_array_set_clear_func(operations, operation_clear);
    const SegSegmentation *segmentation = input->segmentation;
    size_t n = segmentation->n_regions;
    g_autofree Job *jobs = g_new0(Job, n + 1);
    bool ok = true;
    for (size_t r = 0; r < n && ok; r++)
        ok = job_init(&jobs[r], &planner, &segmentation->regions[r], error);
    for (size_t r = 0; r < n && ok; r++) {
        ok = job_cut(&planner, jobs, n, &jobs[r], operations, error);
        if (input->progress)
            input->progress((double)(r + 1) / (double)n, input->progress_data);
    }
    for (size_t r = 0; r < n; r++)
        nc_region_free(jobs[r].region);
    if (!ok) {
        g_array_unref(operations);
        nc_planner_clear(&planner);
        return NULL;
    }
    return plan_of(&planner, input->recipe->method, operations);
}

NcPlan *nc_plan_baseline(const NcPlanInput *input, GError **error)
{
    NcPlanner planner;
    if (!nc_planner_init(&planner, input, error))
        return NULL;
    const SegSegmentation *segmentation = input->segmentation;
    const CfgRecipe *recipe = input->recipe;
    g_autoptr(GPtrArray) regions = g_ptr_array_new_with_free_func((GDestroyNotify)nc_region_free);
    g_autofree const SegRegion **from = g_new(const SegRegion *, segmentation->n_regions + 1);
    size_t n = 0;
    for (size_t r = 0; r < segmentation->n_regions; r++) {
        const CfgRegion *wish = cfg_recipe_region(recipe, segmentation->regions[r].name);
        if (wish && wish->skip)
            continue;
        from[n++] = &segmentation->regions[r];
        g_ptr_array_add(regions,
                        nc_region_new(input->part, &planner.setup, planner.terrain, &from[n - 1], 1,
                                      recipe->keep_out, recipe->n_keep_out));
    }
    g_autoptr(NcRegion) whole = nc_region_new(input->part, &planner.setup, planner.terrain, from, n,
                                              recipe->keep_out, recipe->n_keep_out);
    GArray *operations = g_array_new(FALSE, TRUE, sizeof(NcOperation));
    g_array_set_clear_func(operations, operation_clear);
    bool ok = true;
    if (whole->n_facets > 0) {
        NcOperation operation = {
            .region = 1, .region_name = g_strdup("part"), .kind = SEG_REGION_REST};
        operation.tool = nc_technology_one_tool(&planner, (NcRegion *const *)regions->pdata,
                                                regions->len, whole);
        ok = add_operation(&planner, whole, NULL, &operation, operations, error);
    }
    if (input->progress)
        input->progress(1, input->progress_data);
    if (!ok) {
        g_array_unref(operations);
        nc_planner_clear(&planner);
        return NULL;
    }
    return plan_of(&planner, CFG_METHOD_NONE, operations);
}

void nc_plan_free(NcPlan *plan)
{
    if (!plan)
        return;
    for (size_t i = 0; i < plan->n_operations; i++)
        operation_clear(&plan->operations[i]);
    g_free(plan->operations);
    if (plan->notes)
        g_ptr_array_unref(plan->notes);
    g_free(plan);
}

const char *nc_strategy_name(CfgStrategy strategy)
{
    switch (strategy) {
    case CFG_STRATEGY_AUTO:
        return "auto";
    case CFG_STRATEGY_ISO_PLANAR:
        return "iso-planar";
    case CFG_STRATEGY_ISO_PARAMETRIC:
        return "iso-parametric";
    }
    return "unknown";
}

/* ------------------------------------------------------------------------ planner */

bool nc_planner_init(NcPlanner *planner, const NcPlanInput *input, GError **error)
{
    *planner = (NcPlanner){.input = input};
    const CfgRecipe *recipe = input->recipe;
    if (!nc_budget_share(recipe, &planner->budget, error))
        return false;
    if (input->part->chord_mm > planner->budget.tessellation_mm * (1 + 1e-9)) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "the part was tessellated to %g mm, but its share of quality.tolerance_mm = %g "
                    "is %g mm; load it with that, or set part.chord_mm",
                    input->part->chord_mm, recipe->tolerance_mm, planner->budget.tessellation_mm);
        return false;
    }
    if (recipe->stock_to_leave_mm > 0 && recipe->stock_to_leave_mm >= recipe->allowance_mm) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "quality.stock_to_leave_mm = %g leaves nothing to cut of "
                    "stock.allowance_mm = %g",
                    recipe->stock_to_leave_mm, recipe->allowance_mm);
        return false;
    }
    g_autoptr(GPtrArray) tools = nc_planner_tools(planner, error);
    if (!tools)
        return false;
    planner->setup = nc_setup_new(input->part, recipe->up, recipe->zero);
    planner->terrain = nc_terrain_from_part(input->part, &planner->setup);
    SegVec3 min, max;
    nc_terrain_bounds(planner->terrain, &min, &max);
    planner->floor_mm = min.z;
    planner->clearance_mm = max.z + recipe->allowance_mm + recipe->clearance_mm;
    planner->notes = g_ptr_array_new_with_free_func(g_free);
    return true;
}

void nc_planner_clear(NcPlanner *planner)
{
    nc_terrain_free(planner->terrain);
    if (planner->notes)
        g_ptr_array_unref(planner->notes);
}

/* A cone leaves steps on whatever it was not ground for. */
static bool mills_surfaces(const CfgTool *tool)
{
    return tool->kind == CFG_TOOL_FLAT || tool->kind == CFG_TOOL_BALL ||
           tool->kind == CFG_TOOL_BULL;
}

GPtrArray *nc_planner_tools(const NcPlanner *planner, GError **error)
{
    const CfgRecipe *recipe = planner->input->recipe;
    const CfgToolTable *table = planner->input->tools;
    g_autoptr(GPtrArray) tools = g_ptr_array_new();
    for (size_t i = 0; i < recipe->n_use_tools; i++) {
        const CfgTool *tool = cfg_tools_find(table, recipe->use_tools[i]);
        if (!tool) {
            g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                        "tools.use names tool %d, which the tool table does not have",
                        recipe->use_tools[i]);
            return NULL;
        }
        if (!mills_surfaces(tool)) {
            g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                        "tools.use names tool %d, a %s; surfaces are milled with flat, ball and "
                        "bull tools",
                        tool->number, cfg_tool_kind_name(tool->kind));
            return NULL;
        }
        g_ptr_array_add(tools, (gpointer)tool);
    }
    for (size_t i = 0; recipe->n_use_tools == 0 && i < table->n_tools; i++)
        if (mills_surfaces(&table->tools[i]))
            g_ptr_array_add(tools, (gpointer)&table->tools[i]);
    if (tools->len == 0) {
        g_set_error(
            error, NC_ERROR, NC_ERROR_PLAN,
            "the tool table has no flat, ball or bull tool, which surfaces are milled with");
        return NULL;
    }
    return g_steal_pointer(&tools);
}

char *nc_planner_tool_name(const CfgTool *tool)
{
    return g_strdup_printf("tool %d (%s Ø%g)", tool->number, cfg_tool_kind_name(tool->kind),
                           tool->diameter_mm);
}

/* Takes the operations and the planner's notes; the rest of the planner ends here. */
static NcPlan *plan_of(NcPlanner *planner, CfgMethod method, GArray *operations)
{
    NcPlan *plan = g_new0(NcPlan, 1);
    sort_operations(operations);
    plan->method = method;
    plan->budget = planner->budget;
    plan->clearance_mm = planner->clearance_mm;
    plan->notes = g_steal_pointer(&planner->notes);
    plan->n_operations = operations->len;
    plan->operations = (NcOperation *)(void *)g_array_free(operations, FALSE);
    nc_estimate_plan(plan, planner->input->recipe, planner->input->machine);
    nc_planner_clear(planner);
    return plan;
}

static void operation_clear(void *data)
{
    NcOperation *operation = data;
    g_free(operation->region_name);
    if (operation->path.locations)
        g_array_unref(operation->path.locations);
}

/* ------------------------------------------------------------------------ regions */

G_GNUC_PRINTF(2, 3)
static void note(const NcPlanner *planner, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_ptr_array_add(planner->notes, g_strdup_vprintf(format, arguments));
    va_end(arguments);
}

static void note_reach(const NcPlanner *planner, const NcOperation *operation, const NcReach *reach)
{
    static const char *const up[] = {"+X", "-X", "+Y", "-Y", "+Z", "-Z"};
    double left = nc_reach_unreachable_mm2(reach);
    if (left <= 0)
        return;
    g_autofree char *tool = nc_planner_tool_name(operation->tool);
    note(planner,
         "region %d '%s': %.4g of %.4g mm² reachable in three axes from %s with %s; left are %.4g "
         "facing down or covered, %.4g too narrow for the cutter, %.4g because of shank or holder, "
         "%.4g with the tip below the part",
         operation->region, operation->region_name, reach->requested_mm2 - left,
         reach->requested_mm2, up[planner->input->recipe->up], tool, reach->downward_mm2,
         reach->cutter_mm2, reach->body_mm2, reach->floor_mm2);
}

/* The region and the tool for all of it; notes say why nothing is to be cut. */
static bool job_init(Job *job, const NcPlanner *planner, const SegRegion *from, GError **error)
{
    const CfgRecipe *recipe = planner->input->recipe;
    *job = (Job){.from = from, .wish = cfg_recipe_region(recipe, from->name)};
    if (job->wish && job->wish->skip) {
        note(planner, "region %d '%s': skipped by the recipe", from->id, from->name);
        return true;
    }
    job->region = nc_region_new(planner->input->part, &planner->setup, planner->terrain, &from, 1,
                                recipe->keep_out, recipe->n_keep_out);
    if (job->region->n_facets == 0) {
        note(planner, "region %d '%s': all of its faces are kept out", from->id, from->name);
        g_clear_pointer(&job->region, nc_region_free);
        return true;
    }
    if (!job->wish || job->wish->tool == 0) {
        job->tool = nc_technology_tool(planner, job->region);
        return true;
    }
    job->tool = cfg_tools_find(planner->input->tools, job->wish->tool);
    if (!job->tool)
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "[region.%s] tool = %d: the tool table does not have it", from->name,
                    job->wish->tool);
    return job->tool != NULL;
}

/* The tools of the local features beside the region. */
static GPtrArray *finer_tools(const Job *jobs, size_t n_jobs, const Job *job)
{
    GPtrArray *tools = g_ptr_array_new();
    bool bound =
        job->wish && (job->wish->tool != 0 || job->wish->strategy == CFG_STRATEGY_ISO_PARAMETRIC);
    bool may = job->from->kind == SEG_REGION_REST && !bound;
    for (size_t i = 0; i < n_jobs && may; i++) {
        bool beside = false;
        for (size_t k = 0; k < job->from->n_neighbours; k++)
            beside |= job->from->neighbours[k] == jobs[i].from->id;
        if (beside && jobs[i].region && !g_ptr_array_find(tools, jobs[i].tool, NULL))
            g_ptr_array_add(tools, (gpointer)jobs[i].tool);
    }
    return tools;
}

bool nc_planner_allot(const NcPlanner *planner, const CfgTool *(*tools)[2], GError **error)
{
    const SegSegmentation *segmentation = planner->input->segmentation;
    size_t n = segmentation->n_regions;
    g_autofree Job *jobs = g_new0(Job, n + 1);
    bool ok = true;
    for (size_t r = 0; r < n && ok; r++)
        ok = job_init(&jobs[r], planner, &segmentation->regions[r], error);
    for (size_t r = 0; r < n && ok; r++) {
        tools[r][0] = tools[r][1] = NULL;
        if (!jobs[r].region)
            continue;
        g_autoptr(GPtrArray) finer = finer_tools(jobs, n, &jobs[r]);
        NcAllotment allotment = nc_allot(planner, jobs[r].region, jobs[r].tool,
                                         (const CfgTool *const *)finer->pdata, finer->len);
        tools[r][0] = allotment.tool;
        tools[r][1] = allotment.rest_tool;
        g_free(allotment.rest);
    }
    for (size_t r = 0; r < n; r++)
        nc_region_free(jobs[r].region);
    return ok;
}

static bool job_cut(const NcPlanner *planner, const Job *jobs, size_t n_jobs, const Job *job,
                    GArray *operations, GError **error)
{
    if (!job->region)
        return true;
    g_autoptr(GPtrArray) finer = finer_tools(jobs, n_jobs, job);
    NcAllotment allotment =
        nc_allot(planner, job->region, job->tool, (const CfgTool *const *)finer->pdata, finer->len);
    NcOperation operation = {.region = job->from->id,
                             .region_name = g_strdup(job->from->name),
                             .kind = job->from->kind,
                             .tool = allotment.tool};
    if (!allotment.rest)
        return add_operation(planner, job->region, job->wish, &operation, operations, error);

    NcOperation rest = operation;
    rest.region_name = g_strdup(job->from->name);
    rest.tool = allotment.rest_tool;
    g_autoptr(NcRegion) most = nc_region_split(job->region, allotment.rest, false);
    g_autoptr(NcRegion) strip = nc_region_split(job->region, allotment.rest, true);
    g_free(allotment.rest);
    if (add_operation(planner, most, job->wish, &operation, operations, error))
        return add_operation(planner, strip, job->wish, &rest, operations, error);
    operation_clear(&rest);
    return false;
}

/* Cuts the region and takes the operation over; nothing is added where nothing can be reached. */
static bool add_operation(const NcPlanner *planner, const NcRegion *region, const CfgRegion *wish,
                          NcOperation *operation, GArray *operations, GError **error)
{
    g_autofree uint8_t *reached = g_new(uint8_t, region->n_samples + 1);
    NcReach reach = nc_technology_reach(planner, region, operation->tool, reached);
    operation->requested_area_mm2 = reach.requested_mm2;
    operation->unreachable_area_mm2 = nc_reach_unreachable_mm2(&reach);
    note_reach(planner, operation, &reach);
    double reachable = reach.requested_mm2 - operation->unreachable_area_mm2;
    if (reachable <= 1e-9 * reach.requested_mm2) {
        operation_clear(operation);
        return true;
    }
    bool ok = nc_technology_cutting(planner, wish, operation, error) &&
              nc_technology_depth(planner, operation, error) &&
              nc_planner_cut(planner, region, reached, wish, operation, error);
    if (ok && operation->path.locations->len == 0 && reachable <= NC_SUITS * reach.requested_mm2) {
        note(planner,
             "region %d '%s': left, because no pass touches the little that can be reached",
             operation->region, operation->region_name);
        operation_clear(operation);
        return true;
    }
    if (ok && operation->path.locations->len == 0) {
        g_autofree char *name = nc_planner_tool_name(operation->tool);
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "region %d '%s': %s can reach %.4g of %.4g mm², but %s passes touch none of it "
                    "(walls?); choose another strategy or skip = true in [region.%s]",
                    operation->region, operation->region_name, name, reachable, reach.requested_mm2,
                    nc_strategy_name(operation->strategy), operation->region_name);
        ok = false;
    }
    if (ok)
        g_array_append_val(operations, *operation);
    else
        operation_clear(operation);
    return ok;
}

/* Larger tools first, each called once; among a tool's regions the nearest next. */
static void sort_operations(GArray *operations)
{
    NcOperation *o = (NcOperation *)(void *)operations->data;
    SegVec3 at = {0, 0, 0};
    for (guint i = 0; i < operations->len; i++) {
        guint best = i;
        for (guint j = i; j < operations->len; j++) {
            const NcOperation *a = &o[j], *b = &o[best];
            bool same = i > 0 && o[i - 1].tool == a->tool, was = i > 0 && o[i - 1].tool == b->tool;
            if (same != was) {
                best = same ? j : best;
            } else if (a->tool != b->tool) {
                bool larger = a->tool->diameter_mm != b->tool->diameter_mm
                                  ? a->tool->diameter_mm > b->tool->diameter_mm
                                  : a->tool->number < b->tool->number;
                best = larger ? j : best;
            } else {
                SegVec3 p = g_array_index(a->path.locations, NcLocation, 0).tip;
                SegVec3 q = g_array_index(b->path.locations, NcLocation, 0).tip;
                bool nearer = hypot(p.x - at.x, p.y - at.y) < hypot(q.x - at.x, q.y - at.y) - 1e-9;
                best = nearer ? j : best;
            }
        }
        NcOperation taken = o[best];
        memmove(&o[i + 1], &o[i], (best - i) * sizeof *o);
        o[i] = taken;
        const GArray *locations = taken.path.locations;
        at = g_array_index(locations, NcLocation, locations->len - 1).tip;
    }
}
