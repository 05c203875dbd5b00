/* SPDX-License-Identifier: Apache-2.0 */
/* What is cut, against closed forms: slots, spheres, profiles, scallops of known height, arcs. */
#include "nc/stock/dexel.h"
#include "tests/lib/stock_case.h"
#include "tests/lib/test.h"

/* Of a depth along its ray, where the surface is not too steep to it. */
#define DEPTH_MM 2e-7

static NcStock *box(SegVec3 min, SegVec3 max, double pitch_mm)
{
    g_autoptr(GError) error = NULL;
    NcStock *stock = nc_stock_new_box(min, max, &(NcStockOptions){pitch_mm, 1 << 30}, &error);
    g_assert_no_error(error);
    return stock;
}

static void cut(TestProgram *program, NcStock *stock)
{
    g_autoptr(GArray) collisions = g_array_new(FALSE, FALSE, sizeof(NcCollision));
    g_autoptr(GError) error = NULL;
    g_assert_true(test_program_cut(program, stock, collisions, &error));
    g_assert_no_error(error);
    g_assert_cmpuint(collisions->len, ==, 0);
    test_program_end(program);
}

/* The last end of the Z ray (i, j), or NULL. */
static const NcDexelEnd *top_end(const NcStock *stock, int32_t i, int32_t j, SegVec3 *place)
{
    size_t n;
    const NcDexelEnd *ends = nc_dexel_ray(stock, 2, i, j, &n);
    if (n == 0)
        return NULL;
    *place = seg_vec3(nc_dexel_node_mm(stock, 0, i), nc_dexel_node_mm(stock, 1, j),
                      nc_dexel_mm(stock, 2, ends[n - 1].depth));
    return &ends[n - 1];
}

/* Length of all material on the rays of one axis, times a ray's share of the area. */
static double axis_volume(const NcStock *stock, int axis)
{
    double length = 0;
    size_t n;
    for (int32_t v = 0; v < stock->field[axis].n_rays[1]; v++)
        for (int32_t u = 0; u < stock->field[axis].n_rays[0]; u++) {
            const NcDexelEnd *ends = nc_dexel_ray(stock, axis, u, v, &n);
            for (size_t i = 0; i < n; i += 2)
                length += (ends[i + 1].depth - ends[i].depth) * stock->unit_mm;
        }
    return length * stock->pitch_mm * stock->pitch_mm;
}

/* A sum over rays misses what lies between the outermost ray and the face: at most the surface's
 * share of a pitch. */
static void check_volume(const NcStock *stock, double expected, double surface_mm2)
{
    for (int axis = 0; axis < 3; axis++)
        test_near(axis_volume(stock, axis), expected, surface_mm2 * stock->pitch_mm, 0);
}

static void test_flat_slot(void)
{
    g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -6), seg_vec3(20, 12, 0), 0.1);
    TestProgram program;
    if (!stock)
        return;
    check_volume(stock, 20 * 12 * 6, 2 * (20 * 12 + 20 * 6 + 12 * 6));
    test_program_begin(&program, 1, seg_vec3(-5, 6, -2));
    test_program_move(&program, NC_MOVE_FEED, seg_vec3(25, 6, -2));
    cut(&program, stock);
    check_volume(stock, 20 * 12 * 6 - 20 * 6 * 2, 2 * (20 * 12 + 20 * 6 + 12 * 6));
    int floor = 0, wall = 0;
    size_t n;
    for (int32_t i = 0; i < stock->n_nodes[0]; i++)
        for (int32_t j = 0; j < stock->n_nodes[1]; j++) {
            SegVec3 p = {0};
            const NcDexelEnd *end = top_end(stock, i, j, &p);
            bool in_slot = fabs(p.y - 6) < 3;
            if (!end || fabs(p.z - (in_slot ? -2 : 0)) > DEPTH_MM ||
                end->cut != (in_slot ? 1 : 0) || nc_dexel_normal(end).z < 1 - 1e-9)
                floor++;
        }
    for (int32_t k = 0; k < stock->n_nodes[2]; k++)
        for (int32_t i = 0; i < stock->n_nodes[0]; i++) {
            const NcDexelEnd *ends = nc_dexel_ray(stock, 1, k, i, &n);
            bool in_slot = nc_dexel_node_mm(stock, 2, k) > -2;
            if (n != (in_slot ? 4 : 2) ||
                (in_slot && (fabs(nc_dexel_mm(stock, 1, ends[1].depth) - 3) > DEPTH_MM ||
                             fabs(nc_dexel_mm(stock, 1, ends[2].depth) - 9) > DEPTH_MM ||
                             nc_dexel_normal(&ends[1]).y < 1 - 1e-9 ||
                             nc_dexel_normal(&ends[2]).y > -1 + 1e-9)))
                wall++;
        }
    g_assert_cmpint(floor, ==, 0);
    g_assert_cmpint(wall, ==, 0);
    g_assert_cmpuint(stock->cuts[1].line, ==, 1);
    g_assert_cmpint(stock->cuts[1].tool, ==, 1);
}

