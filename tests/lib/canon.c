/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/canon.h"

#include <math.h>
#include <string.h>

#include "tests/lib/gcode.h"

enum { MAX_NUMBERS = 12 };

/* State of LinuxCNC's canonical machine. */
typedef struct {
    const CfgMachine *machine;
    double unit_mm;
    SegVec3 work, local, tool;
    SegVec3 work_deg, local_deg;
    int plane;
    double feed_mm, feed_deg, speed, surface_mm_min;
    double most_rpm; /* with G96; 0: G97 */
    bool per_turn;
    int direction, tool_number;
    bool mist, flood, exact_stop, feed_override_off, spindle_override_off, adaptive;
    double tolerance_mm;
    SegVec3 at, at_deg;
    GArray *moves; /* NcMove */
    GPtrArray *texts;
} Canon;

typedef struct {
    const char *name, *arguments;
    double n[MAX_NUMBERS];
} Call;

static bool set_offsets(Canon *canon, const Call *call);
static bool set_speeds(Canon *canon, const Call *call);
static bool set_modes(Canon *canon, const Call *call);
static bool act(Canon *canon, const Call *call);
static bool travel(Canon *canon, const Call *call);
static bool means_nothing(const char *name);

static void numbers_of(const char *text, double numbers[MAX_NUMBERS])
{
    int n = 0;
    for (const char *at = text; *at && n < MAX_NUMBERS;) {
        char *end;
        numbers[n] = g_ascii_strtod(at, &end);
        n += end > at;
        at = end > at ? end : at + 1;
    }
}

static bool is_name(const char *name)
{
    return *name && strspn(name, "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.") == strlen(name);
}

GArray *canon_read(const char *calls, const CfgMachine *machine, GPtrArray *texts)
{
    Canon canon = {.machine = machine,
                   .unit_mm = 1.0,
                   .plane = 17,
                   .tolerance_mm = INFINITY,
                   .moves = g_array_new(FALSE, FALSE, sizeof(NcMove)),
                   .texts = texts};
    g_auto(GStrv) lines = g_strsplit(calls, "\n", -1);
    for (char **line = lines; *line; line++) {
        char *open = strchr(*line, '(');
        if (!open)
            continue;
        *open = '\0';
        char *blank = strrchr(*line, ' ');
        Call call = {.name = blank ? blank + 1 : *line, .arguments = open + 1};
        if (!is_name(call.name))
            continue;
        numbers_of(call.arguments, call.n);
        if (!(set_offsets(&canon, &call) || set_speeds(&canon, &call) || set_modes(&canon, &call) ||
              travel(&canon, &call) || act(&canon, &call) || means_nothing(call.name))) {
            g_test_message("LinuxCNC calls %s, which nothing here knows", call.name);
            g_test_fail();
        }
    }
    return canon.moves;
}

/* ------------------------------------------------------------------------- states */

static bool is(const Call *call, const char *name)
{
    return strcmp(call->name, name) == 0;
}

static bool set_offsets(Canon *canon, const Call *call)
{
    const double *n = call->n;
    if (is(call, "USE_LENGTH_UNITS")) {
        canon->unit_mm = strstr(call->arguments, "INCHES") ? 25.4 : 1.0;
    } else if (is(call, "SET_G5X_OFFSET")) {
        canon->work = seg_scale(seg_vec3(n[1], n[2], n[3]), canon->unit_mm);
        canon->work_deg = seg_vec3(n[4], n[5], n[6]);
    } else if (is(call, "SET_G92_OFFSET")) {
        canon->local = seg_scale(seg_vec3(n[0], n[1], n[2]), canon->unit_mm);
        canon->local_deg = seg_vec3(n[3], n[4], n[5]);
    } else if (is(call, "USE_TOOL_LENGTH_OFFSET")) {
        canon->tool = seg_scale(seg_vec3(n[0], n[1], n[2]), canon->unit_mm);
    } else {
        return false;
    }
    return true;
}

