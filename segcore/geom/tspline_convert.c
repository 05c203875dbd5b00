/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A B-spline surface as a T-spline, and the faces of a T-spline as B-spline surfaces. The first is
 * raised to degree 3, and clamped at its ends, by blossoms (polar forms): pole i of a spline of
 * degree 3 over knots t is the blossom of any of its pieces near at t[i + 1], t[i + 2], t[i + 3].
 */
#include <string.h>

#include "segcore/geom/bspline.h"
#include "segcore/geom/part_form.h"
#include "segcore/geom/tspline_patch.h"

/* One direction: what there is, and what it becomes. */
typedef struct {
    const double *knots;
    int degree, n;
    double *cubic; /* the knots of degree 3, clamped */
    int n_cubic;
} Direction;

static void direction_clear(Direction *d)
{
    g_free(d->cubic);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Direction, direction_clear)

typedef double Homogeneous[4];

static void make_cubic(Direction *d);
static void convert_row(const Direction *d, const Homogeneous *from, size_t from_step,
                        Homogeneous *to, size_t to_step);
static SegTspline *build(const Direction *u, const Direction *v, const Homogeneous *net,
                         GError **error);

SegTspline *seg_tspline_from_face(const SegPart *part, int32_t face, GError **error)
{
    const SegSurface *s = &part->faces[face].surface;
    if (s->n_u == 0 || s->degree_u > 3 || s->degree_v > 3) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                    s->n_u == 0 ? "face %d has no surface"
                                : "face %d is of degree %d by %d: a bicubic T-spline holds up to 3",
                    face, s->degree_u, s->degree_v);
        return NULL;
    }
    SegSurfaceTables tables = seg_surface_tables(part->reals, s);
    g_auto(Direction) u = {tables.knots_u, s->degree_u, s->n_u, NULL, 0};
    g_auto(Direction) v = {tables.knots_v, s->degree_v, s->n_v, NULL, 0};
    make_cubic(&u);
    make_cubic(&v);
    size_t rows = (size_t)s->n_u, columns = (size_t)s->n_v;
    size_t rows_3 = (size_t)u.n_cubic, columns_3 = (size_t)v.n_cubic;
    g_autofree Homogeneous *net = g_new(Homogeneous, rows * columns);
    g_autofree Homogeneous *half = g_new(Homogeneous, rows_3 * columns);
    g_autofree Homogeneous *whole = g_new(Homogeneous, rows_3 * columns_3);
    for (size_t i = 0; i < rows * columns; i++) {
        double w = tables.weights ? tables.weights[i] : 1;
        for (size_t x = 0; x < 3; x++)
            net[i][x] = w * tables.poles[3 * i + x];
        net[i][3] = w;
    }
    for (size_t j = 0; j < columns; j++)
        convert_row(&u, (const Homogeneous *)net + j, columns, half + j, columns);
    for (size_t i = 0; i < rows_3; i++)
        convert_row(&v, (const Homogeneous *)half + i * columns, 1, whole + i * columns_3, 1);
    return build(&u, &v, (const Homogeneous *)whole, error);
}

/* A pole's knot vector is centred on its line, so the outermost two knots are no lines. */
static SegTspline *build(const Direction *u, const Direction *v, const Homogeneous *net,
                         GError **error)
{
    size_t n_points = (size_t)u->n_cubic * (size_t)v->n_cubic;
    size_t n_faces = (size_t)(u->n_cubic - 1) * (size_t)(v->n_cubic - 1), face = 0;
    if (n_points > SEG_TSPLINE_MAX_CROSSINGS) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT, "%zu poles are too many for a T-spline",
                    n_points);
        return NULL;
    }
    g_autofree SegTpoint *points = g_new(SegTpoint, n_points);
    g_autofree SegTface *faces = g_new(SegTface, n_faces);
    for (size_t k = 0; k < n_points; k++) {
        const double *h = net[k];
        points[k] = (SegTpoint){(int32_t)(k / (size_t)v->n_cubic),
                                (int32_t)(k % (size_t)v->n_cubic),
                                h[0] / h[3],
                                h[1] / h[3],
                                h[2] / h[3],
                                h[3]};
    }
    for (int32_t i = 0; i + 1 < u->n_cubic; i++)
        for (int32_t j = 0; j + 1 < v->n_cubic; j++)
            faces[face++] = (SegTface){i, i + 1, j, j + 1, 0};
    return seg_tspline_new(u->cubic + 2, u->n_cubic, v->cubic + 2, v->n_cubic, faces,
                           (int32_t)n_faces, points, (int32_t)n_points, error);
}

