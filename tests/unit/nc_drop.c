/* SPDX-License-Identifier: Apache-2.0 */
/* The drop-cutter against closed forms, against a search that knows no geometry, against itself
 * without the tree, and on real meshes. */
#include <omp.h>
#include <time.h>

#include "tests/lib/soup.h"
#include "tests/lib/test.h"

static const NcCutter flat = {3, 0}, ball = {3, 3}, bull = {3, 1};
static const NcCutter cutters[] = {{3, 0}, {3, 3}, {3, 1}, {2, 1.9}, {4, 0.05}, {0.5, 0.5}};

static double drop(const NcTerrain *terrain, NcCutter cutter, double x, double y)
{
    return nc_drop(terrain, cutter, x, y, NULL, NULL);
}

static void test_profile(void)
{
    CfgTool tool = {.kind = CFG_TOOL_BULL, .diameter_mm = 6, .corner_radius_mm = 1};
    NcCutter cutter = nc_cutter(&tool);
    g_assert_cmpfloat(cutter.radius_mm, ==, 3);
    g_assert_cmpfloat(cutter.corner_radius_mm, ==, 1);
    g_assert_cmpfloat(nc_cutter_height_mm(bull, 1.9), ==, 0);
    test_near(nc_cutter_height_mm(bull, 2.6), 0.2, 1e-15, 0);
    g_assert_cmpfloat(nc_cutter_height_mm(bull, 3), ==, 1);
    g_assert_cmpfloat(nc_cutter_height_mm(ball, 0), ==, 0);
    test_near(nc_cutter_height_mm(ball, 1.8), 0.6, 1e-15, 0);
    g_assert_cmpfloat(nc_cutter_height_mm(flat, 3), ==, 0);
    g_assert_true(isinf(nc_cutter_height_mm(flat, 3.0000001)));
    g_assert_true(isinf(nc_cutter_height_mm(ball, 3.0000001)));
}

/* ------------------------------------------------------------------ closed forms */

static void test_plane(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(2);
    for (int i = 0; i < 200; i++) {
        double gx = g_rand_double_range(rand, -5, 5), gy = g_rand_double_range(rand, -5, 5);
        if (i == 0)
            gx = gy = 0;
        Soup soup = {0};
        SegVec3 p[4];
        for (int k = 0; k < 4; k++) {
            double x = k % 2 ? 50 : -50, y = k / 2 ? 50 : -50;
            p[k] = seg_vec3(x, y, 7 + gx * x + gy * y);
        }
        soup_add(&soup, p[0], p[1], p[2]);
        soup_add(&soup, p[1], p[2], p[3]); /* the other way up: both sides are the same */
        g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
        double tangent = hypot(gx, gy), cosine = 1 / sqrt(1 + tangent * tangent);
        for (size_t c = 0; c < G_N_ELEMENTS(cutters); c++) {
            double x = g_rand_double_range(rand, -9, 9), y = g_rand_double_range(rand, -9, 9);
            double r = cutters[c].corner_radius_mm, a = cutters[c].radius_mm - r;
            double expected = 7 + gx * x + gy * y + a * tangent + r * (1 / cosine - 1);
            test_near(drop(terrain, cutters[c], x, y), expected, 1e-10, 0);
        }
        soup_clear(&soup);
    }
}

/* A triangle whose highest point, a vertex, lies d from the axis. */
static void test_vertex(void)
{
    Soup soup = {0};
    soup_add(&soup, seg_vec3(0, 0, 5), seg_vec3(0.01, 0, -900), seg_vec3(0, 0.01, -900));
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    for (double angle = 0; angle < 6.3; angle += 0.37) {
        for (double d = 0; d < 2.99; d += 0.13) {
            double x = d * cos(angle), y = d * sin(angle);
            for (size_t c = 0; c < 3; c++) {
                SegVec3 contact;
                double z = nc_drop(terrain, cutters[c], x, y, NULL, &contact);
                /* the sides are steep, not upright: the contact may lie a little below the tip */
                test_near(z, 5 - nc_cutter_height_mm(cutters[c], d), 1e-5 / (3 - d), 0);
                g_assert_cmpfloat(z, >=, 5 - nc_cutter_height_mm(cutters[c], d) - 1e-12);
                test_near(seg_distance(contact, seg_vec3(0, 0, 5)), 0, 1e-1, 0);
            }
        }
    }
    g_assert_true(isinf(drop(terrain, flat, 3.02, 0)));
    soup_clear(&soup);
}