/* A ball pressed in leaves its sphere: on all three axes, with its normals. */
static void test_ball_sphere(void)
{
    g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -6), seg_vec3(10, 10, 0), 0.1);
    TestProgram program;
    SegVec3 centre = {5, 5, 0.5};
    if (!stock)
        return;
    test_program_begin(&program, 2, seg_vec3(5, 5, 5));
    test_program_move(&program, NC_MOVE_FEED, seg_vec3(5, 5, -2.5));
    cut(&program, stock);
    double cap = G_PI * 2.5 * 2.5 * (3 - 2.5 / 3);
    check_volume(stock, 600 - cap, 2 * 340);
    int seen = 0, wrong = 0;
    for (int axis = 0; axis < 3; axis++)
        for (int32_t v = 0; v < stock->field[axis].n_rays[1]; v++)
            for (int32_t u = 0; u < stock->field[axis].n_rays[0]; u++) {
                size_t n;
                const NcDexelEnd *ends = nc_dexel_ray(stock, axis, u, v, &n);
                SegVec3 origin = nc_dexel_origin(stock, axis, u, v);
                for (size_t i = 0; i < n; i++) {
                    SegVec3 p =
                        nc_dexel_point(axis, origin, nc_dexel_mm(stock, axis, ends[i].depth));
                    SegVec3 radial = seg_scale(seg_sub(centre, p), 1.0 / 3);
                    if (ends[i].cut == 0)
                        continue;
                    seen++;
                    wrong += fabs(seg_norm(radial) - 1) > DEPTH_MM ||
                             seg_distance(radial, nc_dexel_normal(&ends[i])) > 1e-4;
                }
            }
    g_assert_cmpint(wrong, ==, 0);
    g_assert_cmpint(seen, >, 4000);
}

/* Each kind of tool plunged 4 mm deep: the material ends on its drawing. */
static void test_profiles(void)
{
    for (int number = 1; number <= 6; number++) {
        g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -6), seg_vec3(12, 12, 0), 0.15);
        const CfgTool *tool = cfg_tools_find(&test_tools, number);
        TestProgram program;
        int wrong = 0, seen = 0;
        if (!stock)
            return;
        test_program_begin(&program, number, seg_vec3(6, 6, 1));
        test_program_move(&program, NC_MOVE_FEED, seg_vec3(6, 6, -4));
        cut(&program, stock);
        for (int32_t i = 0; i < stock->n_nodes[0]; i++)
            for (int32_t j = 0; j < stock->n_nodes[1]; j++) {
                SegVec3 p;
                const NcDexelEnd *end = top_end(stock, i, j, &p);
                double off = end ? hypot(p.x - 6, p.y - 6) : 0, level = test_drawn_radius(tool, 0);
                if (end && end->cut == 0) {
                    wrong += off < test_drawn_radius(tool, 4);
                } else {
                    seen++;
                    wrong +=
                        !end || (off < level ? fabs(p.z + 4) > DEPTH_MM
                                             : fabs(test_drawn_radius(tool, p.z + 4) - off) > 1e-5);
                }
            }
        g_assert_cmpint(wrong, ==, 0);
        g_assert_cmpint(seen, >, 40);
    }
}

