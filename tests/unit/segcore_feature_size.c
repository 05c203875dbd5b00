/* SPDX-License-Identifier: Apache-2.0 */
/* P0: repair, classes, local features and the rest, on the paper's three kinds of part. */
#include <string.h>

#include "segcore/methods/classes.h"
#include "tests/lib/test.h"

static SegPart *load(const char *name)
{
    g_autofree char *file = g_strconcat("parts/", name, ".igs", NULL);
    g_autofree char *path = test_program(file);
    g_autofree char *helper = test_program("segmill-cad");
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    g_autoptr(GError) error = NULL;
    SegPart *part = seg_part_load(path, &options, &error);
    g_assert_no_error(error);
    return part;
}

static SegSegmentation *segment(const SegPart *part, const SegFeatureSizeParams *params)
{
    g_autoptr(GError) error = NULL;
    SegSegmentation *segmentation = seg_segment_feature_size(part, params, &error);
    g_assert_no_error(error);
    return segmentation;
}

static const SegRegion *region_named(const SegSegmentation *s, const char *name)
{
    for (size_t i = 0; i < s->n_regions; i++)
        if (strcmp(s->regions[i].name, name) == 0)
            return &s->regions[i];
    return NULL;
}

static const SegRegion *region_of(const SegSegmentation *s, int32_t face)
{
    for (size_t i = 0; i < s->n_regions; i++)
        for (size_t k = 0; k < s->regions[i].n_pieces; k++)
            if (s->regions[i].pieces[k].face == face)
                return &s->regions[i];
    return NULL;
}

/* Lowest and highest point of a face's triangles along z. */
static void reach_z(const SegPart *part, int32_t face, double *low, double *high)
{
    const SegFace *f = &part->faces[face];
    *low = INFINITY;
    *high = -INFINITY;
    for (int32_t t = f->first_triangle; t < f->first_triangle + f->n_triangles; t++)
        for (int k = 0; k < 3; k++) {
            double z = part->vertices[part->triangles[t].vertex[k]].position.z;
            *low = fmin(*low, z);
            *high = fmax(*high, z);
        }
}

/* Every face once, triangles and areas add up, neighbours know each other. */
static void assert_sound(const SegPart *part, const SegSegmentation *s)
{
    g_autofree int *seen = g_new0(int, (gsize)part->n_faces);
    double area = 0, expected = 0;
    size_t triangles = 0;
    for (size_t i = 0; i < s->n_regions; i++) {
        const SegRegion *r = &s->regions[i];
        g_assert_cmpint(r->id, ==, (int)i + 1);
        area += r->area_mm2;
        triangles += r->n_triangles;
        for (size_t k = 0; k < r->n_pieces; k++)
            seen[r->pieces[k].face]++;
        for (size_t k = 1; k < r->n_triangles; k++)
            g_assert_cmpint(r->triangles[k - 1], <, r->triangles[k]);
        for (size_t k = 0; k < r->n_neighbours; k++) {
            const SegRegion *other = &s->regions[r->neighbours[k] - 1];
            bool knows = false;
            for (size_t j = 0; j < other->n_neighbours; j++)
                knows |= other->neighbours[j] == r->id;
            g_assert_true(knows);
        }
    }
    for (int32_t f = 0; f < part->n_faces; f++) {
        g_assert_cmpint(seen[f], ==, 1);
        expected += seg_face_area_mm2(part, f);
    }
    g_assert_cmpuint(triangles, ==, (size_t)part->n_triangles);
    test_near(area, expected, 0, 1e-12);
}

/* ------------------------------------------------------------------ the paper's parts */

/* Defaults. The two bosses, six faces above the big ones, are one region; both big faces are in the
 * rest, which is what the larger tool gets. */
