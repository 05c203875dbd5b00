/* SPDX-License-Identifier: Apache-2.0 */
/* Areas, concave radii and adjacency of the analytic part against closed forms. */
#include <string.h>

#include "segcore/geom/curve.h"
#include "segcore/methods/region.h"
#include "tests/lib/test.h"

static SegPart *load(const char *name)
{
    g_autofree char *file = g_strconcat("parts/", name, NULL);
    g_autofree char *path = test_program(file);
    g_autofree char *helper = test_program("segmill-cad");
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    g_autoptr(GError) error = NULL;
    SegPart *part = seg_part_load(path, &options, &error);
    g_assert_no_error(error);
    return part;
}

enum { FACES = 22 };

/* Box, cylinder, cone frustum, sphere, torus, plate with two holes: as tests/parts makes them. */
static void closed_forms(double area_mm2[FACES])
{
    const double plate_mm2 = 40 * 30 - G_PI * (4 * 4 + 2.5 * 2.5);
    const double all[FACES] = {600,
                               600,
                               300,
                               300,
                               200,
                               200,
                               2 * G_PI * 5 * 20,
                               G_PI * 25,
                               G_PI * 25,
                               G_PI * (8 + 3) * 13, /* slant: √(5² + 12²) */
                               G_PI * 9,
                               G_PI * 64,
                               4 * G_PI * 49,
                               4 * G_PI * G_PI * 10 * 3,
                               150,
                               200,
                               plate_mm2,
                               200,
                               plate_mm2,
                               150,
                               2 * G_PI * 2.5 * 5,
                               2 * G_PI * 4 * 5};
    memcpy(area_mm2, all, sizeof all);
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The same areas from STEP and from IGES in mm, inch and metre; sorted, for the order is the
 * file's. */
static void test_areas(void)
{
    static const char *const names[] = {"analytic.step", "analytic.igs", "analytic_inch.igs",
                                        "analytic_metre.igs"};
    static const double units[] = {1, 1, 25.4, 1000};
    double expected[FACES], found[FACES];
    closed_forms(expected);
    qsort(expected, FACES, sizeof *expected, compare_doubles);
    for (size_t i = 0; i < G_N_ELEMENTS(names); i++) {
        g_autoptr(SegPart) part = load(names[i]);
        g_assert_cmpint(part ? part->n_faces : 0, ==, FACES);
        if (!part || part->n_faces != FACES)
            continue;
        g_assert_cmpfloat(part->unit_mm, ==, units[i]);
        for (int32_t f = 0; f < FACES; f++)
            found[f] = seg_face_area_mm2(part, f);
        qsort(found, FACES, sizeof *found, compare_doubles);
        for (int f = 0; f < FACES; f++)
            test_near(found[f], expected[f], 0, 1e-7);
    }
}

static const SegFace *face_of_type(const SegPart *part, SegSurfaceType type, int which)
{
    for (int32_t f = 0; f < part->n_faces; f++)
        if (part->faces[f].type == (int32_t)type && which-- == 0)
            return &part->faces[f];
    return NULL;
}

/* Outsides of solids are convex, holes concave with their radius; the torus is concave around its
 * axis on the inner side: 1/(R - r). */
static void test_concave_radius(void)
{
    g_autoptr(SegPart) part = load("analytic.step");
    if (!part)
        return;
    const struct {
        SegSurfaceType type;
        int which;
        double radius_mm, tolerance;
    } cases[] = {{SEG_SURFACE_PLANE, 0, INFINITY, 0},  {SEG_SURFACE_CYLINDER, 0, INFINITY, 0},
                 {SEG_SURFACE_CONE, 0, INFINITY, 0},   {SEG_SURFACE_SPHERE, 0, INFINITY, 0},
                 {SEG_SURFACE_TORUS, 0, 10 - 3, 2e-3}, {SEG_SURFACE_CYLINDER, 1, 2.5, 1e-9},
                 {SEG_SURFACE_CYLINDER, 2, 4, 1e-9}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        const SegFace *face = face_of_type(part, cases[i].type, cases[i].which);
        g_assert_nonnull(face);
        if (!face)
            continue;
        double radius = seg_min_concave_radius_mm(part, (int32_t)(face - part->faces));
        if (isinf(cases[i].radius_mm))
            g_assert_true(isinf(radius));
        else
            test_near(radius, cases[i].radius_mm, 0, cases[i].tolerance);
    }
}

/* STEP shares edges; the IGES file of single trimmed surfaces shares none. The pairs are the same,
 * but for the order of the faces: compared by the areas of the two. */
static void test_adjacency(void)
{
    g_autoptr(SegPart) step = load("analytic.step"), iges = load("analytic.igs");
    if (!step || !iges)
        return;
    g_autoptr(GArray) shared = seg_part_adjacency(step, 0);
    g_autoptr(GArray) touching = seg_part_adjacency(iges, 1e-3);
    g_autoptr(GArray) neither = seg_part_adjacency(iges, 0);
    /* Box 12, cylinder and cone 2 each, plate 12 and two for each hole. */
    g_assert_cmpuint(shared->len, ==, 12 + 2 + 2 + 12 + 4);
    g_assert_cmpuint(touching->len, ==, shared->len);
    g_assert_cmpuint(neither->len, <, shared->len);
    double sum[2] = {0, 0};
    for (guint i = 0; i < shared->len && i < touching->len; i++) {
        const SegFacePair *a = &g_array_index(shared, SegFacePair, i);
        const SegFacePair *b = &g_array_index(touching, SegFacePair, i);
        g_assert_cmpint(a->a, <, a->b);
        sum[0] += seg_face_area_mm2(step, a->a) * seg_face_area_mm2(step, a->b);
        sum[1] += seg_face_area_mm2(iges, b->a) * seg_face_area_mm2(iges, b->b);
    }
    test_near(sum[1], sum[0], 0, 1e-6);
}

/* Boxes of boundaries: a circle that lies askew reaches r·sin of the angle to each axis. */
static void test_boxes(void)
{
    g_autoptr(SegPart) part = load("analytic.step");
    if (!part)
        return;
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    for (int32_t f = 0; f < part->n_faces; f++) {
        const SegFace *face = &part->faces[f];
        if (face->type != SEG_SURFACE_PLANE || face->n_loops != 1 ||
            part->loops[face->first_loop].n_coedges > 2)
            continue;
        double r = sqrt(seg_face_area_mm2(part, f) / G_PI);
        SegVec3 n = face->axis;
        double extents[3] = {2 * r * sqrt(1 - n.x * n.x), 2 * r * sqrt(1 - n.y * n.y),
                             2 * r * sqrt(1 - n.z * n.z)};
        qsort(extents, 3, sizeof *extents, compare_doubles);
        SegFeatureSize size = seg_feature_size(part, f, &params, NULL);
        test_near(size.length_mm, extents[2], 0, 1e-8);
        test_near(size.width_mm, extents[1], 0, 1e-8);
        test_near(size.height_mm, extents[0], 0, 1e-8);
        test_near(size.diagonal_mm, 2 * r * sqrt(2), 0, 1e-8);
    }
}

static void add(void)
{
    g_test_add_func("/segcore/measures/areas", test_areas);
    g_test_add_func("/segcore/measures/concave-radius", test_concave_radius);
    g_test_add_func("/segcore/measures/adjacency", test_adjacency);
    g_test_add_func("/segcore/measures/boxes", test_boxes);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
