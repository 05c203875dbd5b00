/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Area of a trimmed face by Green's theorem. With J = |Su × Sv| and G(u,v) the integral of J(u,s)
 * over s from the domain's lower v to v, the area inside the loops is the integral of -G du along
 * them, material on the left; where a loop has gaps they are bridged straight. The outer integral
 * runs along the pcurves, cut where they cross knots of the surface; the inner one runs up a column
 * of the surface, whose poles are summed over u once.
 */
#include "segcore/geom/bspline.h"
#include "segcore/geom/integrate.h"

/* Difference between 7 and 15 points that is good enough, as a part of the face's area; the
 * integrals come out far better. */
static const double GOOD_ENOUGH = 2e-8;

typedef struct {
    double x, y, z, w;
} Pole;

/* The curve v -> S(u,v) and its derivative by u, as poles in v. */
typedef struct {
    const SegSurface *surface;
    SegSurfaceTables tables;
    double u;
    Pole *at, *by_u; /* n_v each */
    double constant; /* J where it is the same everywhere; else 0 */
    double enough;
} Column;

/* A walk along a path in (u,v). */
typedef struct {
    Column *column;
    const double *reals; /* the path's */
    const SegCurve *path;
    double enough;
} Walk;

static double walk_loop(Walk *walk, const SegPart *part, const SegLoop *loop);
static double constant_jacobian(const SegPart *part, const SegFace *face);
static double rough_area(const SegPart *part, const SegFace *face);

double seg_face_area_mm2(const SegPart *part, int32_t face)
{
    const SegFace *f = &part->faces[face];
    if (f->surface.n_u == 0)
        return 0;
    Column column = {&f->surface, seg_surface_tables(part->reals, &f->surface),
                     NAN,         NULL,
                     NULL,        constant_jacobian(part, f)};
    g_autofree Pole *poles = g_new(Pole, 2 * (size_t)f->surface.n_v);
    column.at = poles;
    column.by_u = poles + f->surface.n_v;
    Walk walk = {&column, NULL, NULL, GOOD_ENOUGH * rough_area(part, f)};
    column.enough = walk.enough / (column.tables.knots_u[f->surface.n_u] -
                                   column.tables.knots_u[f->surface.degree_u]);
    double area = 0;
    for (int32_t l = f->first_loop; l < f->first_loop + f->n_loops; l++)
        area += walk_loop(&walk, part, &part->loops[l]);
    return fabs(area); /* the loops of a reversed face may run the other way */
}

/* By its triangles. */
static double rough_area(const SegPart *part, const SegFace *face)
{
    double sum = 0;
    for (int32_t t = face->first_triangle; t < face->first_triangle + face->n_triangles; t++) {
        const int32_t *v = part->triangles[t].vertex;
        SegVec3 a = part->vertices[v[0]].position;
        SegVec3 ab = seg_sub(part->vertices[v[1]].position, a);
        SegVec3 ac = seg_sub(part->vertices[v[2]].position, a);
        sum += seg_norm(seg_cross(ab, ac)) / 2;
    }
    return sum;
}

/* A parallelogram: nothing to integrate. */
static double constant_jacobian(const SegPart *part, const SegFace *face)
{
    const SegSurface *s = &face->surface;
    if (face->type != SEG_SURFACE_PLANE || s->degree_u != 1 || s->degree_v != 1 || s->n_u != 2 ||
        s->n_v != 2 || s->rational)
        return 0;
    SegSurfaceTables t = seg_surface_tables(part->reals, s);
    SegSurfacePoint a = seg_surface_evaluate(part->reals, s, t.knots_u[1], t.knots_v[1], 1);
    SegSurfacePoint b = seg_surface_evaluate(part->reals, s, t.knots_u[2], t.knots_v[2], 1);
    SegVec3 twist = seg_sub(b.pu, a.pu);
    if (seg_norm(twist) > 1e-12 * seg_norm(a.pu))
        return 0;
    return seg_norm(seg_cross(a.pu, a.pv));
}

/* ------------------------------------------------------------------ the inner integral */

