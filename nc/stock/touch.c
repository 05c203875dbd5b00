/* SPDX-License-Identifier: Apache-2.0 */
/* A tool that feels its way: where it first touches material, or leaves it. */
#include "nc/stock/cutter_body.h"
#include "nc/stock/dexel.h"
#include "nc/stock/sweep.h"

/* The tip's way. */
typedef struct {
    const NcStock *stock;
    NcToolBody body;
    SegVec3 a, b;
} Way;

static bool touches(const Way *way, double from, double to);
static double first_touch(const Way *way, double from, double to, double step);
static double first_leave(const Way *way, double step);

bool nc_stock_probe(const NcStock *stock, const NcMove *move, SegVec3 zero,
                    const CfgToolTable *tools, bool away, SegVec3 *where)
{
    const CfgTool *tool = cfg_tools_find(tools, move->tool);
    if (!tool)
        return false;
    zero.z += tool->length_mm;
    const Way way = {stock, nc_body_cutting(tool), seg_sub(move->from, zero),
                     seg_sub(move->to, zero)};
    const double length_mm = seg_distance(way.a, way.b);
    const double step = length_mm > NC_STOCK_PROBE_MM ? NC_STOCK_PROBE_MM / length_mm : 1;
    double at = 0;
    if (touches(&way, 0, 0) == away)
        at = away                  ? first_leave(&way, step)
             : touches(&way, 0, 1) ? first_touch(&way, 0, 1, step)
                                   : INFINITY;
    if (at > 1)
        return false;
    *where = seg_lerp(move->from, move->to, at);
    return true;
}

/* It touches somewhere in [from, to]; behind `from` first. */
static double first_touch(const Way *way, double from, double to, double step)
{
    while (to - from > step) {
        const double middle = (from + to) / 2;
        if (touches(way, from, middle))
            to = middle;
        else
            from = middle;
    }
    return to;
}

/* It touches at the start, and may do so again later: looked for in steps of a quarter pitch. */
static double first_leave(const Way *way, double step)
{
    const double length_mm = seg_distance(way->a, way->b);
    const int n = (int)ceil(4 * length_mm / way->stock->pitch_mm);
    for (int i = 1; i <= n; i++) {
        double in = (double)(i - 1) / n, out = (double)i / n;
        if (touches(way, out, out))
            continue;
        while (out - in > step) {
            const double middle = (in + out) / 2;
            *(touches(way, middle, middle) ? &in : &out) = middle;
        }
        return out;
    }
    return INFINITY;
}

/* Whether material lies on the ray between t0 and t1. */
static bool has_material(const NcStock *stock, int axis, int32_t u, int32_t v, double t0, double t1)
{
    size_t n;
    const NcDexelEnd *ends = nc_dexel_ray(stock, axis, u, v, &n);
    for (size_t e = 0; e < n; e += 2)
        if (nc_dexel_mm(stock, axis, ends[e].depth) < t1 &&
            nc_dexel_mm(stock, axis, ends[e + 1].depth) > t0)
            return true;
    return false;
}

/* The rays along u or v that may be met: those within the tool's reach of the way. */
static void rays_of(const Way *way, SegVec3 from, SegVec3 to, int d, int32_t *first, int32_t *last)
{
    const double a[3] = {from.x, from.y, from.z}, b[3] = {to.x, to.y, to.z};
    const double below = d == 2 ? way->body.bottom : -way->body.radius;
    const double above = d == 2 ? way->body.top : way->body.radius;
    const double node_mm = way->stock->node_mm[d], pitch_mm = way->stock->pitch_mm;
    const double most = way->stock->n_nodes[d];
    *first = (int32_t)CLAMP(ceil((fmin(a[d], b[d]) + below - node_mm) / pitch_mm), 0, most);
    *last = (int32_t)CLAMP(floor((fmax(a[d], b[d]) + above - node_mm) / pitch_mm), -1, most - 1);
}

/* Whether the tool meets material on this part of its way. */
static bool touches(const Way *way, double from, double to)
{
    const SegVec3 a = seg_lerp(way->a, way->b, from), b = seg_lerp(way->a, way->b, to);
    bool found = false;
    for (int axis = 0; axis < 3 && !found; axis++) {
        const SegVec3 along = {axis == 0, axis == 1, axis == 2};
        int32_t u0, u1, v0, v1;
        rays_of(way, a, b, (axis + 1) % 3, &u0, &u1);
        rays_of(way, a, b, (axis + 2) % 3, &v0, &v1);
        for (int32_t v = v0; v <= v1 && !found; v++)
            for (int32_t u = u0; u <= u1 && !found; u++) {
                double t0, t1;
                found = nc_swept_interval(&way->body, a, b, nc_dexel_origin(way->stock, axis, u, v),
                                          along, &t0, &t1, NULL) &&
                        has_material(way->stock, axis, u, v, t0, t1);
            }
    }
    return found;
}
