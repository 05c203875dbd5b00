/* SPDX-License-Identifier: Apache-2.0 */
/* Curves and surfaces against closed forms and finite differences. */
#include "segcore/geom/bspline.h"

#include <string.h>

#include "segcore/geom/curve.h"
#include "tests/lib/form.h"
#include "tests/lib/test.h"

static const double H = 0.70710678118654752440; /* weight of a quarter circle's middle pole */

static void assert_vec(SegVec3 a, SegVec3 b, double tolerance)
{
    test_near(a.x, b.x, tolerance, 0);
    test_near(a.y, b.y, tolerance, 0);
    test_near(a.z, b.z, tolerance, 0);
}

/* A whole circle of radius 3 about (1, 2, 4), in four rational arcs. */
static SegCurve circle(Form *form)
{
    const double knots[12] = {0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4};
    const double corner[9][2] = {{1, 0},   {1, 1},  {0, 1},  {-1, 1}, {-1, 0},
                                 {-1, -1}, {0, -1}, {1, -1}, {1, 0}};
    double poles[27], weights[9];
    for (int i = 0; i < 9; i++) {
        poles[3 * i] = 1 + 3 * corner[i][0];
        poles[3 * i + 1] = 2 + 3 * corner[i][1];
        poles[3 * i + 2] = 4;
        weights[i] = i % 2 ? H : 1;
    }
    return form_curve(form, 2, 9, 3, knots, poles, weights);
}

/* A curve of random poles, with a double knot inside. */
static SegCurve random_curve(Form *form, GRand *random, int degree, int n, bool rational)
{
    g_autofree double *knots = g_new(double, n + degree + 1), *poles = g_new(double, 3 * n),
                      *weights = g_new(double, n);
    for (int i = 0; i <= n + degree; i++)
        knots[i] = CLAMP(i - degree, 0, n - degree);
    if (n - degree > 3 && degree > 1) /* a double knot would tear a polyline */
        knots[degree + 2] = knots[degree + 1];
    for (int i = 0; i < 3 * n; i++)
        poles[i] = g_rand_double_range(random, -10, 10);
    for (int i = 0; i < n; i++)
        weights[i] = g_rand_double_range(random, 0.2, 5);
    return form_curve(form, degree, n, 3, knots, poles, rational ? weights : NULL);
}

static SegPart view(const Form *form)
{
    return (SegPart){.reals = (const double *)(const void *)form->reals->data,
                     .n_reals = form->reals->len};
}

/* ------------------------------------------------------------------ curves */

static void test_circle(void)
{
    g_autoptr(Form) form = form_new();
    SegCurve c = circle(form);
    SegPart part = view(form);
    for (int i = 0; i <= 400; i++) {
        SegVec3 d[3];
        seg_curve_derivatives(part.reals, &c, i / 100.0, 2, d);
        SegVec3 r = seg_sub(d[0], seg_vec3(1, 2, 4));
        test_near(seg_norm(r), 3, 0, 1e-14);
        test_near(seg_dot(r, d[1]), 0, 1e-12, 0);
        SegVec3 cross = seg_cross(d[1], d[2]);
        test_near(seg_norm(cross) / pow(seg_norm(d[1]), 3), 1.0 / 3, 0, 1e-12);
    }
    assert_vec(seg_curve_evaluate(&part, &c, -1, NULL), seg_vec3(4, 2, 4), 1e-15);
    assert_vec(seg_curve_evaluate(&part, &c, 2, NULL), seg_vec3(-2, 2, 4), 1e-15);
    assert_vec(seg_curve_evaluate(&part, &c, 9, NULL), seg_vec3(4, 2, 4), 1e-15);
}