static void move_column(Column *column, double u)
{
    if (column->u == u)
        return;
    column->u = u;
    const SegSurface *s = column->surface;
    const SegSurfaceTables *t = &column->tables;
    int p = s->degree_u, span = seg_knot_span(t->knots_u, p, s->n_u, u);
    double basis[3][SEG_MAX_DEGREE + 1];
    seg_basis(t->knots_u, p, span, u, 1, basis);
    for (int j = 0; j < s->n_v; j++) {
        Pole at = {0}, by_u = {0};
        for (int i = 0; i <= p; i++) {
            ptrdiff_t k = (ptrdiff_t)(span - p + i) * s->n_v + j;
            const double *q = t->poles + 3 * k;
            double w = t->weights ? t->weights[k] : 1;
            double a = basis[0][i] * w, b = basis[1][i] * w;
            at = (Pole){at.x + a * q[0], at.y + a * q[1], at.z + a * q[2], at.w + a};
            by_u = (Pole){by_u.x + b * q[0], by_u.y + b * q[1], by_u.z + b * q[2], by_u.w + b};
        }
        column->at[j] = at;
        column->by_u[j] = by_u;
    }
}

static void add(Pole *sum, double factor, const Pole *p)
{
    sum->x += factor * p->x;
    sum->y += factor * p->y;
    sum->z += factor * p->z;
    sum->w += factor * p->w;
}

static SegVec3 xyz(const Pole *p)
{
    return seg_vec3(p->x, p->y, p->z);
}

/* J at v of the column. */
static double jacobian(void *context, double v)
{
    const Column *column = context;
    const SegSurface *s = column->surface;
    int q = s->degree_v, span = seg_knot_span(column->tables.knots_v, q, s->n_v, v);
    double basis[3][SEG_MAX_DEGREE + 1];
    seg_basis(column->tables.knots_v, q, span, v, 1, basis);
    Pole a = {0}, au = {0}, av = {0};
    for (int j = 0; j <= q; j++) {
        const Pole *at = &column->at[span - q + j];
        add(&a, basis[0][j], at);
        add(&av, basis[1][j], at);
        add(&au, basis[0][j], &column->by_u[span - q + j]);
    }
    SegVec3 su = xyz(&au), sv = xyz(&av);
    if (s->rational) {
        SegVec3 p = seg_scale(xyz(&a), 1 / a.w);
        su = seg_scale(seg_along(su, p, -au.w), 1 / a.w);
        sv = seg_scale(seg_along(sv, p, -av.w), 1 / a.w);
    }
    return seg_norm(seg_cross(su, sv));
}

/* G(u, v). */
static double column_area(Column *column, double u, double v)
{
    const SegSurface *s = column->surface;
    const double *ku = column->tables.knots_u, *kv = column->tables.knots_v;
    u = fmin(fmax(u, ku[s->degree_u]), ku[s->n_u]);
    double low = kv[s->degree_v];
    v = fmin(fmax(v, low), kv[s->n_v]);
    if (column->constant > 0)
        return column->constant * (v - low);
    if (v == low)
        return 0;
    move_column(column, u);
    double sum = 0;
    for (int j = s->degree_v; j < s->n_v && kv[j] < v; j++)
        if (kv[j + 1] > kv[j])
            sum += seg_integrate(jacobian, column, kv[j], fmin(v, kv[j + 1]), GOOD_ENOUGH,
                                 column->enough);
    return sum;
}

/* ------------------------------------------------------------------ the outer integral */

/* -G du/dt along the path. */
static double minus_g_du(void *context, double t)
{
    Walk *walk = context;
    SegVec3 c[3];
    seg_curve_derivatives(walk->reals, walk->path, t, 1, c);
    return c[1].x == 0 ? 0 : -column_area(walk->column, c[0].x, c[0].y) * c[1].x;
}

/* The coordinate k (0: u, 1: v) of the path. */
static double coordinate(const Walk *walk, int k, double t)
{
    SegVec3 c[3];
    seg_curve_derivatives(walk->reals, walk->path, t, 0, c);
    return k == 0 ? c[0].x : c[0].y;
}

/* Where coordinate k passes `knot` between a and b, on whose sides it lies. */
static double crossing(const Walk *walk, int k, double knot, double a, double b)
{
    double at_a = coordinate(walk, k, a) - knot, at_b = coordinate(walk, k, b) - knot;
    for (int i = 0; i < 60 && fabs(b - a) > 1e-15 * (fabs(a) + fabs(b)); i++) {
        double t = i % 3 ? a - at_a * (b - a) / (at_b - at_a) : (a + b) / 2;
        double at_t = coordinate(walk, k, t) - knot;
        if (at_t == 0)
            return t;
        if ((at_t > 0) == (at_a > 0)) {
            a = t;
            at_a = at_t;
        } else {
            b = t;
            at_b = at_t;
        }
    }
    return (a + b) / 2;
}

