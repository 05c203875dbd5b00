/* SPDX-License-Identifier: Apache-2.0 */
/* The way to the place where a program begins, or goes on at a gate. */
#ifndef SIM_APPROACH_H
#define SIM_APPROACH_H

#include "sim/program.h"

/* The gauge point, and A, B, C. */
typedef struct {
    SegVec3 mm, deg;
} SimPlace;

/* A place of a program, and what the machine has to be like there. */
typedef struct {
    SimPlace place;
    int tool;           /* 0: whichever is in the spindle */
    double spindle_rpm; /* as programmed */
    bool coolant_mist, coolant_flood;
    int work_offset;
} SimSituation;

/* As if all before the gate had been executed; gates count from 1. Where a corner is rounded at the
 * gate, that is the place on the rounding. */
SimSituation sim_situation_at_gate(const SimProgram *program, size_t gate);

/*
 * To the top of the travel; the tool, where another one is in the spindle, at the place where tools
 * are changed; across at the top, A, B, C with it; the spindle up to speed and the coolant on; and
 * only then down. Rapids that stop exactly. Whatever is clamped on the table, no higher way leads
 * over it. The moves have line 0, and one gate: the end, where the machine may be held.
 */
SimProgram *sim_approach_new(const CfgMachine *machine, SimPlace from, int tool, SimSituation to,
                             NcOverride override);

#endif
