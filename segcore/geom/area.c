/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Area of a trimmed face by Green's theorem. With J = |Su × Sv| and G(u,v) the integral of J(u,s)
 * over s from the domain's lower v to v, the area inside the loops is the integral of -G du along
 * them, material on the left; where a loop has gaps they are bridged straight. The paths are cut
 * where they cross knots of the surface. On a piece within the j-th span of v, G is the part from
 * that span's lower knot, integrated along the piece, and the part below it, whose integral depends
 * on the piece's ends alone.
 */
#include "segcore/geom/columns.h"
#include "segcore/geom/integrate.h"

/* Expected error of each integral that is good enough, as a part of the face's area. */
static const double GOOD_ENOUGH = 1e-8;

/* A walk along a path in (u,v). */
typedef struct {
    const SegSurface *surface;
    SegSurfaceTables tables;
    SegColumns *columns;
    double constant;     /* J where it is the same everywhere; else 0 */
    const double *reals; /* the path's */
    const SegCurve *path;
    int span_v; /* of the piece in hand */
    double enough;
    GArray *breaks; /* of double: scratch */
} Walk;

static double walk_loop(Walk *walk, const SegPart *part, const SegLoop *loop);
static double constant_element(const SegPart *part, const SegFace *face);
static double rough_area(const SegPart *part, const SegFace *face);

