/* SPDX-License-Identifier: Apache-2.0 */
/* Canned cycles G73 and G81 to G89 as moves [NIST 3.5.16; LinuxCNC 2.9]: to above the hole, to
 * the R plane, the hole, and back to the R plane (G99) or to where the cycles began (G98). */
#include "nc/gcode/interpreter.h"

/* LinuxCNC: how far before the last depth G83 ends its rapid, and how far G73 goes back. */
#define PECK_CLEARANCE_MM 0.254

/* Of one block: more nobody means, and they would fill the memory. */
#define MOST_PECKS 100000.0

/* Along the plane's normal, machine coordinates. */
typedef struct {
    NcPlaneAxes axes;
    int normal;
    double r, bottom, clear;
    double top; /* G87: of the counterbore */
} Hole;

static void drill(NcExecution *x, const Hole *hole);

static void go_to(NcExecution *x, NcMoveKind kind, SegVec3 to)
{
    NcMove *made = nc_append_move(x, kind);
    made->to = x->modal.position = to;
    if (x->modal.surface_speed)
        nc_move_speeds(x, made);
}

static void go(NcExecution *x, NcMoveKind kind, int axis, double value)
{
    SegVec3 to = x->modal.position;
    *nc_axis(&to, axis) = value;
    go_to(x, kind, to);
}

/* A word of the block, or the same cycle's last one. */
static bool keep_word(NcExecution *x, char letter, double unit, double *kept, GError **error)
{
    const NcWord *word = nc_word(x->block, letter);
    if (word)
        *kept = word->value * unit;
    return !isnan(*kept) ||
           nc_word_error(error, x->modal.line, nc_motion_word(x->block), "needs a %c word", letter);
}

static bool keep_words(NcExecution *x, int normal, GError **error)
{
    NcModal *modal = &x->modal;
    int code = x->block->motion;
    double dwell_s = modal->cycle.dwell_s;
    if (modal->cycle.code != code)
        modal->cycle =
            (NcCycle){code, NAN, NAN, NAN, code == 840 ? dwell_s : (double)NAN, {NAN, NAN, NAN}};
    NcCycle *cycle = &modal->cycle;
    double unit = modal->unit_mm;
    if (!keep_word(x, (char)('X' + normal), unit, &cycle->bottom_mm, error) ||
        !keep_word(x, 'R', unit, &cycle->r_mm, error))
        return false;
    for (int i = 0; code == 870 && i < 3; i++)
        if (!keep_word(x, (char)('I' + i), unit, &cycle->offset_mm[i], error))
            return false;
    if ((code == 820 || code == 860 || code == 880 || code == 890) &&
        !keep_word(x, 'P', 1.0, &cycle->dwell_s, error))
        return false;
    if (code == 840 && nc_word(x->block, 'P'))
        cycle->dwell_s = nc_word(x->block, 'P')->value;
    if (code != 730 && code != 830)
        return true;
    if (!keep_word(x, 'Q', unit, &cycle->peck_mm, error))
        return false;
    return cycle->peck_mm > 0.0 || nc_word_error(error, modal->line, nc_word(x->block, 'Q'),
                                                 "must be above 0: the depth of a peck");
}

static bool check_spindle(const NcExecution *x, GError **error)
{
    int code = x->block->motion;
    if (code == 840 && x->modal.spindle <= 0)
        return nc_word_error(error, x->modal.line, nc_motion_word(x->block),
                             "needs the spindle turning clockwise (M3)");
    if (code >= 860 && code <= 880 && x->modal.spindle == 0)
        return nc_word_error(error, x->modal.line, nc_motion_word(x->block),
                             "needs the spindle turning");
    return true;
}

/* Where the words lead; with G91 the R plane counts from where the tool is, the bottom from R. */
static bool find_hole(NcExecution *x, NcPlaneAxes axes, double level, Hole *hole, GError **error)
{
    const NcModal *modal = &x->modal;
    SegVec3 shift = nc_program_shift(x);
    double base = modal->incremental ? level : nc_axis_value(shift, axes.normal);
    hole->axes = axes;
    hole->normal = axes.normal;
    hole->r = base + modal->cycle.r_mm;
    hole->bottom = (modal->incremental ? hole->r : base) + modal->cycle.bottom_mm;
    hole->top = (modal->incremental ? hole->bottom : base) + modal->cycle.offset_mm[axes.normal];
    return hole->r >= hole->bottom || nc_word_error(error, modal->line, nc_motion_word(x->block),
                                                    "has its R plane below the bottom of the hole");
}

static bool check_count(const NcExecution *x, const Hole *hole, double repeats, GError **error)
{
    const NcCycle *cycle = &x->modal.cycle;
    double pecks = isnan(cycle->peck_mm) ? 1.0 : ceil((hole->r - hole->bottom) / cycle->peck_mm);
    return repeats * fmax(pecks, 1.0) <= MOST_PECKS ||
           nc_word_error(error, x->modal.line, nc_motion_word(x->block),
                         "would go into the hole %.0f times: at most %.0f are read",
                         repeats * pecks, MOST_PECKS);
}

