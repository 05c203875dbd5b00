/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Ramps: how a feed hold leaves the planned speed along the path, how a resume comes back to it,
 * and how an override leads from one plan to another.
 *
 * A plan (nc_motion_plan) gives each move a trapezoid of speed over the path: at distance p of a
 * move, v²(p) = min(v_in² + 2ap, v_max², v_out² + 2a(L - p)). A ramp is a speed w(p) on the SAME
 * path whose slope is ±a of the move it is on: dw²/dp = ±2a.
 *
 * Why the limits of the axes are kept. A plan keeps them at corners, on arcs and along moves, and
 * it nowhere falls faster than its own a. So a speed that is at most the plan's, and falls as fast
 * as that a, stays at most the plan's: a ramp BELOW a plan keeps the limits with that plan's a, up
 * and down. A ramp that comes from a faster plan falls with the a of that one, which is its LAW,
 * until it is down at the new plan: it is below the faster plan all the while. (On arcs a depends
 * on the feed, as the turn takes its share of what the axes can; so the two are not the same.)
 *
 * Ramps are solved exactly, piece by piece, when they are asked for: how often anybody looks at the
 * clock changes nothing.
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

/* From a place, where the speed is at most that of `law`, to rest as soon as its accelerations
 * allow. GArray of SimPiece in time order; empty: at rest already. Stops at the end of the last
 * moving move at the latest. */
GArray *sim_ramp_stop(const SimProgram *program, const SimPlan *law, SimPlace from);

/* From a place to the speed of `plan`: up with the accelerations of `plan`, or down with those of
 * `law`, which the speed is at most that of. Empty: has it already. */
GArray *sim_ramp_meet(const SimProgram *program, const SimPlan *law, const SimPlan *plan,
                      SimPlace from);

/* From the speed of `plan` to rest exactly at the end of `move`. Empty: the plan rests there. */
GArray *sim_ramp_stop_at(const SimProgram *program, const SimPlan *plan, size_t move);

/* Whether the place is faster than the plan there, by more than rounding. */
bool sim_ramp_above(const SimProgram *program, const SimPlan *plan, SimPlace place);

/* A plan's own distance along a move after t_s of it, and back; exact inverses but for rounding. */
double sim_plan_distance_mm(const NcTimedMove *timed, double t_s);
double sim_plan_time_s(const NcTimedMove *timed, double distance_mm);

/* A move of the path, though it may have no length; those that have none take no time. */
bool sim_travels(const SimProgram *program, size_t move);

/* False for dwells, tool changes, …, which take time but no path. */
bool sim_plan_moves(const NcTimedMove *timed);

/* An override of 0 forbids the move: the plan stands before it. */
bool sim_plan_forbids(const NcTimedMove *timed);

#endif
