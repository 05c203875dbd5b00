/* SPDX-License-Identifier: Apache-2.0 */
/* Stock around a part and from files, against bodies whose volume and surface are known. */
#include <string.h>

#include "nc/nc.h"
#include "nc/stock/near_net.h"
#include "tests/lib/mesh_check.h"
#include "tests/lib/test.h"

/* A closed box, outward; hollow ones face the other way. */
static void add_box(GString *points, GString *faces, int *n, SegVec3 min, SegVec3 max, bool hollow)
{
    static const int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                    {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (int c = 0; c < 8; c++)
        g_string_append_printf(points, "%.17g %.17g %.17g\n", c & 1 ? max.x : min.x,
                               c & 2 ? max.y : min.y, c & 4 ? max.z : min.z);
    for (int f = 0; f < 6; f++) {
        g_string_append(faces, "4");
        for (int i = 0; i < 4; i++)
            g_string_append_printf(faces, " %d", 8 * *n + quads[f][hollow ? 3 - i : i]);
        g_string_append_c(faces, '\n');
    }
    (*n)++;
}

typedef struct {
    SegVec3 min, max;
    bool hollow;
} Box;

static SegPart *part_of(const Box *boxes, int n_boxes)
{
    g_autoptr(GString) points = g_string_new(NULL);
    g_autoptr(GString) faces = g_string_new(NULL);
    int n = 0;
    for (int i = 0; i < n_boxes; i++)
        add_box(points, faces, &n, boxes[i].min, boxes[i].max, boxes[i].hollow);
    g_autofree char *text =
        g_strdup_printf("OFF\n%d %d 0\n%s%s", 8 * n, 6 * n, points->str, faces->str);
    g_autoptr(GError) error = NULL;
    SegPart *part = seg_part_from_mesh(text, strlen(text), "boxes.off", &error);
    g_assert_no_error(error);
    return part;
}

/* The stock of a recipe with these settings, the part standing as it is. */
static NcStock *stock_of(const SegPart *part, double pitch_mm, const char *const *set,
                         GError **error)
{
    g_autoptr(CfgRecipe) recipe = cfg_recipe_default("part.off", (char *const *)set, error);
    if (!recipe)
        return NULL;
    const NcSetup setup = nc_setup_new(part, CFG_UP_PLUS_Z, CFG_ZERO_PART);
    const NcStockOptions options = {pitch_mm, 1ull << 30};
    return nc_stock_from_recipe(part, &setup, recipe, &options, error);
}

static NcMesh *near_net(const SegPart *part, double pitch_mm, double allowance_mm)
{
    g_autofree char *allowance = g_strdup_printf("stock.allowance_mm=%g", allowance_mm);
    const char *const set[] = {allowance, NULL};
    g_autoptr(GError) error = NULL;
    g_autoptr(NcStock) stock = stock_of(part, pitch_mm, set, &error);
    g_assert_no_error(error);
    if (!stock)
        return NULL;
    NcMesh *mesh = nc_stock_mesh(stock);
    test_mesh_is_solid(mesh);
    return mesh;
}

/* Steiner's formula for a box: V + A·r + π·r²·(a + b + c) + 4/3·π·r³. */
static double rounded_box_volume(double a, double b, double c, double r)
{
    return a * b * c + 2 * r * (a * b + b * c + c * a) + G_PI * r * r * (a + b + c) +
           4.0 / 3 * G_PI * r * r * r;
}

static void rounded_box(void)
{
    const double pitch = 0.2, r = 1.5;
    const Box box = {{-2, 1, 3}, {8, 5, 6}, false};
    g_autoptr(SegPart) part = part_of(&box, 1);
    g_autoptr(NcMesh) mesh = near_net(part, pitch, r);
    test_near(test_mesh_volume_mm3(mesh), rounded_box_volume(10, 4, 3, r), 0, 1e-3);
    g_assert_cmpuint(test_mesh_shells(mesh), ==, 1);
    double worst = 0;
    for (size_t v = 0; v < mesh->n_vertices; v++) {
        const SegVec3 p = mesh->vertices[v];
        const SegVec3 off = {fmax(0, fmax(-2 - p.x, p.x - 8)), fmax(0, fmax(1 - p.y, p.y - 5)),
                             fmax(0, fmax(3 - p.z, p.z - 6))};
        worst = fmax(worst, fabs(seg_norm(off) - r));
    }
    g_assert_cmpfloat(worst, <, pitch * pitch / (2 * r));
}

/* Two boxes that overlap, as assemblies have them: one body, no matter that faces lie inside. */
static void overlapping_boxes(void)
{
    const Box boxes[] = {{{0, 0, 0}, {10, 4, 4}, false}, {{3, -3, 1}, {6, 7, 3}, false}};
    g_autoptr(SegPart) part = part_of(boxes, 2);
    g_autoptr(NcMesh) mesh = near_net(part, 0.2, 0.25);
    g_assert_cmpuint(test_mesh_shells(mesh), ==, 1);
    /* Where both stick out of each other their roundings run together: second order in r. */
    const double r = 0.25, apart = 160 + 60 - 3 * 4 * 2, area = 192 + 112 - 52;
    g_assert_cmpfloat(test_mesh_volume_mm3(mesh), >, apart + 0.8 * r * area);
    g_assert_cmpfloat(test_mesh_volume_mm3(mesh), <, apart + 1.2 * r * area);
}

/* A void larger than the allowances on both its sides stays one. */
static void voids(void)
{
    const double r = 0.5;
    for (int i = 0; i < 2; i++) {
        const double half = i == 0 ? 0.4 : 2;
        const Box boxes[] = {{{-5, -5, -5}, {5, 5, 5}, false},
                             {{-half, -half, -half}, {half, half, half}, true}};
        g_autoptr(SegPart) part = part_of(boxes, 2);
        g_autoptr(NcMesh) mesh = near_net(part, 0.2, r);
        const double left = i == 0 ? 0 : pow(2 * (half - r), 3);
        test_near(test_mesh_volume_mm3(mesh), rounded_box_volume(10, 10, 10, r) - left, 0, 1e-3);
        g_assert_cmpuint(test_mesh_shells(mesh), ==, i == 0 ? 1 : 2);
    }
}

/* An open surface has the allowance on both sides: 2·r·A + π·r²·P/2 + 4/3·π·r³. */
static void one_triangle(void)
{
    static const char text[] = "OFF\n3 1 0\n0 0 0\n9 1 2\n2 7 -1\n3 0 1 2\n";
    const SegVec3 a = {0, 0, 0}, b = {9, 1, 2}, c = {2, 7, -1};
    const double r = 1, pitch = 0.15;
    g_autoptr(SegPart) part = seg_part_from_mesh(text, strlen(text), "triangle.off", NULL);
    g_autoptr(NcMesh) mesh = near_net(part, pitch, r);
    const double area = seg_norm(seg_cross(seg_sub(b, a), seg_sub(c, a))) / 2;
    const double around = seg_distance(a, b) + seg_distance(b, c) + seg_distance(c, a);
    test_near(test_mesh_volume_mm3(mesh),
              2 * r * area + G_PI * r * r * around / 2 + 4.0 / 3 * G_PI * r * r * r, 0, 2e-3);
}

static double volume_of(const SegPart *part, const char *const *set)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(NcStock) stock = stock_of(part, 0.2, set, &error);
    g_assert_no_error(error);
    g_autoptr(NcMesh) mesh = stock ? nc_stock_mesh(stock) : NULL;
    return mesh ? test_mesh_volume_mm3(mesh) : NAN;
}

