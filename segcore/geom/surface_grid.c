/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A B-spline surface over a grid. The poles are summed over u once a row: what is left of them is
 * a curve in v for the position and one for each derivative in u, and chunks of its samples are
 * summed over v, those of one span together.
 */
#include "segcore/geom/surface_batch.h"

#include <string.h>

/* Samples [first, first + n) of v lie in one span, and in one chunk. */
typedef struct {
    size_t first, n;
    int span;
} Run;

typedef struct {
    const SegSurface *surface;
    SegSurfaceTables tables;
    int dim;                    /* 3; 4 where rational */
    double *net;                /* [dim][n_u][n_v]: homogeneous poles, coordinate by coordinate */
    double *row;                /* [3][dim][n_v]: net summed over u with N, N', N'' */
    double *basis;              /* [3][q + 1][step] */
    double *noise_v, *noise_vv; /* of the samples */
    double largest;             /* coordinate of the poles */
    size_t n_samples;           /* of v */
    size_t step;                /* n_samples, with a stride to spare */
    Run *runs;
    size_t n_runs;
    int first, last; /* columns of poles that the samples need */
} Grid;

static void sum_over_u(const Grid *g, double u, SegChunk *chunk);
static void sum_run(const Grid *g, const Run *run, SegChunk *chunk, size_t at);

void seg_face_grid(const SegPart *part, int32_t face, const double *u, size_t n_u, const double *v,
                   size_t n_v, SegSurfaceBatch *out)
{
    const SegFace *f = &part->faces[face];
    SegChunk chunk = {0};
    if (f->surface.n_u > 0)
        seg_surface_grid(part->reals, &f->surface, f->reversed, u, n_u, v, n_v, &chunk, out, 0,
                         n_v);
    else
        memset(out->flags, SEG_POINT_DEGENERATE, n_u * n_v);
}

/* The poles times their weights, and the weights. */
static void lay_out_net(Grid *g)
{
    size_t n = (size_t)g->surface->n_u * (size_t)g->surface->n_v;
    g->net = g_new(double, (size_t)g->dim *n);
    for (size_t i = 0; i < n; i++) {
        double w = g->tables.weights ? g->tables.weights[i] : 1;
        for (size_t x = 0; x < 3; x++)
            g->net[x * n + i] = w * g->tables.poles[3 * i + x];
        if (g->dim == 4)
            g->net[3 * n + i] = w;
    }
}

/* Basis functions and runs of all samples of v. */
static void prepare_v(Grid *g, const double *v)
{
    const double *knots = g->tables.knots_v;
    int q = g->surface->degree_v, n = g->surface->n_v;
    size_t count = g->n_samples;
    g->step = count + SEG_STRIDE;
    g->basis = g_new0(double, 3 * (size_t)(q + 1) * g->step);
    g->noise_v = g_new(double, count);
    g->noise_vv = g_new(double, count);
    g->runs = g_new(Run, count);
    g->first = n;
    for (size_t k = 0; k < count; k++) {
        double t = seg_clamp(v[k], knots[q], knots[n]);
        int span = seg_knot_span(knots, q, n, t);
        double basis[3][SEG_MAX_DEGREE + 1];
        seg_basis(knots, q, span, t, 2, basis);
        for (size_t o = 0; o < 3; o++)
            for (size_t j = 0; j <= (size_t)q; j++)
                g->basis[(o * (size_t)(q + 1) + j) * g->step + k] = basis[o][j];
        g->noise_v[k] = seg_noise(g->largest, basis[1], q);
        g->noise_vv[k] = seg_noise(g->largest, basis[2], q);
        Run *last = g->n_runs > 0 ? &g->runs[g->n_runs - 1] : NULL;
        if (last && last->span == span && k % SEG_CHUNK != 0)
            last->n++;
        else
            g->runs[g->n_runs++] = (Run){k, 1, span};
        g->first = MIN(g->first, span - q);
        g->last = MAX(g->last, span);
    }
}

