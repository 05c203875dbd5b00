/* SPDX-License-Identifier: Apache-2.0 */
/* Points of a T-spline, face by face. */
#include <string.h>

#include "segcore/geom/surface_batch.h"
#include "segcore/geom/tspline_patch.h"

/* The last line whose value is at most t, with a next line of larger value; -1 where t is outside
 * or no number. At the last value of all, the last such line. */
static int32_t line_below(const double *knots, int32_t n, double t)
{
    if (!(t >= knots[0] && t <= knots[n - 1]) || knots[0] == knots[n - 1])
        return -1;
    int32_t low = 0, high = n; /* knots[low] <= t, and t < knots[high] or high is n */
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        if (knots[middle] <= t)
            low = middle;
        else
            high = middle;
    }
    while (low == n - 1 || knots[low] == knots[low + 1])
        low--;
    return low;
}

/* The line before `line` that ends a cell of some width there, where t lies on it; else -1. */
static int32_t line_before(const double *knots, int32_t line, double t)
{
    if (line < 0 || knots[line] != t)
        return -1;
    int32_t before = line - 1;
    while (before >= 0 && knots[before] == t)
        before--;
    return before;
}

/* The face of the surface in cell (i, j), or -1. */
static int32_t face_of(const SegTspline *t, int32_t i, int32_t j)
{
    if (i < 0 || j < 0)
        return -1;
    int32_t face = t->cells[(ptrdiff_t)i * (t->n_v - 1) + j];
    return t->patches->surfaces[face].n_u > 0 ? face : -1;
}

/* On an edge the face of larger parameters, then those on its other sides. */
static int32_t find_face(const SegTspline *t, int32_t i, int32_t j, double u, double v)
{
    int32_t face = face_of(t, i, j);
    if (face >= 0)
        return face;
    int32_t before_i = line_before(t->knots_u, i, u), before_j = line_before(t->knots_v, j, v);
    face = face_of(t, before_i, j);
    if (face < 0)
        face = face_of(t, i, before_j);
    return face >= 0 ? face : face_of(t, before_i, before_j);
}

/* The arrays of a batch one after another: each of n values, in storage. */
static size_t arrays_of(const SegSurfaceBatch *b)
{
    static const size_t arrays[] = {3, 6, 9, 3, 4, 6};
    size_t sum = 0;
    for (unsigned i = 0; i < G_N_ELEMENTS(arrays); i++)
        sum += b->fields & (1u << i) ? arrays[i] : 0;
    return sum;
}

static void set_outside(SegSurfaceBatch *b, size_t first, size_t n)
{
    memset(b->flags + first, SEG_POINT_OUTSIDE, n);
    for (size_t a = 0, arrays = arrays_of(b); a < arrays; a++)
        memset(b->storage + a * b->n + first, 0, n * sizeof(double));
}

/* Point k of `from` goes to to[k] of `out`. */
static void scatter(const SegSurfaceBatch *from, const uint32_t *to, size_t n, SegSurfaceBatch *out)
{
    for (size_t k = 0; k < n; k++)
        out->flags[to[k]] = from->flags[k];
    for (size_t a = 0, arrays = arrays_of(out); a < arrays; a++)
        for (size_t k = 0; k < n; k++)
            out->storage[a * out->n + to[k]] = from->storage[a * from->n + k];
}

static void evaluate(const SegTspline *t, int32_t face, const double *u, const double *v, size_t n,
                     SegChunk *chunk, SegSurfaceBatch *out)
{
    const double *reals = (const double *)(void *)t->patches->reals->data;
    seg_surface_points(reals, &t->patches->surfaces[face], false, u, v, n, chunk, out, 0);
}

/* ------------------------------------------------------------------ scattered points */

typedef struct {
    int32_t face;
    uint32_t point;
} Place;

static int compare_places(const void *a, const void *b)
{
    const Place *p = a, *q = b;
    return p->face != q->face ? (p->face > q->face) - (p->face < q->face)
                              : (p->point > q->point) - (p->point < q->point);
}

/* The points of one face at a time are gathered, evaluated, and put where they belong. */
static void evaluate_places(const SegTspline *t, const Place *places, size_t n, const double *u,
                            const double *v, SegSurfaceBatch *out)
{
    g_autofree double *some_u = g_new(double, n), *some_v = g_new(double, n);
    g_autofree uint32_t *to = g_new(uint32_t, n);
    SegChunk chunk = {0};
    g_autoptr(SegSurfaceBatch) some = seg_surface_batch_new(n, out->fields);
    for (size_t first = 0, end; first < n; first = end) {
        for (end = first; end < n && places[end].face == places[first].face; end++) {
            to[end - first] = places[end].point;
            some_u[end - first] = u[places[end].point];
            some_v[end - first] = v[places[end].point];
        }
        evaluate(t, places[first].face, some_u, some_v, end - first, &chunk, some);
        scatter(some, to, end - first, out);
    }
}

