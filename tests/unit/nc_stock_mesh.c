/* SPDX-License-Identifier: Apache-2.0 */
/* The in-process model: closed, manifold, outward and sharp, whatever was cut. */
#include <omp.h>
#include <string.h>

#include "nc/nc.h"
#include "nc/stock/fill.h"
#include "tests/lib/mesh_check.h"
#include "tests/lib/test.h"

/* ------------------------------------------------------------- any way through the grid */

static bool node_in(const bool *in, const NcStock *stock, const int32_t node[3])
{
    for (int d = 0; d < 3; d++)
        if (node[d] < 0 || node[d] >= stock->n_nodes[d])
            return false;
    return in[(node[0] * stock->n_nodes[1] + node[1]) * stock->n_nodes[2] + node[2]];
}

static NcDexelEnd random_end(GRand *random, const NcStock *stock, int axis, int32_t node, bool into)
{
    const int32_t one = 1 << stock->shift;
    double n[3];
    for (int d = 0; d < 3; d++)
        n[d] = g_rand_double_range(random, -1, 1);
    n[axis] = into ? -fabs(n[axis]) : fabs(n[axis]);
    NcDexelEnd end = {0};
    int32_t along = g_rand_int_range(random, 1, one);
    switch (g_rand_int_range(random, 0, 4)) { /* at the nodes too */
    case 0:
        along = 1;
        break;
    case 1:
        along = one - 1;
        break;
    }
    end.depth = node * one + along;
    nc_dexel_set_normal(&end, seg_unit(seg_vec3(n[0], n[1], n[2])));
    return end;
}

/* A stock whose nodes are in or out at random, with crossings and normals at random. */
static NcStock *random_stock(GRand *random, double share)
{
    const NcStockOptions options = {1, 1ull << 30};
    NcStock *stock = nc_stock_alloc(seg_vec3(0, 0, 0), seg_vec3(12, 10, 9), &options, NULL);
    const size_t n =
        (size_t)stock->n_nodes[0] * (size_t)stock->n_nodes[1] * (size_t)stock->n_nodes[2];
    g_autofree bool *in = g_new(bool, n);
    for (size_t i = 0; i < n; i++)
        in[i] = g_rand_double(random) < share;
    for (int axis = 0; axis < 3; axis++) {
        NcFill fill;
        for (nc_fill_begin(&fill, stock, axis); nc_fill_next(&fill);) {
            NcDexelEnd begun = {0};
            int32_t node[3];
            node[(axis + 1) % 3] = fill.u;
            node[(axis + 2) % 3] = fill.v;
            for (int32_t i = 0; i <= stock->n_nodes[axis]; i++) {
                node[axis] = i - 1;
                const bool before = node_in(in, stock, node);
                node[axis] = i;
                const bool now = node_in(in, stock, node);
                if (now && !before)
                    begun = random_end(random, stock, axis, i - 1, true);
                else if (before && !now)
                    nc_fill_segment(&fill, begun, random_end(random, stock, axis, i - 1, false));
            }
        }
    }
    return stock;
}

static void random_nodes(void)
{
    GRand *random = g_rand_new_with_seed(1);
    for (int i = 0; i < 60; i++) {
        g_autoptr(NcStock) stock = random_stock(random, 0.1 + 0.8 * (i % 9) / 8);
        g_autoptr(NcMesh) mesh = nc_stock_mesh(stock);
        test_mesh_is_solid(mesh);
        if (g_test_failed())
            break;
    }
    g_rand_free(random);
}

/* ------------------------------------------------------------------- cuts with known ends */

static CfgTool the_tools[] = {
    {.number = 1, .kind = CFG_TOOL_FLAT, .diameter_mm = 6, .flute_length_mm = 60},
    {.number = 2,
     .kind = CFG_TOOL_BALL,
     .diameter_mm = 6,
     .corner_radius_mm = 3,
     .flute_length_mm = 60},
    {.number = 3,
     .kind = CFG_TOOL_BULL,
     .diameter_mm = 8,
     .corner_radius_mm = 1.5,
     .flute_length_mm = 60},
    {.number = 4,
     .kind = CFG_TOOL_DRILL,
     .diameter_mm = 4,
     .tip_angle_deg = 118,
     .flute_length_mm = 60},
};

