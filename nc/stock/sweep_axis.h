/* SPDX-License-Identifier: Apache-2.0 */
/*
 * nc_swept_interval on lines parallel to the axes, many times faster, with the same bound on the
 * error. There the sweep's section is simple: a level one is the hull of two discs, and over a
 * point (x, y) the lower face has one lowest place.
 */
#ifndef NC_STOCK_SWEEP_AXIS_H
#define NC_STOCK_SWEEP_AXIS_H

#include "nc/stock/sweep.h"

/* The line through `origin` along X or Y (`axis` 0 or 1): the interval of that coordinate, and the
 * outward unit normals at its ends. */
bool nc_swept_level(const NcToolBody *body, SegVec3 a, SegVec3 b, int axis, SegVec3 origin,
                    double t[2], SegVec3 normals[2]);

/* The lower end of what is swept over (x, y): its z and outward unit normal. */
bool nc_swept_floor(const NcToolBody *body, SegVec3 a, SegVec3 b, double x, double y, double *z,
                    SegVec3 *normal);

/* Whether a point lies in the swept volume; decided by nc_swept_level on the line through it along
 * X, so that all who ask get one answer. */
bool nc_swept_contains(const NcToolBody *body, SegVec3 a, SegVec3 b, SegVec3 point);

#endif
