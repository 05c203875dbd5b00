/* SPDX-License-Identifier: Apache-2.0 */
/* segmill-cad write: what it writes holds the same faces; and the shipped part. */
#include "tests/unit/occ_run.h"

#include <glib/gstdio.h>

static OccRun write_faces(const char *path, const char *out, const char *faces)
{
    return occ_run((const char *[]){"segmill-cad", "write", path, out, "--faces", faces, NULL});
}

/* Writes every `step`-th face from `first` on and reads the file back, here and with the judge. */
static void check_round_trip(const char *path, int32_t first, int32_t step)
{
    g_autoptr(SegPart) part = occ_read(path, "10");
    if (!part)
        return;
    char *folder = test_folder();
    g_autofree char *out = g_build_filename(folder, "out.igs", NULL);
    g_autofree char *list = g_build_filename(folder, "faces", NULL);
    g_autofree char *at_list = g_strconcat("@", list, NULL);
    g_autoptr(GString) numbers = g_string_new(NULL);
    g_autoptr(GArray) faces = g_array_new(FALSE, FALSE, sizeof(int32_t));
    for (int32_t i = first; i < part->n_faces; i += step) {
        g_string_append_printf(numbers, "%d\n", i);
        g_array_append_val(faces, i);
    }
    g_file_set_contents(list, numbers->str, -1, NULL);
    g_auto(OccRun) run = write_faces(path, out, at_list);
    g_assert_cmpint(run.status, ==, 0);
    g_autoptr(SegPart) back = occ_read(out, "10");
    g_autoptr(GArray) judged = occ_judge(out);
    g_assert_cmpint(back ? back->n_faces : -1, ==, (int)faces->len);
    g_assert_cmpint((int)judged->len, ==, (int)faces->len);
    double sum = 0, sum_back = 0, sum_judged = 0;
    for (guint i = 0; back && i < faces->len && i < (guint)back->n_faces; i++) {
        double area = seg_face_area_mm2(part, g_array_index(faces, int32_t, i));
        sum += area;
        sum_back += seg_face_area_mm2(back, (int32_t)i);
        test_near(seg_face_area_mm2(back, (int32_t)i), area, 1e-4, 1e-4);
        g_assert_cmpint(back->faces[i].iges_type, ==, 144);
    }
    for (guint i = 0; i < judged->len; i++)
        sum_judged += g_array_index(judged, OccFace, i).area;
    test_near(sum_back, sum, 0, 1e-6);
    test_near(sum_judged, sum, 0, 1e-6);
    test_folder_remove(folder);
}

static void round_trip_of_ours(void)
{
    const char *parts[] = {"analytic.step", "p0_piece.igs", "blade.igs", "impeller.igs"};
    for (size_t i = 0; i < G_N_ELEMENTS(parts); i++) {
        g_autofree char *path = occ_part(parts[i]);
        check_round_trip(path, 0, 1);
        check_round_trip(path, 1, 3);
    }
}

static void round_trip(void)
{
    const char *files[] = {"freeform/example_45_faces.iges", "freeform/fusee_all_nurbs.stp",
                           "freeform/tblade3_rotor_wedge.iges", "freeform/sw_clamp_exercise11.igs",
                           "nist/nist_ctc_01_ap203_geom.stp"};
    for (size_t i = 0; i < G_N_ELEMENTS(files); i++) {
        g_autofree char *path = test_data(files[i]);
        if (path)
            check_round_trip(path, 0, 1);
    }
}

static void same_bytes(void)
{
    char *folder = test_folder();
    g_autofree char *part = occ_part("p0_piece.igs");
    g_autofree char *a = g_build_filename(folder, "a.igs", NULL);
    g_autofree char *b = g_build_filename(folder, "b.igs", NULL);
    g_auto(OccRun) first = write_faces(part, a, "0,3");
    g_auto(OccRun) second = write_faces(part, b, "0 3 0");
    g_assert_cmpint(first.status, ==, 0);
    g_assert_cmpint(second.status, ==, 0);
    g_autofree char *bytes_a = NULL, *bytes_b = NULL;
    g_file_get_contents(a, &bytes_a, NULL, NULL);
    g_file_get_contents(b, &bytes_b, NULL, NULL);
    g_assert_cmpstr(bytes_a, ==, bytes_b);
    g_assert_null(bytes_a ? strstr(bytes_a, folder) : NULL);
    test_folder_remove(folder);
}

static void refused(void)
{
    char *folder = test_folder();
    g_autofree char *part = occ_part("p0_piece.igs");
    g_autofree char *out = g_build_filename(folder, "out.igs", NULL);
    g_autofree char *nowhere = g_build_filename(folder, "no", "out.igs", NULL);
    const struct {
        const char *out, *faces;
        int status;
        const char *why;
    } cases[] = {
        {out, "999", 3, "face 999 does not exist"},  {out, "1,x", 3, "'x' is not a face number"},
        {out, "-1", 3, "'-1' is not a face number"}, {out, "", 3, "no face is named"},
        {out, "@/nonexistent", 3, "/nonexistent"},   {nowhere, "0", 1, "cannot be written"}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_auto(OccRun) run = write_faces(part, cases[i].out, cases[i].faces);
        g_assert_cmpint(run.status, ==, cases[i].status);
        g_assert_nonnull(strstr(run.messages, cases[i].why));
    }
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    g_assert_null(g_dir_read_name(dir)); /* nothing is left behind */
    test_folder_remove(folder);
}

/* What we ship is what the program makes. */
static void shipped(void)
{
    g_autofree char *made_path = occ_part("p0_piece.igs");
    g_autofree char *made = NULL, *shipped = NULL;
    g_file_get_contents(made_path, &made, NULL, NULL);
    g_file_get_contents("config/etc/p0-piece.igs", &shipped, NULL, NULL);
    g_assert_nonnull(made);
    g_assert_true(made && shipped && strcmp(made, shipped) == 0);
}

/* The P0 piece is what the paper's experiment asks for. */
static void p0_piece(void)
{
    g_autofree char *path = occ_part("p0_piece.igs");
    g_autoptr(GArray) faces = occ_judge(path);
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (guint i = 0; i < faces->len; i++) {
        const double *box = g_array_index(faces, OccFace, i).box;
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], box[k]);
            high[k] = fmax(high[k], box[3 + k]);
        }
    }
    const double size[3] = {30, 60, 20};
    for (int k = 0; k < 3 && faces->len > 0; k++)
        test_near(high[k] - low[k], size[k], 1e-6, 0);
}

static void add(void)
{
    g_test_add_func("/occ/write/round-trip-of-ours", round_trip_of_ours);
    g_test_add_func("/occ/write/round-trip", round_trip);
    g_test_add_func("/occ/write/same-bytes", same_bytes);
    g_test_add_func("/occ/write/refused", refused);
    g_test_add_func("/occ/parts/shipped", shipped);
    g_test_add_func("/occ/parts/p0-piece", p0_piece);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