double seg_face_area_mm2(const SegPart *part, int32_t face)
{
    if (part->areas_mm2)
        return part->areas_mm2[face];
    const SegFace *f = &part->faces[face];
    const SegSurface *s = &f->surface;
    if (s->n_u == 0)
        return 0;
    SegSurfaceTables tables = seg_surface_tables(part->reals, s);
    double enough = GOOD_ENOUGH * rough_area(part, f);
    double extent_u = tables.knots_u[s->n_u] - tables.knots_u[s->degree_u];
    g_autoptr(GArray) breaks = g_array_new(FALSE, FALSE, sizeof(double));
    g_autoptr(SegColumns) columns = seg_columns_new(part->reals, s, enough / extent_u);
    Walk walk = {.surface = s,
                 .tables = tables,
                 .columns = columns,
                 .constant = constant_element(part, f),
                 .enough = enough,
                 .breaks = breaks};
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
static double constant_element(const SegPart *part, const SegFace *face)
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

/* ------------------------------------------------------------------ paths */

/* -G du/dt along the piece, without what lies below its span of v. */
static double minus_g_du(void *context, double t)
{
    Walk *walk = context;
    SegVec3 c[3];
    seg_curve_derivatives(walk->reals, walk->path, t, 1, c);
    if (c[1].x == 0)
        return 0;
    if (walk->constant > 0)
        return -walk->constant * (c[0].y - walk->tables.knots_v[1]) * c[1].x;
    return -seg_columns_above(walk->columns, c[0].x, walk->span_v, c[0].y) * c[1].x;
}

/* The coordinate k (0: u, 1: v) of the path. */
static double coordinate(const Walk *walk, int k, double t)
{
    SegVec3 c[3];
    seg_curve_derivatives(walk->reals, walk->path, t, 0, c);
    return k == 0 ? c[0].x : c[0].y;
}

/* The surface's knots in one direction (0: u, 1: v). */
typedef struct {
    const double *knots;
    int degree, n;
    double near; /* a knot so close is not crossed */
} Grid;

static Grid grid_of(const Walk *walk, int k)
{
    const SegSurface *s = walk->surface;
    Grid g = {k == 0 ? walk->tables.knots_u : walk->tables.knots_v,
              k == 0 ? s->degree_u : s->degree_v, k == 0 ? s->n_u : s->n_v, 0};
    g.near = 1e-9 * (g.knots[g.n] - g.knots[g.degree]);
    return g;
}

/* The first knot above low, as an index; n or more where there is none below high. */
static int next_knot(const Grid *g, double low, double high)
{
    int i = seg_knot_span(g->knots, g->degree, g->n, low) + 1;
    while (i < g->n && g->knots[i] <= low)
        i++;
    return i < g->n && g->knots[i] < high ? i : g->n;
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

/* Appends the path's crossings of the knots in direction k between a and b, within one of its
 * spans, looking at a few points. One that is missed costs time, not correctness. */
static void add_crossings(Walk *walk, int k, const Grid *g, double a, double b)
{
    int steps = walk->path->degree == 1 ? 1 : 2 * walk->path->degree;
    double from = coordinate(walk, k, a);
    for (int step = 1; step <= steps; step++) {
        double t0 = a + (b - a) * (step - 1) / steps, t1 = a + (b - a) * step / steps;
        double to = coordinate(walk, k, t1), high = fmax(from, to);
        for (int i = next_knot(g, fmin(from, to), high); i < g->n && g->knots[i] < high; i++)
            if (g->knots[i] > g->knots[i - 1]) {
                double t = crossing(walk, k, g->knots[i], t0, t1);
                g_array_append_val(walk->breaks, t);
            }
        from = to;
    }
}

/* The hull of the path's poles of one span, in direction k. */
static void hull(const Walk *walk, int span, int k, double *low, double *high)
{
    const SegCurve *c = walk->path;
    const double *poles = seg_curve_tables(walk->reals, c).poles;
    *low = INFINITY;
    *high = -INFINITY;
    for (int i = span - c->degree; i <= span; i++) {
        *low = fmin(*low, poles[2 * i + k]);
        *high = fmax(*high, poles[2 * i + k]);
    }
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double walk_piece(Walk *walk, double a, double b)
{
    int q = walk->surface->degree_v, n = walk->surface->n_v;
    walk->span_v = q;
    if (walk->constant > 0 || n == q + 1)
        return seg_integrate(minus_g_du, walk, a, b, 0, walk->enough);
    double v = coordinate(walk, 1, (a + b) / 2);
    walk->span_v = seg_knot_span(walk->tables.knots_v, q, n, v);
    double below = seg_columns_below(walk->columns, coordinate(walk, 0, a), coordinate(walk, 0, b),
                                     walk->span_v);
    return seg_integrate(minus_g_du, walk, a, b, 0, walk->enough) - below;
}

/* Over [a, b], within one of the path's spans: cut where the surface has knots, which only matters
 * where the poles reach over one. */
static double walk_span(Walk *walk, int span, double a, double b)
{
    double low, high;
    g_array_set_size(walk->breaks, 0);
    for (int k = 0; k < 2; k++) {
        hull(walk, span, k, &low, &high);
        if (k == 0 && low == high)
            return 0; /* du = 0 */
        Grid g = grid_of(walk, k);
        if (walk->constant <= 0 && next_knot(&g, low + g.near, high - g.near) < g.n)
            add_crossings(walk, k, &g, a, b);
    }
    g_array_sort(walk->breaks, compare_doubles);
    double sum = 0, from = a;
    for (guint i = 0; i < walk->breaks->len; i++) {
        double t = g_array_index(walk->breaks, double, i);
        if (t <= from || t >= b)
            continue;
        sum += walk_piece(walk, from, t);
        from = t;
    }
    return sum + walk_piece(walk, from, b);
}

static double walk_along(Walk *walk, const double *reals, const SegCurve *path, double first,
                         double last)
{
    walk->reals = reals;
    walk->path = path;
    const double *knots = seg_curve_tables(reals, path).knots;
    double sum = 0;
    for (int i = seg_knot_span(knots, path->degree, path->n_poles, first);
         i < path->n_poles && knots[i] < last; i++) {
        double a = fmax(first, knots[i]), b = fmin(last, knots[i + 1]);
        if (a < b)
            sum += walk_span(walk, i, a, b);
    }
    return sum;
}

/* Straight from a to b: files have loops whose ends meet within a tolerance only. */
static double walk_gap(Walk *walk, SegVec3 a, SegVec3 b)
{
    const SegSurface *s = walk->surface;
    const double *knots = walk->tables.knots_u;
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