/* The tip goes straight from a to b. */
static NcMove move_to(int tool, uint32_t line, SegVec3 a, SegVec3 b)
{
    return (NcMove){.kind = NC_MOVE_FEED,
                    .line = line,
                    .tool = tool,
                    .work_offset = 54,
                    .from = a,
                    .to = b,
                    .feed_mm_min = 1000,
                    .spindle_rpm = 8000};
}

static void cut(NcStock *stock, const NcMove *moves, size_t n)
{
    for (size_t i = 0; i < G_N_ELEMENTS(the_tools); i++) {
        the_tools[i].shank_diameter_mm = the_tools[i].diameter_mm;
        the_tools[i].stickout_mm = 80;
        the_tools[i].holder_diameter_mm = 40;
        the_tools[i].flutes = 2;
    }
    const CfgToolTable tools = {the_tools, G_N_ELEMENTS(the_tools)};
    g_autoptr(GError) error = NULL;
    nc_stock_cut(stock, moves, n, seg_vec3(0, 0, 0), &tools, NULL, &error);
    g_assert_no_error(error);
}

static NcStock *box(SegVec3 min, SegVec3 max, double pitch_mm)
{
    const NcStockOptions options = {pitch_mm, 1ull << 30};
    g_autoptr(GError) error = NULL;
    NcStock *stock = nc_stock_new_box(min, max, &options, &error);
    g_assert_no_error(error);
    return stock;
}

/* Closed and so on; and its volume within what rays at this pitch can tell. */
static NcMesh *mesh_of(const NcStock *stock, double pitch_mm)
{
    NcMesh *mesh = nc_stock_mesh(stock);
    double area = 0;
    for (size_t t = 0; t < mesh->n_triangles; t++) {
        const int32_t *v = mesh->triangles[t].vertex;
        const SegVec3 a = mesh->vertices[v[0]];
        area += seg_norm(
                    seg_cross(seg_sub(mesh->vertices[v[1]], a), seg_sub(mesh->vertices[v[2]], a))) /
                2;
    }
    test_mesh_is_solid(mesh);
    test_near(test_mesh_volume_mm3(mesh), nc_stock_volume_mm3(stock), area * pitch_mm / 2, 0);
    return mesh;
}

/* Distance from a body, negative inside; exact near its faces, edges and corners. */
typedef double Distance(SegVec3 p);

static double max3(double a, double b, double c)
{
    return fmax(a, fmax(b, c));
}

static double box_distance(SegVec3 p, SegVec3 min, SegVec3 max)
{
    return max3(fmax(min.x - p.x, p.x - max.x), fmax(min.y - p.y, p.y - max.y),
                fmax(min.z - p.z, p.z - max.z));
}

/* Every corner of every triangle, the middles of its sides and its own lie on the body: across a
 * sharp edge that holds only where the edge itself is in the mesh. */
static double worst_distance(const NcMesh *mesh, Distance *distance)
{
    double worst = 0;
    for (size_t t = 0; t < mesh->n_triangles; t++) {
        const int32_t *v = mesh->triangles[t].vertex;
        const SegVec3 c[3] = {mesh->vertices[v[0]], mesh->vertices[v[1]], mesh->vertices[v[2]]};
        const SegVec3 middle = seg_scale(seg_add(c[0], seg_add(c[1], c[2])), 1.0 / 3);
        worst = fmax(worst, fabs(distance(middle)));
        for (int i = 0; i < 3; i++) {
            worst = fmax(worst, fabs(distance(c[i])));
            worst = fmax(worst, fabs(distance(seg_lerp(c[i], c[(i + 1) % 3], 0.5))));
        }
    }
    return worst;
}

static double brick(SegVec3 p)
{
    return box_distance(p, seg_vec3(-1, 2, -3), seg_vec3(7.3, 9.1, 0));
}

