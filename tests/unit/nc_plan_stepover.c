/* SPDX-License-Identifier: Apache-2.0 */
/* Step-overs against scallops measured in cross-sections that are drawn, not computed by the same
 * formula: circles over a plane or a circle. */
#include "nc/toolpath/stepover.h"
#include "tests/lib/test.h"

/* Height of the scallop midway between two balls whose centres are `apart` radians apart around a
 * circle of radius rho; outside (side 1) or inside (side -1) of it. */
static double scallop_on_circle(double radius, double rho, double side, double apart)
{
    double centre = rho + side * radius;
    double x = centre * sin(apart / 2), y = centre * cos(apart / 2);
    /* The ball meets the line of symmetry at the end that lies towards the surface. */
    double meets = y - side * sqrt(radius * radius - x * x);
    return side * (meets - rho);
}

static void plane(void)
{
    for (double radius = 0.5; radius <= 10; radius *= 1.7)
        for (double h = 0.001; h < 0.2; h *= 3) {
            double step = nc_ball_contact_step_mm(radius, h, 0);
            double scallop = radius - sqrt(radius * radius - step * step / 4);
            test_near(scallop, fmin(h, radius / 2), 1e-12, 1e-9);
            test_near(nc_ball_centre_step_mm(radius, h, 0), step, 0, 1e-12);
        }
}

static void circles(void)
{
    for (double side = -1; side <= 1; side += 2)
        for (double radius = 0.5; radius <= 10; radius *= 1.7)
            for (double ratio = 1.2; ratio < 1e6; ratio *= 4) {
                double rho = radius * ratio, h = 0.01;
                double contact = nc_ball_contact_step_mm(radius, h, -side / rho);
                double centre = nc_ball_centre_step_mm(radius, h, -side / rho);
                test_near(scallop_on_circle(radius, rho, side, contact / rho), h, 1e-9 * rho, 1e-6);
                test_near(centre / (rho + side * radius), contact / rho, 0, 1e-12);
                double known = sqrt(8 * h * radius * rho / (rho + side * radius));
                test_near(contact, known, 0, 0.05);
            }
}

static void groove(void)
{
    double step = nc_ball_centre_step_mm(3, 0.01, 1 / 3.0);
    g_assert_true(isfinite(step));
    g_assert_cmpfloat(step, >, 0);
}

/* A ball over ground that leans across the planes: the planes come closer by the cosine. */
static void leaning(void)
{
    NcBend flat = {0};
    NcCutter ball = {4, 4};
    double level = nc_ball_contact_step_mm(4, 0.01, 0);
    for (double lean = 0; lean < 1.5; lean += 0.1) {
        SegVec3 normal = {0, sin(lean), cos(lean)};
        test_near(nc_plane_step_mm(ball, 0.01, normal, &flat, seg_vec3(0, 1, 0)), level * cos(lean),
                  1e-12, 1e-9);
        test_near(nc_plane_step_mm(ball, 0.01, normal, &flat, seg_vec3(1, 0, 0)), level, 0, 1e-9);
    }
}

/* Lower envelope of two copies of the tool's cross-section on a line that rises by `slope`, the
 * second copy `step` further along x: the highest gap at right angles to the line between the two
 * contacts. */
static double scallop_of_profile(NcCutter tool, double slope, double step)
{
    enum { N = 4000 };
    double touch = -INFINITY, at = 0;
    for (int i = -N; i <= N; i++) {
        double x = tool.radius_mm * i / N;
        double down = slope * x - nc_cutter_height_mm(tool, x);
        if (down > touch) {
            touch = down;
            at = x;
        }
    }
    double worst = 0;
    for (int i = 0; i <= N; i++) {
        double x = at + step * i / N;
        double first = nc_cutter_height_mm(tool, x) + touch;
        double second = nc_cutter_height_mm(tool, x - step) + slope * step + touch;
        worst = fmax(worst, fmin(first, second) - slope * x);
    }
    return worst / hypot(1, slope);
}

static void flat_and_bull(void)
{
    NcBend plane_bend = {0};
    static const NcCutter tools[] = {{3, 0}, {3, 0.5}, {3, 1}, {8, 2}};
    for (size_t k = 0; k < G_N_ELEMENTS(tools); k++)
        for (double lean = 0; lean < 1.3; lean += 0.02) {
            SegVec3 normal = {0, -sin(lean), cos(lean)};
            double step = nc_plane_step_mm(tools[k], 0.01, normal, &plane_bend, seg_vec3(0, 1, 0));
            g_assert_cmpfloat(step, >, 0);
            g_assert_cmpfloat(step, <=, 2 * tools[k].radius_mm);
            g_assert_cmpfloat(scallop_of_profile(tools[k], tan(lean), step), <=, 0.01 * 1.02);
        }
}

/* The flat's edge seen along its way up a slope is an ellipse. */
static void flat_uphill(void)
{
    NcBend plane_bend = {0};
    NcCutter flat = {3, 0};
    for (double climb = 0.02; climb < 1.3; climb += 0.1) {
        SegVec3 normal = {-sin(climb), 0, cos(climb)};
        double step = nc_plane_step_mm(flat, 0.01, normal, &plane_bend, seg_vec3(0, 1, 0));
        double y = fmin(step / 2, 3);
        /* The rim at ±y lags behind the middle by x; that far the slope has fallen. */
        double x = 3 - sqrt(9 - y * y);
        g_assert_cmpfloat(x * sin(climb), <=, 0.01 * 1.02);
    }
}

/* Steps down a wall: no deeper than the tool may cut, and no cusp where the wall leans. */
static void wall(void)
{
    NcCutter flat = {5, 0};
    SegVec3 up = {0, 0, 1};
    test_near(nc_contact_step_mm(flat, 0.01, 12, seg_vec3(1, 0, 0), 0, up), 12, 0, 0);
    double lean = 0.002;
    SegVec3 normal = {cos(lean), 0, sin(lean)}, along = {-sin(lean), 0, cos(lean)};
    double step = nc_contact_step_mm(flat, 0.01, 12, normal, 0, along);
    test_near(step * sin(lean), 0.01, 0, 1e-6);
}

static void add(void)
{
    g_test_add_func("/nc/plan/stepover/plane", plane);
    g_test_add_func("/nc/plan/stepover/circles", circles);
    g_test_add_func("/nc/plan/stepover/groove", groove);
    g_test_add_func("/nc/plan/stepover/leaning", leaning);
    g_test_add_func("/nc/plan/stepover/flat-and-bull", flat_and_bull);
    g_test_add_func("/nc/plan/stepover/flat-uphill", flat_uphill);
    g_test_add_func("/nc/plan/stepover/wall", wall);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