void seg_surface_grid(const double *reals, const SegSurface *surface, bool reversed,
                      const double *u, size_t n_u, const double *v, size_t n_v, SegChunk *chunk,
                      SegSurfaceBatch *out, size_t at, size_t stride)
{
    if (n_u == 0 || n_v == 0)
        return;
    Grid g = {.surface = surface,
              .tables = seg_surface_tables(reals, surface),
              .dim = surface->rational ? 4 : 3,
              .largest = seg_largest_coordinate(reals, surface),
              .n_samples = n_v};
    lay_out_net(&g);
    prepare_v(&g, v);
    g.row = g_new(double, 3 * (size_t)g.dim * (size_t)surface->n_v);
    for (size_t i = 0; i < n_u; i++) {
        sum_over_u(&g, u[i], chunk);
        for (size_t r = 0; r < g.n_runs;) {
            size_t first = g.runs[r].first, n = 0;
            do { /* the runs of one chunk */
                sum_run(&g, &g.runs[r], chunk, n);
                n += g.runs[r].n;
            } while (++r < g.n_runs && g.runs[r].first % SEG_CHUNK != 0);
            memcpy(chunk->noise[SEG_NOISE_V], g.noise_v + first, n * sizeof(double));
            memcpy(chunk->noise[SEG_NOISE_VV], g.noise_vv + first, n * sizeof(double));
            seg_chunk_store(chunk, n, surface->rational, reversed, out, at + i * stride + first);
        }
    }
    g_free(g.net);
    g_free(g.row);
    g_free(g.basis);
    g_free(g.noise_v);
    g_free(g.noise_vv);
    g_free(g.runs);
}

/* ------------------------------------------------------------------ the two sums */

SEG_VECTOR_CLONES
static void sum_poles(const double *net, size_t step, int n, const double *basis, int p,
                      double *row)
{
#pragma omp simd
    for (int j = 0; j < n; j++)
        row[j] = basis[0] * net[j];
    for (int i = 1; i <= p; i++) {
#pragma omp simd
        for (int j = 0; j < n; j++)
            row[j] += basis[i] * net[(size_t)i * step + (size_t)j];
    }
}

static void sum_over_u(const Grid *g, double u, SegChunk *chunk)
{
    const SegSurface *s = g->surface;
    const double *knots = g->tables.knots_u;
    u = seg_clamp(u, knots[s->degree_u], knots[s->n_u]);
    int span = seg_knot_span(knots, s->degree_u, s->n_u, u);
    double basis[3][SEG_MAX_DEGREE + 1];
    seg_basis(knots, s->degree_u, span, u, 2, basis);
    double noise_u = seg_noise(g->largest, basis[1], s->degree_u);
    double noise_uu = seg_noise(g->largest, basis[2], s->degree_u);
    for (size_t k = 0; k < seg_whole_strides(MIN(g->n_samples, SEG_CHUNK)); k++) {
        chunk->noise[SEG_NOISE_U][k] = noise_u;
        chunk->noise[SEG_NOISE_UU][k] = noise_uu;
    }
    size_t columns = (size_t)s->n_v, plane = (size_t)s->n_u * columns, first = (size_t)g->first;
    for (size_t o = 0; o < 3; o++)
        for (size_t x = 0; x < (size_t)g->dim; x++)
            sum_poles(g->net + x * plane + (size_t)(span - s->degree_u) * columns + first, columns,
                      g->last - g->first + 1, basis[o], s->degree_u,
                      g->row + (o * (size_t)g->dim + x) * columns + first);
}

/* The sum of b[j]·c[j] for j = 0 … q <= 5, the b `step` apart. Written out: a loop inside would
 * keep the compiler from taking several samples at once. */
static inline __attribute__((always_inline)) double sum(int q, const double *b, size_t step,
                                                        const double *c)
{
    double s = b[0] * c[0] + b[step] * c[1];
    if (q >= 2)
        s += b[2 * step] * c[2];
    if (q >= 3)
        s += b[3 * step] * c[3];
    if (q >= 4)
        s += b[4 * step] * c[4];
    if (q >= 5)
        s += b[5 * step] * c[5];
    return s;
}

/* Sums n samples of one coordinate. c0, c1, c2 are the q + 1 poles of the curves for N, N', N'' in
 * u; b has the basis functions in v, `step` apart, and their derivatives behind them. */