/* ------------------------------------------------------------------ degree 3 */

/* The knots inside the domain, each as often more as the degree rises, and its ends four times. */
static void make_cubic(Direction *d)
{
    int p = d->degree, n = d->n, raise = 3 - p, count = 0;
    double a = d->knots[p], b = d->knots[n];
    d->cubic = g_new(double, (n + p + 1) * (1 + raise) + 8);
    for (; count < 4; count++)
        d->cubic[count] = a;
    for (int i = 0; i <= n + p; i++) {
        double t = d->knots[i];
        bool first = i == 0 || d->knots[i - 1] < t;
        for (int times = first ? 1 + raise : 1; t > a && t < b && times > 0; times--)
            d->cubic[count++] = t;
    }
    for (int i = 0; i < 4; i++)
        d->cubic[count++] = b;
    d->n_cubic = count - 4;
}

/* The blossom of the piece on `span` at p arguments: de Boor's algorithm, each step with its own.
 */
static void blossom(const Direction *d, const Homogeneous *poles, size_t step, int span,
                    const double *arguments, Homogeneous out)
{
    int p = d->degree;
    Homogeneous h[4];
    for (int i = 0; i <= p; i++)
        memcpy(h[i], poles[(size_t)(span - p + i) * step], sizeof h[i]);
    for (int r = 1; r <= p; r++)
        for (int i = p; i >= r; i--) {
            double low = d->knots[span - p + i], high = d->knots[span + 1 + i - r];
            double s = (arguments[r - 1] - low) / (high - low);
            for (int x = 0; x < 4; x++)
                h[i][x] = (1 - s) * h[i - 1][x] + s * h[i][x];
        }
    memcpy(out, h[p], sizeof h[p]);
}

/* The blossom of the same piece as of degree 3: the mean over the choices of p arguments. */
static void blossom_3(const Direction *d, const Homogeneous *poles, size_t step, int span,
                      const double t[3], Homogeneous out)
{
    static const int choices[4][3][2] = {{{0}}, {{0}, {1}, {2}}, {{0, 1}, {0, 2}, {1, 2}}, {{0}}};
    Homogeneous sum = {0}, one;
    if (d->degree == 3) {
        blossom(d, poles, step, span, t, out);
        return;
    }
    for (int c = 0; c < 3; c++) {
        const int *choice = choices[d->degree][c];
        blossom(d, poles, step, span, (const double[]){t[choice[0]], t[choice[1]]}, one);
        for (int x = 0; x < 4; x++)
            sum[x] += one[x] / 3;
    }
    memcpy(out, sum, sizeof sum);
}

static bool same_knots(const Direction *d)
{
    return d->degree == 3 && d->n_cubic == d->n &&
           memcmp(d->cubic, d->knots, (size_t)(d->n + 4) * sizeof(double)) == 0;
}

static void convert_row(const Direction *d, const Homogeneous *from, size_t from_step,
                        Homogeneous *to, size_t to_step)
{
    bool same = same_knots(d);
    for (int i = 0; i < d->n_cubic; i++) {
        const double *t = d->cubic + i + 1;
        if (same) {
            memcpy(to[(size_t)i * to_step], from[(size_t)i * from_step], sizeof *to);
            continue;
        }
        /* The piece at the middle of the pole's knot vector, which it is not zero on. */
        double middle = 0.5 * (fmax(t[0], d->cubic[i]) + fmin(t[2], d->cubic[i + 4]));
        int span = seg_knot_span(d->knots, d->degree, d->n, middle);
        blossom_3(d, from, from_step, span, t, to[(size_t)i * to_step]);
    }
}

/* ------------------------------------------------------------------ patches */

const SegSurface *seg_tspline_patch(const SegTspline *t, int32_t face, const double **reals)
{
    *reals = (const double *)(void *)t->patches->reals->data;
    return &t->patches->surfaces[face];
}
