/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Ramps of speed with limited acceleration and jerk, and acceleration 0 at both ends.
 *
 * With A and J, the ramp between v1 and v2 takes T = Δv/A + A/J where Δv >= A²/J, else
 * T = 2·√(Δv/J), and being symmetric covers (v1 + v2)/2·T. `q` is A²/J, what a full build-up and
 * release of acceleration gains. Without a limit of jerk, 1/J = 0: the trapezoid.
 */
#ifndef NC_MOTION_SCURVE_H
#define NC_MOTION_SCURVE_H

#include <math.h>
#include <stdbool.h>

typedef struct {
    double a;  /* mm/s² */
    double ij; /* 1 / jerk, s³/mm */
} NcRate;

static inline double nc_rate_q(NcRate r)
{
    return r.a * r.a * r.ij;
}

static inline NcRate nc_rate_least(NcRate a, NcRate b)
{
    return (NcRate){fmin(a.a, b.a), fmax(a.ij, b.ij)};
}

static inline double nc_ramp_s(double dv, NcRate r)
{
    return dv >= nc_rate_q(r) ? dv / r.a + r.a * r.ij : 2.0 * sqrt(dv * r.ij);
}

static inline double nc_ramp_mm(double v1, double v2, NcRate r)
{
    return 0.5 * (v1 + v2) * nc_ramp_s(fabs(v2 - v1), r);
}

/* Distance after which a ramp that goes on accelerating passes v. */
static inline double nc_rise_mm(double from, double v, NcRate r)
{
    double dv = v - from, q = nc_rate_q(r);
    if (dv <= 0.0)
        return 0.0;
    if (dv <= 0.5 * q)
        return sqrt(2.0 * dv * r.ij) * (from + dv / 3.0);
    double v1 = from + 0.5 * q;
    return r.a * r.ij * (from + q / 6.0) + (v * v - v1 * v1) / (2.0 * r.a);
}

/* The speed to which a ramp from u leads within d. */
static inline double nc_ramp_reach(double u, double d, NcRate r)
{
    double q = nc_rate_q(r), k = q - 2.0 * u;
    double v = 0.5 * (sqrt(k * k + 8.0 * r.a * d) - q);
    if (v - u >= q)
        return v;
    /* y³ + 2u/J·y = d/J for y = (v - u)·T/2 …: convex, so Newton falls to the root from above. */
    double p = 2.0 * u * r.ij, c = d * r.ij;
    double y = cbrt(c);
    if (p * y > c)
        y = c / p;
    for (int i = 0; i < 40; i++) {
        double step = (y * (y * y + p) - c) / (3.0 * y * y + p);
        if (!(step > 1e-15 * y))
            break;
        y -= step;
    }
    return u + y * y / r.ij;
}

/* The greatest speed, at most `top`, on the way of length d from v1 to v2; at least the larger of
 * them. */
double nc_ramp_peak(double v1, double v2, double d, double top, NcRate r);

#endif
