/* SPDX-License-Identifier: Apache-2.0 */
/* The cut part measured along lines, against closed forms: every kind of tool, straight moves and
 * arcs, rows of scallops, what was not cut, what was cut away and how far that goes. */
#include "nc/stock/probe.h"

#include <math.h>
#include <string.h>

#include "nc/stock/chords.h"

#include "tests/lib/test.h"

#define LENGTH_MM 60.0
#define STOCK_MM 0.5

/* One of each kind, 6 mm wide. Numbers are those of CfgToolKind, and 1. */
static const CfgTool shapes[CFG_N_TOOL_KINDS] = {
    [CFG_TOOL_FLAT] = {.kind = CFG_TOOL_FLAT},
    [CFG_TOOL_BALL] = {.kind = CFG_TOOL_BALL, .corner_radius_mm = 3},
    [CFG_TOOL_BULL] = {.kind = CFG_TOOL_BULL, .corner_radius_mm = 1},
    [CFG_TOOL_DRILL] = {.kind = CFG_TOOL_DRILL, .tip_angle_deg = 118},
    [CFG_TOOL_CHAMFER] = {.kind = CFG_TOOL_CHAMFER, .tip_angle_deg = 90, .tip_diameter_mm = 1},
    [CFG_TOOL_TAPER] = {.kind = CFG_TOOL_TAPER,
                        .tip_angle_deg = 20,
                        .tip_diameter_mm = 2,
                        .corner_radius_mm = 1},
};

static CfgToolTable table_of(CfgTool tools[CFG_N_TOOL_KINDS])
{
    for (int i = 0; i < CFG_N_TOOL_KINDS; i++) {
        tools[i] = shapes[i];
        tools[i].number = i + 1;
        tools[i].diameter_mm = 6;
        tools[i].shank_diameter_mm = 6;
        tools[i].flute_length_mm = 20;
        tools[i].stickout_mm = 30;
        tools[i].length_mm = LENGTH_MM;
    }
    return (CfgToolTable){tools, CFG_N_TOOL_KINDS};
}

/* Height of the cutting face above the tip, at r from the axis. */
static double profile(CfgToolKind kind, double r)
{
    const double slope = tan(10 * G_PI / 180), tangent = cos(10 * G_PI / 180);
    switch (kind) {
    case CFG_TOOL_BALL:
        return 3 - sqrt(9 - r * r);
    case CFG_TOOL_BULL:
        return r <= 2 ? 0 : 1 - sqrt(1 - (r - 2) * (r - 2));
    case CFG_TOOL_DRILL:
        return r / tan(59 * G_PI / 180);
    case CFG_TOOL_CHAMFER:
        return fmax(r - 0.5, 0);
    case CFG_TOOL_TAPER:
        return r <= tangent ? 1 - sqrt(1 - r * r)
                            : 1 - sin(10 * G_PI / 180) + (r - tangent) / slope;
    default:
        return 0;
    }
}

/* A feed move of the tip, of tool `kind`. The work zero lies at (10, 20, -30). */
static const SegVec3 zero = {10, 20, -30};

static NcMove feed(CfgToolKind kind, SegVec3 a, SegVec3 b)
{
    SegVec3 off = seg_add(zero, seg_vec3(0, 0, LENGTH_MM));
    return (NcMove){.kind = NC_MOVE_FEED,
                    .tool = (int)kind + 1,
                    .from = seg_add(a, off),
                    .to = seg_add(b, off)};
}

static NcProbing *probing_of(const NcMove *moves, size_t n)
{
    CfgTool tools[CFG_N_TOOL_KINDS];
    CfgToolTable table = table_of(tools);
    g_autoptr(GError) error = NULL;
    NcProbing *probing = nc_probing_new(moves, n, zero, &table, &error);
    g_assert_no_error(error);
    return probing;
}

static double deviation(const NcProbing *probing, SegVec3 point, SegVec3 normal)
{
    return nc_probing_measure(probing, point, normal, STOCK_MM, 1000).deviation_mm;
}

/* Along a level move the cut is the tool's profile, whatever lies along it. */
static void slots(void)
{
    for (CfgToolKind kind = 0; kind < CFG_N_TOOL_KINDS; kind++) {
        NcMove move = feed(kind, seg_vec3(-20, 0, 1), seg_vec3(20, 0, 1));
        g_autoptr(NcProbing) probing = probing_of(&move, 1);
        for (double y = -2.95; probing && y < 3; y += 0.1)
            for (double off = -0.4; off <= 0.4; off += 0.1) {
                double lowest = 1 + profile(kind, fabs(y));
                SegVec3 point = {3.3 * y, y, lowest - off};
                test_near(deviation(probing, point, seg_vec3(0, 0, 1)), off, 1e-9, 0);
            }
    }
}

