/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/stepover.h"

/* Sine of the rise across from which on passes run level along a wall. */
#define WALL 0.99

/* Where the tool hardly fits the valley its axis hardly moves; passes closer than this gain
 * nothing. */
#define SQUEEZE_LEAST 0.1

static double valley_radius(NcCutter tool, SegVec3 normal);
static double scallop_angle(double radius, double scallop, double rho, double side);
static double flat_step(NcCutter tool, double scallop, SegVec3 normal, double sine_across);

/* A scallop higher than this share of the ball would be no scallop. */
static double within(double scallop, double radius)
{
    return fmin(scallop, radius / 2);
}

/* Curvature so small that the circle is a plane to double precision of the step. */
static bool is_plane(double curvature, double radius)
{
    return fabs(curvature) * radius < 1e-9;
}

double nc_ball_contact_step_mm(double radius, double scallop, double curvature)
{
    double h = within(scallop, radius);
    if (is_plane(curvature, radius))
        return 2 * sqrt(h * (2 * radius - h));
    double rho = 1 / fabs(curvature), side = curvature > 0 ? -1 : 1;
    if (curvature > 0 && rho <= radius + h)
        return radius;
    return rho * scallop_angle(radius, h, rho, side);
}

double nc_ball_centre_step_mm(double radius, double scallop, double curvature)
{
    double h = within(scallop, radius);
    if (is_plane(curvature, radius))
        return 2 * sqrt(h * (2 * radius - h));
    double rho = 1 / fabs(curvature), side = curvature > 0 ? -1 : 1;
    if (curvature > 0 && rho <= radius + h)
        return radius;
    return (rho + side * radius) * scallop_angle(radius, h, rho, side);
}

double nc_plane_step_mm(NcCutter tool, double scallop, SegVec3 normal, const NcBend *bend,
                        SegVec3 across)
{
    double lean = seg_dot(normal, across);
    double seen = sqrt(fmax(1 - lean * lean, 0));
    double r = tool.corner_radius_mm, step = 0;
    SegVec3 q = seen > 0 ? seg_scale(seg_along(across, normal, -lean), 1 / seen) : normal;
    double curvature = nc_bend_along(bend, q);
    if (r >= tool.radius_mm)
        return seen * nc_ball_centre_step_mm(r, scallop, curvature);
    if (r > 0)
        step = seen * nc_ball_contact_step_mm(r, scallop, curvature);
    double tilt = hypot(lean, normal.z) > 0 ? fabs(lean) / hypot(lean, normal.z) : 1;
    step = fmax(step, flat_step(tool, scallop, normal, tilt));
    return step * fmax(1 - valley_radius(tool, normal) * fmax(curvature, 0), SQUEEZE_LEAST);
}

/* Steps of the axis in a valley are shorter than those of the contact by 1 - k·R, where R is the
 * larger radius of the torus at the contact: the one around the axis. */
static double valley_radius(NcCutter tool, SegVec3 normal)
{
    double sine = fmax(hypot(normal.x, normal.y), 1e-9);
    return (tool.radius_mm - tool.corner_radius_mm) / sine + tool.corner_radius_mm;
}

double nc_contact_step_mm(NcCutter tool, double scallop, double depth, SegVec3 normal,
                          double curvature, SegVec3 across)
{
    double r = tool.corner_radius_mm;
    double step = r > 0 ? nc_ball_contact_step_mm(r, scallop, curvature) : 0;
    if (fabs(across.z) > WALL)
        step = fmax(step, fmin(depth, scallop / fmax(fabs(normal.z), 1e-9)));
    /* The tool's axis stands upright, so the slope across is that of the tangent. */
    return fmax(step, flat_step(tool, scallop, normal, fabs(across.z)));
}

/* φ of the header; side is 1 on convex circles, -1 in concave ones. */
static double scallop_angle(double radius, double scallop, double rho, double side)
{
    double sine2 =
        scallop * (2 * radius - scallop) / (4 * (rho + side * radius) * (rho + side * scallop));
    return 4 * asin(sqrt(fmin(fmax(sine2, 0), 0.5)));
}

static double flat_step(NcCutter tool, double scallop, SegVec3 normal, double sine_across)
{
    double flat = tool.radius_mm - tool.corner_radius_mm;
    if (flat <= 0)
        return 0;
    double sine = hypot(normal.x, normal.y);
    double step = NC_FLAT_STEP * 2 * flat;
    if (sine_across * step > scallop)
        step = scallop / sine_across;
    /* On the way up the rim beside the middle lags behind it by x, and the slope falls by x·sine.
     */
    double x = sine * flat > scallop ? scallop / sine : flat;
    return fmin(step, 2 * sqrt(x * (2 * flat - x)));
}