static void test_curve_derivatives(void)
{
    GRand *random = g_rand_new_with_seed(20260103);
    for (int degree = 1; degree <= SEG_MAX_DEGREE; degree++) {
        g_autoptr(Form) form = form_new();
        SegCurve c = random_curve(form, random, degree, degree + 6, degree % 2);
        SegPart part = view(form);
        for (int i = 0; i < 20; i++) {
            /* Within a span, away from its knots. */
            double t = g_rand_int_range(random, 0, 6) + g_rand_double_range(random, 0.05, 0.95);
            const double h = 1e-5;
            SegVec3 a[3], b[3], at[3];
            seg_curve_derivatives(part.reals, &c, t - h, 1, a);
            seg_curve_derivatives(part.reals, &c, t + h, 1, b);
            seg_curve_derivatives(part.reals, &c, t, 2, at);
            double size = 1 + seg_norm(at[1]) + seg_norm(at[2]);
            assert_vec(seg_scale(seg_sub(b[0], a[0]), 0.5 / h), at[1], 2e-5 * size * degree);
            assert_vec(seg_scale(seg_sub(b[1], a[1]), 0.5 / h), at[2], 2e-5 * size * degree);
        }
    }
    g_rand_free(random);
}

static void test_length(void)
{
    g_autoptr(Form) form = form_new();
    SegCurve c = circle(form);
    const double line_knots[4] = {0, 0, 2, 2}, line_poles[6] = {0, 0, 0, 1, 2, 2};
    SegCurve line = form_curve(form, 1, 2, 3, line_knots, line_poles, NULL);
    /* A cubic with a cusp, (t², t³): its length over [-1, 1] is 2(13√13 - 8)/27. */
    const double cusp_knots[8] = {-1, -1, -1, -1, 1, 1, 1, 1};
    const double cusp_poles[12] = {1, -1, 0, -1.0 / 3, 1, 0, -1.0 / 3, -1, 0, 1, 1, 0};
    SegCurve cusp = form_curve(form, 3, 4, 3, cusp_knots, cusp_poles, NULL);
    SegPart part = view(form);
    test_near(seg_curve_length_mm(&part, &c, 0, 4), 6 * G_PI, 0, 1e-10);
    test_near(seg_curve_length_mm(&part, &c, 0.5, 3), 6 * G_PI * 2.5 / 4, 0, 1e-10);
    test_near(seg_curve_length_mm(&part, &c, 3, 0.5), 6 * G_PI * 2.5 / 4, 0, 1e-10);
    test_near(seg_curve_length_mm(&part, &line, 0, 2), 3, 0, 1e-14);
    test_near(seg_curve_length_mm(&part, &cusp, -1, 1), 2 * (13 * sqrt(13) - 8) / 27, 0, 1e-8);
}

static void test_at_length(void)
{
    GRand *random = g_rand_new_with_seed(20260104);
    for (int i = 0; i < 30; i++) {
        g_autoptr(Form) form = form_new();
        int degree = 1 + i % 5;
        SegCurve c = random_curve(form, random, degree, degree + 5, i % 2);
        SegPart part = view(form);
        double total = seg_curve_length_mm(&part, &c, 0, 5);
        for (int k = 1; k < 8; k++) {
            double t = seg_curve_at_length(&part, &c, 0, 5, total * k / 8, total);
            test_near(seg_curve_length_mm(&part, &c, 0, t), total * k / 8, 1e-8 * total, 0);
        }
    }
    g_rand_free(random);
}

