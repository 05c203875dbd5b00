/* SPDX-License-Identifier: Apache-2.0 */
/* One region with one tool: the strategy, the order of its pieces, the ways between them. */
#include "nc/plan/estimate.h"
#include "nc/plan/link.h"
#include "nc/plan/order.h"
#include "nc/plan/planner.h"

/* Neighbouring passes end no further apart than this many steps. */
#define DIRECT_STEPS 3

static NcJob job_of(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool);
static void finish(const NcPlanner *planner, const NcJob *job, NcCuts *cuts,
                   NcOperation *operation);

bool nc_planner_cut(const NcPlanner *planner, const NcRegion *region, const CfgRegion *wish,
                    NcOperation *operation, GError **error)
{
    (void)wish;
    (void)error;
    const CfgMachine *machine = planner->input->machine;
    NcJob job = job_of(planner, region, operation->tool);
    double speed = operation->feed_mm_min / 60;
    double turn_s = 4 * speed / fmin(machine->axis[0].max_mm_s2, machine->axis[1].max_mm_s2);
    operation->strategy = CFG_STRATEGY_ISO_PLANAR;
    operation->direction_rad = nc_iso_planar_direction(&job, operation->feed_mm_min, turn_s);
    NcCuts cuts = nc_iso_planar(&job, operation->direction_rad);
    finish(planner, &job, &cuts, operation);
    return true;
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
