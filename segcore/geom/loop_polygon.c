/* SPDX-License-Identifier: Apache-2.0 */
/* Loops as polygons in (u,v). */
#include "segcore/geom/bspline.h"

typedef struct {
    double u, v;
    SegVec3 p;
} Sample;

typedef struct {
    const SegPart *part;
    const SegSurface *surface;
    const SegCoedge *coedge;
    double chord_mm;
    GArray *uv; /* of double[2] */
} Outline;

static Sample sample_at(const Outline *o, double t)
{
    SegVec3 c = seg_curve_evaluate(o->part, &o->coedge->pcurve, t, NULL);
    return (Sample){c.x, c.y, seg_surface_evaluate(o->part->reals, o->surface, c.x, c.y, 0).p};
}

static double distance_to_chord(SegVec3 p, SegVec3 a, SegVec3 b)
{
    SegVec3 ab = seg_sub(b, a), ap = seg_sub(p, a);
    double length2 = seg_dot(ab, ab);
    double t = length2 > 0 ? fmin(fmax(seg_dot(ap, ab) / length2, 0), 1) : 0;
    return seg_norm(seg_along(ap, ab, -t));
}

/* How far the edge's point s, between a and b, lies from the chord: the straight one in space, and
 * the image of the straight one in (u,v). */
static double sagitta(const Outline *o, const Sample *s, const Sample *a, const Sample *b)
{
    double du = b->u - a->u, dv = b->v - a->v, length2 = du * du + dv * dv;
    double t = length2 > 0 ? ((s->u - a->u) * du + (s->v - a->v) * dv) / length2 : 0;
    t = fmin(fmax(t, 0), 1);
    SegVec3 image =
        seg_surface_evaluate(o->part->reals, o->surface, a->u + t * du, a->v + t * dv, 0).p;
    return fmax(distance_to_chord(s->p, a->p, b->p), seg_distance(s->p, image));
}

/* Appends the points after a up to and with b; m lies at the middle. */
static void refine(const Outline *o, double ta, const Sample *a, const Sample *m, double tb,
                   const Sample *b, int depth)
{
    double tm = (ta + tb) / 2;
    Sample q1 = sample_at(o, (ta + tm) / 2), q3 = sample_at(o, (tm + tb) / 2);
    double off = fmax(sagitta(o, m, a, b), fmax(sagitta(o, &q1, a, b), sagitta(o, &q3, a, b)));
    if (depth > 0 && off > o->chord_mm) {
        refine(o, ta, a, &q1, tm, m, depth - 1);
        refine(o, tm, m, &q3, tb, b, depth - 1);
    } else {
        double uv[2] = {b->u, b->v};
        g_array_append_val(o->uv, uv);
    }
}

/* From one end to the other, span by span, both ends included. */
static void append_coedge(const Outline *o)
{
    const int max_depth = 12;
    const SegCoedge *c = o->coedge;
    const double *knots = seg_curve_tables(o->part->reals, &c->pcurve).knots;
    int p = c->pcurve.degree, n = c->pcurve.n_poles;
    guint start = o->uv->len;
    double t = c->t_first;
    Sample a = sample_at(o, t);
    double first[2] = {a.u, a.v};
    g_array_append_val(o->uv, first);
    for (int i = seg_knot_span(knots, p, n, t); i < n && t < c->t_last; i++) {
        double next = i == n - 1 ? c->t_last : fmin(knots[i + 1], c->t_last);
        if (!(next > t))
            continue;
        Sample m = sample_at(o, (t + next) / 2), b = sample_at(o, next);
        refine(o, t, &a, &m, next, &b, max_depth);
        a = b;
        t = next;
    }
    double(*uv)[2] = (double(*)[2])(void *)o->uv->data + start;
    guint count = o->uv->len - start;
    for (guint i = 0; c->reversed && i < count / 2; i++)
        for (int k = 0; k < 2; k++) {
            double swap = uv[i][k];
            uv[i][k] = uv[count - 1 - i][k];
            uv[count - 1 - i][k] = swap;
        }
}

