/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The body of all points within a distance r of a triangle mesh, as a union of convex parts: for
 * each face the slab from r below it to r above it, for each edge that the slabs leave open the
 * points within r of it.
 */
#ifndef NC_STOCK_ROUNDED_H
#define NC_STOCK_ROUNDED_H

#include "nc/nc.h"

typedef struct {
    int n; /* corners: 2 an edge, 3 a face */
    SegVec3 p[3];
    SegVec3 normal;  /* of a face: unit, outward */
    SegVec3 side[3]; /* of a face: unit, in its plane, outward from p[i]-p[i+1] */
} NcRoundedPart;

/* Where a line parallel to an axis lies in a part, as coordinates along the axis, and the outward
 * normals there. */
typedef struct {
    double t[2];
    SegVec3 normal[2];
} NcSpan;

bool nc_rounded_span(const NcRoundedPart *part, double r, int axis, SegVec3 origin, NcSpan *span);

/* Where the line passes through a face itself, into the body or out of it; false for an edge. */
bool nc_rounded_crossing(const NcRoundedPart *part, int axis, SegVec3 origin, double *t,
                         bool *enters);

/*
 * The parts for a mesh, GArray of NcRoundedPart: its faces that have an area, and of their edges
 * those that stick out; all edges where the mesh is not closed. Vertices at one place are one.
 */
GArray *nc_rounded_parts(const SegVec3 *vertices, const int32_t (*triangles)[3], size_t n);

static inline double nc_along(SegVec3 p, int axis)
{
    return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}

#endif