static void box_is_sharp(void)
{
    const double pitch = 0.25;
    g_autoptr(NcStock) stock = box(seg_vec3(-1, 2, -3), seg_vec3(7.3, 9.1, 0), pitch);
    g_autoptr(NcMesh) mesh = mesh_of(stock, pitch);
    g_assert_cmpfloat(worst_distance(mesh, brick), <, 1e-3 * pitch);
    test_near(test_mesh_volume_mm3(mesh), 8.3 * 7.1 * 3, 0.1 * pitch * 1e-3 * 210, 0);
    g_assert_cmpuint(test_mesh_shells(mesh), ==, 1);
    for (size_t t = 0; t < mesh->n_triangles; t++)
        g_assert_cmpint(mesh->triangles[t].tool + (int)mesh->triangles[t].last_line, ==, 0);
}

/* A step, a slot through it and a pocket whose walls stand, cut by flat tools along the axes: all
 * faces plane but the pocket's round ends. */
static double stepped(SegVec3 p)
{
    const double d = box_distance(p, seg_vec3(0, 0, -10), seg_vec3(30, 20, 0));
    const double slot = box_distance(p, seg_vec3(-9, 7, -2.5), seg_vec3(99, 13, 9));
    const double step = box_distance(p, seg_vec3(17, -99, -5), seg_vec3(99, 99, 9));
    return max3(d, -slot, -step);
}

static void pockets_are_sharp(void)
{
    const double pitch = 0.3;
    g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -10), seg_vec3(30, 20, 0), pitch);
    const NcMove moves[] = {
        move_to(1, 10, seg_vec3(-5, 10, -2.5), seg_vec3(40, 10, -2.5)),
        move_to(1, 11, seg_vec3(20, -5, -5), seg_vec3(20, 30, -5)),
        move_to(1, 12, seg_vec3(25, 30, -5), seg_vec3(25, -5, -5)),
        move_to(1, 13, seg_vec3(30, -5, -5), seg_vec3(30, 30, -5)),
    };
    cut(stock, moves, G_N_ELEMENTS(moves));
    g_autoptr(NcMesh) mesh = mesh_of(stock, pitch);
    g_assert_cmpfloat(worst_distance(mesh, stepped), <, 1e-3 * pitch);
    test_near(test_mesh_volume_mm3(mesh), 30 * 20 * 10 - 13 * 20 * 5 - 17 * 6 * 2.5, 0.05, 0);
    for (size_t t = 0; t < mesh->n_triangles; t++) {
        const NcMeshTriangle *made = &mesh->triangles[t];
        const int32_t *v = made->vertex;
        const SegVec3 p = seg_scale(
            seg_add(mesh->vertices[v[0]], seg_add(mesh->vertices[v[1]], mesh->vertices[v[2]])),
            1.0 / 3);
        const bool raw =
            p.z < -5.01 || p.z > -0.01 || p.x < 0.01 || p.x > 29.99 || p.y < 0.01 || p.y > 19.99;
        g_assert_cmpint(made->tool, ==, raw ? 0 : 1);
        if (fabs(p.x - 17) < 2 * pitch)
            continue; /* the slot runs into the step: blocks of both are around */
        g_assert_cmpuint(made->first_line, >=, raw ? 0 : p.x < 17 ? 10 : 11);
        g_assert_cmpuint(made->last_line, <=, raw ? 0 : p.x < 17 ? 10 : 13);
    }
}

static double plunged(SegVec3 p)
{
    const double d = box_distance(p, seg_vec3(-10, -10, -10), seg_vec3(10, 10, 0));
    return fmax(d, 3 - seg_distance(p, seg_vec3(1, 2, 1)));
}

/* A ball leaves a cap: the vertices lie within pitch²/(2R) of it, the rim is sharp. */
static void ball_pocket(void)
{
    const double pitch = 0.2, h = 2;
    g_autoptr(NcStock) stock = box(seg_vec3(-10, -10, -10), seg_vec3(10, 10, 0), pitch);
    const NcMove plunge = move_to(2, 1, seg_vec3(1, 2, 8), seg_vec3(1, 2, -h));
    cut(stock, &plunge, 1);
    g_autoptr(NcMesh) mesh = mesh_of(stock, pitch);
    g_assert_cmpfloat(worst_distance(mesh, plunged), <, pitch * pitch / 6);
    test_near(test_mesh_volume_mm3(mesh), 4000 - G_PI * h * h * (9 - h) / 3, 0, 2e-5);
}

