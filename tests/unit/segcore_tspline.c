/* SPDX-License-Identifier: Apache-2.0 */
/* T-splines: equal to the B-spline surfaces they are made of, to sums over their definition, with
 * T-junctions, holes and corners that go in; what is wrong is refused. */
#include <math.h>
#include <string.h>

#include "segcore/geom/bspline.h"
#include "segcore/geom/tmesh.h"
#include "tests/lib/form.h"
#include "tests/lib/test.h"
#include "tests/lib/tmeshes.h"
#include "tests/lib/waves.h"

static SegVec3 at(double *const from[3], size_t i)
{
    return seg_vec3(from[0][i], from[1][i], from[2][i]);
}

static void assert_vec(SegVec3 a, SegVec3 b, double tolerance)
{
    test_near(seg_distance(a, b), 0, tolerance * (1 + seg_norm(b)), 0);
}

/* ------------------------------------------------------------------ against B-splines */

static void compare_with_face(const SegPart *part, int32_t face, const SegTspline *t)
{
    enum { N = 67 };
    double u0, u1, v0, v1, domain[4], u[N], v[N];
    seg_face_domain(part, face, &u0, &u1, &v0, &v1);
    seg_tspline_domain(t, &domain[0], &domain[1], &domain[2], &domain[3]);
    g_assert_true(domain[0] == u0 && domain[1] == u1 && domain[2] == v0 && domain[3] == v1);
    for (int i = 0; i < N; i++) {
        u[i] = u0 + (u1 - u0) * i / (N - 1.0);
        v[i] = v0 + (v1 - v0) * i / (N - 1.0);
    }
    g_autoptr(SegSurfaceBatch) a = seg_surface_batch_new(N * N, SEG_ALL_FIELDS);
    g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(N * N, SEG_ALL_FIELDS);
    seg_face_grid(part, face, u, N, v, N, a);
    seg_tspline_grid(t, u, N, v, N, b);
    double sign = part->faces[face].reversed ? -1 : 1;
    for (size_t i = 0; i < N * N; i++) {
        g_assert_cmpint(b->flags[i] & ~SEG_POINT_UMBILIC, ==, 0);
        assert_vec(at(b->position, i), at(a->position, i), 1e-13);
        assert_vec(at(b->du, i), at(a->du, i), 1e-11);
        assert_vec(at(b->dvv, i), at(a->dvv, i), 1e-8);
        assert_vec(at(b->duv, i), at(a->duv, i), 1e-8);
        assert_vec(at(b->normal, i), seg_scale(at(a->normal, i), sign), 1e-11);
        test_near(b->gauss[i], a->gauss[i], 1e-9, 1e-9);
    }
}

static void test_from_face(void)
{
    for (int degree = 1; degree <= 3; degree++)
        for (int rational = 0; rational < 2; rational++) {
            g_autoptr(SegPart) part = waves_part(degree, degree + 9, rational);
            g_autoptr(GError) error = NULL;
            g_autoptr(SegTspline) t = seg_tspline_from_face(part, 0, &error);
            g_assert_no_error(error);
            if (t)
                compare_with_face(part, 0, t);
        }
    g_autoptr(Form) form = form_sample();
    g_autoptr(SegPart) sample = form_part(form);
    for (int32_t face = 0; face < 2; face++) {
        g_autoptr(SegTspline) t = seg_tspline_from_face(sample, face, NULL);
        g_assert_nonnull(t);
        if (t)
            compare_with_face(sample, face, t);
    }
    g_autoptr(SegPart) quartic = waves_part(4, 9, false);
    g_autoptr(GError) error = NULL;
    g_assert_null(seg_tspline_from_face(quartic, 0, &error));
    g_assert_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT);
}

/* Ends that are not clamped, and a double knot inside. */
static void test_open_knots(void)
{
    g_autoptr(Form) form = form_new();
    const double knots_u[] = {-3, -1, 0, 1, 2, 2, 3, 4, 5, 7}, knots_v[] = {0, 1, 2, 3, 4, 5, 6};
    double poles[6 * 4 * 3];
    for (int i = 0; i < 6 * 4; i++) {
        poles[3 * i] = 10.0 * (i / 4);
        poles[3 * i + 1] = 10.0 * (i % 4);
        poles[3 * i + 2] = 5 * sin(i);
    }
    form_patch(form, SEG_SURFACE_BSPLINE,
               form_surface(form, 3, 6, 2, 4, knots_u, knots_v, poles, NULL));
    g_autoptr(SegPart) part = form_part(form);
    g_autoptr(GError) error = NULL;
    g_autoptr(SegTspline) t = seg_tspline_from_face(part, 0, &error);
    g_assert_no_error(error);
    if (t)
        compare_with_face(part, 0, t);
}

