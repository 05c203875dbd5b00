/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Ramps: how a feed hold leaves the planned speed along the path, and how a resume comes back.
 *
 * The plan (nc_motion_plan) gives each move a trapezoid of speed over the path: at distance p of a
 * move, v²(p) = min(v_in² + 2ap, v_max², v_out² + 2a(L - p)). A ramp is a speed w(p) <= v(p) on the
 * SAME path whose slope is ±a of the move it is on: dw²/dp = ±2a. As w never exceeds v and a is the
 * acceleration that the axes allow along that move, corners, arcs and axis limits are all kept.
 * The ramps are solved exactly, piece by piece, when the hold or resume comes: how often anybody
 * looks at the clock changes nothing.
 */
#ifndef SIM_RAMP_H
#define SIM_RAMP_H

#include "sim/program.h"

/* A place on the path, and the speed there. */
typedef struct {
    size_t move;
    double at_mm; /* from the move's start */
    double speed_mm_s;
} SimPlace;

/* Constant acceleration over a stretch of one move. */
typedef struct {
    size_t move;
    double from_mm, to_mm;
    double from_mm_s, to_mm_s;
    double duration_s;
    bool ends_move; /* to_mm is the move's end */
} SimPiece;

/* From a place to rest as soon as the accelerations allow. GArray of SimPiece in time order; empty:
 * at rest already. Stops at the end of the last moving move at the latest. */
GArray *sim_ramp_stop(const SimProgram *program, SimPlace from);

/* From a place back to the planned speed. Empty: has it already. */
GArray *sim_ramp_resume(const SimProgram *program, SimPlace from);

/* From the planned speed to rest exactly at the end of `move`. Empty: the plan rests there. */
GArray *sim_ramp_stop_at(const SimProgram *program, size_t move);

/* The plan's own distance along a move after t_s of it, and back; exact inverses but for rounding.
 */
double sim_plan_distance_mm(const NcTimedMove *timed, double t_s);
double sim_plan_time_s(const NcTimedMove *timed, double distance_mm);

/* False for dwells, tool changes, …, which take time but no path. */
bool sim_plan_moves(const NcTimedMove *timed);

#endif