/* Rows of a ball, step-over s: ridges of R - sqrt(R² - s²/4) half way between them. */
static void test_scallops(void)
{
    double s = 0.8, pitch = 0.02, height = 3 - sqrt(9 - s * s / 4);
    g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -1.5), seg_vec3(4, 4, 0), pitch);
    TestProgram program;
    int wrong = 0;
    double highest = -INFINITY;
    if (!stock)
        return;
    test_program_begin(&program, 2, seg_vec3(-4, -2 * s, -1));
    for (int row = -2; row <= 8; row++) {
        test_program_move(&program, NC_MOVE_FEED, seg_vec3(row % 2 ? 8 : -4, row * s, -1));
        test_program_move(&program, NC_MOVE_FEED, seg_vec3(row % 2 ? -4 : 8, row * s, -1));
    }
    cut(&program, stock);
    for (int32_t i = 0; i < stock->n_nodes[0]; i++)
        for (int32_t j = 0; j < stock->n_nodes[1]; j++) {
            SegVec3 p = {0};
            const NcDexelEnd *end = top_end(stock, i, j, &p);
            double off = p.y - s * round(p.y / s);
            wrong += !end || fabs(p.z - (2 - sqrt(9 - off * off))) > DEPTH_MM;
            highest = fmax(highest, p.z + 1);
        }
    g_assert_cmpint(wrong, ==, 0);
    /* A ray is at most half a pitch off the ridge, whose flanks rise by s/2 on R at most. */
    test_near(highest, height - pitch * s / 24, pitch * s / 24 + DEPTH_MM, 0);
}

/* A full circle with a flat tool leaves a ring; its walls are chords that lie within the stated
 * tolerance. */
static void test_ring(void)
{
    g_autoptr(NcStock) stock = box(seg_vec3(-15, -15, -3), seg_vec3(15, 15, 0), 0.25);
    TestProgram program;
    int wrong = 0, walls = 0;
    if (!stock)
        return;
    test_program_begin(&program, 1, seg_vec3(8, 0, 2));
    test_program_move(&program, NC_MOVE_FEED, seg_vec3(8, 0, -2));
    test_program_arc(&program, seg_vec3(8, 0, -2), seg_vec3(0, 0, -2), 17, 1);
    cut(&program, stock);
    for (int32_t k = 0; k < stock->n_nodes[2]; k++)
        for (int32_t j = 0; j < stock->n_nodes[1]; j++) {
            size_t n;
            const NcDexelEnd *ends = nc_dexel_ray(stock, 0, j, k, &n);
            double y = nc_dexel_node_mm(stock, 1, j);
            for (size_t i = 0; i < n; i++) {
                double r = hypot(nc_dexel_mm(stock, 0, ends[i].depth), y);
                if (ends[i].cut == 0)
                    continue;
                walls++;
                wrong += fmin(fabs(r - 5), fabs(r - 11)) > 1e-4 + DEPTH_MM;
            }
        }
    g_assert_cmpint(wrong, ==, 0);
    g_assert_cmpint(walls, >, 1000);
    double ring = G_PI * (11 * 11 - 5 * 5) * 2;
    test_near(nc_stock_volume_mm3(stock), 900 * 3 - ring, 10, 0);
}

/* A ball on a helix in each plane: no material nearer than its radius to the helix, and what is cut
 * lies just there. */
