/* SPDX-License-Identifier: Apache-2.0 */
/* Reading G-code: block by block, or a whole program with the machine's limits. */
#include "nc/gcode/read.h"

#include "nc/gcode/flow.h"

#include <string.h>

/* What a block that only moves may have changed when it fails. */
typedef struct {
    uint32_t line;
    int motion;
    double feed_mm, feed_deg;
} MotionState;

static bool read_block(NcInterpreter *interpreter, const char *text, size_t length, NcBlock *block,
                       GArray *moves, GError **error);
static bool run_line(NcInterpreter *interpreter, NcExecution *x, const char *text, size_t length,
                     GError **error);
static void keep(NcExecution *x);
static void put_back(NcExecution *x, MotionState before);
static bool carry_out(NcExecution *x, GError **error);
static bool read_percent(NcExecution *execution, GError **error);
static bool after_end(const NcExecution *execution, GError **error);

/* What the machine file says, where a program can read and set it. */
static void keep_offsets(NcParameters *parameters, const CfgMachine *machine)
{
    for (int axis = 0; axis < 3; axis++) {
        parameters->numbered[NC_PARAMETER_HOME + axis] = machine->tool_change_mm[axis];
        for (int i = 0; i < CFG_N_WORK_OFFSETS; i++) {
            double *offset = &parameters->numbered[nc_parameter_of_work(i)];
            offset[axis] = machine->work_offset_mm[i][axis];
            offset[axis + 3] = machine->work_offset_deg[i][axis];
        }
    }
}

static SegVec3 vector_of(const double v[3])
{
    return (SegVec3){v[0], v[1], v[2]};
}

/* Before the first tool change the machine stands, and G28 goes, where it changes tools: the one
 * place the machine file names. */
NcInterpreter *nc_interpreter_new(const CfgMachine *machine, const CfgToolTable *tools)
{
    NcInterpreter *interpreter = g_new0(NcInterpreter, 1);
    NcExecution *x = &interpreter->x;
    interpreter->flow = nc_flow_new();
    x->kept_compensation = g_new0(NcCompensation, 1);
    x->compensation = g_new0(NcCompensation, 1);
    x->machine = machine;
    x->tools = tools;
    x->parameters = nc_parameters_new();
    x->messages = nc_messages_new();
    keep_offsets(x->parameters, machine);
    x->modal = (NcModal){
        .work_mm = vector_of(machine->work_offset_mm[0]),
        .work_deg = vector_of(machine->work_offset_deg[0]),
        .position = vector_of(machine->tool_change_mm),
        .unit_mm = 1.0,
        .tolerance_mm = INFINITY,
        .motion = 800,
        .plane = 17,
        .retract_r = true,
        .cycle_level_mm = (double)NAN,
    };
    return interpreter;
}

void nc_interpreter_free(NcInterpreter *interpreter)
{
    if (interpreter) {
        nc_parameters_free(interpreter->x.parameters);
        nc_messages_free(interpreter->x.messages);
        nc_flow_free(interpreter->flow);
        g_free(interpreter->x.kept_compensation);
        g_free(interpreter->x.compensation);
        g_free(interpreter);
    }
}

void nc_interpreter_set_position(NcInterpreter *interpreter, SegVec3 gauge_point)
{
    interpreter->x.modal.position = gauge_point;
    nc_compensation_reset(interpreter->x.compensation);
}

void nc_interpreter_set_block_delete(NcInterpreter *interpreter, bool on)
{
    interpreter->x.block_delete = on;
}

void nc_interpreter_set_probe(NcInterpreter *interpreter, NcProbe probe, void *data)
{
    interpreter->x.probe = probe;
    interpreter->x.probe_data = data;
}

bool nc_interpreter_block(NcInterpreter *interpreter, const char *text, size_t length,
                          GArray *moves, GError **error)
{
    NcBlock block;
    return read_block(interpreter, text, length, &block, moves, error);
}

static bool read_block(NcInterpreter *interpreter, const char *text, size_t length, NcBlock *block,
                       GArray *moves, GError **error)
{
    NcExecution *x = &interpreter->x;
    const MotionState before = {x->modal.line, x->modal.motion, x->modal.feed_mm,
                                x->modal.feed_deg};
    const guint n_before = moves->len;
    x->moves = moves;
    x->block = block;
    x->is_kept = false;
    x->statement_line = ++x->modal.line;
    if (!run_line(interpreter, x, text, length, error)) {
        g_array_set_size(moves, n_before);
        put_back(x, before);
        return false;
    }
    x->modal.line = x->statement_line;
    return true;
}

/* What the statement finds, but for its line. */
static void keep(NcExecution *x)
{
    x->is_kept = true;
    x->kept = x->modal;
    nc_compensation_copy(x->kept_compensation, x->compensation);
}

