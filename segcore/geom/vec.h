/* SPDX-License-Identifier: Apache-2.0 */
/* Three-vectors by value. Part of segcore's public interface: include segcore/segcore.h. */
#ifndef SEGCORE_GEOM_VEC_H
#define SEGCORE_GEOM_VEC_H

#include <math.h>

/* A point (mm) or a direction. The same 24 bytes in memory and in the part form. */
typedef struct {
    double x, y, z;
} SegVec3;

static inline SegVec3 seg_vec3(double x, double y, double z)
{
    return (SegVec3){x, y, z};
}

static inline SegVec3 seg_add(SegVec3 a, SegVec3 b)
{
    return (SegVec3){a.x + b.x, a.y + b.y, a.z + b.z};
}

static inline SegVec3 seg_sub(SegVec3 a, SegVec3 b)
{
    return (SegVec3){a.x - b.x, a.y - b.y, a.z - b.z};
}

static inline SegVec3 seg_scale(SegVec3 a, double s)
{
    return (SegVec3){a.x * s, a.y * s, a.z * s};
}

/* a + s·b */
static inline SegVec3 seg_along(SegVec3 a, SegVec3 b, double s)
{
    return (SegVec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}

/* a at t = 0, b at t = 1. */
static inline SegVec3 seg_lerp(SegVec3 a, SegVec3 b, double t)
{
    return seg_along(a, seg_sub(b, a), t);
}

static inline double seg_dot(SegVec3 a, SegVec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline SegVec3 seg_cross(SegVec3 a, SegVec3 b)
{
    return (SegVec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static inline double seg_norm(SegVec3 a)
{
    return sqrt(seg_dot(a, a));
}

static inline double seg_distance(SegVec3 a, SegVec3 b)
{
    return seg_norm(seg_sub(a, b));
}

/* The unit vector along a; a itself where its length is 0. */
static inline SegVec3 seg_unit(SegVec3 a)
{
    double n = seg_norm(a);
    return n > 0 ? seg_scale(a, 1 / n) : a;
}

#endif