/* The highest point of a bull-nosed cutter's contact with a line, by golden section. */
static double bull_on_line(NcCutter cutter, double aside, double slope)
{
    double chord = sqrt(cutter.radius_mm * cutter.radius_mm - aside * aside);
    double lo = -chord, hi = chord, golden = (sqrt(5) - 1) / 2;
    for (int i = 0; i < 100; i++) {
        double a = hi - golden * (hi - lo), b = lo + golden * (hi - lo);
        double fa = slope * a - nc_cutter_height_mm(cutter, hypot(aside, a));
        double fb = slope * b - nc_cutter_height_mm(cutter, hypot(aside, b));
        if (fa > fb)
            hi = b;
        else
            lo = a;
    }
    return slope * lo - nc_cutter_height_mm(cutter, hypot(aside, lo));
}

static void test_edge(void)
{
    static const double slopes[] = {0, 1e-9, 1e-3, 0.2, 1, 3, 40};
    for (size_t s = 0; s < G_N_ELEMENTS(slopes); s++) {
        double m = slopes[s];
        Soup soup = {0}; /* a wall: its upper edge runs along (0.6, 0.8) and rises by m */
        SegVec3 a = {-60, -80, -100 * m}, b = {60, 80, 100 * m}, below = {0, 0, -9000};
        soup_add(&soup, a, b, below);
        g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
        for (double aside = -2.9; aside < 3; aside += 0.1) {
            double x = -0.8 * aside + 0.6 * 11, y = 0.6 * aside + 0.8 * 11, at = 11 * m;
            double chord = sqrt(9 - aside * aside);
            double on_flat = at + m * chord, on_ball = at + chord * sqrt(1 + m * m) - 3;
            test_near(drop(terrain, flat, x, y), on_flat, 1e-10, 0);
            test_near(drop(terrain, ball, x, y), on_ball, 1e-10, 0);
            double on_bull = at + bull_on_line(bull, fabs(aside), m);
            test_near(drop(terrain, bull, x, y), on_bull, 1e-10, 0);
        }
        soup_clear(&soup);
    }
}

/* A sphere of radius S: the cutter's own torus rolls over it. The mesh lies inside the sphere by
 * less than the chord error, which counts 1/cos of the slope when measured along Z. */
static void test_sphere(void)
{
    const double S = 10;
    const int n = 90;
    Soup soup = {0};
    soup_add_sphere(&soup, S, n);
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    double chord = 1.3 * S * G_PI * G_PI / (n * n);
    for (size_t c = 0; c < G_N_ELEMENTS(cutters); c++) {
        double r = cutters[c].corner_radius_mm, a = cutters[c].radius_mm - r;
        for (double d = 0; d < a + 0.7 * (S + r); d += 0.0937) {
            double beyond = fmax(0, d - a);
            double expected = sqrt((S + r) * (S + r) - beyond * beyond) - r;
            double cosine = sqrt(1 - pow(beyond / (S + r), 2));
            double z = drop(terrain, cutters[c], d * cos(d), d * sin(d));
            g_assert_cmpfloat(z, <=, expected + 1e-12);
            g_assert_cmpfloat(z, >=, expected - chord / cosine);
        }
    }
    soup_clear(&soup);
}

