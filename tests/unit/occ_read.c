/* SPDX-License-Identifier: Apache-2.0 */
/* segmill-cad read: units, numbers, order, closed forms, and what it refuses. */
#include "tests/unit/occ_run.h"

#include <glib/gstdio.h>

/* ------------------------------------------------------------------ units */

static void box_of_vertices(const SegPart *part, double low[3], double high[3])
{
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
    }
    for (int32_t i = 0; i < part->n_vertices; i++) {
        const double p[3] = {part->vertices[i].position.x, part->vertices[i].position.y,
                             part->vertices[i].position.z};
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], p[k]);
            high[k] = fmax(high[k], p[k]);
        }
    }
}

static void check_size(const char *path, double unit_mm, double x, double y, double z,
                       double tolerance_mm)
{
    g_autoptr(SegPart) part = occ_read(path, "1");
    if (!part)
        return;
    double low[3], high[3];
    box_of_vertices(part, low, high);
    test_near(part->unit_mm, unit_mm, 0, 1e-12);
    test_near(high[0] - low[0], x, tolerance_mm, 0);
    test_near(high[1] - low[1], y, tolerance_mm, 0);
    test_near(high[2] - low[2], z, tolerance_mm, 0);
}

static void units(void)
{
    g_autofree char *inch = test_data("freeform/model1_inch.igs");
    g_autofree char *metre = test_data("freeform/pipe_hollow.iges");
    if (inch)
        check_size(inch, 25.4, 2590.8, 2718.2, 508, 1);
    if (metre)
        check_size(metre, 1000, 2000, 2000, 10000, 1);
}

static void units_of_ours(void)
{
    const struct {
        const char *name;
        double unit_mm;
    } files[] = {{"analytic.igs", 1},
                 {"analytic_inch.igs", 25.4},
                 {"analytic_metre.igs", 1000},
                 {"analytic.step", 1}};
    g_autofree char *path = occ_part(files[0].name);
    g_autoptr(SegPart) first = occ_read(path, "0.1");
    for (size_t i = 0; i < G_N_ELEMENTS(files) && first; i++) {
        g_autofree char *other = occ_part(files[i].name);
        g_autoptr(SegPart) part = occ_read(other, "0.1");
        g_assert_cmpint(part ? part->n_faces : 0, ==, first->n_faces);
        if (!part || part->n_faces != first->n_faces)
            return;
        test_near(part->unit_mm, files[i].unit_mm, 0, 1e-12);
        for (int32_t f = 0; f < part->n_faces; f++)
            test_near(seg_face_area_mm2(part, f), seg_face_area_mm2(first, f), 0, 1e-7);
    }
}

/* ------------------------------------------------------------------ closed forms */

typedef struct {
    SegSurfaceType type;
    double area;
} Known;

/* The faces of tests/parts/analytic.cc, in order. */
static const Known KNOWN[] = {
    {SEG_SURFACE_PLANE, 600},
    {SEG_SURFACE_PLANE, 600},
    {SEG_SURFACE_PLANE, 300},
    {SEG_SURFACE_PLANE, 300},
    {SEG_SURFACE_PLANE, 200},
    {SEG_SURFACE_PLANE, 200},
    {SEG_SURFACE_CYLINDER, 2 * G_PI * 5 * 20},
    {SEG_SURFACE_PLANE, G_PI * 25},
    {SEG_SURFACE_PLANE, G_PI * 25},
    {SEG_SURFACE_CONE, G_PI *(8 + 3) * 13}, /* slant √(5² + 12²) */
    {SEG_SURFACE_PLANE, G_PI * 9},
    {SEG_SURFACE_PLANE, G_PI * 64},
    {SEG_SURFACE_SPHERE, 4 * G_PI * 49},
    {SEG_SURFACE_TORUS, 4 * G_PI *G_PI * 10 * 3},
    {SEG_SURFACE_PLANE, 150},
    {SEG_SURFACE_PLANE, 200},
    {SEG_SURFACE_PLANE, 1200 - G_PI *(16 + 6.25)},
    {SEG_SURFACE_PLANE, 200},
    {SEG_SURFACE_PLANE, 1200 - G_PI *(16 + 6.25)},
    {SEG_SURFACE_PLANE, 150},
    {SEG_SURFACE_CYLINDER, 2 * G_PI * 2.5 * 5},
    {SEG_SURFACE_CYLINDER, 2 * G_PI * 4 * 5},
};