static void put_back(NcExecution *x, MotionState before)
{
    if (x->is_kept) {
        x->modal = x->kept;
        nc_compensation_copy(x->compensation, x->kept_compensation);
    }
    x->modal.line = before.line;
    x->modal.motion = before.motion;
    x->modal.feed_mm = before.feed_mm;
    x->modal.feed_deg = before.feed_deg;
}

/* Most blocks say where to move by G0 to G3, and how fast: nothing else of the state is touched
 * before they succeed. */
static bool only_moves(const NcExecution *x)
{
    const NcBlock *block = x->block;
    return block->motion <= 30 && !block->by.some_g && !block->by.some_m && !block->message &&
           block->region < 0 && !(block->by.letters & (NC_LETTER('S') | NC_LETTER('T'))) &&
           x->modal.cycle.code == 0 && !nc_compensation_busy(x->compensation);
}

static bool carry_out(NcExecution *x, GError **error)
{
    if (!nc_check(x->block, &x->modal, error))
        return false;
    if (!x->is_kept && !only_moves(x))
        keep(x);
    return nc_execute(x, error) && nc_compensate(x, error);
}

/* A block, or a line that belongs to O words. */
static bool run_line(NcInterpreter *interpreter, NcExecution *x, const char *text, size_t length,
                     GError **error)
{
    if (!nc_flow_takes(interpreter->flow, text, length))
        return nc_run_block(x, text, length, error);
    if (x->modal.ended)
        return after_end(x, error);
    keep(x);
    x->modal.begun = true;
    bool good = nc_flow_read(interpreter->flow, x, text, length, error);
    x->block->structure = true;
    return good;
}

bool nc_run_block(NcExecution *x, const char *text, size_t length, GError **error)
{
    const NcBlock *block = x->block;
    NcModal *modal = &x->modal;
    x->first_move = x->uncompensated = x->moves->len;
    if (!nc_lex(x, text, length, error))
        return false;
    bool empty = block->n_words == 0 && block->n_settings == 0 && !block->percent;
    if (modal->ended && !empty)
        return after_end(x, error);
    bool skipped = block->deleted && x->block_delete;
    if (!(block->percent ? read_percent(x, error) : skipped || carry_out(x, error)))
        return false;
    for (int i = 0; !skipped && i < block->n_settings; i++)
        nc_parameter_set(x->parameters, block->settings[i].parameter, block->settings[i].value);
    modal->begun = modal->begun || !block->blank;
    return true;
}

static bool after_end(const NcExecution *x, GError **error)
{
    return nc_word_error(error, x->modal.line, NULL, "nothing is read after the program's end");
}

/* A program stands between two lines "%", or ends with M2 or M30. */
static bool read_percent(NcExecution *x, GError **error)
{
    NcModal *modal = &x->modal;
    if (!modal->begun) {
        modal->percent_open = true;
        return true;
    }
    if (!modal->percent_open) {
        return nc_word_error(error, modal->line, NULL,
                             "%% ends a program that did not begin with %%");
    }
    if (!x->is_kept)
        keep(x);
    nc_append_move(x, NC_MOVE_END);
    modal->ended = true;
    return nc_compensate(x, error);
}

bool nc_read_blocks(NcInterpreter *interpreter, const char *text, size_t length, GArray *moves,
                    NcBlockRead read, void *data, GError **error)
{
    if (length == 0) {
        g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM,
                    "the program is empty: it needs at least M2 or M30");
        return false;
    }
    const char *end = text + length;
    for (const char *at = text; at < end && !interpreter->x.modal.ended;) {
        const char *newline = memchr(at, '\n', (size_t)(end - at));
        const char *next = newline ? newline + 1 : end;
        guint n_before = moves->len;
        NcBlock block;
        if (!read_block(interpreter, at, (size_t)(next - at), &block, moves, error))
            return false;
        for (guint i = n_before; i < moves->len; i++) {
            const NcMove *made = &g_array_index(moves, NcMove, i);
            if (!nc_move_check_limits(interpreter->x.machine, made, error))
                return false;
        }
        if (read)
            read(interpreter, block.structure ? NULL : &block, (size_t)(next - text), n_before,
                 data);
        at = next;
    }
    if (!interpreter->x.modal.ended && nc_flow_open(interpreter->flow))
        return nc_flow_open_error(interpreter->flow, error);
    if (!interpreter->x.modal.ended) {
        return nc_word_error(error, interpreter->x.modal.line, NULL,
                             interpreter->x.modal.percent_open
                                 ? "the program ends without its second %%"
                                 : "the program ends without M2 or M30");
    }
    return true;
}

GArray *nc_read_program(const char *text, size_t length, const CfgMachine *machine,
                        const CfgToolTable *tools, GError **error)
{
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(machine, tools);
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    if (!nc_read_blocks(interpreter, text, length, moves, NULL, NULL, error))
        return NULL;
    return g_steal_pointer(&moves);
}
