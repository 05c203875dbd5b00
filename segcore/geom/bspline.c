/* SPDX-License-Identifier: Apache-2.0 */
/* Evaluation of B-spline curves and surfaces. */
#include "segcore/geom/bspline.h"

/* A point with its weight: rational forms are evaluated in these. */
typedef struct {
    double x, y, z, w;
} Homogeneous;

static inline void accumulate(Homogeneous *sum, double factor, const Homogeneous *h)
{
    sum->x += factor * h->x;
    sum->y += factor * h->y;
    sum->z += factor * h->z;
    sum->w += factor * h->w;
}

static inline SegVec3 numerator(const Homogeneous *h)
{
    return seg_vec3(h->x, h->y, h->z);
}

static double clamp(double t, double a, double b)
{
    return t >= a ? fmin(t, b) : a; /* NaN goes to a */
}

SegSurfacePoint seg_face_evaluate(const SegPart *part, int32_t face, double u, double v)
{
    const SegSurface *surface = &part->faces[face].surface;
    if (surface->n_u == 0)
        return (SegSurfacePoint){0};
    return seg_surface_evaluate(part->reals, surface, u, v, 2);
}

SegVec3 seg_curve_evaluate(const SegPart *part, const SegCurve *curve, double t,
                           SegVec3 *derivative)
{
    SegVec3 c[3];
    seg_curve_derivatives(part->reals, curve, t, derivative ? 1 : 0, c);
    if (derivative)
        *derivative = c[1];
    return c[0];
}

void seg_face_domain(const SegPart *part, int32_t face, double *u0, double *u1, double *v0,
                     double *v1)
{
    const SegSurface *s = &part->faces[face].surface;
    *u0 = *u1 = *v0 = *v1 = 0;
    if (s->n_u == 0)
        return;
    SegSurfaceTables t = seg_surface_tables(part->reals, s);
    *u0 = t.knots_u[s->degree_u];
    *u1 = t.knots_u[s->n_u];
    *v0 = t.knots_v[s->degree_v];
    *v1 = t.knots_v[s->n_v];
}

/* ------------------------------------------------------------------ basis functions */

int seg_knot_span(const double *knots, int degree, int n, double t)
{
    int low = degree, high = n; /* knots[low] <= t, and t < knots[high] or high is n */
    while (high - low > 1) {
        int middle = low + (high - low) / 2;
        if (knots[middle] <= t)
            low = middle;
        else
            high = middle;
    }
    while (low > degree && knots[low] >= knots[low + 1])
        low--;
    while (knots[low] >= knots[low + 1])
        low++;
    return low;
}

/* Raises the functions of degree p - 1 in `from` to those of degree p (Cox and de Boor). */
static void raise_degree(const double *knots, int span, int p, double t, const double *from,
                         double *to)
{
    double carried = 0;
    for (int j = 0; j < p; j++) {
        double right = knots[span + j + 1], left = knots[span + j + 1 - p];
        double share = from[j] / (right - left);
        to[j] = carried + (right - t) * share;
        carried = (t - left) * share;
    }
    to[p] = carried;
}

/* Derivatives of the functions of degree p from `from`, those of degree p - 1 (or from any
 * derivative of those): NURBS Book eq. 2.7. */
static void differentiate(const double *knots, int span, int p, const double *from, double *to)
{
    double carried = 0;
    for (int j = 0; j < p; j++) {
        double share = p * from[j] / (knots[span + j + 1] - knots[span + j + 1 - p]);
        to[j] = carried - share;
        carried = share;
    }
    to[p] = carried;
}

void seg_basis(const double *knots, int degree, int span, double t, int order,
               double basis[3][SEG_MAX_DEGREE + 1])
{
    double buffer[2][SEG_MAX_DEGREE + 1], below[SEG_MAX_DEGREE + 1];
    int now = 0;
    buffer[0][0] = 1;
    for (int p = 1; p <= degree; p++, now ^= 1) {
        if (order >= 2 && p == degree - 1)
            differentiate(knots, span, p, buffer[now], below);
        if (order >= 1 && p == degree)
            differentiate(knots, span, p, buffer[now], basis[1]);
        raise_degree(knots, span, p, t, buffer[now], buffer[now ^ 1]);
    }
    for (int j = 0; j <= degree; j++)
        basis[0][j] = buffer[now][j];
    if (order >= 2 && degree >= 2)
        differentiate(knots, span, degree, below, basis[2]);
    else if (order >= 2)
        basis[2][0] = basis[2][1] = 0;
}

/* ------------------------------------------------------------------ curves */

