/* SPDX-License-Identifier: Apache-2.0 */
/* Motion against closed forms, and against the axes' limits on random paths. The machine of
 * tests/lib/gcode.h: 100 mm/s and 500 mm/s² on every axis. */
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <math.h>

typedef struct {
    GArray *moves;
    NcMotion *motion;
    double total_s;
} Run;

static Run run(const char *program, const CfgMachine *machine)
{
    Run r = {.moves = gcode_read(program, machine)};
    g_assert_nonnull(r.moves);
    if (!r.moves)
        r.moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    r.motion = nc_motion_new(machine, NC_NO_OVERRIDE, 0.0, (const NcMove *)(void *)r.moves->data,
                             r.moves->len);
    r.total_s = nc_motion_total_s(r.motion);
    return r;
}

static void run_clear(Run *r)
{
    nc_motion_free(r->motion);
    g_array_unref(r->moves);
}

/* Where a move ends. */
static NcAlong at_end(const Run *r, size_t move)
{
    return nc_motion_along(r->motion, nc_motion_start_s(r->motion, move + 1));
}

static double duration(const char *program)
{
    CfgMachine machine = gcode_machine();
    Run r = run(program, &machine);
    run_clear(&r);
    return r.total_s;
}

static void check_duration(const char *program, double expected_s)
{
    double actual = duration(program);
    if (fabs(actual - expected_s) > 1e-9 * (1.0 + expected_s))
        g_test_message("%s", program);
    test_near(actual, expected_s, 1e-9, 1e-9);
}

/* length / v + v / a where the speed is reached, else 2·√(length / a). */
static double rest_to_rest(double length, double v, double a)
{
    return length >= v * v / a ? length / v + v / a : 2.0 * sqrt(length / a);
}

static void single_moves(void)
{
    check_duration("G1 X100 F3000\nM2", rest_to_rest(100.0, 50.0, 500.0));
    check_duration("G1 X2 F6000\nM2", rest_to_rest(2.0, 100.0, 500.0));
    check_duration("G1 X2 F60000\nM2", rest_to_rest(2.0, 100.0, 500.0));
    check_duration("G0 X200\nM2", rest_to_rest(200.0, 100.0, 500.0));
    /* along a diagonal every axis may use its own limit */
    double root3 = sqrt(3.0);
    check_duration("G0 X100 Y100 Z100\nM2",
                   rest_to_rest(100.0 * root3, 100.0 * root3, 500.0 * root3));
    check_duration("G0 X0\nM2", 0.0);
}

static void slow_axis(void)
{
    CfgMachine machine = gcode_machine();
    machine.axis[2] = (CfgAxis){-1000.0, 1000.0, 600.0, 100.0, 0.0};
    Run r = run("G0 X30 Z10\nM2", &machine);
    /* Z alone: 10 mm at 10 mm/s and 100 mm/s² */
    test_near(r.total_s, rest_to_rest(10.0, 10.0, 100.0), 1e-9, 0.0);
    run_clear(&r);
}

static void standing(void)
{
    check_duration("G4 P1.5\nM2", 1.5);
    check_duration("T1 M6\nM2", 5.0);
    check_duration("S3000 M3\nM5\nM2", 3.0 + 3.0);
    check_duration("S3000 M3\nS1000\nM4\nM2", 3.0 + 2.0 + 2.0 + 1.0);
    check_duration("S3000 M3\nT1 M6\nM2", 3.0 + 3.0 + 5.0);
    check_duration("G1 X10 F3000\nG4 P1\nX20\nM2", 2.0 * rest_to_rest(10.0, 50.0, 500.0) + 1.0);
    check_duration("G1 X10 F3000\nM8\nX20\nM2", 2.0 * rest_to_rest(10.0, 50.0, 500.0));
}

/* With G96 the spindle changes its speed on the way: what stands behind that has nothing to wait
 * for, and M5 brakes from there. */
static void surface_speed(void)
{
    const double rpm = 60e3 / (2.0 * G_PI * 20.0), on_way = rest_to_rest(10.0, 50.0, 500.0);
    check_duration("G0 X20\nG96 S60 D2500 M3\nG1 X10 F3000\nG4 P1\nM8\nM5\nM2",
                   rest_to_rest(20.0, 100.0, 500.0) + rpm / 1000.0 + on_way + 1.0 +
                       2.0 * rpm / 1000.0);
}

