/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The controller of the virtual machine: a pure state machine that executes one program on a
 * virtual clock.
 *
 * The program's clock counts the machine's own seconds since START. It advances `speed` times as
 * fast as the clock passed in (or as fast as it is stepped, speed = INFINITY), and stands while the
 * machine waits for a person (HELD, PROGRAM_STOP). Programs are examined from the place where the
 * machine changes tools: there it stands at power-up, and from elsewhere START sends it back there
 * first. Block times come from the plan and from exactly
 * solved ramps (sim/ramp.h), never from summed steps, so they are the same at every speed.
 */
#ifndef SIM_CONTROLLER_H
#define SIM_CONTROLLER_H

#include "fieldbus/fieldbus.h"
#include "sim/program.h"

typedef struct {
    const CfgMachine *machine; /* outlives the controller */
    double speed;              /* program seconds a second; INFINITY: as fast as stepped */
    size_t moves_per_step;     /* at most: bounds the time of one step */
} SimControllerOptions;

typedef enum {
    SIM_TICK,         /* only the clock */
    SIM_LOAD,         /* a verified program, ready to start */
    SIM_FORGET,       /* drop it */
    SIM_START,        /* from its first block, READY or COMPLETE */
    SIM_HOLD,         /* brake on the path; a tool change is finished first */
    SIM_HOLD_AT_GATE, /* come to rest exactly at the next gate that can be reached */
    SIM_RESUME,       /* after a hold or a program stop; takes a gate hold back, too */
    SIM_ABORT,        /* brake and end the run */
    SIM_ESTOP,        /* the button: brake, end the run, and stay stopped */
    SIM_ACKNOWLEDGE,  /* by a person at the machine: the button is released, the alarm read */
} SimEventKind;

typedef struct {
    SimEventKind kind;
    SimProgram *program; /* SIM_LOAD: the controller takes it over */
} SimEvent;

typedef enum {
    SIM_STATE, /* the state changed */
    SIM_TELL,  /* the receiver has to hear of an event */
    SIM_BLOCK, /* a block has been executed */
} SimActionKind;

/* A block is a line of the program with at least one action. */
typedef struct {
    uint32_t line;
    NcMoveKind kind; /* of its last action */
    double start_s, end_s;
    SegVec3 position_mm;
    double feed_mm_min; /* programmed; 0 where nothing is fed */
} SimBlock;

typedef struct {
    SimActionKind kind;
    FbState state;        /* SIM_STATE */
    FbMachineEvent event; /* SIM_TELL */
    SimBlock block;       /* SIM_BLOCK */
    double time_s;        /* of the program's clock */
} SimAction;

/* Runs since the machine was switched on. */
typedef struct {
    uint32_t started, completed, aborted, stopped; /* stopped: by e-stop */
    double machine_s;                              /* the program's clock, summed */
} SimTotals;

typedef struct SimController SimController;

SimController *sim_controller_new(const SimControllerOptions *options);
void sim_controller_free(SimController *controller);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimController, sim_controller_free)

/* Steps to now_us, then by the event. Appends SimActions in the order of the program's clock.
 * An event that does not fit the state does nothing: the receiver has refused it already. */
void sim_controller_step(SimController *controller, const SimEvent *event, int64_t now_us,
                         GArray *actions);

/* Whether the program's clock runs: then it wants ticks. */
bool sim_controller_moving(const SimController *controller);
FbState sim_controller_state(const SimController *controller);

/* What the machine shows now. Position is that of the gauge point, machine coordinates. */
FbProgress sim_controller_progress(const SimController *controller);

SimTotals sim_controller_totals(const SimController *controller);

#endif
