/* SPDX-License-Identifier: Apache-2.0 */
/* Local refinement: the lines become edges, and the surface stays what it is within 1e-12 of its
 * size at 10 000 points. */
#include <math.h>

#include "tests/lib/test.h"
#include "tests/lib/tmeshes.h"
#include "tests/lib/waves.h"

enum { N = 100 };

static const double TOLERANCE = 1e-12;

static SegVec3 at(double *const from[3], size_t i)
{
    return seg_vec3(from[0][i], from[1][i], from[2][i]);
}

/* The largest distance between two surfaces at N × N points, over the size of the first; they have
 * the same holes. */
static double difference(const SegTspline *a, const SegTspline *b)
{
    double u0, u1, v0, v1, u[N], v[N], worst = 0;
    seg_tspline_domain(a, &u0, &u1, &v0, &v1);
    for (int i = 0; i < N; i++) {
        u[i] = u0 + (u1 - u0) * i / (N - 1);
        v[i] = v0 + (v1 - v0) * i / (N - 1);
    }
    g_autoptr(SegSurfaceBatch) in_a = seg_surface_batch_new(N * N, SEG_POSITIONS);
    g_autoptr(SegSurfaceBatch) in_b = seg_surface_batch_new(N * N, SEG_POSITIONS);
    seg_tspline_grid(a, u, N, v, N, in_a);
    seg_tspline_grid(b, u, N, v, N, in_b);
    SegVec3 low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < N * N; i++) {
        bool outside = in_a->flags[i] & SEG_POINT_OUTSIDE;
        g_assert_true(outside == ((in_b->flags[i] & SEG_POINT_OUTSIDE) != 0));
        if (outside)
            continue;
        SegVec3 p = at(in_a->position, i);
        low = seg_vec3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
        high = seg_vec3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
        worst = fmax(worst, seg_distance(p, at(in_b->position, i)));
    }
    return worst / seg_distance(low, high);
}

/* No face of the surface has the line inside it. */
static void assert_edges(const SegTspline *t, const SegTline *lines, size_t n)
{
    for (size_t k = 0; k < n; k++)
        for (int32_t f = 0; f < t->n_faces; f++) {
            const SegTface *q = &t->faces[f];
            double u0 = t->knots_u[q->i0], u1 = t->knots_u[q->i1];
            double v0 = t->knots_v[q->j0], v1 = t->knots_v[q->j1];
            double a0 = lines[k].of_u ? u0 : v0, a1 = lines[k].of_u ? u1 : v1;
            double b0 = lines[k].of_u ? v0 : u0, b1 = lines[k].of_u ? v1 : u1;
            const double near = 2e-8;
            bool through = a0 + near < lines[k].at && lines[k].at < a1 - near &&
                           fmax(b0, lines[k].from) < fmin(b1, lines[k].to);
            g_assert_false(!q->hole && through);
        }
}

static void put_rectangle(SegTline *lines, double u0, double u1, double v0, double v1)
{
    lines[0] = (SegTline){true, u0, v0, v1};
    lines[1] = (SegTline){true, u1, v0, v1};
    lines[2] = (SegTline){false, v0, u0, u1};
    lines[3] = (SegTline){false, v1, u0, u1};
}

static SegTspline *check_refined(const SegTspline *t, const SegTline *lines, size_t n)
{
    g_autoptr(GError) error = NULL;
    SegTspline *refined = seg_tspline_refine(t, lines, n, &error);
    g_assert_no_error(error);
    if (!refined)
        return NULL;
    double off = difference(t, refined);
    g_test_message("%d points, %d faces → %d points, %d faces; off by %.2g", t->n_points,
                   t->n_faces, refined->n_points, refined->n_faces, off);
    g_assert_cmpfloat(off, <, TOLERANCE);
    assert_edges(refined, lines, n);
    return refined;
}

static void random_rectangles(GRand *random, const SegTspline *t, SegTline *lines, int n)
{
    double d[4];
    seg_tspline_domain(t, &d[0], &d[1], &d[2], &d[3]);
    for (int k = 0; k < n; k++) {
        double u0 = g_rand_double_range(random, d[0], d[1]);
        double v0 = g_rand_double_range(random, d[2], d[3]);
        double u1 = g_rand_double_range(random, u0, d[1]),
               v1 = g_rand_double_range(random, v0, d[3]);
        put_rectangle(lines + 4 * k, u0, u1, v0, v1);
    }
}