/* The same on a ramp: square to it a flat's rim and a ball look like themselves. */
static void ramps(void)
{
    const double c = cos(0.3), s = sin(0.3);
    NcMove ball = feed(CFG_TOOL_BALL, seg_vec3(-10 * c, 0, -10 * s), seg_vec3(10 * c, 0, 10 * s));
    g_autoptr(NcProbing) probing = probing_of(&ball, 1);
    for (double angle = -1.2; probing && angle < 1.25; angle += 0.1) {
        /* The ball's centre line; around it, a cylinder of its radius. */
        SegVec3 across = {0, 1, 0}, up = {-s, 0, c}, at = {2 * c, 0, 2 * s + 3};
        SegVec3 out = seg_add(seg_scale(across, sin(angle)), seg_scale(up, -cos(angle)));
        for (double off = -0.3; off <= 0.3; off += 0.1) {
            SegVec3 point = seg_along(at, out, 3 + off);
            test_near(deviation(probing, point, seg_scale(out, -1)), off, 1e-9, 0);
        }
    }
}

/* Around a ball that stands still. */
static void spheres(void)
{
    NcMove ball = feed(CFG_TOOL_BALL, seg_vec3(1, 2, 3), seg_vec3(1, 2, 3));
    g_autoptr(NcProbing) probing = probing_of(&ball, 1);
    for (double polar = 0; probing && polar < 1.5; polar += 0.1)
        for (double turn = 0; turn < 6.2; turn += 0.4) {
            SegVec3 out = {sin(polar) * cos(turn), sin(polar) * sin(turn), -cos(polar)};
            SegVec3 point = seg_along(seg_vec3(1, 2, 6), out, 3.25);
            test_near(deviation(probing, point, seg_scale(out, -1)), 0.25, 1e-9, 0);
        }
}

/* Rows on a plane: between two the cusp is R - √(R² - s²/4) high; under each there is none. */
static void rows(void)
{
    const double step = 0.4, cusp = 3 - sqrt(9 - step * step / 4);
    NcMove moves[40];
    for (int i = 0; i < 40; i++)
        moves[i] = feed(CFG_TOOL_BALL, seg_vec3(-20, i * step, 0), seg_vec3(20, i * step, 0));
    g_autoptr(NcProbing) probing = probing_of(moves, 40);
    for (int i = 5; probing && i < 35; i++) {
        SegVec3 row = {0.1 * i, i * step, 0}, between = {0.1 * i, (i + 0.5) * step, 0};
        test_near(deviation(probing, row, seg_vec3(0, 0, 1)), 0, 1e-9, 0);
        test_near(deviation(probing, between, seg_vec3(0, 0, 1)), cusp, 1e-9, 0);
        g_assert_cmpuint(nc_probing_measure(probing, row, seg_vec3(0, 0, 1), 1, 1000).move, ==,
                         (size_t)i);
    }
}

/* A full circle in each plane. */
static void arcs(void)
{
    NcMove arc = feed(CFG_TOOL_BALL, seg_vec3(10, 0, 0), seg_vec3(10, 0, 0));
    arc.kind = NC_MOVE_ARC;
    arc.plane = 17;
    arc.turn = -1;
    arc.centre = seg_sub(arc.from, seg_vec3(10, 0, 0));
    g_autoptr(NcProbing) probing = probing_of(&arc, 1);
    for (double turn = 0; probing && turn < 6.2; turn += 0.1)
        for (double tilt = -1.2; tilt < 1.25; tilt += 0.2) {
            /* Around the centre of the ball's place: a torus. */
            SegVec3 ray = {cos(turn), sin(turn), 0};
            SegVec3 out = seg_along(seg_scale(ray, sin(tilt)), seg_vec3(0, 0, 1), -cos(tilt));
            SegVec3 point = seg_along(seg_add(seg_scale(ray, 10), seg_vec3(0, 0, 3)), out, 2.9);
            test_near(deviation(probing, point, seg_scale(out, -1)), -0.1, 1e-4, 0);
        }
}

/* A steep helix bores its cylinder, which the last turn alone touches just above the tip. */
static void helix(void)
{
    const double turns = 3, rise = -19;
    NcMove bore = feed(CFG_TOOL_FLAT, seg_vec3(1, 0, 0), seg_vec3(1, 0, rise));
    bore.kind = NC_MOVE_ARC;
    bore.plane = 17;
    bore.turn = (int)turns;
    bore.centre = seg_sub(bore.from, seg_vec3(1, 0, 0));
    g_autoptr(NcProbing) probing = probing_of(&bore, 1);
    for (double turn = turns - 0.9; probing && turn < turns - 0.1; turn += 0.0123) {
        SegVec3 ray = {cos(2 * G_PI * turn), sin(2 * G_PI * turn), 0};
        SegVec3 point = {4 * ray.x, 4 * ray.y, rise * turn / turns + 0.2};
        test_near(deviation(probing, point, seg_scale(ray, -1)), 0, NC_STOCK_CHORD_MM, 0);
    }
}

