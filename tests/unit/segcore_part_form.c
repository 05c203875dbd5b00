/* SPDX-License-Identifier: Apache-2.0 */
/* What the reader of the part form takes, and what it refuses. */
#include <string.h>

#include "tests/lib/form.h"
#include "tests/lib/test.h"

static void test_sample(void)
{
    g_autoptr(Form) form = form_sample();
    g_autoptr(SegPart) part = form_part(form);
    g_assert_cmpint(part->n_faces, ==, 2);
    g_assert_cmpint(part->n_triangles, ==, 4);
    g_assert_cmpstr(seg_surface_type_name((SegSurfaceType)part->faces[1].type), ==, "cylinder");
    test_near(seg_face_area_mm2(part, 0), 24, 0, 1e-12);
    test_near(seg_face_area_mm2(part, 1), G_PI / 2 * 5 * 10, 0, 1e-9);
}

/* A slice of a larger block is not aligned: the reader copies it. */
static void test_unaligned(void)
{
    g_autoptr(Form) form = form_sample();
    g_autoptr(GBytes) bytes = form_bytes(form);
    gsize length;
    const void *data = g_bytes_get_data(bytes, &length);
    g_autofree char *block = g_malloc(length + 1);
    memcpy(block + 1, data, length);
    g_autoptr(GBytes) whole = g_bytes_new(block, length + 1);
    g_autoptr(GBytes) slice = g_bytes_new_from_bytes(whole, 1, length);
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = seg_part_from_form(slice, &error);
    g_assert_no_error(error);
    g_assert_nonnull(part);
}

static void assert_refused(GBytes *bytes, const char *what)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = seg_part_from_form(bytes, &error);
    if (part)
        g_test_message("taken, though wrong: %s", what);
    g_assert_null(part);
    g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    if (error && !strstr(error->message, what)) {
        g_test_message("\"%s\" does not say \"%s\"", error->message, what);
        g_test_fail();
    }
}

/* One wrong field a case; the message names the table and the entry. */
typedef struct {
    const char *what;
    size_t table; /* of the Form */
    guint entry;
    size_t field;
    char type; /* i: int32_t, l: int64_t, d: double */
    double value;
} Wrong;

#define AT(table, entry, record, field) offsetof(Form, table), entry, offsetof(record, field)
#define REAL(entry) offsetof(Form, reals), entry, 0

/* Face 1 of the sample: knots in u at real SURFACE, in v behind them, poles, then weights. */
enum { SURFACE = 92, KNOTS_U = 6, WEIGHTS = KNOTS_U + 4 + 18 };

static const Wrong wrongs[] = {
    {"faces[1]", AT(faces, 1, SegFace, type), 'i', SEG_N_SURFACE_TYPES},
    {"faces[1]", AT(faces, 1, SegFace, type), 'i', -1},
    {"faces[1]", AT(faces, 1, SegFace, type), 'i', SEG_SURFACE_MESH},
    {"faces[1]", AT(faces, 1, SegFace, reversed), 'i', 2},
    {"faces[1]", AT(faces, 1, SegFace, surface.degree_u), 'i', 0},
    {"faces[1]", AT(faces, 1, SegFace, surface.degree_u), 'i', 26},
    {"faces[1]", AT(faces, 1, SegFace, surface.n_u), 'i', 2},
    {"faces[1]", AT(faces, 1, SegFace, surface.n_v), 'i', INT32_MAX},
    {"faces[1]", AT(faces, 1, SegFace, surface.rational), 'i', 7},
    {"faces[1]", AT(faces, 1, SegFace, surface.data), 'l', -1},
    {"faces[1]", AT(faces, 1, SegFace, surface.data), 'l', 9e18},
    {"faces[1]: knots decrease", REAL(SURFACE + 2), 'd', 2},
    {"faces[1]: the domain is empty", REAL(SURFACE + 3), 'd', 0},
    {"faces[1]: a weight", REAL(SURFACE + WEIGHTS + 3), 'd', 0},
    {"faces[1]: a weight", REAL(SURFACE + WEIGHTS + 3), 'd', -1},
    {"faces[1]: an axis", AT(faces, 1, SegFace, axis.z), 'd', 2},
    {"faces[1]: the radius", AT(faces, 1, SegFace, radius_mm), 'd', 0},
    {"faces[1]", AT(faces, 1, SegFace, n_loops), 'i', 0},
    {"faces[1]", AT(faces, 1, SegFace, first_loop), 'i', 0},
    {"faces[1]", AT(faces, 1, SegFace, n_triangles), 'i', 3},
    {"faces[1]", AT(faces, 1, SegFace, n_iges_curves), 'i', 1},
    {"faces[1]", AT(faces, 1, SegFace, iges_de), 'i', -1},
    {"loops[1]", AT(loops, 1, SegLoop, n_coedges), 'i', 5},
    {"loops[1]", AT(loops, 1, SegLoop, first_coedge), 'i', 3},
    {"loops[1]", AT(loops, 1, SegLoop, outer), 'i', 2},
    {"coedges[5]", AT(coedges, 5, SegCoedge, edge), 'i', 8},
    {"coedges[5]", AT(coedges, 5, SegCoedge, pcurve.dim), 'i', 3},
    {"coedges[5]", AT(coedges, 5, SegCoedge, t_last), 'd', 0},
    {"edges[5]", AT(edges, 5, SegEdge, t_last), 'd', 11},
    {"edges[5]", AT(edges, 5, SegEdge, face[1]), 'i', 2},
    {"does not name face 1", AT(edges, 5, SegEdge, face[0]), 'i', 0},
    {"vertices[6]", AT(vertices, 6, SegVertex, normal.z), 'd', 1.1},
    {"vertices[6]", AT(vertices, 6, SegVertex, position.y), 'd', NAN},
    {"triangles[3]", AT(triangles, 3, SegTriangle, vertex[1]), 'i', 2},
    {"triangles[3]", AT(triangles, 3, SegTriangle, vertex[1]), 'i', 8},
    {"triangles[3]", AT(triangles, 3, SegTriangle, face), 'i', 0},
    {"reals[0]", REAL(0), 'd', INFINITY},
};

