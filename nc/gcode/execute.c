/* SPDX-License-Identifier: Apache-2.0 */
/* A checked block into moves, in RS-274's order of execution [NIST, table 8; LinuxCNC 2.9]. */
#include "nc/gcode/interpreter.h"

static bool set_words(NcExecution *x, GError **error);
static bool set_modes(NcExecution *x, GError **error);
static void machine_functions(NcExecution *x);
static bool move(NcExecution *x, GError **error);
static void go_home(NcExecution *x, int home);
static void stop(NcExecution *x);

/* F, S and T; tool change; spindle; coolant; dwell; plane, units, offsets, modes; reference
 * points; motion; stop. So F still counts in the units of the block before. */
bool nc_execute(NcExecution *x, GError **error)
{
    const NcBlock *block = x->block;
    if (block->region >= 0)
        x->modal.region = block->region;
    if (!set_words(x, error))
        return false;
    machine_functions(x);
    if (!set_modes(x, error))
        return false;
    if (!nc_set_offsets(x, error))
        return false;
    int code = block->g[NC_G_NON_MODAL];
    int home = code == 280 || code == 281 ? NC_PARAMETER_HOME : NC_PARAMETER_HOME_2;
    if (code == 280 || code == 300)
        go_home(x, home);
    else if (code == 281 || code == 301)
        nc_set_parameters_point(x, home, x->modal.position);
    if (block->motion >= 0 && !move(x, error))
        return false;
    stop(x);
    return true;
}

static double spindle_rpm(const NcModal *modal)
{
    return modal->spindle * modal->speed_rpm;
}

NcMove *nc_append_move(NcExecution *x, NcMoveKind kind)
{
    const NcModal *modal = &x->modal;
    g_array_set_size(x->moves, x->moves->len + 1);
    NcMove *made = &g_array_index(x->moves, NcMove, x->moves->len - 1);
    *made = (NcMove){
        .kind = kind,
        .line = x->statement_line,
        .block_line = modal->line == x->statement_line ? 0 : modal->line,
        .region = modal->region,
        .tool = modal->tool,
        .from = modal->position,
        .to = modal->position,
        .plane = modal->plane,
        .feed_mm_min = modal->feed_mm_min,
        .spindle_rpm = spindle_rpm(modal),
        .tolerance_mm = modal->tolerance_mm,
        .exact_stop = modal->exact_stop,
        .coolant_mist = modal->mist,
        .coolant_flood = modal->flood,
        .work_offset = 54 + modal->wcs,
    };
    return made;
}

static NcMove *append_to(NcExecution *x, NcMoveKind kind, SegVec3 to)
{
    NcMove *made = nc_append_move(x, kind);
    made->to = to;
    x->modal.position = to;
    return made;
}

/* ----------------------------------------------------------- words and functions */

static const CfgTool *find_tool(const NcExecution *x, int number)
{
    return x->tools ? cfg_tools_find(x->tools, number) : NULL;
}

static bool no_tool(const NcExecution *x, const NcWord *word, GError **error)
{
    return nc_word_error(error, x->modal.line, word, "is not in the machine's tool table");
}

static bool set_words(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const NcWord *f = nc_word(x->block, 'F'), *s = nc_word(x->block, 'S');
    const NcWord *t = nc_word(x->block, 'T');
    if (f)
        modal->feed_mm_min = f->value * modal->unit_mm;
    if (s)
        modal->speed_rpm = s->value;
    if (t) {
        if (t->value > 0.0 && !find_tool(x, (int)t->value))
            return no_tool(x, t, error);
        modal->selected_tool = (int)t->value;
    }
    return true;
}

static void machine_functions(NcExecution *x)
{
    NcModal *modal = &x->modal;
    const NcBlock *block = x->block;
    if (block->m[NC_M_TOOL] == 6) {
        modal->spindle = 0;
        modal->tool = modal->selected_tool;
        nc_append_move(x, NC_MOVE_TOOL_CHANGE);
    }
    int m = block->m[NC_M_SPINDLE];
    if (m >= 0)
        modal->spindle = m == 3 ? 1 : m == 4 ? -1 : 0;
    if (m >= 0 || (nc_word(block, 'S') && modal->spindle != 0))
        nc_append_move(x, NC_MOVE_SPINDLE);
    m = block->m[NC_M_COOLANT];
    if (m >= 0) {
        modal->mist = m == 7 || (m == 8 && modal->mist);
        modal->flood = m == 8 || (m == 7 && modal->flood);
        nc_append_move(x, NC_MOVE_COOLANT);
    }
    if (block->g[NC_G_NON_MODAL] == 40)
        nc_append_move(x, NC_MOVE_DWELL)->dwell_s = nc_word(block, 'P')->value;
}

/* G43 with no H, or with H0, takes the tool in the spindle. */
static bool set_tool_length(NcExecution *x, GError **error)
{
    const NcWord *h = nc_word(x->block, 'H');
    int number = h && h->value > 0.0 ? (int)h->value : x->modal.tool;
    const CfgTool *tool = find_tool(x, number);
    if (!tool && number > 0)
        return no_tool(x, h ? h : x->block->g_word[NC_G_TOOL], error);
    x->modal.tool_length_mm = tool ? tool->length_mm : 0.0;
    return true;
}

/* G61 is LinuxCNC's exact path, G61.1 its exact stop; G64 P0 names no tolerance, as there. Q lets a
 * machine join moves; ours never does. */
