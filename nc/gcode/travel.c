/* SPDX-License-Identifier: Apache-2.0 */
/* Where a block's moves lead: G0 to G3, probing, and the reference points [NIST 3.5; LinuxCNC 2.9].
 */
#include "nc/gcode/interpreter.h"

/* LinuxCNC's smallest feed with G93, in the program's units. */
#define LEAST_INVERSE_FEED 0.1

/* And what it takes for no way at all. */
#define NOTHING_MM 1e-7

static bool check_rotary(const NcExecution *x, GError **error);
static bool check_feed(const NcExecution *x, GError **error);
static void go_home(NcExecution *x, int parameter);
static void straight(NcExecution *x, NcMoveKind kind, bool machine_coordinates);
static bool arc(NcExecution *x, const NcPlace *to, GError **error);
static bool probe(NcExecution *x, const NcPlace *to, GError **error);
static void find_target(const NcExecution *x, bool machine_coordinates, NcPlace *to);

bool nc_travel(NcExecution *x, GError **error)
{
    const NcBlock *block = x->block;
    const int code = block->by.g[NC_G_NON_MODAL], motion = block->motion;
    const int home = code == 280 || code == 281 ? NC_PARAMETER_HOME : NC_PARAMETER_HOME_2;
    if (!check_rotary(x, error))
        return false;
    if (code == 280 || code == 300)
        go_home(x, home);
    else if (code == 281 || code == 301)
        nc_set_parameters_place(x, home, (NcPlace){x->modal.position, x->modal.position_deg});
    if (motion < 0 || (motion > 0 && !check_feed(x, error)))
        return motion < 0;
    if (motion <= 10) {
        straight(x, motion == 0 ? NC_MOVE_RAPID : NC_MOVE_FEED, code == 530);
        return true;
    }
    NcPlace to;
    find_target(x, false, &to);
    if (nc_is_cycle(motion))
        return nc_run_cycle(x, to.mm, error);
    return nc_is_probe(motion) ? probe(x, &to, error) : arc(x, &to, error);
}

/* ------------------------------------------------------------------------ places */

SegVec3 nc_program_shift(const NcExecution *x)
{
    const NcModal *modal = &x->modal;
    return seg_vec3(modal->work_mm.x + modal->local_mm.x, modal->work_mm.y + modal->local_mm.y,
                    modal->work_mm.z + modal->local_mm.z + modal->tool_length_mm);
}

static SegVec3 rotary_shift(const NcExecution *x)
{
    return seg_add(x->modal.work_deg, x->modal.local_deg);
}

NcPlace nc_program_place(const NcExecution *x)
{
    return (NcPlace){seg_sub(nc_gauge_point(x), nc_program_shift(x)),
                     seg_sub(x->modal.position_deg, rotary_shift(x))};
}

/* Where one axis word leads; an axis without a word stays. */
static double along(const NcBlock *block, char letter, double unit, double here, double base)
{
    const NcWord *word = nc_word(block, letter);
    return word ? word->value * unit + base : here;
}

/* Where only A, B, C are to move X, Y, Z stand, whatever sums of decimal numbers are: F counts
 * otherwise. */
static double rounded(double to, double here)
{
    return fabs(to - here) < NOTHING_MM ? here : to;
}

static void find_target(const NcExecution *x, bool machine_coordinates, NcPlace *to)
{
    const NcModal *modal = &x->modal;
    const NcBlock *block = x->block;
    const bool incremental = modal->incremental && !machine_coordinates;
    const double unit = modal->unit_mm;
    const SegVec3 *at = &modal->position, none = {0.0, 0.0, 0.0};
    const SegVec3 base = incremental ? *at : machine_coordinates ? none : nc_program_shift(x);
    to->mm.x = along(block, 'X', unit, at->x, base.x);
    to->mm.y = along(block, 'Y', unit, at->y, base.y);
    to->mm.z = along(block, 'Z', unit, at->z, base.z);
    to->deg = modal->position_deg;
    if (block->by.letters & NC_ROTARY_AXES) {
        to->mm =
            (SegVec3){rounded(to->mm.x, at->x), rounded(to->mm.y, at->y), rounded(to->mm.z, at->z)};
        const SegVec3 zero = incremental ? to->deg : machine_coordinates ? none : rotary_shift(x);
        to->deg.x = along(block, 'A', 1.0, to->deg.x, zero.x);
        to->deg.y = along(block, 'B', 1.0, to->deg.y, zero.y);
        to->deg.z = along(block, 'C', 1.0, to->deg.z, zero.z);
    }
}

