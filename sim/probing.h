/* SPDX-License-Identifier: Apache-2.0 */
/*
 * G38 of a program that is being read, answered by the material: as it is clamped when the reading
 * begins, cut by the program's moves so far. So what a program measures does not depend on when it
 * is read, nor on how it runs.
 */
#ifndef SIM_PROBING_H
#define SIM_PROBING_H

#include "sim/material.h"

typedef struct SimProbing SimProbing;

/* Nothing is copied, and no move looked at, before the first G38. */
SimProbing *sim_probing_new(SimMaterial *material);
void sim_probing_free(SimProbing *probing);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimProbing, sim_probing_free)

/* `moves` (GArray of NcMove) grows while they are read, until the next call; then, a program of
 * these moves has come of it, which is referenced. */
void sim_probing_begin(SimProbing *probing, const GArray *moves);
void sim_probing_read(SimProbing *probing, SimProgram *program);

/* The NcProbe; its data is the SimProbing. */
bool sim_probing_answer(const NcMove *move, bool away, SegVec3 *where, void *probing);

#endif