/* ------------------------------------------------------------------ against the definition */

/* N[s0 … s4](t) by eq. 3 of P1, the plain recursion. */
static double recursion(const double *s, int order, double t, double end)
{
    if (order == 0)
        return s[0] < s[1] && s[0] <= t && (t < s[1] || (t == end && s[1] == end));
    double left = s[order] > s[0] ? (t - s[0]) / (s[order] - s[0]) : 0;
    double right = s[order + 1] > s[1] ? (s[order + 1] - t) / (s[order + 1] - s[1]) : 0;
    return left * recursion(s, order - 1, t, end) + right * recursion(s + 1, order - 1, t, end);
}

/* P1 eq. 1 over ALL points, by knot vectors of the T-spline. */
static SegVec3 definition(const SegTspline *t, double u, double v)
{
    SegVec3 sum = {0, 0, 0};
    double weight = 0;
    for (int32_t k = 0; k < t->n_points; k++) {
        double in_u[5], in_v[5];
        for (int i = 0; i < 5; i++) {
            in_u[i] = t->knots_u[t->lines_u[k][i]];
            in_v[i] = t->knots_v[t->lines_v[k][i]];
        }
        const SegTpoint *p = &t->points[k];
        double b = p->w * recursion(in_u, 3, u, t->knots_u[t->n_u - 1]) *
                   recursion(in_v, 3, v, t->knots_v[t->n_v - 1]);
        sum = seg_along(sum, seg_vec3(p->x, p->y, p->z), b);
        weight += b;
    }
    return seg_scale(sum, 1 / weight);
}

static bool in_hole(const SegTspline *t, double u, double v)
{
    bool in = false, surface = false;
    for (int32_t f = 0; f < t->n_faces; f++) {
        const SegTface *q = &t->faces[f];
        bool here = t->knots_u[q->i0] <= u && u <= t->knots_u[q->i1] && t->knots_v[q->j0] <= v &&
                    v <= t->knots_v[q->j1];
        in |= here && q->hole;
        surface |= here && !q->hole && t->knots_u[q->i0] < t->knots_u[q->i1] &&
                   t->knots_v[q->j0] < t->knots_v[q->j1];
    }
    return in && !surface;
}

static void compare_with_definition(const SegTspline *t)
{
    enum { N = 41 };
    double u0, u1, v0, v1, u[N], v[N], all_u[N * N], all_v[N * N];
    seg_tspline_domain(t, &u0, &u1, &v0, &v1);
    for (int i = 0; i < N; i++) {
        u[i] = u0 + (u1 - u0) * i / (N - 1.0);
        v[i] = v0 + (v1 - v0) * i / (N - 1.0);
    }
    for (int i = 0; i < N * N; i++) {
        all_u[i] = u[i / N];
        all_v[i] = v[i % N];
    }
    g_autoptr(SegSurfaceBatch) grid = seg_surface_batch_new(N * N, SEG_ALL_FIELDS);
    g_autoptr(SegSurfaceBatch) points = seg_surface_batch_new(N * N, SEG_ALL_FIELDS);
    seg_tspline_grid(t, u, N, v, N, grid);
    seg_tspline_points(t, all_u, all_v, N * N, points);
    for (size_t i = 0; i < N * N; i++) {
        bool hole = in_hole(t, all_u[i], all_v[i]);
        g_assert_true(hole == ((grid->flags[i] & SEG_POINT_OUTSIDE) != 0));
        g_assert_cmpint(grid->flags[i], ==, points->flags[i]);
        if (hole) {
            g_assert_cmpfloat(seg_norm(at(grid->position, i)), ==, 0);
            continue;
        }
        assert_vec(at(grid->position, i), definition(t, all_u[i], all_v[i]), 1e-13);
        assert_vec(at(points->position, i), at(grid->position, i), 1e-14);
        assert_vec(at(points->duv, i), at(grid->duv, i), 1e-10);
    }
}

