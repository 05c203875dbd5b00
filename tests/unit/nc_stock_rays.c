/* SPDX-License-Identifier: Apache-2.0 */
/* Random programs on coarse grids: what is left against a removal without any short cut, the three
 * rays of each node against each other, and the result against itself for any number of threads. */
#include <omp.h>
#include <stdlib.h>

#include "nc/stock/ray.h"
#include "nc/stock/sweep_axis.h"
#include "tests/lib/stock_case.h"
#include "tests/lib/test.h"

static NcStock *raw(void)
{
    return nc_stock_new_box(seg_vec3(-12, -9, -10), seg_vec3(12, 9, 0),
                            &(NcStockOptions){0.6, 1 << 30}, NULL);
}

static SegVec3 random_tip(GRand *random)
{
    /* Round numbers, so that cuts touch each other and themselves. */
    double step = g_rand_boolean(random) ? 0.5 : 1e-3;
    return seg_vec3(step * round(g_rand_double_range(random, -14, 14) / step),
                    step * round(g_rand_double_range(random, -11, 11) / step),
                    step * round(g_rand_double_range(random, -8, 2) / step));
}

/* Long and tiny moves of all tools, level, steep, arcs; some rapid. */
static void random_program(GRand *random, TestProgram *program)
{
    test_program_begin(program, 1, random_tip(random));
    for (int t = 0; t < 4; t++) {
        SegVec3 tip = random_tip(random);
        test_program_tool(program, g_rand_int_range(random, 1, 9), tip);
        for (int i = 0; i < 100; i++) {
            SegVec3 to = random_tip(random);
            double share = g_rand_int_range(random, 0, 10) == 0 ? 0.5 : 0.01;
            to = seg_lerp(tip, to, share);
            if (g_rand_int_range(random, 0, 3) == 0)
                to.z = tip.z;
            if (g_rand_int_range(random, 0, 30) == 0) {
                SegVec3 centre = seg_add(tip, seg_vec3(-2, 0, 0));
                test_program_arc(program, seg_add(tip, seg_vec3(0, 0, -0.5)), centre, 17, 1);
                tip.z -= 0.5;
                continue;
            }
            bool rapid = g_rand_int_range(random, 0, 40) == 0;
            test_program_move(program, rapid ? NC_MOVE_RAPID : NC_MOVE_FEED, to);
            tip = to;
        }
    }
}

static NcStock *cut(const TestProgram *program, GArray *collisions)
{
    g_autoptr(GError) error = NULL;
    NcStock *stock = raw();
    g_assert_true(test_program_cut(program, stock, collisions, &error));
    g_assert_no_error(error);
    return stock;
}

/* Every part of every chord taken out of every ray, one after the other. */
static NcStock *cut_naively(const TestProgram *program)
{
    NcStock *stock = raw();
    g_autoptr(NcChordReader) reader =
        nc_chord_reader_new((const NcMove *)(const void *)program->moves->data, program->moves->len,
                            test_zero, &test_tools);
    const NcGroup *groups;
    double middle;
    for (size_t n; (n = nc_chord_reader_next(reader, stock, &groups)) > 0;)
        for (int axis = 0; axis < 3; axis++)
            for (int32_t v = 0; v < stock->field[axis].n_rays[1]; v++)
                for (int32_t u = 0; u < stock->field[axis].n_rays[0]; u++) {
                    NcDexelField *field = &stock->field[axis];
                    NcRay ray = {
                        stock, axis, &field->tiles[v / NC_TILE * field->n_tiles[0] + u / NC_TILE],
                        v % NC_TILE * NC_TILE + u % NC_TILE, nc_dexel_origin(stock, axis, u, v)};
                    for (size_t g = 0; g < n; g++)
                        for (int i = 0; i < groups[g].n; i++)
                            for (int k = 0; k < NC_N_PARTS; k++)
                                nc_ray_subtract(&ray, &groups[g].cutter->part[k],
                                                &groups[g].chords[i], &middle);
                }
    return stock;
}

