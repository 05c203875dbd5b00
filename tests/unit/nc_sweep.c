/* SPDX-License-Identifier: Apache-2.0 */
/* The swept-tool gouge check against closed forms and against dense drops along the move. */
#include <omp.h>

#include "tests/lib/soup.h"
#include "tests/lib/test.h"

static const NcCutter flat = {3, 0}, ball = {3, 3}, bull = {3, 1};
static const NcCutter cutters[] = {{3, 0}, {3, 3}, {3, 1}, {2, 1.9}, {4, 0.05}, {0.5, 0.5}};
static const double fine = 1e-9;

static double gouge(const NcTerrain *terrain, NcCutter cutter, SegVec3 a, SegVec3 b)
{
    return nc_sweep_gouge_mm(terrain, cutter, a, b, fine);
}

/* ------------------------------------------------------------------ closed forms */

static void test_plane(void)
{
    Soup soup = {0};
    soup_add(&soup, seg_vec3(-90, -90, 0), seg_vec3(90, -90, 0), seg_vec3(0, 120, 0));
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    for (size_t c = 0; c < 3; c++) {
        SegVec3 high = {0, 0, 7}, low = {8, 5, -2};
        test_near(gouge(terrain, cutters[c], high, low), 2, fine, 0);
        test_near(gouge(terrain, cutters[c], low, high), 2, fine, 0);
        test_near(gouge(terrain, cutters[c], high, high), -7, fine, 0);
        test_near(gouge(terrain, cutters[c], high, seg_vec3(0, 0, -3)), 3, fine, 0);
        test_near(gouge(terrain, cutters[c], seg_vec3(-9, 2, 1), seg_vec3(9, 3, 1)), -1, fine, 0);
    }
    SegVec3 far = {500, 0, 0};
    g_assert_cmpfloat(gouge(terrain, ball, far, seg_vec3(600, 0, -50)), ==, -INFINITY);
    g_assert_true(nc_sweep_clear(terrain, ball, far, seg_vec3(600, 0, -50), 0));
    soup_clear(&soup);
}

/* A ridge with a sharp, level crest at z = 5 over the line x = 0, its sides 1 in 1000. */
static NcTerrain *knife(void)
{
    Soup soup = {0};
    for (int side = -1; side <= 1; side += 2) {
        SegVec3 foot_a = {side * 0.01, -50, -5}, foot_b = {side * 0.01, 50, -5};
        SegVec3 top_a = {0, -50, 5}, top_b = {0, 50, 5};
        soup_add(&soup, foot_a, foot_b, top_b);
        soup_add(&soup, foot_a, top_b, top_a);
    }
    NcTerrain *terrain = soup_terrain(&soup);
    soup_clear(&soup);
    return terrain;
}

static void test_knife(void)
{
    g_autoptr(NcTerrain) terrain = knife();
    /* Level, straight across and askew, ends far out of reach: the crest is met at its full height
     * wherever the middle of a step falls. */
    for (double start = -7; start < -6; start += 0.0371) {
        for (size_t c = 0; c < 3; c++) {
            SegVec3 a = {start, -1, 4.5}, b = {start + 13, 3, 4.5};
            test_near(gouge(terrain, cutters[c], a, b), 0.5, fine, 0);
            g_assert_false(nc_sweep_clear(terrain, cutters[c], a, b, 0.4999));
            g_assert_true(nc_sweep_clear(terrain, cutters[c], a, b, 0.5001));
        }
    }
    /* A ball climbing across at 45°: deepest where its sphere touches the crest. */
    SegVec3 a = {-8, 0, -4}, b = {8, 0, 12};
    double expected = 5 - 4 + 3 * (sqrt(2) - 1);
    test_near(gouge(terrain, ball, a, b), expected, 1e-8, 0);
    test_near(gouge(terrain, ball, b, a), expected, 1e-8, 0);
}

/* A flat cutter that rises while it comes to a wall is deepest when its rim reaches it: the drop
 * height jumps there. */
