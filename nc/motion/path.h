/* SPDX-License-Identifier: Apache-2.0 */
/* The geometry of one move: lines, arcs and helices. */
#ifndef NC_MOTION_PATH_H
#define NC_MOTION_PATH_H

#include "nc/nc.h"

/* Axes of a plane counted from 0, right-handed: first × second = normal. */
typedef struct {
    int first, second, normal;
} NcPlaneAxes;

NcPlaneAxes nc_plane_axes(int plane); /* 17, 18, 19 */

/* An arc or helix: at fraction f the angle is start + f·sweep, the radius and the coordinate along
 * the normal go linearly. */
typedef struct {
    NcPlaneAxes axes;
    double start_rad, sweep_rad; /* sweep: positive anticlockwise */
    double radius_from_mm, radius_to_mm;
    double rise_mm;
    double length_mm;
} NcArc;

NcArc nc_arc(const NcMove *move);

static inline double *nc_axis(SegVec3 *v, int axis)
{
    return axis == 0 ? &v->x : axis == 1 ? &v->y : &v->z;
}

static inline double nc_axis_value(SegVec3 v, int axis)
{
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

#endif