/* A move of no length behind one that stands has none of its time. */
static void standing_and_no_length(void)
{
    CfgMachine machine = gcode_machine();
    Run r = run("S3000 M3\nG1 F100\nX0\nG4 P1\nM2", &machine);
    g_assert_cmpint(r.moves->len, >, 2);
    test_near(nc_motion_duration_s(r.motion, 0), 3.0, 1e-12, 0);
    test_near(nc_motion_duration_s(r.motion, 1), 0.0, 1e-12, 0);
    run_clear(&r);
}

/* Stops at every corner, and the exact stop also where there is none. */
static void exact(void)
{
    double side = rest_to_rest(10.0, 50.0, 500.0);
    check_duration("G61 G1 X10 F3000\nY10\nX0\nY0\nM2", 4.0 * side);
    check_duration("G61 G1 X10 F3000\nX20\nX30\nM2", rest_to_rest(30.0, 50.0, 500.0));
    check_duration("G61.1 G1 X10 F3000\nX20\nX30\nM2", 3.0 * side);
    check_duration("G1 X10 F3000\nX0\nX10\nM2", 3.0 * side);
}

/* Equal short pieces of a line take the line's time, zero-length ones between them too. */
static void pieces(void)
{
    g_autoptr(GString) program = g_string_new("F6000 G1\n");
    for (int i = 1; i <= 1000; i++)
        g_string_append_printf(program, "X%.4f Y%.4f\n%s", 0.3 * i, 0.1 * i,
                               i % 7 ? "" : "G0 Z0\nG1\n");
    g_string_append(program, "M2");
    g_autofree char *with_rapids = g_strdup(program->str);
    double length = hypot(300.0, 100.0), slope = 300.0 / length;
    test_near(duration(with_rapids), rest_to_rest(length, 100.0, 500.0 / slope), 1e-6, 0.0);
}

/* A blend is a parabola of half-width h, and P = h·|Δd|/4 from the corner; it turns with
 * a = v²·Δd/2h, which is √3/2 of what the axes can. */
static void corner(void)
{
    CfgMachine machine = gcode_machine();
    Run r = run("G64 P0.1 G1 X100 F6000\nY100\nM2", &machine);
    double half = 4.0 * 0.1 / sqrt(2.0), v = sqrt(sqrt(0.75) * 500.0 * 2.0 * half);
    test_near(at_end(&r, 0).v_mm_s, v, 1e-9, 0.0);
    /* Both ways alike: from rest to v over 100 - h, then h at v. */
    double once = 100.0 / 500.0 + (100.0 - v) / 500.0 + half / v;
    once += (100.0 - half - 1e4 / 1000.0 - (1e4 - v * v) / 1000.0) / 100.0;
    test_near(r.total_s, 2.0 * once, 1e-9, 0.0);
    NcPoint at = nc_motion_at(r.motion, nc_motion_start_s(r.motion, 1));
    test_near(hypot(at.position[0] - 100.0, at.position[1]), 0.1, 1e-9, 0.0);
    run_clear(&r);

    /* Without P it takes half of the shorter move. */
    r = run("G64 G1 X100 F6000\nY1\nM2", &machine);
    v = sqrt(sqrt(0.75) * 500.0 * 1.0);
    g_assert_cmpfloat(v, <, sqrt(2.0 * 500.0 * 0.5)); /* the last half can still stop */
    test_near(at_end(&r, 0).v_mm_s, v, 0.0, 1e-6);
    run_clear(&r);

    /* Back on itself: a stop. */
    r = run("G64 G1 X10 F6000\nX0\nM2", &machine);
    g_assert_cmpfloat(at_end(&r, 0).v_mm_s, ==, 0.0);
    run_clear(&r);
}

/* n equal moves of length L at right angles: each corner at v_c over 2h, between them up from v_c
 * and down again over L - 2h; the first and the last from and to rest over L - h. */
