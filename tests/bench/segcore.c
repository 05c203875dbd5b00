/* SPDX-License-Identifier: Apache-2.0 */
/* Segmentation after reading in faces/s, and reading the part form in MB/s. Goals: 20 000 faces/s
 * (a tenth of it is a must). Parts: those of the project, and of the outside data what is there. */
#include <stdio.h>
#include <string.h>

#include "segcore/segcore.h"
#include "tests/lib/test.h"

static double seconds_since(gint64 start_us)
{
    return (double)(g_get_monotonic_time() - start_us) / G_USEC_PER_SEC;
}

/* The best of several runs, each of at least a tenth of a second. */
static double faces_per_s(const SegPart *part)
{
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    double best = 0;
    for (int run = 0; run < 3; run++) {
        gint64 start = g_get_monotonic_time();
        int times = 0;
        do {
            seg_segmentation_free(seg_segment_feature_size(part, &params, NULL));
            times++;
        } while (seconds_since(start) < 0.1);
        best = MAX(best, times * part->n_faces / seconds_since(start));
    }
    return best;
}

static double form_mb_per_s(const SegPart *part)
{
    double best = 0, mb = (double)g_bytes_get_size(part->memory) / 1e6;
    for (int run = 0; run < 5; run++) {
        gint64 start = g_get_monotonic_time();
        g_autoptr(SegPart) copy = seg_part_from_form(part->memory, NULL);
        best = MAX(best, copy ? mb / seconds_since(start) : 0);
    }
    return best;
}

static void measure(const char *path, const char *helper)
{
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    gint64 start = g_get_monotonic_time();
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = seg_part_load(path, &options, &error);
    if (!part) {
        printf("  %s\n", error->message);
        return;
    }
    double loaded_s = seconds_since(start);
    g_autofree char *name = g_path_get_basename(path);
    printf("  %-28s %5d faces %7d triangles  read %6.0f ms  segmented %8.0f faces/s  form %5.0f "
           "MB/s\n",
           name, part->n_faces, part->n_triangles, 1000 * loaded_s, faces_per_s(part),
           form_mb_per_s(part));
}

int main(void)
{
    static const char *const own[] = {"p0_piece.igs", "impeller.igs", "blade.igs"};
    static const char *const outside[] = {
        "mfcad/step/2-4-10-19.step",         "mfcadpp/step/mfcadpp_val_205.step",
        "nist/nist_ctc_05_ap203_geom.stp",   "nist/nist_ftc_10_ap203_geom.stp",
        "freeform/example_45_faces.iges",    "freeform/fusee_all_nurbs.stp",
        "freeform/ventilator_fan_catia.stp", "freeform/propeller_and_shaft.iges"};
    g_autofree char *helper = test_program("segmill-cad");
    puts("segcore: segmentation by feature size (goal 20000 faces/s, must 2000), form");
    for (size_t i = 0; i < G_N_ELEMENTS(own); i++) {
        g_autofree char *file = g_strconcat("parts/", own[i], NULL);
        g_autofree char *path = test_program(file);
        measure(path, helper);
    }
    const char *root = g_getenv("SEGMILL_TEST_DATA");
    for (size_t i = 0; i < G_N_ELEMENTS(outside); i++) {
        g_autofree char *path = g_build_filename(root ? root : "../shared/data", outside[i], NULL);
        if (g_file_test(path, G_FILE_TEST_EXISTS))
            measure(path, helper);
    }
    return 0;
}
