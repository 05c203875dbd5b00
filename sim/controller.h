/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The controller of the virtual machine: a pure state machine that executes one program on a
 * virtual clock.
 *
 * The program's clock counts the machine's own seconds since START. It advances `speed` times as
 * fast as the clock passed in (or as fast as it is stepped, speed = INFINITY), and stands while the
 * machine waits: for a person (HELD, PROGRAM_STOP, an override of 0), for the next pass of a
 * program that drips, for a plan. Programs are examined from the place where the machine changes
 * tools: there it stands at power-up, and from elsewhere START sends it back there first. Block
 * times come from the plan and from exactly solved detours (nc/motion.h), never from summed steps,
 * so they are the same at every speed.
 *
 * Overrides: whoever steps the controller asks for sim_controller_unplanned after each step, plans
 * that program anew, in a thread if it is long, and brings the plan as SIM_PLAN. A run goes on by
 * the old plan until then; out of rest it waits for the new one.
 */
#ifndef SIM_CONTROLLER_H
#define SIM_CONTROLLER_H

#include "fieldbus/fieldbus.h"
#include "sim/course.h"

typedef struct {
    const CfgMachine *machine; /* outlives the controller */
    double speed;              /* program seconds a second; INFINITY: as fast as stepped */
    size_t moves_per_step;     /* at most: bounds the time of one step */
    SimCourse *course;         /* gets what is executed, and outlives it; NULL: nobody asks */
} SimControllerOptions;

typedef enum {
    SIM_TICK,          /* only the clock */
    SIM_LOAD,          /* a verified program, ready to start */
    SIM_PASS,          /* of a program that drips: the next one */
    SIM_FORGET,        /* drop it */
    SIM_START,         /* from its first block, READY or COMPLETE */
    SIM_RESTART,       /* the same from a gate of a stored program */
    SIM_HOLD,          /* brake on the path; a tool change is finished first */
    SIM_HOLD_AT_GATE,  /* come to rest exactly at the next gate that can be reached */
    SIM_RESUME,        /* after a hold or a program stop; takes a gate hold back, too */
    SIM_ABORT,         /* brake and end the run */
    SIM_ESTOP,         /* the button: brake, end the run, and stay stopped */
    SIM_FAIL,          /* a fault of the machine: the same, as an alarm */
    SIM_OVERRIDE,      /* feed, rapids, spindle */
    SIM_PLAN,          /* what sim_controller_unplanned asked for */
    SIM_OPTIONAL_STOP, /* the switch that M1 asks for */
    SIM_ACKNOWLEDGE,   /* by a person at the machine: the button is released, the alarm read */
} SimEventKind;

typedef struct {
    SimEventKind kind;
    /* LOAD, taken over: NULL for a program that drips. PASS, taken over: NULL where the machine
     * cannot execute it; then the run ends with an alarm at the gate before it. PLAN: whose plan.
     */
    SimProgram *program;
    SimPlan *plan;       /* PLAN; taken over */
    size_t gate;         /* RESTART; from 1 */
    NcOverride override; /* OVERRIDE */
    bool on;             /* OPTIONAL_STOP */
} SimEvent;

typedef enum {
    SIM_STATE,     /* the state changed */
    SIM_TELL,      /* the receiver has to hear of an event */
    SIM_BLOCK,     /* a block has been executed */
    SIM_WAY,       /* a move of the way to where the program begins or goes on */
    SIM_MESSAGE,   /* the program says something to the person at the machine */
    SIM_OVERRIDES, /* a run goes on by a plan with these */
    SIM_WOKEN,     /* the moment asked for has come: the last action of its step */
} SimActionKind;

/* A block is a line of the program with at least one action; one in a loop or a subroutine is a
 * block each time. */
typedef struct {
    uint32_t line;       /* as NcMove: what the machine shows */
    uint32_t block_line; /* its own */
    NcMoveKind kind;     /* of its last action */
    double start_s, end_s;
    SegVec3 position_mm;
    bool turns;             /* the machine has an axis A, B or C */
    double position_deg[3]; /* of those */
    double feed_mm_min;     /* programmed; 0 where nothing is fed */
    int tool;               /* in the spindle at its end */
    double spindle_rpm;     /* reached at its end */
} SimBlock;

typedef struct {
    SimActionKind kind;
    FbState state;        /* SIM_STATE */
    FbMachineEvent event; /* SIM_TELL */
    SimBlock block;       /* SIM_BLOCK; SIM_WAY, where line is 0 */
    NcOverride override;  /* SIM_OVERRIDES */
    double time_s;        /* of the program's clock */
    uint32_t line;        /* SIM_WOKEN: the block that begins or is in execution; SIM_MESSAGE */
    char *text;           /* SIM_MESSAGE; whoever carries it out takes it over */
} SimAction;

/* A moment of a run: before a block of this line or a later one, or at this time of the program's
 * clock, whichever comes first; the same moment at every speed. */
typedef struct {
    uint32_t line; /* UINT32_MAX: none */
    double time_s; /* INFINITY: none */
} SimMoment;

/* Runs since the machine was switched on. */
typedef struct {
    uint32_t started, completed, aborted, stopped; /* stopped: by e-stop or alarm */
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

/* Asks for SIM_WOKEN, once: the clock then stands until the next tick, so that what is done before
 * is done at that moment. Another moment takes the place of the one before. */
void sim_controller_wake(SimController *controller, SimMoment moment);

/* Whether the program's clock runs: then it wants ticks. Starving it does not, but what is shown
 * grows older. */
bool sim_controller_moving(const SimController *controller);

/* A program whose plan has other overrides than are in force; NULL: none. The controller's. */
SimProgram *sim_controller_unplanned(const SimController *controller, NcOverride *override);
FbState sim_controller_state(const SimController *controller);

/* What the machine shows now. Position is that of the gauge point, machine coordinates. */
FbProgress sim_controller_progress(const SimController *controller);

SimTotals sim_controller_totals(const SimController *controller);

#endif
