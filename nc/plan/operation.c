/* SPDX-License-Identifier: Apache-2.0 */
/* One region with one tool: the strategy, the order of its pieces, the ways between them. */
#include "nc/plan/estimate.h"
#include "nc/plan/link.h"
#include "nc/plan/order.h"
#include "nc/plan/technology.h"
#include "nc/toolpath/cover.h"

/* Neighbouring passes end no further apart than this many steps. */
#define DIRECT_STEPS 3

/* More than this share of the region, left by the strategy, is noted. */
#define LEFT_NOTED 0.001

typedef struct {
    NcOperation operation;
    double left_mm2; /* reached by the tool, but not cut by the passes */
} Trial;

static Trial try_strategy(const NcPlanner *planner, const NcJob *job, const NcOperation *from,
                          CfgStrategy strategy, const uint8_t *reached);
static bool is_better(const Trial *a, const Trial *b, double area_mm2);
static NcJob job_of(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool);
static void finish(const NcPlanner *planner, const NcJob *job, NcCuts *cuts,
                   NcOperation *operation);

bool nc_planner_cut(const NcPlanner *planner, const NcRegion *region, const uint8_t *reached,
                    const CfgRegion *wish, NcOperation *operation, GError **error)
{
    CfgStrategy strategy = wish ? wish->strategy : CFG_STRATEGY_AUTO;
    bool parametric = nc_iso_parametric_can(region, planner->input->part);
    if (strategy == CFG_STRATEGY_ISO_PARAMETRIC && !parametric) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "[region.%s] strategy = iso-parametric: the region has no surfaces, only "
                    "triangles; choose iso-planar",
                    operation->region_name);
        return false;
    }
    NcJob job = job_of(planner, region, operation->tool);
    Trial best = {.left_mm2 = INFINITY};
    if (strategy != CFG_STRATEGY_ISO_PARAMETRIC)
        best = try_strategy(planner, &job, operation, CFG_STRATEGY_ISO_PLANAR, reached);
    if (strategy != CFG_STRATEGY_ISO_PLANAR && parametric) {
        Trial other = try_strategy(planner, &job, operation, CFG_STRATEGY_ISO_PARAMETRIC, reached);
        if (is_better(&other, &best, region->area_mm2)) {
            Trial swap = best;
            best = other;
            other = swap;
        }
        if (other.operation.path.locations)
            g_array_unref(other.operation.path.locations);
    }
    *operation = best.operation;
    operation->unreachable_area_mm2 += best.left_mm2;
    if (best.left_mm2 > LEFT_NOTED * region->area_mm2)
        g_ptr_array_add(planner->notes,
                        g_strdup_printf("region %d '%s': %.4g mm² that the tool can reach are left "
                                        "by %s passes",
                                        operation->region, operation->region_name, best.left_mm2,
                                        nc_strategy_name(operation->strategy)));
    return true;
}

static Trial try_strategy(const NcPlanner *planner, const NcJob *job, const NcOperation *from,
                          CfgStrategy strategy, const uint8_t *reached)
{
    const CfgMachine *machine = planner->input->machine;
    const CfgRecipe *recipe = planner->input->recipe;
    Trial trial = {.operation = *from};
    trial.operation.strategy = strategy;
    NcCuts cuts;
    if (strategy == CFG_STRATEGY_ISO_PARAMETRIC) {
        cuts = nc_iso_parametric(job);
    } else {
        double speed = from->feed_mm_min / 60;
        double turn_s = 4 * speed / fmin(machine->axis[0].max_mm_s2, machine->axis[1].max_mm_s2);
        trial.operation.direction_rad = nc_iso_planar_direction(job, from->feed_mm_min, turn_s);
        cuts = nc_iso_planar(job, trial.operation.direction_rad);
    }
    trial.left_mm2 = nc_cover_left_mm2(&job->trace, cuts.pieces,
                                       recipe->scallop_mm + recipe->tolerance_mm, reached);
    finish(planner, job, &cuts, &trial.operation);
    return trial;
}

/* What covers more comes first; where both cover the same, what is faster. */
static bool is_better(const Trial *a, const Trial *b, double area_mm2)
{
    if (fabs(a->left_mm2 - b->left_mm2) > NC_SUITS * area_mm2)
        return a->left_mm2 < b->left_mm2;
    return a->operation.estimated_s < b->operation.estimated_s;
}

static NcJob job_of(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool)
{
    const CfgRecipe *recipe = planner->input->recipe;
    NcBody body = nc_body(tool, recipe->stock_to_leave_mm, recipe->allowance_mm);
    return (NcJob){
        .part = planner->input->part,
        .setup = &planner->setup,
        .region = region,
        .scallop_mm = recipe->scallop_mm,
        .tessellation_mm = planner->budget.tessellation_mm,
        .trace = {.terrain = planner->terrain,
                  .region = region,
                  .body = body,
                  .floor_mm = planner->floor_mm - recipe->stock_to_leave_mm - 1e-6,
                  .chord_mm = planner->budget.chord_mm,
                  .touch_mm = recipe->tolerance_mm,
                  .overlap_mm = recipe->overlap_mm,
                  .bridge_mm = body.tool.radius_mm},
    };
}

/* Orders and joins the pieces; takes them over. */
static void finish(const NcPlanner *planner, const NcJob *job, NcCuts *cuts, NcOperation *operation)
{
    const CfgRecipe *recipe = planner->input->recipe;
    double direct = DIRECT_STEPS * cuts->stepover_mm;
    NcLinker linker = {.trace = &job->trace,
                       .allowance_mm = recipe->allowance_mm,
                       .clearance_mm = planner->clearance_mm,
                       .direct_mm = direct};
    nc_order_pieces(cuts->pieces, recipe->one_way, direct, recipe->clearance_mm);
    operation->stepover_mm = cuts->stepover_mm;
    operation->path = nc_link(&linker, cuts->pieces);
    nc_pieces_free(cuts->pieces);
    cuts->pieces = NULL;
    nc_estimate_lengths(operation);
    operation->estimated_s = nc_estimate_operation_s(operation, recipe, planner->input->machine,
                                                     planner->budget.blend_mm);
}
