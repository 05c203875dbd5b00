/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A run: the path between two places where the machine stands. Legs are its moves, corners where
 * two of them are joined by a blend, cells stretches of path with one set of limits.
 */
#ifndef NC_MOTION_RUN_H
#define NC_MOTION_RUN_H

#include "nc/motion/scurve.h"
#include "nc/motion/track.h"

/* Inverse limits of the axes; 0: none. */
typedef struct {
    int axes;    /* 3, or 6 where a rotary axis moves */
    bool smooth; /* some axis has a limit of jerk: blends are smooth to the second derivative */
    double per_v[NC_AXES], per_a[NC_AXES], per_j[NC_AXES];
    double window_s; /* blends need be no longer than the path of this time */
    double feed, rapid;
} NcLimits;

typedef struct {
    size_t move;
    double start, length;
    double slope[NC_AXES]; /* of a straight leg */
    double feed;           /* in force, a second; INFINITY: rapid */
    double programmed;     /* the same without overrides */
    double share;          /* of the axes' speeds; below 1 where rapids are slowed down */
    double speed;          /* as programmed, or less where the axes are slower */
    double tolerance;
    bool round;
    bool forbidden; /* by an override of 0 */
} NcLeg;

typedef struct {
    size_t leg; /* the one before */
    double at;  /* from the run's start */
    double half;
    double turned; /* by how much the slope changes */
    double tolerance;
    bool barrier; /* no other blend reaches into this one */
    bool round;   /* a leg of it is */
} NcCorner;

typedef struct {
    double length, v; /* v 0: of a forbidden leg */
    NcRate rate;
} NcCell;

typedef struct {
    const NcLimits *limits;
    const NcMove *moves;
    NcLeg *legs;
    size_t n_legs;
    double length;
    NcCorner *corners; /* room for n_legs */
    size_t n_corners;
    double *turned; /* sums of the corners' before each; room for n_legs + 1 */
    NcCell *cells;  /* room for 6·n_legs */
    size_t n_cells;
} NcRun;

/* By how much slope and bend jump from a leg to the next. */
void nc_run_jump(const NcRun *run, size_t leg, double slope[NC_AXES], double bend[NC_AXES]);

/* Finds the corners and gives each blend its width. */
void nc_run_blend(NcRun *run);

/* Cuts the path into cells. */
void nc_run_cells(NcRun *run);

/* Least tolerance: a tenth of a micrometre, and what "exact" means. */
#define NC_EXACT_MM 1e-4
/* With G61 the machine stops where the path turns by more: decimal places leave less of a tangent.
 */
#define NC_TANGENT_RAD 1e-3
#define NC_STRAIGHT_RAD 1e-9

/* The shares of an axis' acceleration and jerk that may turn the path (cells.c). */
#define NC_ACROSS 0.86602540378443865 /* √3/2 */
#define NC_JERK_ACROSS 0.5

#endif
