/* SPDX-License-Identifier: Apache-2.0 */
/* The stock that a recipe or a file describes. */
#include "nc/stock/near_net.h"

static bool has_size(const CfgRecipe *recipe);
static NcStock *stock_around_part(const SegPart *part, const NcSetup *setup, double allowance_mm,
                                  const NcStockOptions *options, GError **error);

/* A part as nc_stock_new_mesh takes it, in workpiece coordinates. */
typedef struct {
    SegVec3 *vertices;
    int32_t (*triangles)[3];
    SegVec3 min, max;
} Body;

static Body body_of(const SegPart *part, const NcSetup *setup)
{
    Body body = {.vertices = g_new(SegVec3, (size_t)part->n_vertices),
                 .triangles = g_malloc_n((size_t)part->n_triangles, sizeof *body.triangles),
                 .min = {INFINITY, INFINITY, INFINITY},
                 .max = {-INFINITY, -INFINITY, -INFINITY}};
    for (int32_t v = 0; v < part->n_vertices; v++) {
        const SegVec3 at = part->vertices[v].position;
        body.vertices[v] = setup ? nc_setup_point(setup, at) : at;
    }
    for (int32_t t = 0; t < part->n_triangles; t++)
        for (int i = 0; i < 3; i++) {
            const int32_t v = body.triangles[t][i] = part->triangles[t].vertex[i];
            const SegVec3 p = body.vertices[v];
            body.min =
                seg_vec3(fmin(body.min.x, p.x), fmin(body.min.y, p.y), fmin(body.min.z, p.z));
            body.max =
                seg_vec3(fmax(body.max.x, p.x), fmax(body.max.y, p.y), fmax(body.max.z, p.z));
        }
    return body;
}

static void body_clear(Body *body)
{
    g_free(body->vertices);
    g_free(body->triangles);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Body, body_clear)

NcStock *nc_stock_load(const char *path, const NcStockOptions *options, GError **error)
{
    const SegLoadOptions loading = SEG_LOAD_DEFAULTS;
    g_autoptr(SegPart) part = seg_part_load(path, &loading, error);
    NcStock *stock = part ? stock_around_part(part, NULL, 0, options, error) : NULL;
    if (part && !stock)
        g_prefix_error(error, "%s: ", path);
    return stock;
}

static NcStock *stock_around_part(const SegPart *part, const NcSetup *setup, double allowance_mm,
                                  const NcStockOptions *options, GError **error)
{
    g_auto(Body) body = body_of(part, setup);
    const size_t n_vertices = (size_t)part->n_vertices, n_triangles = (size_t)part->n_triangles;
    return allowance_mm > 0 ? nc_stock_new_near_net(body.vertices, n_vertices, body.triangles,
                                                    n_triangles, allowance_mm, options, error)
                            : nc_stock_new_mesh(body.vertices, n_vertices, body.triangles,
                                                n_triangles, options, error);
}

/* The box that [stock] names, or the part's with the allowance around it. */
static void box_of(const SegPart *part, const NcSetup *setup, const CfgRecipe *recipe, SegVec3 *min,
                   SegVec3 *max)
{
    if (has_size(recipe)) {
        const double *low = recipe->stock_min_mm, *high = recipe->stock_max_mm;
        *min = seg_vec3(low[0], low[1], low[2]);
        *max = seg_vec3(high[0], high[1], high[2]);
        return;
    }
    const double a = recipe->allowance_mm;
    g_auto(Body) body = body_of(part, setup);
    *min = seg_sub(body.min, seg_vec3(a, a, a));
    *max = seg_add(body.max, seg_vec3(a, a, a));
}

static bool has_size(const CfgRecipe *recipe)
{
    for (int d = 0; d < 3; d++)
        if (recipe->stock_min_mm[d] < recipe->stock_max_mm[d])
            return true;
    return false;
}

/* Round the part's middle, or in the box that [stock] names. */
static NcStock *cylinder_of(const SegPart *part, const NcSetup *setup, const CfgRecipe *recipe,
                            const NcStockOptions *options, GError **error)
{
    SegVec3 min, max;
    box_of(part, setup, recipe, &min, &max);
    const SegVec3 base = {(min.x + max.x) / 2, (min.y + max.y) / 2, min.z};
    double diameter_mm = fmin(max.x - min.x, max.y - min.y);
    if (!has_size(recipe)) {
        g_auto(Body) body = body_of(part, setup);
        diameter_mm = 0;
        for (int32_t t = 0; t < part->n_triangles; t++)
            for (int i = 0; i < 3; i++) {
                const SegVec3 p = body.vertices[body.triangles[t][i]];
                diameter_mm = fmax(diameter_mm, 2 * hypot(p.x - base.x, p.y - base.y));
            }
        diameter_mm += 2 * recipe->allowance_mm;
    } else if (fabs((max.x - min.x) - (max.y - min.y)) > 1e-9 * diameter_mm) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "[stock] the cylinder's box from min_mm to max_mm is %.6g x %.6g mm: both are "
                    "its diameter, make them equal",
                    max.x - min.x, max.y - min.y);
        return NULL;
    }
    return nc_stock_new_cylinder(base, diameter_mm, max.z - min.z, options, error);
}

NcStock *nc_stock_from_recipe(const SegPart *part, const NcSetup *setup, const CfgRecipe *recipe,
                              const NcStockOptions *options, GError **error)
{
    SegVec3 min, max;
    switch (recipe->stock_kind) {
    case CFG_STOCK_BOX:
        box_of(part, setup, recipe, &min, &max);
        return nc_stock_new_box(min, max, options, error);
    case CFG_STOCK_CYLINDER:
        return cylinder_of(part, setup, recipe, options, error);
    case CFG_STOCK_FILE:
        return nc_stock_load(recipe->stock_file, options, error);
    case CFG_STOCK_NEAR_NET:
        break;
    }
    return stock_around_part(part, setup, recipe->allowance_mm, options, error);
}