static void check_parameters(const SegFace *face, double radius, double minor, double angle)
{
    test_near(face->radius_mm, radius, 1e-9, 0);
    test_near(face->minor_radius_mm, minor, 1e-9, 0);
    test_near(fabs(face->half_angle_rad), angle, 1e-9, 0);
    test_near(seg_norm(face->axis), 1, 1e-12, 0);
    test_near(seg_dot(face->axis, face->x_axis), 0, 1e-12, 0);
}

static void closed_forms(void)
{
    g_autofree char *path = occ_part("analytic.step");
    g_autoptr(SegPart) part = occ_read(path, "0.01");
    g_assert_cmpint(part ? part->n_faces : 0, ==, G_N_ELEMENTS(KNOWN));
    if (!part || part->n_faces != G_N_ELEMENTS(KNOWN))
        return;
    for (int32_t i = 0; i < part->n_faces; i++) {
        g_assert_cmpstr(seg_surface_type_name((SegSurfaceType)part->faces[i].type), ==,
                        seg_surface_type_name(KNOWN[i].type));
        test_near(seg_face_area_mm2(part, i), KNOWN[i].area, 0, 1e-7);
        g_assert_cmpint(part->faces[i].iges_de, ==, 0);
    }
    check_parameters(&part->faces[6], 5, 0, 0);
    check_parameters(&part->faces[9], part->faces[9].radius_mm, 0, atan2(5, 12));
    check_parameters(&part->faces[12], 7, 0, 0);
    check_parameters(&part->faces[13], 10, 3, 0);
}

/* ------------------------------------------------------------------ entity numbers */

/* Entity type by directory entry number, read from the file's own columns (IGES 5.3, 2.2.4.4). */
static GHashTable *directory_of(const char *path)
{
    GHashTable *types = g_hash_table_new(NULL, NULL);
    g_autofree char *text = NULL;
    g_file_get_contents(path, &text, NULL, NULL);
    g_auto(GStrv) lines = g_strsplit(text ? text : "", "\n", -1);
    for (size_t i = 0; lines[i]; i++) {
        if (strlen(lines[i]) < 80 || lines[i][72] != 'D')
            continue;
        int number = atoi(lines[i] + 73);
        g_autofree char *type = g_strndup(lines[i], 8);
        if (number % 2 == 1)
            g_hash_table_insert(types, GINT_TO_POINTER(number), GINT_TO_POINTER(atoi(type)));
    }
    return types;
}

static int type_at(GHashTable *types, int32_t de)
{
    return GPOINTER_TO_INT(g_hash_table_lookup(types, GINT_TO_POINTER(de)));
}

static void check_entities(const char *relative, int32_t n_faces, int32_t face_type,
                           int32_t surface_type, int32_t boundary_type)
{
    g_autofree char *path = test_data(relative);
    g_autoptr(SegPart) part = path ? occ_read(path, "10") : NULL;
    if (!part)
        return;
    g_assert_cmpint(part->n_faces, ==, n_faces);
    g_autoptr(GHashTable) types = directory_of(path);
    g_autoptr(GHashTable) seen = g_hash_table_new(NULL, NULL);
    for (int32_t i = 0; i < part->n_faces; i++) {
        const SegFace *face = &part->faces[i];
        g_assert_cmpint(face->iges_type, ==, face_type);
        g_assert_cmpint(type_at(types, face->iges_de), ==, face_type);
        g_assert_true(g_hash_table_add(seen, GINT_TO_POINTER(face->iges_de)));
        g_assert_true(face->iges_surface_type == surface_type || face->iges_surface_type == 190);
        g_assert_cmpint(type_at(types, face->iges_surface_de), ==, face->iges_surface_type);
        int boundaries = 0;
        for (int32_t k = 0; k < face->n_iges_curves; k++) {
            const SegIgesEntity *curve = &part->iges_curves[face->first_iges_curve + k];
            g_assert_cmpint(type_at(types, curve->de), ==, curve->type);
            g_assert_true(k == 0 || curve[-1].de < curve->de);
            boundaries += curve->type == boundary_type;
        }
        g_assert_cmpint(boundaries, ==, face->n_loops);
    }
}