static void set_control(NcModal *modal, const NcBlock *block)
{
    const NcWord *p = nc_word(block, 'P');
    modal->exact_stop = block->g[NC_G_CONTROL] == 611;
    if (block->g[NC_G_CONTROL] != 640)
        modal->tolerance_mm = 0.0;
    else
        modal->tolerance_mm = p && p->value > 0.0 ? p->value * modal->unit_mm : INFINITY;
}

/* Its offset counts as it is now: one that is set later waits for the next time. */
static void select_work(NcExecution *x, int wcs)
{
    x->modal.wcs = wcs;
    x->modal.work_mm = nc_parameters_point(x, nc_parameter_of_work(wcs));
}

static bool set_modes(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const int *g = x->block->g;
    if (g[NC_G_PLANE] >= 0)
        modal->plane = g[NC_G_PLANE] / 10;
    if (g[NC_G_UNITS] >= 0)
        modal->unit_mm = g[NC_G_UNITS] == 200 ? NC_MM_PER_INCH : 1.0;
    if (g[NC_G_TOOL] == 490)
        modal->tool_length_mm = 0.0;
    else if (g[NC_G_TOOL] == 430 && !set_tool_length(x, error))
        return false;
    else if (g[NC_G_TOOL] == 431)
        modal->tool_length_mm = nc_word(x->block, 'Z')->value * modal->unit_mm;
    if (g[NC_G_WORK] >= 0)
        select_work(x, g[NC_G_WORK] / 10 - 54);
    if (g[NC_G_CONTROL] >= 0)
        set_control(modal, x->block);
    if (g[NC_G_DISTANCE] >= 0)
        modal->incremental = g[NC_G_DISTANCE] == 910;
    if (g[NC_G_ARC] >= 0)
        modal->arc_absolute = g[NC_G_ARC] == 901;
    if (g[NC_G_RETRACT] >= 0)
        modal->retract_r = g[NC_G_RETRACT] == 990;
    if (g[NC_G_MOTION] >= 0)
        modal->motion = g[NC_G_MOTION];
    else if (g[NC_G_CANCEL] >= 0)
        modal->motion = 800;
    if (!nc_is_cycle(modal->motion)) {
        modal->cycle.code = 0;
        modal->cycle_level_mm = (double)NAN;
    }
    return true;
}

/* ------------------------------------------------------------------------ motion */

SegVec3 nc_program_shift(const NcExecution *x)
{
    return seg_add(seg_add(x->modal.work_mm, x->modal.local_mm),
                   seg_vec3(0.0, 0.0, x->modal.tool_length_mm));
}

/* Where the block's axis words lead; axes without a word stay. */
static SegVec3 target(const NcExecution *x, SegVec3 shift, bool incremental)
{
    SegVec3 to = x->modal.position;
    for (int axis = 0; axis < 3; axis++) {
        const NcWord *word = nc_word(x->block, (char)('X' + axis));
        if (word) {
            double base = *nc_axis(incremental ? &to : &shift, axis);
            *nc_axis(&to, axis) = word->value * x->modal.unit_mm + base;
        }
    }
    return to;
}

static bool move(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    const NcBlock *block = x->block;
    bool machine_coordinates = block->g[NC_G_NON_MODAL] == 530;
    SegVec3 shift = machine_coordinates ? seg_vec3(0.0, 0.0, 0.0) : nc_program_shift(x);
    SegVec3 to = target(x, shift, modal->incremental && !machine_coordinates);
    if (block->motion == 0 || block->motion == 10) {
        NcMove *straight = append_to(x, block->motion == 0 ? NC_MOVE_RAPID : NC_MOVE_FEED, to);
        straight->machine_coordinates = machine_coordinates;
        return true;
    }
    if (nc_is_cycle(block->motion))
        return nc_run_cycle(x, to, error);
    SegVec3 centre;
    if (!nc_arc_centre(block, modal, modal->position, to, shift, &centre, error))
        return false;
    const NcWord *p = nc_word(block, 'P');
    int turns = p ? (int)p->value : 1;
    NcMove *arc = append_to(x, NC_MOVE_ARC, to);
    arc->centre = centre;
    arc->turn = block->motion == 30 ? turns : -turns;
    return true;
}

/* G28 and G30: by way of the point named, then home with the axes named; with all where none is.
 * LinuxCNC goes to that point even where none is named, so two moves it always is. */
static void go_home(NcExecution *x, int parameter)
{
    SegVec3 place = nc_parameters_point(x, parameter), home = x->modal.position;
    bool some = false;
    for (int axis = 0; axis < 3; axis++) {
        if (nc_word(x->block, (char)('X' + axis))) {
            *nc_axis(&home, axis) = *nc_axis(&place, axis);
            some = true;
        }
    }
    SegVec3 by_way = target(x, nc_program_shift(x), x->modal.incremental);
    append_to(x, NC_MOVE_RAPID, by_way)->machine_coordinates = !some;
    append_to(x, NC_MOVE_RAPID, some ? home : place)->machine_coordinates = true;
}

/* M2 and M30 leave the machine in a known state [NIST 3.6.1]. */
static void stop(NcExecution *x)
{
    NcModal *modal = &x->modal;
    switch (x->block->m[NC_M_STOP]) {
    case 0:
        nc_append_move(x, NC_MOVE_STOP);
        break;
    case 1:
        nc_append_move(x, NC_MOVE_OPTIONAL_STOP);
        break;
    case 2:
    case 30:
        select_work(x, 0);
        modal->plane = 17;
        modal->incremental = false;
        modal->motion = 10;
        modal->feed_mm_min = 0.0;
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
        break;
    default:
        break;
    }
}
