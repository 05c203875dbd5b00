/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/program.h"

#include <string.h>

#include "sim/alarm.h"
#include "sim/probing.h"

struct SimReader {
    NcInterpreter *interpreter;
    const CfgMachine *machine;
    SimProbing *probing; /* NULL: nobody answers G38 */
    uint32_t line;       /* the last one read */
    double spindle_rpm;  /* programmed there */
    bool ended;          /* what follows is no part of the program */
};

/* What is being read. */
typedef struct {
    GArray *moves;
    const uint64_t *gates;
    size_t n_gates, n_found;
    size_t *found;
} Reading;

static bool read_lines(SimReader *reader, GBytes *bytes, Reading *reading, GError **error);
static bool read_line(SimReader *reader, const char *line, size_t length, GArray *moves,
                      GError **error);
static void pass_gates(Reading *reading, uint64_t offset);
static char **take_messages(const SimReader *reader, GArray *moves);

SimProgram *sim_reader_read(SimReader *reader, GBytes *bytes, const uint64_t *gates, size_t n_gates,
                            bool last, NcOverride override, GError **error)
{
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autofree size_t *found = g_new(size_t, n_gates);
    g_autoptr(GError) cause = NULL;
    Reading reading = {.moves = moves, .gates = gates, .n_gates = n_gates, .found = found};
    const double spindle_rpm = reader->spindle_rpm;
    if (reader->probing)
        sim_probing_begin(reader->probing, moves);
    if (!read_lines(reader, bytes, &reading, &cause)) {
        SimAlarm alarm =
            g_error_matches(cause, NC_ERROR, NC_ERROR_LIMIT) ? SIM_ALARM_LIMIT : SIM_ALARM_PROGRAM;
        g_set_error_literal(error, SIM_ALARM, (int)alarm, cause->message);
        return NULL;
    }
    if (last && !reader->ended) {
        g_set_error(error, SIM_ALARM, SIM_ALARM_PROGRAM,
                    "line %u: the program ends without M2, M30 or its second %%", reader->line);
        return NULL;
    }
    SimProgram *program = g_atomic_rc_box_new0(SimProgram);
    program->messages = take_messages(reader, moves);
    program->n = moves->len;
    program->moves = (NcMove *)(void *)g_array_free(g_steal_pointer(&moves), FALSE);
    program->spindle_rpm = spindle_rpm;
    program->last_line = reader->line;
    program->gates = g_steal_pointer(&found);
    program->n_gates = n_gates;
    program->plan = sim_plan_new(program, reader->machine, override);
    if (program->n > 0)
        reader->spindle_rpm = program->moves[program->n - 1].spindle_rpm;
    if (reader->probing)
        sim_probing_read(reader->probing, program);
    return program;
}

/* A pass is executed while the next one is read: it has its texts for itself. */
static char **take_messages(const SimReader *reader, GArray *moves)
{
    GPtrArray *texts = g_ptr_array_new();
    for (guint i = 0; i < moves->len; i++) {
        NcMove *move = &g_array_index(moves, NcMove, i);
        if (move->kind != NC_MOVE_MESSAGE)
            continue;
        g_ptr_array_add(texts, g_strdup(nc_interpreter_message(reader->interpreter, move)));
        move->message = (int)texts->len - 1;
    }
    g_ptr_array_add(texts, NULL);
    return (char **)g_ptr_array_free(texts, FALSE);
}

static bool read_lines(SimReader *reader, GBytes *bytes, Reading *reading, GError **error)
{
    size_t length;
    const char *text = g_bytes_get_data(bytes, &length);
    for (size_t at = 0; at < length && !reader->ended;) {
        const char *newline = memchr(text + at, '\n', length - at);
        size_t next = newline ? (size_t)(newline + 1 - text) : length;
        pass_gates(reading, at);
        if (!read_line(reader, text + at, next - at, reading->moves, error))
            return false;
        at = next;
    }
    pass_gates(reading, UINT64_MAX);
    return true;
}

static bool read_line(SimReader *reader, const char *line, size_t length, GArray *moves,
                      GError **error)
{
    guint before = moves->len;
    reader->line++;
    if (!nc_interpreter_block(reader->interpreter, line, length, moves, error))
        return false;
    for (guint i = before; i < moves->len; i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        if (!nc_move_check_limits(reader->machine, move, error))
            return false;
        reader->ended = reader->ended || move->kind == NC_MOVE_END;
    }
    return true;
}

/* Gates up to `offset` have the moves read so far before them. */
static void pass_gates(Reading *reading, uint64_t offset)
{
    while (reading->n_found < reading->n_gates && reading->gates[reading->n_found] <= offset)
        reading->found[reading->n_found++] = reading->moves->len;
}

SimReader *sim_reader_new(const CfgMachine *machine, const CfgToolTable *tools)
{
    SimReader *reader = g_atomic_rc_box_new0(SimReader);
    reader->interpreter = nc_interpreter_new(machine, tools);
    reader->machine = machine;
    return reader;
}

SimReader *sim_reader_ref(SimReader *reader)
{
    return g_atomic_rc_box_acquire(reader);
}

void sim_reader_set_probing(SimReader *reader, SimProbing *probing)
{
    reader->probing = probing;
    nc_interpreter_set_probe(reader->interpreter, sim_probing_answer, probing);
}

static void reader_clear(void *reader)
{
    nc_interpreter_free(((SimReader *)reader)->interpreter);
    sim_probing_free(((SimReader *)reader)->probing);
}

void sim_reader_unref(SimReader *reader)
{
    if (reader)
        g_atomic_rc_box_release_full(reader, reader_clear);
}

/* ------------------------------------------------------------------------ programs */

SimProgram *sim_program_from_moves(GArray *moves, const CfgMachine *machine, NcOverride override)
{
    SimProgram *program = g_atomic_rc_box_new0(SimProgram);
    program->n = moves->len;
    program->moves = (NcMove *)(void *)g_array_free(moves, FALSE);
    program->plan = sim_plan_new(program, machine, override);
    return program;
}

SimProgram *sim_program_ref(SimProgram *program)
{
    return g_atomic_rc_box_acquire(program);
}

static void program_clear(void *data)
{
    SimProgram *program = data;
    g_free(program->moves);
    g_strfreev(program->messages);
    g_free(program->gates);
    sim_plan_unref(program->plan);
}

void sim_program_unref(SimProgram *program)
{
    if (program)
        g_atomic_rc_box_release_full(program, program_clear);
}

double sim_program_duration_s(const SimProgram *program)
{
    if (program->n == 0)
        return 0;
    return nc_motion_total_s(program->plan->motion);
}

void sim_program_set_plan(SimProgram *program, SimPlan *plan)
{
    sim_plan_unref(program->plan);
    program->plan = plan;
}

SimPlan *sim_plan_new(const SimProgram *program, const CfgMachine *machine, NcOverride override)
{
    SimPlan *plan = g_atomic_rc_box_new0(SimPlan);
    plan->override = override;
    plan->motion =
        nc_motion_new(machine, override, program->spindle_rpm, program->moves, program->n);
    return plan;
}

SimPlan *sim_plan_ref(SimPlan *plan)
{
    return g_atomic_rc_box_acquire(plan);
}

static void plan_clear(void *plan)
{
    nc_motion_free(((SimPlan *)plan)->motion);
}

void sim_plan_unref(SimPlan *plan)
{
    if (plan)
        g_atomic_rc_box_release_full(plan, plan_clear);
}

bool sim_same_override(NcOverride a, NcOverride b)
{
    return a.feed == b.feed && a.rapid == b.rapid && a.spindle == b.spindle;
}
