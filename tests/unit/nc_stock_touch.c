/* SPDX-License-Identifier: Apache-2.0 */
/* Probing the stock, against places that are known. */
#include "nc/nc.h"
#include "tests/lib/test.h"

#define PITCH 0.2

static CfgTool the_tools[] = {
    {.number = 1, .kind = CFG_TOOL_FLAT, .diameter_mm = 6, .flute_length_mm = 20, .length_mm = 50},
    {.number = 2,
     .kind = CFG_TOOL_BALL,
     .diameter_mm = 6,
     .corner_radius_mm = 3,
     .flute_length_mm = 20,
     .length_mm = 70},
};
static const CfgToolTable table = {the_tools, G_N_ELEMENTS(the_tools)};
static const SegVec3 zero = {100, 200, -300};

/* Where the tip is, work coordinates, when it meets the block or leaves it; NAN: never. */
static SegVec3 feel(const NcStock *stock, int tool, SegVec3 from, SegVec3 to, bool away)
{
    const SegVec3 gauge = {zero.x, zero.y, zero.z + (tool == 1 ? 50 : 70)};
    const NcMove move = {.kind = NC_MOVE_PROBE,
                         .tool = tool,
                         .from = seg_add(from, gauge),
                         .to = seg_add(to, gauge)};
    SegVec3 where;
    if (!nc_stock_probe(stock, &move, zero, &table, away, &where))
        return seg_vec3(NAN, NAN, NAN);
    return seg_sub(where, gauge);
}

static NcStock *block(void)
{
    const NcStockOptions options = {PITCH, 1ull << 28};
    return nc_stock_new_box(seg_vec3(0, 0, -20), seg_vec3(30, 25, 0), &options, NULL);
}

static void faces(void)
{
    g_autoptr(NcStock) stock = block();
    const double ball = PITCH * PITCH / 12, exact = 2 * NC_STOCK_PROBE_MM;
    test_near(feel(stock, 1, seg_vec3(9, 9, 8), seg_vec3(9, 9, -5), false).z, 0, exact, 0);
    test_near(feel(stock, 1, seg_vec3(-20, 9, -8), seg_vec3(9, 9, -8), false).x, -3,
              PITCH * PITCH / 24, 0);
    test_near(feel(stock, 2, seg_vec3(9, 9, 8), seg_vec3(9, 9, -5), false).z, 0, ball, 0);
    test_near(feel(stock, 2, seg_vec3(9, 50, -8), seg_vec3(9, 3, -8), false).y, 28, ball, 0);
    /* Aslant onto the top, and with the ball's side onto the upper edge of x = 0. */
    test_near(feel(stock, 2, seg_vec3(5, 5, 6), seg_vec3(17, 14, -3), false).x, 13, 2 * ball, 0);
    /* The edge lies between two rays. */
    test_near(feel(stock, 2, seg_vec3(-9, 9, -1), seg_vec3(9, 9, -1), false).x, -sqrt(9 - 4), PITCH,
              0);
}

static void away_and_nowhere(void)
{
    g_autoptr(NcStock) stock = block();
    const double exact = 2 * NC_STOCK_PROBE_MM;
    const SegVec3 in = {9, 9, -4}, above = {9, 9, 30}, beside = {60, 9, -4};
    test_near(feel(stock, 1, in, above, true).z, 0, exact, 0);
    test_near(feel(stock, 1, in, beside, true).x, 33, PITCH * PITCH / 24, 0);
    test_near(feel(stock, 1, above, in, true).z, 30, exact, 0);
    test_near(feel(stock, 1, in, above, false).z, -4, exact, 0);
    g_assert_true(isnan(feel(stock, 1, in, seg_vec3(9, 9, -2), true).z));
    g_assert_true(isnan(feel(stock, 1, above, seg_vec3(60, 9, 30), false).z));
    g_assert_true(isnan(feel(stock, 1, beside, seg_vec3(60, 9, -30), false).z));
    g_assert_true(isnan(feel(stock, 7, above, in, false).z));
}

/* A copy is one of its own. */
static void copied(void)
{
    g_autoptr(NcStock) stock = block();
    g_autoptr(NcStock) copy = nc_stock_copy(stock);
    const SegVec3 gauge = {zero.x, zero.y, zero.z + 50};
    const NcMove move = {.kind = NC_MOVE_FEED,
                         .tool = 1,
                         .line = 1,
                         .spindle_rpm = 5000,
                         .from = seg_add(gauge, seg_vec3(9, -9, -7)),
                         .to = seg_add(gauge, seg_vec3(9, 40, -7))};
    g_assert_true(nc_stock_cut(copy, &move, 1, zero, &table, NULL, NULL));
    const SegVec3 above = {9, 9, 8}, below = {9, 9, -15};
    test_near(feel(stock, 1, above, below, false).z, 0, 2 * NC_STOCK_PROBE_MM, 0);
    test_near(feel(copy, 1, above, below, false).z, -7, 2 * NC_STOCK_PROBE_MM, 0);
    test_near(nc_stock_volume_mm3(stock), 30 * 25 * 20, 0, 0.02);
}

static void add(void)
{
    g_test_add_func("/nc/stock/touch/faces", faces);
    g_test_add_func("/nc/stock/touch/away", away_and_nowhere);
    g_test_add_func("/nc/stock/touch/copy", copied);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
