/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/plan/estimate.h"

typedef struct {
    const CfgMachine *machine;
    SegVec3 offset; /* of the work coordinates in force */
    SegVec3 at;     /* gauge point, machine coordinates */
    int tool;
    double rpm, blend_mm;
    GArray *moves; /* NcMove */
} Walk;

static void walk_operation(Walk *walk, const NcOperation *operation);
static void change_tool(Walk *walk, int tool);
static void set_spindle(Walk *walk, double rpm);
static void rapid(Walk *walk, SegVec3 to);

static Walk walk_new(const CfgRecipe *recipe, const CfgMachine *machine, double blend_mm)
{
    const double *offset = machine->work_offset_mm[CLAMP(recipe->wcs - 54, 0, 5)];
    const double *change = machine->tool_change_mm;
    return (Walk){.machine = machine,
                  .offset = seg_vec3(offset[0], offset[1], offset[2]),
                  .at = seg_vec3(change[0], change[1], change[2]),
                  .blend_mm = blend_mm,
                  .moves = g_array_new(FALSE, TRUE, sizeof(NcMove))};
}

void nc_estimate_lengths(NcOperation *operation)
{
    const GArray *locations = operation->path.locations;
    SegVec3 before = {0, 0, 0};
    bool cutting = false;
    operation->length_mm = operation->air_mm = 0;
    operation->reversals = 0;
    for (guint i = 1; i < locations->len; i++) {
        const NcLocation *a = &g_array_index(locations, NcLocation, i - 1), *b = a + 1;
        SegVec3 step = seg_sub(b->tip, a->tip);
        double length = seg_norm(step);
        if (b->motion != NC_CUT) {
            operation->air_mm += length;
            if (b->motion != NC_LINK)
                cutting = false;
            continue;
        }
        operation->length_mm += length;
        if (cutting && seg_dot(before, step) < 0)
            operation->reversals++;
        if (length > 0) {
            before = step;
            cutting = true;
        }
    }
}

double nc_estimate_operation_s(const NcOperation *operation, const CfgRecipe *recipe,
                               const CfgMachine *machine, double blend_mm)
{
    Walk walk = walk_new(recipe, machine, blend_mm);
    if (operation->path.locations->len > 0) {
        const NcLocation *first = &g_array_index(operation->path.locations, NcLocation, 0);
        walk.at = seg_add(first->tip, walk.offset);
        walk.at.z += operation->tool->length_mm;
    }
    walk.tool = operation->tool->number;
    walk.rpm = operation->spindle_rpm;
    walk_operation(&walk, operation);
    size_t n = walk.moves->len;
    g_autoptr(NcMotion) motion =
        nc_motion_new(machine, NC_NO_OVERRIDE, 0, (NcMove *)(void *)walk.moves->data, n);
    g_array_unref(walk.moves);
    return nc_motion_total_s(motion);
}

void nc_estimate_plan(NcPlan *plan, const CfgRecipe *recipe, const CfgMachine *machine)
{
    Walk walk = walk_new(recipe, machine, plan->budget.blend_mm);
    g_autofree size_t *end = g_new(size_t, plan->n_operations + 1);
    plan->length_mm = plan->air_mm = 0;
    plan->reversals = plan->tool_changes = 0;
    for (size_t i = 0; i < plan->n_operations; i++) {
        NcOperation *operation = &plan->operations[i];
        if (operation->tool->number != walk.tool) {
            change_tool(&walk, operation->tool->number);
            plan->tool_changes++;
        }
        set_spindle(&walk, operation->spindle_rpm);
        walk_operation(&walk, operation);
        end[i] = walk.moves->len;
        plan->length_mm += operation->length_mm;
        plan->air_mm += operation->air_mm;
        plan->reversals += operation->reversals;
    }
    set_spindle(&walk, 0);
    rapid(&walk, seg_vec3(walk.at.x, walk.at.y, machine->axis[2].max_mm));
    g_autoptr(NcMotion) motion = nc_motion_new(machine, NC_NO_OVERRIDE, 0,
                                               (NcMove *)(void *)walk.moves->data, walk.moves->len);
    double before = 0;
    for (size_t i = 0; i < plan->n_operations; i++) {
        double s = nc_motion_start_s(motion, end[i]);
        plan->operations[i].estimated_s = s - before;
        before = s;
    }
    plan->estimated_s = nc_motion_total_s(motion);
    g_array_unref(walk.moves);
}

static void add(Walk *walk, NcMove move)
{
    move.line = walk->moves->len + 1;
    move.tool = walk->tool;
    move.spindle_rpm = walk->rpm;
    move.tolerance_mm = walk->blend_mm;
    move.from = walk->at;
    g_array_append_val(walk->moves, move);
    walk->at = move.to;
}

static void rapid(Walk *walk, SegVec3 to)
{
    add(walk, (NcMove){.kind = NC_MOVE_RAPID, .to = to});
}

/* With the spindle at rest and the tool at the top of the travel, as the program does it. */
static void change_tool(Walk *walk, int tool)
{
    set_spindle(walk, 0);
    rapid(walk, seg_vec3(walk->at.x, walk->at.y, walk->machine->axis[2].max_mm));
    walk->tool = tool;
    add(walk, (NcMove){.kind = NC_MOVE_TOOL_CHANGE, .to = walk->at});
}

static void set_spindle(Walk *walk, double rpm)
{
    if (rpm == walk->rpm)
        return;
    walk->rpm = rpm;
    add(walk, (NcMove){.kind = NC_MOVE_SPINDLE, .to = walk->at});
}

static void walk_operation(Walk *walk, const NcOperation *operation)
{
    const GArray *locations = operation->path.locations;
    double length = operation->tool->length_mm;
    for (guint i = 0; i < locations->len; i++) {
        const NcLocation *location = &g_array_index(locations, NcLocation, i);
        SegVec3 to = seg_add(location->tip, walk->offset);
        to.z += length;
        if (i == 0)
            rapid(walk, seg_vec3(to.x, to.y, fmax(walk->at.z, to.z)));
        if (location->motion == NC_RAPID) {
            rapid(walk, to);
            continue;
        }
        double feed =
            location->motion == NC_LEAD ? operation->plunge_mm_min : operation->feed_mm_min;
        add(walk, (NcMove){.kind = NC_MOVE_FEED, .to = to, .feed_mm_min = feed});
    }
}