/* ------------------------------------------------------------------------- checks */

static bool check_rotary(const NcExecution *x, GError **error)
{
    if (!(x->block->by.letters & NC_ROTARY_AXES))
        return true;
    for (int i = 0; i < 3; i++) {
        const NcWord *word = nc_word(x->block, (char)('A' + i));
        if (word && !x->machine->rotary[i].present)
            return nc_word_error(error, x->modal.line, word,
                                 "needs an axis %c, which the machine file does not have", 'A' + i);
    }
    return true;
}

static bool check_feed(const NcExecution *x, GError **error)
{
    const NcModal *modal = &x->modal;
    const NcWord *word = nc_motion_word(x->block);
    const bool path = x->block->motion <= 30;
    if (modal->feed_mode == NC_FEED_INVERSE) {
        const NcWord *f = nc_word(x->block, 'F');
        if (!path)
            return nc_word_error(error, modal->line, word, "cannot be used with G93");
        return (f && f->value > 0.0) ||
               nc_word_error(error, modal->line, word, "needs an F word in each block with G93");
    }
    if (!(modal->feed_mm > 0.0))
        return nc_word_error(error, modal->line, word, "needs a feed: add an F word above 0");
    if (modal->feed_mode == NC_FEED_A_MINUTE)
        return true;
    if (nc_is_probe(x->block->motion))
        return nc_word_error(error, modal->line, word, "cannot be used with G95");
    return (modal->spindle != 0 && modal->speed > 0.0) ||
           nc_word_error(error, modal->line, word,
                         "needs the spindle turning: with G95 the feed follows it");
}

/* -------------------------------------------------------------------------- paths */

/* And so the machine. */
static void end_at(NcExecution *x, NcMove *move, const NcPlace *to)
{
    move->to = x->modal.position = to->mm;
    x->modal.position_deg = to->deg;
    move->to_deg[0] = to->deg.x;
    move->to_deg[1] = to->deg.y;
    move->to_deg[2] = to->deg.z;
    if (x->modal.surface_speed)
        nc_move_speeds(x, move);
}

static NcMove *go_to(NcExecution *x, NcMoveKind kind, const NcPlace *to)
{
    NcMove *made = nc_append_move(x, kind);
    end_at(x, made, to);
    return made;
}

static bool moves_mm(const NcMove *move)
{
    return move->kind == NC_MOVE_ARC || seg_distance(move->from, move->to) > 0.0;
}

/* In mm, or in degrees; of an arc, as LinuxCNC has it, by the radius where it begins. */
static double length_of(const NcMove *move, bool mm)
{
    const double *a = move->from_deg, *b = move->to_deg;
    if (move->kind == NC_MOVE_ARC) {
        const NcArc arc = nc_arc(move);
        return hypot(arc.radius_from_mm * arc.sweep_rad, arc.rise_mm);
    }
    return mm ? seg_distance(move->from, move->to)
              : hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]);
}

/* F counts along X, Y, Z; in degrees where only A, B, C move [LinuxCNC 2.9, "Feed Rate"]; with G93
 * it says how often in a minute the move could be made. */
static void set_feed(const NcExecution *x, NcMove *move)
{
    const NcModal *modal = &x->modal;
    const bool mm = moves_mm(move);
    const double *a = move->from_deg, *b = move->to_deg;
    const bool turns = a[0] != b[0] || a[1] != b[1] || a[2] != b[2];
    if (modal->feed_mode == NC_FEED_INVERSE) {
        const double least = LEAST_INVERSE_FEED * (mm || !turns ? modal->unit_mm : 1.0);
        move->feed_mm_min = MAX(length_of(move, mm) * nc_word(x->block, 'F')->value, least);
    } else if (turns && !mm && !x->compensation->away) {
        move->feed_mm_min = modal->feed_deg;
        if (modal->feed_mode == NC_FEED_A_TURN)
            move->feed_mm_min *= fabs(move->spindle_rpm);
    }
}