static void spoil(Form *form, const Wrong *wrong)
{
    GArray *table = *(GArray **)(void *)((char *)form + wrong->table);
    void *field = table->data + wrong->entry * g_array_get_element_size(table) + wrong->field;
    int32_t narrow = wrong->type == 'i' ? (int32_t)wrong->value : 0;
    int64_t wide = wrong->type == 'l' ? (int64_t)wrong->value : 0;
    switch (wrong->type) {
    case 'i':
        memcpy(field, &narrow, sizeof narrow);
        break;
    case 'l':
        memcpy(field, &wide, sizeof wide);
        break;
    default:
        memcpy(field, &wrong->value, sizeof wrong->value);
    }
}

static void test_entries(void)
{
    g_autoptr(Form) good = form_sample();
    g_assert_cmpint(g_array_index(good->faces, SegFace, 1).surface.data, ==, SURFACE);
    for (size_t i = 0; i < G_N_ELEMENTS(wrongs); i++) {
        g_autoptr(Form) form = form_sample();
        spoil(form, &wrongs[i]);
        g_autoptr(GBytes) bytes = form_bytes(form);
        assert_refused(bytes, wrongs[i].what);
    }
}

static void test_header(void)
{
    g_autoptr(Form) form = form_sample();
    g_autoptr(GBytes) good = form_bytes(form);
    gsize length;
    const void *data = g_bytes_get_data(good, &length);
    for (int i = 0; i < 9; i++) {
        g_autofree char *block = g_memdup2(data, length);
        SegPartHeader *header = (SegPartHeader *)(void *)block;
        const char *what = NULL;
        gsize size = length;
        switch (i) {
        case 0:
            what = "SEGPART";
            header->magic[0] = 's';
            break;
        case 1:
            what = "version 2";
            header->version = 2;
            break;
        case 2:
            what = "byte order";
            header->byte_order = 0x04030201;
            break;
        case 3:
            what = "sha256";
            header->sha256[63] = 'G';
            break;
        case 4:
            what = "unit_mm";
            header->unit_mm = 0;
            break;
        case 5:
            what = "faces";
            header->n_faces = -1;
            break;
        case 6:
            what = "reals";
            header->n_reals = INT64_MAX;
            break;
        case 7:
            what = "bytes";
            size--;
            break;
        case 8:
            what = "less than a header";
            size = 100;
            break;
        }
        g_autoptr(GBytes) bytes = g_bytes_new(block, size);
        assert_refused(bytes, what);
    }
}

/* Whatever the bytes are, the answer is a part that can be measured, or SEG_ERROR_INPUT. */
static void test_mutations(void)
{
    enum { SEED = 20260102, RUNS = 5000 };
    g_test_message("seed %d", SEED);
    g_autoptr(Form) form = form_sample();
    g_autoptr(GBytes) good = form_bytes(form);
    gsize length;
    const void *data = g_bytes_get_data(good, &length);
    GRand *random = g_rand_new_with_seed(SEED);
    int taken = 0;
    for (int i = 0; i < RUNS; i++) {
        g_autofree uint8_t *block = g_memdup2(data, length);
        for (int k = g_rand_int_range(random, 1, 4); k > 0; k--)
            block[g_rand_int_range(random, 0, (gint32)length)] = (uint8_t)g_rand_int(random);
        g_autoptr(GBytes) bytes = g_bytes_new(block, length);
        g_autoptr(GError) error = NULL;
        g_autoptr(SegPart) part = seg_part_from_form(bytes, &error);
        if (!part) {
            g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
            continue;
        }
        taken++;
        SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
        g_autoptr(SegSegmentation) segmentation = seg_segment_feature_size(part, &params, NULL);
        g_assert_nonnull(segmentation);
    }
    g_rand_free(random);
    g_test_message("%d of %d taken", taken, RUNS);
    g_assert_cmpint(taken, >, 0);
    g_assert_cmpint(taken, <, RUNS);
}

/* The seed of the fuzz target is this sample, so that one can see where it is from. */
static void test_corpus(void)
{
    g_autoptr(Form) form = form_sample();
    g_autoptr(GBytes) bytes = form_bytes(form);
    g_autofree char *kept = NULL;
    gsize length = 0;
    g_autoptr(GError) error = NULL;
    g_file_get_contents("tests/fuzz/corpus/part_form/sample", &kept, &length, &error);
    g_assert_no_error(error);
    g_autoptr(GBytes) seed = g_bytes_new_take(g_steal_pointer(&kept), length);
    g_assert_true(g_bytes_equal(seed, bytes));
}

static void add(void)
{
    g_test_add_func("/segcore/part_form/sample", test_sample);
    g_test_add_func("/segcore/part_form/unaligned", test_unaligned);
    g_test_add_func("/segcore/part_form/header", test_header);
    g_test_add_func("/segcore/part_form/entries", test_entries);
    g_test_add_func("/segcore/part_form/mutations", test_mutations);
    g_test_add_func("/segcore/part_form/corpus", test_corpus);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