/* The box holds a dense sampling, and no more than a denser one could show. */
static void test_box(void)
{
    GRand *random = g_rand_new_with_seed(20260105);
    for (int i = 0; i < 200; i++) {
        g_autoptr(Form) form = form_new();
        int degree = 1 + i % 9;
        SegCurve c = random_curve(form, random, degree, degree + 6, i % 2);
        SegPart part = view(form);
        double a = g_rand_double_range(random, 0, 2), b = g_rand_double_range(random, 4, 6);
        SegBox exact = SEG_BOX_EMPTY, sampled = SEG_BOX_EMPTY;
        seg_curve_box(&part, &c, a, b, &exact);
        for (int k = 0; k <= 4000; k++)
            seg_box_add(&sampled, seg_curve_evaluate(&part, &c, a + (b - a) * k / 4000, NULL));
        for (int corner = (int)ceil(a); corner < b; corner++)
            seg_box_add(&sampled, seg_curve_evaluate(&part, &c, corner, NULL));
        const double slack = 1e-4; /* what 4000 samples may miss of an extremum */
        assert_vec(exact.min, sampled.min, slack);
        assert_vec(exact.max, sampled.max, slack);
        g_assert_cmpfloat(exact.min.x, <=, sampled.min.x + 1e-8);
        g_assert_cmpfloat(exact.max.z, >=, sampled.max.z - 1e-8);
    }
    g_rand_free(random);
    g_autoptr(Form) form = form_new();
    SegCurve c = circle(form);
    SegPart part = view(form);
    SegBox box = SEG_BOX_EMPTY;
    g_assert_cmpuint(seg_curve_box(&part, &c, 0.5, 4, &box), >, 0);
    assert_vec(box.min, seg_vec3(-2, -1, 4), 1e-9);
    assert_vec(box.max, seg_vec3(4, 2 + 3, 4), 1e-9);
}

/* ------------------------------------------------------------------ surfaces */

/* One eighth of a sphere of radius 2: u around z, v up to the pole; Su × Sv points outwards. */
static SegSurface sphere_octant(Form *form)
{
    const double knots[6] = {0, 0, 0, 1, 1, 1};
    const double around[3][2] = {{1, 0}, {1, 1}, {0, 1}}, up[3][2] = {{1, 0}, {1, 1}, {0, 1}};
    double poles[27], weights[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double *p = poles + 3 * (3 * i + j);
            p[0] = 2 * around[i][0] * up[j][0];
            p[1] = 2 * around[i][1] * up[j][0];
            p[2] = 2 * up[j][1];
            weights[3 * i + j] = (i == 1 ? H : 1) * (j == 1 ? H : 1);
        }
    return form_surface(form, 2, 3, 2, 3, knots, knots, poles, weights);
}

/* Seen from outside a ball is convex: both curvatures negative; from inside concave. */
static void test_curvature(void)
{
    g_autoptr(Form) form = form_new();
    form_patch(form, SEG_SURFACE_SPHERE, sphere_octant(form));
    g_autoptr(SegPart) part = form_part(form);
    for (int reversed = 0; reversed < 2; reversed++) {
        SegFace face = part->faces[0];
        face.reversed = reversed;
        double sign = reversed ? 1 : -1;
        for (int i = 0; i < 100; i++) {
            SegSurfacePoint s = seg_face_evaluate(part, 0, i % 10 / 9.0, i / 10 / 10.0);
            SegVec3 normal;
            double k_min, k_max;
            g_assert_true(seg_surface_normal(&face, &s, &normal));
            assert_vec(normal, seg_scale(s.p, -sign / 2), 1e-12);
            g_assert_true(seg_surface_curvature(&face, &s, &k_min, &k_max));
            test_near(k_min, sign / 2, 1e-6, 0);
            test_near(k_max, sign / 2, 1e-6, 0);
        }
        SegSurfacePoint pole = seg_face_evaluate(part, 0, 0.5, 1);
        SegVec3 normal;
        g_assert_false(seg_surface_normal(&face, &pole, &normal));
        g_assert_cmpfloat(seg_norm(normal), ==, 0);
    }
    test_near(seg_face_area_mm2(part, 0), G_PI * 4 / 2, 0, 1e-8);
}

