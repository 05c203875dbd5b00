/* SPDX-License-Identifier: Apache-2.0 */
/* T-splines in files: back as they went out, and what is wrong is refused with its line. */
#include <glib/gstdio.h>
#include <math.h>
#include <string.h>

#include "tests/lib/test.h"
#include "tests/lib/tmeshes.h"
#include "tests/lib/waves.h"

static void assert_same(const SegTspline *a, const SegTspline *b)
{
    g_assert_true(a->n_u == b->n_u && a->n_v == b->n_v && a->n_faces == b->n_faces &&
                  a->n_points == b->n_points);
    g_assert_true(memcmp(a->knots_u, b->knots_u, (size_t)a->n_u * sizeof(double)) == 0);
    g_assert_true(memcmp(a->knots_v, b->knots_v, (size_t)a->n_v * sizeof(double)) == 0);
    g_assert_true(memcmp(a->faces, b->faces, (size_t)a->n_faces * sizeof(SegTface)) == 0);
    g_assert_true(memcmp(a->points, b->points, (size_t)a->n_points * sizeof(SegTpoint)) == 0);
}

static void check_round_trip(const SegTspline *t)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "surface.tspl", NULL);
    g_autoptr(GError) error = NULL;
    g_assert_true(seg_tspline_save(t, path, &error));
    g_assert_no_error(error);
    g_autoptr(SegTspline) back = seg_tspline_load(path, &error);
    g_assert_no_error(error);
    g_assert_nonnull(back);
    if (back)
        assert_same(t, back);
    test_folder_remove(folder);
}

static void test_round_trip(void)
{
    for (int which = 0; which < N_TMESHES; which++) {
        g_autoptr(SegTspline) t = tmesh_example(which, NULL);
        g_assert_nonnull(t);
        if (t)
            check_round_trip(t);
    }
    g_autoptr(SegPart) part = waves_part(2, 9, true);
    g_autoptr(SegTspline) t = seg_tspline_from_face(part, 0, NULL);
    g_assert_nonnull(t);
    if (t)
        check_round_trip(t);
}

static void expect(const char *text, const char *message)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(SegTspline) t = seg_tspline_from_bytes(text, strlen(text), "a.tspl", &error);
    g_assert_null(t);
    g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    if (error && !strstr(error->message, message)) {
        g_test_message("\"%s\" says nothing of \"%s\"", error->message, message);
        g_test_fail();
    }
}

static void test_refused(void)
{
    expect("", "not a T-spline");
    expect("solid", "not a T-spline");
    expect("tspline 1", "a.tspl:1: \"tspline\"");
    expect("tspl 2", "version 2");
    expect("tspl x", "\"x\" is no version");
    expect("tspl 1\nu 2 0 1\nv 2 0 1\nface 0 1 0 1", "cut off");
    expect("tspl 1\nu 2 0 1\nu 2 0 1\nend", "a.tspl:3: the lines are given twice");
    expect("tspl 1\nu 2 1 0", "below");
    expect("tspl 1\nu 2 0 nan", "\"nan\" is no knot");
    expect("tspl 1\nu 2 0 1e99", "no knot");
    expect("tspl 1\nu 99999 0", "\"99999\" is no number of lines");
    expect("tspl 1\nu -1", "\"-1\" is no number of lines");
    expect("tspl 1\nface 0 1 0", "is no line");
    expect("tspl 1\npoint 0 0 1 2 3\nend", "\"end\" is no weight");
    expect("tspl 1\npoint 0 0 1 2 3 0\nend", "a.tspl:2: weight 0");
    expect("tspl 1\npoint 0 0 inf 2 3 1\nend", "\"inf\" is no coordinate");
    expect("tspl 1\nvertex", "a.tspl:2: \"vertex\" is none of");
    expect("tspl 1\nend more", "comes after");
    expect("tspl 1 # nothing\nend", "lines of u");
    expect("tspl 1\nu 2 0 1\nv 2 0 1\nend", "not closed");
    expect("tspl 1\nu 2 0 1\nv 2 0 1\nface 0 1 0 1\nend", "no control point");
    expect("tspl 1\nu 2 0 0\nv 2 0 1\nface 0 1 0 1\nend", "no face");
    expect("5x", "no number of points");
    expect("1\n0 0 0 0 0 0 0 0 0 0 0 0 0 0 1 2", "in point 1");
    expect("1\n0 0 0 0 0 0 0 0 0 0 2 0 0 0 1 2 3", "in point 1");
    expect("1\n0 0 0 0 0 0 0 0 0 0 0 0 0 0 1 2 3", "on 1 lines of u");
    expect("1\n0 0 0 0 0 0 0 0 0 0 1 0 0 0 1 2 3", "neighbour of point 1");
}