/* A feed that depends on where the move leads. */
static void set_own_feed(const NcExecution *x, NcMove *move)
{
    if (move->kind != NC_MOVE_RAPID &&
        (x->modal.feed_mode == NC_FEED_INVERSE || (x->block->by.letters & NC_ROTARY_AXES)))
        set_feed(x, move);
}

static void straight(NcExecution *x, NcMoveKind kind, bool machine_coordinates)
{
    NcPlace to;
    find_target(x, machine_coordinates, &to);
    NcMove *made = go_to(x, kind, &to);
    made->machine_coordinates = machine_coordinates;
    set_own_feed(x, made);
}

static bool arc(NcExecution *x, const NcPlace *to, GError **error)
{
    const NcBlock *block = x->block;
    const NcWord *p = nc_word(block, 'P');
    const int turns = p ? (int)p->value : 1;
    SegVec3 centre;
    if (!nc_arc_centre(block, &x->modal, x->modal.position, to->mm, nc_program_shift(x), &centre,
                       error))
        return false;
    NcMove *made = go_to(x, NC_MOVE_ARC, to);
    made->centre = centre;
    made->turn = block->motion == 30 ? turns : -turns;
    set_own_feed(x, made);
    return true;
}

/* G28 and G30: by way of the point named, then home with the axes named; with all where none is.
 * LinuxCNC goes to that point even where none is named, so two moves it always is. */
static void go_home(NcExecution *x, int parameter)
{
    const bool some = x->block->by.letters & NC_AXES;
    NcPlace place = nc_parameters_place(x, parameter), home;
    find_target(x, false, &home);
    go_to(x, NC_MOVE_RAPID, &home)->machine_coordinates = !some;
    for (int axis = 0; axis < 6; axis++) {
        const bool there = axis < 3 || x->machine->rotary[axis - 3].present;
        if (there && (!some || nc_word(x->block, nc_axis_letter(axis))))
            *nc_place_axis(&home, axis) = *nc_place_axis(&place, axis);
    }
    go_to(x, NC_MOVE_RAPID, &home)->machine_coordinates = true;
}

/* ------------------------------------------------------------------------- probing */

/* #5061 to #5066: where it touched, in the program's coordinates and units; #5070: whether. */
static void set_probed(NcExecution *x, bool touched)
{
    NcPlace at = nc_program_place(x);
    for (int axis = 0; axis < 6; axis++)
        nc_set_parameter(x, NC_PARAMETER_PROBED + axis,
                         *nc_place_axis(&at, axis) / (axis < 3 ? x->modal.unit_mm : 1.0));
    for (int index = NC_PARAMETER_PROBED + 6; index < NC_PARAMETER_TOUCHED; index++)
        nc_set_parameter(x, index, 0.0);
    nc_set_parameter(x, NC_PARAMETER_TOUCHED, touched);
}

/* G38.2 and G38.4 have to find what they look for; G38.4 and G38.5 go away from it. */
static bool probe(NcExecution *x, const NcPlace *to, GError **error)
{
    const int code = x->block->motion;
    const bool must = code == 382 || code == 384, away = code >= 384;
    const NcPlace from = {x->modal.position, x->modal.position_deg};
    const double length = seg_distance(from.mm, to->mm);
    const NcWord *word = nc_motion_word(x->block);
    if (must && length == 0.0 && seg_distance(from.deg, to->deg) == 0.0)
        return nc_word_error(error, x->modal.line, word,
                             "begins where it ends: there is nothing to probe");
    NcMove *made = go_to(x, NC_MOVE_PROBE, to);
    set_own_feed(x, made);
    SegVec3 where = to->mm;
    const bool touched = x->probe && x->probe(made, away, &where, x->probe_data);
    if (x->probe && must && !touched)
        return nc_word_error(error, x->modal.line, word, "%s",
                             away ? "came to its end and is still in touch with the work"
                                  : "came to its end and touched nothing");
    if (touched && length > 0.0) {
        const double part = seg_distance(from.mm, where) / length;
        end_at(x, made, &(NcPlace){where, seg_lerp(from.deg, to->deg, part)});
    }
    set_probed(x, touched);
    return true;
}
