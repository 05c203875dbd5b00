/* SPDX-License-Identifier: Apache-2.0 */
/* Batches of surface points against closed forms, against the evaluation of one point, and at
 * degenerate points. */
#include <math.h>

#include "segcore/geom/bspline.h"
#include "tests/lib/form.h"
#include "tests/lib/test.h"
#include "tests/lib/waves.h"

static const double H = 0.70710678118654752440; /* weight of a quarter circle's middle pole */

static SegVec3 at(double *const from[3], size_t i)
{
    return seg_vec3(from[0][i], from[1][i], from[2][i]);
}

static void assert_vec(SegVec3 a, SegVec3 b, double tolerance)
{
    test_near(seg_distance(a, b), 0, tolerance * (1 + seg_norm(b)), 0);
}

static void fill(double *t, size_t n, double a, double b)
{
    for (size_t i = 0; i < n; i++)
        t[i] = a + (b - a) * (double)i / (double)(n - 1);
}

/* Point i of the batch as the evaluation of one point has it. */
static void compare_point(const SegPart *part, const SegSurfaceBatch *b, size_t i, double u,
                          double v)
{
    SegSurfacePoint s = seg_face_evaluate(part, 0, u, v);
    assert_vec(at(b->position, i), s.p, 1e-13);
    assert_vec(at(b->du, i), s.pu, 1e-12);
    assert_vec(at(b->dv, i), s.pv, 1e-12);
    assert_vec(at(b->duu, i), s.puu, 1e-11);
    assert_vec(at(b->duv, i), s.puv, 1e-11);
    assert_vec(at(b->dvv, i), s.pvv, 1e-11);
    SegVec3 normal;
    double k_min, k_max;
    g_assert_cmpint(b->flags[i], ==, 0);
    g_assert_true(seg_surface_normal(&part->faces[0], &s, &normal));
    g_assert_true(seg_surface_curvature(&part->faces[0], &s, &k_min, &k_max));
    assert_vec(at(b->normal, i), normal, 1e-12);
    test_near(b->k_min[i], k_min, 1e-9, 0);
    test_near(b->k_max[i], k_max, 1e-9, 0);
    test_near(b->mean[i], 0.5 * (b->k_min[i] + b->k_max[i]), 1e-15, 1e-13);
    test_near(b->gauss[i], b->k_min[i] * b->k_max[i], 1e-15, 1e-9);
}

/* The directions are unit vectors in the tangent plane at right angles, and the surface has the
 * principal curvatures along them. */
static void check_directions(const SegSurfaceBatch *b, size_t i)
{
    SegVec3 n = at(b->normal, i), lo = at(b->direction_min, i), hi = at(b->direction_max, i);
    test_near(seg_norm(lo), 1, 1e-12, 0);
    test_near(seg_norm(hi), 1, 1e-12, 0);
    test_near(seg_dot(lo, hi), 0, 1e-12, 0);
    test_near(seg_dot(lo, n), 0, 1e-12, 0);
    test_near(seg_dot(hi, n), 0, 1e-12, 0);
    SegVec3 du = at(b->du, i), dv = at(b->dv, i), side = seg_cross(du, dv);
    for (int which = 0; which < 2; which++) {
        SegVec3 d = which ? hi : lo;
        /* d = a du + c dv */
        double area2 = seg_dot(side, side), a = seg_dot(seg_cross(d, dv), side) / area2;
        double c = seg_dot(seg_cross(du, d), side) / area2;
        double k = a * a * seg_dot(n, at(b->duu, i)) + 2 * a * c * seg_dot(n, at(b->duv, i)) +
                   c * c * seg_dot(n, at(b->dvv, i));
        test_near(k, which ? b->k_max[i] : b->k_min[i], 1e-10, 0);
    }
}

