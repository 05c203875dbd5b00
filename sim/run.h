/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A run: the part of the controller that carries a program out. What is executed is a row of
 * sections, each a SimProgram from rest to rest: the way to the place where the program begins,
 * then the stored program, or pass after pass of one that drips.
 */
#ifndef SIM_RUN_H
#define SIM_RUN_H

#include <math.h>

#include "sim/approach.h"
#include "sim/controller.h"
#include "sim/drive.h"
#include "sim/spindle.h"

/* What a stop that is under way, or prepared, is for. */
typedef enum {
    SIM_NO_STOP,
    SIM_STOP_HELD,
    SIM_STOP_PROGRAM,
    SIM_STOP_ABORTED,
    SIM_STOP_ESTOP /* or an alarm */
} SimStop;

/* No moment to be woken at. */
#define SIM_NEVER ((SimMoment){UINT32_MAX, INFINITY})

/* Why a machine that runs stands still. */
typedef enum { SIM_NO_WAIT, SIM_WAIT_PASS, SIM_WAIT_PLAN, SIM_WAIT_OVERRIDE } SimWait;

struct SimController {
    SimControllerOptions options;
    FbState state;
    int64_t now_us;
    uint64_t executed_blocks;
    SimPlace place; /* outside the sections */
    int tool;
    int work_offset; /* in force, 54 to 59 */
    bool optional_stop;
    NcOverride override;
    SimTotals totals; /* machine_s: of the runs that ended */

    SimProgram *program; /* stored; else NULL */
    bool drips;
    GQueue passes; /* SimProgram, not begun */
    bool fault;    /* the pass behind them cannot be executed */

    bool in_run;
    bool halted;      /* until RESUME */
    bool approaching; /* the section is the way to the program */
    size_t begin;     /* gate of RESTART; 0: START */
    SimDrive drive;   /* program NULL: between two sections */
    SimSpindle spindle;
    double programmed_rpm;
    bool spindle_override_off; /* M49, M51 P0 */
    double time_s;             /* the program's clock */
    double budget_s;           /* granted by the clock passed in, not yet used */
    double block_start_s;

    SimStop stop;
    bool gate_wanted; /* a hold at the next gate, once the plan's speed is reached */
    SimWait wait;
    int64_t wait_us; /* since when */

    SimMoment wake; /* asked for */
    bool woken;     /* the clock stands until the next tick */

    size_t gate;        /* the last one passed in this run */
    uint32_t last_line; /* of the sections left */
    uint32_t stop_line; /* first line not done when the last run ended; 0: none */
    uint32_t starved;
    int64_t starved_us;
};

/* Lets the program's clock run as far as the clock passed in grants, event by event. */
void sim_run_advance(SimController *c, int64_t now_us, bool ticked, GArray *actions);

void sim_run_start(SimController *c, size_t gate, GArray *actions);

/* At rest, or out of a stop: goes on, or waits for what it needs. */
void sim_run_set_off(SimController *c, GArray *actions);

/* A tool change is finished before a hold or abort: half a change is no place to stand. */
void sim_run_brake(SimController *c, SimStop stop, GArray *actions);

/* Looks for the first gate in front of which the plan can still be left in time; without one in
 * this section the next one is asked. Starving, it stands at a gate. */
void sim_run_hold_at_gate(SimController *c, GArray *actions);
void sim_run_resume(SimController *c, GArray *actions);

/* Overrides: the spindle follows at once, the axes when the plan is there. */
void sim_run_override(SimController *c, GArray *actions);
void sim_run_replan(SimController *c, GArray *actions);

/* A pass has come, or it is known that none can. */
void sim_run_feed(SimController *c, GArray *actions);

/* Microseconds of waiting for passes, so far in this run. */
int64_t sim_run_starved_us(const SimController *c);
SimPlace sim_run_place(const SimController *c);

/* Of the tool; not at the end of a section. */
double sim_run_speed_mm_s(const SimController *c);

/* Drops the passes of a program that drips. */
void sim_run_drop_passes(SimController *c);

/* The state changed; and the receiver has to hear of it. */
void sim_run_note(SimController *c, FbState state, GArray *actions);
void sim_run_tell(SimController *c, FbState state, FbMachineEvent event, GArray *actions);

#endif
