/* SPDX-License-Identifier: Apache-2.0 */
/* Collisions: each kind, with its line, place and depth; none in a right program; what is refused.
 */
#include <string.h>

#include "nc/stock/dexel.h"
#include "tests/lib/stock_case.h"
#include "tests/lib/test.h"

typedef struct {
    NcStock *stock;
    TestProgram program;
    GArray *collisions;
} Case;

static void begin(Case *c, int tool, SegVec3 from)
{
    g_autoptr(GError) error = NULL;
    c->stock = nc_stock_new_box(seg_vec3(0, 0, -40), seg_vec3(40, 30, 0),
                                &(NcStockOptions){0.3, 1 << 30}, &error);
    g_assert_no_error(error);
    c->collisions = g_array_new(FALSE, FALSE, sizeof(NcCollision));
    test_program_begin(&c->program, tool, from);
}

static void run(Case *c, guint expected)
{
    g_autoptr(GError) error = NULL;
    g_assert_true(test_program_cut(&c->program, c->stock, c->collisions, &error));
    g_assert_no_error(error);
    g_assert_cmpuint(c->collisions->len, ==, expected);
}

static void end(Case *c)
{
    nc_stock_free(c->stock);
    g_array_unref(c->collisions);
    test_program_end(&c->program);
}

static void check(const Case *c, guint i, NcCollisionKind kind, uint32_t line, double depth_mm,
                  SegVec3 min, SegVec3 max)
{
    if (i >= c->collisions->len)
        return;
    const NcCollision *found = &g_array_index(c->collisions, NcCollision, i);
    SegVec3 p = found->position;
    g_assert_cmpstr(nc_collision_name(found->kind), ==, nc_collision_name(kind));
    g_assert_cmpuint(found->line, ==, line);
    test_near(found->depth_mm, depth_mm, 1e-6, 0);
    g_assert_true(p.x >= min.x && p.x <= max.x && p.y >= min.y && p.y <= max.y && p.z >= min.z &&
                  p.z <= max.z);
}

/* In by feed, along, out by G0 through its own way, over to the next; a touch of 0.5 µm is none. */
static void test_right(void)
{
    Case c;
    begin(&c, 1, seg_vec3(20, 15, 50));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(10, 10, 2));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(10, 10, -5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(30, 10, -5));
    test_program_arc(&c.program, seg_vec3(30, 20, -5), seg_vec3(30, 15, -5), 17, 1);
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(30, 20, 1));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(30, 10, 1));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(30, 10, -5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(10, 10, -5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(10, 10, -0.0005));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(10, 25, -0.0005));
    c.program.next.tool = 0; /* nothing in the spindle, nothing swept */
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(10, 25, -5));
    run(&c, 0);
    end(&c);
}