static void test_one_by_one(void)
{
    static const int degrees[] = {1, 2, 3, 4, 5, 7, 12};
    for (size_t d = 0; d < G_N_ELEMENTS(degrees); d++)
        for (int rational = 0; rational < 2; rational++) {
            g_autoptr(SegPart) part = waves_part(degrees[d], degrees[d] + 9, rational);
            enum { N_U = 23, N_V = 151 }; /* more than a chunk, and not a whole number of them */
            double u[N_U], v[N_V];
            fill(u, N_U, 0.003, 0.997);
            fill(v, N_V, -1.99, 2.99);
            g_autoptr(SegSurfaceBatch) grid = seg_surface_batch_new(N_U * N_V, SEG_ALL_FIELDS);
            seg_face_grid(part, 0, u, N_U, v, N_V, grid);
            double all_u[N_U * N_V], all_v[N_U * N_V];
            for (size_t i = 0; i < N_U * N_V; i++) {
                all_u[i] = u[i / N_V];
                all_v[i] = v[i % N_V];
            }
            g_autoptr(SegSurfaceBatch) points = seg_surface_batch_new(N_U * N_V, SEG_ALL_FIELDS);
            seg_face_points(part, 0, all_u, all_v, N_U * N_V, points);
            for (size_t i = 0; i < N_U * N_V; i += 7) {
                compare_point(part, grid, i, all_u[i], all_v[i]);
                compare_point(part, points, i, all_u[i], all_v[i]);
                check_directions(grid, i);
            }
        }
}

/* Half a sphere of radius 5: rational, of two poles, flat in no place. */
static SegPart *sphere(double radius)
{
    g_autoptr(Form) form = form_new();
    const double knots_u[8] = {0, 0, 0, 1, 1, 2, 2, 2}, knots_v[6] = {0, 0, 0, 1, 1, 1};
    const double circle[5][3] = {{1, 0, 1}, {1, 1, H}, {0, 1, 1}, {-1, 1, H}, {-1, 0, 1}};
    const double rise[3][3] = {{1, 0, 1}, {1, 1, H}, {0, 1, 1}}; /* from the equator to the pole */
    double poles[45], weights[15];
    for (int i = 0; i < 5; i++)
        for (int j = 0; j < 3; j++) {
            double *pole = poles + 3 * (3 * i + j);
            pole[0] = radius * rise[j][0] * circle[i][0];
            pole[1] = radius * rise[j][0] * circle[i][1];
            pole[2] = radius * rise[j][1];
            weights[3 * i + j] = rise[j][2] * circle[i][2];
        }
    form_patch(form, SEG_SURFACE_SPHERE,
               form_surface(form, 2, 5, 2, 3, knots_u, knots_v, poles, weights));
    return form_part(form);
}

/* Outward normals, umbilic everywhere, and no normal at the pole: a flag, never a wrong number. */
static void test_sphere(void)
{
    const double radius = 5;
    g_autoptr(SegPart) part = sphere(radius);
    double u[41], v[31];
    fill(u, 41, 0, 2);
    fill(v, 31, 0, 1);
    g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(41 * 31, SEG_ALL_FIELDS);
    seg_face_grid(part, 0, u, 41, v, 31, b);
    for (size_t i = 0; i < 41 * 31; i++) {
        SegVec3 p = at(b->position, i);
        test_near(seg_norm(p), radius, 0, 1e-14);
        if (i % 31 == 30) {
            g_assert_cmpint(b->flags[i], ==, SEG_POINT_DEGENERATE);
            g_assert_cmpfloat(seg_norm(at(b->normal, i)), ==, 0);
            g_assert_cmpfloat(seg_norm(at(b->direction_max, i)), ==, 0);
            g_assert_cmpfloat(b->k_max[i], ==, 0);
            continue;
        }
        g_assert_cmpint(b->flags[i], ==, SEG_POINT_UMBILIC);
        assert_vec(at(b->normal, i), seg_scale(p, 1 / radius), 1e-11);
        test_near(b->k_min[i], -1 / radius, 1e-10, 0);
        test_near(b->k_max[i], -1 / radius, 1e-10, 0);
        test_near(seg_norm(at(b->direction_max, i)), 1, 1e-12, 0);
        test_near(seg_dot(at(b->direction_max, i), at(b->direction_min, i)), 0, 1e-12, 0);
    }
}

/* A parallelogram is umbilic with curvatures 0; a cylinder bends one way only, along its circles.
 */
