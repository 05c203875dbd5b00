/* SPDX-License-Identifier: Apache-2.0 */
/* A checked block into moves, in RS-274's order of execution [NIST, table 8; LinuxCNC 2.9]. */
#include "nc/gcode/interpreter.h"

#define MM_PER_FOOT 304.8
#define MM_PER_METRE 1000.0

static bool set_words(NcExecution *x, GError **error);
static bool machine_functions(NcExecution *x, GError **error);
static bool set_modes(NcExecution *x, GError **error);
static void stop(NcExecution *x);

/* Messages; feed mode, F, S and T; tool change; spindle; coolant; overrides; dwell; plane, units,
 * offsets, modes; reference points; motion; stop. So F still counts in the units of the block
 * before. */
bool nc_execute(NcExecution *x, GError **error)
{
    const NcBlock *block = x->block;
    NcModal *modal = &x->modal;
    if (block->region >= 0)
        modal->region = block->region;
    if (!nc_check_compensated(x, error))
        return false;
    if (block->message)
        nc_speak(x);
    if (!set_words(x, error))
        return false;
    if (block->by.some_m && !machine_functions(x, error))
        return false;
    if (block->by.some_g && !set_modes(x, error))
        return false;
    if (block->by.g[NC_G_MOTION] >= 0)
        modal->motion = block->by.g[NC_G_MOTION];
    else if (block->by.g[NC_G_CANCEL] >= 0)
        modal->motion = 800;
    if (modal->cycle.code != 0 && !nc_is_cycle(modal->motion)) {
        modal->cycle.code = 0;
        modal->cycle_level_mm = (double)NAN;
    }
    if (!nc_travel(x, error))
        return false;
    stop(x);
    return true;
}

/* With G96 the distance from the work's zero along X is the radius. */
static double spindle_rpm(const NcExecution *x, SegVec3 place)
{
    const NcModal *modal = &x->modal;
    if (modal->spindle == 0)
        return 0.0;
    if (!modal->surface_speed)
        return modal->spindle * modal->speed_rpm;
    if (modal->surface_mm_min == 0.0)
        return 0.0;
    const double radius = fabs(place.x - nc_program_shift(x).x);
    const double most = MIN(modal->speed_rpm, x->machine->spindle_max_rpm);
    const double rpm = modal->surface_mm_min / (2.0 * G_PI * radius);
    return modal->spindle * MAX(MIN(rpm, most), x->machine->spindle_min_rpm);
}

static double feed(const NcExecution *x, double spindle, double word)
{
    return x->modal.feed_mode == NC_FEED_A_TURN ? word * fabs(spindle) : word;
}

void nc_move_speeds(const NcExecution *x, NcMove *move)
{
    const NcModal *modal = &x->modal;
    move->spindle_rpm = spindle_rpm(x, move->to);
    move->feed_mm_min = feed(x, move->spindle_rpm, modal->feed_mm);
}

/* Field by field: what is given at once is cleared first, and there are millions of moves. */
NcMove *nc_append_move(NcExecution *x, NcMoveKind kind)
{
    const NcModal *modal = &x->modal;
    const guint n = x->moves->len;
    g_array_set_size(x->moves, n + 1);
    NcMove *made = &g_array_index(x->moves, NcMove, n);
    made->kind = kind;
    made->line = x->statement_line;
    made->block_line = modal->line == x->statement_line ? 0 : modal->line;
    made->region = modal->region;
    made->tool = modal->tool;
    made->work_offset = 54 + modal->wcs;
    made->plane = modal->plane;
    made->turn = 0;
    made->from = made->to = modal->position;
    made->from_deg[0] = made->to_deg[0] = modal->position_deg.x;
    made->from_deg[1] = made->to_deg[1] = modal->position_deg.y;
    made->from_deg[2] = made->to_deg[2] = modal->position_deg.z;
    made->centre = (SegVec3){0.0, 0.0, 0.0};
    made->tolerance_mm = modal->tolerance_mm;
    made->begins_block = n == x->first_move;
    made->exact_stop = modal->exact_stop;
    made->coolant_mist = modal->mist;
    made->coolant_flood = modal->flood;
    made->machine_coordinates = false;
    made->feed_per_turn = modal->feed_mode == NC_FEED_A_TURN;
    made->feed_override_off = modal->feed_override_off;
    made->spindle_override_off = modal->spindle_override_off;
    made->adaptive_feed = modal->adaptive_feed;
    nc_move_speeds(x, made);
    return made;
}

/* ----------------------------------------------------------- words and functions */

bool nc_find_tool(const NcExecution *x, int number, NcToolOffset *tool)
{
    const CfgTool *known = x->tools ? cfg_tools_find(x->tools, number) : NULL;
    const NcToolOffset *said = known ? nc_parameters_tool(x->parameters, number) : NULL;
    if (said)
        *tool = *said;
    else if (known)
        *tool = (NcToolOffset){number, known->length_mm, known->diameter_mm};
    return known != NULL;
}