static void zigzag(void)
{
    const double length = 2.0, p = 0.02, a = 500.0;
    const int n = 100;
    g_autoptr(GString) program = g_string_new("G64 P0.02 F60000 G1\n");
    for (int i = 1; i <= n; i++)
        g_string_append_printf(program, "X%d Y%d\n", (i + 1) / 2 * 2, i / 2 * 2);
    g_string_append(program, "M2");
    double half = 4.0 * p / sqrt(2.0), corner = sqrt(sqrt(0.75) * a * 2.0 * half);
    double between = length - 2.0 * half, peak = sqrt(a * between + corner * corner);
    double one = 2.0 * (peak - corner) / a + 2.0 * half / corner;
    double end = length - half, top = sqrt(a * end + 0.5 * corner * corner);
    double ends = 2.0 * ((2.0 * top - corner) / a + half / corner);
    test_near(duration(program->str), (n - 2) * one + ends, 1e-6, 0.0);
}

static void circle(void)
{
    CfgMachine machine = gcode_machine();
    /* r = 4: v² / r = √3/2 · 500 limits; half the acceleration is left for speeding up */
    double v = sqrt(sqrt(0.75) * 500.0 * 4.0), length = 2.0 * G_PI * 4.0 * 10.0;
    Run r = run("G2 I4 P10 F6000\nM2", &machine);
    test_near(nc_motion_along(r.motion, 0.5 * r.total_s).v_mm_s, v, 1e-9, 0.0);
    test_near(nc_motion_end_mm(r.motion, 0), length, 1e-9, 0.0);
    test_near(r.total_s, rest_to_rest(length, v, 250.0), 1e-9, 0.0);
    run_clear(&r);

    /* slow enough for the feed to limit: the rest of the acceleration is along the path */
    r = run("G2 I100 F600\nM2", &machine);
    double across = 10.0 * 10.0 / 100.0;
    test_near(r.total_s, rest_to_rest(200.0 * G_PI, 10.0, sqrt(500.0 * 500.0 - across * across)),
              1e-9, 0.0);
    run_clear(&r);

    /* a line into the tangent of an arc does not slow down for the corner */
    r = run("G64 P0.01 G1 X50 F1200\nG3 Y40 J20\nG1 X0\nM2", &machine);
    test_near(at_end(&r, 0).v_mm_s, 20.0, 1e-9, 0.0);
    test_near(at_end(&r, 1).v_mm_s, 20.0, 1e-9, 0.0);
    run_clear(&r);
}

/* ------------------------------------------------------------------------------ jerk */

static CfgMachine jerky_machine(double jerk)
{
    CfgMachine machine = gcode_machine();
    for (int i = 0; i < 3; i++)
        machine.axis[i].max_mm_s3 = jerk;
    return machine;
}

static double jerky_s(const char *program, double jerk)
{
    CfgMachine machine = jerky_machine(jerk);
    Run r = run(program, &machine);
    run_clear(&r);
    return r.total_s;
}

/* The seven phases: L/v + v/a + a/j; without constant speed T = a/j + √((a/j)² + 4L/a); without
 * constant acceleration 4·∛(L/2j); with the speed reached but not the acceleration L/v + 2·√(v/j).
 */
static void s_curve(void)
{
    const double a = 500.0, j = 10000.0;
    test_near(jerky_s("G1 X100 F3000\nM2", j), 100.0 / 50.0 + 50.0 / a + a / j, 1e-9, 0.0);
    double ramp = a / j;
    test_near(jerky_s("G1 X10 F6000\nM2", j), ramp + sqrt(ramp * ramp + 4.0 * 10.0 / a), 1e-9, 0.0);
    test_near(jerky_s("G1 X1 F6000\nM2", j), 4.0 * cbrt(1.0 / (2.0 * j)), 1e-9, 0.0);
    test_near(jerky_s("G1 X10 F600\nM2", j), 10.0 / 10.0 + 2.0 * sqrt(10.0 / j), 1e-9, 0.0);
    /* Along a diagonal every axis has its own. */
    test_near(jerky_s("G1 X100 Y100 F3000\nM2", j),
              100.0 * sqrt(2.0) / 50.0 + 50.0 / (a * sqrt(2.0)) + a / j, 1e-9, 0.0);
}

/* A thousand pieces of a line take the line's time, and arcs in tangents a circle's. */
static void jerky_pieces(void)
{
    g_autoptr(GString) program = g_string_new("G64 P0.01 F3000 G1\n");
    for (int i = 1; i <= 1000; i++)
        g_string_append_printf(program, "X%.1f\n", 0.1 * i);
    g_string_append(program, "M2");
    test_near(jerky_s(program->str, 10000.0), 100.0 / 50.0 + 50.0 / 500.0 + 0.05, 1e-9, 0.0);
}