/* Rays that do not have the same segments; films may differ, they depend on the order. */
static int different_rays(const NcStock *a, const NcStock *b)
{
    int different = 0;
    for (int axis = 0; axis < 3; axis++)
        for (int32_t v = 0; v < a->field[axis].n_rays[1]; v++)
            for (int32_t u = 0; u < a->field[axis].n_rays[0]; u++) {
                size_t n, m;
                const NcDexelEnd *p = nc_dexel_ray(a, axis, u, v, &n);
                const NcDexelEnd *q = nc_dexel_ray(b, axis, u, v, &m);
                bool same = n == m;
                for (size_t i = 0; i < n && same; i++)
                    same = abs(p[i].depth - q[i].depth) * a->unit_mm <= NC_FILM_MM;
                different += !same;
            }
    return different;
}

static void test_naive(void)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(7);
    for (int i = 0; i < test_trials(4); i++) {
        TestProgram program;
        random_program(random, &program);
        g_autoptr(NcStock) fast = cut(&program, NULL);
        g_autoptr(NcStock) slow = cut_naively(&program);
        g_assert_cmpint(different_rays(fast, slow), ==, 0);
        double removed = 24 * 18 * 10 - nc_stock_volume_mm3(fast);
        g_assert_true(removed > 50 && removed < 24 * 18 * 10 - 50);
        test_program_end(&program);
    }
}

static bool is_material(const NcStock *stock, int axis, const int32_t node[3])
{
    size_t n;
    int32_t depth = nc_dexel_node_depth(stock, node[axis]);
    const NcDexelEnd *ends =
        nc_dexel_ray(stock, axis, node[(axis + 1) % 3], node[(axis + 2) % 3], &n);
    for (size_t i = 0; i < n; i += 2)
        if (ends[i].depth < depth && depth < ends[i + 1].depth)
            return true;
    return false;
}

/* What the mesh relies on. */
static bool is_well_formed(const NcStock *stock)
{
    for (int axis = 0; axis < 3; axis++)
        for (int32_t v = 0; v < stock->field[axis].n_rays[1]; v++)
            for (int32_t u = 0; u < stock->field[axis].n_rays[0]; u++) {
                size_t n;
                const NcDexelEnd *ends = nc_dexel_ray(stock, axis, u, v, &n);
                int32_t before = INT32_MIN;
                for (size_t i = 0; i < n; i++) {
                    SegVec3 normal = nc_dexel_normal(&ends[i]);
                    double across = axis == 0 ? normal.x : axis == 1 ? normal.y : normal.z;
                    if (ends[i].depth <= before || ends[i].depth % (1 << stock->shift) == 0 ||
                        (i % 2 ? across < -1e-4 : across > 1e-4) || ends[i].cut >= stock->n_cuts)
                        return false;
                    before = ends[i].depth;
                }
                if (n % 2)
                    return false;
            }
    return true;
}

static void test_nodes(void)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(3);
    for (int i = 0; i < test_trials(10); i++) {
        TestProgram program;
        int differ = 0;
        random_program(random, &program);
        g_autoptr(NcStock) stock = cut(&program, NULL);
        for (int32_t x = 0; x < stock->n_nodes[0]; x++)
            for (int32_t y = 0; y < stock->n_nodes[1]; y++)
                for (int32_t z = 0; z < stock->n_nodes[2]; z++) {
                    int32_t node[3] = {x, y, z};
                    int sum = is_material(stock, 0, node) + is_material(stock, 1, node) +
                              is_material(stock, 2, node);
                    differ += sum % 3 != 0;
                }
        g_assert_cmpint(differ, ==, 0);
        g_assert_true(is_well_formed(stock));
        test_program_end(&program);
    }
}

/* Nodes that lie on cuts to the last digit: the grid's own coordinates are programmed. On floors
 * the rays agree; where a ray runs in a wall it cannot tell, and only there may they differ. */