bool nc_no_tool(const NcExecution *x, const NcWord *word, GError **error)
{
    return nc_word_error(error, x->modal.line, word, "is not in the machine's tool table");
}

/* G94 and G95 forget the feed, as G93 does. */
static void set_feed_mode(NcModal *modal, int code)
{
    modal->feed_mode = code == 930   ? NC_FEED_INVERSE
                       : code == 950 ? NC_FEED_A_TURN
                                     : NC_FEED_A_MINUTE;
    modal->feed_mm = modal->feed_deg = 0.0;
}

/* D is the largest speed with G96; of G97 the S word counts again as turns. */
static void set_speed(NcModal *modal, const NcBlock *block)
{
    const NcWord *d = nc_word(block, 'D'), *s = nc_word(block, 'S');
    const int code = block->by.g[NC_G_SPINDLE];
    if (s)
        modal->speed = s->value;
    if (code >= 0)
        modal->surface_speed = code == 960;
    if (!modal->surface_speed) {
        modal->speed_rpm = modal->speed;
        return;
    }
    if (code == 960)
        modal->speed_rpm = d ? fabs(d->value) : INFINITY;
    modal->surface_mm_min = modal->speed * (modal->unit_mm == 1.0 ? MM_PER_METRE : MM_PER_FOOT);
}

static bool set_words(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const NcBlock *block = x->block;
    const NcWord *f = nc_word(block, 'F'), *t = nc_word(block, 'T');
    if (block->by.g[NC_G_FEED_MODE] >= 0)
        set_feed_mode(modal, block->by.g[NC_G_FEED_MODE]);
    if (f && modal->feed_mode != NC_FEED_INVERSE) {
        modal->feed_mm = f->value * modal->unit_mm;
        modal->feed_deg = f->value;
    }
    if (nc_word(block, 'S') || block->by.g[NC_G_SPINDLE] >= 0) {
        const double before = spindle_rpm(x, modal->position);
        set_speed(modal, block);
        const bool m = block->by.m[NC_M_SPINDLE] >= 0 || block->by.m[NC_M_TOOL] == 6;
        if (!m && (nc_word(block, 'S') || spindle_rpm(x, modal->position) != before) &&
            modal->spindle != 0)
            nc_append_move(x, NC_MOVE_SPINDLE);
    }
    if (t) {
        NcToolOffset tool;
        if (t->value > 0.0 && !nc_find_tool(x, (int)t->value, &tool))
            return nc_no_tool(x, t, error);
        modal->selected_tool = (int)t->value;
    }
    return true;
}

static bool set_tool(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const NcWord *q = nc_word(x->block, 'Q');
    NcToolOffset tool;
    if (x->block->by.m[NC_M_TOOL] == 6) {
        modal->spindle = 0;
        modal->tool = modal->selected_tool;
        nc_append_move(x, NC_MOVE_TOOL_CHANGE);
        return true;
    }
    if (q->value > 0.0 && !nc_find_tool(x, (int)q->value, &tool))
        return nc_no_tool(x, q, error);
    modal->tool = (int)q->value;
    nc_append_move(x, NC_MOVE_TOOL_NUMBER);
    return true;
}

/* M19 without R, P and Q stops the spindle wherever that comes to stand. */
static void set_spindle(NcExecution *x, int m)
{
    const NcWord *r = nc_word(x->block, 'R'), *p = nc_word(x->block, 'P');
    const NcWord *q = nc_word(x->block, 'Q');
    x->modal.spindle = m == 3 ? 1 : m == 4 ? -1 : 0;
    if (m != 19 || !(r || p || q)) {
        nc_append_move(x, NC_MOVE_SPINDLE);
        return;
    }
    const int way = p ? (int)p->value : 0;
    nc_append_move(x, NC_MOVE_ORIENT)->orient =
        (NcOrient){r ? r->value : 0.0, way == 2 ? -1 : way, q ? q->value : 0.0};
}

/* M48 to M53: without P, and with any but P0, they allow. */
static void set_overrides(NcModal *modal, const NcBlock *block)
{
    const NcWord *p = nc_word(block, 'P');
    const int m = block->by.m[NC_M_OVERRIDE];
    const bool off = m == 49 || (p && p->value == 0.0);
    if (m <= 50)
        modal->feed_override_off = off;
    if (m <= 49 || m == 51)
        modal->spindle_override_off = off;
    if (m == 52)
        modal->adaptive_feed = !off;
}

