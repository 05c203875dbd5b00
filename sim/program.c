/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/program.h"

#include <string.h>

#include "sim/alarm.h"

static GArray *read_moves(GBytes *bytes, const CfgMachine *machine, const CfgToolTable *tools,
                          GError **error);
static void find_gates(SimProgram *program, GBytes *bytes, const uint64_t *gates, size_t n_gates);

SimProgram *sim_program_new(GBytes *bytes, const uint64_t *gates, size_t n_gates,
                            const CfgMachine *machine, const CfgToolTable *tools, GError **error)
{
    g_autoptr(GArray) moves = read_moves(bytes, machine, tools, error);
    if (!moves)
        return NULL;
    SimProgram *program = sim_program_from_moves(g_steal_pointer(&moves), machine);
    find_gates(program, bytes, gates, n_gates);
    g_autofree char *sha256 = g_compute_checksum_for_bytes(G_CHECKSUM_SHA256, bytes);
    g_strlcpy(program->sha256, sha256, sizeof program->sha256);
    return program;
}

SimProgram *sim_program_from_moves(GArray *moves, const CfgMachine *machine)
{
    SimProgram *program = g_new0(SimProgram, 1);
    program->n = moves->len;
    program->moves = (NcMove *)(void *)g_array_free(moves, FALSE);
    program->timed = nc_motion_plan(machine, program->moves, program->n);
    return program;
}

void sim_program_free(SimProgram *program)
{
    if (!program)
        return;
    g_free(program->moves);
    g_free(program->timed);
    g_free(program->gates);
    g_free(program);
}

double sim_program_duration_s(const SimProgram *program)
{
    const NcTimedMove *last = &program->timed[program->n - 1];
    return last->start_s + last->duration_s;
}

static GArray *read_moves(GBytes *bytes, const CfgMachine *machine, const CfgToolTable *tools,
                          GError **error)
{
    g_autoptr(GError) cause = NULL;
    size_t length;
    const char *text = g_bytes_get_data(bytes, &length);
    GArray *moves = nc_read_program(text ? text : "", length, machine, tools, &cause);
    if (!moves) {
        SimAlarm alarm =
            g_error_matches(cause, NC_ERROR, NC_ERROR_LIMIT) ? SIM_ALARM_LIMIT : SIM_ALARM_PROGRAM;
        g_set_error_literal(error, SIM_ALARM, (int)alarm, cause->message);
    }
    return moves;
}

/* A gate lies behind a newline, so the blocks before it are the lines counted up to there. */
static void find_gates(SimProgram *program, GBytes *bytes, const uint64_t *gates, size_t n_gates)
{
    size_t length;
    const char *text = g_bytes_get_data(bytes, &length);
    program->gates = g_new(size_t, n_gates);
    program->n_gates = n_gates;
    const char *at = text;
    uint32_t line = 0;
    size_t move = 0;
    for (size_t g = 0; g < n_gates; g++) {
        const char *end = text + MIN(gates[g], length);
        for (const char *newline;
             at < end && (newline = memchr(at, '\n', (size_t)(end - at))) != NULL; at = newline + 1)
            line++;
        while (move < program->n && program->moves[move].line <= line)
            move++;
        program->gates[g] = move;
    }
}
