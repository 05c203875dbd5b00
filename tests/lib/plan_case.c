/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/plan_case.h"

#include <stdio.h>
#include <string.h>

#include "tests/lib/test.h"

static SegSegmentation *segmentation_new(const SegPart *part, int n_regions,
                                         int (*region_of)(const SegPart *, int32_t));

static int all_in_one(const SegPart *part, int32_t triangle)
{
    (void)part;
    (void)triangle;
    return 1;
}

PlanCase *plan_case_new(SegPart *part, char *const *set, GError **error)
{
    PlanCase *c = g_new0(PlanCase, 1);
    c->part = part;
    c->recipe = cfg_recipe_default("part", set, error);
    c->machine = c->recipe ? cfg_machine_load("config/etc/machine.ini", error) : NULL;
    c->tools = c->machine ? cfg_tools_load("config/etc/tools.ini", error) : NULL;
    if (!c->tools) {
        plan_case_free(c);
        return NULL;
    }
    c->segmentation = segmentation_new(part, 1, all_in_one);
    c->input = (NcPlanInput){.part = c->part,
                             .segmentation = c->segmentation,
                             .recipe = c->recipe,
                             .machine = c->machine,
                             .tools = c->tools};
    return c;
}

PlanCase *plan_case_load(const char *path, char *const *set, GError **error)
{
    g_autoptr(CfgRecipe) recipe = cfg_recipe_default(path, set, error);
    NcBudget budget;
    if (!recipe || !nc_budget_share(recipe, &budget, error))
        return NULL;
    g_autofree char *helper = test_program("segmill-cad");
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    options.chord_mm = budget.tessellation_mm;
    SegPart *part = seg_part_load(path, &options, error);
    PlanCase *c = part ? plan_case_new(part, set, error) : NULL;
    if (!c || recipe->method != CFG_METHOD_FEATURE_SIZE || part->faces[0].surface.n_u == 0)
        return c;
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    seg_segmentation_free(c->segmentation);
    c->segmentation = seg_segment_feature_size(part, &params, error);
    c->input.segmentation = c->segmentation;
    if (!c->segmentation)
        g_clear_pointer(&c, plan_case_free);
    return c;
}

void plan_case_free(PlanCase *c)
{
    if (!c)
        return;
    g_clear_pointer(&c->segmentation, seg_segmentation_free);
    g_clear_pointer(&c->part, seg_part_unref);
    g_clear_pointer(&c->recipe, cfg_recipe_free);
    g_clear_pointer(&c->machine, cfg_machine_free);
    g_clear_pointer(&c->tools, cfg_tools_free);
    g_free(c);
}

void plan_case_split(PlanCase *c, int n_regions, int (*region_of)(const SegPart *, int32_t))
{
    seg_segmentation_free(c->segmentation);
    c->segmentation = segmentation_new(c->part, n_regions, region_of);
    c->input.segmentation = c->segmentation;
}

static void fill_region(const SegPart *part, SegRegion *region,
                        int (*region_of)(const SegPart *, int32_t))
{
    region->triangles = g_new(int32_t, (size_t)part->n_triangles + 1);
    region->pieces = g_new0(SegPiece, (size_t)part->n_faces + 1);
    for (int32_t f = 0; f < part->n_faces; f++) {
        const SegFace *face = &part->faces[f];
        int32_t taken = 0;
        for (int32_t t = face->first_triangle; t < face->first_triangle + face->n_triangles; t++) {
            if (region_of(part, t) != region->id)
                continue;
            const SegTriangle *triangle = &part->triangles[t];
            SegVec3 a = part->vertices[triangle->vertex[0]].position;
            SegVec3 b = part->vertices[triangle->vertex[1]].position;
            SegVec3 e = part->vertices[triangle->vertex[2]].position;
            region->area_mm2 += seg_norm(seg_cross(seg_sub(b, a), seg_sub(e, a))) / 2;
            region->triangles[region->n_triangles++] = t;
            taken++;
        }
        if (taken > 0 && taken == face->n_triangles && face->surface.n_u > 0)
            region->pieces[region->n_pieces++].face = f;
    }
}