static void test_p0_piece(void)
{
    g_autoptr(SegPart) part = load("p0_piece");
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    g_autoptr(SegSegmentation) s = part ? segment(part, &params) : NULL;
    if (!s)
        return;
    assert_sound(part, s);
    const SegRegion *rest = region_named(s, "rest"), *boss = NULL;
    g_assert_nonnull(rest);
    for (int32_t f = 0; f < part->n_faces; f++) {
        double low, high;
        reach_z(part, f, &low, &high);
        const SegRegion *region = region_of(s, f);
        if (high > 13.6) { /* above the big faces: of a boss */
            g_assert_cmpint(region->kind, ==, SEG_REGION_LOCAL);
            g_assert_true(!boss || boss == region);
            boss = region;
        } else if (seg_face_area_mm2(part, f) > 500) {
            g_assert_true(region == rest);
        } else {
            g_assert_true(region != boss);
        }
    }
    if (!boss || !rest)
        return;
    g_assert_cmpuint(boss->n_pieces, ==, 8);
    g_assert_cmpuint(boss->n_neighbours, ==, 1);
    g_assert_cmpint(boss->neighbours[0], ==, rest->id);
    test_near(boss->min_concave_radius_mm, 2, 0, 1e-3); /* the fillet at the foot */
    g_assert_cmpfloat(rest->min_concave_radius_mm, >, 20);
}

/* Defaults: hub, main blades and splitters are apart; seven of each, five faces a blade. */
static void test_impeller(void)
{
    g_autoptr(SegPart) part = load("impeller");
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    g_autoptr(SegSegmentation) s = part ? segment(part, &params) : NULL;
    if (!s)
        return;
    assert_sound(part, s);
    const SegRegion *blades[2] = {NULL, NULL}; /* main, splitters: by area, as regions are sorted */
    size_t n = 0;
    for (size_t i = 0; i < s->n_regions; i++)
        if (s->regions[i].kind == SEG_REGION_LOCAL && s->regions[i].n_pieces == 35) {
            g_assert_cmpuint(n, <, 2);
            if (n < 2)
                blades[n++] = &s->regions[i];
        }
    g_assert_cmpuint(n, ==, 2);
    if (n != 2)
        return;
    g_assert_cmpfloat(blades[0]->area_mm2, >, 1.5 * blades[1]->area_mm2);
    const SegRegion *rest = region_named(s, "rest");
    for (int32_t f = 0; f < part->n_faces; f++)
        if (part->faces[f].type != SEG_SURFACE_BSPLINE)
            g_assert_true(region_of(s, f) != blades[0] && region_of(s, f) != blades[1]);
    g_assert_nonnull(rest);
    for (size_t i = 0; i < 2 && rest; i++) {
        g_assert_cmpuint(blades[i]->n_neighbours, ==, 1);
        g_assert_cmpint(blades[i]->neighbours[0], ==, rest->id);
    }
}

/* The ends of the blade are near in size to its middle, so the ratio is given: 0.85. */
static void test_blade(void)
{
    g_autoptr(SegPart) part = load("blade");
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    params.local_ratio = 0.85;
    g_autoptr(SegSegmentation) s = part ? segment(part, &params) : NULL;
    if (!s)
        return;
    assert_sound(part, s);
    g_assert_cmpuint(s->n_regions, ==, 3);
    for (int32_t f = 0; f < part->n_faces; f++) {
        double low, high;
        reach_z(part, f, &low, &high);
        bool end = low < 1 || high > 47;
        g_assert_cmpint(region_of(s, f)->kind, ==, end ? SEG_REGION_LOCAL : SEG_REGION_REST);
    }
}

/* ------------------------------------------------------------------ choices by hand */

