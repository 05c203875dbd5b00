/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A face of a T-spline is polynomial between the knots of its influence points that pass through
 * it. There each blending function is a Bézier curve in u times one in v, and their sum is a
 * bicubic B-spline surface with those knots three times.
 */
#include "segcore/geom/tspline_patch.h"

#include <stdlib.h>

#include "segcore/geom/part_form.h"

/* The weights of a patch are taken for 1 within this: rounding of a partition of unity. */
static const double WEIGHT_ROUNDING = 1e-14;

/* Most poles of a patch, and most numbers of all: beyond, knots run through faces without end. */
enum { MOST_POLES = 1 << 20, MOST_REALS = 1 << 27 };

/* One direction of a face: the ends of its pieces, and the ordinates of each influence point. */
typedef struct {
    double *cuts;
    int n;             /* of pieces */
    double *ordinates; /* [influence][3n + 1] */
} Pieces;

static void pieces_clear(Pieces *pieces)
{
    g_free(pieces->cuts);
    g_free(pieces->ordinates);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Pieces, pieces_clear)

typedef double Knots[5];

static bool add_patch(SegTpatches *p, const SegTspline *t, int32_t face, GError **error);
static void find_pieces(Pieces *pieces, const Knots *knots, int n, double a, double b);
static bool find_ordinates(const Knots s, const Pieces *pieces, double *out);

SegTpatches *seg_tpatches_new(const SegTspline *t, GError **error)
{
    SegTpatches *p = g_new0(SegTpatches, 1);
    p->surfaces = g_new0(SegSurface, t->n_faces);
    p->reals = g_array_new(FALSE, FALSE, sizeof(double));
    for (int32_t f = 0; f < t->n_faces; f++)
        if (t->first_influence[f + 1] > t->first_influence[f] && !add_patch(p, t, f, error)) {
            seg_tpatches_free(p);
            return NULL;
        }
    return p;
}

void seg_tpatches_free(SegTpatches *patches)
{
    if (!patches)
        return;
    g_free(patches->surfaces);
    g_array_unref(patches->reals);
    g_free(patches);
}

/* ------------------------------------------------------------------ one patch */

/* The ends of the pieces three times, those of the patch four times. */
static void append_knots(GArray *reals, const Pieces *pieces)
{
    for (int i = 0; i <= pieces->n; i++)
        for (int times = i == 0 || i == pieces->n ? 4 : 3; times > 0; times--)
            g_array_append_val(reals, pieces->cuts[i]);
}

/* Sums the homogeneous poles of all influence points. */
static void sum_poles(const SegTspline *t, const int32_t *influence, int n, const Pieces *u,
                      const Pieces *v, double (*poles)[4])
{
    size_t rows = (size_t)(3 * u->n + 1), columns = (size_t)(3 * v->n + 1);
    for (size_t k = 0; k < (size_t)n; k++) {
        const SegTpoint *p = &t->points[influence[k]];
        const double h[4] = {p->w * p->x, p->w * p->y, p->w * p->z, p->w};
        const double *in_u = u->ordinates + k * rows, *in_v = v->ordinates + k * columns;
        size_t first = 0, end = columns;
        while (first < end && in_v[first] == 0)
            first++;
        while (end > first && in_v[end - 1] == 0)
            end--;
        for (size_t i = 0; i < rows; i++)
            for (size_t j = first; in_u[i] != 0 && j < end; j++)
                for (int x = 0; x < 4; x++)
                    poles[i * columns + j][x] += in_u[i] * in_v[j] * h[x];
    }
}

/* Four poles of a row across a border, `step` apart from the border inwards. Where no function
 * reaches it, as with a knot only three times at an end, points and weight go to zero together, and
 * the surface to a limit: t·(c0, c1, c2) of degree 2 is projectively (c0, c1, c2), raised to 3. The
 * fourth pole, which the next piece shares, is the same. */