/* Rest to rest around a circle, v³/r² and v²/r far from the limits: as on a line. */
static void jerky_circle(void)
{
    double slow = jerky_s("G2 I100 F600\nM2", 10000.0);
    test_near(slow, 200.0 * G_PI / 10.0 + 2.0 * sqrt(10.0 / 10000.0), 0.0, 0.005);
}

/* Short moves along a curve, as CAM writes them, do not bring a jerk-limited machine down: 0.1 mm
 * on a circle of 20 mm at 3000 mm/min, with coordinates of four places. */
static void jerky_chain(void)
{
    g_autoptr(GString) program = g_string_new("G64 P0.01 F3000 G0 X20\nG1\n");
    for (int i = 1; i <= 1256; i++)
        g_string_append_printf(program, "X%.4f Y%.4f\n", 20.0 * cos(i * G_PI / 628.0),
                               20.0 * sin(i * G_PI / 628.0));
    g_string_append(program, "M2");
    CfgMachine machine = jerky_machine(10000.0);
    Run r = run(program->str, &machine);
    double s = r.total_s - nc_motion_start_s(r.motion, 1);
    g_test_message("%.3f s, at the feed alone %.3f s", s, 40.0 * G_PI / 50.0);
    g_assert_cmpfloat(s, <, 1.2 * 40.0 * G_PI / 50.0);
    run_clear(&r);
}

static void helix(void)
{
    CfgMachine machine = gcode_machine();
    Run r = run("G3 I-10 Z12 P4 F1200\nM2", &machine);
    test_near(nc_motion_end_mm(r.motion, 0), hypot(2.0 * G_PI * 10.0 * 4.0, 12.0), 1e-9, 0.0);
    const NcMove *move = &g_array_index(r.moves, NcMove, 0);
    NcPoint middle = nc_motion_at(r.motion, 0.5 * r.total_s);
    test_near(middle.position[0], 0.0, 1e-9, 0.0);
    test_near(middle.position[1], 0.0, 1e-9, 0.0);
    test_near(middle.position[2], 6.0, 1e-9, 0.0);
    SegVec3 eighth = nc_move_point(move, 1.0 / 16.0);
    test_near(eighth.x, -10.0, 1e-9, 0.0);
    test_near(eighth.y, 10.0, 1e-9, 0.0);
    test_near(eighth.z, 0.75, 1e-9, 0.0);
    run_clear(&r);
}

static void bounds(void)
{
    static const struct {
        const char *program;
        double min[3], max[3];
    } cases[] = {
        {"G1 X1 Y-2 Z3 F1\nM2", {0, -2, 0}, {1, 0, 3}},
        {"F1 G2 X10 Y10 I10\nM2", {0, 0, 0}, {10, 10, 0}},
        {"F1 G2 X20 I10\nM2", {0, 0, 0}, {20, 10, 0}},
        {"F1 G3 X20 I10\nM2", {0, -10, 0}, {20, 0, 0}},
        {"F1 G3 X10 Y10 I10\nM2", {0, -10, 0}, {20, 10, 0}},
        {"F1 G2 I10 Z-3\nM2", {0, -10, -3}, {20, 10, 0}},
        {"F1 G18 G2 X20 I10\nM2", {0, 0, -10}, {20, 0, 0}},
        {"F1 G19 G3 Z20 K10\nM2", {0, 0, 0}, {0, 10, 20}},
    };
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Run r = run(cases[i].program, &machine);
        SegVec3 min, max;
        nc_move_bounds(&g_array_index(r.moves, NcMove, 0), &min, &max);
        g_test_message("%s", cases[i].program);
        test_near(min.x, cases[i].min[0], 1e-9, 0.0);
        test_near(min.y, cases[i].min[1], 1e-9, 0.0);
        test_near(min.z, cases[i].min[2], 1e-9, 0.0);
        test_near(max.x, cases[i].max[0], 1e-9, 0.0);
        test_near(max.y, cases[i].max[1], 1e-9, 0.0);
        test_near(max.z, cases[i].max[2], 1e-9, 0.0);
        run_clear(&r);
    }
}

/* What the plan says of itself against differences of its positions, and the limits; the jerk is
 * the business of tests/unit/nc_motion_limits.c. Returns the number of violations. */
