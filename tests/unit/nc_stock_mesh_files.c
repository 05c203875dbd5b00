/* SPDX-License-Identifier: Apache-2.0 */
/* The in-process model as a file: read by our own reader and judged by ADMesh. */
#include <stdio.h>
#include <string.h>

#include "nc/nc.h"
#include "tests/lib/mesh_check.h"
#include "tests/lib/test.h"

/* A box with a ball's groove through it, a blind hole, and a piece sawn off. */
static NcMesh *sample(void)
{
    CfgTool tools[] = {{.number = 7,
                        .kind = CFG_TOOL_BALL,
                        .diameter_mm = 6,
                        .corner_radius_mm = 3,
                        .flute_length_mm = 40,
                        .shank_diameter_mm = 6,
                        .stickout_mm = 60,
                        .holder_diameter_mm = 30},
                       {.number = 8,
                        .kind = CFG_TOOL_FLAT,
                        .diameter_mm = 4,
                        .flute_length_mm = 40,
                        .shank_diameter_mm = 4,
                        .stickout_mm = 60,
                        .holder_diameter_mm = 30}};
    const CfgToolTable table = {tools, G_N_ELEMENTS(tools)};
    NcMove groove = {.kind = NC_MOVE_FEED,
                     .line = 12,
                     .tool = 7,
                     .from = {-5, 6, -2},
                     .to = {25, 9, -3},
                     .feed_mm_min = 500,
                     .spindle_rpm = 9000};
    NcMove hole = groove, saw = groove;
    hole.tool = saw.tool = 8;
    hole.line = 20;
    hole.from = seg_vec3(5, 3, 9);
    hole.to = seg_vec3(5, 3, -4);
    saw.line = 25;
    saw.from = seg_vec3(15, -5, -7);
    saw.to = seg_vec3(15, 20, -7);
    const NcMove moves[] = {groove, hole, saw};
    const NcStockOptions options = {0.25, 1ull << 28};
    g_autoptr(GError) error = NULL;
    g_autoptr(NcStock) stock =
        nc_stock_new_box(seg_vec3(0, 0, -6), seg_vec3(20, 12, 0), &options, &error);
    if (stock)
        nc_stock_cut(stock, moves, G_N_ELEMENTS(moves), seg_vec3(0, 0, 0), &table, NULL, &error);
    g_assert_no_error(error);
    return stock ? nc_stock_mesh(stock) : NULL;
}

/* The same triangles in the same order, to the last bit. */
static void assert_same(const NcMesh *mesh, const SegPart *part)
{
    if (!part)
        return;
    g_assert_cmpuint((size_t)part->n_triangles, ==, mesh->n_triangles);
    for (size_t t = 0; t < MIN(mesh->n_triangles, (size_t)part->n_triangles); t++)
        for (int i = 0; i < 3; i++) {
            const SegVec3 a = mesh->vertices[mesh->triangles[t].vertex[i]];
            const SegVec3 b = part->vertices[part->triangles[t].vertex[i]].position;
            if ((float)a.x != (float)b.x || (float)a.y != (float)b.y || (float)a.z != (float)b.z)
                g_test_fail_printf("triangle %zu, corner %d: read %g, %g, %g for %g, %g, %g", t, i,
                                   b.x, b.y, b.z, a.x, a.y, a.z);
        }
}

static void read_back(void)
{
    char *folder = test_folder();
    g_autoptr(NcMesh) mesh = sample();
    for (int k = 0; mesh && k < 2; k++) {
        g_autofree char *path = g_build_filename(folder, k == 0 ? "a.stl" : "a.off", NULL);
        g_autoptr(GError) error = NULL;
        gsize length;
        g_autofree char *bytes = NULL;
        nc_mesh_write(mesh, path, &error);
        g_assert_no_error(error);
        g_assert_true(g_file_get_contents(path, &bytes, &length, NULL));
        g_autoptr(SegPart) part = seg_part_from_mesh(bytes, length, path, &error);
        g_assert_no_error(error);
        assert_same(mesh, part);
    }
    test_folder_remove(folder);
}

/* What the files say of tools and lines: the attribute, the runs beside, the numbers behind faces.
 */