static bool machine_functions(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const NcBlock *block = x->block;
    if (block->by.m[NC_M_TOOL] >= 0 && !set_tool(x, error))
        return false;
    if (block->by.m[NC_M_SPINDLE] >= 0)
        set_spindle(x, block->by.m[NC_M_SPINDLE]);
    const int m = block->by.m[NC_M_COOLANT];
    if (m >= 0) {
        modal->mist = m == 7 || (m == 8 && modal->mist);
        modal->flood = m == 8 || (m == 7 && modal->flood);
        nc_append_move(x, NC_MOVE_COOLANT);
    }
    if (block->by.m[NC_M_OVERRIDE] >= 0)
        set_overrides(modal, block);
    return true;
}

/* ------------------------------------------------------------------------- modes */

/* G43 with no H, or with H0, takes the tool in the spindle. */
static bool set_tool_length(NcExecution *x, GError **error)
{
    const NcWord *h = nc_word(x->block, 'H');
    int number = h && h->value > 0.0 ? (int)h->value : x->modal.tool;
    NcToolOffset tool = {0, 0.0, 0.0};
    if (!nc_find_tool(x, number, &tool) && number > 0)
        return nc_no_tool(x, h ? h : nc_g_word(x->block, NC_G_TOOL), error);
    x->modal.tool_length_mm = tool.length_mm;
    return true;
}

/* G61 is LinuxCNC's exact path, G61.1 its exact stop; G64 P0 names no tolerance, as there. Q lets a
 * machine join moves; ours never does. */
static void set_control(NcModal *modal, const NcBlock *block)
{
    const NcWord *p = nc_word(block, 'P');
    modal->exact_stop = block->by.g[NC_G_CONTROL] == 611;
    if (block->by.g[NC_G_CONTROL] != 640)
        modal->tolerance_mm = 0.0;
    else
        modal->tolerance_mm = p && p->value > 0.0 ? p->value * modal->unit_mm : INFINITY;
}

/* From ten times the code; the one in force goes on as it is. */
static void set_work(NcExecution *x, int code)
{
    const int wcs = code <= 590 ? code / 10 - 54 : code - 585;
    if (wcs != x->modal.wcs)
        nc_select_work(x, wcs);
}

static bool set_modes(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const int16_t *g = x->block->by.g;
    if (g[NC_G_NON_MODAL] == 40)
        nc_append_move(x, NC_MOVE_DWELL)->dwell_s = nc_word(x->block, 'P')->value;
    if (g[NC_G_PLANE] >= 0)
        modal->plane = g[NC_G_PLANE] / 10;
    if (g[NC_G_UNITS] >= 0)
        modal->unit_mm = g[NC_G_UNITS] == 200 ? NC_MM_PER_INCH : 1.0;
    if (!nc_set_compensation(x, error))
        return false;
    if (g[NC_G_TOOL] == 490)
        modal->tool_length_mm = 0.0;
    else if (g[NC_G_TOOL] == 430 && !set_tool_length(x, error))
        return false;
    else if (g[NC_G_TOOL] == 431)
        modal->tool_length_mm = nc_word(x->block, 'Z')->value * modal->unit_mm;
    if (g[NC_G_WORK] >= 0)
        set_work(x, g[NC_G_WORK]);
    if (g[NC_G_CONTROL] >= 0)
        set_control(modal, x->block);
    if (g[NC_G_DISTANCE] >= 0)
        modal->incremental = g[NC_G_DISTANCE] == 910;
    if (g[NC_G_ARC] >= 0)
        modal->arc_absolute = g[NC_G_ARC] == 901;
    if (g[NC_G_RETRACT] >= 0)
        modal->retract_r = g[NC_G_RETRACT] == 990;
    return nc_set_offsets(x, error);
}

/* ------------------------------------------------------------------------- stops */

/* M2 and M30 leave the machine in a known state [NIST 3.6.1]. */
static void end(NcExecution *x)
{
    NcModal *modal = &x->modal;
    nc_select_work(x, 0);
    set_feed_mode(modal, 940);
    modal->plane = 17;
    modal->incremental = false;
    modal->motion = 10;
    modal->feed_override_off = modal->spindle_override_off = false;
    modal->surface_speed = false;
    modal->speed_rpm = modal->speed;
    if (modal->spindle != 0) {
        modal->spindle = 0;
        nc_append_move(x, NC_MOVE_SPINDLE);
    }
    if (modal->mist || modal->flood) {
        modal->mist = modal->flood = false;
        nc_append_move(x, NC_MOVE_COOLANT);
    }
    nc_append_move(x, NC_MOVE_END);
    modal->ended = true;
}

/* M60 stops as M0 does: there are no pallets. */
static void stop(NcExecution *x)
{
    switch (x->block->by.m[NC_M_STOP]) {
    case 0:
    case 60:
        nc_append_move(x, NC_MOVE_STOP);
        break;
    case 1:
        nc_append_move(x, NC_MOVE_OPTIONAL_STOP);
        break;
    case 2:
    case 30:
        end(x);
        break;
    default:
        break;
    }
}