static int check_limits(const CfgMachine *machine, const Run *r)
{
    int wrong = !(isfinite(r->total_s) && r->total_s >= 0.0);
    for (guint i = 0; i < r->moves->len; i++)
        wrong += !(nc_motion_duration_s(r->motion, i) >= -1e-12);
    const double h = fmin(1e-3, r->total_s / 64.0);
    for (double t = h; t < r->total_s - h && wrong < 100; t += 2.7 * h) {
        NcPoint p[3];
        for (int k = 0; k < 3; k++)
            p[k] = nc_motion_at(r->motion, t + (k - 1) * h);
        for (int axis = 0; axis < 3; axis++) {
            const CfgAxis *limit = &machine->axis[axis];
            double a = p[0].position[axis], b = p[1].position[axis], c = p[2].position[axis];
            double v = (c - a) / (2.0 * h), bend = (a - 2.0 * b + c) / (h * h);
            wrong += fabs(v) > limit->max_mm_min / 60.0 * (1.0 + 1e-6);
            wrong += fabs(bend) > limit->max_mm_s2 * (1.0 + 1e-3) + 1e-11 / (h * h);
            wrong += fabs(p[1].velocity[axis] - v) > 2.0 * limit->max_mm_s2 * h + 1e-9 / h;
            wrong += fabs(p[1].acceleration[axis]) > limit->max_mm_s2 * (1.0 + 1e-6);
        }
    }
    return wrong;
}

static char *random_program(GRand *random)
{
    GString *program = g_string_new("G91.1\n");
    double x = 0.0, y = 0.0, z = 0.0;
    for (int i = 0; i < 300; i++) {
        double size = pow(10.0, g_rand_double_range(random, -2.5, 1.5));
        double dx = size * g_rand_double_range(random, -1.0, 1.0);
        double dy = size * g_rand_double_range(random, -1.0, 1.0);
        double dz = size * g_rand_double_range(random, -0.5, 0.5);
        if (fabs(x + dx) > 400.0 || fabs(y + dy) > 400.0 || fabs(z + dz) > 400.0)
            dx = -x, dy = -y, dz = -z;
        int kind = g_rand_int_range(random, 0, 8);
        x += dx, y += dy, z += dz;
        if (kind == 0)
            g_string_append(program, g_rand_boolean(random) ? "G64 P0.02\n" : "G61\n");
        g_string_append_printf(program, "F%d ", g_rand_int_range(random, 100, 9000));
        if (kind == 1)
            g_string_append_printf(program, "G0 X%.4f Y%.4f Z%.4f\n", x, y, z);
        else if ((kind == 2 || kind == 3) && hypot(dx, dy) > 0.01)
            g_string_append_printf(program, "G%d G17 X%.4f Y%.4f Z%.4f R%.4f\n", kind, x, y, z,
                                   hypot(dx, dy) * g_rand_double_range(random, 0.6, 3.0));
        else if (kind == 4 && hypot(dz, dx) > 0.01)
            g_string_append_printf(program, "G3 G18 X%.4f Y%.4f Z%.4f R%.4f\n", x, y, z,
                                   hypot(dz, dx) * g_rand_double_range(random, 0.6, 3.0));
        else
            g_string_append_printf(program, "G1 X%.4f Y%.4f Z%.4f\n", x, y, z);
    }
    g_string_append(program, "M2\n");
    return g_string_free(program, FALSE);
}

static void random_paths(void)
{
    CfgMachine machine = gcode_machine();
    machine.axis[1].max_mm_s2 = 200.0;
    machine.axis[2] = (CfgAxis){-1000.0, 1000.0, 1200.0, 100.0, 0.0};
    g_autoptr(GRand) random = g_rand_new_with_seed(7);
    for (int i = 0; i < 20; i++) {
        g_autofree char *program = random_program(random);
        Run r = run(program, &machine);
        g_assert_cmpuint(r.moves->len, >, 300);
        g_assert_cmpint(check_limits(&machine, &r), ==, 0);
        run_clear(&r);
    }
}

