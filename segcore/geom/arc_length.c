/* SPDX-License-Identifier: Apache-2.0 */
/* Arc length of B-spline curves, and the parameter at a given one (P0 §2.2). */
#include "segcore/geom/bspline.h"
#include "segcore/geom/curve.h"
#include "segcore/geom/integrate.h"

static const double RELATIVE_ERROR = 1e-10;    /* of what is promised */
static const double INTEGRATION_ERROR = 1e-12; /* of one span's integral */

typedef struct {
    const double *reals;
    const SegCurve *curve;
} Speed;

static double speed_at(void *context, double t)
{
    const Speed *s = context;
    SegVec3 c[3];
    seg_curve_derivatives(s->reals, s->curve, t, 1, c);
    return seg_norm(c[1]);
}

/* Over a part of one span. */
static double smooth_length(const SegPart *part, const SegCurve *curve, double a, double b)
{
    if (curve->degree == 1 && !curve->rational)
        return seg_distance(seg_curve_evaluate(part, curve, a, NULL),
                            seg_curve_evaluate(part, curve, b, NULL));
    Speed speed = {part->reals, curve};
    return seg_integrate(speed_at, &speed, a, b, INTEGRATION_ERROR, 0);
}

double seg_curve_length_mm(const SegPart *part, const SegCurve *curve, double a, double b)
{
    if (curve->n_poles == 0 || a == b)
        return 0;
    if (a > b)
        return seg_curve_length_mm(part, curve, b, a);
    const double *knots = seg_curve_tables(part->reals, curve).knots;
    double length = 0;
    int p = curve->degree, n = curve->n_poles;
    for (int i = seg_knot_span(knots, p, n, a); i < n && knots[i] < b; i++) {
        double from = i == p ? a : fmax(a, knots[i]); /* outside the domain it stands still */
        double to = i == n - 1 ? b : fmin(b, knots[i + 1]);
        from = fmax(from, knots[p]);
        to = fmin(to, knots[n]);
        if (to > from)
            length += smooth_length(part, curve, from, to);
    }
    return length;
}

double seg_curve_at_length(const SegPart *part, const SegCurve *curve, double a, double b,
                           double length_mm, double total_mm)
{
    const int max_steps = 60;
    double low = a, high = b;
    double u = a + length_mm / total_mm * fabs(b - a);
    double missing = length_mm - seg_curve_length_mm(part, curve, a, u); /* F(u) */
    for (int i = 0; i < max_steps && fabs(missing) > RELATIVE_ERROR * total_mm; i++) {
        if (missing > 0)
            low = u;
        else
            high = u;
        SegVec3 derivative;
        seg_curve_evaluate(part, curve, u, &derivative);
        double next = u + missing / seg_norm(derivative); /* u - F/F', F' = -|C'| */
        if (!(next > low && next < high))
            next = (low + high) / 2;
        double moved = seg_curve_length_mm(part, curve, u, next);
        missing -= next > u ? moved : -moved;
        u = next;
    }
    return u;
}
