/* SPDX-License-Identifier: Apache-2.0 */
/* STL and OFF: what is read, and what is refused. */
#include <string.h>

#include "segcore/segcore.h"
#include "tests/lib/test.h"

static SegPart *read_mesh(const void *bytes, size_t length, GError **error)
{
    return seg_part_from_mesh(bytes, length, "part.stl", error);
}

/* A tetrahedron with legs of 1 mm: area 3/2 + √3/2. */
static const double TETRAHEDRON_MM2 = 1.5 + 0.86602540378443864676;

static const char ascii[] = "solid tip with facet in its name\n"
                            " facet normal 0 0 -1\n  outer loop\n"
                            "   vertex 0 0 0\n   vertex 0 1 0\n   vertex 1 0 0\n"
                            "  endloop\n endfacet\n"
                            " FACET NORMAL nan nan nan\n  OUTER LOOP\n"
                            "   VERTEX 0 0 0\n   VERTEX 1.0e0 0 0\n   VERTEX 0 0 1\n"
                            "  ENDLOOP\n ENDFACET\n"
                            "facet normal -1 0 0 outer loop vertex 0 0 0 vertex 0 0 1 vertex 0 1 0 "
                            "endloop endfacet\r\n"
                            " facet normal 1 1 1\n  outer loop\n"
                            "   vertex 1 0 0\n   vertex 0 1 0\n   vertex 0 0 1\n"
                            "  endloop\n endfacet\n"
                            "endsolid tip\n";

static void assert_tetrahedron(SegPart *part)
{
    g_assert_nonnull(part);
    if (!part)
        return;
    g_assert_cmpint(part->n_triangles, ==, 4);
    g_assert_cmpint(part->n_faces, ==, 1);
    g_assert_cmpint(part->faces[0].type, ==, SEG_SURFACE_MESH);
    g_autoptr(SegSegmentation) whole = seg_segment_none(part, NULL);
    test_near(whole->regions[0].area_mm2, TETRAHEDRON_MM2, 0, 1e-12);
    test_near(whole->regions[0].feature_size_mm[0], sqrt(3), 0, 1e-12);
    g_assert_cmpstr(whole->regions[0].name, ==, "part");
    g_assert_cmpuint(whole->regions[0].n_triangles, ==, 4);
    /* Facet normals, outwards: away from the centre. */
    SegVec3 centre = seg_vec3(0.25, 0.25, 0.25);
    for (int32_t i = 0; i < part->n_vertices; i++) {
        const SegVertex *v = &part->vertices[i];
        test_near(seg_norm(v->normal), 1, 0, 1e-12);
        g_assert_cmpfloat(seg_dot(v->normal, seg_sub(v->position, centre)), >, 0);
    }
}

static void test_ascii(void)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = read_mesh(ascii, strlen(ascii), &error);
    g_assert_no_error(error);
    assert_tetrahedron(part);
}

static const float corners[4][9] = {{0, 0, 0, 0, 1, 0, 1, 0, 0},
                                    {0, 0, 0, 1, 0, 0, 0, 0, 1},
                                    {0, 0, 0, 0, 0, 1, 0, 1, 0},
                                    {1, 0, 0, 0, 1, 0, 0, 0, 1}};
enum { BINARY_BYTES = 84 + 4 * 50 };

/* With a header that begins as an ascii file does. */
static void write_binary(char bytes[BINARY_BYTES])
{
    memset(bytes, 0, BINARY_BYTES);
    strcpy(bytes, "solid tip");
    bytes[80] = 4;
    for (int i = 0; i < 4; i++)
        memcpy(bytes + 84 + 50 * i + 12, corners[i], sizeof corners[i]);
}

static void test_binary(void)
{
    char bytes[BINARY_BYTES + 49] = {0};
    write_binary(bytes);
    for (size_t trailing = 0; trailing < 50; trailing += 49) {
        g_autoptr(GError) error = NULL;
        g_autoptr(SegPart) part = read_mesh(bytes, BINARY_BYTES + trailing, &error);
        g_assert_no_error(error);
        assert_tetrahedron(part);
    }
}

static void test_off(void)
{
    static const char *const files[] = {
        "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
        "# tip\nOFF 4 4 0 # counts\n\n0 0 0\n1 0 0 # x\n0 1 0\n0 0 1\n"
        "3 0 2 1 255 0 0\n3 0 1 3 0.5 0.5 0.5 1\n3 0 3 2\n3 1 2 3",
        "COFF\r\n4 4 0\r\n0 0 0 255 0 0 1\r\n1 0 0 255 0 0 1\r\n0 1 0 0 0 0 1\r\n0 0 1 9 9 9 1\r\n"
        "3 0 2 1\r\n3 0 1 3\r\n3 0 3 2\r\n3 1 2 3\r\n",
    };
    for (size_t i = 0; i < G_N_ELEMENTS(files); i++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(SegPart) part = read_mesh(files[i], strlen(files[i]), &error);
        g_assert_no_error(error);
        assert_tetrahedron(part);
    }
}

