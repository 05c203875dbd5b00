/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/geom/columns.h"

#include "segcore/geom/integrate.h"

#include <string.h>

enum { NODES = 8, MAX_STRIPS = 64 };

/* A strip is resolved when its last Legendre coefficients are this small against the first. */
static const double RESOLVED = 1e-8;

typedef struct {
    double x, y, z, w;
} Pole;

/* A part of a span of u. For every span of v, as Legendre coefficients over the strip: the integral
 * of J from the domain's lower end to the knot below that span, as a function of u. */
typedef struct {
    double u_a, u_b;
    double (*below)[NODES]; /* one a span of v, and one for all of them */
} Strip;

struct SegColumns {
    const SegSurface *surface;
    SegSurfaceTables tables;
    double enough;
    Pole *at, *by_u;  /* n_v each: the column v -> S(u,v) and its derivative by u, as poles in v */
    double u;         /* of the column */
    int first, count; /* the poles that are up to date */
    GArray **strips;  /* of Strip, ascending, by span of u: NULL until asked for */
};

SegColumns *seg_columns_new(const double *reals, const SegSurface *surface, double enough)
{
    SegColumns *c = g_new0(SegColumns, 1);
    *c = (SegColumns){.surface = surface,
                      .tables = seg_surface_tables(reals, surface),
                      .enough = enough,
                      .at = g_new(Pole, 2 * (size_t)surface->n_v),
                      .u = NAN};
    c->by_u = c->at + surface->n_v;
    return c;
}

static void clear_strip(void *strip)
{
    g_free(((Strip *)strip)->below);
}

void seg_columns_free(SegColumns *columns)
{
    for (int i = 0; columns->strips && i < columns->surface->n_u; i++)
        if (columns->strips[i])
            g_array_unref(columns->strips[i]);
    g_free(columns->strips);
    g_free(columns->at);
    g_free(columns);
}

/* ------------------------------------------------------------------ one column */