static void cylinder(void)
{
    const double pitch = 0.2;
    const NcStockOptions options = {pitch, 1ull << 30};
    g_autoptr(NcStock) stock = nc_stock_new_cylinder(seg_vec3(3, -4, -12), 15, 12, &options, NULL);
    g_autoptr(NcMesh) mesh = mesh_of(stock, pitch);
    test_near(test_mesh_volume_mm3(mesh), G_PI * 7.5 * 7.5 * 12, 0, 1e-4);
    for (size_t v = 0; v < mesh->n_vertices; v++) {
        const SegVec3 p = mesh->vertices[v];
        const double d = max3(hypot(p.x - 3, p.y + 4) - 7.5, -12 - p.z, p.z);
        g_assert_cmpfloat(fabs(d), <, pitch * pitch / 15);
    }
}

/* Rows of a ball: the crests stand at R - √(R² - s²/4), and are in the mesh. */
static void scallops(void)
{
    const double pitch = 0.1, step = 1, depth = 1;
    g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -5), seg_vec3(6, 12, 0), pitch);
    NcMove rows[15];
    for (size_t i = 0; i < G_N_ELEMENTS(rows); i++) {
        const double y = (double)i * step - 1;
        rows[i] = move_to(2, (uint32_t)i, seg_vec3(-9, y, -depth), seg_vec3(15, y, -depth));
    }
    cut(stock, rows, G_N_ELEMENTS(rows));
    g_autoptr(NcMesh) mesh = mesh_of(stock, pitch);
    const double height = 3 - sqrt(9 - step * step / 4);
    for (int crest = 1; crest < 10; crest++) {
        double top = -9;
        for (size_t v = 0; v < mesh->n_vertices; v++) {
            const SegVec3 p = mesh->vertices[v];
            if (fabs(p.y - (crest + 0.5)) < pitch && p.x > 1 && p.x < 5)
                top = fmax(top, p.z + depth);
        }
        test_near(top, height, 0, 0.02);
    }
}

/* ------------------------------------------------------------------------ nasty ones */

static SegVec3 random_point(GRand *random)
{
    const double step = g_rand_boolean(random) ? 1 : 0.01; /* often in line with others */
    return seg_vec3(step * rint(g_rand_double_range(random, -4, 24) / step),
                    step * rint(g_rand_double_range(random, -4, 20) / step),
                    step * rint(g_rand_double_range(random, -7, 3) / step));
}

static void random_cuts(void)
{
    const double pitch = 0.4;
    GRand *random = g_rand_new_with_seed(3);
    for (int run = 0; run < 6 && !g_test_failed(); run++) {
        g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -8), seg_vec3(20, 16, 0), pitch);
        for (int i = 0; i < 60; i++) {
            const NcMove move = move_to(g_rand_int_range(random, 1, 5), (uint32_t)i + 1,
                                        random_point(random), random_point(random));
            cut(stock, &move, 1);
        }
        nc_mesh_free(mesh_of(stock, pitch));
    }
    g_rand_free(random);
}

/* Cuts that meet: side by side, coplanar, walls of any thickness down to none. */
static void thin_walls(void)
{
    const double pitch = 0.2;
    const double walls[] = {0, 1e-12, 1e-9, 1e-6, 1e-4, 0.01, 0.1, 0.19, 0.2, 0.21, 0.5};
    for (size_t i = 0; i < G_N_ELEMENTS(walls); i++) {
        g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -6), seg_vec3(16, 16, 0), pitch);
        const double y = 5 + 6 + walls[i];
        const NcMove moves[] = {
            move_to(1, 1, seg_vec3(-9, 5, -4), seg_vec3(25, 5, -4)),
            move_to(1, 2, seg_vec3(-9, y, -4), seg_vec3(25, y, -4)),
            move_to(1, 3, seg_vec3(5, -9, -4 - walls[i]), seg_vec3(5, 25, -4 - walls[i])),
            move_to(1, 4, seg_vec3(12, 12, 9), seg_vec3(12, 12, -6 + walls[i])),
        };
        cut(stock, moves, G_N_ELEMENTS(moves));
        nc_mesh_free(mesh_of(stock, pitch));
    }
}