/* Appends the crossings of [a, b] with the knots of one direction. */
static void add_crossings(const Walk *walk, int k, double a, double b, GArray *breaks)
{
    const SegSurface *s = walk->column->surface;
    int degree = k == 0 ? s->degree_u : s->degree_v, n = k == 0 ? s->n_u : s->n_v;
    const double *knots = k == 0 ? walk->column->tables.knots_u : walk->column->tables.knots_v;
    double from = coordinate(walk, k, a), to = coordinate(walk, k, b);
    double low = fmin(from, to), high = fmax(from, to);
    for (int i = seg_knot_span(knots, degree, n, low) + 1; i < n && knots[i] < high; i++)
        if (knots[i] > low && knots[i] > knots[i - 1]) {
            double t = crossing(walk, k, knots[i], a, b);
            g_array_append_val(breaks, t);
        }
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The path's parameters between which nothing has a kink, both ends included. */
static GArray *smooth_pieces(const Walk *walk, double first, double last)
{
    GArray *breaks = g_array_new(FALSE, FALSE, sizeof(double));
    const SegCurve *c = walk->path;
    const double *knots = seg_curve_tables(walk->reals, c).knots;
    int steps = c->degree == 1 && !c->rational ? 1 : 2 * c->degree;
    for (int i = seg_knot_span(knots, c->degree, c->n_poles, first);
         i < c->n_poles && knots[i] < last; i++) {
        double from = fmax(first, knots[i]), to = fmin(last, knots[i + 1]);
        for (int k = 0; from < to && k < steps; k++) {
            double a = from + (to - from) * k / steps, b = from + (to - from) * (k + 1) / steps;
            if (k == 0)
                g_array_append_val(breaks, a);
            if (walk->column->constant > 0)
                continue;
            add_crossings(walk, 0, a, b, breaks);
            add_crossings(walk, 1, a, b, breaks);
        }
    }
    g_array_append_val(breaks, last);
    g_array_sort(breaks, compare_doubles);
    return breaks;
}

static double walk_along(Walk *walk, const double *reals, const SegCurve *path, double first,
                         double last)
{
    walk->reals = reals;
    walk->path = path;
    g_autoptr(GArray) breaks = smooth_pieces(walk, first, last);
    double sum = 0;
    for (guint i = 0; i + 1 < breaks->len; i++) {
        double a = g_array_index(breaks, double, i), b = g_array_index(breaks, double, i + 1);
        if (b > a)
            sum += seg_integrate(minus_g_du, walk, a, b, GOOD_ENOUGH, walk->enough);
    }
    return sum;
}

/* Straight from a to b: files have loops whose ends meet within a tolerance only. */
static double walk_gap(Walk *walk, SegVec3 a, SegVec3 b)
{
    const SegSurface *s = walk->column->surface;
    const double *knots = walk->column->tables.knots_u;
    if (fabs(b.x - a.x) <= 1e-9 * (knots[s->n_u] - knots[s->degree_u]))
        return 0;
    const double line[8] = {0, 0, 1, 1, a.x, a.y, b.x, b.y};
    SegCurve path = {.degree = 1, .n_poles = 2, .dim = 2};
    return walk_along(walk, line, &path, 0, 1);
}

/* The first or last point of a coedge in the loop's direction. */
static SegVec3 end_of(const SegPart *part, const SegCoedge *c, bool last)
{
    double t = last == (c->reversed == 0) ? c->t_last : c->t_first;
    return seg_curve_evaluate(part, &c->pcurve, t, NULL);
}

static double walk_loop(Walk *walk, const SegPart *part, const SegLoop *loop)
{
    const SegCoedge *coedges = &part->coedges[loop->first_coedge];
    double sum = 0;
    for (int32_t i = 0; i < loop->n_coedges; i++) {
        const SegCoedge *c = &coedges[i], *next = &coedges[(i + 1) % loop->n_coedges];
        double along = walk_along(walk, part->reals, &c->pcurve, c->t_first, c->t_last);
        sum += c->reversed ? -along : along;
        sum += walk_gap(walk, end_of(part, c, true), end_of(part, next, false));
    }
    return sum;
}