static void divide_out_border(double (*poles)[4], ptrdiff_t step)
{
    for (int x = 0; x < 4; x++) {
        double c0 = 3 * poles[step][x], c1 = 1.5 * poles[2 * step][x], c2 = poles[3 * step][x];
        poles[0][x] = c0;
        poles[step][x] = (c0 + 2 * c1) / 3;
        poles[2 * step][x] = (2 * c1 + c2) / 3;
    }
}

/* A border of n poles `along` apart, from which `inwards` leads into the surface. */
static void take_limit(double (*border)[4], size_t n, ptrdiff_t along, ptrdiff_t inwards)
{
    for (size_t i = 0; i < n; i++)
        if (border[(ptrdiff_t)i * along][3] != 0)
            return;
    for (size_t i = 0; i < n; i++)
        divide_out_border(border + (ptrdiff_t)i * along, inwards);
}

/* False where a weight is not positive even so. */
static bool take_limits(double (*poles)[4], size_t rows, size_t columns)
{
    ptrdiff_t row = (ptrdiff_t)columns, last_row = (ptrdiff_t)(rows - 1) * row;
    take_limit(poles, columns, 1, row);
    take_limit(poles + last_row, columns, 1, -row);
    take_limit(poles, rows, row, 1);
    take_limit(poles + columns - 1, rows, row, -1);
    for (size_t i = 0; i < rows * columns; i++)
        if (!(poles[i][3] >= SEG_FORM_MIN_WEIGHT))
            return false;
    return true;
}

static void append_poles(SegTpatches *p, SegSurface *s, double (*poles)[4])
{
    size_t n = (size_t)s->n_u * (size_t)s->n_v;
    for (size_t i = 0; i < n; i++) {
        const double r = 1 / poles[i][3],
                     xyz[] = {poles[i][0] * r, poles[i][1] * r, poles[i][2] * r};
        g_array_append_vals(p->reals, xyz, 3);
        s->rational |= fabs(poles[i][3] - 1) > WEIGHT_ROUNDING;
    }
    for (size_t i = 0; s->rational && i < n; i++)
        g_array_append_val(p->reals, poles[i][3]);
}

static Knots *knots_of(const int32_t *influence, int n, const int32_t (*lines)[5],
                       const double *values)
{
    Knots *knots = g_new(Knots, n);
    for (int k = 0; k < n; k++)
        for (int i = 0; i < 5; i++)
            knots[k][i] = values[lines[influence[k]][i]];
    return knots;
}

static bool refuse(const SegTface *f, const char *why, GError **error)
{
    g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                "the face from line %d to %d of u and %d to %d of v %s", f->i0, f->i1, f->j0, f->j1,
                why);
    return false;
}

