/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The drive of the axes: where on the path of one program the machine is at a moment of the
 * program's clock, and how fast. It follows the program's plan, leaves it by ramps (sim/ramp.h) and
 * comes back to it. What a move means, and why the machine stops, is not its business.
 */
#ifndef SIM_DRIVE_H
#define SIM_DRIVE_H

#include "sim/ramp.h"

/* How the program's clock and the plan's are tied together. */
typedef enum {
    SIM_STAND,  /* at rest, `done` of the move */
    SIM_FOLLOW, /* the plan at its own speed, offset_s later */
    SIM_RAMP,   /* along the pieces of `ramp` */
} SimMode;

typedef struct {
    SimProgram *program; /* NULL: none yet */
    SimPlan *plan;       /* to be followed */
    SimPlan *law;        /* what it is not faster than; another one than `plan` on the way down */
    SimMode mode;
    size_t move;     /* in execution, or next; program->n: at the end */
    double done;     /* STAND: of the move, mm of a path, else s */
    double offset_s; /* FOLLOW: the program's clock less the plan's */

    GArray *ramp; /* SimPiece; in RAMP, or prepared; never NULL */
    guint piece;
    double piece_start_s;
    bool stopping; /* RAMP: ends at rest, not on the plan */

    bool prepared; /* FOLLOW until `ramp` begins; or, empty, to the end of stop_move */
    size_t stop_move;
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

/* When, on the program's clock, the next thing happens: a move's, a piece's or a ramp's turn; then
 * it is made to happen. An override may let it stand behind that. */
double sim_drive_next_s(const SimDrive *drive);
unsigned sim_drive_happen(SimDrive *drive, double time_s);

/* Where it is; `speed` along the path. Not at the end. */
SimPlace sim_drive_place(const SimDrive *drive, double time_s);
SegVec3 sim_drive_position_mm(const SimDrive *drive, double time_s);

/* Seconds of the plan done of the move in execution, in FOLLOW. */
double sim_drive_move_s(const SimDrive *drive, double time_s);

#endif
