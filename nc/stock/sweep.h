/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The volume that a body sweeps on a straight move, cut by a line. A convex body swept along a
 * straight move is convex, so the line meets it in one interval.
 */
#ifndef NC_STOCK_SWEEP_H
#define NC_STOCK_SWEEP_H

#include "nc/stock/cutter_body.h"

/* Each end of an interval lies within this of the surface of the swept volume, square to it, for
 * coordinates and moves up to 2 m. (Along a line that only grazes the surface no bound is possible:
 * there the ends' own place depends on the last digit of the input.) */
#define NC_SWEEP_ERROR_MM 1e-9

/*
 * The interval [t0, t1] of the line origin + t·direction that lies in `body` while its tip moves
 * from a to b, which may be the same point; false where they do not meet. `direction` is a unit
 * vector, any. `normals` (may be NULL) gets the outward unit normals of the swept volume at t0 and
 * t1. Closed form, but for the torus of a bull tool, whose ends come from Newton's method on the
 * distance to the swept disc: convex, so it approaches from one side and cannot miss.
 */
bool nc_swept_interval(const NcToolBody *body, SegVec3 a, SegVec3 b, SegVec3 origin,
                       SegVec3 direction, double *t0, double *t1, SegVec3 normals[2]);

#endif