static void test_examples(void)
{
    GRand *random = g_rand_new_with_seed(20261124);
    for (int which = 0; which < N_TMESHES; which++)
        for (int times = 0; times < 8; times++) {
            g_autoptr(SegTspline) t = tmesh_example(which, NULL);
            SegTline lines[12];
            random_rectangles(random, t, lines, 1 + times % 3);
            g_autoptr(SegTspline) refined = check_refined(t, lines, 4 * (size_t)(1 + times % 3));
            if (!refined)
                continue;
            /* And that once more. */
            random_rectangles(random, t, lines, 1);
            g_autoptr(SegTspline) twice = check_refined(refined, lines, 4);
            if (twice)
                g_assert_cmpfloat(difference(t, twice), <, TOLERANCE);
        }
    g_rand_free(random);
}

/* Of degree 2, 3 and rational; many rectangles, as a segmentation has. */
static void test_surfaces(void)
{
    GRand *random = g_rand_new_with_seed(20261125);
    for (int degree = 1; degree <= 3; degree++)
        for (int rational = 0; rational < 2; rational++) {
            g_autoptr(SegPart) part = waves_part(degree, 14, rational);
            g_autoptr(SegTspline) t = seg_tspline_from_face(part, 0, NULL);
            g_assert_nonnull(t);
            SegTline lines[40];
            random_rectangles(random, t, lines, 10);
            seg_tspline_free(check_refined(t, lines, 40));
        }
    g_rand_free(random);
}

/* Of others, with T-junctions, and borders where the surface is a limit. */
static void test_files(void)
{
    static const char *const files[] = {"beach_tspline.cfg", "door_tspline.cfg",
                                        "helicoidal_tspline.cfg", "opentspline_tmesh.tsp"};
    GRand *random = g_rand_new_with_seed(20261126);
    for (size_t i = 0; i < G_N_ELEMENTS(files); i++) {
        g_autofree char *name = g_build_filename("tspline", files[i], NULL);
        g_autofree char *path = test_data(name);
        g_autoptr(SegTspline) t = path ? seg_tspline_load(path, NULL) : NULL;
        for (int times = 0; t && times < 4; times++) {
            SegTline lines[8];
            random_rectangles(random, t, lines, 2);
            seg_tspline_free(check_refined(t, lines, 8));
        }
    }
    g_rand_free(random);
}

/* One small rectangle in a large surface costs points near it only. */
static void test_local(void)
{
    g_autoptr(SegPart) part = waves_part(3, 60, false);
    g_autoptr(SegTspline) t = seg_tspline_from_face(part, 0, NULL);
    g_assert_nonnull(t);
    SegTline lines[4];
    put_rectangle(lines, 0.502, 0.533, 0.31, 0.42);
    g_autoptr(SegTspline) refined = check_refined(t, lines, 4);
    if (refined)
        g_assert_cmpint(refined->n_points - t->n_points, <, 80); /* whole lines: 4 · 60 */
}

/* A line that is there already, one beside the surface, none at all: nothing changes. */
static void test_nothing(void)
{
    g_autoptr(SegTspline) t = tmesh_example(TMESH_HOLED, NULL);
    g_assert_nonnull(t);
    const SegTline lines[] = {
        {true, 3 + 1e-10, 2, 3}, {false, 99, 0, 9}, {true, 4.5, 3.1, 5.9}, {true, 2.5, 7, 7}};
    for (size_t n = 0; n <= G_N_ELEMENTS(lines); n++) {
        g_autoptr(SegTspline) same = check_refined(t, lines, n);
        g_assert_nonnull(same);
        g_assert_cmpint(same ? same->n_points : 0, ==, t->n_points);
        g_assert_cmpint(same ? same->n_faces : 0, ==, t->n_faces);
    }
    g_autoptr(GError) error = NULL;
    const SegTline wrong = {true, NAN, 0, 1};
    g_assert_null(seg_tspline_refine(t, &wrong, 1, &error));
    g_assert_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT);
}

/* The whole width of a B-spline surface: the same as inserting a knot into it. */
static void test_whole_line(void)
{
    g_autoptr(SegPart) part = waves_part(3, 8, false);
    g_autoptr(SegTspline) t = seg_tspline_from_face(part, 0, NULL);
    g_assert_nonnull(t);
    double u0, u1, v0, v1;
    seg_tspline_domain(t, &u0, &u1, &v0, &v1);
    const SegTline line = {true, 0.41, v0, v1};
    g_autoptr(SegTspline) refined = check_refined(t, &line, 1);
    if (refined) {
        g_assert_cmpint(refined->n_u, ==, t->n_u + 1);
        g_assert_cmpint(refined->n_points, <=, t->n_points + 8);
    }
}

static void add(void)
{
    g_test_add_func("/segcore/tspline_refine/examples", test_examples);
    g_test_add_func("/segcore/tspline_refine/surfaces", test_surfaces);
    g_test_add_func("/segcore/tspline_refine/files", test_files);
    g_test_add_func("/segcore/tspline_refine/local", test_local);
    g_test_add_func("/segcore/tspline_refine/nothing", test_nothing);
    g_test_add_func("/segcore/tspline_refine/whole_line", test_whole_line);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