static void test_definition(void)
{
    for (int which = 0; which < N_TMESHES; which++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(SegTspline) t = tmesh_example(which, &error);
        g_assert_no_error(error);
        if (t)
            compare_with_definition(t);
    }
}

/* The files of others: what they say is the definition. On borders that no function reaches the
 * surface goes to its limit. */
static void test_files_of_others(void)
{
    static const char *const files[] = {"beach_tspline.cfg", "door_tspline.cfg",
                                        "helicoidal_tspline.cfg", "opentspline_tmesh.tsp"};
    static const int32_t points[] = {16, 219, 216, 22};
    for (size_t i = 0; i < G_N_ELEMENTS(files); i++) {
        g_autofree char *name = g_build_filename("tspline", files[i], NULL);
        g_autofree char *path = test_data(name);
        if (!path)
            return;
        g_autoptr(GError) error = NULL;
        g_autoptr(SegTspline) t = seg_tspline_load(path, &error);
        g_assert_no_error(error);
        if (!t)
            continue;
        g_assert_cmpint(t->n_points, ==, points[i]);
        double u0, u1, v0, v1;
        seg_tspline_domain(t, &u0, &u1, &v0, &v1);
        for (int k = 0; k < 400; k++) {
            double a = (k / 20 + 0.5) / 20, b = (k % 20 + 0.5) / 20;
            const double u[] = {u0 + a * (u1 - u0), u0, u0 + 1e-9 * (u1 - u0), u1};
            const double v[] = {v0 + b * (v1 - v0), v0 + b * (v1 - v0), v0 + b * (v1 - v0), v1};
            g_autoptr(SegSurfaceBatch) batch = seg_surface_batch_new(4, SEG_ALL_FIELDS);
            seg_tspline_points(t, u, v, 4, batch);
            assert_vec(at(batch->position, 0), definition(t, u[0], v[0]), 1e-12);
            assert_vec(at(batch->position, 1), at(batch->position, 2), 1e-4);
            const SegTpoint *last = &t->points[0];
            for (int32_t p = 0; p < t->n_points; p++)
                if (t->points[p].i == t->n_u - 1 && t->points[p].j == t->n_v - 1)
                    last = &t->points[p];
            assert_vec(at(batch->position, 3), seg_vec3(last->x, last->y, last->z), 1e-12);
        }
    }
}

/* Outside the domain, and at no number. */
static void test_outside(void)
{
    g_autoptr(SegTspline) t = tmesh_example(TMESH_HOLED, NULL);
    g_assert_nonnull(t);
    if (!t)
        return;
    const double u[] = {-1, 0, 99, NAN, 4.5}, v[] = {1, 0, 1, 1, 4.5};
    g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(5, SEG_ALL_FIELDS);
    seg_tspline_points(t, u, v, 5, b);
    g_assert_cmpint(b->flags[0], ==, SEG_POINT_OUTSIDE);
    g_assert_cmpint(b->flags[1] & SEG_POINT_OUTSIDE, ==, 0);
    g_assert_cmpint(b->flags[2], ==, SEG_POINT_OUTSIDE);
    g_assert_cmpint(b->flags[3], ==, SEG_POINT_OUTSIDE);
    g_assert_cmpint(b->flags[4], ==, SEG_POINT_OUTSIDE);
}

/* Figure 1 of P1 in small: rays stop at edges across and at vertices, and pass faces. */
static void test_rays(void)
{
    /* Between lines 1 and 3 of u and 1 and 3 of v two faces, one above the other. */
    const SegTface faces[] = {{0, 1, 0, 4, 0}, {1, 3, 0, 1, 0}, {1, 3, 1, 2, 0}, {1, 3, 2, 3, 0},
                              {1, 3, 3, 4, 0}, {3, 4, 0, 2, 0}, {3, 4, 2, 4, 0}};
    g_autoptr(SegTmesh) m = seg_tmesh_new(5, 5, faces, 7, NULL);
    g_assert_nonnull(m);
    if (!m)
        return;
    int32_t u[5], v[5];
    const int32_t expected_u[] = {0, 0, 1, 3, 4}, expected_v[] = {0, 1, 2, 3, 4};
    seg_tmesh_lines(m, 1, 2, u, v);
    g_assert_true(memcmp(u, expected_u, sizeof u) == 0);
    g_assert_true(memcmp(v, expected_v, sizeof v) == 0);
    const int32_t beyond_u[] = {1, 3, 4, 4, 4}, beyond_v[] = {0, 0, 2, 4, 4};
    seg_tmesh_lines(m, 4, 2, u, v);
    g_assert_true(memcmp(u, beyond_u, sizeof u) == 0);
    g_assert_true(memcmp(v, beyond_v, sizeof v) == 0);
    g_assert_cmpint(seg_tmesh_inside(m, 2, 2), ==, -1);
    seg_tmesh_add_vertex(m, 2, 2);
    const int32_t more_u[] = {0, 0, 1, 2, 3};
    seg_tmesh_lines(m, 1, 2, u, v);
    g_assert_true(memcmp(u, more_u, sizeof u) == 0);
}