static void test_by_hand(void)
{
    g_autoptr(SegPart) part = load("p0_piece");
    if (!part)
        return;
    const int32_t faces[] = {9}, tags[] = {1, 4}, wrong[] = {99};
    const int32_t reassign[][2] = {{3, 1}, {7, 1}, {0, 9}};

    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    params.local_faces = faces;
    params.n_local_faces = 1;
    g_autoptr(SegSegmentation) by_face = segment(part, &params);
    g_assert_cmpuint(by_face ? by_face->n_regions : 0, ==, 2);
    g_assert_cmpuint(by_face ? by_face->regions[1].n_pieces : 0, ==, 1);

    params = SEG_FEATURE_SIZE_DEFAULTS;
    params.reassign = reassign;
    params.n_reassign = 3;
    params.local_tags = tags;
    params.n_local_tags = 2;
    g_autoptr(SegSegmentation) by_tag = segment(part, &params);
    if (by_tag) {
        assert_sound(part, by_tag);
        g_assert_cmpint(region_of(by_tag, 3)->kind, ==, SEG_REGION_LOCAL);
        g_assert_cmpint(region_of(by_tag, 9)->kind, ==, SEG_REGION_LOCAL);
        g_assert_cmpint(region_of(by_tag, 6)->kind, ==, SEG_REGION_LOCAL);
        g_assert_cmpint(region_of(by_tag, 0)->kind, ==, SEG_REGION_REST);
    }

    const struct {
        const char *what;
        SegFeatureSizeParams params;
    } refused[] = {
        {"local_faces 99", {.local_faces = wrong, .n_local_faces = 1}},
        {"local_tags 99", {.local_tags = wrong, .n_local_tags = 1}},
        {"reassign 99:1", {.reassign = &(const int32_t[2]){99, 1}, .n_reassign = 1}},
        {"reassign 1:99", {.reassign = &(const int32_t[2]){1, 99}, .n_reassign = 1}},
        {"tolerance", {.tolerance = -1}},
        {"tolerance", {.tolerance = NAN}},
        {"local_ratio", {.local_ratio = 1.5}},
        {"points", {.repair = SEG_REPAIR_POINTS, .points = -1}},
        {"every face", {.min_size_mm = 1000}},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(refused); i++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(SegSegmentation) none =
            seg_segment_feature_size(part, &refused[i].params, &error);
        g_assert_null(none);
        g_assert_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT);
        g_assert_nonnull(error ? strstr(error->message, refused[i].what) : NULL);
    }
}

static void test_drop_and_split(void)
{
    g_autoptr(SegPart) part = load("p0_piece");
    if (!part)
        return;
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    params.min_size_mm = 16;
    params.split_rest = true;
    g_autoptr(SegSegmentation) s = segment(part, &params);
    if (!s)
        return;
    g_assert_cmpuint(s->n_dropped, ==, 4); /* the top edges and caps of both bosses */
    for (size_t i = 0; i < s->n_dropped; i++) {
        g_assert_null(region_of(s, s->dropped[i].face));
        g_assert_nonnull(strstr(s->dropped[i].reason, "min_size_mm 16"));
    }
    g_assert_nonnull(region_named(s, "rest-1"));
    g_assert_nonnull(region_named(s, "rest-2"));
    g_assert_null(region_named(s, "rest"));
    g_assert_cmpstr(s->method, ==, "feature-size");
    const char *const expected[] = {"local_faces=",    "local_ratio=0.5",
                                    "local_tags=",     "min_size_mm=16",
                                    "reassign=",       "repair=exact",
                                    "split_rest=true", "subset_tolerance=0",
                                    "tolerance=0.05",  NULL};
    g_assert_true(g_strv_equal((const char *const *)s->parameters, expected));
}

/* ------------------------------------------------------------------ classes */

static SegFeatureSize size(double length, double width, double height)
{
    return (SegFeatureSize){sqrt(length * length + width * width + height * height), length, width,
                            height};
}

static void test_classes(void)
{
    /* A chain of neighbours, 3 % apart each: the first takes what is within 5 % of itself. */
    SegFeatureSize chain[8];
    for (int i = 0; i < 8; i++)
        chain[i] = size(100 * pow(0.97, i), 0, 0);
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    g_auto(SegClasses) classes = {0};
    g_assert_true(seg_classify(chain, 8, &params, &classes, NULL));
    g_assert_cmpint(classes.n_tags, ==, 4);
    for (int i = 0; i < 8; i++)
        g_assert_cmpint(classes.tag[i], ==, i / 2 + 1);
    test_near(classes.opening_mm[1], 100 * 0.97 * 0.97, 0, 1e-12);

    /* Of one diagonal, but of two shapes: apart only by their subset sizes. */
    SegFeatureSize shapes[4] = {size(30, 40, 0), size(50, 0, 0), size(30, 40, 0), size(49, 0, 0)};
    for (int i = 0; i < 2; i++) {
        g_auto(SegClasses) shaped = {0};
        params.subset_tolerance = i ? 0.05 : 0;
        g_assert_true(seg_classify(shapes, 4, &params, &shaped, NULL));
        g_assert_cmpint(shaped.n_tags, ==, i ? 2 : 1);
        g_assert_cmpint(shaped.tag[0], ==, shaped.tag[2]);
        g_assert_cmpint(shaped.tag[1], ==, shaped.tag[3]);
    }
}