void seg_tspline_points(const SegTspline *t, const double *u, const double *v, size_t n,
                        SegSurfaceBatch *out)
{
    g_autofree Place *places = g_new(Place, n);
    size_t inside = 0;
    for (size_t k = 0; k < n; k++) {
        int32_t i = line_below(t->knots_u, t->n_u, u[k]), j = line_below(t->knots_v, t->n_v, v[k]);
        int32_t face = find_face(t, i, j, u[k], v[k]);
        if (face >= 0)
            places[inside++] = (Place){face, (uint32_t)k};
        else
            set_outside(out, k, 1);
    }
    qsort(places, inside, sizeof *places, compare_places);
    evaluate_places(t, places, inside, u, v, out);
}

/* ------------------------------------------------------------------ grids */

static int32_t *lines_below(const double *knots, int32_t n_knots, const double *t, size_t n)
{
    int32_t *lines = g_new(int32_t, n);
    for (size_t k = 0; k < n; k++)
        lines[k] = line_below(knots, n_knots, t[k]);
    return lines;
}

/* The first of the ascending lines that is `line` or above. */
static size_t first_from(const int32_t *lines, size_t n, int32_t line)
{
    size_t low = 0, high = n;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (lines[middle] >= line)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* The range of the samples that lie inside the domain; those outside have line -1 on both ends. */
static void find_range(const int32_t *lines, size_t n, size_t *first, size_t *end)
{
    for (*first = 0; *first < n && lines[*first] < 0;)
        ++*first;
    for (*end = n; *end > *first && lines[*end - 1] < 0;)
        --*end;
}

/* Points of the grid in no face's cell that lie on the border of one: on the upper sides of the
 * surface, and on the lower and left sides of holes. */
static void evaluate_borders(const SegTspline *t, const double *u, const int32_t *in_u, size_t n_u,
                             const double *v, const int32_t *in_v, size_t n_v, SegChunk *chunk,
                             SegSurfaceBatch *out)
{
    for (size_t i = 0; i < n_u; i++)
        for (size_t j = 0; j < n_v; j++) {
            if (in_u[i] < 0 || in_v[j] < 0 || face_of(t, in_u[i], in_v[j]) >= 0)
                continue;
            bool on_u = u[i] == t->knots_u[in_u[i]], on_v = v[j] == t->knots_v[in_v[j]];
            int32_t face = on_u || on_v ? find_face(t, in_u[i], in_v[j], u[i], v[j]) : -1;
            if (face < 0)
                continue;
            g_autoptr(SegSurfaceBatch) one = seg_surface_batch_new(1, out->fields);
            evaluate(t, face, &u[i], &v[j], 1, chunk, one);
            scatter(one, &(uint32_t){(uint32_t)(i * n_v + j)}, 1, out);
        }
}

void seg_tspline_grid(const SegTspline *t, const double *u, size_t n_u, const double *v, size_t n_v,
                      SegSurfaceBatch *out)
{
    g_autofree int32_t *in_u = lines_below(t->knots_u, t->n_u, u, n_u);
    g_autofree int32_t *in_v = lines_below(t->knots_v, t->n_v, v, n_v);
    const double *reals = (const double *)(void *)t->patches->reals->data;
    size_t u0, u1, v0, v1;
    SegChunk chunk = {0};
    find_range(in_u, n_u, &u0, &u1);
    find_range(in_v, n_v, &v0, &v1);
    set_outside(out, 0, n_u * n_v);
    for (int32_t f = 0; f < t->n_faces; f++) {
        const SegTface *face = &t->faces[f];
        if (t->patches->surfaces[f].n_u == 0)
            continue;
        size_t i0 = u0 + first_from(in_u + u0, u1 - u0, face->i0);
        size_t i1 = u0 + first_from(in_u + u0, u1 - u0, face->i1);
        size_t j0 = v0 + first_from(in_v + v0, v1 - v0, face->j0);
        size_t j1 = v0 + first_from(in_v + v0, v1 - v0, face->j1);
        if (i0 < i1 && j0 < j1)
            seg_surface_grid(reals, &t->patches->surfaces[f], false, u + i0, i1 - i0, v + j0,
                             j1 - j0, &chunk, out, i0 * n_v + j0, n_v);
    }
    evaluate_borders(t, u, in_u, n_u, v, in_v, n_v, &chunk, out);
}