static void test_on_nodes(void)
{
    g_autoptr(NcStock) stock = raw();
    if (!stock)
        return;
    TestProgram program;
    double x = nc_dexel_node_mm(stock, 0, 20), y = nc_dexel_node_mm(stock, 1, 15);
    double z = nc_dexel_node_mm(stock, 2, 10);
    int floors = 0, differ = 0;
    test_program_begin(&program, 1, seg_vec3(x, y, 5));
    test_program_move(&program, NC_MOVE_FEED, seg_vec3(x, y, z));
    test_program_move(&program, NC_MOVE_FEED, seg_vec3(x + 3.6, y, z));
    g_assert_true(test_program_cut(&program, stock, NULL, NULL));
    for (int32_t i = 0; i < stock->n_nodes[0]; i++)
        for (int32_t j = 0; j < stock->n_nodes[1]; j++) {
            int32_t node[3] = {i, j, 10};
            double dx = nc_dexel_node_mm(stock, 0, i) - x, dy = nc_dexel_node_mm(stock, 1, j) - y;
            double off = hypot(dx - fmin(fmax(dx, 0), 3.6), dy) - 3;
            int sum = is_material(stock, 0, node) + is_material(stock, 1, node) +
                      is_material(stock, 2, node);
            differ += fabs(off) > NC_SWEEP_ERROR_MM && sum % 3 != 0;
            floors += off < 0;
        }
    g_assert_cmpint(differ, ==, 0);
    g_assert_cmpint(floors, >, 100);
    g_assert_true(is_well_formed(stock));
    test_program_end(&program);
}

static void checksum_stock(const NcStock *stock, const GArray *collisions, char text[65])
{
    g_autoptr(GChecksum) sum = g_checksum_new(G_CHECKSUM_SHA256);
    for (int axis = 0; axis < 3; axis++)
        for (int32_t v = 0; v < stock->field[axis].n_rays[1]; v++)
            for (int32_t u = 0; u < stock->field[axis].n_rays[0]; u++) {
                size_t n;
                const NcDexelEnd *ends = nc_dexel_ray(stock, axis, u, v, &n);
                g_checksum_update(sum, (const guchar *)ends, (gssize)(n * sizeof *ends));
                g_checksum_update(sum, (const guchar *)&n, sizeof n);
            }
    for (guint i = 0; i < collisions->len; i++) {
        const NcCollision *c = &g_array_index(collisions, NcCollision, i);
        g_autofree char *line =
            g_strdup_printf("%d %u %.17g %.17g %.17g %.17g\n", (int)c->kind, c->line, c->position.x,
                            c->position.y, c->position.z, c->depth_mm);
        g_checksum_update(sum, (const guchar *)line, -1);
    }
    g_strlcpy(text, g_checksum_get_string(sum), 65);
}

static void test_threads(void)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(5);
    const int threads[] = {1, 2, 7};
    int before = omp_get_max_threads();
    TestProgram program;
    char sums[3][65];
    random_program(random, &program);
    for (int i = 0; i < 3; i++) {
        g_autoptr(GArray) collisions = g_array_new(FALSE, FALSE, sizeof(NcCollision));
        omp_set_num_threads(threads[i]);
        g_autoptr(NcStock) stock = cut(&program, collisions);
        checksum_stock(stock, collisions, sums[i]);
        g_assert_cmpuint(collisions->len, >, 5);
    }
    omp_set_num_threads(before);
    g_assert_cmpstr(sums[0], ==, sums[1]);
    g_assert_cmpstr(sums[0], ==, sums[2]);
    test_program_end(&program);
}

/* Move by move is the same stock as all at once. */
static void test_one_by_one(void)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(11);
    TestProgram program;
    random_program(random, &program);
    g_autoptr(NcStock) whole = cut(&program, NULL);
    g_autoptr(NcStock) stock = raw();
    for (guint i = 0; i < program.moves->len; i++)
        g_assert_true(nc_stock_cut(stock, &g_array_index(program.moves, NcMove, i), 1, test_zero,
                                   &test_tools, NULL, NULL));
    g_assert_cmpint(different_rays(whole, stock), ==, 0);
    g_assert_cmpuint(whole->n_cuts, ==, stock->n_cuts);
    test_program_end(&program);
}

static void add(void)
{
    g_test_add_func("/nc/stock/rays/naive", test_naive);
    g_test_add_func("/nc/stock/rays/nodes", test_nodes);
    g_test_add_func("/nc/stock/rays/on-nodes", test_on_nodes);
    g_test_add_func("/nc/stock/rays/threads", test_threads);
    g_test_add_func("/nc/stock/rays/one-by-one", test_one_by_one);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