/* A polygon is a fan; a facet without area, an edge and a point are left out. */
static void test_polygon(void)
{
    static const char off[] = "OFF\n5 4 0\n0 0 0\n2 0 0\n2 2 0\n1 3 0\n0 2 0\n"
                              "5 0 1 2 3 4\n3 0 1 1\n2 0 1\n0\n";
    g_autoptr(SegPart) part = read_mesh(off, strlen(off), NULL);
    g_assert_nonnull(part);
    if (!part)
        return;
    g_assert_cmpint(part->n_triangles, ==, 3);
    g_autoptr(SegSegmentation) whole = seg_segment_none(part, NULL);
    test_near(whole->regions[0].area_mm2, 5, 0, 1e-12);
}

static void assert_refused(const void *bytes, size_t length, const char *what)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = read_mesh(bytes, length, &error);
    g_assert_null(part);
    g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    if (error && !strstr(error->message, what)) {
        g_test_message("\"%s\" does not say \"%s\"", error->message, what);
        g_test_fail();
    }
}

static void test_refused_text(void)
{
    static const char *const cases[][2] = {
        {"", "no triangle"},
        {"OFF\n", "count"},
        {"OFF\n4 4\n", "count"},
        {"OFF\n99999999 1 0\n0 0 0\n", "count that fits"},
        {"OFF\n1 99999999999999999999 0\n0 0 0\n", "count that fits"},
        {"OFF\n-3 1 0\n", "count that fits"},
        {"OFF\n3 1 0\n0 0 0\n1 0 x\n0 1 0\n3 0 1 2\n", "part.stl:4: \"x\" is not a coordinate"},
        {"OFF\n3 1 0\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n", "\"nan\" is not a coordinate"},
        {"OFF\n3 1 0\n0 0 0\n1 0 1e300\n0 1 0\n3 0 1 2\n", "\"1e300\" is not a coordinate"},
        {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "vertex \"3\" of 3"},
        {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", "vertex \"-1\" of 3"},
        {"OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "corners"},
        {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 1\n", "no triangle"},
        {"solid a\nendsolid a\n", "no triangle"},
        {"solid a\n", "cut off"},
        {"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n", "cut off"},
        {"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex inf 0 0\n",
         "part.stl:6: unexpected \"inf\""},
        {"solid a\nfacet normal 0 0 1\ninner loop\n", "part.stl:3: unexpected \"inner\""},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++)
        assert_refused(cases[i][0], strlen(cases[i][0]), cases[i][1]);
}

static void test_refused_binary(void)
{
    char bytes[BINARY_BYTES];
    write_binary(bytes);
    assert_refused(bytes, BINARY_BYTES - 1, "says 4 facets");
    assert_refused(bytes, BINARY_BYTES - 50, "says 4 facets");
    memset(bytes + 80, 0xff, 4);
    assert_refused(bytes, BINARY_BYTES, "says 4294967295 facets");
    memset(bytes + 80, 0, 4);
    assert_refused(bytes, BINARY_BYTES, "says 0 facets");
    write_binary(bytes);
    const float infinite = INFINITY;
    memcpy(bytes + 84 + 50 + 16, &infinite, sizeof infinite);
    assert_refused(bytes, BINARY_BYTES, "facet 1: inf");
}

/* Every mesh of the outside data is one that other programs read. */
static void test_data_meshes(void)
{
    static const char *const suffixes[] = {".stl", ".off", NULL};
    static const char *const folders[] = {"mesh", "featurenet_stl"};
    for (size_t k = 0; k < G_N_ELEMENTS(folders); k++) {
        g_autoptr(GPtrArray) files = test_data_files(folders[k], suffixes);
        for (guint i = 0; i < files->len; i++) {
            g_autoptr(GError) error = NULL;
            g_autoptr(SegPart) part = seg_part_load(files->pdata[i], NULL, &error);
            g_assert_no_error(error);
            g_assert_cmpint(part ? part->n_triangles : 0, >, 0);
        }
    }
}

static void add(void)
{
    g_test_add_func("/segcore/mesh/ascii", test_ascii);
    g_test_add_func("/segcore/mesh/binary", test_binary);
    g_test_add_func("/segcore/mesh/off", test_off);
    g_test_add_func("/segcore/mesh/polygon", test_polygon);
    g_test_add_func("/segcore/mesh/refused-text", test_refused_text);
    g_test_add_func("/segcore/mesh/refused-binary", test_refused_binary);
    g_test_add_func("/segcore/mesh/data", test_data_meshes);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