/* Drops the points that repeat the one before, as the next coedge's first does where no gap is. */
static void drop_repeated(const Outline *o)
{
    SegSurfaceTables t = seg_surface_tables(o->part->reals, o->surface);
    const SegSurface *s = o->surface;
    double near_u = 1e-9 * (t.knots_u[s->n_u] - t.knots_u[s->degree_u]);
    double near_v = 1e-9 * (t.knots_v[s->n_v] - t.knots_v[s->degree_v]);
    double(*uv)[2] = (double(*)[2])(void *)o->uv->data;
    guint kept = 0;
    for (guint i = 0; i < o->uv->len; i++) {
        const double *next = uv[(i + 1) % o->uv->len];
        if (fabs(next[0] - uv[i][0]) > near_u || fabs(next[1] - uv[i][1]) > near_v) {
            uv[kept][0] = uv[i][0];
            uv[kept++][1] = uv[i][1];
        }
    }
    g_array_set_size(o->uv, kept);
}

/* The last face whose loops begin at or before this one: loops ascend with the faces. */
static const SegFace *owner(const SegPart *part, int32_t loop)
{
    int32_t low = 0, high = part->n_faces;
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        if (part->faces[middle].first_loop <= loop)
            low = middle;
        else
            high = middle;
    }
    return &part->faces[low];
}

SegLoopPolygon seg_loop_polygon(const SegPart *part, int32_t loop, double chord_mm)
{
    Outline o = {part, &owner(part, loop)->surface, NULL, chord_mm, NULL};
    o.uv = g_array_new(FALSE, FALSE, sizeof(double[2]));
    for (int32_t i = 0; i < part->loops[loop].n_coedges; i++) {
        o.coedge = &part->coedges[part->loops[loop].first_coedge + i];
        append_coedge(&o);
    }
    drop_repeated(&o);
    size_t n = o.uv->len;
    return (SegLoopPolygon){(double(*)[2])(void *)g_array_free(o.uv, FALSE), n};
}

/* Does the side from a to b pass v, and at which u? */
static inline bool side_passes(const double a[2], const double b[2], double v, double *u)
{
    if ((a[1] > v) == (b[1] > v))
        return false;
    *u = a[0] + (v - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
    return true;
}

bool seg_polygons_contain(const SegLoopPolygon *polygons, size_t n, double u, double v)
{
    bool inside = false;
    for (size_t i = 0; i < n; i++) {
        const SegLoopPolygon *p = &polygons[i];
        double at;
        for (size_t k = 0, j = p->n - 1; k < p->n; j = k++)
            if (side_passes(p->uv[j], p->uv[k], v, &at) && u < at)
                inside = !inside;
    }
    return inside;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void find_passes(const SegLoopPolygon *polygons, size_t n, double v, GArray *passes)
{
    g_array_set_size(passes, 0);
    for (size_t i = 0; i < n; i++) {
        const SegLoopPolygon *p = &polygons[i];
        double at;
        for (size_t k = 0, j = p->n - 1; k < p->n; j = k++)
            if (side_passes(p->uv[j], p->uv[k], v, &at))
                g_array_append_val(passes, at);
    }
    g_array_sort(passes, compare_doubles);
}

/* How many of the sorted values are above u. */
static guint count_above(const GArray *sorted, double u)
{
    guint low = 0, high = sorted->len;
    while (low < high) {
        guint middle = low + (high - low) / 2;
        if (u < g_array_index(sorted, double, middle))
            high = middle;
        else
            low = middle + 1;
    }
    return sorted->len - low;
}

void seg_polygons_grid(const SegLoopPolygon *polygons, size_t n, const double *u, size_t n_u,
                       const double *v, size_t n_v, uint8_t *flags)
{
    g_autoptr(GArray) passes = g_array_new(FALSE, FALSE, sizeof(double));
    for (size_t j = 0; j < n_v; j++) {
        find_passes(polygons, n, v[j], passes);
        for (size_t i = 0; i < n_u; i++)
            if (count_above(passes, u[i]) % 2 == 0)
                flags[i * n_v + j] |= SEG_POINT_OUTSIDE;
    }
}
