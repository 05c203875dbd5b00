/* SPDX-License-Identifier: Apache-2.0 */
/* The swept volume of every kind of tool, cut by lines: against its definition, on which nothing of
 * the kernel rests, and against closed forms. */
#include "nc/stock/sweep_axis.h"
#include "tests/lib/stock_case.h"
#include "tests/lib/test.h"

enum { N_KINDS = 6 }; /* the first tools of the table */

/* How far p is outside the tool, across its axis, when the tip is at a + s·(b - a). */
static double beyond_radius(const CfgTool *tool, SegVec3 a, SegVec3 b, double s, SegVec3 p)
{
    SegVec3 local = seg_sub(p, seg_lerp(a, b, s));
    double top = tool->flute_length_mm;
    return hypot(local.x, local.y) - test_drawn_radius(tool, fmin(fmax(local.z, 0), top));
}

/* The definition: p is in the sweep if it is in the tool at some s. Where p is as high as the tool
 * is, the excess over the radius is convex in s, so thirds find its least value. */
static bool defined_inside(const CfgTool *tool, SegVec3 a, SegVec3 b, SegVec3 p)
{
    double low = 0, high = 1, rise = b.z - a.z, z = p.z - a.z, top = tool->flute_length_mm;
    if (rise != 0) {
        double s[2] = {z / rise, (z - top) / rise};
        low = fmax(low, fmin(s[0], s[1]));
        high = fmin(high, fmax(s[0], s[1]));
    } else if (z < 0 || z > top) {
        return false;
    }
    if (low > high)
        return false;
    for (int i = 0; i < 200; i++) {
        double third = (high - low) / 3, s[2] = {low + third, high - third};
        if (beyond_radius(tool, a, b, s[0], p) <= beyond_radius(tool, a, b, s[1], p))
            high = s[1];
        else
            low = s[0];
    }
    return beyond_radius(tool, a, b, low, p) <= 0 || beyond_radius(tool, a, b, high, p) <= 0;
}

static SegVec3 random_vector(GRand *random, double size)
{
    return seg_vec3(g_rand_double_range(random, -size, size),
                    g_rand_double_range(random, -size, size),
                    g_rand_double_range(random, -size, size));
}

/* Level, vertical, none, short and long moves. */
static SegVec3 random_move(GRand *random)
{
    const double sizes_mm[] = {0.1, 20, 1500};
    SegVec3 d = random_vector(random, sizes_mm[g_rand_int_range(random, 0, 3)]);
    switch (g_rand_int_range(random, 0, 7)) {
    case 0:
        d.z = 0;
        break;
    case 1:
        d.x = d.y = 0;
        break;
    case 2:
        d = seg_vec3(0, 0, 0);
        break;
    case 3:
        d.y = d.z = 0;
        break;
    default:
        break;
    }
    return d;
}

/* Any direction, along the axes, along the move, and nearly level. */
static SegVec3 random_direction(GRand *random, SegVec3 move)
{
    SegVec3 w = seg_unit(random_vector(random, 1));
    switch (g_rand_int_range(random, 0, 7)) {
    case 0:
        return seg_vec3(1, 0, 0);
    case 1:
        return seg_vec3(0, -1, 0);
    case 2:
        return seg_vec3(0, 0, 1);
    case 3:
        return seg_norm(move) > 0 ? seg_unit(move) : w;
    case 4:
        w.z *= 1e-9;
        return seg_unit(w);
    default:
        return w;
    }
}

/* A point of the tool in the sweep. */
static SegVec3 random_inside(GRand *random, const CfgTool *tool, SegVec3 a, SegVec3 b)
{
    double z = g_rand_double(random) * tool->flute_length_mm;
    double angle = g_rand_double_range(random, 0, 2 * G_PI), r = test_drawn_radius(tool, z);
    SegVec3 tip = seg_lerp(a, b, g_rand_double(random));
    return seg_add(tip, seg_vec3(r * cos(angle), r * sin(angle), z));
}

/* An end lies on the surface: a little towards the middle is inside, a little away is not; and all
 * of the sweep lies behind the plane of its normal. */
