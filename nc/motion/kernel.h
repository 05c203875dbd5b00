/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Blends. A path with a jump Δd of its slope at s = 0 becomes smooth when h·G(s/h)·Δd is added to
 * it: G is even, 0 outside of -1 … 1, and G'' the kernel that the jump is spread over: a box
 * (the blend is a parabola), or a triangle, so that the second derivative is continuous. What is
 * left then is a jump Δc of the second derivative where a line meets an arc; h²·W(s/h)·Δc takes
 * it away: W is odd, so that nothing moves outside.
 *
 * u = 1 - |x|; G0, G1, G2 are G and its derivatives, less the jump itself.
 */
#ifndef NC_MOTION_KERNEL_H
#define NC_MOTION_KERNEL_H

#include <stdbool.h>

typedef struct {
    double value, slope, bend;
} NcKernel;

/* How far the corner itself moves, over h·|Δd|; and the most that W moves anything. */
#define NC_BOX_REACH 0.25
#define NC_TRIANGLE_REACH (1.0 / 6.0)
#define NC_BEND_REACH 0.0088

static inline NcKernel nc_kernel_corner(bool smooth, double x)
{
    double sign = x < 0.0 ? 1.0 : -1.0, u = 1.0 - (x < 0.0 ? -x : x);
    if (u <= 0.0)
        return (NcKernel){0.0, 0.0, 0.0};
    return smooth ? (NcKernel){u * u * u / 6.0, sign * u * u / 2.0, u}
                  : (NcKernel){u * u / 4.0, sign * u / 2.0, 0.5};
}

static inline NcKernel nc_kernel_bend(double x)
{
    double sign = x < 0.0 ? -1.0 : 1.0, u = 1.0 - (x < 0.0 ? -x : x);
    if (u <= 0.0)
        return (NcKernel){0.0, 0.0, 0.0};
    return (NcKernel){sign * u * u * u * (1.0 - u) / 12.0, u * u * (u / 3.0 - 0.25),
                      sign * u * (0.5 - u)};
}

#endif