static bool set_speeds(Canon *canon, const Call *call)
{
    const double *n = call->n;
    if (is(call, "SET_FEED_RATE")) {
        canon->feed_mm = n[0] * canon->unit_mm;
        canon->feed_deg = n[0];
    } else if (is(call, "SET_FEED_MODE")) {
        canon->per_turn = n[1] != 0.0;
    } else if (is(call, "SET_SPINDLE_SPEED")) {
        canon->speed = n[1];
        canon->surface_mm_min = n[1] * (canon->unit_mm == 1.0 ? 1000.0 : 304.8);
    } else if (is(call, "SET_SPINDLE_MODE")) {
        canon->most_rpm = n[1];
    } else if (is(call, "START_SPINDLE_CLOCKWISE")) {
        canon->direction = 1;
    } else if (is(call, "START_SPINDLE_COUNTERCLOCKWISE")) {
        canon->direction = -1;
    } else if (is(call, "STOP_SPINDLE_TURNING")) {
        canon->direction = 0;
    } else {
        return false;
    }
    return true;
}

static bool set_modes(Canon *canon, const Call *call)
{
    if (is(call, "SELECT_PLANE")) {
        canon->plane = strstr(call->arguments, "XY") ? 17 : strstr(call->arguments, "XZ") ? 18 : 19;
    } else if (is(call, "SET_MOTION_CONTROL_MODE")) {
        const bool blends = strstr(call->arguments, "CONTINUOUS");
        const double tolerance = call->n[0] * canon->unit_mm;
        canon->exact_stop = strstr(call->arguments, "STOP");
        canon->tolerance_mm = !blends ? 0.0 : tolerance > 0.0 ? tolerance : INFINITY;
    } else if (is(call, "ENABLE_FEED_OVERRIDE") || is(call, "DISABLE_FEED_OVERRIDE")) {
        canon->feed_override_off = *call->name == 'D';
    } else if (is(call, "ENABLE_SPEED_OVERRIDE") || is(call, "DISABLE_SPEED_OVERRIDE")) {
        canon->spindle_override_off = *call->name == 'D';
    } else if (is(call, "ENABLE_ADAPTIVE_FEED") || is(call, "DISABLE_ADAPTIVE_FEED")) {
        canon->adaptive = *call->name == 'E';
    } else if (is(call, "MIST_ON") || is(call, "MIST_OFF")) {
        canon->mist = is(call, "MIST_ON");
    } else if (is(call, "FLOOD_ON") || is(call, "FLOOD_OFF")) {
        canon->flood = is(call, "FLOOD_ON");
    } else {
        return false;
    }
    return true;
}

static bool means_nothing(const char *name)
{
    static const char *const names[] = {
        "COMMENT",
        "ON_RESET",
        "SET_XY_ROTATION",
        "SET_FEED_REFERENCE",
        "SELECT_TOOL",
        "START_CHANGE",
        "SET_TOOL_TABLE_ENTRY",
        "SET_NAIVECAM_TOLERANCE",
        "PALLET_SHUTTLE",
        "TURN_PROBE_ON",
        "TURN_PROBE_OFF",
        "ENABLE_FEED_HOLD",
        "LOGOPEN",
        "LOGCLOSE",
        "LOGAPPEND",
    };
    for (size_t i = 0; i < G_N_ELEMENTS(names); i++)
        if (strcmp(names[i], name) == 0)
            return true;
    return false;
}

/* -------------------------------------------------------------------------- moves */

/* Cutting speed over the circumference at the work's X. */
static double spindle_rpm(const Canon *canon)
{
    if (canon->most_rpm == 0.0)
        return canon->direction * canon->speed;
    const double radius = fabs(canon->at.x - canon->work.x - canon->local.x);
    const double rpm = canon->surface_mm_min / (2.0 * G_PI * radius);
    const double most = fmin(canon->most_rpm, canon->machine->spindle_max_rpm);
    return canon->direction * fmax(fmin(rpm, most), canon->machine->spindle_min_rpm);
}

/* For LinuxCNC's motion this is no way at all. */
static bool same_vector(SegVec3 a, SegVec3 b)
{
    return fabs(a.x - b.x) < 1e-7 && fabs(a.y - b.y) < 1e-7 && fabs(a.z - b.z) < 1e-7;
}