/* Four points at the corners of a square, with the knots and neighbours given. */
static char *square(const char *knots_of_first, int right_of_first, int above_second)
{
    return g_strdup_printf("4\n%s 0 0 0 1 1 0 %d 3 0 0 0 0\n"
                           "0 0 1 1 1 0 0 0 1 1 0 0 %d %d 1 0 0\n"
                           "0 0 0 1 1 0 0 1 1 1 1 4 0 0 0 1 0\n"
                           "0 0 1 1 1 0 0 1 1 1 %d 0 0 3 1 1 0\n",
                           knots_of_first, right_of_first, above_second, right_of_first ? 1 : 0,
                           above_second ? 2 : 0);
}

static void test_point_lists(void)
{
    g_autofree char *good = square("0 0 0 1 1", 2, 4);
    g_autoptr(GError) error = NULL;
    g_autoptr(SegTspline) t = seg_tspline_from_bytes(good, strlen(good), "square.cfg", &error);
    g_assert_no_error(error);
    g_assert_nonnull(t);
    if (t) {
        g_assert_cmpint(t->n_faces, ==, 1);
        g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(1, SEG_POSITIONS);
        seg_tspline_points(t, (const double[]){0.5}, (const double[]){0.5}, 1, b);
        test_near(b->position[0][0], 0.5, 1e-15, 0);
    }
    g_autofree char *own_knots = square("0 0 0 2 2", 2, 4);
    expect(own_knots, "knot vectors of their own");
    g_autofree char *open = square("0 0 0 1 1", 0, 4);
    expect(open, "not closed");
    g_autofree char *apart = square("0 0 0 1 1", 2, 0);
    expect(apart, "not closed");
}

/* T-Splines' own form: two parametrised rectangles are read whole, a surface with corners that go
 * in is refused by name. */
static void test_tsm(void)
{
    g_autofree char *simple = test_data("tspline/simple.tsm"), *fan = test_data("tspline/fan.tsm");
    g_autofree char *mouse = test_data("tspline/mouse.tsm");
    if (!simple || !fan || !mouse)
        return;
    g_autoptr(GError) error = NULL;
    g_autoptr(SegTspline) s = seg_tspline_load(simple, &error);
    g_assert_no_error(error);
    g_autoptr(SegTspline) f = seg_tspline_load(fan, &error);
    g_assert_no_error(error);
    g_assert_null(seg_tspline_load(mouse, &error));
    g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    g_assert_true(error && strstr(error->message, "not rectangular"));
    if (!s || !f)
        return;
    g_assert_cmpint(s->n_points, ==, 23); /* every one in the file */
    g_assert_cmpint(f->n_points, ==, 81);

    /* 30 × 30 mm over [0, 1] × [0, 1], its points at the Greville abscissae: y is 30 v, and x is 30
     * u where no row that lacks a point reaches. Corners are at their points. */
    const double u[] = {0, 0.1, 0.25, 0.5, 0.9, 1}, v[] = {0, 0.2, 0.5, 0.6, 0.8, 1};
    g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(36, SEG_POSITIONS);
    seg_tspline_grid(s, u, 6, v, 6, b);
    for (size_t i = 0; i < 36; i++) {
        test_near(b->position[1][i], 30 * v[i % 6], 1e-12, 0);
        if (i % 6 == 0)
            test_near(b->position[0][i], 30 * u[i / 6], 1e-12, 0);
    }
    test_near(b->position[2][0], -3.4626040428907068, 1e-12, 0);
    test_near(b->position[2][5], -3.5023978266846547, 1e-12, 0);
    test_near(b->position[2][30], -3.49483566732731, 1e-12, 0);
    test_near(b->position[2][35], -2.3707438010214226, 1e-12, 0);
}