static bool add_patch(SegTpatches *p, const SegTspline *t, int32_t face, GError **error)
{
    const SegTface *f = &t->faces[face];
    const int32_t *influence = t->influence + t->first_influence[face];
    int n = t->first_influence[face + 1] - t->first_influence[face];
    g_autofree Knots *in_u = knots_of(influence, n, (const int32_t(*)[5])t->lines_u, t->knots_u);
    g_autofree Knots *in_v = knots_of(influence, n, (const int32_t(*)[5])t->lines_v, t->knots_v);
    g_auto(Pieces) u = {0};
    g_auto(Pieces) v = {0};
    find_pieces(&u, (const Knots *)in_u, n, t->knots_u[f->i0], t->knots_u[f->i1]);
    find_pieces(&v, (const Knots *)in_v, n, t->knots_v[f->j0], t->knots_v[f->j1]);
    SegSurface *s = &p->surfaces[face];
    *s = (SegSurface){.data = p->reals->len,
                      .degree_u = 3,
                      .degree_v = 3,
                      .n_u = 3 * u.n + 1,
                      .n_v = 3 * v.n + 1};
    int64_t n_poles = (int64_t)s->n_u * s->n_v;
    if (n_poles > MOST_POLES || p->reals->len + 4 * n_poles > MOST_REALS)
        return refuse(f, "is crossed by too many knots of its points", error);
    u.ordinates = g_new0(double, (gsize)n *(gsize)s->n_u);
    v.ordinates = g_new0(double, (gsize)n *(gsize)s->n_v);
    for (int k = 0; k < n; k++)
        if (!find_ordinates(in_u[k], &u, u.ordinates + (ptrdiff_t)k * s->n_u) ||
            !find_ordinates(in_v[k], &v, v.ordinates + (ptrdiff_t)k * s->n_v))
            return refuse(f, "is torn: a point has four equal knots inside it", error);
    g_autofree double(*poles)[4] = g_malloc0_n((gsize)s->n_u * (gsize)s->n_v, sizeof *poles);
    sum_poles(t, influence, n, &u, &v, poles);
    if (!take_limits(poles, (size_t)s->n_u, (size_t)s->n_v))
        return refuse(f,
                      "is not covered up to its border: the weights of its points sum to 0 "
                      "there; repeat the outer lines, or make it a hole",
                      error);
    append_knots(p->reals, &u);
    append_knots(p->reals, &v);
    append_poles(p, s, poles);
    return true;
}

/* ------------------------------------------------------------------ Bézier pieces */

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void find_pieces(Pieces *pieces, const Knots *knots, int n, double a, double b)
{
    pieces->cuts = g_new(double, 5 * n + 2);
    int count = 0, kept = 1;
    pieces->cuts[count++] = a;
    for (int k = 0; k < n; k++)
        for (int i = 0; i < 5; i++)
            if (knots[k][i] > a && knots[k][i] < b)
                pieces->cuts[count++] = knots[k][i];
    pieces->cuts[count++] = b;
    qsort(pieces->cuts, (size_t)count, sizeof *pieces->cuts, compare_doubles);
    for (int i = 1; i < count; i++)
        if (pieces->cuts[i] > pieces->cuts[kept - 1])
            pieces->cuts[kept++] = pieces->cuts[i];
    pieces->n = kept - 1;
}

static double share(double part, double whole)
{
    return whole > 0 ? part / whole : 0;
}

/* The polynomial that N[s0 … s4] is between s[span] and s[span + 1], and its derivative, at t. */
static void evaluate(const Knots s, int span, double t, double *value, double *derivative)
{
    double b[4] = {0};
    b[span] = 1;
    for (int d = 1; d <= 3; d++) {
        if (d == 3)
            *derivative = 3 * (share(b[0], s[3] - s[0]) - share(b[1], s[4] - s[1]));
        for (int i = 0; i + d < 4; i++)
            b[i] = share(t - s[i], s[i + d] - s[i]) * b[i] +
                   share(s[i + d + 1] - t, s[i + d + 1] - s[i + 1]) * b[i + 1];
    }
    *value = b[0];
}

/* The Bézier ordinates of N[s0 … s4] over the pieces, end to end: from its values and slopes at the
 * ends of a piece. False where it jumps between two. */
static bool find_ordinates(const Knots s, const Pieces *pieces, double *out)
{
    for (int i = 0; i < 2; i++)
        if (s[i] == s[i + 3] && s[i] > pieces->cuts[0] && s[i] < pieces->cuts[pieces->n])
            return false;
    for (int k = 0; k < pieces->n; k++, out += 3) {
        double a = pieces->cuts[k], b = pieces->cuts[k + 1], value, slope;
        int span = 0;
        while (span < 4 && !(s[span] <= a && b <= s[span + 1]))
            span++;
        if (span == 4)
            continue;
        evaluate(s, span, a, &value, &slope);
        out[0] = value;
        out[1] = value + slope * (b - a) / 3;
        evaluate(s, span, b, &value, &slope);
        out[2] = value - slope * (b - a) / 3;
        out[3] = value;
    }
    return true;
}