static bool check_end(GRand *random, const CfgTool *tool, SegVec3 a, SegVec3 b, SegVec3 end,
                      SegVec3 normal)
{
    SegVec3 middle = seg_lerp(a, b, 0.5);
    middle.z += 0.6 * tool->flute_length_mm;
    SegVec3 inwards = seg_unit(seg_sub(middle, end));
    /* The error is counted square to the surface. */
    double step = 2e-9 / fmax(-seg_dot(inwards, normal), 1e-3);
    bool good = defined_inside(tool, a, b, seg_along(end, inwards, step)) &&
                !defined_inside(tool, a, b, seg_along(end, inwards, -step)) &&
                fabs(seg_norm(normal) - 1) < 1e-12;
    for (int i = 0; i < 20 && good; i++) {
        SegVec3 p = random_inside(random, tool, a, b);
        good = seg_dot(seg_sub(p, end), normal) < 1e-6 * seg_distance(p, end) + 1e-9;
    }
    return good;
}

/* The kernel; along an axis the fast one where `fast`, which gives of Z only the lower end. */
static int ends_on_line(const NcToolBody *body, SegVec3 a, SegVec3 b, SegVec3 origin, SegVec3 w,
                        bool fast, SegVec3 ends[2], SegVec3 normals[2])
{
    double t[2];
    int axis = fabs(w.x) == 1 ? 0 : fabs(w.y) == 1 ? 1 : 2;
    SegVec3 base = {axis == 0 ? 0 : origin.x, axis == 1 ? 0 : origin.y, axis == 2 ? 0 : origin.z};
    SegVec3 up = {axis == 0, axis == 1, axis == 2};
    bool meets;
    if (!fast) {
        meets = nc_swept_interval(body, a, b, origin, w, &t[0], &t[1], normals);
        base = origin;
        up = w;
    } else if (axis < 2) {
        meets = nc_swept_level(body, a, b, axis, origin, t, normals);
    } else {
        meets = nc_swept_floor(body, a, b, origin.x, origin.y, &t[0], &normals[0]);
        t[1] = t[0];
    }
    for (int i = 0; i < 2; i++)
        ends[i] = seg_along(base, up, t[i]);
    return !meets ? 0 : fast && axis == 2 ? 1 : 2;
}

static bool check_line(GRand *random, const CfgTool *tool, SegVec3 a, SegVec3 b, SegVec3 origin,
                       SegVec3 w, bool fast, bool *hit)
{
    NcToolBody body = nc_body_cutting(tool);
    SegVec3 ends[2], normals[2];
    int n = ends_on_line(&body, a, b, origin, w, fast, ends, normals);
    *hit = n > 0;
    for (int i = 0; i < n; i++)
        if (!check_end(random, tool, a, b, ends[i], normals[i]))
            return false;
    for (int i = 0; i < 100 && n == 0; i++)
        if (defined_inside(tool, a, b, seg_along(origin, w, g_rand_double_range(random, -40, 40))))
            return false;
    return true;
}

static void report(const CfgTool *tool, SegVec3 a, SegVec3 b, SegVec3 origin, SegVec3 w, bool fast)
{
    g_test_message("%s: a = (%.17g, %.17g, %.17g), b = (%.17g, %.17g, %.17g), line from (%.17g, "
                   "%.17g, %.17g) along (%.17g, %.17g, %.17g)%s",
                   cfg_tool_kind_name(tool->kind), a.x, a.y, a.z, b.x, b.y, b.z, origin.x, origin.y,
                   origin.z, w.x, w.y, w.z, fast ? ", fast" : "");
}

static void check_random_lines(int n, unsigned seed, bool fast)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(seed);
    int hits = 0, wrong = 0;
    for (int i = 0; i < n; i++) {
        const CfgTool *tool = &test_tools.tools[i % N_KINDS];
        SegVec3 a = random_vector(random, 1000), b = seg_add(a, random_move(random));
        SegVec3 w = random_direction(random, seg_sub(b, a));
        if (fast) {
            int axis = g_rand_int_range(random, 0, 3);
            w = seg_vec3(axis == 0, axis == 1, axis == 2);
        }
        SegVec3 near = seg_lerp(a, b, g_rand_double(random));
        near.z += g_rand_double_range(random, -1, tool->flute_length_mm + 1);
        SegVec3 origin = seg_add(near, random_vector(random, 4));
        origin = seg_along(origin, w, g_rand_double_range(random, -30, 30));
        bool hit;
        if (!check_line(random, tool, a, b, origin, w, fast, &hit) && ++wrong < 5)
            report(tool, a, b, origin, w, fast);
        hits += hit;
    }
    g_assert_cmpint(wrong, ==, 0);
    g_assert_cmpint(hits, >, n / 3);
}