/* Nothing cut: the stock's end, on either side of the point. */
static void uncut(void)
{
    NcMove far = feed(CFG_TOOL_FLAT, seg_vec3(100, 0, 0), seg_vec3(110, 0, 0));
    g_autoptr(NcProbing) probing = probing_of(&far, 1);
    if (!probing)
        return;
    for (double stock = -2; stock <= 2; stock += 0.5) {
        NcProbed probed =
            nc_probing_measure(probing, seg_vec3(0, 0, 0), seg_vec3(0, 0, 1), stock, 1000);
        g_assert_cmpfloat(probed.deviation_mm, ==, stock);
        g_assert_cmpuint(probed.move, ==, NC_PROBING_UNCUT);
    }
    /* Under a cut that does not come down to the point, but into the stock. */
    SegVec3 below = {105, 0, -0.2};
    test_near(deviation(probing, below, seg_vec3(0, 0, 1)), 0.2, 1e-9, 0);
    /* And one that stays above it. */
    SegVec3 deep = {105, 0, -0.7};
    test_near(deviation(probing, deep, seg_vec3(0, 0, 1)), STOCK_MM, 1e-9, 0);
}

/* A hole that many moves made is measured to its end; one behind a wall is not counted. */
static void deep(void)
{
    NcMove moves[22];
    for (int i = 0; i < 20; i++)
        moves[i] = feed(CFG_TOOL_FLAT, seg_vec3(0, 0, -0.9 * i), seg_vec3(4, 0, -0.9 * i - 0.5));
    moves[20] = feed(CFG_TOOL_FLAT, seg_vec3(40, 0, -1), seg_vec3(44, 0, -1));
    moves[21] = feed(CFG_TOOL_FLAT, seg_vec3(50.5, 0, -1), seg_vec3(54, 0, -1));
    g_autoptr(NcProbing) probing = probing_of(moves, 22);
    if (!probing)
        return;
    test_near(deviation(probing, seg_vec3(4, 0, 0), seg_vec3(0, 0, 1)), -0.9 * 19 - 0.5, 1e-9, 0);
    /* From the end of one slot towards the other: 0.5 mm of wall between them. */
    SegVec3 in_slot = {44, 0, 0};
    test_near(deviation(probing, in_slot, seg_vec3(-1, 0, 0)), -3, 1e-9, 0);
}

static void errors(void)
{
    CfgTool tools[CFG_N_TOOL_KINDS];
    CfgToolTable table = table_of(tools);
    NcMove move = feed(CFG_TOOL_BALL, seg_vec3(0, 0, 0), seg_vec3(1, 0, 0));
    move.line = 17;
    move.tool = 99;
    g_autoptr(GError) error = NULL;
    g_autoptr(NcProbing) none = nc_probing_new(&move, 1, zero, &table, &error);
    g_assert_null(none);
    g_assert_error(error, NC_ERROR, NC_ERROR_PROGRAM);
    g_assert_nonnull(error ? strstr(error->message, "line 17: tool 99") : NULL);
    g_clear_error(&error);
    move.tool = 1;
    move.to_deg[0] = 5;
    none = nc_probing_new(&move, 1, zero, &table, &error);
    g_assert_null(none);
    g_assert_nonnull(error ? strstr(error->message, "line 17: a move with rotary axis A") : NULL);
    g_clear_error(&error);
    /* 40 million pieces of a quarter of the radius. */
    double length_mm = 40e6 * 0.25 * tools[0].diameter_mm / 2;
    move = feed((CfgToolKind)0, seg_vec3(0, 0, 0), seg_vec3(length_mm, 0, 0));
    move.line = 17;
    none = nc_probing_new(&move, 1, zero, &table, &error);
    g_assert_null(none);
    g_assert_nonnull(error ? strstr(error->message, "line 17: the program is too long") : NULL);
}

static void add(void)
{
    g_test_add_func("/nc/probing/slots", slots);
    g_test_add_func("/nc/probing/ramps", ramps);
    g_test_add_func("/nc/probing/spheres", spheres);
    g_test_add_func("/nc/probing/rows", rows);
    g_test_add_func("/nc/probing/arcs", arcs);
    g_test_add_func("/nc/probing/helix", helix);
    g_test_add_func("/nc/probing/uncut", uncut);
    g_test_add_func("/nc/probing/deep", deep);
    g_test_add_func("/nc/probing/errors", errors);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