static NcMove *add(Canon *canon, NcMoveKind kind, SegVec3 to, SegVec3 to_deg)
{
    const bool angular =
        kind != NC_MOVE_ARC && same_vector(canon->at, to) && !same_vector(canon->at_deg, to_deg);
    NcMove move = {.kind = kind,
                   .from = canon->at,
                   .to = to,
                   .to_deg = {to_deg.x, to_deg.y, to_deg.z},
                   .plane = canon->plane,
                   .tool = canon->tool_number,
                   .feed_mm_min = angular ? canon->feed_deg : canon->feed_mm,
                   .tolerance_mm = canon->tolerance_mm,
                   .exact_stop = canon->exact_stop,
                   .coolant_mist = canon->mist,
                   .coolant_flood = canon->flood,
                   .feed_per_turn = canon->per_turn,
                   .feed_override_off = canon->feed_override_off,
                   .spindle_override_off = canon->spindle_override_off,
                   .adaptive_feed = canon->adaptive};
    canon->at = to;
    canon->at_deg = to_deg;
    move.spindle_rpm = spindle_rpm(canon);
    if (canon->per_turn)
        move.feed_mm_min *= fabs(move.spindle_rpm);
    g_array_append_val(canon->moves, move);
    return &g_array_index(canon->moves, NcMove, canon->moves->len - 1);
}

static NcMove *add_here(Canon *canon, NcMoveKind kind)
{
    return add(canon, kind, canon->at, canon->at_deg);
}

/* Program coordinates to millimetres of the gauge point. */
static SegVec3 point(const Canon *canon, double x, double y, double z)
{
    SegVec3 shift = seg_add(seg_add(canon->work, canon->local), canon->tool);
    return seg_along(shift, seg_vec3(x, y, z), canon->unit_mm);
}

static SegVec3 angles(const Canon *canon, const double *n)
{
    return seg_add(seg_add(canon->work_deg, canon->local_deg), seg_vec3(n[0], n[1], n[2]));
}

/* First end, second end, first centre, second centre, turns, end along the normal, A, B, C. */
static void arc(Canon *canon, const double *n)
{
    SegVec3 to, centre;
    if (canon->plane == 17) {
        to = point(canon, n[0], n[1], n[5]);
        centre = point(canon, n[2], n[3], n[5]);
    } else if (canon->plane == 18) {
        to = point(canon, n[1], n[5], n[0]);
        centre = point(canon, n[3], n[5], n[2]);
    } else {
        to = point(canon, n[5], n[0], n[1]);
        centre = point(canon, n[5], n[2], n[3]);
    }
    NcMove *made = add(canon, NC_MOVE_ARC, to, angles(canon, n + 6));
    made->centre = centre;
    made->turn = (int)n[4];
}

static bool travel(Canon *canon, const Call *call)
{
    const double *n = call->n;
    const SegVec3 to = point(canon, n[0], n[1], n[2]), to_deg = angles(canon, n + 3);
    if (is(call, "STRAIGHT_TRAVERSE"))
        add(canon, NC_MOVE_RAPID, to, to_deg);
    else if (is(call, "STRAIGHT_FEED"))
        add(canon, NC_MOVE_FEED, to, to_deg);
    else if (is(call, "STRAIGHT_PROBE"))
        add(canon, NC_MOVE_PROBE, to, to_deg);
    else if (is(call, "ARC_FEED"))
        arc(canon, n);
    else
        return false;
    return true;
}

/* "text"), with the quotes. */
static void message(Canon *canon, const char *quoted)
{
    size_t length = strlen(quoted);
    add_here(canon, NC_MOVE_MESSAGE)->message = (int)canon->texts->len;
    g_ptr_array_add(canon->texts, g_strndup(quoted + 1, length > 3 ? length - 3 : 0));
}