static void test_rapid(void)
{
    Case c;
    begin(&c, 2, seg_vec3(-10, 15, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(-10, 15, -0.5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(50, 15, -0.5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(50, 15, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(20, 5, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(20, 5, -2));
    run(&c, 2);
    /* The ray nearest to the middle of the ball's way is up to half a pitch off. */
    if (c.collisions->len == 2) {
        NcCollision *along = &g_array_index(c.collisions, NcCollision, 0);
        double lost = 3 - sqrt(9 - 0.15 * 0.15);
        g_assert_true(along->depth_mm <= 0.5 && along->depth_mm >= 0.5 - lost);
        along->depth_mm = 0.5;
        along[1].depth_mm = MIN(along[1].depth_mm, 2);
        g_assert_true(along[1].depth_mm >= 2 - 2 * lost);
        along[1].depth_mm = 2;
    }
    check(&c, 0, NC_COLLISION_RAPID, 2, 0.5, seg_vec3(0, 14.8, -0.3), seg_vec3(40, 15.2, -0.2));
    check(&c, 1, NC_COLLISION_RAPID, 5, 2, seg_vec3(19.8, 4.8, -1.1), seg_vec3(20.2, 5.2, -0.9));
    end(&c);
}

/* Beside the block, 31 mm deep: flutes of 20 take 1 mm of its side, the shank above them the next
 * 10 mm of it, and the holder 1 mm off the top. */
static void test_shank_and_holder(void)
{
    Case c;
    begin(&c, 1, seg_vec3(-2, -40, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(-2, -40, -31));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(-2, 60, -31));
    run(&c, 2);
    check(&c, 0, NC_COLLISION_HOLDER, 2, 1, seg_vec3(0, 0, -1), seg_vec3(18, 30, 0));
    check(&c, 1, NC_COLLISION_SHANK, 2, 1, seg_vec3(0, 0, -11), seg_vec3(1, 30, 0));
    end(&c);
}

/* A slot 6 deep with flutes of 5: the shank of 8 meets 1 mm of each wall. */
static void test_too_deep(void)
{
    Case c;
    begin(&c, 7, seg_vec3(-10, 15, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(-10, 15, -6));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(50, 15, -6));
    run(&c, 1);
    check(&c, 0, NC_COLLISION_SHANK, 2, 1, seg_vec3(0, 11, -1), seg_vec3(40, 19, 0));
    end(&c);
    begin(&c, 7, seg_vec3(-10, 15, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(-10, 15, -5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(50, 15, -5));
    run(&c, 0);
    end(&c);
}

/* Rubbing is seen on the highest ray, up to a pitch below the top. */
static void check_rub(const Case *c, guint i, uint32_t line, double depth_mm, SegVec3 min,
                      SegVec3 max)
{
    if (i >= c->collisions->len)
        return;
    NcCollision *found = &g_array_index(c->collisions, NcCollision, i);
    g_assert_true(found->depth_mm <= depth_mm && found->depth_mm > depth_mm - 0.3);
    found->depth_mm = depth_mm;
    check(c, i, NC_COLLISION_SHANK, line, depth_mm, min, max);
}

/* In its own hole a shank as thick as the cutter takes nothing: flutes of 3, straight down 4.9 and
 * in pecks; and no deeper than its flutes; and a neck that is thinner by 0.03. */
static void test_own_hole(void)
{
    Case c;
    begin(&c, 9, seg_vec3(10, 10, 5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(10, 10, -4.9));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(10, 10, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(30, 20, 5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(30, 20, -2.5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(30, 20, 2));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(30, 20, -2.4));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(30, 20, -4.9));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(30, 20, 2));
    run(&c, 2);
    check_rub(&c, 0, 1, 1.9, seg_vec3(6.9, 6.9, -0.3), seg_vec3(13.1, 13.1, 0));
    check_rub(&c, 1, 7, 1.9, seg_vec3(26.9, 16.9, -0.3), seg_vec3(33.1, 23.1, 0));
    double left = nc_stock_volume_mm3(c.stock);
    end(&c);
    begin(&c, 1, seg_vec3(10, 10, 5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(10, 10, -4.9));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(10, 10, 5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(30, 20, 5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(30, 20, -4.9));
    run(&c, 0);
    test_near(nc_stock_volume_mm3(c.stock), left, 1e-6, 0);
    end(&c);
    begin(&c, 9, seg_vec3(10, 10, 5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(10, 10, -3));
    run(&c, 0);
    end(&c);
    begin(&c, 10, seg_vec3(10, 10, 5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(10, 10, -4.9));
    run(&c, 0);
    end(&c);
}

/* A slot in layers: the second brings the shank below the walls that the first has made. */
static void test_own_slot(void)
{
    Case c;
    begin(&c, 9, seg_vec3(-10, 15, 5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(-10, 15, -2.5));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(50, 15, -2.5));
    test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(50, 15, -4.9));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(-10, 15, -4.9));
    run(&c, 1);
    check_rub(&c, 0, 4, 1.9, seg_vec3(0, 11.9, -0.3), seg_vec3(40, 18.1, 0));
    end(&c);
}

static void check_spindle(int tool, double spindle_rpm, guint expected)
{
    Case c;
    begin(&c, tool, seg_vec3(-10, 15, 5));
    c.program.next.spindle_rpm = spindle_rpm;
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(-10, 15, -3));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(50, 15, -3));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(-10, 15, -3)); /* the way is free now */
    run(&c, expected);
    check(&c, 0, NC_COLLISION_SPINDLE, 2, 3, seg_vec3(0, 12, -3), seg_vec3(40, 18, 0));
    end(&c);
}

static void test_spindle(void)
{
    check_spindle(1, 5000, 0);
    check_spindle(1, 0, 1);
    check_spindle(1, -5000, 1);
    check_spindle(8, -5000, 0);
    check_spindle(8, 5000, 1);
}

/* A line that is executed often is reported once, with its deepest. */
static void test_one_a_line(void)
{
    Case c;
    begin(&c, 1, seg_vec3(-10, 5, -1));
    for (int i = 0; i < 3; i++) {
        c.program.next.line = 6;
        test_program_move(&c.program, NC_MOVE_RAPID, seg_vec3(50, 5 + 8 * i, -1 - i));
        c.program.next.line = 7;
        test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(60, 5 + 8 * i, -1 - i));
        test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(60, 13 + 8 * i, -2 - i));
        test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(-10, 13 + 8 * i, 20));
        test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(-10, 13 + 8 * i, -2 - i));
    }
    run(&c, 1);
    check(&c, 0, NC_COLLISION_RAPID, 7, 3, seg_vec3(0, 18, -3), seg_vec3(40, 24, 0));
    end(&c);
}

static void check_refused(const Case *c, const char *part)
{
    g_autoptr(GError) error = NULL;
    double before = nc_stock_volume_mm3(c->stock);
    g_assert_false(test_program_cut(&c->program, c->stock, NULL, &error));
    g_assert_error(error, NC_ERROR, NC_ERROR_PROGRAM);
    if (error && !strstr(error->message, part))
        g_test_fail_printf("\"%s\" does not say \"%s\"", error->message, part);
    test_near(nc_stock_volume_mm3(c->stock), before, 0, 0);
}

static void test_refused(void)
{
    Case c;
    begin(&c, 1, seg_vec3(-10, 15, -3));
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(50, 15, -3));
    c.program.next.tool = 77;
    test_program_move(&c.program, NC_MOVE_FEED, seg_vec3(60, 15, -3));
    check_refused(&c, "line 2: tool 77");
    g_array_index(c.program.moves, NcMove, 1).tool = 1;
    g_array_index(c.program.moves, NcMove, 1).to_deg[1] = 12.5;
    check_refused(&c, "line 2: a move with rotary axis B at 12.5");
    end(&c);
}

static void check_no_stock(SegVec3 max, NcStockOptions options, const char *part)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(NcStock) stock = nc_stock_new_box(seg_vec3(0, 0, 0), max, &options, &error);
    g_assert_null(stock);
    g_assert_error(error, NC_ERROR, NC_ERROR_PLAN);
    if (error && !strstr(error->message, part))
        g_test_fail_printf("\"%s\" does not say \"%s\"", error->message, part);
}