/* ------------------------------------------------------------------ what is refused */

typedef struct {
    double knots_u[6], knots_v[6];
    SegTface faces[25];
    SegTpoint points[36];
    int32_t n_faces, n_points;
} Plain;

/* 6 × 6 lines, the outer ones twice. */
static Plain plain(void)
{
    Plain p = {{0, 0, 1, 2, 3, 3}, {0, 0, 1, 2, 3, 3}, {{0}}, {{0}}, 0, 0};
    for (int i = 0; i < 25; i++)
        p.faces[p.n_faces++] = (SegTface){i / 5, i / 5 + 1, i % 5, i % 5 + 1, 0};
    for (int i = 0; i < 36; i++)
        p.points[p.n_points++] = (SegTpoint){i / 6, i % 6, i / 6, i % 6, i % 5, 1};
    return p;
}

static void expect(const Plain *p, const char *message)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(SegTspline) t = seg_tspline_new(p->knots_u, 6, p->knots_v, 6, p->faces, p->n_faces,
                                              p->points, p->n_points, &error);
    if (!message) {
        g_assert_no_error(error);
        return;
    }
    g_assert_null(t);
    g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    if (error && !strstr(error->message, message)) {
        g_test_message("\"%s\" says nothing of \"%s\"", error->message, message);
        g_test_fail();
    }
}

static void test_refused(void)
{
    Plain p = plain();
    expect(&p, NULL);
    p.knots_u[2] = NAN;
    expect(&p, "line 2 of u");
    p = plain(), p.knots_v[3] = 0.5;
    expect(&p, "line 3 of v");
    p = plain(), p.faces[7].i1 = 3;
    expect(&p, "overlap");
    p = plain(), p.n_faces = 24;
    expect(&p, "not closed");
    p = plain(), p.faces[3].j1 = 9;
    expect(&p, "face 3");
    p = plain(), p.points[4].w = 0;
    expect(&p, "weight");
    p = plain(), p.points[4].z = INFINITY;
    expect(&p, "coordinate");
    p = plain(), p.points[4].i = -1;
    expect(&p, "no line");
    p = plain(), p.points[5] = p.points[4];
    expect(&p, "twice");
    p = plain(), p.n_points = 35;
    expect(&p, "no control point");
    p = plain(), memcpy(p.knots_u, (double[]){0, 0, 0, 0, 0, 0}, sizeof p.knots_u);
    expect(&p, "no face");
    p = plain();
    for (int i = 0; i < 25; i++)
        p.faces[i].hole = 1;
    expect(&p, "no face");
    /* One large face in the middle, and a point in it. */
    p = plain(), p.n_faces = 0;
    for (int i = 0; i < 25; i++)
        if (i / 5 < 1 || i / 5 > 3 || i % 5 < 1 || i % 5 > 3)
            p.faces[p.n_faces++] = (SegTface){i / 5, i / 5 + 1, i % 5, i % 5 + 1, 0};
    p.faces[p.n_faces++] = (SegTface){1, 4, 1, 4, 0};
    expect(&p, "inside a face");
}

static void add(void)
{
    g_test_add_func("/segcore/tspline/from_face", test_from_face);
    g_test_add_func("/segcore/tspline/open_knots", test_open_knots);
    g_test_add_func("/segcore/tspline/definition", test_definition);
    g_test_add_func("/segcore/tspline/files_of_others", test_files_of_others);
    g_test_add_func("/segcore/tspline/outside", test_outside);
    g_test_add_func("/segcore/tspline/rays", test_rays);
    g_test_add_func("/segcore/tspline/refused", test_refused);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
