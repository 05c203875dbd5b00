/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Many points of a surface at once: positions, derivatives, normals, curvatures. Part of segcore's
 * public interface: include segcore/segcore.h.
 */
#ifndef SEGCORE_SURFACE_H
#define SEGCORE_SURFACE_H

#include <glib.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct SegPart SegPart;

/* What a batch holds. */
enum {
    SEG_POSITIONS = 1 << 0,
    SEG_FIRST = 1 << 1,  /* du, dv */
    SEG_SECOND = 1 << 2, /* duu, duv, dvv */
    SEG_NORMALS = 1 << 3,
    SEG_CURVATURES = 1 << 4, /* gauss, mean, k_min, k_max */
    SEG_DIRECTIONS = 1 << 5, /* direction_min, direction_max */
    SEG_ALL_FIELDS = (1 << 6) - 1
};

/* What is to be known of one point. */
enum {
    /* Su × Sv vanishes (the sine of their angle is below 1e-9), or a derivative is not finite:
     * there is no normal and no curvature, and they and the directions are 0. */
    SEG_POINT_DEGENERATE = 1 << 0,
    /* k_min and k_max are equal within 1e-9 or within what rounding leaves, as everywhere on a
     * plane and a sphere: every tangent is a principal direction. The one along Su is given as
     * direction_max. */
    SEG_POINT_UMBILIC = 1 << 1,
    /* Not on the surface: in a hole of it, or beyond its border. */
    SEG_POINT_OUTSIDE = 1 << 2,
};

/*
 * Arrays of `n` values each; three of them, x, y and z, for a vector. NULL where the field was not
 * asked for. Curvatures as in seg_surface_curvature: in 1/mm, with the outward normal as reference,
 * positive is CONCAVE, k_min <= k_max; mean = (k_min + k_max)/2, gauss = k_min · k_max (P1 §3.1.1,
 * P2 table 1). The directions are tangent unit vectors, at right angles, of either sign.
 */
typedef struct {
    size_t n;
    unsigned fields;
    double *position[3];
    double *du[3], *dv[3];
    double *duu[3], *duv[3], *dvv[3];
    double *normal[3];
    double *gauss, *mean, *k_min, *k_max;
    double *direction_min[3], *direction_max[3];
    uint8_t *flags;  /* SEG_POINT_…; always there */
    double *storage; /* behind all of them */
} SegSurfaceBatch;

/* A batch for n points, all zero. `fields` is any of SEG_POSITIONS … together. */
SegSurfaceBatch *seg_surface_batch_new(size_t n, unsigned fields);
void seg_surface_batch_free(SegSurfaceBatch *batch);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SegSurfaceBatch, seg_surface_batch_free)

/*
 * Evaluates the face's B-spline surface at every (u[i], v[j]): point i·n_v + j of `out`, which has
 * n_u · n_v or more. Outside the knot range the nearest inside is taken; loops are not looked at
 * (seg_polygons_grid does). Basis functions once a line, poles summed over u once a row. Of a
 * face without a surface only the flags are set: degenerate.
 */
void seg_face_grid(const SegPart *part, int32_t face, const double *u, size_t n_u, const double *v,
                   size_t n_v, SegSurfaceBatch *out);

/* The same at scattered points (u[i], v[i]): point i of `out`. */
void seg_face_points(const SegPart *part, int32_t face, const double *u, const double *v, size_t n,
                     SegSurfaceBatch *out);

#endif