void seg_curve_derivatives(const double *reals, const SegCurve *curve, double t, int order,
                           SegVec3 out[3])
{
    SegCurveTables c = seg_curve_tables(reals, curve);
    int p = curve->degree, n = curve->n_poles, dim = curve->dim;
    t = clamp(t, c.knots[p], c.knots[n]);
    int span = seg_knot_span(c.knots, p, n, t);
    double basis[3][SEG_MAX_DEGREE + 1];
    seg_basis(c.knots, p, span, t, order, basis);

    Homogeneous h[3] = {0};
    for (int j = 0; j <= p; j++) {
        int i = span - p + j;
        const double *pole = c.poles + (ptrdiff_t)i * dim;
        double w = c.weights ? c.weights[i] : 1;
        Homogeneous q = {w * pole[0], w * pole[1], dim == 3 ? w * pole[2] : 0, w};
        for (int k = 0; k <= order; k++)
            accumulate(&h[k], basis[k][j], &q);
    }
    out[0] = numerator(&h[0]);
    for (int k = 1; k <= order; k++)
        out[k] = numerator(&h[k]);
    if (!c.weights)
        return;
    double w = h[0].w;
    out[0] = seg_scale(out[0], 1 / w);
    if (order >= 1)
        out[1] = seg_scale(seg_along(out[1], out[0], -h[1].w), 1 / w);
    if (order >= 2)
        out[2] =
            seg_scale(seg_along(seg_along(out[2], out[1], -2 * h[1].w), out[0], -h[2].w), 1 / w);
}

/* ------------------------------------------------------------------ surfaces */

/* Derivatives of the homogeneous surface: position, u, v, uu, uv, vv. */
enum { S, SU, SV, SUU, SUV, SVV };

static void sum_poles(const SegSurface *s, const SegSurfaceTables *t, int span_u, int span_v,
                      int order, const double bu[3][SEG_MAX_DEGREE + 1],
                      const double bv[3][SEG_MAX_DEGREE + 1], Homogeneous h[6])
{
    int p = s->degree_u, q = s->degree_v;
    for (int i = 0; i <= p; i++) {
        ptrdiff_t row = (ptrdiff_t)(span_u - p + i) * s->n_v + (span_v - q);
        const double *pole = t->poles + 3 * row;
        Homogeneous r[3] = {0};
        for (int j = 0; j <= q; j++, pole += 3) {
            double w = t->weights ? t->weights[row + j] : 1;
            Homogeneous point = {w * pole[0], w * pole[1], w * pole[2], w};
            for (int k = 0; k <= order; k++)
                accumulate(&r[k], bv[k][j], &point);
        }
        accumulate(&h[S], bu[0][i], &r[0]);
        if (order < 1)
            continue;
        accumulate(&h[SU], bu[1][i], &r[0]);
        accumulate(&h[SV], bu[0][i], &r[1]);
        if (order < 2)
            continue;
        accumulate(&h[SUU], bu[2][i], &r[0]);
        accumulate(&h[SUV], bu[1][i], &r[1]);
        accumulate(&h[SVV], bu[0][i], &r[2]);
    }
}

/* A4.4 written out for two orders: A = wS, so S_u = (A_u - w_u S)/w and so on. */
static void divide(const Homogeneous h[6], int order, SegSurfacePoint *out)
{
    double r = 1 / h[S].w, wu = h[SU].w, wv = h[SV].w;
    out->p = seg_scale(out->p, r);
    if (order < 1)
        return;
    out->pu = seg_scale(seg_along(out->pu, out->p, -wu), r);
    out->pv = seg_scale(seg_along(out->pv, out->p, -wv), r);
    if (order < 2)
        return;
    SegVec3 uu = seg_along(seg_along(out->puu, out->pu, -2 * wu), out->p, -h[SUU].w);
    SegVec3 uv = seg_along(seg_along(out->puv, out->pu, -wv), out->pv, -wu);
    SegVec3 vv = seg_along(seg_along(out->pvv, out->pv, -2 * wv), out->p, -h[SVV].w);
    out->puu = seg_scale(uu, r);
    out->puv = seg_scale(seg_along(uv, out->p, -h[SUV].w), r);
    out->pvv = seg_scale(vv, r);
}

SegSurfacePoint seg_surface_evaluate(const double *reals, const SegSurface *s, double u, double v,
                                     int order)
{
    SegSurfaceTables t = seg_surface_tables(reals, s);
    u = clamp(u, t.knots_u[s->degree_u], t.knots_u[s->n_u]);
    v = clamp(v, t.knots_v[s->degree_v], t.knots_v[s->n_v]);
    int span_u = seg_knot_span(t.knots_u, s->degree_u, s->n_u, u);
    int span_v = seg_knot_span(t.knots_v, s->degree_v, s->n_v, v);
    double bu[3][SEG_MAX_DEGREE + 1], bv[3][SEG_MAX_DEGREE + 1];
    seg_basis(t.knots_u, s->degree_u, span_u, u, order, bu);
    seg_basis(t.knots_v, s->degree_v, span_v, v, order, bv);

    Homogeneous h[6] = {0};
    sum_poles(s, &t, span_u, span_v, order, bu, bv, h);
    SegSurfacePoint out = {numerator(&h[S]),   numerator(&h[SU]),  numerator(&h[SV]),
                           numerator(&h[SUU]), numerator(&h[SUV]), numerator(&h[SVV])};
    if (t.weights)
        divide(h, order, &out);
    return out;
}