/* Programs that once broke LinuxCNC's planner. */
static void known_trouble(void)
{
    static const char *const suffixes[] = {".ngc", NULL};
    g_autoptr(GPtrArray) files = test_data_files("gcode_conformance/linuxcnc_trajectory", suffixes);
    CfgMachine machine = gcode_machine();
    int n = 0;
    for (guint i = 0; files && i < files->len; i++) {
        g_autofree char *program = NULL;
        if (!g_file_get_contents(files->pdata[i], &program, NULL, NULL))
            continue;
        g_autoptr(GArray) moves = gcode_read(program, &machine);
        if (!moves)
            continue;
        n++;
        Run r = run(program, &machine);
        g_assert_cmpint(check_limits(&machine, &r), ==, 0);
        run_clear(&r);
    }
    if (files && files->len > 0)
        g_assert_cmpint(n, >, 30);
}

/* A circle in chords of 0.1 mm is run as fast as the circle itself. */
static void chords(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(GString) program = g_string_new("G64 P0.01 F6000 G0 X20\nG1\n");
    for (int i = 1; i <= 1256; i++)
        g_string_append_printf(program, "X%.6f Y%.6f\n", 20.0 * cos(i * G_PI / 628.0),
                               20.0 * sin(i * G_PI / 628.0));
    g_string_append(program, "M2");
    Run polygon = run(program->str, &machine), arc = run("G0 X20\nF6000 G3 I-20\nM2", &machine);
    double polygon_v = at_end(&polygon, 628).v_mm_s;
    double arc_v = nc_motion_along(arc.motion, nc_motion_total_s(arc.motion) - 1.0).v_mm_s;
    test_near(polygon_v, arc_v, 0.0, 0.05);
    run_clear(&polygon);
    run_clear(&arc);
}

static void million(void)
{
    CfgMachine machine = gcode_machine();
    const guint n = 1000000;
    g_autofree NcMove *moves = g_new0(NcMove, n);
    SegVec3 at = seg_vec3(0.0, 0.0, 0.0);
    for (guint i = 0; i < n; i++) {
        SegVec3 to = seg_vec3(0.1 * (i % 5000), 0.1 * (i / 5000), 0.3 * sin(0.01 * i));
        moves[i] = (NcMove){.kind = NC_MOVE_FEED,
                            .from = at,
                            .to = to,
                            .feed_mm_min = 3000.0,
                            .tolerance_mm = 0.01};
        at = to;
    }
    for (int jerky = 0; jerky < 2; jerky++) {
        machine = jerky_machine(jerky * 10000.0);
        gint64 start = g_get_monotonic_time();
        g_autoptr(NcMotion) motion = nc_motion_new(&machine, NC_NO_OVERRIDE, 0.0, moves, n);
        double seconds = (double)(g_get_monotonic_time() - start) * 1e-6;
        g_test_message("%.0f moves/s%s", n / seconds, jerky ? ", jerk-limited" : "");
        g_assert_cmpfloat(n / seconds, >, jerky ? 3000.0 : 10000.0); /* must: ten times that */
        g_assert_cmpfloat(nc_motion_along(motion, nc_motion_total_s(motion)).v_mm_s, ==, 0.0);
    }
}

static void add(void)
{
    g_test_add_func("/nc/motion/single-moves", single_moves);
    g_test_add_func("/nc/motion/slow-axis", slow_axis);
    g_test_add_func("/nc/motion/standing", standing);
    g_test_add_func("/nc/motion/surface-speed", surface_speed);
    g_test_add_func("/nc/motion/standing-and-no-length", standing_and_no_length);
    g_test_add_func("/nc/motion/exact", exact);
    g_test_add_func("/nc/motion/pieces", pieces);
    g_test_add_func("/nc/motion/corner", corner);
    g_test_add_func("/nc/motion/zigzag", zigzag);
    g_test_add_func("/nc/motion/circle", circle);
    g_test_add_func("/nc/motion/s-curve", s_curve);
    g_test_add_func("/nc/motion/jerky-pieces", jerky_pieces);
    g_test_add_func("/nc/motion/jerky-circle", jerky_circle);
    g_test_add_func("/nc/motion/jerky-chain", jerky_chain);
    g_test_add_func("/nc/motion/helix", helix);
    g_test_add_func("/nc/motion/bounds", bounds);
    g_test_add_func("/nc/motion/random-paths", random_paths);
    g_test_add_func("/nc/motion/known-trouble", known_trouble);
    g_test_add_func("/nc/motion/chords", chords);
    g_test_add_func("/nc/motion/million", million);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
