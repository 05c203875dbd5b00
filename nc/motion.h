/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Part of nc/nc.h, which others include: how a machine drives canonical moves, and how long it
 * takes. Lengths in mm, angles in degrees, times s.
 */
#ifndef NC_MOTION_H
#define NC_MOTION_H

#include "nc/gcode.h"

/* ------------------------------------------------------------------ motion */

/* The move's path, from fraction 0 to 1 of its length. An arc whose radii differ within the
 * interpreter's tolerance is a spiral. */
double nc_move_length_mm(const NcMove *move);
SegVec3 nc_move_point(const NcMove *move, double fraction);

/* The smallest box around the move's path. */
void nc_move_bounds(const NcMove *move, SegVec3 *min, SegVec3 *max);

/* How a move is driven: distance and trapezoidal speed over its own time. */
typedef struct {
    double start_s; /* since the program's start */
    double duration_s;
    double length_mm;
    double v_in_mm_s, v_max_mm_s, v_out_mm_s;
    double a_mm_s2; /* acceleration along the move; 0 for what does not move */
} NcTimedMove;

/*
 * Plans the moves with the machine's accelerations: trapezoidal, per axis, looking ahead over all
 * of them. Corners are taken at the speed that keeps the path tolerance in force: with G61 the
 * machine stops at all but tangents, with G61.1 after every move; the rule, with its source, is in
 * nc/motion/plan.c. Tool changes, spindle ramps and dwells take their times, and the axes stand
 * meanwhile. Returns n NcTimedMoves (g_free); the end is last.start + duration. O(n).
 */
NcTimedMove *nc_motion_plan(const CfgMachine *machine, const NcMove *moves, size_t n);

/* What a person turns at the machine, in percent of what is programmed; 100 each: nothing. */
typedef struct {
    int feed, rapid, spindle;
} NcOverride;

#define NC_NO_OVERRIDE ((NcOverride){100, 100, 100})

/* The same with overrides, `spindle_rpm` programmed before the first move. A move that an override
 * of 0 forbids has v_max_mm_s 0 and takes no time: whoever follows the plan stands before it. */
NcTimedMove *nc_motion_plan_override(const CfgMachine *machine, NcOverride override,
                                     double spindle_rpm, const NcMove *moves, size_t n);

/* The spindle's speed where `rpm` is programmed: within what the machine can, 0 stays 0. */
double nc_override_rpm(const CfgMachine *machine, NcOverride override, double rpm);

/* Position on a move after `t_s` seconds of it. */
SegVec3 nc_motion_position(const NcMove *move, const NcTimedMove *timed, double t_s);

/* Speed at that time, mm/s. */
double nc_motion_speed_mm_s(const NcTimedMove *timed, double t_s);

#endif