static void test_helix(int plane)
{
    g_autoptr(NcStock) stock = box(seg_vec3(-9, -9, -9), seg_vec3(9, 9, 9), 0.5);
    TestProgram program;
    int wrong = 0, seen = 0;
    int a = plane == 17 ? 0 : plane == 18 ? 2 : 1, b = (a + 1) % 3, c = (a + 2) % 3;
    double from[3], to[3], centre[3];
    if (!stock)
        return;
    from[a] = to[a] = 4;
    from[b] = to[b] = centre[a] = centre[b] = centre[c] = 0;
    from[c] = 3;
    to[c] = -1;
    SegVec3 down = {0, 0, -3}; /* the ball's centre goes where the helix is said to be */
    test_program_begin(&program, 2, seg_add(seg_vec3(from[0], from[1], from[2]), down));
    test_program_arc(&program, seg_add(seg_vec3(to[0], to[1], to[2]), down),
                     seg_add(seg_vec3(0, 0, 0), down), plane, 1);
    cut(&program, stock);
    for (int axis = 0; axis < 3; axis++)
        for (int32_t v = 0; v < stock->field[axis].n_rays[1]; v++)
            for (int32_t u = 0; u < stock->field[axis].n_rays[0]; u++) {
                size_t n;
                const NcDexelEnd *ends = nc_dexel_ray(stock, axis, u, v, &n);
                SegVec3 origin = nc_dexel_origin(stock, axis, u, v);
                for (size_t i = 0; i < n; i++) {
                    double best = INFINITY;
                    SegVec3 p =
                        nc_dexel_point(axis, origin, nc_dexel_mm(stock, axis, ends[i].depth));
                    /* Above the helix is the shaft: only the ball's own surface is judged. */
                    if (ends[i].cut == 0 || nc_dexel_normal(&ends[i]).z < 0.05)
                        continue;
                    for (int k = 0; k <= 2000; k++) {
                        double at[3], angle = 2 * G_PI * k / 2000;
                        at[a] = 4 * cos(angle);
                        at[b] = 4 * sin(angle);
                        at[c] = 3 - 4.0 * k / 2000;
                        best = fmin(best, seg_distance(p, seg_vec3(at[0], at[1], at[2])));
                    }
                    seen++;
                    wrong += fabs(best - 3) > 1.2e-4;
                }
            }
    g_assert_cmpint(wrong, ==, 0);
    g_assert_cmpint(seen, >, 500);
}

static void test_helices(void)
{
    test_helix(17);
    test_helix(18);
    test_helix(19);
}

/* A cylinder of material: its volume, and its wall on X and Y rays. */
static void test_cylinder(void)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(NcStock) stock =
        nc_stock_new_cylinder(seg_vec3(3, -2, -10), 12, 8, &(NcStockOptions){0.1, 1 << 30}, &error);
    int wrong = 0;
    g_assert_no_error(error);
    if (!stock)
        return;
    check_volume(stock, G_PI * 36 * 8, 2 * G_PI * 36 + G_PI * 12 * 8);
    for (int axis = 0; axis < 2; axis++)
        for (int32_t v = 0; v < stock->field[axis].n_rays[1]; v++)
            for (int32_t u = 0; u < stock->field[axis].n_rays[0]; u++) {
                size_t n;
                const NcDexelEnd *ends = nc_dexel_ray(stock, axis, u, v, &n);
                SegVec3 origin = nc_dexel_origin(stock, axis, u, v);
                for (size_t i = 0; i < n; i++) {
                    SegVec3 p =
                        nc_dexel_point(axis, origin, nc_dexel_mm(stock, axis, ends[i].depth));
                    wrong += fabs(hypot(p.x - 3, p.y + 2) - 6) > DEPTH_MM;
                }
            }
    g_assert_cmpint(wrong, ==, 0);
}

static void add(void)
{
    g_test_add_func("/nc/stock/cut/flat-slot", test_flat_slot);
    g_test_add_func("/nc/stock/cut/ball-sphere", test_ball_sphere);
    g_test_add_func("/nc/stock/cut/profiles", test_profiles);
    g_test_add_func("/nc/stock/cut/scallops", test_scallops);
    g_test_add_func("/nc/stock/cut/ring", test_ring);
    g_test_add_func("/nc/stock/cut/helices", test_helices);
    g_test_add_func("/nc/stock/cut/cylinder", test_cylinder);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