static void origins(void)
{
    char *folder = test_folder();
    g_autofree char *stl = g_build_filename(folder, "a.stl", NULL);
    g_autofree char *runs = g_build_filename(folder, "a.stl.json", NULL);
    g_autofree char *off = g_build_filename(folder, "a.off", NULL);
    g_autofree char *bytes = NULL, *json = NULL, *text = NULL;
    g_autoptr(NcMesh) mesh = sample();
    size_t seen[26] = {0};
    if (mesh && nc_mesh_write(mesh, stl, NULL) && nc_mesh_write(mesh, off, NULL) &&
        g_file_get_contents(stl, &bytes, NULL, NULL) &&
        g_file_get_contents(runs, &json, NULL, NULL) &&
        g_file_get_contents(off, &text, NULL, NULL)) {
        const char *run = strstr(json, "\"runs\":[") + 8;
        const char *face = strrchr(text, '\0') - 1;
        size_t left = 0;
        unsigned tool = 0, first = 0, last = 0;
        for (size_t t = 0; t < mesh->n_triangles; t++) {
            const NcMeshTriangle *made = &mesh->triangles[t];
            uint16_t attribute;
            memcpy(&attribute, bytes + 84 + 50 * t + 48, sizeof attribute);
            g_assert_cmpuint(attribute, ==, (guint)made->tool);
            if (left == 0) {
                g_assert_cmpint(sscanf(run, "%*[,\n][%zu,%u,%u,%u]", &left, &tool, &first, &last),
                                ==, 4);
                run = strchr(run, ']') + 1;
            }
            left--;
            g_assert_cmpuint(tool, ==, (guint)made->tool);
            g_assert_cmpuint(first, ==, made->first_line);
            g_assert_cmpuint(last, ==, made->last_line);
            seen[MIN(made->last_line, 25)]++;
        }
        g_assert_cmpuint(left, ==, 0);
        g_assert_cmpstr(run, ==, "\n]}\n");
        while (face > text && face[-1] != '\n')
            face--;
        const NcMeshTriangle *made = &mesh->triangles[mesh->n_triangles - 1];
        g_autofree char *expected =
            g_strdup_printf("3 %d %d %d # %d %u %u\n", made->vertex[0], made->vertex[1],
                            made->vertex[2], made->tool, made->first_line, made->last_line);
        g_assert_cmpstr(face, ==, expected);
    }
    for (size_t line = 0; line < G_N_ELEMENTS(seen); line++)
        g_assert_true((seen[line] > 0) == (line == 0 || line == 12 || line == 20 || line == 25));
    test_folder_remove(folder);
}

static double number_behind(const char *text, const char *label)
{
    const char *at = text ? strstr(text, label) : NULL;
    at = at ? strchr(at, ':') : NULL;
    return at ? g_ascii_strtod(at + 1, NULL) : -1;
}

static void judged_by_admesh(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "a.stl", NULL);
    g_autofree char *said = NULL;
    g_autoptr(NcMesh) mesh = sample();
    g_autoptr(GError) error = NULL;
    char *argv[] = {"admesh", path, NULL};
    if (mesh && nc_mesh_write(mesh, path, &error) &&
        g_spawn_sync(folder, argv, NULL, G_SPAWN_SEARCH_PATH, NULL, NULL, &said, NULL, NULL,
                     &error)) {
        g_assert_cmpfloat(number_behind(said, "Number of facets"), ==, (double)mesh->n_triangles);
        g_assert_cmpfloat(number_behind(said, "Number of parts"), ==, 2);
        test_near(number_behind(said, "Volume"), test_mesh_volume_mm3(mesh), 0, 1e-4);
        const char *const none[] = {"Total disconnected facets",
                                    "Degenerate facets",
                                    "Edges fixed",
                                    "Facets removed",
                                    "Facets added",
                                    "Facets reversed",
                                    "Backwards edges",
                                    "Normals fixed"};
        for (size_t i = 0; i < G_N_ELEMENTS(none); i++)
            g_assert_cmpfloat(number_behind(said, none[i]), ==, 0);
    }
    g_assert_no_error(error);
    test_folder_remove(folder);
}

/* The one before stays, and nothing is left beside it. */
static void cannot_write(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "absent", "a.stl", NULL);
    g_autofree char *taken = g_build_filename(folder, "taken.off", NULL);
    g_autofree char *inside = g_build_filename(taken, "x", NULL);
    g_autoptr(NcMesh) mesh = sample();
    g_autoptr(GError) error = NULL, second = NULL;
    g_assert_cmpint(g_mkdir_with_parents(inside, 0777), ==, 0);
    if (mesh) {
        g_assert_false(nc_mesh_write(mesh, path, &error));
        g_assert_error(error, G_FILE_ERROR, G_FILE_ERROR_NOENT);
        g_assert_false(nc_mesh_write(mesh, taken, &second));
        g_assert_true(second && strstr(second->message, "taken.off"));
    }
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    g_assert_cmpstr(g_dir_read_name(dir), ==, "taken.off");
    g_assert_null(g_dir_read_name(dir));
    test_folder_remove(folder);
}

static void add(void)
{
    g_test_add_func("/nc/stock/mesh/read-back", read_back);
    g_test_add_func("/nc/stock/mesh/origins", origins);
    g_test_add_func("/nc/stock/mesh/admesh", judged_by_admesh);
    g_test_add_func("/nc/stock/mesh/cannot-write", cannot_write);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