static void entity_numbers(void)
{
    check_entities("freeform/example_45_faces.iges", 45, 144, 128, 142);
    check_entities("freeform/ideas_cube_143.igs", 6, 143, 128, 141);
    check_entities("freeform/d150_wing_msbo.igs", 8, 510, 128, 508);
}

/* ------------------------------------------------------------------ order of the faces */

/* The labels of MFCAD++ name each face's surface by its index: any other order shows. */
static void face_order(void)
{
    g_autofree char *table = test_data("mfcadpp/labels.csv");
    g_autofree char *text = NULL;
    if (!table || !g_file_get_contents(table, &text, NULL, NULL))
        return;
    const struct {
        const char *model, *file;
    } models[] = {{"hcadnet_case1_true", "mfcadpp/hcadnet_case1_true.stp"},
                  {"mfcadpp_test_1000", "mfcadpp/step/mfcadpp_test_1000.step"},
                  {"mfcadpp_test_10033", "mfcadpp/step/mfcadpp_test_10033.step"}};
    const struct {
        const char *name;
        SegSurfaceType type;
    } types[] = {{"PLANE", SEG_SURFACE_PLANE},
                 {"CYLINDRICAL_SURFACE", SEG_SURFACE_CYLINDER},
                 {"CONICAL_SURFACE", SEG_SURFACE_CONE},
                 {"SPHERICAL_SURFACE", SEG_SURFACE_SPHERE},
                 {"TOROIDAL_SURFACE", SEG_SURFACE_TORUS},
                 {"B_SPLINE_SURFACE_WITH_KNOTS", SEG_SURFACE_BSPLINE}};
    g_auto(GStrv) lines = g_strsplit(text, "\n", -1);
    for (size_t m = 0; m < G_N_ELEMENTS(models); m++) {
        g_autofree char *path = test_data(models[m].file);
        g_autoptr(SegPart) part = path ? occ_read(path, "10") : NULL;
        int32_t n = 0;
        for (size_t i = 1; part && lines[i]; i++) {
            g_auto(GStrv) words = g_strsplit(g_strchomp(lines[i]), ",", -1);
            if (g_strv_length(words) < 6 || strcmp(words[0], models[m].model) != 0)
                continue;
            int32_t index = atoi(words[1]);
            n++;
            g_assert_cmpint(index, <, part->n_faces);
            for (size_t t = 0; t < G_N_ELEMENTS(types) && index < part->n_faces; t++)
                if (strcmp(types[t].name, words[5]) == 0)
                    g_assert_cmpint(part->faces[index].type, ==, types[t].type);
        }
        g_assert_cmpint(n, >, 0);
        g_assert_cmpint(part ? part->n_faces : -1, ==, n);
    }
}

/* The same blade as IGES and as STEP: the same faces, each once. */
static void two_formats(void)
{
    g_autofree char *iges = test_data("freeform/tblade3_rotor_wedge.iges");
    g_autofree char *step = test_data("freeform/tblade3_rotor_wedge.step");
    g_autoptr(SegPart) a = iges ? occ_read(iges, "1") : NULL;
    g_autoptr(SegPart) b = step ? occ_read(step, "1") : NULL;
    g_assert_cmpint(a ? a->n_faces : -1, ==, b ? b->n_faces : -1);
    for (int32_t i = 0; a && b && i < a->n_faces; i++) {
        double area = seg_face_area_mm2(a, i), nearest = INFINITY;
        for (int32_t k = 0; k < b->n_faces; k++) {
            double other = seg_face_area_mm2(b, k);
            if (fabs(other - area) < fabs(nearest - area))
                nearest = other;
        }
        test_near(nearest, area, 0, 1e-5);
    }
}

/* ------------------------------------------------------------------ refusals */