static void test_step(void)
{
    Soup soup = {0};
    soup_add(&soup, seg_vec3(0, -50, 2), seg_vec3(90, 0, 2), seg_vec3(0, 50, 2));
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    for (double slope = 0.01; slope < 3; slope *= 1.7) {
        for (double start = -8; start < -7; start += 0.093) {
            SegVec3 a = {start, 0, slope * start}, b = {1.3, 0, slope * 1.3};
            test_near(gouge(terrain, flat, a, b), 2 + 3 * slope, 1e-8, 0);
            test_near(gouge(terrain, flat, b, a), 2 + 3 * slope, 1e-8, 0);
            double torus = 2 + 2 * slope + 1 * (sqrt(1 + slope * slope) - 1);
            test_near(gouge(terrain, bull, a, b), torus, 1e-8, 0);
        }
    }
    soup_clear(&soup);
}

/* ------------------------------------------------------------------ dense samples */

static SegVec3 random_tip(GRand *rand, double size)
{
    return seg_vec3(g_rand_double_range(rand, -size, size), g_rand_double_range(rand, -size, size),
                    g_rand_double_range(rand, -size, size));
}

static double gouge_at(const NcTerrain *terrain, NcCutter cutter, SegVec3 a, SegVec3 b, double t)
{
    SegVec3 tip = seg_lerp(a, b, t);
    return nc_drop(terrain, cutter, tip.x, tip.y, NULL, NULL) - tip.z;
}

enum { SAMPLES = 300 };

static double sampled_gouge(const NcTerrain *terrain, NcCutter cutter, SegVec3 a, SegVec3 b,
                            int *deepest)
{
    double best = -INFINITY;
    for (int i = 0; i <= SAMPLES; i++) {
        double g = gouge_at(terrain, cutter, a, b, (double)i / SAMPLES);
        if (g > best) {
            best = g;
            *deepest = i;
        }
    }
    return best;
}

/* For one triangle the gouge is concave along the move: its maximum lies beside the best sample. */
static double searched_gouge(const NcTerrain *single, NcCutter cutter, SegVec3 a, SegVec3 b)
{
    int deepest = 0;
    double best = sampled_gouge(single, cutter, a, b, &deepest);
    if (best == -INFINITY)
        return best;
    double lo = fmax(0, deepest - 1) / SAMPLES, hi = fmin(SAMPLES, deepest + 1) / SAMPLES;
    double middle = (double)deepest / SAMPLES;
    for (int i = 0; i < 80; i++) {
        double left = (lo + middle) / 2, right = (middle + hi) / 2;
        double at_left = gouge_at(single, cutter, a, b, left);
        double at_right = gouge_at(single, cutter, a, b, right);
        if (at_left > best) {
            hi = middle, middle = left, best = at_left;
        } else if (at_right > best) {
            lo = middle, middle = right, best = at_right;
        } else {
            lo = left, hi = right;
        }
    }
    return best;
}

static void test_search(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(11);
    Soup soup = {0};
    soup_add_random(&soup, rand, 120);
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    g_autoptr(GPtrArray) singles = g_ptr_array_new_with_free_func((GDestroyNotify)nc_terrain_free);
    for (size_t t = 0; t < soup.n; t++)
        g_ptr_array_add(singles, soup_terrain_of(&soup, t));
    for (int i = 0; i < 120; i++) {
        NcCutter cutter = cutters[(size_t)i % G_N_ELEMENTS(cutters)];
        double length = exp(g_rand_double_range(rand, log(0.05), log(10)));
        SegVec3 a = random_tip(rand, 10), b = seg_add(a, random_tip(rand, length));
        double expected = -INFINITY;
        for (guint t = 0; t < singles->len; t++)
            expected = fmax(expected, searched_gouge(singles->pdata[t], cutter, a, b));
        double found = gouge(terrain, cutter, a, b);
        if (expected == -INFINITY) /* a touch shorter than a sample step is still possible */
            continue;
        test_near(found, expected, 1e-7, 0);
        double coarse = nc_sweep_gouge_mm(terrain, cutter, a, b, 0.01);
        g_assert_cmpfloat(coarse, <=, found + fine);
        g_assert_cmpfloat(coarse, >=, found - 0.01 - fine);
        g_assert_false(nc_sweep_clear(terrain, cutter, a, b, found - 1e-6));
        g_assert_true(nc_sweep_clear(terrain, cutter, a, b, found + 1e-6));
    }
    soup_clear(&soup);
}