/* Sums the poles first … first + count - 1 of the column at u. */
static void move_to(SegColumns *c, double u, int first, int count)
{
    if (c->u == u && first >= c->first && first + count <= c->first + c->count)
        return;
    c->u = u;
    c->first = first;
    c->count = count;
    const SegSurface *s = c->surface;
    const SegSurfaceTables *t = &c->tables;
    int p = s->degree_u, span = seg_knot_span(t->knots_u, p, s->n_u, u);
    double basis[3][SEG_MAX_DEGREE + 1];
    seg_basis(t->knots_u, p, span, u, 1, basis);
    for (int j = first; j < first + count; j++) {
        Pole at = {0}, by_u = {0};
        for (int i = 0; i <= p; i++) {
            ptrdiff_t k = (ptrdiff_t)(span - p + i) * s->n_v + j;
            const double *q = t->poles + 3 * k;
            double w = t->weights ? t->weights[k] : 1;
            double a = basis[0][i] * w, b = basis[1][i] * w;
            at = (Pole){at.x + a * q[0], at.y + a * q[1], at.z + a * q[2], at.w + a};
            by_u = (Pole){by_u.x + b * q[0], by_u.y + b * q[1], by_u.z + b * q[2], by_u.w + b};
        }
        c->at[j] = at;
        c->by_u[j] = by_u;
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
static double area_element(void *context, double v)
{
    const SegColumns *c = context;
    const SegSurface *s = c->surface;
    int q = s->degree_v, span = seg_knot_span(c->tables.knots_v, q, s->n_v, v);
    double basis[3][SEG_MAX_DEGREE + 1];
    seg_basis(c->tables.knots_v, q, span, v, 1, basis);
    Pole a = {0}, au = {0}, av = {0};
    for (int j = 0; j <= q; j++) {
        add(&a, basis[0][j], &c->at[span - q + j]);
        add(&av, basis[1][j], &c->at[span - q + j]);
        add(&au, basis[0][j], &c->by_u[span - q + j]);
    }
    SegVec3 su = xyz(&au), sv = xyz(&av);
    if (s->rational) {
        SegVec3 p = seg_scale(xyz(&a), 1 / a.w);
        su = seg_scale(seg_along(su, p, -au.w), 1 / a.w);
        sv = seg_scale(seg_along(sv, p, -av.w), 1 / a.w);
    }
    return seg_norm(seg_cross(su, sv));
}

/* Within one span of v. */
static double within_span(SegColumns *c, int span_v, double v_a, double v_b)
{
    if (v_a == v_b)
        return 0;
    move_to(c, c->u, span_v - c->surface->degree_v, c->surface->degree_v + 1);
    return seg_integrate(area_element, c, v_a, v_b, 0, c->enough);
}

/* Loops overhang their surface by what the file calls accurate: the spans at the ends reach on. */
static double within_reach(const double *knots, int degree, int n, double t)
{
    const double reach = 0.01 * (knots[n] - knots[degree]);
    return fmin(fmax(t, knots[degree] - reach), knots[n] + reach);
}

/* t, or the end of span j that is nearest to it; the first and the last span are open. */
static double end_in_span(const double *knots, int j, int first, int last, double t)
{
    if (j > first)
        t = fmax(t, knots[j]);
    return j < last ? fmin(t, knots[j + 1]) : t;
}

double seg_columns_above(SegColumns *c, double u, int span_v, double v)
{
    const double *kv = c->tables.knots_v;
    int q = c->surface->degree_v, n = c->surface->n_v;
    v = within_reach(kv, q, n, v);
    u = within_reach(c->tables.knots_u, c->surface->degree_u, c->surface->n_u, u);
    if (c->u != u) {
        c->u = u;
        c->count = 0;
    }
    /* Nearly always within the span; a path may stray over its ends. */
    int first = seg_knot_span(kv, q, n, kv[q]), last = seg_knot_span(kv, q, n, kv[n]);
    double sum = 0;
    for (int j = span_v; j <= last && (kv[j] < v || j == span_v); j++)
        if (kv[j + 1] > kv[j])
            sum += within_span(c, j, kv[j], end_in_span(kv, j, first, last, v));
    for (int j = span_v - 1; j >= first && kv[j + 1] > v; j--)
        if (kv[j + 1] > kv[j])
            sum -= within_span(c, j, end_in_span(kv, j, first, last, v), kv[j + 1]);
    return sum;
}

/* ------------------------------------------------------------------ strips */

/* Gauss's nodes of order NODES on one side, and their weights. */
static const double NODE[NODES / 2] = {
    0.183434642495649804939476142360184, 0.525532409916328985817739049189246,
    0.796666477413626739591553936475830, 0.960289856497536231683560868569473};
static const double WEIGHT[NODES / 2] = {
    0.362683783378361982965150449277196, 0.313706645877887287337962201986601,
    0.222381034453374470544355994426241, 0.101228536290376259152531354309962};

static double node(int i)
{
    return i < NODES / 2 ? -NODE[NODES / 2 - 1 - i] : NODE[i - NODES / 2];
}

static double weight(int i)
{
    return i < NODES / 2 ? WEIGHT[NODES / 2 - 1 - i] : WEIGHT[i - NODES / 2];
}

/* Legendre polynomials P0 … P[n - 1] at x. */
static void legendre(double x, int n, double *p)
{
    p[0] = 1;
    p[1] = x;
    for (int m = 2; m < n; m++)
        p[m] = ((2 * m - 1) * x * p[m - 1] - (m - 1) * p[m - 2]) / m;
}

static size_t n_rows(const SegColumns *c)
{
    return (size_t)(c->surface->n_v - c->surface->degree_v + 1);
}

/* A strip's integrals at the nodes, summed up from below, then turned into coefficients. */
static Strip make_strip(SegColumns *c, double u_a, double u_b)
{
    const double *kv = c->tables.knots_v;
    int q = c->surface->degree_v, n = c->surface->n_v;
    size_t rows = n_rows(c);
    Strip strip = {u_a, u_b, g_malloc0_n(rows, sizeof *strip.below)};
    for (int i = 0; i < NODES; i++) {
        double p[NODES], sum = 0;
        legendre(node(i), NODES, p);
        c->u = NAN;
        move_to(c, (u_a + u_b) / 2 + (u_b - u_a) / 2 * node(i), 0, n);
        for (size_t row = 1; row < rows; row++) {
            int j = q + (int)row - 1;
            if (kv[j + 1] > kv[j])
                sum += seg_integrate(area_element, c, kv[j], kv[j + 1], 0, c->enough);
            for (int m = 0; m < NODES; m++)
                strip.below[row][m] += (2 * m + 1) / 2.0 * weight(i) * sum * p[m];
        }
    }
    return strip;
}

static bool is_resolved(const SegColumns *c, const Strip *strip)
{
    const double *top = strip->below[n_rows(c) - 1];
    return fabs(top[NODES - 1]) + fabs(top[NODES - 2]) <= RESOLVED * fabs(top[0]);
}

/* The strips of one span of u: halved until each is resolved. */
static GArray *make_strips(SegColumns *c, double u_a, double u_b)
{
    GArray *strips = g_array_new(FALSE, FALSE, sizeof(Strip));
    g_array_set_clear_func(strips, clear_strip);
    Strip whole = make_strip(c, u_a, u_b);
    g_array_append_val(strips, whole);
    for (guint i = 0; i < strips->len && strips->len < MAX_STRIPS;) {
        Strip *strip = &g_array_index(strips, Strip, i);
        if (is_resolved(c, strip)) {
            i++;
            continue;
        }
        double middle = (strip->u_a + strip->u_b) / 2;
        Strip left = make_strip(c, strip->u_a, middle), right = make_strip(c, middle, strip->u_b);
        clear_strip(strip);
        *strip = left;
        g_array_insert_val(strips, i + 1, right);
    }
    return strips;
}

/* The integral over [u_a, u_b] within the strip: P_m integrates to (P_{m+1} - P_{m-1}) / (2m + 1).
 */
static double over_strip(const Strip *strip, size_t row, double u_a, double u_b)
{
    double from[NODES + 1], to[NODES + 1], half = (strip->u_b - strip->u_a) / 2;
    double middle = (strip->u_a + strip->u_b) / 2;
    legendre((u_a - middle) / half, NODES + 1, from);
    legendre((u_b - middle) / half, NODES + 1, to);
    const double *coefficient = strip->below[row];
    double sum = coefficient[0] * (to[1] - from[1]);
    for (int m = 1; m < NODES; m++)
        sum += coefficient[m] * (to[m + 1] - to[m - 1] - from[m + 1] + from[m - 1]) / (2 * m + 1);
    return half * sum;
}

double seg_columns_below(SegColumns *c, double u_a, double u_b, int span_v)
{
    size_t row = (size_t)(span_v - c->surface->degree_v);
    if (row == 0 || u_a == u_b)
        return 0;
    if (u_a > u_b)
        return -seg_columns_below(c, u_b, u_a, span_v);
    const double *ku = c->tables.knots_u;
    int p = c->surface->degree_u, n = c->surface->n_u;
    u_a = within_reach(ku, p, n, u_a);
    u_b = within_reach(ku, p, n, u_b);
    if (!c->strips)
        c->strips = g_new0(GArray *, (size_t)n);
    double sum = 0;
    int first = seg_knot_span(ku, p, n, ku[p]), last = seg_knot_span(ku, p, n, ku[n]);
    for (int i = seg_knot_span(ku, p, n, u_a); i <= last && (ku[i] < u_b || i == first); i++) {
        if (ku[i + 1] <= ku[i])
            continue;
        if (!c->strips[i])
            c->strips[i] = make_strips(c, ku[i], ku[i + 1]);
        for (guint k = 0; k < c->strips[i]->len; k++) {
            const Strip *strip = &g_array_index(c->strips[i], Strip, k);
            bool opens = i == first && k == 0, ends = i == last && k + 1 == c->strips[i]->len;
            double a = opens ? u_a : fmax(u_a, strip->u_a), b = ends ? u_b : fmin(u_b, strip->u_b);
            if (a < b)
                sum += over_strip(strip, row, a, b);
        }
    }
    return sum;
}