/* ------------------------------------------------------------------ repair */

/* Figure 8: more points, smaller error; the exact repair is what they approach, from below. */
static void test_repair(void)
{
    g_autoptr(SegPart) part = load("impeller");
    if (!part)
        return;
    SegFeatureSizeParams exact = SEG_FEATURE_SIZE_DEFAULTS, points = exact, rule = exact;
    points.repair = SEG_REPAIR_POINTS;
    rule.repair = SEG_REPAIR_RULE;
    rule.datum_mm = 100;
    const int counts[] = {0, 1, 7, 31, 500};
    double worst[5] = {0}, worst_rule = 0;
    for (int32_t f = 0; f < part->n_faces; f++) {
        double truth = seg_feature_size(part, f, &exact, NULL).diagonal_mm;
        for (int i = 0; i < 5; i++) {
            points.points = counts[i];
            size_t n = 0;
            double found = seg_feature_size(part, f, &points, &n).diagonal_mm;
            g_assert_cmpfloat(found, <=, truth * (1 + 1e-9));
            worst[i] = fmax(worst[i], 1 - found / truth);
            g_assert_cmpuint(n % (size_t)MAX(counts[i], 1), ==, 0);
        }
        double ruled = seg_feature_size(part, f, &rule, NULL).diagonal_mm;
        worst_rule = fmax(worst_rule, 1 - ruled / truth);
    }
    g_test_message("largest error: %.3g (0 points), %.3g (1), %.3g (7), %.3g (31), %.3g (500), "
                   "%.3g (rule)",
                   worst[0], worst[1], worst[2], worst[3], worst[4], worst_rule);
    g_assert_cmpfloat(worst[2], <, 0.0137);
    g_assert_cmpfloat(worst[3], <, worst[2]);
    g_assert_cmpfloat(worst[4], <, 1e-5);
}

/* The rule on edges of known length: a face of 6 × 4 within a datum that makes each case. */
static void test_rule(void)
{
    g_autoptr(SegPart) part = load("p0_piece");
    if (!part)
        return;
    int32_t bottom = -1;
    for (int32_t f = 0; f < part->n_faces; f++)
        if (fabs(seg_face_area_mm2(part, f) - 1800) < 1e-6)
            bottom = f;
    g_assert_cmpint(bottom, >=, 0);
    /* Four edges: 30, 60, 30, 60 mm (the long ones may be in two). */
    const SegFace *face = &part->faces[MAX(bottom, 0)];
    g_assert_cmpint(part->loops[face->first_loop].n_coedges, ==, 4);
    const struct {
        double datum_mm;
        size_t points;
    } cases[] = {{40, 2 * 7 + 2 * 7},
                 {59, 2 * 7 + 2 * 5},
                 {80, 2 * 7 + 2 * 3},
                 {100, 2 * 5 + 2 * 1},
                 {190, 2 * 3 + 2 * 1},
                 {301, 2 * 1},
                 {601, 0}};
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    params.repair = SEG_REPAIR_RULE;
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        size_t n = 0;
        params.datum_mm = cases[i].datum_mm;
        SegFeatureSize found = seg_feature_size(part, MAX(bottom, 0), &params, &n);
        g_assert_cmpuint(n, ==, cases[i].points);
        test_near(found.diagonal_mm, sqrt(30 * 30 + 60 * 60), 0, 1e-12);
    }
}

static void add(void)
{
    g_test_add_func("/segcore/feature-size/p0-piece", test_p0_piece);
    g_test_add_func("/segcore/feature-size/impeller", test_impeller);
    g_test_add_func("/segcore/feature-size/blade", test_blade);
    g_test_add_func("/segcore/feature-size/by-hand", test_by_hand);
    g_test_add_func("/segcore/feature-size/drop-and-split", test_drop_and_split);
    g_test_add_func("/segcore/feature-size/classes", test_classes);
    g_test_add_func("/segcore/feature-size/repair", test_repair);
    g_test_add_func("/segcore/feature-size/rule", test_rule);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