static void test_no_stock(void)
{
    check_no_stock(seg_vec3(10, 0, 10), NC_STOCK_DEFAULTS, "no volume");
    check_no_stock(seg_vec3(10, NAN, 10), NC_STOCK_DEFAULTS, "no volume");
    check_no_stock(seg_vec3(10, 10, 10), (NcStockOptions){0, 1 << 20}, "pitch");
    check_no_stock(seg_vec3(10, 10, 10), (NcStockOptions){30, 1 << 20}, "finer");
    check_no_stock(seg_vec3(1e4, 10, 10), (NcStockOptions){1e-3, 1 << 20}, "coarser");
    check_no_stock(seg_vec3(100, 100, 100), (NcStockOptions){0.1, 1 << 20}, "may have 1.0 MB");
}

/* Rays that are cut apart grow beyond what is allowed: said, not exceeded in silence. */
static void test_memory(void)
{
    g_autoptr(GError) error = NULL;
    NcStockOptions options = {0.25, 0};
    TestProgram program;
    options.memory_bytes = 4 << 20;
    g_autoptr(NcStock) stock =
        nc_stock_new_box(seg_vec3(0, 0, -10), seg_vec3(40, 40, 0), &options, &error);
    g_assert_no_error(error);
    if (!stock)
        return;
    g_assert_cmpuint(nc_stock_memory_bytes(stock), <=, options.memory_bytes);
    stock->memory_bytes = nc_stock_memory_bytes(stock) + 1000;
    test_program_begin(&program, 2, seg_vec3(-10, 0, -5));
    for (int i = 0; i < 10; i++) {
        test_program_move(&program, NC_MOVE_FEED, seg_vec3(-10, 4 * i, -5));
        test_program_move(&program, NC_MOVE_FEED, seg_vec3(50, 4 * i, -5));
        test_program_move(&program, NC_MOVE_FEED, seg_vec3(50, 4 * i, 5));
    }
    g_assert_false(test_program_cut(&program, stock, NULL, &error));
    g_assert_error(error, NC_ERROR, NC_ERROR_PLAN);
    test_program_end(&program);
}

static void add(void)
{
    g_test_add_func("/nc/stock/collide/right", test_right);
    g_test_add_func("/nc/stock/collide/rapid", test_rapid);
    g_test_add_func("/nc/stock/collide/shank-and-holder", test_shank_and_holder);
    g_test_add_func("/nc/stock/collide/too-deep", test_too_deep);
    g_test_add_func("/nc/stock/collide/own-hole", test_own_hole);
    g_test_add_func("/nc/stock/collide/own-slot", test_own_slot);
    g_test_add_func("/nc/stock/collide/spindle", test_spindle);
    g_test_add_func("/nc/stock/collide/one-a-line", test_one_a_line);
    g_test_add_func("/nc/stock/collide/refused", test_refused);
    g_test_add_func("/nc/stock/collide/no-stock", test_no_stock);
    g_test_add_func("/nc/stock/collide/memory", test_memory);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