static SegSegmentation *segmentation_new(const SegPart *part, int n_regions,
                                         int (*region_of)(const SegPart *, int32_t))
{
    SegSegmentation *s = g_new0(SegSegmentation, 1);
    s->method = g_strdup("none");
    s->parameters = g_new0(char *, 1);
    s->n_regions = (size_t)n_regions;
    s->regions = g_new0(SegRegion, s->n_regions);
    for (int r = 0; r < n_regions; r++) {
        SegRegion *region = &s->regions[r];
        region->id = r + 1;
        region->name = n_regions == 1 ? g_strdup("part") : g_strdup_printf("region-%d", r + 1);
        region->kind = SEG_REGION_REST;
        region->min_concave_radius_mm = INFINITY;
        fill_region(part, region, region_of);
    }
    return s;
}

/* ------------------------------------------------------------------------ meshes */

static void add_triangle(GString *off, int a, int b, int c, int *n)
{
    g_string_append_printf(off, "3 %d %d %d\n", a, b, c);
    ++*n;
}

static void add_vertex(GString *off, double x, double y, double z)
{
    char text[3][G_ASCII_DTOSTR_BUF_SIZE];
    g_string_append_printf(off, "%s %s %s\n", g_ascii_dtostr(text[0], sizeof text[0], x),
                           g_ascii_dtostr(text[1], sizeof text[1], y),
                           g_ascii_dtostr(text[2], sizeof text[2], z));
}

SegPart *plan_case_height_field(double side, int n, double bottom, double (*height)(double, double))
{
    g_autoptr(GString) vertices = g_string_new(NULL);
    g_autoptr(GString) triangles = g_string_new(NULL);
    int row = n + 1, level = row * row, n_triangles = 0;
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < row; i++)
            for (int j = 0; j < row; j++) {
                double x = side * i / n, y = side * j / n;
                add_vertex(vertices, x, y, k == 0 ? height(x, y) : bottom);
            }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            int a = i * row + j, b = a + row;
            add_triangle(triangles, a, b, b + 1, &n_triangles);
            add_triangle(triangles, a, b + 1, a + 1, &n_triangles);
            add_triangle(triangles, level + a, level + b + 1, level + b, &n_triangles);
            add_triangle(triangles, level + a, level + a + 1, level + b + 1, &n_triangles);
        }
    for (int i = 0; i < n; i++) {
        int edge[4][2] = {{i * row, (i + 1) * row},
                          {(i + 1) * row + n, i * row + n},
                          {i + 1, i},
                          {n * row + i, n * row + i + 1}};
        for (int k = 0; k < 4; k++) {
            int a = edge[k][0], b = edge[k][1];
            add_triangle(triangles, a, level + a, level + b, &n_triangles);
            add_triangle(triangles, a, level + b, b, &n_triangles);
        }
    }
    g_autofree char *text = g_strdup_printf("OFF\n%d %d 0\n%s%s", 2 * level, n_triangles,
                                            vertices->str, triangles->str);
    return seg_part_from_mesh(text, strlen(text), "height-field.off", NULL);
}

SegPart *plan_case_boxes(const double (*boxes)[6], int n)
{
    static const int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                    {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    g_autoptr(GString) vertices = g_string_new(NULL);
    g_autoptr(GString) triangles = g_string_new(NULL);
    int n_triangles = 0;
    for (int b = 0; b < n; b++) {
        for (int k = 0; k < 8; k++)
            add_vertex(vertices, boxes[b][k & 1 ? 3 : 0], boxes[b][k & 2 ? 4 : 1],
                       boxes[b][k & 4 ? 5 : 2]);
        for (int q = 0; q < 6; q++) {
            const int *c = quads[q];
            add_triangle(triangles, 8 * b + c[0], 8 * b + c[1], 8 * b + c[2], &n_triangles);
            add_triangle(triangles, 8 * b + c[0], 8 * b + c[2], 8 * b + c[3], &n_triangles);
        }
    }
    g_autofree char *text =
        g_strdup_printf("OFF\n%d %d 0\n%s%s", 8 * n, n_triangles, vertices->str, triangles->str);
    return seg_part_from_mesh(text, strlen(text), "boxes.off", NULL);
}
