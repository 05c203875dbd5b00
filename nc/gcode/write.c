/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plan as one program.
 *
 * Ways between regions are safe whatever the machine did before: the program begins, changes tools
 * and ends at the top of the Z travel, G53 G0 Z…, which depends on no offset, no tool length and,
 * unlike G28, on no position stored in the controller where nobody reading the program sees it.
 * From there the tool goes to its place first, then down, with the spindle turning. A rapid that
 * changes height too is split in two, so that a machine that drives each axis at its own speed
 * keeps clear as well.
 */
#include "nc/gcode/dialect.h"
#include "nc/gcode/text.h"
#include "nc/motion/path.h"

#include <string.h>

enum { FEWEST_DECIMALS = 3, MOST_DECIMALS = 6, SPEED_DECIMALS = 3, TOLERANCE_DECIMALS = 6 };

typedef struct {
    NcText text;
    GArray *gates; /* uint64_t */
    const CfgMachine *machine;
    const NcDialect *dialect;
    const NcOperation *operation;
    const double *offset_mm;        /* of the work coordinate system */
    int decimals;                   /* of a coordinate */
    double low_mm[3], high_mm[3];   /* where the operation's tool may go */
    int64_t at[3], clearance, feed; /* last ones written; feed in 10^-SPEED_DECIMALS */
    bool known[3];                  /* whether `at` is */
    int motion;                     /* 0, 1; -1: none yet */
    int tool;
    double spindle_rpm;
    bool clear; /* of the part: at clearance height or above */
} Writer;

static bool write_preamble(Writer *w, const NcPlan *plan, const CfgRecipe *recipe,
                           char *const *header, GError **error);
static bool write_operation(Writer *w, const NcOperation *operation, GError **error);
static void write_end(Writer *w);

/* Coordinates are rounded within their share of the tolerance: half a step on three axes. */
static int coordinate_decimals(double rounding_mm)
{
    int decimals = FEWEST_DECIMALS;
    while (decimals < MOST_DECIMALS && 0.5 * sqrt(3.0) * pow(10.0, -decimals) > rounding_mm)
        decimals++;
    return decimals;
}

NcProgram *nc_program_write(const NcPlan *plan, const CfgRecipe *recipe, const CfgMachine *machine,
                            char *const *header, GError **error)
{
    const NcDialect *dialect = nc_dialect(machine->dialect, error);
    if (!dialect)
        return NULL;
    Writer w = {
        .gates = g_array_new(FALSE, FALSE, sizeof(uint64_t)),
        .machine = machine,
        .dialect = dialect,
        .offset_mm = machine->work_offset_mm[recipe->wcs - 54],
        .decimals = coordinate_decimals(plan->budget.rounding_mm),
        .motion = -1,
    };
    w.clearance = nc_text_scaled(plan->clearance_mm, w.decimals);
    bool good = write_preamble(&w, plan, recipe, header, error);
    for (size_t i = 0; good && i < plan->n_operations; i++)
        good = write_operation(&w, &plan->operations[i], error);
    NcProgram *program = NULL;
    if (good) {
        write_end(&w);
        g_autoptr(GBytes) bytes = nc_text_steal(&w.text);
        program = nc_program_new(bytes, (const uint64_t *)(void *)w.gates->data, w.gates->len);
    }
    nc_text_clear(&w.text);
    g_array_unref(w.gates);
    return program;
}

static void gate(Writer *w)
{
    uint64_t offset = w->text.length;
    g_array_append_val(w->gates, offset);
}

/* Marks where the tool comes clear of the part. Where Z is not known it is at the top. */
static void watch_height(Writer *w)
{
    bool clear = !w->known[2] || w->at[2] >= w->clearance;
    if (clear && !w->clear)
        gate(w);
    w->clear = clear;
}

/* ------------------------------------------------------------ beginning and end */

/* To the top of the Z travel, which is written so that rounding stays within it. */
static void write_top(Writer *w)
{
    double top = floor(w->machine->axis[2].max_mm * nc_text_power[w->decimals] + 1e-3);
    nc_text_put(&w->text, "G53 G0 ");
    nc_text_word(&w->text, 'Z', (int64_t)top, w->decimals);
    nc_text_put(&w->text, "\n");
    w->motion = 0;
    w->known[2] = false;
    watch_height(w);
}