/* A box from z = 0 to 4 with walls; the holder is a flat cutter too. */
static void test_box(void)
{
    Soup soup = {0};
    SegVec3 p[8];
    for (int k = 0; k < 8; k++)
        p[k] = seg_vec3(k & 1 ? 10 : 0, k & 2 ? 10 : 0, k & 4 ? 4 : 0);
    static const int quads[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                    {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
    for (int i = 0; i < 6; i++) {
        const int *q = quads[i];
        soup_add(&soup, p[q[0]], p[q[1]], p[q[2]]);
        soup_add(&soup, p[q[0]], p[q[2]], p[q[3]]);
    }
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    SegVec3 min, max;
    nc_terrain_bounds(terrain, &min, &max);
    g_assert_cmpfloat(min.z, ==, 0);
    g_assert_cmpfloat(max.x, ==, 10);
    for (double d = -5.03; d < 3.5; d += 0.1) { /* outside the wall x = 10 by d */
        for (size_t c = 0; c < 3; c++) {
            double h = nc_cutter_height_mm(cutters[c], fmax(d, 0));
            double z = drop(terrain, cutters[c], 10 + d, 5);
            if (isinf(h))
                g_assert_cmpfloat(z, ==, -INFINITY);
            else
                test_near(z, 4 - h, 1e-12, 0);
        }
    }
    g_assert_cmpfloat(drop(terrain, (NcCutter){20, 0}, 25, 5), ==, 4);
    g_assert_cmpfloat(drop(terrain, (NcCutter){0, 0}, 5.5, 5), ==, 4);
    soup_clear(&soup);
}

static void test_nothing(void)
{
    g_autoptr(NcTerrain) empty = nc_terrain_new(NULL, 0, NULL, 0);
    int32_t triangle = 0;
    g_assert_cmpfloat(nc_drop(empty, ball, 0, 0, &triangle, NULL), ==, -INFINITY);
    g_assert_cmpint(triangle, ==, -1);
    Soup soup = {0};
    soup_add(&soup, seg_vec3(1, 2, 3), seg_vec3(1, 2, 3), seg_vec3(1, 2, 3));
    g_autoptr(NcTerrain) point = soup_terrain(&soup);
    g_assert_cmpfloat(drop(point, ball, 1, 2), ==, 3);
    g_assert_cmpfloat(drop(point, ball, 1, 5.1), ==, -INFINITY);
    g_assert_cmpfloat(drop(point, ball, 1e300, -1e300), ==, -INFINITY);
    g_assert_cmpfloat(drop(point, ball, (double)NAN, 0), ==, -INFINITY);
    g_assert_cmpfloat(drop(point, ball, INFINITY, 0), ==, -INFINITY);
    soup_clear(&soup);
}

/* ------------------------------------------------------- a search without geometry */

/* p.z - h(|p - c|), continued steeply beyond the radius so that a search finds its way. */
static double lift(NcCutter cutter, double x, double y, SegVec3 p)
{
    double d = hypot(p.x - x, p.y - y), beyond = d - cutter.radius_mm;
    return beyond <= 0 ? p.z - nc_cutter_height_mm(cutter, d)
                       : p.z - cutter.corner_radius_mm - 1e7 * beyond;
}

/* The greatest lift on the segment (golden section: it is concave there). */
static double search_segment(NcCutter cutter, double x, double y, SegVec3 a, SegVec3 b)
{
    const double golden = (sqrt(5) - 1) / 2;
    double lo = 0, hi = 1, s = 1 - golden, t = golden;
    double fs = lift(cutter, x, y, seg_lerp(a, b, s)), ft = lift(cutter, x, y, seg_lerp(a, b, t));
    for (int i = 0; i < 75; i++) {
        if (fs > ft) {
            hi = t, t = s, ft = fs, s = hi - golden * (hi - lo);
            fs = lift(cutter, x, y, seg_lerp(a, b, s));
        } else {
            lo = s, s = t, fs = ft, t = lo + golden * (hi - lo);
            ft = lift(cutter, x, y, seg_lerp(a, b, t));
        }
    }
    double ends = fmax(lift(cutter, x, y, a), lift(cutter, x, y, b));
    return fmax(fmax(fs, ft), ends);
}

/* The greatest lift on the triangle: of all segments between two of its sides, again concave. */
static double search_triangle(NcCutter cutter, double x, double y, const SegVec3 v[3])
{
    const double golden = (sqrt(5) - 1) / 2;
    double lo = 0, hi = 1, best = -INFINITY;
    for (int i = 0; i < 75; i++) {
        double s = hi - golden * (hi - lo), t = lo + golden * (hi - lo);
        double fs = search_segment(cutter, x, y, seg_lerp(v[0], v[1], s), seg_lerp(v[0], v[2], s));
        double ft = search_segment(cutter, x, y, seg_lerp(v[0], v[1], t), seg_lerp(v[0], v[2], t));
        best = fmax(best, fmax(fs, ft));
        if (fs > ft)
            hi = t;
        else
            lo = s;
    }
    return fmax(best, search_segment(cutter, x, y, v[1], v[2]));
}

static bool out_of_reach(NcCutter cutter, double x, double y, const SegVec3 v[3])
{
    double min_x = fmin(v[0].x, fmin(v[1].x, v[2].x)), max_x = fmax(v[0].x, fmax(v[1].x, v[2].x));
    double min_y = fmin(v[0].y, fmin(v[1].y, v[2].y)), max_y = fmax(v[0].y, fmax(v[1].y, v[2].y));
    double R = cutter.radius_mm;
    return min_x > x + R || max_x < x - R || min_y > y + R || max_y < y - R;
}

/* Random triangles, one by one: the drop equals what the search finds, and the contact is a point
 * of the triangle at which the cutter stands at that height. */
static void test_search(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(3);
    Soup soup = {0};
    soup_add_random(&soup, rand, 300);
    for (size_t i = 0; i < soup.n; i++) {
        g_autoptr(NcTerrain) terrain = soup_terrain_of(&soup, i);
        const SegVec3 *v = soup.triangles[i];
        for (size_t c = 0; c < G_N_ELEMENTS(cutters); c++) {
            NcCutter cutter = cutters[c];
            SegVec3 inside =
                seg_lerp(v[0], seg_lerp(v[1], v[2], g_rand_double(rand)), g_rand_double(rand));
            double x = inside.x + cutter.radius_mm * g_rand_double_range(rand, -0.9, 0.9);
            double y = inside.y + cutter.radius_mm * g_rand_double_range(rand, -0.9, 0.9);
            double expected = search_triangle(cutter, x, y, v);
            SegVec3 contact = {0, 0, 0};
            double z = nc_drop(terrain, cutter, x, y, NULL, &contact);
            if (isinf(z)) {
                g_assert_cmpfloat(expected, <, -100);
                continue;
            }
            test_near(z, expected, 2e-9, 0);
            double d = fmin(hypot(contact.x - x, contact.y - y), cutter.radius_mm);
            test_near(contact.z - nc_cutter_height_mm(cutter, d), z, 1e-7, 0);
        }
    }
    soup_clear(&soup);
}

/* No sample of any triangle stands out of the cutter; with the tree, over all triangles. */
static void test_samples(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(4);
    Soup soup = {0};
    soup_add_random(&soup, rand, 150);
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    const int steps = 40;
    for (int i = 0; i < 60; i++) {
        NcCutter cutter = cutters[(size_t)i % G_N_ELEMENTS(cutters)];
        double x = g_rand_double_range(rand, -9, 9), y = g_rand_double_range(rand, -9, 9);
        double z = drop(terrain, cutter, x, y), sampled = -INFINITY;
        for (size_t t = 0; t < soup.n; t++) {
            const SegVec3 *v = soup.triangles[t];
            if (out_of_reach(cutter, x, y, v))
                continue;
            for (int j = 0; j <= steps; j++) {
                for (int k = 0; j + k <= steps; k++) {
                    SegVec3 p = seg_along(seg_lerp(v[0], v[1], (double)j / steps),
                                          seg_sub(v[2], v[0]), (double)k / steps);
                    double h = nc_cutter_height_mm(cutter, hypot(p.x - x, p.y - y));
                    sampled = fmax(sampled, p.z - h);
                }
            }
        }
        g_assert_cmpfloat(z, >=, sampled - 1e-9);
    }
    soup_clear(&soup);
}

/* ------------------------------------------------------------------------ the tree */

/* Every digit is that of the highest drop on any one triangle, and that triangle is named. */
static void same_as_one_by_one(const Soup *soup, GRand *rand, int n)
{
    g_autoptr(NcTerrain) terrain = soup_terrain(soup);
    g_autoptr(GPtrArray) singles = g_ptr_array_new_with_free_func((GDestroyNotify)nc_terrain_free);
    for (size_t t = 0; t < soup->n; t++)
        g_ptr_array_add(singles, soup_terrain_of(soup, t));
    SegVec3 min, max;
    nc_terrain_bounds(terrain, &min, &max);
    double size = fmax(max.x - min.x, max.y - min.y);
    for (int i = 0; i < n; i++) {
        double R = size * exp(g_rand_double_range(rand, log(0.005), log(0.5)));
        double r[] = {0, R, R * g_rand_double(rand)};
        NcCutter cutter = {R, r[i % 3]};
        double x = g_rand_double_range(rand, min.x - R, max.x + R);
        double y = g_rand_double_range(rand, min.y - R, max.y + R);
        if (i % 5 == 0) { /* over a vertex, where ties are */
            SegVec3 *v = soup->triangles[g_rand_int_range(rand, 0, (int)soup->n)];
            x = v[0].x, y = v[0].y;
        }
        double best = -INFINITY;
        for (size_t t = 0; t < soup->n; t++)
            best = fmax(best, drop(singles->pdata[t], cutter, x, y));
        int32_t triangle;
        double z = nc_drop(terrain, cutter, x, y, &triangle, NULL);
        g_assert_cmpfloat(z, ==, best);
        g_assert_true((triangle < 0) == (z == -INFINITY));
        if (triangle >= 0)
            g_assert_cmpfloat(drop(singles->pdata[triangle], cutter, x, y), ==, z);
    }
}

static void test_tree(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(5);
    static const size_t sizes[] = {1, 2, 8, 9, 63, 65, 700};
    for (size_t i = 0; i < G_N_ELEMENTS(sizes); i++) {
        Soup soup = {0};
        soup_add_random(&soup, rand, sizes[i]);
        same_as_one_by_one(&soup, rand, 300);
        soup_clear(&soup);
    }
    Soup waves = {0};
    soup_add_waves(&waves, rand, 40);
    same_as_one_by_one(&waves, rand, 300);
    soup_clear(&waves);
    Soup sphere = {0};
    soup_add_sphere(&sphere, 5, 24);
    same_as_one_by_one(&sphere, rand, 300);
    soup_clear(&sphere);
}

static void test_batch(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(6);
    Soup soup = {0};
    soup_add_waves(&soup, rand, 60);
    soup_add_random(&soup, rand, 200);
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    size_t n = 20000;
    g_autofree double *x = g_new(double, n), *y = g_new(double, n), *z = g_new(double, n);
    g_autofree int32_t *triangle = g_new(int32_t, n);
    g_autofree SegVec3 *contact = g_new0(SegVec3, n);
    for (size_t i = 0; i < n; i++) { /* passes, then anywhere */
        bool raster = i < n / 2;
        x[i] = raster ? (double)(i % 1000) * 0.1 : g_rand_double_range(rand, -5, 105);
        y[i] = raster ? (double)(i / 1000) * 0.3 : g_rand_double_range(rand, -5, 105);
    }
    for (size_t c = 0; c < 3; c++) {
        for (int threads = 1; threads <= 5; threads += 2) {
            omp_set_num_threads(threads);
            nc_drop_batch(terrain, cutters[c], n, x, y, z, triangle, contact);
            int different = 0;
            for (size_t i = 0; i < n; i++) {
                SegVec3 p = {0, 0, 0};
                int32_t t;
                double alone = nc_drop(terrain, cutters[c], x[i], y[i], &t, &p);
                different += alone != z[i] || t != triangle[i] || p.x != contact[i].x ||
                             p.y != contact[i].y || p.z != contact[i].z;
            }
            g_assert_cmpint(different, ==, 0);
        }
    }
    nc_drop_batch(terrain, ball, 0, NULL, NULL, NULL, NULL, NULL);
    soup_clear(&soup);
}

static double processor_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* A tenth of what the bench has for its goal. */
static void test_speed(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(1);
    Soup soup = {0};
    soup_add_waves(&soup, rand, 200);
    g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
    size_t n = 20000;
    g_autofree double *x = g_new(double, n), *y = g_new(double, n), *z = g_new(double, n);
    for (size_t i = 0; i < n; i++) {
        x[i] = (double)(i % 1000) * 0.1;
        y[i] = (double)(i / 1000) * 5;
    }
    omp_set_num_threads(1);
    double best = INFINITY;
    for (int run = 0; run < 5; run++) {
        double start = processor_s();
        nc_drop_batch(terrain, ball, n, x, y, z, NULL, NULL);
        best = fmin(best, processor_s() - start);
    }
    g_test_message("%.0f locations/s", (double)n / best);
    g_assert_cmpfloat((double)n / best, >, 50000);
    soup_clear(&soup);
}

/* Real meshes: walls, undercuts, needles, thousands of facets on one plane. */
static void test_meshes(void)
{
    static const char *const suffixes[] = {".stl", ".off", NULL};
    g_autoptr(GPtrArray) files = test_data_files("mesh", suffixes);
    g_autoptr(GRand) rand = g_rand_new_with_seed(7);
    for (guint i = 0; i < files->len; i++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(SegPart) part = seg_part_load(files->pdata[i], NULL, &error);
        if (!part) {
            g_test_message("%s", error->message);
            continue;
        }
        g_test_message("%s: %d triangles", part->path, part->n_triangles);
        Soup soup = {0};
        for (int32_t t = 0; t < part->n_triangles; t++) {
            const int32_t *v = part->triangles[t].vertex;
            soup_add(&soup, part->vertices[v[0]].position, part->vertices[v[1]].position,
                     part->vertices[v[2]].position);
        }
        same_as_one_by_one(&soup, rand, 150);
        soup_clear(&soup);
    }
}

static void add(void)
{
    g_test_add_func("/nc/drop/profile", test_profile);
    g_test_add_func("/nc/drop/plane", test_plane);
    g_test_add_func("/nc/drop/vertex", test_vertex);
    g_test_add_func("/nc/drop/edge", test_edge);
    g_test_add_func("/nc/drop/sphere", test_sphere);
    g_test_add_func("/nc/drop/box", test_box);
    g_test_add_func("/nc/drop/nothing", test_nothing);
    g_test_add_func("/nc/drop/search", test_search);
    g_test_add_func("/nc/drop/samples", test_samples);
    g_test_add_func("/nc/drop/tree", test_tree);
    g_test_add_func("/nc/drop/batch", test_batch);
    g_test_add_func("/nc/drop/meshes", test_meshes);
    g_test_add_func("/nc/drop/speed", test_speed);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
