/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A delivered program as the machine executes it: read, checked and planned.
 *
 * A stored program is one SimProgram. One that drips is a row of them, a pass each: one reader
 * reads them all, so the modal state goes on, and each is planned from rest to rest.
 */
#ifndef SIM_PROGRAM_H
#define SIM_PROGRAM_H

#include "config/config.h"
#include "nc/nc.h"

/* How the moves of a program are driven; immutable, counted. */
typedef struct {
    NcOverride override;
    NcMotion *motion;
} SimPlan;

/* All but `plan` is immutable; counted, so that it may be planned anew in a thread. */
typedef struct {
    NcMove *moves; /* a whole program's last is the NC_MOVE_END; a pass may have none at all */
    size_t n;
    double spindle_rpm; /* programmed before the first move */
    uint32_t last_line; /* of the bytes that it was read from */
    char **messages;    /* texts of its NC_MOVE_MESSAGEs, which number them from 0 */
    size_t *gates;      /* number of moves before each gate, ascending */
    size_t n_gates;
    SimPlan *plan; /* the newest; whoever executes the program may set another */
} SimProgram;

/* Reads one program, as a whole or pass by pass, in one modal state. Not for two threads at a
 * time. Counted. `machine` and `tools` outlive it. */
typedef struct SimReader SimReader;

SimReader *sim_reader_new(const CfgMachine *machine, const CfgToolTable *tools);
/* Who answers G38, until then nobody; taken over. */
struct SimProbing;
void sim_reader_set_probing(SimReader *reader, struct SimProbing *probing);
SimReader *sim_reader_ref(SimReader *reader);
void sim_reader_unref(SimReader *reader);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimReader, sim_reader_unref)

/*
 * Reads, checks and plans the program's next `bytes`, which end with a line; `last`: the program
 * has to end in them. `gates` are offsets in `bytes`, just behind a newline. Errors: SIM_ALARM with
 * a SimAlarm as code; the message names line, column and word.
 */
SimProgram *sim_reader_read(SimReader *reader, GBytes *bytes, const uint64_t *gates, size_t n_gates,
                            bool last, NcOverride override, GError **error);

/* Takes over `moves` and plans them; no gates, no hash. */
SimProgram *sim_program_from_moves(GArray *moves, const CfgMachine *machine, NcOverride override);
SimProgram *sim_program_ref(SimProgram *program);
void sim_program_unref(SimProgram *program);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimProgram, sim_program_unref)

/* Seconds from start to end without a hold. */
double sim_program_duration_s(const SimProgram *program);

/* Takes the plan over. */
void sim_program_set_plan(SimProgram *program, SimPlan *plan);

SimPlan *sim_plan_new(const SimProgram *program, const CfgMachine *machine, NcOverride override);
SimPlan *sim_plan_ref(SimPlan *plan);
void sim_plan_unref(SimPlan *plan);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimPlan, sim_plan_unref)

bool sim_same_override(NcOverride a, NcOverride b);

#endif
