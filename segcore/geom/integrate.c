/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/geom/integrate.h"

#include <math.h>

enum { MAX_DEPTH = 24, MAX_HALVINGS = 100 };

/* Piessens et al., QUADPACK, QK15: nodes on one side, centre last; Gauss's are the odd ones. */
static const double NODE[7] = {
    0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
    0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
    0.586087235467691130294144691693013, 0.405845151377397166906606412076961,
    0.207784955007898467600689403773245};
static const double KRONROD[8] = {
    0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
    0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
    0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
    0.204432940075298892414161999234649, 0.209482141084727828012999174891714};
static const double GAUSS[4] = {
    0.129484966168869693270611432679082, 0.279705391489276667901467771423780,
    0.381830050505118944950369775488975, 0.417959183673469387755102040816327};

typedef struct {
    double integral, error, magnitude; /* the last: the integral of |f| */
} Estimate;

/* Kronrod's rule is of about twice the degree of Gauss's in it, so its error is about the square of
 * the difference d; d^1.5 (all relative to |f|) is on the safe side of that, as in QUADPACK. */
static Estimate judge(double kronrod, double gauss, double magnitude)
{
    double difference = fabs(kronrod - gauss);
    double relative = magnitude > 0 ? fmin(difference / magnitude, 1) : 1;
    return (Estimate){kronrod, difference * sqrt(relative), magnitude};
}

static Estimate estimate(SegIntegrand f, void *context, double a, double b)
{
    double middle = (a + b) / 2, half = (b - a) / 2;
    double centre = f(context, middle);
    double kronrod = KRONROD[7] * centre, gauss = GAUSS[3] * centre;
    double magnitude = KRONROD[7] * fabs(centre);
    for (int i = 0; i < 7; i++) {
        double left = f(context, middle - half * NODE[i]);
        double right = f(context, middle + half * NODE[i]);
        kronrod += KRONROD[i] * (left + right);
        magnitude += KRONROD[i] * (fabs(left) + fabs(right));
        if (i % 2 == 1)
            gauss += GAUSS[i / 2] * (left + right);
    }
    return judge(half * kronrod, half * gauss, fabs(half) * magnitude);
}

typedef struct {
    SegIntegrand f;
    void *context;
    double enough;
    int halvings_left;
} Refinement;

static double refine(Refinement *r, double a, double b, const Estimate *whole, int depth)
{
    if (!(whole->error > r->enough) || depth == MAX_DEPTH || r->halvings_left == 0)
        return whole->integral;
    r->halvings_left--;
    double middle = (a + b) / 2;
    Estimate left = estimate(r->f, r->context, a, middle);
    Estimate right = estimate(r->f, r->context, middle, b);
    return refine(r, a, middle, &left, depth + 1) + refine(r, middle, b, &right, depth + 1);
}

/* The same by Gauss's 3 points and Kronrod's 7. */
static Estimate quick_estimate(SegIntegrand f, void *context, double a, double b)
{
    static const double at[3] = {0.960491268708020283423507092629080,
                                 0.774596669241483377035853079956480,
                                 0.434243749346802558002071502844628};
    static const double weight[4] = {
        0.104656226026467265193823857192073, 0.268488089868333440728569280666710,
        0.401397414775962222905051818618432, 0.450916538658474142345110087045571};
    double middle = (a + b) / 2, half = (b - a) / 2;
    double centre = f(context, middle);
    double kronrod = weight[3] * centre, gauss = 8 * centre / 9;
    double magnitude = weight[3] * fabs(centre);
    for (int i = 0; i < 3; i++) {
        double left = f(context, middle - half * at[i]), right = f(context, middle + half * at[i]);
        kronrod += weight[i] * (left + right);
        magnitude += weight[i] * (fabs(left) + fabs(right));
        if (i == 1)
            gauss += 5 * (left + right) / 9;
    }
    return judge(half * kronrod, half * gauss, fabs(half) * magnitude);
}

double seg_integrate(SegIntegrand f, void *context, double a, double b, double relative,
                     double least)
{
    Estimate quick = quick_estimate(f, context, a, b);
    if (!(quick.error > fmax(relative * quick.magnitude, least)))
        return quick.integral;
    Estimate whole = estimate(f, context, a, b);
    Refinement r = {f, context, fmax(relative * whole.magnitude, least), MAX_HALVINGS};
    return refine(&r, a, b, &whole, 0);
}