/* Short moves between drops, as a toolpath has them, and moves across the whole surface. */
static void test_waves(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(12);
    Soup soup = {0};
    soup_add_waves(&soup, rand, 100);
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    for (int i = 0; i < 300; i++) {
        NcCutter cutter = cutters[(size_t)i % G_N_ELEMENTS(cutters)];
        bool across = i % 10 == 0;
        double x = g_rand_double_range(rand, 5, 95), y = g_rand_double_range(rand, 5, 95);
        double reach = across ? 100 : 1;
        SegVec3 a = {x, y, across ? 1 : nc_drop(terrain, cutter, x, y, NULL, NULL)};
        x += g_rand_double_range(rand, -reach, reach);
        y += g_rand_double_range(rand, -reach, reach);
        SegVec3 b = {x, y, across ? 2 : nc_drop(terrain, cutter, x, y, NULL, NULL)};
        int deepest = 0;
        double sampled = sampled_gouge(terrain, cutter, a, b, &deepest);
        double found = gouge(terrain, cutter, a, b);
        g_assert_cmpfloat(found, >=, sampled - fine - 1e-9);
        /* between samples the drop height rises by less than its slope allows */
        g_assert_cmpfloat(found, <=, sampled + 3 * seg_distance(a, b) / SAMPLES + 1e-9);
    }
    soup_clear(&soup);
}

static void test_batch(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(13);
    Soup soup = {0};
    soup_add_waves(&soup, rand, 60);
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    size_t n = 3000;
    g_autofree SegVec3 *tips = g_new(SegVec3, n);
    g_autofree double *batch = g_new0(double, n);
    for (size_t i = 0; i < n; i++) {
        tips[i] = seg_vec3((double)(i % 300) * 0.3, (double)(i / 300) * 7, 0);
        tips[i].z = nc_drop(terrain, ball, tips[i].x, tips[i].y, NULL, NULL);
    }
    for (int threads = 1; threads <= 5; threads += 2) {
        omp_set_num_threads(threads);
        nc_sweep_gouge_batch(terrain, ball, n, tips, 1e-4, batch);
        int different = 0;
        for (size_t i = 0; i + 1 < n; i++)
            different += batch[i] != nc_sweep_gouge_mm(terrain, ball, tips[i], tips[i + 1], 1e-4);
        g_assert_cmpint(different, ==, 0);
    }
    nc_sweep_gouge_batch(terrain, ball, 0, NULL, 1e-4, NULL);
    nc_sweep_gouge_batch(terrain, ball, 1, tips, 1e-4, NULL);
    soup_clear(&soup);
}

static void test_nothing(void)
{
    g_autoptr(NcTerrain) empty = nc_terrain_new(NULL, 0, NULL, 0);
    SegVec3 a = {0, 0, 0}, b = {1, 2, 3};
    g_assert_cmpfloat(gouge(empty, ball, a, b), ==, -INFINITY);
    g_assert_true(nc_sweep_clear(empty, ball, a, b, -1e9));
    g_autoptr(NcTerrain) terrain = knife();
    g_assert_cmpfloat(gouge(terrain, (NcCutter){0, 0}, seg_vec3(0, 0, 1), seg_vec3(0, 0, 2)), ==,
                      4);
    g_assert_cmpfloat(gouge(terrain, ball, seg_vec3((double)NAN, 0, 0), b), ==, -INFINITY);
}

static void add(void)
{
    g_test_add_func("/nc/sweep/plane", test_plane);
    g_test_add_func("/nc/sweep/knife", test_knife);
    g_test_add_func("/nc/sweep/step", test_step);
    g_test_add_func("/nc/sweep/search", test_search);
    g_test_add_func("/nc/sweep/waves", test_waves);
    g_test_add_func("/nc/sweep/batch", test_batch);
    g_test_add_func("/nc/sweep/nothing", test_nothing);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
