/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Part of nc/nc.h, which others include: how a machine drives canonical moves, and how long it
 * takes. Lengths in mm, angles in degrees, times s. docs/motion.md has the formulas.
 *
 * A motion is a smooth path p(s) and a speed along it. The path follows the programmed one, and
 * rounds its corners within the tolerance in force; s counts the programmed length (of X, Y, Z;
 * degrees where only A, B, C move), blends included, so every move has its own stretch of s. The
 * path does not depend on overrides: plans of one program with different overrides share it.
 */
#ifndef NC_MOTION_H
#define NC_MOTION_H

#include "nc/gcode.h"

/* ------------------------------------------------------------------- moves */

/* The move's path, from fraction 0 to 1 of its length. An arc whose radii differ within the
 * interpreter's tolerance is a spiral. */
double nc_move_length_mm(const NcMove *move);
SegVec3 nc_move_point(const NcMove *move, double fraction);

/* The smallest box around the move's path. */
void nc_move_bounds(const NcMove *move, SegVec3 *min, SegVec3 *max);

/* Whether the move leads along a path at all (it may still be of length zero). */
static inline bool nc_move_travels(const NcMove *move)
{
    return move->kind == NC_MOVE_RAPID || move->kind == NC_MOVE_FEED || move->kind == NC_MOVE_ARC ||
           move->kind == NC_MOVE_PROBE;
}

/* -------------------------------------------------------------------- plan */

/* What a person turns at the machine, in percent of what is programmed; 100 each: nothing. */
typedef struct {
    int feed, rapid, spindle;
} NcOverride;

#define NC_NO_OVERRIDE ((NcOverride){100, 100, 100})

/* The spindle's speed where `rpm` is programmed: within what the machine can, 0 stays 0. */
double nc_override_rpm(const CfgMachine *machine, NcOverride override, double rpm);

/* How n moves are driven. Immutable. */
typedef struct NcMotion NcMotion;

/*
 * Plans the moves within every axis' speed, acceleration and, where the machine has one, jerk,
 * looking ahead over all of them. With G64 P corners are rounded within P; with G64 alone each
 * corner may take half of the shorter move; with G61 the machine stops at all corners but tangents,
 * with G61.1 after every move. Tool changes, the spindle's ramps, dwells, coolant and orientation
 * take their times, and the axes stand meanwhile. A move that an override of 0 forbids takes no
 * time: whoever follows the plan stands before it. `spindle_rpm` is programmed before the first
 * move. `moves` are kept, and outlive the motion. O(n).
 */
NcMotion *nc_motion_new(const CfgMachine *machine, NcOverride override, double spindle_rpm,
                        const NcMove *moves, size_t n);
void nc_motion_free(NcMotion *motion);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcMotion, nc_motion_free)

/* Seconds since the first move's start at which a move begins; of move n: the end of all. */
double nc_motion_start_s(const NcMotion *motion, size_t move);
double nc_motion_duration_s(const NcMotion *motion, size_t move);
double nc_motion_total_s(const NcMotion *motion);

/* Where on the path a move ends. */
double nc_motion_end_mm(const NcMotion *motion, size_t move);

/* Whether an override of 0 forbids the move. */
bool nc_motion_forbids(const NcMotion *motion, size_t move);

/* False for what the axes stand still for. A message takes no time, and stops nothing. */
static inline bool nc_move_passes(const NcMove *move)
{
    return nc_move_travels(move) || move->kind == NC_MOVE_MESSAGE;
}

/* ------------------------------------------------------------------- place */

/* A place on the path and how fast it is passed. */
typedef struct {
    double s_mm, v_mm_s, a_mm_s2;
} NcAlong;

/* X, Y, Z in mm, A, B, C in degrees; machine coordinates of the gauge point. */
typedef struct {
    double position[6], velocity[6], acceleration[6];
} NcPoint;

NcAlong nc_motion_along(const NcMotion *motion, double t_s);

/* When the plan passes a place; where it stands there, the moment it comes. */
double nc_motion_time_s(const NcMotion *motion, double s_mm);

/* The point of the path for a place on `move` or near it. */
NcPoint nc_motion_point(const NcMotion *motion, size_t move, NcAlong along);

/* nc_motion_along and nc_motion_point of the move in execution at that time. */
NcPoint nc_motion_at(const NcMotion *motion, double t_s);

/* ----------------------------------------------------------------- detours */

/*
 * A detour leaves the plan's speed, on the same path and within the same limits: to rest for a
 * feed hold, from rest or from a lower speed back to the plan, to rest exactly at a gate. It is a
 * row of stretches of constant jerk.
 */
typedef struct {
    double duration_s;
    NcAlong from;
    double jerk_mm_s3;
} NcPhase;

NcAlong nc_phase_at(const NcPhase *phase, double t_s);

/* The time in the phase at which a place is passed; the place is within it. */
double nc_phase_time_s(const NcPhase *phase, double s_mm);

/*
 * From a place to the speed v_to as soon as the limits allow, GArray of NcPhase; with v_to = 0 it
 * ends at rest. `from` is on the plan or below it. Where the way ahead does not let it brake at
 * once (a corner comes that has to be slower), it first follows the plan; NULL where that cannot
 * be, because it is not on the plan.
 */
GArray *nc_motion_brake(const NcMotion *motion, NcAlong from, double v_to);

/* From a place on the plan, or below it, to a = 0; of no duration where jerk is not limited. False
 * where the speed would turn before, or be above the plan's or the run at its end meanwhile. */
bool nc_motion_level(const NcMotion *motion, NcAlong from, NcPhase *phase);

/*
 * From a place with a = 0, and no faster than the plan, back to the plan: GArray of NcPhase, and
 * the place where the plan is met, which it is followed from. NULL where the place is too fast to
 * slow down in time.
 */
GArray *nc_motion_join(const NcMotion *motion, NcAlong from, double *met_mm);

/* Off the plan to rest exactly at a place: GArray of NcPhase; the first begins where the plan is
 * left. Empty: the plan rests there. */
GArray *nc_motion_rest_at(const NcMotion *motion, double s_mm);

#endif
