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

/* One wrong entry a case; the message names the table and the entry. */
static void test_entries(void)
{
    enum { CASES = 34 };
    for (int i = 0; i < CASES; i++) {
        g_autoptr(Form) form = form_sample();
        SegFace *face = &g_array_index(form->faces, SegFace, 1);
        SegLoop *loop = &g_array_index(form->loops, SegLoop, 1);
        SegCoedge *coedge = &g_array_index(form->coedges, SegCoedge, 5);
        SegEdge *edge = &g_array_index(form->edges, SegEdge, 5);
        SegVertex *vertex = &g_array_index(form->vertices, SegVertex, 6);
        SegTriangle *triangle = &g_array_index(form->triangles, SegTriangle, 3);
        double *reals = (double *)(void *)form->reals->data;
        double *knots = reals + face->surface.data;
        double *weights = knots + 6 + 4 + 18;
        const char *what = "faces[1]";
        switch (i) {
        case 0:
            face->type = SEG_N_SURFACE_TYPES;
            break;
        case 1:
            face->type = -1;
            break;
        case 2:
            face->reversed = 2;
            break;
        case 3:
            face->surface.degree_u = 0;
            break;
        case 4:
            face->surface.degree_u = 26;
            break;
        case 5:
            face->surface.n_u = 2;
            break;
        case 6:
            face->surface.n_v = INT32_MAX;
            break;
        case 7:
            face->surface.rational = 7;
            break;
        case 8:
            face->surface.data = -1;
            break;
        case 9:
            face->surface.data = INT64_MAX;
            break;
        case 10:
            knots[2] = 2;
            break;
        case 11:
            knots[3] = knots[4] = knots[5] = 0;
            break;
        case 12:
            weights[3] = 0;
            break;
        case 13:
            weights[3] = -1;
            break;
        case 14:
            face->axis = seg_vec3(0, 0, 2);
            break;
        case 15:
            face->radius_mm = 0;
            break;
        case 16:
            face->n_loops = 0;
            break;
        case 17:
            face->first_loop = 0;
            break;
        case 18:
            face->n_triangles = 3;
            break;
        case 19:
            face->n_iges_curves = 1;
            break;
        case 20:
            face->type = SEG_SURFACE_MESH;
            break;
        case 21:
            face->iges_de = -1;
            break;
        case 22:
            what = "loops[1]";
            loop->n_coedges = 5;
            break;
        case 23:
            what = "loops[1]";
            loop->first_coedge = 3;
            break;
        case 24:
            what = "coedges[5]";
            coedge->edge = 8;
            break;
        case 25:
            what = "coedges[5]";
            coedge->pcurve.dim = 3;
            break;
        case 26:
            what = "coedges[5]";
            coedge->t_last = coedge->t_first;
            break;
        case 27:
            what = "edges[5]";
            edge->t_last = 11;
            break;
        case 28:
            what = "edges[5]";
            edge->face[1] = 2;
            break;
        case 29:
            what = "does not name face 1";
            edge->face[0] = 0;
            break;
        case 30:
            what = "vertices[6]";
            vertex->normal = seg_vec3(0, 0, 1.1);
            break;
        case 31:
            what = "vertices[6]";
            vertex->position.y = NAN;
            break;
        case 32:
            what = "triangles[3]";
            triangle->vertex[1] = 2;
            break;
        case 33:
            what = "reals[";
            reals[form->reals->len - 1] = INFINITY;
            break;
        }
        g_autoptr(GBytes) bytes = form_bytes(form);
        assert_refused(bytes, what);
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
