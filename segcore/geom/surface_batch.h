/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Between the summing of poles and what is asked of a point: a chunk of points, derivative by
 * derivative, small enough for the first cache.
 */
#ifndef SEGCORE_GEOM_SURFACE_BATCH_H
#define SEGCORE_GEOM_SURFACE_BATCH_H

#include <float.h>

#include "segcore/geom/bspline.h"

/* The hot loops once for each kind of vector unit. Same digits in all: nothing is fused. Not under
 * the address sanitizer, which is not up yet when the loader chooses among them. */
#if defined(__x86_64__) && defined(__gnu_linux__) && !defined(__SANITIZE_ADDRESS__) &&             \
    !defined(__clang__)
#define SEG_VECTOR_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SEG_VECTOR_CLONES
#endif

/* Points of a chunk, and the stride of vector loops over it: they take whole strides, and what lies
 * beyond the points is never looked at. */
enum { SEG_CHUNK = 64, SEG_STRIDE = 8, SEG_CHUNK_ROOM = SEG_CHUNK + SEG_STRIDE };

static inline size_t seg_whole_strides(size_t n)
{
    return (n + SEG_STRIDE - 1) / SEG_STRIDE * SEG_STRIDE;
}

/* Derivatives of the homogeneous surface: position, u, v, uu, uv, vv. */
enum { SEG_D, SEG_DU, SEG_DV, SEG_DUU, SEG_DUV, SEG_DVV, SEG_N_DERIVATIVES };

/* What rounding may leave in Su, Sv, Suu, Svv where the terms of their sums cancel. */
enum { SEG_NOISE_U, SEG_NOISE_V, SEG_NOISE_UU, SEG_NOISE_VV, SEG_N_NOISES };

/* Begins as all zero. */
typedef struct {
    double d[SEG_N_DERIVATIVES][4][SEG_CHUNK_ROOM]; /* of x, y, z, and w where rational */
    double noise[SEG_N_NOISES][SEG_CHUNK_ROOM];
} SegChunk;

/* As many roundings are taken for possible. */
#define SEG_NOISE (16 * DBL_EPSILON)

/* The noise of the sum of one coordinate of poles, none larger than `largest`, with these basis
 * functions or derivatives. */
static inline double seg_noise(double largest, const double *basis, int degree)
{
    double sum = 0;
    for (int j = 0; j <= degree; j++)
        sum += fabs(basis[j]);
    return SEG_NOISE * largest * sum;
}

/* The largest coordinate of a surface's poles. */
double seg_largest_coordinate(const double *reals, const SegSurface *surface);

/* Makes points [at, at + n) of `out` of the n first in the chunk, which is used up. */
void seg_chunk_store(SegChunk *chunk, size_t n, bool rational, bool reversed, SegSurfaceBatch *out,
                     size_t at);

/* The grid of seg_face_grid on any surface: point (i, j) goes to at + i·stride + j of `out`. The
 * chunk is room to work in. */
void seg_surface_grid(const double *reals, const SegSurface *surface, bool reversed,
                      const double *u, size_t n_u, const double *v, size_t n_v, SegChunk *chunk,
                      SegSurfaceBatch *out, size_t at, size_t stride);

/* The points of seg_face_points on any surface: point i goes to at + i of `out`. */
void seg_surface_points(const double *reals, const SegSurface *surface, bool reversed,
                        const double *u, const double *v, size_t n, SegChunk *chunk,
                        SegSurfaceBatch *out, size_t at);

/* Where t lies in [a, b], or its nearest end; NaN goes to a. */
static inline double seg_clamp(double t, double a, double b)
{
    return t >= a ? fmin(t, b) : a;
}

#endif