static void test_surface_derivatives(void)
{
    enum { NU = 7, NV = 6 };
    GRand *random = g_rand_new_with_seed(20260106);
    const double knots_u[NU + 4] = {0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4};
    const double knots_v[NV + 3] = {0, 0, 0, 1, 2, 3, 4, 4, 4};
    double poles[3 * NU * NV], weights[NU * NV];
    for (int i = 0; i < 3 * NU * NV; i++)
        poles[i] = g_rand_double_range(random, -10, 10);
    for (int i = 0; i < NU * NV; i++)
        weights[i] = g_rand_double_range(random, 0.2, 5);
    for (int rational = 0; rational < 2; rational++) {
        g_autoptr(Form) form = form_new();
        SegSurface s =
            form_surface(form, 3, NU, 2, NV, knots_u, knots_v, poles, rational ? weights : NULL);
        const double *reals = (const double *)(const void *)form->reals->data;
        for (int i = 0; i < 200; i++) {
            const double h = 1e-5;
            double u = g_rand_int_range(random, 0, 4) + g_rand_double_range(random, 0.01, 0.99);
            double v = g_rand_int_range(random, 0, 4) + g_rand_double_range(random, 0.01, 0.99);
            SegSurfacePoint p = seg_surface_evaluate(reals, &s, u, v, 2);
            SegSurfacePoint a = seg_surface_evaluate(reals, &s, u - h, v, 2);
            SegSurfacePoint b = seg_surface_evaluate(reals, &s, u + h, v, 2);
            SegSurfacePoint c = seg_surface_evaluate(reals, &s, u, v - h, 2);
            SegSurfacePoint d = seg_surface_evaluate(reals, &s, u, v + h, 2);
            double size = 1e-4 * (1 + seg_norm(p.puu) + seg_norm(p.puv) + seg_norm(p.pvv));
            assert_vec(seg_scale(seg_sub(b.p, a.p), 0.5 / h), p.pu, size);
            assert_vec(seg_scale(seg_sub(d.p, c.p), 0.5 / h), p.pv, size);
            assert_vec(seg_scale(seg_sub(b.pu, a.pu), 0.5 / h), p.puu, size);
            assert_vec(seg_scale(seg_sub(d.pu, c.pu), 0.5 / h), p.puv, size);
            assert_vec(seg_scale(seg_sub(d.pv, c.pv), 0.5 / h), p.pvv, size);
        }
    }
    g_rand_free(random);
}

static void test_polygon(void)
{
    g_autoptr(Form) form = form_sample();
    g_autoptr(SegPart) part = form_part(form);
    SegLoopPolygon plane = seg_loop_polygon(part, 0, 0.01), wall = seg_loop_polygon(part, 1, 0.01);
    g_assert_cmpuint(plane.n, ==, 4);
    /* Chords of a quarter circle of radius 5 within 0.01: 13 at least a side. */
    g_assert_cmpuint(wall.n, >=, 2 * 13);
    g_assert_cmpuint(wall.n, <=, 2 * 65 + 4);
    g_assert_true(seg_polygons_contain(&wall, 1, 0.5, 5));
    g_assert_false(seg_polygons_contain(&wall, 1, 1.5, 5));
    g_assert_false(seg_polygons_contain(&wall, 1, 0.5, 11));
    double hole_uv[4][2] = {{0.4, 4}, {0.6, 4}, {0.6, 6}, {0.4, 6}};
    SegLoopPolygon both[2] = {wall, {hole_uv, 4}};
    g_assert_false(seg_polygons_contain(both, 2, 0.5, 5));
    g_assert_true(seg_polygons_contain(both, 2, 0.3, 5));
    g_free(plane.uv);
    g_free(wall.uv);
}

static void add(void)
{
    g_test_add_func("/segcore/bspline/circle", test_circle);
    g_test_add_func("/segcore/bspline/curve-derivatives", test_curve_derivatives);
    g_test_add_func("/segcore/bspline/length", test_length);
    g_test_add_func("/segcore/bspline/at-length", test_at_length);
    g_test_add_func("/segcore/bspline/box", test_box);
    g_test_add_func("/segcore/bspline/curvature", test_curvature);
    g_test_add_func("/segcore/bspline/surface-derivatives", test_surface_derivatives);
    g_test_add_func("/segcore/bspline/polygon", test_polygon);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