static void check_refused(const char *path, const char *why)
{
    g_auto(OccRun) run =
        occ_run((const char *[]){"segmill-cad", "read", path, "--chord", "0.1", NULL});
    g_assert_cmpint(run.status, ==, 3);
    g_assert_cmpint((int)g_bytes_get_size(run.out), ==, 0);
    if (!strstr(run.messages, path) || !strstr(run.messages, why)) {
        g_test_message("\"%s\" names not both %s and \"%s\"", run.messages, path, why);
        g_test_fail();
    }
}

static void refused(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "part.igs", NULL);
    check_refused(path, "No such file");
    check_refused(folder, "not a regular file");
    g_file_set_contents(path, "", 0, NULL);
    check_refused(path, "empty");
    char noise[5000];
    for (size_t i = 0; i < sizeof noise; i++)
        noise[i] = (char)((i * i * 2654435761u) >> 13);
    g_file_set_contents(path, noise, sizeof noise, NULL);
    check_refused(path, "neither STEP");
    g_file_set_contents(path, "ISO-10303-21;\nHEADER;\nENDSEC;\n", -1, NULL);
    check_refused(path, "STEP");
    test_folder_remove(folder);

    const char *malformed[] = {"freeform/malformed_first_line_82_cols.iges",
                               "freeform/malformed_first_line_without_80_cols.iges",
                               "freeform/malformed_up_to_line_7_of_DE_section.iges"};
    for (size_t i = 0; i < G_N_ELEMENTS(malformed); i++) {
        g_autofree char *data = test_data(malformed[i]);
        if (data)
            check_refused(data, "");
    }
}

/* A file cut short anywhere is read as far as it goes or refused; never a partial form. */
static void truncated(void)
{
    const char *parts[] = {"analytic.igs", "analytic.step"};
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "cut.igs", NULL);
    for (size_t p = 0; p < G_N_ELEMENTS(parts); p++) {
        g_autofree char *whole = occ_part(parts[p]);
        g_autofree char *bytes = NULL;
        gsize length = 0;
        g_file_get_contents(whole, &bytes, &length, NULL);
        g_assert_cmpuint(length, >, 10000);
        for (gsize k = 1; k < 12 && bytes; k++) {
            g_file_set_contents(path, bytes, (gssize)(length * k / 12 + k), NULL);
            g_auto(OccRun) run =
                occ_run((const char *[]){"segmill-cad", "read", path, "--chord", "1", NULL});
            g_assert_true(run.status == 0 || run.status == 3 || run.status == -1);
            if (run.status == 0) {
                g_autoptr(GError) error = NULL;
                g_autoptr(SegPart) part = seg_part_from_form(run.out, &error);
                g_assert_nonnull(part);
            } else {
                g_assert_cmpint((int)g_bytes_get_size(run.out), ==, 0);
            }
        }
    }
    test_folder_remove(folder);
}

static void usage(void)
{
    g_autofree char *part = occ_part("analytic.igs");
    const char *const wrong[][6] = {
        {"segmill-cad", NULL},
        {"segmill-cad", "eat", part, NULL},
        {"segmill-cad", "read", part, NULL},
        {"segmill-cad", "read", part, "--chord", NULL},
        {"segmill-cad", "read", part, "--chord", "-1", NULL},
        {"segmill-cad", "read", part, "--chord", "nan", NULL},
        {"segmill-cad", "read", part, "--depth", "1", NULL},
        {"segmill-cad", "write", part, "out.igs", NULL},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(wrong); i++) {
        g_auto(OccRun) run = occ_run(wrong[i]);
        g_assert_cmpint(run.status, ==, 2);
        g_assert_nonnull(strstr(run.messages, "usage:"));
        g_assert_cmpint((int)g_bytes_get_size(run.out), ==, 0);
    }
}

static void add(void)
{
    g_test_add_func("/occ/read/units", units);
    g_test_add_func("/occ/read/units-of-ours", units_of_ours);
    g_test_add_func("/occ/read/closed-forms", closed_forms);
    g_test_add_func("/occ/read/entity-numbers", entity_numbers);
    g_test_add_func("/occ/read/face-order", face_order);
    g_test_add_func("/occ/read/two-formats", two_formats);
    g_test_add_func("/occ/read/refused", refused);
    g_test_add_func("/occ/read/truncated", truncated);
    g_test_add_func("/occ/read/usage", usage);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