static void test_any_line(void)
{
    check_random_lines(test_trials(6000), 1, false);
}

static void test_axes(void)
{
    check_random_lines(test_trials(6000), 2, true);
}

/* A ball on a level move: the line across it, and the one down on it, have textbook ends. */
static void test_ball_closed_form(void)
{
    NcToolBody body = nc_body_cutting(&test_tools.tools[1]);
    SegVec3 a = {0, 0, 0}, b = {10, 0, 0}, n[2];
    double t0, t1;
    g_assert_true(
        nc_swept_interval(&body, a, b, seg_vec3(5, 1, -50), seg_vec3(0, 0, 1), &t0, &t1, n));
    test_near(t0, 50 + 3 - sqrt(9 - 1), 1e-12, 0);
    test_near(t1, 70, 1e-12, 0);
    test_near(n[0].y, 1.0 / 3, 1e-12, 0);
    test_near(n[0].z, -sqrt(8) / 3, 1e-12, 0);
    test_near(n[1].z, 1, 1e-12, 0);
    g_assert_true(
        nc_swept_interval(&body, a, b, seg_vec3(-90, 0, 1), seg_vec3(1, 0, 0), &t0, &t1, n));
    test_near(t0, 90 - sqrt(9 - 4), 1e-12, 0);
    test_near(t1, 100 + sqrt(9 - 4), 1e-12, 0);
    g_assert_false(
        nc_swept_interval(&body, a, b, seg_vec3(5, 3.001, 0), seg_vec3(0, 0, 1), &t0, &t1, n));
}

/* A flat tool that ramps down: its rim sweeps an oblique cylinder, whose normal is square to the
 * move. */
static void test_flat_ramp(void)
{
    NcToolBody body = nc_body_cutting(&test_tools.tools[0]);
    SegVec3 a = {0, 0, 1}, b = {10, 0, 0}, n[2];
    double t0, t1;
    g_assert_true(
        nc_swept_interval(&body, a, b, seg_vec3(5, 0, -50), seg_vec3(0, 0, 1), &t0, &t1, n));
    test_near(t0, 50 + 0.2, 1e-12, 0); /* the leading rim at x = 5 stood at tip x = 8 */
    test_near(n[0].x * 10 - n[0].z, 0, 1e-12, 0);
}

static void test_profiles(void)
{
    for (size_t i = 0; i < N_KINDS; i++) {
        NcToolBody body = nc_body_cutting(&test_tools.tools[i]);
        test_near(body.top, test_tools.tools[i].flute_length_mm, 0, 0);
        for (double z = 0.001; z < test_tools.tools[i].flute_length_mm; z += 0.0137) {
            double r = test_drawn_radius(&test_tools.tools[i], z);
            test_near(nc_body_radius_mm(&body, z), r, 1e-12, 0);
            if (r < body.radius - 1e-9)
                test_near(nc_body_height_mm(&body, r), z, 1e-9, 0);
        }
        g_assert_true(isinf(nc_body_height_mm(&body, body.radius + 1e-9)));
    }
    const CfgTool *stepped = &test_tools.tools[6];
    NcToolBody shank = nc_body_shank(stepped), holder = nc_body_holder(stepped);
    test_near(shank.bottom, 5, 0, 0);
    test_near(shank.top, 30, 0, 0);
    test_near(shank.radius, 4, 0, 0);
    test_near(holder.bottom, 30, 0, 0);
    test_near(holder.top, 80, 0, 0);
    test_near(holder.radius, 20, 0, 0);
    CfgTool bare = *stepped;
    bare.flute_length_mm = bare.length_mm = bare.stickout_mm;
    shank = nc_body_shank(&bare);
    holder = nc_body_holder(&bare);
    g_assert_true(nc_body_is_empty(&shank));
    g_assert_true(nc_body_is_empty(&holder));
}

static void add(void)
{
    g_test_add_func("/nc/stock/sweep/any-line", test_any_line);
    g_test_add_func("/nc/stock/sweep/axes", test_axes);
    g_test_add_func("/nc/stock/sweep/ball", test_ball_closed_form);
    g_test_add_func("/nc/stock/sweep/flat-ramp", test_flat_ramp);
    g_test_add_func("/nc/stock/sweep/profiles", test_profiles);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
