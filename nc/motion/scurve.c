/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/motion/scurve.h"

static double excess(double v1, double v2, double v, double d, NcRate r)
{
    return nc_ramp_mm(v1, v, r) + nc_ramp_mm(v, v2, r) - d;
}

double nc_ramp_peak(double v1, double v2, double d, double top, NcRate r)
{
    double low = fmax(v1, v2), q = nc_rate_q(r);
    if (!(top > low) || (isfinite(top) && excess(v1, v2, top, d, r) <= 0.0))
        return fmax(top, low);
    /* Both ramps reach the full acceleration: v² + qv = … */
    double c = 0.5 * (v1 * (q - v1) + v2 * (q - v2)) - r.a * d;
    double v = 0.5 * (sqrt(fmax(q * q - 4.0 * c, 0.0)) - q);
    if (v - fmin(v1, v2) >= q && v - low >= q)
        return fmin(fmax(v, low), top);
    /* Else a bracketed Newton: the way grows with the peak. */
    double high = fmin(top, nc_ramp_reach(fmin(v1, v2), d, r));
    v = 0.5 * (low + high);
    for (int i = 0; i < 60 && high - low > 1e-14 * high; i++) {
        double f = excess(v1, v2, v, d, r);
        if (f > 0.0)
            high = v;
        else
            low = v;
        double slope = 0.5 * (nc_ramp_s(v - v1, r) + nc_ramp_s(v - v2, r));
        slope += 0.5 * (v1 + v) * (v - v1 >= q ? 1.0 / r.a : sqrt(r.ij / (v - v1)));
        slope += 0.5 * (v2 + v) * (v - v2 >= q ? 1.0 / r.a : sqrt(r.ij / (v - v2)));
        double next = v - f / slope;
        if (fabs(f) <= 1e-15 * d || fabs(next - v) <= 1e-15 * v)
            return v;
        v = next > low && next < high ? next : 0.5 * (low + high);
    }
    return low;
}