bool nc_run_cycle(NcExecution *x, SegVec3 target, GError **error)
{
    NcModal *modal = &x->modal;
    NcPlaneAxes axes = nc_plane_axes(modal->plane);
    double here = nc_axis_value(modal->position, axes.normal);
    const NcWord *l = nc_word(x->block, 'L');
    Hole hole;
    if (!keep_words(x, axes.normal, error) || !check_spindle(x, error))
        return false;
    double shift = nc_axis_value(nc_program_shift(x), axes.normal);
    if (isnan(modal->cycle_level_mm))
        modal->cycle_level_mm = here - shift;
    double begun = modal->cycle_level_mm + shift;
    double level = modal->retract_r ? here : fmax(here, begun);
    if (!find_hole(x, axes, level, &hole, error) ||
        !check_count(x, &hole, l ? l->value : 1.0, error))
        return false;
    if (level < hole.r)
        go(x, NC_MOVE_RAPID, axes.normal, level = hole.r);
    hole.clear = modal->retract_r ? hole.r : fmax(begun, hole.r);
    double tolerance = modal->tolerance_mm;
    bool exact_stop = modal->exact_stop;
    modal->tolerance_mm = 0.0;
    modal->exact_stop = false;
    SegVec3 step = seg_sub(target, modal->position);
    for (int i = 0; i < (l ? (int)l->value : 1); i++) {
        if (i > 0 && modal->incremental)
            target = seg_add(modal->position, step);
        *nc_axis(&target, axes.normal) = level;
        go_to(x, NC_MOVE_RAPID, target);
        if (level != hole.r)
            go(x, NC_MOVE_RAPID, axes.normal, hole.r);
        drill(x, &hole);
        level = hole.clear;
    }
    modal->tolerance_mm = tolerance;
    modal->exact_stop = exact_stop;
    return true;
}

/* ------------------------------------------------------------------- in the hole */

static void turn(NcExecution *x, int direction)
{
    x->modal.spindle = direction;
    nc_append_move(x, NC_MOVE_SPINDLE);
}

static void dwell(NcExecution *x)
{
    double seconds = x->modal.cycle.dwell_s;
    nc_append_move(x, NC_MOVE_DWELL)->dwell_s = isnan(seconds) ? 0.0 : seconds;
}

static void peck(NcExecution *x, const Hole *hole)
{
    double peck_mm = x->modal.cycle.peck_mm;
    for (double depth = hole->r - peck_mm; depth > hole->bottom; depth -= peck_mm) {
        go(x, NC_MOVE_FEED, hole->normal, depth);
        if (x->block->motion == 830)
            go(x, NC_MOVE_RAPID, hole->normal, hole->r);
        go(x, NC_MOVE_RAPID, hole->normal, depth + PECK_CLEARANCE_MM);
    }
}

/* What a person turns does not count meanwhile. */
static void tap(NcExecution *x, const Hole *hole)
{
    NcModal *modal = &x->modal;
    const bool feed_off = modal->feed_override_off, spindle_off = modal->spindle_override_off;
    modal->feed_override_off = modal->spindle_override_off = true;
    go(x, NC_MOVE_FEED, hole->normal, hole->bottom);
    turn(x, 0);
    turn(x, -1);
    dwell(x);
    go(x, NC_MOVE_FEED, hole->normal, hole->clear);
    turn(x, 0);
    turn(x, 1);
    modal->feed_override_off = feed_off;
    modal->spindle_override_off = spindle_off;
}

static void bore(NcExecution *x, const Hole *hole)
{
    int direction = x->modal.spindle;
    dwell(x);
    turn(x, 0);
    go(x, NC_MOVE_RAPID, hole->normal, hole->clear);
    turn(x, direction);
}

/* The person at the machine retracts the tool while it stands. */
static void bore_by_hand(NcExecution *x, const Hole *hole)
{
    int direction = x->modal.spindle;
    dwell(x);
    turn(x, 0);
    go(x, NC_MOVE_STOP, hole->normal, hole->clear);
    turn(x, direction);
}

static void stop_turned(NcExecution *x)
{
    turn(x, 0);
    nc_append_move(x, NC_MOVE_ORIENT)->orient = (NcOrient){0.0, 0, 0.0};
}

/* Through the hole beside its axis, with the spindle standing, and up from below. */
static void bore_back(NcExecution *x, const Hole *hole)
{
    int direction = x->modal.spindle;
    const SegVec3 centre = x->modal.position;
    const double *offset = x->modal.cycle.offset_mm;
    SegVec3 beside = centre, below = centre;
    *nc_axis(&beside, hole->axes.first) += offset[hole->axes.first];
    *nc_axis(&beside, hole->axes.second) += offset[hole->axes.second];
    *nc_axis(&below, hole->normal) = hole->bottom;
    go_to(x, NC_MOVE_RAPID, beside);
    stop_turned(x);
    go(x, NC_MOVE_RAPID, hole->normal, hole->bottom);
    go_to(x, NC_MOVE_RAPID, below);
    turn(x, direction);
    go(x, NC_MOVE_FEED, hole->normal, hole->top);
    go(x, NC_MOVE_FEED, hole->normal, hole->bottom);
    stop_turned(x);
    *nc_axis(&beside, hole->normal) = hole->bottom;
    go_to(x, NC_MOVE_RAPID, beside);
    go(x, NC_MOVE_RAPID, hole->normal, hole->clear);
    *nc_axis(&below, hole->normal) = hole->clear;
    go_to(x, NC_MOVE_RAPID, below);
    turn(x, direction);
}

static void drill(NcExecution *x, const Hole *hole)
{
    int code = x->block->motion;
    if (code == 840) {
        tap(x, hole);
        return;
    }
    if (code == 870) {
        bore_back(x, hole);
        return;
    }
    if (code == 730 || code == 830)
        peck(x, hole);
    go(x, NC_MOVE_FEED, hole->normal, hole->bottom);
    if (code == 860) {
        bore(x, hole);
    } else if (code == 880) {
        bore_by_hand(x, hole);
    } else {
        if (code == 820 || code == 890)
            dwell(x);
        if (code == 850)
            go(x, NC_MOVE_FEED, hole->normal, hole->r);
        go(x, code == 890 ? NC_MOVE_FEED : NC_MOVE_RAPID, hole->normal, hole->clear);
    }
}