static bool write_preamble(Writer *w, const NcPlan *plan, const CfgRecipe *recipe,
                           char *const *header, GError **error)
{
    double blend = plan->budget.blend_mm;
    int64_t tolerance = (int64_t)floor(blend * nc_text_power[TOLERANCE_DECIMALS] + 1e-3);
    if (tolerance < 1) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "the tolerance leaves %g mm for corners, too little to write: raise "
                    "quality.tolerance_mm",
                    blend);
        return false;
    }
    for (char *const *line = header; line && *line; line++)
        nc_text_comment(&w->text, *line);
    nc_text_put(&w->text, w->dialect->preamble);
    nc_text_word(&w->text, 'P', tolerance, TOLERANCE_DECIMALS);
    nc_text_printf(&w->text, "\nG%d\n", recipe->wcs);
    write_top(w);
    return true;
}

static void write_spindle_off(Writer *w)
{
    if (w->spindle_rpm != 0.0) {
        nc_text_put(&w->text, "M5\n");
        w->spindle_rpm = 0.0;
    }
}

static void write_end(Writer *w)
{
    write_spindle_off(w);
    nc_text_put(&w->text, "M9\n");
    write_top(w);
    nc_text_put(&w->text, w->dialect->end);
    gate(w);
}

/* ------------------------------------------------------------------------ moves */

static void write_word(Writer *w, size_t begun, char letter, int64_t value, int decimals)
{
    if (w->text.length > begun)
        nc_text_put(&w->text, " ");
    nc_text_word(&w->text, letter, value, decimals);
}

/* A block of G0 or G1 with the first `axes` axes of `to`; nothing where none changes. */
static void write_block(Writer *w, int motion, const int64_t to[3], int axes, int64_t feed)
{
    NcText *text = &w->text;
    size_t begun = text->length;
    bool moves = false, changed[3];
    for (int axis = 0; axis < axes; axis++) {
        changed[axis] = !w->known[axis] || to[axis] != w->at[axis];
        moves = moves || changed[axis];
    }
    if (!moves)
        return;
    if (motion != w->motion)
        nc_text_put(text, motion == 0 ? "G0" : "G1");
    w->motion = motion;
    for (int axis = 0; axis < axes; axis++) {
        if (changed[axis])
            write_word(w, begun, (char)('X' + axis), to[axis], w->decimals);
        w->at[axis] = to[axis];
        w->known[axis] = true;
    }
    if (motion == 1 && feed != w->feed) {
        write_word(w, begun, 'F', feed, SPEED_DECIMALS);
        w->feed = feed;
    }
    nc_text_put(text, "\n");
    watch_height(w);
}

/* Up first and then across, or across first and then down; from the top it is down. */
static void write_rapid(Writer *w, const int64_t to[3])
{
    if (w->known[2] && to[2] > w->at[2]) {
        const int64_t above[3] = {w->at[0], w->at[1], to[2]};
        write_block(w, 0, above, 3, 0);
    }
    write_block(w, 0, to, 2, 0);
    write_block(w, 0, to, 3, 0);
}

static bool outside(const Writer *w, SegVec3 tip, int axis, GError **error)
{
    const CfgAxis *travel = &w->machine->axis[axis];
    double value = nc_axis_value(tip, axis) + w->offset_mm[axis] +
                   (axis == 2 ? w->operation->tool->length_mm : 0.0);
    g_set_error(error, NC_ERROR, NC_ERROR_LIMIT,
                "region %d: %c would go to %.4f mm in machine coordinates with tool %d; the "
                "machine's travel is %.10g to %.10g mm: move the work offset, use another tool or "
                "a lower clearance",
                w->operation->region, 'X' + axis, value, w->operation->tool->number, travel->min_mm,
                travel->max_mm);
    return false;
}

static bool scale_point(const Writer *w, SegVec3 tip, int64_t to[3], GError **error)
{
    const double value[3] = {tip.x, tip.y, tip.z};
    for (int axis = 0; axis < 3; axis++) {
        if (!(value[axis] >= w->low_mm[axis] && value[axis] <= w->high_mm[axis]))
            return outside(w, tip, axis, error);
        to[axis] = nc_text_scaled(value[axis], w->decimals);
    }
    return true;
}

/* ------------------------------------------------------------------- operations */

