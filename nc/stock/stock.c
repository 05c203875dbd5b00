/* SPDX-License-Identifier: Apache-2.0 */
/* The stock before the first cut: a box, a cylinder. */
#include "nc/stock/fill.h"
#include "nc/stock/sweep_axis.h"

static bool check_size(SegVec3 min, SegVec3 max, GError **error)
{
    bool finite = isfinite(min.x) && isfinite(min.y) && isfinite(min.z) && isfinite(max.x) &&
                  isfinite(max.y) && isfinite(max.z);
    if (finite && max.x > min.x && max.y > min.y && max.z > min.z)
        return true;
    g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                "the stock from (%.6g, %.6g, %.6g) to (%.6g, %.6g, %.6g) has no volume", min.x,
                min.y, min.z, max.x, max.y, max.z);
    return false;
}

/* All rays of an axis have the same ends: the faces, off the nodes next to them. */
static void fill_box_axis(NcStock *stock, int axis)
{
    const double min[3] = {stock->min.x, stock->min.y, stock->min.z};
    const double max[3] = {stock->max.x, stock->max.y, stock->max.z};
    int32_t last = nc_dexel_node_depth(stock, stock->n_nodes[axis] - 1);
    SegVec3 up = {axis == 0, axis == 1, axis == 2};
    NcDexelEnd in = {.depth = MIN(nc_dexel_depth(stock, axis, min[axis]), -1)};
    NcDexelEnd out = {.depth = MAX(nc_dexel_depth(stock, axis, max[axis]), last + 1)};
    nc_dexel_set_normal(&in, seg_scale(up, -1));
    nc_dexel_set_normal(&out, up);
    NcFill fill;
    for (nc_fill_begin(&fill, stock, axis); nc_fill_next(&fill);)
        nc_fill_segment(&fill, in, out);
}

NcStock *nc_stock_new_box(SegVec3 min, SegVec3 max, const NcStockOptions *options, GError **error)
{
    if (!check_size(min, max, error))
        return NULL;
    NcStock *stock = nc_stock_alloc(min, max, options, error);
    for (int d = 0; d < 3 && stock; d++)
        fill_box_axis(stock, d);
    return stock;
}

/* An end of a segment where the surface of `body` is, on the side of the next node that
 * nc_swept_contains tells. */
static NcDexelEnd body_end(const NcStock *stock, const NcFill *fill, const NcToolBody *body,
                           SegVec3 base, double t, SegVec3 normal, bool out)
{
    NcDexelEnd end = {.depth = nc_dexel_depth(stock, fill->axis, t)};
    nc_dexel_set_normal(&end, normal);
    int32_t node;
    if (nc_dexel_near_node(stock, fill->axis, end.depth, normal, &node)) {
        SegVec3 p = nc_fill_node(fill, node);
        bool above = nc_swept_contains(body, base, base, p) == out;
        end.depth = nc_dexel_node_depth(stock, node) + (above ? 1 : -1);
    }
    return end;
}

NcStock *nc_stock_new_cylinder(SegVec3 base, double diameter_mm, double height_mm,
                               const NcStockOptions *options, GError **error)
{
    double r = diameter_mm / 2;
    SegVec3 min = seg_add(base, seg_vec3(-r, -r, 0));
    SegVec3 max = seg_add(base, seg_vec3(r, r, height_mm));
    if (!check_size(min, max, error))
        return NULL;
    NcStock *stock = nc_stock_alloc(min, max, options, error);
    NcToolBody body = nc_body_cylinder(0, height_mm, diameter_mm);
    for (int d = 0; d < 3 && stock; d++) {
        NcFill fill;
        for (nc_fill_begin(&fill, stock, d); nc_fill_next(&fill);) {
            double t[2];
            SegVec3 normal[2], w = {d == 0, d == 1, d == 2};
            if (!nc_swept_interval(&body, base, base, fill.origin, w, &t[0], &t[1], normal))
                continue;
            NcDexelEnd in = body_end(stock, &fill, &body, base, t[0], normal[0], false);
            NcDexelEnd out = body_end(stock, &fill, &body, base, t[1], normal[1], true);
            nc_fill_segment(&fill, in, out);
        }
    }
    return stock;
}