/* One face of four vertices, and what is wrong with it after one replacement. */
static void expect_tsm(const char *old, const char *new, const char *message)
{
    g_autofree char *text = NULL;
    g_assert_true(g_file_get_contents("tests/fuzz/corpus/tspl/face.tsm", &text, NULL, NULL));
    g_autoptr(GString) changed = g_string_new(text);
    g_assert_cmpuint(g_string_replace(changed, old, new, 1), ==, 1);
    if (message) {
        expect(changed->str, message);
        return;
    }
    g_autoptr(GError) error = NULL;
    g_autoptr(SegTspline) t =
        seg_tspline_from_bytes(changed->str, changed->len, "face.tsm", &error);
    g_assert_no_error(error);
    g_assert_cmpint(t ? t->n_points : 0, ==, 16);
}

static void test_tsm_refused(void)
{
    expect_tsm("degree 3", "degree 3", NULL);
    expect_tsm("degree 3", "degree 2", "a.tspl:2: degree 2");
    expect_tsm("millimeters", "inches", "units");
    expect_tsm("conditions 1", "conditions 0", "end conditions");
    expect_tsm("ec 1 0", "ec 1 3", "creases");
    expect_tsm("e 1 1", "e 1 0", "knot interval");
    expect_tsm("e 1 1", "e 1 2", "do not add up");
    expect_tsm("v 1 NORTH", "v 1 UP", "a direction");
    expect_tsm("v 1 NORTH", "v 2 NORTH", "does not leave it");
    expect_tsm("l 3 1 4 0 0 0 0", "l 3 1 4 0 0 0", "seven whole numbers");
    expect_tsm("l 3 1 4 0 0 0 0", "l 3 2 4 0 0 0 0", "not closed");
    expect_tsm("l 3 1 4 0 0 0 0", "l 3 1 4 0 0 0 1", "extraordinary");
    expect_tsm("l 3 1 4 0 0 0 0", "l", "not there");
    expect_tsm("l 5 7 0 1 -1 0 2", "l 5 7 0 1 -1 0 0", "turns inwards");
    expect_tsm("l 5 7 0 1 -1 0 2", "l 5 7 0 1 -1 0 1", "3 corners");
    expect_tsm("0m cg 0 4 1", "0m cg 0 5 1", "extraordinary");
    expect_tsm("0m cg 0 4 1", "0m cg 9 4 1", "not known");
    expect_tsm("0g 0 0 0 1", "0g 0 0 0 2", "weight of 2");
    expect_tsm("0g 0 0 0 1", "0g 0 0 0", "four numbers");
    expect_tsm("0g 0 0 0 1", "0g", "deleted");
}

static void test_cut_binary(void)
{
    g_autofree char *path = test_data("tspline/opentspline_tmesh.tsp"), *bytes = NULL;
    gsize length;
    if (!path)
        return;
    g_assert_true(g_file_get_contents(path, &bytes, &length, NULL));
    for (gsize cut = 0; cut < length; cut += 7) {
        g_autoptr(GError) error = NULL;
        g_assert_null(seg_tspline_from_bytes(bytes, cut, "cut.tsp", &error));
        g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    }
}

static void test_no_file(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "none", "x.tspl", NULL);
    g_autoptr(GError) error = NULL;
    g_assert_null(seg_tspline_load(path, &error));
    g_assert_error(error, SEG_ERROR, SEG_ERROR_IO);
    g_clear_error(&error);
    g_autoptr(SegTspline) t = tmesh_example(TMESH_HOLED, NULL);
    g_assert_nonnull(t);
    if (t) {
        g_assert_false(seg_tspline_save(t, path, &error));
        g_assert_error(error, SEG_ERROR, SEG_ERROR_IO);
    }
    test_folder_remove(folder);
}

static void add(void)
{
    g_test_add_func("/segcore/tspline_file/round_trip", test_round_trip);
    g_test_add_func("/segcore/tspline_file/refused", test_refused);
    g_test_add_func("/segcore/tspline_file/point_lists", test_point_lists);
    g_test_add_func("/segcore/tspline_file/tsm", test_tsm);
    g_test_add_func("/segcore/tspline_file/tsm_refused", test_tsm_refused);
    g_test_add_func("/segcore/tspline_file/cut_binary", test_cut_binary);
    g_test_add_func("/segcore/tspline_file/no_file", test_no_file);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