static void kinds(void)
{
    const Box box = {{-2, 1, 3}, {4, 9, 6}, false};
    g_autoptr(SegPart) part = part_of(&box, 1);
    const char *const around[] = {"stock.kind=box", "stock.allowance_mm=1", NULL};
    test_near(volume_of(part, around), 8 * 10 * 5, 0, 1e-4);
    const char *const named[] = {"stock.kind=box", "stock.min_mm=0, 0, 0", "stock.max_mm=5, 6, 7",
                                 NULL};
    test_near(volume_of(part, named), 5 * 6 * 7, 0, 1e-4);
    const char *const round[] = {"stock.kind=cylinder", "stock.allowance_mm=1", NULL};
    test_near(volume_of(part, round), G_PI * 6 * 6 * 5, 0, 5e-4);
    const char *const bar[] = {"stock.kind=cylinder", "stock.min_mm=-3, -3, 0",
                               "stock.max_mm=3, 3, 7", NULL};
    test_near(volume_of(part, bar), G_PI * 9 * 7, 0, 5e-4);
    const char *const oval[] = {"stock.kind=cylinder", "stock.min_mm=-3, -3, 0",
                                "stock.max_mm=3, 4, 7", NULL};
    g_autoptr(GError) error = NULL;
    g_autoptr(NcStock) none = stock_of(part, 0.2, oval, &error);
    g_assert_null(none);
    g_assert_error(error, NC_ERROR, NC_ERROR_PLAN);
}

static void files(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "stock.off", NULL);
    g_autofree char *setting = g_strconcat("stock.file=", path, NULL);
    const Box box = {{-2, 1, 3}, {4, 9, 6}, false};
    g_autoptr(SegPart) part = part_of(&box, 1);
    const char *const near[] = {"stock.allowance_mm=0.7", NULL};
    const char *const file[] = {"stock.kind=file", setting, NULL};
    const char *const bare[] = {"stock.allowance_mm=0", NULL};
    g_autoptr(GError) error = NULL;
    g_autoptr(NcMesh) mesh = near_net(part, 0.2, 0.7);
    g_assert_true(nc_mesh_write(mesh, path, NULL));
    test_near(volume_of(part, file), volume_of(part, near), 0, 2e-3);
    test_near(volume_of(part, bare), 6 * 8 * 3, 0, 1e-4);
    g_assert_true(g_file_set_contents(path, "none", -1, NULL));
    g_autoptr(NcStock) none = stock_of(part, 0.2, file, &error);
    g_assert_null(none);
    g_assert_true(error && strstr(error->message, "stock.off"));
    test_folder_remove(folder);
}

static void add(void)
{
    g_test_add_func("/nc/stock/near-net/box", rounded_box);
    g_test_add_func("/nc/stock/near-net/overlapping", overlapping_boxes);
    g_test_add_func("/nc/stock/near-net/voids", voids);
    g_test_add_func("/nc/stock/near-net/open", one_triangle);
    g_test_add_func("/nc/stock/recipe/kinds", kinds);
    g_test_add_func("/nc/stock/recipe/files", files);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
