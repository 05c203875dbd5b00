/* SPDX-License-Identifier: Apache-2.0 */
/* A delivered program as the machine executes it: read, checked and planned; immutable. */
#ifndef SIM_PROGRAM_H
#define SIM_PROGRAM_H

#include "config/config.h"
#include "nc/nc.h"

typedef struct {
    NcMove *moves; /* the last is the NC_MOVE_END */
    NcTimedMove *timed;
    size_t n;
    size_t *gates; /* number of moves before each gate, ascending */
    size_t n_gates;
    char sha256[65];
} SimProgram;

/*
 * Reads, checks and plans `bytes`; `gates` are byte offsets just behind a newline, as OPEN names
 * them. Errors: SIM_ALARM with a SimAlarm as code; the message names line, column and word.
 * Touches nothing but its arguments, so it may run in a thread.
 */
SimProgram *sim_program_new(GBytes *bytes, const uint64_t *gates, size_t n_gates,
                            const CfgMachine *machine, const CfgToolTable *tools, GError **error);

/* Takes over `moves`, which end with an NC_MOVE_END, and plans them; no gates, no hash. */
SimProgram *sim_program_from_moves(GArray *moves, const CfgMachine *machine);
void sim_program_free(SimProgram *program);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimProgram, sim_program_free)

/* Seconds from start to end without a hold. */
double sim_program_duration_s(const SimProgram *program);

#endif