static void test_plane_and_cylinder(void)
{
    g_autoptr(Form) form = form_sample();
    g_autoptr(SegPart) part = form_part(form);
    for (int32_t face = 0; face < 2; face++) {
        double u0, u1, v0, v1, u[9], v[9];
        seg_face_domain(part, face, &u0, &u1, &v0, &v1);
        fill(u, 9, u0, u1);
        fill(v, 9, v0, v1);
        g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(81, SEG_ALL_FIELDS);
        seg_face_grid(part, face, u, 9, v, 9, b);
        for (size_t i = 0; i < 81; i++) {
            SegVec3 p = at(b->position, i), axis = seg_vec3(0, 0, 1);
            if (face == 0) {
                g_assert_cmpint(b->flags[i], ==, SEG_POINT_UMBILIC);
                test_near(b->k_min[i], 0, 1e-15, 0);
                test_near(b->k_max[i], 0, 1e-15, 0);
                continue;
            }
            SegVec3 out = seg_unit(seg_vec3(p.x, p.y, 0));
            g_assert_cmpint(b->flags[i], ==, 0);
            assert_vec(at(b->normal, i), out, 1e-13);
            test_near(b->k_min[i], -0.2, 1e-13, 0);
            test_near(b->k_max[i], 0, 1e-13, 0);
            test_near(fabs(seg_dot(at(b->direction_max, i), axis)), 1, 1e-12, 0);
            test_near(seg_dot(at(b->direction_min, i), axis), 0, 1e-12, 0);
        }
    }
}

/* What is out of the domain is moved into it; NaN too. No points is no work. */
static void test_outside(void)
{
    g_autoptr(SegPart) part = waves_part(3, 12, false);
    const double u[] = {-5, 0, NAN, 7, 1}, v[] = {-9, -2, 0.5, INFINITY, 3};
    g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(5, SEG_POSITIONS);
    seg_face_points(part, 0, u, v, 5, b);
    assert_vec(at(b->position, 0), at(b->position, 1), 0);
    assert_vec(at(b->position, 3), at(b->position, 4), 0);
    assert_vec(at(b->position, 2), seg_face_evaluate(part, 0, 0, 0.5).p, 1e-13);
    seg_face_points(part, 0, u, v, 0, b);
    seg_face_grid(part, 0, u, 0, v, 5, b);
    seg_face_grid(part, 0, u, 5, v, 0, b);
    g_assert_null(b->du[0]);
    g_assert_null(b->k_max);
}

/* The grid asks of the loops what the question about one point asks. */
static void test_polygons(void)
{
    double outer[][2] = {{0, 0}, {4, 0}, {4, 3}, {2, 1.5}, {0, 3}};
    double hole[][2] = {{0.5, 0.5}, {0.5, 1}, {1, 1}, {1, 0.5}};
    const SegLoopPolygon polygons[] = {{outer, 5}, {hole, 4}};
    double u[57], v[43];
    fill(u, 57, -0.5, 4.5);
    fill(v, 43, -0.25, 3.25);
    uint8_t flags[57 * 43] = {0};
    seg_polygons_grid(polygons, 2, u, 57, v, 43, flags);
    size_t inside = 0;
    for (size_t i = 0; i < 57; i++)
        for (size_t j = 0; j < 43; j++) {
            bool in = flags[i * 43 + j] == 0;
            g_assert_true(in == seg_polygons_contain(polygons, 2, u[i], v[j]));
            inside += in;
        }
    double area = 12 - 3 - 0.25, cell = 5.0 / 56 * 3.5 / 42;
    test_near((double)inside * cell, area, 0.3, 0);
}

static void add(void)
{
    g_test_add_func("/segcore/surface_grid/one_by_one", test_one_by_one);
    g_test_add_func("/segcore/surface_grid/sphere", test_sphere);
    g_test_add_func("/segcore/surface_grid/plane_and_cylinder", test_plane_and_cylinder);
    g_test_add_func("/segcore/surface_grid/outside", test_outside);
    g_test_add_func("/segcore/surface_grid/polygons", test_polygons);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