static void same_with_any_threads(void)
{
    const double pitch = 0.4;
    NcMesh *mesh[2];
    for (int run = 0; run < 2; run++) {
        g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -8), seg_vec3(20, 16, 0), pitch);
        const NcMove move = move_to(2, 1, seg_vec3(-5, 3, -1), seg_vec3(25, 11, -6));
        cut(stock, &move, 1);
        omp_set_num_threads(run == 0 ? 1 : 3);
        mesh[run] = nc_stock_mesh(stock);
    }
    g_assert_cmpuint(mesh[0]->n_vertices, ==, mesh[1]->n_vertices);
    g_assert_cmpuint(mesh[0]->n_triangles, ==, mesh[1]->n_triangles);
    if (!g_test_failed()) {
        g_assert_cmpint(
            memcmp(mesh[0]->vertices, mesh[1]->vertices, mesh[0]->n_vertices * sizeof(SegVec3)), ==,
            0);
        g_assert_cmpint(memcmp(mesh[0]->triangles, mesh[1]->triangles,
                               mesh[0]->n_triangles * sizeof(NcMeshTriangle)),
                        ==, 0);
    }
    nc_mesh_free(mesh[0]);
    nc_mesh_free(mesh[1]);
}

static void through_and_apart(void)
{
    const double pitch = 0.25;
    g_autoptr(NcStock) stock = box(seg_vec3(0, 0, -6), seg_vec3(30, 16, 0), pitch);
    const NcMove drill = move_to(4, 1, seg_vec3(8, 8, 5), seg_vec3(8, 8, -9));
    cut(stock, &drill, 1);
    g_autoptr(NcMesh) holed = mesh_of(stock, pitch);
    g_assert_cmpuint(test_mesh_shells(holed), ==, 1);
    test_near(test_mesh_volume_mm3(holed), 30 * 16 * 6 - G_PI * 4 * 6, 0.2, 0);
    /* A torus: its vertices, edges and faces add up to 0. */
    g_assert_cmpint((int)holed->n_vertices - (int)holed->n_triangles / 2, ==, 0);

    const NcMove saw = move_to(1, 2, seg_vec3(20, -9, -6), seg_vec3(20, 25, -6));
    cut(stock, &saw, 1);
    g_autoptr(NcMesh) apart = mesh_of(stock, pitch);
    g_assert_cmpuint(test_mesh_shells(apart), ==, 2);

    NcMove all[8];
    for (size_t i = 0; i < G_N_ELEMENTS(all); i++) {
        const double y = 2.5 * (double)i - 1;
        all[i] = move_to(1, 3, seg_vec3(-9, y, -7), seg_vec3(40, y, -7));
    }
    cut(stock, all, G_N_ELEMENTS(all));
    g_autoptr(NcMesh) nothing = nc_stock_mesh(stock);
    g_assert_cmpuint(nothing->n_triangles + nothing->n_vertices, ==, 0);
}

static void add(void)
{
    g_test_add_func("/nc/stock/mesh/random-nodes", random_nodes);
    g_test_add_func("/nc/stock/mesh/box", box_is_sharp);
    g_test_add_func("/nc/stock/mesh/cylinder", cylinder);
    g_test_add_func("/nc/stock/mesh/pockets", pockets_are_sharp);
    g_test_add_func("/nc/stock/mesh/ball", ball_pocket);
    g_test_add_func("/nc/stock/mesh/scallops", scallops);
    g_test_add_func("/nc/stock/mesh/random-cuts", random_cuts);
    g_test_add_func("/nc/stock/mesh/thin-walls", thin_walls);
    g_test_add_func("/nc/stock/mesh/threads", same_with_any_threads);
    g_test_add_func("/nc/stock/mesh/through-and-apart", through_and_apart);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