/* What the machine's travel leaves for the tip, in program coordinates, after rounding. */
static void set_range(Writer *w, const NcOperation *operation)
{
    double scale = nc_text_power[w->decimals];
    for (int axis = 0; axis < 3; axis++) {
        const CfgAxis *travel = &w->machine->axis[axis];
        double shift = w->offset_mm[axis] + (axis == 2 ? operation->tool->length_mm : 0.0);
        w->low_mm[axis] = ceil((travel->min_mm - shift) * scale - 1e-3) / scale - 1e-9;
        w->high_mm[axis] = floor((travel->max_mm - shift) * scale + 1e-3) / scale + 1e-9;
    }
}

static bool check_operation(const Writer *w, const NcOperation *operation, GError **error)
{
    double rpm = operation->spindle_rpm;
    if (operation->path.locations->len == 0) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN, "region %d has no moves", operation->region);
        return false;
    }
    if (!(rpm >= w->machine->spindle_min_rpm && rpm <= w->machine->spindle_max_rpm && rpm > 0.0)) {
        g_set_error(error, NC_ERROR, NC_ERROR_LIMIT,
                    "region %d: the spindle cannot turn at %g rev/min: the machine runs from %g to "
                    "%g",
                    operation->region, rpm, w->machine->spindle_min_rpm,
                    w->machine->spindle_max_rpm);
        return false;
    }
    if (!(fmin(operation->feed_mm_min, operation->plunge_mm_min) >= 1e-3)) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "region %d: feeds of %g and %g mm/min are too small to write",
                    operation->region, operation->feed_mm_min, operation->plunge_mm_min);
        return false;
    }
    return true;
}

static void write_tool(Writer *w, const NcOperation *operation)
{
    int number = operation->tool->number;
    if (number != w->tool) {
        write_spindle_off(w);
        if (w->known[2])
            write_top(w);
        nc_text_printf(&w->text, w->dialect->tool_change, number);
        nc_text_printf(&w->text, w->dialect->tool_length, number);
        w->tool = number;
    }
    if (operation->spindle_rpm != w->spindle_rpm) {
        nc_text_word(&w->text, 'S', nc_text_scaled(operation->spindle_rpm, SPEED_DECIMALS),
                     SPEED_DECIMALS);
        nc_text_put(&w->text, " M3\n");
        w->spindle_rpm = operation->spindle_rpm;
    }
}

/* Above the first place, then down to the clearance height. */
static bool write_approach(Writer *w, SegVec3 first, GError **error)
{
    int64_t to[3];
    first.z = (double)w->clearance / nc_text_power[w->decimals];
    if (!scale_point(w, first, to, error))
        return false;
    write_rapid(w, to);
    return true;
}

static void write_opening(Writer *w, const NcOperation *operation)
{
    nc_text_printf(&w->text, "(REGION %d %s tool=%d feed=%.10g)\n", operation->region,
                   seg_region_kind_name(operation->kind), operation->tool->number,
                   operation->feed_mm_min);
    write_tool(w, operation);
}

static bool write_operation(Writer *w, const NcOperation *operation, GError **error)
{
    const GArray *locations = operation->path.locations;
    w->operation = operation;
    set_range(w, operation);
    if (!check_operation(w, operation, error))
        return false;
    write_opening(w, operation);
    if (!write_approach(w, g_array_index(locations, NcLocation, 0).tip, error))
        return false;
    int64_t feed = nc_text_scaled(operation->feed_mm_min, SPEED_DECIMALS);
    int64_t plunge = nc_text_scaled(operation->plunge_mm_min, SPEED_DECIMALS);
    int64_t to[3];
    for (guint i = 0; i < locations->len; i++) {
        const NcLocation *location = &g_array_index(locations, NcLocation, i);
        if (location->axis.z < 1.0 - 1e-9) {
            g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                        "region %d: a tilted tool axis cannot be written for three axes",
                        operation->region);
            return false;
        }
        if (!scale_point(w, location->tip, to, error))
            return false;
        if (location->motion == NC_RAPID)
            write_rapid(w, to);
        else
            write_block(w, 1, to, 3, location->motion == NC_LEAD ? plunge : feed);
    }
    to[2] = MAX(to[2], w->clearance);
    write_rapid(w, to);
    return true;
}
