/* SPDX-License-Identifier: Apache-2.0 */
/* A B-spline surface at scattered points: the basis functions of a chunk of points side by side,
 * then each with poles of its own, x, y, z, w side by side. */
#include "segcore/geom/surface_batch.h"

#include <string.h>

typedef double Lanes[SEG_CHUNK];

/* One direction of the surface, and the chunk's parameters in it. */
typedef struct {
    const double *knots;
    int degree, n;
    int span[SEG_CHUNK];
    Lanes t;
    Lanes near[2 * SEG_MAX_DEGREE];     /* the knots from span + 1 - degree to span + degree */
    Lanes basis[3][SEG_MAX_DEGREE + 1]; /* as seg_basis */
    Lanes below[2][SEG_MAX_DEGREE + 1]; /* of degrees on the way, in turn */
} Axis;

static void evaluate_basis(Axis *a, const double *t, size_t n);
static void measure_noise(const Axis *a, double largest, double *first, double *second);
static void sum_point(const Axis *u, const Axis *v, const double (*net)[4], size_t k,
                      SegChunk *chunk);

void seg_face_points(const SegPart *part, int32_t face, const double *u, const double *v, size_t n,
                     SegSurfaceBatch *out)
{
    const SegFace *f = &part->faces[face];
    SegChunk chunk = {0};
    if (f->surface.n_u > 0)
        seg_surface_points(part->reals, &f->surface, f->reversed, u, v, n, &chunk, out, 0);
    else
        memset(out->flags, SEG_POINT_DEGENERATE, n);
}

void seg_surface_points(const double *reals, const SegSurface *surface, bool reversed,
                        const double *u, const double *v, size_t n, SegChunk *chunk,
                        SegSurfaceBatch *out, size_t at)
{
    SegSurfaceTables t = seg_surface_tables(reals, surface);
    size_t n_poles = (size_t)surface->n_u * (size_t)surface->n_v;
    double(*net)[4] = g_malloc_n(n_poles, sizeof *net);
    for (size_t i = 0; i < n_poles; i++) {
        double w = t.weights ? t.weights[i] : 1;
        for (size_t x = 0; x < 3; x++)
            net[i][x] = w * t.poles[3 * i + x];
        net[i][3] = w;
    }
    Axis *axes = g_new(Axis, 2);
    axes[0].span[0] = axes[1].span[0] = 0;
    axes[0].knots = t.knots_u, axes[0].degree = surface->degree_u, axes[0].n = surface->n_u;
    axes[1].knots = t.knots_v, axes[1].degree = surface->degree_v, axes[1].n = surface->n_v;
    double largest = seg_largest_coordinate(reals, surface);
    for (size_t first = 0; first < n; first += SEG_CHUNK) {
        size_t count = MIN(n - first, SEG_CHUNK);
        evaluate_basis(&axes[0], u + first, count);
        evaluate_basis(&axes[1], v + first, count);
        measure_noise(&axes[0], largest, chunk->noise[SEG_NOISE_U], chunk->noise[SEG_NOISE_UU]);
        measure_noise(&axes[1], largest, chunk->noise[SEG_NOISE_V], chunk->noise[SEG_NOISE_VV]);
        for (size_t k = 0; k < count; k++)
            sum_point(&axes[0], &axes[1], (const double(*)[4])net, k, chunk);
        seg_chunk_store(chunk, count, surface->rational, reversed, out, at + first);
    }
    g_free(axes);
    g_free(net);
}

/* ------------------------------------------------------------------ basis functions */

/* As in bspline.c, A2.2 and eq. 2.7: the same operations in the same order on each lane. */
SEG_VECTOR_CLONES
static void raise_degree(Lanes *near, int degree, int p, const double *t, Lanes *from, Lanes *to)
{
    Lanes carried = {0};
    for (int j = 0; j < p; j++) {
        const double *right = near[degree + j], *left = near[degree + j - p];
#pragma omp simd
        for (int k = 0; k < SEG_CHUNK; k++) {
            double share = from[j][k] / (right[k] - left[k]);
            to[j][k] = carried[k] + (right[k] - t[k]) * share;
            carried[k] = (t[k] - left[k]) * share;
        }
    }
    memcpy(to[p], carried, sizeof carried);
}

SEG_VECTOR_CLONES
static void differentiate(Lanes *near, int degree, int p, Lanes *from, Lanes *to)
{
    Lanes carried = {0};
    for (int j = 0; j < p; j++) {
        const double *right = near[degree + j], *left = near[degree + j - p];
#pragma omp simd
        for (int k = 0; k < SEG_CHUNK; k++) {
            double share = p * from[j][k] / (right[k] - left[k]);
            to[j][k] = carried[k] - share;
            carried[k] = share;
        }
    }
    memcpy(to[p], carried, sizeof carried);
}