static void orient(Canon *canon, const double *n)
{
    canon->direction = 0;
    add_here(canon, NC_MOVE_ORIENT)->orient = (NcOrient){n[1], n[2] >= 2.0 ? -1 : (int)n[2], 0.0};
}

static void wait_orient(Canon *canon, double seconds)
{
    if (canon->moves->len > 0)
        g_array_index(canon->moves, NcMove, canon->moves->len - 1).orient.wait_s = seconds;
}

static bool act(Canon *canon, const Call *call)
{
    const double *n = call->n;
    if (is(call, "DWELL")) {
        add_here(canon, NC_MOVE_DWELL)->dwell_s = n[0];
    } else if (is(call, "CHANGE_TOOL") || is(call, "CHANGE_TOOL_NUMBER")) {
        canon->tool_number = (int)n[0];
        add_here(canon, is(call, "CHANGE_TOOL") ? NC_MOVE_TOOL_CHANGE : NC_MOVE_TOOL_NUMBER);
    } else if (is(call, "ORIENT_SPINDLE")) {
        orient(canon, n);
    } else if (is(call, "SPINDLE.0.WAIT_ORIENT_COMPLETE")) {
        wait_orient(canon, n[0]);
    } else if (is(call, "MESSAGE") || is(call, "LOG")) {
        message(canon, call->arguments);
    } else if (is(call, "PROGRAM_STOP")) {
        add_here(canon, NC_MOVE_STOP);
    } else if (is(call, "OPTIONAL_PROGRAM_STOP")) {
        add_here(canon, NC_MOVE_OPTIONAL_STOP);
    } else if (is(call, "PROGRAM_END") || is(call, "FINISH")) {
        add_here(canon, NC_MOVE_END);
    } else {
        return false;
    }
    return true;
}

/* --------------------------------------------------------------------- comparison */

static bool near(double a, double b, double tolerance)
{
    return a == b || fabs(a - b) <= tolerance;
}

static bool near_point(SegVec3 a, SegVec3 b, double tolerance)
{
    return near(a.x, b.x, tolerance) && near(a.y, b.y, tolerance) && near(a.z, b.z, tolerance);
}

static bool same_arc(const NcMove *ours, const NcMove *theirs, double tolerance)
{
    SegVec3 centre = theirs->centre;
    if (ours->plane == 17)
        centre.z = ours->centre.z;
    else if (ours->plane == 18)
        centre.y = ours->centre.y;
    else
        centre.x = ours->centre.x;
    return ours->plane == theirs->plane && ours->turn == theirs->turn &&
           near_point(ours->centre, centre, tolerance);
}

/* LinuxCNC prints the tolerance of G64 with six decimals. */
static bool same_path(const NcMove *ours, const NcMove *theirs, double tolerance)
{
    bool same = near_point(ours->to, theirs->to, tolerance) &&
                near(ours->tolerance_mm, theirs->tolerance_mm, 26e-6) &&
                ours->exact_stop == theirs->exact_stop;
    for (int i = 0; i < 3; i++)
        same = same && near(ours->to_deg[i], theirs->to_deg[i], tolerance);
    if (ours->kind == NC_MOVE_ARC)
        same = same && same_arc(ours, theirs, tolerance);
    if (ours->kind != NC_MOVE_RAPID) {
        const double slack =
            tolerance * fmax(1.0, fabs(theirs->feed_per_turn ? theirs->spindle_rpm : 1.0));
        same = same && near(ours->feed_mm_min, theirs->feed_mm_min, slack) &&
               ours->feed_per_turn == theirs->feed_per_turn;
    }
    return same;
}

/* The way is compared where M19 names it: G87 hands the direction of M3 over as one. */
static bool same_orient(const NcOrient *ours, const NcOrient *theirs, double tolerance)
{
    return near(ours->angle_deg, theirs->angle_deg, tolerance) &&
           near(ours->wait_s, theirs->wait_s, tolerance) &&
           (ours->angle_deg == 0.0 || ours->way == theirs->way);
}

