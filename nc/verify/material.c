/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/verify/material.h"

#include "nc/motion/path.h"
#include "nc/stock/dexel.h"

#define PITCH_MM 0.1
#define MEMORY_BYTES 512e6
#define RAY_BYTES 64 /* of a ray, with what moves cut into it */

NcStock *nc_material_new(const NcPlanInput *input, const NcSetup *setup, double *pitch_mm,
                         GError **error)
{
    const SegPart *part = input->part;
    const CfgRecipe *recipe = input->recipe;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int32_t i = 0; i < part->n_vertices; i++) {
        SegVec3 p = nc_setup_point(setup, part->vertices[i].position);
        for (int d = 0; d < 3; d++) {
            low[d] = fmin(low[d], nc_axis_value(p, d));
            high[d] = fmax(high[d], nc_axis_value(p, d));
        }
    }
    bool sized = recipe->stock_kind == CFG_STOCK_BOX || recipe->stock_kind == CFG_STOCK_CYLINDER;
    for (int d = 0; d < 3 && sized; d++) {
        low[d] = fmin(low[d], recipe->stock_min_mm[d]);
        high[d] = fmax(high[d], recipe->stock_max_mm[d]);
    }
    double area = 0;
    for (int d = 0; d < 3; d++) {
        int u = (d + 1) % 3, v = (d + 2) % 3;
        double a = 2 * recipe->allowance_mm;
        area += (high[u] - low[u] + a) * (high[v] - low[v] + a);
    }
    NcStockOptions options = NC_STOCK_DEFAULTS;
    options.pitch_mm = *pitch_mm = fmax(PITCH_MM, sqrt(area * RAY_BYTES / MEMORY_BYTES));
    return nc_stock_from_recipe(part, setup, recipe, &options, error);
}

/* From the coordinate on along the axis, in the sense of `sign`, to the end of the material; where
 * the ray has none here, back to the next; far away where it has none at all. */
static double along_ray(const NcStock *stock, int axis, const NcDexelEnd *ends, size_t n, double at,
                        double sign)
{
    double lacking = INFINITY;
    for (size_t i = 0; i + 1 < n; i += 2) {
        double from = nc_dexel_mm(stock, axis, ends[i].depth);
        double to = nc_dexel_mm(stock, axis, ends[i + 1].depth);
        double end = sign > 0 ? to - at : at - from, start = sign > 0 ? from - at : at - to;
        if (end >= -stock->pitch_mm && start <= stock->pitch_mm)
            return fmax(end, 0);
        if (end < 0)
            lacking = fmin(lacking, -end);
    }
    return -lacking;
}

double nc_material_end_mm(const NcStock *stock, const CfgRecipe *recipe, SegVec3 point,
                          SegVec3 normal)
{
    if (recipe->stock_kind == CFG_STOCK_NEAR_NET)
        return recipe->allowance_mm;
    int axis = 0;
    for (int d = 1; d < 3; d++)
        if (fabs(nc_axis_value(normal, d)) > fabs(nc_axis_value(normal, axis)))
            axis = d;
    int32_t at[2];
    for (int k = 0; k < 2; k++) {
        int d = (axis + 1 + k) % 3;
        double node = rint((nc_axis_value(point, d) - stock->node_mm[d]) / stock->pitch_mm);
        at[k] = (int32_t)fmin(fmax(node, 0), stock->n_nodes[d] - 1);
    }
    size_t n;
    const NcDexelEnd *ends = nc_dexel_ray(stock, axis, at[0], at[1], &n);
    double along = nc_axis_value(normal, axis);
    double end = along_ray(stock, axis, ends, n, nc_axis_value(point, axis), along);
    /* Where a ray has no material behind the point the part's size is as good as any depth. */
    double most = seg_distance(stock->min, stock->max);
    return fmin(fmax(end / fabs(along), -most), most);
}
