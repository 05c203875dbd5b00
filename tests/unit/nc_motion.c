/* SPDX-License-Identifier: Apache-2.0 */
/* Motion against closed forms, and against the axes' limits on random paths. The machine of
 * tests/lib/gcode.h: 100 mm/s and 500 mm/s² on every axis. */
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <math.h>

typedef struct {
    GArray *moves;
    NcTimedMove *timed;
    double total_s;
} Run;

static Run run(const char *program, const CfgMachine *machine)
{
    Run r = {.moves = gcode_read(program, machine)};
    g_assert_nonnull(r.moves);
    if (!r.moves)
        r.moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    r.timed = nc_motion_plan(machine, (const NcMove *)(void *)r.moves->data, r.moves->len);
    if (r.moves->len > 0) {
        const NcTimedMove *last = &r.timed[r.moves->len - 1];
        r.total_s = last->start_s + last->duration_s;
    }
    return r;
}

static void run_clear(Run *r)
{
    g_array_unref(r->moves);
    g_free(r->timed);
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
    machine.axis[2] = (CfgAxis){-1000.0, 1000.0, 600.0, 100.0};
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

/* The corner's circle stays within P of it: v² = (√3/2)·a·P·cos β/(1 − cos β). */
static void corner(void)
{
    CfgMachine machine = gcode_machine();
    Run r = run("G64 P0.1 G1 X100 F6000\nY100\nM2", &machine);
    double beta = G_PI / 4.0, p = 0.1;
    double radius = p * cos(beta) / (1.0 - cos(beta));
    test_near(r.timed[0].v_out_mm_s, sqrt(sqrt(0.75) * 500.0 * radius), 1e-9, 0.0);
    g_assert_cmpfloat(r.timed[0].v_out_mm_s, ==, r.timed[1].v_in_mm_s);
    run_clear(&r);

    /* that circle keeps to the half of the shorter move */
    r = run("G64 P10 G1 X100 F6000\nY1\nM2", &machine);
    radius = 0.5 / tan(beta);
    double from_end = sqrt(2.0 * 500.0 * 1.0); /* the last move must be able to stop */
    test_near(r.timed[0].v_out_mm_s, fmin(sqrt(sqrt(0.75) * 500.0 * radius), from_end), 1e-9, 0.0);
    run_clear(&r);

    r = run("G64 G1 X10 F6000\nX0\nM2", &machine);
    g_assert_cmpfloat(r.timed[0].v_out_mm_s, ==, 0.0);
    run_clear(&r);
}

static void circle(void)
{
    CfgMachine machine = gcode_machine();
    /* r = 4: v² / r = √3/2 · 500 limits; half the acceleration is left for speeding up */
    double v = sqrt(sqrt(0.75) * 500.0 * 4.0), length = 2.0 * G_PI * 4.0 * 10.0;
    Run r = run("G2 I4 P10 F6000\nM2", &machine);
    test_near(r.timed[0].v_max_mm_s, v, 1e-9, 0.0);
    test_near(r.timed[0].length_mm, length, 1e-9, 0.0);
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
    test_near(r.timed[0].v_out_mm_s, 20.0, 1e-9, 0.0);
    test_near(r.timed[1].v_out_mm_s, 20.0, 1e-9, 0.0);
    run_clear(&r);
}

static void helix(void)
{
    CfgMachine machine = gcode_machine();
    Run r = run("G3 I-10 Z12 P4 F1200\nM2", &machine);
    test_near(r.timed[0].length_mm, hypot(2.0 * G_PI * 10.0 * 4.0, 12.0), 1e-9, 0.0);
    const NcMove *move = &g_array_index(r.moves, NcMove, 0);
    SegVec3 middle = nc_motion_position(move, &r.timed[0], 0.5 * r.timed[0].duration_s);
    test_near(middle.x, 0.0, 1e-9, 0.0);
    test_near(middle.y, 0.0, 1e-9, 0.0);
    test_near(middle.z, 6.0, 1e-9, 0.0);
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

/* Sampled within every move: speed and acceleration of each axis, the distance run, and that the
 * speed goes on across the joint. Returns the number of violations. */
static int check_limits(const CfgMachine *machine, const Run *r)
{
    int wrong = 0;
    double v_last = 0.0;
    for (guint i = 0; i < r->moves->len; i++) {
        const NcMove *move = &g_array_index(r->moves, NcMove, i);
        const NcTimedMove *timed = &r->timed[i];
        double h = timed->duration_s / 64.0;
        wrong += !(isfinite(timed->duration_s) && timed->duration_s >= 0.0);
        if (!(timed->length_mm > 0.0)) {
            v_last = timed->duration_s > 0.0 ? 0.0 : v_last;
            continue;
        }
        wrong += fabs(timed->v_in_mm_s - v_last) > 1e-9;
        v_last = timed->v_out_mm_s;
        if (move->kind != NC_MOVE_RAPID)
            wrong += timed->v_max_mm_s > move->feed_mm_min / 60.0 * (1.0 + 1e-12);
        wrong += fabs(nc_motion_speed_mm_s(timed, 0.0) - timed->v_in_mm_s) > 1e-6;
        wrong += fabs(nc_motion_speed_mm_s(timed, timed->duration_s) - timed->v_out_mm_s) > 1e-6;
        for (int k = 1; k < 64; k++) {
            SegVec3 a = nc_motion_position(move, timed, (k - 1) * h);
            SegVec3 b = nc_motion_position(move, timed, k * h);
            SegVec3 c = nc_motion_position(move, timed, (k + 1) * h);
            const double v[3] = {(c.x - a.x) / (2 * h), (c.y - a.y) / (2 * h),
                                 (c.z - a.z) / (2 * h)};
            SegVec3 bend = seg_scale(seg_add(seg_sub(c, b), seg_sub(a, b)), 1.0 / (h * h));
            const double acceleration[3] = {bend.x, bend.y, bend.z};
            double noise = 1e-11 / (h * h);
            for (int axis = 0; axis < 3; axis++) {
                const CfgAxis *limit = &machine->axis[axis];
                wrong += fabs(v[axis]) > limit->max_mm_min / 60.0 * (1.0 + 1e-6);
                wrong += fabs(acceleration[axis]) > limit->max_mm_s2 * (1.0 + 1e-3) + noise;
            }
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
    machine.axis[2] = (CfgAxis){-1000.0, 1000.0, 1200.0, 100.0};
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
    test_near(polygon.timed[628].v_max_mm_s, arc.timed[1].v_max_mm_s, 0.0, 0.01);
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
    gint64 start = g_get_monotonic_time();
    g_autofree NcTimedMove *timed = nc_motion_plan(&machine, moves, n);
    double seconds = (double)(g_get_monotonic_time() - start) * 1e-6;
    g_test_message("%.2f million moves/s", n / seconds * 1e-6);
    g_assert_cmpfloat(seconds, <, 20.0);
    g_assert_cmpfloat(timed[n - 1].v_out_mm_s, ==, 0.0);
}

static void add(void)
{
    g_test_add_func("/nc/motion/single-moves", single_moves);
    g_test_add_func("/nc/motion/slow-axis", slow_axis);
    g_test_add_func("/nc/motion/standing", standing);
    g_test_add_func("/nc/motion/exact", exact);
    g_test_add_func("/nc/motion/pieces", pieces);
    g_test_add_func("/nc/motion/corner", corner);
    g_test_add_func("/nc/motion/circle", circle);
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