static char *plain(const char *text)
{
    g_auto(GStrv) words = g_strsplit_set(text, " \t", -1);
    GString *plain = g_string_new(NULL);
    for (char **word = words; *word; word++)
        if (**word)
            g_string_append_printf(plain, "%s%s", plain->len > 0 ? " " : "", *word);
    return g_string_free(plain, FALSE);
}

static bool same_text(const char *ours, const char *theirs)
{
    g_autofree char *a = plain(ours), *b = plain(theirs);
    return g_str_equal(a, b);
}

static bool same_state(const NcMove *ours, const NcMove *theirs, double tolerance)
{
    const double slack = tolerance * fmax(1.0, 1e-3 * fabs(theirs->spindle_rpm));
    return near(ours->spindle_rpm, theirs->spindle_rpm, slack) &&
           ours->coolant_mist == theirs->coolant_mist &&
           ours->coolant_flood == theirs->coolant_flood && ours->tool == theirs->tool &&
           (ours->kind == NC_MOVE_END ||
            (ours->feed_override_off == theirs->feed_override_off &&
             ours->spindle_override_off == theirs->spindle_override_off)) &&
           ours->adaptive_feed == theirs->adaptive_feed;
}

static bool same_move(const NcMove *ours, const NcMove *theirs, double tolerance)
{
    if (ours->kind != theirs->kind || !same_state(ours, theirs, tolerance))
        return false;
    if (ours->kind <= NC_MOVE_ARC || ours->kind == NC_MOVE_PROBE)
        return same_path(ours, theirs, tolerance);
    if (ours->kind == NC_MOVE_DWELL)
        return near(ours->dwell_s, theirs->dwell_s, tolerance);
    return ours->kind != NC_MOVE_ORIENT || same_orient(&ours->orient, &theirs->orient, tolerance);
}

/* Ours without those that LinuxCNC has as states, which show in the other moves. */
static GArray *without_states(const GArray *moves)
{
    GArray *kept = g_array_new(FALSE, FALSE, sizeof(NcMove));
    for (guint i = 0; i < moves->len; i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        if (move->kind != NC_MOVE_SPINDLE && move->kind != NC_MOVE_COOLANT)
            g_array_append_val(kept, *move);
    }
    return kept;
}

static void tell_move(const char *whose, const GArray *moves, guint i)
{
    if (i >= moves->len)
        return;
    const NcMove *move = &g_array_index(moves, NcMove, i);
    g_autoptr(GArray) one = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_array_append_vals(one, move, 1);
    g_autofree char *text = gcode_text(one);
    g_test_message("%s (line %u): %sspindle %.17g, feed %.17g%s, tool %d, tolerance %g%s, coolant "
                   "%d %d, overrides %d %d %d",
                   whose, nc_move_block_line(move), text, move->spindle_rpm, move->feed_mm_min,
                   move->feed_per_turn ? " with the spindle" : "", move->tool, move->tolerance_mm,
                   move->exact_stop ? " exact stop" : "", move->coolant_mist, move->coolant_flood,
                   !move->feed_override_off, !move->spindle_override_off, move->adaptive_feed);
}

bool canon_same(const char *name, const NcInterpreter *interpreter, const GArray *moves,
                const GArray *theirs, const GPtrArray *texts, double tolerance, bool prints)
{
    g_autoptr(GArray) ours = without_states(moves);
    guint i = 0, j = 0;
    for (; i < ours->len && j < theirs->len; i++, j++) {
        const NcMove *a = &g_array_index(ours, NcMove, i), *b = &g_array_index(theirs, NcMove, j);
        if (prints && a->kind == NC_MOVE_MESSAGE && b->kind != NC_MOVE_MESSAGE)
            j--;
        else if (!same_move(a, b, tolerance) ||
                 (a->kind == NC_MOVE_MESSAGE &&
                  !same_text(nc_interpreter_message(interpreter, a), texts->pdata[b->message])))
            break;
    }
    if (i == ours->len && j == theirs->len)
        return true;
    g_test_message("%s differs at move %u of %u, %u of %u:", name, i, ours->len, j, theirs->len);
    tell_move("ours", ours, i);
    tell_move("theirs", theirs, j);
    return false;
}