/* Neighbours in a list of points mostly share a span. */
static int find_span(const Axis *a, double t, int last)
{
    if (last > 0 && a->knots[last] <= t && t < a->knots[last + 1])
        return last;
    return seg_knot_span(a->knots, a->degree, a->n, t);
}

static void evaluate_basis(Axis *a, const double *t, size_t n)
{
    int p = a->degree;
    for (size_t k = 0; k < SEG_CHUNK; k++) { /* the last point again where there are fewer */
        a->t[k] = seg_clamp(t[MIN(k, n - 1)], a->knots[p], a->knots[a->n]);
        a->span[k] = find_span(a, a->t[k], a->span[k > 0 ? k - 1 : 0]);
        for (int j = 0; j < 2 * p; j++)
            a->near[j][k] = a->knots[a->span[k] + 1 - p + j];
    }
    Lanes *now = a->below[0], *next = a->below[1];
    for (size_t k = 0; k < SEG_CHUNK; k++)
        now[0][k] = 1;
    for (int d = 1; d <= p; d++) {
        if (d == p - 1)
            differentiate(a->near, p, d, now, a->basis[2]);
        if (d == p)
            differentiate(a->near, p, d, now, a->basis[1]);
        raise_degree(a->near, p, d, a->t, now, next);
        Lanes *swap = now;
        now = next, next = swap;
    }
    memcpy(a->basis[0], now, (size_t)(p + 1) * sizeof(Lanes));
    if (p >= 2) {
        differentiate(a->near, p, p, a->basis[2], next);
        memcpy(a->basis[2], next, (size_t)(p + 1) * sizeof(Lanes));
    } else {
        memset(a->basis[2], 0, 2 * sizeof(Lanes));
    }
}

/* seg_noise of all lanes. */
SEG_VECTOR_CLONES
static void sum_noise(const Lanes *basis, int degree, double largest, double *noise)
{
    memset(noise, 0, sizeof(Lanes));
    for (int j = 0; j <= degree; j++) {
#pragma omp simd
        for (int k = 0; k < SEG_CHUNK; k++)
            noise[k] += SEG_NOISE * largest * fabs(basis[j][k]);
    }
}

static void measure_noise(const Axis *a, double largest, double *first, double *second)
{
    sum_noise(a->basis[1], a->degree, largest, first);
    sum_noise(a->basis[2], a->degree, largest, second);
}

/* ------------------------------------------------------------------ poles */

/* Derivatives of the homogeneous surface at point k; `pole` is the first that counts. */
static inline __attribute__((always_inline)) void sum_poles(const Axis *u, const Axis *v,
                                                            const double (*pole)[4], int q,
                                                            size_t k,
                                                            double h[SEG_N_DERIVATIVES][4])
{
    for (int i = 0; i <= u->degree; i++, pole += v->n) {
        double r[3][4] = {{0}};
        for (int j = 0; j <= q; j++) {
            double b0 = v->basis[0][j][k], b1 = v->basis[1][j][k], b2 = v->basis[2][j][k];
#pragma omp simd
            for (int x = 0; x < 4; x++) {
                r[0][x] += b0 * pole[j][x];
                r[1][x] += b1 * pole[j][x];
                r[2][x] += b2 * pole[j][x];
            }
        }
        double b0 = u->basis[0][i][k], b1 = u->basis[1][i][k], b2 = u->basis[2][i][k];
#pragma omp simd
        for (int x = 0; x < 4; x++) {
            h[SEG_D][x] += b0 * r[0][x];
            h[SEG_DU][x] += b1 * r[0][x];
            h[SEG_DV][x] += b0 * r[1][x];
            h[SEG_DUU][x] += b2 * r[0][x];
            h[SEG_DUV][x] += b1 * r[1][x];
            h[SEG_DVV][x] += b0 * r[2][x];
        }
    }
}

SEG_VECTOR_CLONES
static void sum_point(const Axis *u, const Axis *v, const double (*net)[4], size_t k,
                      SegChunk *chunk)
{
    const double(*pole)[4] = net + (ptrdiff_t)(u->span[k] - u->degree) * v->n;
    double h[SEG_N_DERIVATIVES][4] = {{0}};
    if (v->degree == 3)
        sum_poles(u, v, pole + v->span[k] - 3, 3, k, h);
    else
        sum_poles(u, v, pole + v->span[k] - v->degree, v->degree, k, h);
    for (int d = 0; d < SEG_N_DERIVATIVES; d++)
        for (int x = 0; x < 4; x++)
            chunk->d[d][x][k] = h[d][x];
}
