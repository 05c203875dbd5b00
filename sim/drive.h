/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drive of the axes: where on the path of one program the machine is at a moment of the
 * program's clock, and how fast. It follows the program's plan, leaves it by detours (nc/motion.h)
 * and comes back to it. What a move means, and why the machine stops, is not its business.
 *
 * Detours are solved exactly, phase by phase, when they are asked for: how often anybody looks at
 * the clock changes nothing.
 */
#ifndef SIM_DRIVE_H
#define SIM_DRIVE_H

#include "sim/program.h"

/* How the program's clock and the plan's are tied together. */
typedef enum {
    SIM_STAND,  /* at rest: `at_mm` of the path, or `done_s` of a move that is none */
    SIM_FOLLOW, /* the plan at its own speed, offset_s later */
    SIM_DETOUR, /* along the phases of `detour` */
} SimMode;

typedef struct {
    SimProgram *program; /* NULL: none yet */
    SimPlan *plan;       /* to be followed */
    SimPlan *law;        /* what a detour's first law_phases are not faster than; then it is plan */
    guint law_phases;
    SimMode mode;
    size_t move; /* in execution, or next; program->n: at the end */
    double at_mm, done_s;
    double offset_s; /* FOLLOW: the program's clock less the plan's */

    GArray *detour; /* NcPhase; in DETOUR, or prepared; never NULL */
    guint phase;
    double phase_start_s;
    double met_mm;    /* where the plan is met */
    bool stopping;    /* DETOUR: is a stop that was asked for; else it leads to the plan, or */
    bool to_rest;     /* ends at rest nevertheless */
    bool stop_wanted; /* as soon as the detour is over */
    bool plan_wanted; /* the same for a newer plan */

    bool prepared; /* FOLLOW until `detour` begins; or, empty, to the end of stop_move */
    size_t stop_move;
    double leaves_s; /* when on the plan's clock `detour` begins */
} SimDrive;

/* What has happened, any of: */
enum {
    SIM_MOVE_DONE = 1, /* the move before drive->move has been executed */
    SIM_AT_REST = 2,   /* a stop that was asked for is over */
};

void sim_drive_init(SimDrive *drive);
void sim_drive_clear(SimDrive *drive);

/* Stands before a move of a program (takes a reference) and its newest plan. */
void sim_drive_enter(SimDrive *drive, SimProgram *program, size_t move);

/* Stands, with no program. */
void sim_drive_leave(SimDrive *drive);

/* Sets off for the plan, from rest or out of a stop; false: an override of 0 forbids the move, and
 * it stands. Not at the end. */
bool sim_drive_go(SimDrive *drive, double time_s);

/* Brakes; at rest already, or on what is no path: stands at once. */
void sim_drive_brake(SimDrive *drive, double time_s);

/* Stands, here and now. */
void sim_drive_stand(SimDrive *drive, double time_s);

/* Follows the program's newest plan from here on. */
void sim_drive_replan(SimDrive *drive, double time_s);

/* Out of FOLLOW: will come to rest exactly at the end of a move; false where it is too late. */
bool sim_drive_prepare_stop(SimDrive *drive, size_t move, double time_s);
void sim_drive_cancel_stop(SimDrive *drive);

/* Out of FOLLOW: the move in execution takes longer. */
void sim_drive_delay(SimDrive *drive, double delay_s);

/* When, on the program's clock, the next thing happens: a move's or a phase's end; then it is made
 * to happen. An override may let it stand behind that. */
double sim_drive_next_s(const SimDrive *drive);
unsigned sim_drive_happen(SimDrive *drive, double time_s);

/* Where it is. Not at the end. */
NcPoint sim_drive_point(const SimDrive *drive, double time_s);

/* The share of the path's move that it stands in, of which it has come so far; else 0. */
double sim_drive_part(const SimDrive *drive);

/* Seconds of the plan done of the move in execution, in FOLLOW. */
double sim_drive_move_s(const SimDrive *drive, double time_s);

#endif
