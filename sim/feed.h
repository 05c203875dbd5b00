/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What takes long: reading, checking and planning programs, in threads beside the main loop. The
 * link must not wait for it.
 */
#ifndef SIM_FEED_H
#define SIM_FEED_H

#include "sim/program.h"

typedef struct SimFeed SimFeed;

typedef struct {
    /* What was asked for has been examined: SimPrograms in order, and the error that ended it. The
     * callee takes the references that it needs. */
    void (*examined)(GPtrArray *programs, const GError *error, void *data);
    /* A program has been planned anew; the plan is the callee's. */
    void (*planned)(SimProgram *program, SimPlan *plan, void *data);
    void *data;
} SimFeedCallbacks;

/* Calls back in the default main context. `machine` and `tools` outlive it. */
SimFeed *sim_feed_new(const CfgMachine *machine, const CfgToolTable *tools,
                      const SimFeedCallbacks *callbacks);

/* Answers G38 of the programs that begin from now on; outlives it. */
struct SimMaterial;
void sim_feed_set_material(SimFeed *feed, struct SimMaterial *material);

/* Waits for what is under way. */
void sim_feed_free(SimFeed *feed);

/* Begins a program, and forgets the one there was, and what is being examined of it. */
void sim_feed_begin(SimFeed *feed);

/* Whether something is being examined: then nothing else may be given. */
bool sim_feed_busy(const SimFeed *feed);

/* Examines a whole program (copies the gates, which are as sim_reader_read wants them) … */
void sim_feed_program(SimFeed *feed, GBytes *bytes, const uint64_t *gates, size_t n_gates,
                      NcOverride override);

/* … or its next passes, an array of GBytes, taken over; `last`: the program ends with them. Each
 * becomes a SimProgram with one gate, its end. */
void sim_feed_passes(SimFeed *feed, GPtrArray *passes, bool last, NcOverride override);

/* Plans a program anew, one at a time: false where one is being planned. */
bool sim_feed_plan(SimFeed *feed, SimProgram *program, NcOverride override);

#endif