static inline __attribute__((always_inline)) void
sum_coordinate(int q, const double *c0, const double *c1, const double *c2, const double *b,
               size_t step, size_t n, double (*d)[4][SEG_CHUNK_ROOM], int x, size_t at)
{
    const double *b1 = b + (size_t)(q + 1) * step, *b2 = b1 + (size_t)(q + 1) * step;
#pragma omp simd
    for (size_t k = 0; k < n; k++) {
        d[SEG_D][x][at + k] = sum(q, b + k, step, c0);
        d[SEG_DU][x][at + k] = sum(q, b + k, step, c1);
        d[SEG_DUU][x][at + k] = sum(q, b + k, step, c2);
        d[SEG_DV][x][at + k] = sum(q, b1 + k, step, c0);
        d[SEG_DUV][x][at + k] = sum(q, b1 + k, step, c1);
        d[SEG_DVV][x][at + k] = sum(q, b2 + k, step, c0);
    }
}

/* The same of any degree: pole after pole. */
static inline __attribute__((always_inline)) void
sum_coordinate_any(int q, const double *c0, const double *c1, const double *c2, const double *b,
                   size_t step, size_t n, double (*d)[4][SEG_CHUNK_ROOM], int x, size_t at)
{
    size_t order = (size_t)(q + 1) * step;
    for (int i = 0; i < SEG_N_DERIVATIVES; i++)
        memset(d[i][x] + at, 0, n * sizeof(double));
    for (int j = 0; j <= q; j++, b += step) {
#pragma omp simd
        for (size_t k = 0; k < n; k++) {
            d[SEG_D][x][at + k] += b[k] * c0[j];
            d[SEG_DU][x][at + k] += b[k] * c1[j];
            d[SEG_DUU][x][at + k] += b[k] * c2[j];
            d[SEG_DV][x][at + k] += b[order + k] * c0[j];
            d[SEG_DUV][x][at + k] += b[order + k] * c1[j];
            d[SEG_DVV][x][at + k] += b[2 * order + k] * c0[j];
        }
    }
}

/* The poles of the curves at the run, and where its samples go. */
typedef struct {
    const double *row; /* first pole of the curve of x */
    size_t columns;    /* between coordinates */
    size_t order;      /* between derivatives in u */
    const double *basis;
    size_t step;
} Span;

static inline __attribute__((always_inline)) void
sum_coordinates(int q, int dim, const Span *s, size_t n, double (*d)[4][SEG_CHUNK_ROOM], size_t at)
{
    for (int x = 0; x < dim; x++) {
        const double *c = s->row + (size_t)x * s->columns;
        if (q <= 5)
            sum_coordinate(q, c, c + s->order, c + 2 * s->order, s->basis, s->step, n, d, x, at);
        else
            sum_coordinate_any(q, c, c + s->order, c + 2 * s->order, s->basis, s->step, n, d, x,
                               at);
    }
}

/* The usual degrees by constants, so that the sum is written out. */
SEG_VECTOR_CLONES
static void sum_span(int q, int dim, const Span *s, size_t n, double (*d)[4][SEG_CHUNK_ROOM],
                     size_t at)
{
    switch (q) {
    case 1:
        sum_coordinates(1, dim, s, n, d, at);
        break;
    case 2:
        sum_coordinates(2, dim, s, n, d, at);
        break;
    case 3:
        sum_coordinates(3, dim, s, n, d, at);
        break;
    case 4:
        sum_coordinates(4, dim, s, n, d, at);
        break;
    case 5:
        sum_coordinates(5, dim, s, n, d, at);
        break;
    default:
        sum_coordinates(q, dim, s, n, d, at);
        break;
    }
}

/* Whole strides: what is written past the run is the next one's, which comes after. */
static void sum_run(const Grid *g, const Run *run, SegChunk *chunk, size_t at)
{
    int q = g->surface->degree_v;
    size_t columns = (size_t)g->surface->n_v;
    Span s = {g->row + (run->span - q), columns, (size_t)g->dim * columns, g->basis + run->first,
              g->step};
    sum_span(q, g->dim, &s, seg_whole_strides(run->n), chunk->d, at);
}
