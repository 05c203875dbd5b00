/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/terrain.h"

/*
 * The height to bound is F(q,t) = plane(q) - h(|q - c(t)|) - z(t) over the box and the span. F is
 * jointly concave: the plane and z are linear, and h of a norm of an affine map is convex. So its
 * tangent at any point q1 of the box and the middle of the span lies above F everywhere, and the
 * maximum of that linear function over box and span is found coordinate by coordinate. The bound
 * is tight when q1 is near the maximum: q1 is the cutter's contact with the plane, moved into the
 * box. Near the rim, where h rises without limit, the profile is continued by its tangent at
 * RIM·r, which is below it.
 */
static const double RIM = 0.98;

static inline double clamp(double v, double lo, double hi)
{
    v = v < lo ? lo : v;
    return v > hi ? hi : v;
}

/* Greatest of rate·(v - at) for v in [lo, hi]. */
static inline double rise(double rate, double at, double lo, double hi)
{
    double to_lo = rate * (lo - at), to_hi = rate * (hi - at);
    return to_lo > to_hi ? to_lo : to_hi;
}

void nc_node_bounds(const NcNode *node, NcCutter cutter, const NcMoveSpan *span, double slack_mm,
                    double bounds[NC_WIDTH])
{
    const double r = cutter.corner_radius_mm, a = cutter.radius_mm - r;
    const double x = span->middle.x, y = span->middle.y, z = span->middle.z;
    const double half_x = span->half.x, half_y = span->half.y, half_z = span->half.z;
    const double reach =
        (cutter.radius_mm + sqrt(half_x * half_x + half_y * half_y)) * (1 + 1e-12) + slack_mm;
    const double rim = RIM * r;
#pragma omp simd
    for (int i = 0; i < NC_WIDTH; i++) {
        double lo_x = node->lo_x[i] - x, hi_x = node->hi_x[i] - x;
        double lo_y = node->lo_y[i] - y, hi_y = node->hi_y[i] - y;
        double near_x = clamp(0, lo_x, hi_x), near_y = clamp(0, lo_y, hi_y);
        bool reached = near_x * near_x + near_y * near_y <= reach * reach;

        double contact = a + r * node->slope_sin[i];
        double q_x = clamp(contact * node->up_x[i], lo_x, hi_x);
        double q_y = clamp(contact * node->up_y[i], lo_y, hi_y);
        double d = sqrt(q_x * q_x + q_y * q_y);
        double w = clamp(d - a, 0, rim);
        double root = sqrt(r * r - w * w);
        double rate = w / ((root + 1e-300) * (d + 1e-300)); /* h'(d) / d */
        double over = d - a - rim > 0 ? d - a - rim : 0;
        double h = (r - root) + rate * d * over;

        double g_x = node->slope[i] * node->up_x[i], g_y = node->slope[i] * node->up_y[i];
        double plane = node->z[i] + g_x * (q_x - lo_x) + g_y * (q_y - lo_y);
        double along = fabs(rate * (q_x * half_x + q_y * half_y) - half_z);
        double bound = plane - h + rise(g_x - rate * q_x, q_x, lo_x, hi_x) +
                       rise(g_y - rate * q_y, q_y, lo_y, hi_y) + along + slack_mm;
        double top = node->top[i] + fabs(half_z);
        bound = (bound < top ? bound : top) - z;
        bounds[i] = reached ? bound : -INFINITY;
    }
}
