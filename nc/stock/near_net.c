/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A body from triangles, with an allowance or without. Ray by ray: the layer around the surface is
 * the union of the spans in the rounded mesh's parts, exact, or without an allowance the points
 * where the ray crosses the surface. A gap between two layers is material where the ray has entered
 * the body more often than left it, counted from either end: a flaw in the mesh leaves a gap open,
 * not the rest of the ray full.
 */
#include "nc/stock/near_net.h"

#include "nc/stock/fill.h"
#include "nc/stock/rounded.h"

/* Layers that come this near to each other are one. */
#define FILM_MM 1e-6

/* The box along u and v that a part lies in. */
typedef struct {
    double low[2], high[2];
} Reach;

/* What the rays of an axis may meet, tile by tile. */
typedef struct {
    const NcRoundedPart *parts;
    size_t n_parts;
    double r;
    Reach *reach;  /* of each part */
    size_t *first; /* of each tile in `part`, ending with their number */
    uint32_t *part;
} Bins;

/* Rays that meet the body, and those of them that do not enter it as often as they leave it. */
typedef struct {
    size_t rays, open;
} Count;

/* One ray in so many may meet a flaw of a body that is closed otherwise. */
#define LEAKS_ONE_IN 1000

/* One ray, and the room for it. */
typedef struct {
    Count count;
    NcSpan *layers; /* ascending, apart */
    size_t n_layers, room_layers;
    struct {
        double t;
        bool enters;
    } * crossings;
    size_t n_crossings, room_crossings;
} Line;

static void bins_new(Bins *bins, const NcStock *stock, int axis, const GArray *parts, double r);
static NcStock *new_body(const SegVec3 *vertices, size_t n_vertices, const int32_t (*triangles)[3],
                         size_t n_triangles, double allowance_mm, const NcStockOptions *options,
                         Count *count, GError **error);
static void fill_axis(NcStock *stock, int axis, const GArray *parts, double r, Count *count);
static void fill_tile(NcStock *stock, int axis, int32_t tile, const Bins *bins, Line *line);

NcStock *nc_stock_new_near_net(const SegVec3 *vertices, size_t n_vertices,
                               const int32_t (*triangles)[3], size_t n_triangles,
                               double allowance_mm, const NcStockOptions *options, GError **error)
{
    Count count = {0};
    return new_body(vertices, n_vertices, triangles, n_triangles, allowance_mm, options, &count,
                    error);
}

NcStock *nc_stock_new_mesh(const SegVec3 *vertices, size_t n_vertices,
                           const int32_t (*triangles)[3], size_t n_triangles,
                           const NcStockOptions *options, GError **error)
{
    Count count = {0};
    g_autoptr(NcStock) stock =
        new_body(vertices, n_vertices, triangles, n_triangles, 0, options, &count, error);
    if (stock && count.open * LEAKS_ONE_IN > count.rays) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "the stock is not a closed body: of %zu lines through it %zu do not enter it "
                    "as often as they leave it",
                    count.rays, count.open);
        return NULL;
    }
    if (stock && count.rays == 0) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "the stock has no volume that a pitch of %.6g mm shows", options->pitch_mm);
        return NULL;
    }
    return g_steal_pointer(&stock);
}

static NcStock *new_body(const SegVec3 *vertices, size_t n_vertices, const int32_t (*triangles)[3],
                         size_t n_triangles, double allowance_mm, const NcStockOptions *options,
                         Count *count, GError **error)
{
    SegVec3 min = {INFINITY, INFINITY, INFINITY}, max = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t v = 0; v < n_vertices; v++) {
        const SegVec3 p = vertices[v];
        min = seg_vec3(fmin(min.x, p.x), fmin(min.y, p.y), fmin(min.z, p.z));
        max = seg_vec3(fmax(max.x, p.x), fmax(max.y, p.y), fmax(max.z, p.z));
    }
    const SegVec3 around = {allowance_mm, allowance_mm, allowance_mm};
    g_autoptr(GArray) parts = nc_rounded_parts(vertices, triangles, n_triangles);
    if (parts->len == 0) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN, "the stock has no surface with an area");
        return NULL;
    }
    NcStock *stock = nc_stock_alloc(seg_sub(min, around), seg_add(max, around), options, error);
    for (int axis = 0; axis < 3 && stock; axis++)
        fill_axis(stock, axis, parts, allowance_mm, count);
    return stock;
}

static void fill_axis(NcStock *stock, int axis, const GArray *parts, double r, Count *count)
{
    const int32_t n_tiles = stock->field[axis].n_tiles[0] * stock->field[axis].n_tiles[1];
    size_t rays = 0, open = 0;
    Bins bins;
    bins_new(&bins, stock, axis, parts, r);
#pragma omp parallel reduction(+ : rays, open)
    {
        Line line = {0};
#pragma omp for schedule(dynamic, 8)
        for (int32_t tile = 0; tile < n_tiles; tile++)
            fill_tile(stock, axis, tile, &bins, &line);
        rays = line.count.rays;
        open = line.count.open;
        g_free(line.layers);
        g_free(line.crossings);
    }
    count->rays += rays;
    count->open += open;
    g_free(bins.reach);
    g_free(bins.first);
    g_free(bins.part);
}

/* ------------------------------------------------------------------------------- bins */

static Reach reach_of(const NcRoundedPart *part, int axis, double r)
{
    Reach reach;
    for (int k = 0; k < 2; k++) {
        const int d = (axis + 1 + k) % 3;
        const double slack = 1e-6, wide = part->n == 3 ? r * fabs(nc_along(part->normal, d)) : r;
        reach.low[k] = INFINITY;
        reach.high[k] = -INFINITY;
        for (int i = 0; i < part->n; i++) {
            reach.low[k] = fmin(reach.low[k], nc_along(part->p[i], d) - wide - slack);
            reach.high[k] = fmax(reach.high[k], nc_along(part->p[i], d) + wide + slack);
        }
    }
    return reach;
}

/* The tiles of rays that it may meet, [low, high] along u and v. */
static void tiles_of(const Reach *reach, const NcStock *stock, int axis, int32_t low[2],
                     int32_t high[2])
{
    for (int k = 0; k < 2; k++) {
        const double node_mm = stock->node_mm[(axis + 1 + k) % 3];
        const double tile_mm = NC_TILE * stock->pitch_mm;
        const int32_t last = stock->field[axis].n_tiles[k] - 1;
        low[k] = CLAMP((int32_t)floor((reach->low[k] - node_mm) / tile_mm), 0, last);
        high[k] = CLAMP((int32_t)floor((reach->high[k] - node_mm) / tile_mm), 0, last);
    }
}

/* Counts, then sorts by counting. */
static void bins_new(Bins *bins, const NcStock *stock, int axis, const GArray *parts, double r)
{
    const NcDexelField *field = &stock->field[axis];
    const size_t n_tiles = (size_t)field->n_tiles[0] * (size_t)field->n_tiles[1];
    *bins = (Bins){.parts = &g_array_index(parts, NcRoundedPart, 0),
                   .n_parts = parts->len,
                   .r = r,
                   .first = g_new0(size_t, n_tiles + 2)};
    bins->reach = g_new(Reach, bins->n_parts);
    for (size_t i = 0; i < bins->n_parts; i++)
        bins->reach[i] = reach_of(&bins->parts[i], axis, r);
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < bins->n_parts; i++) {
            int32_t low[2], high[2];
            tiles_of(&bins->reach[i], stock, axis, low, high);
            for (int32_t v = low[1]; v <= high[1]; v++)
                for (int32_t u = low[0]; u <= high[0]; u++) {
                    size_t *at = &bins->first[(size_t)v * (size_t)field->n_tiles[0] + (size_t)u];
                    if (pass == 0)
                        at[2]++;
                    else
                        bins->part[at[1]++] = (uint32_t)i;
                }
        }
        for (size_t t = 0; t <= n_tiles && pass == 0; t++)
            bins->first[t + 1] += bins->first[t];
        if (pass == 0)
            bins->part = g_new(uint32_t, bins->first[n_tiles + 1]);
    }
}

/* ------------------------------------------------------------------------------- rays */

/* Joins it with the layers that it meets. */
static void add_layer(Line *line, NcSpan span)
{
    size_t first = 0, end;
    while (first < line->n_layers && line->layers[first].t[1] + FILM_MM < span.t[0])
        first++;
    for (end = first; end < line->n_layers && line->layers[end].t[0] - FILM_MM <= span.t[1]; end++)
        for (int k = 0; k < 2; k++)
            if (k == 0 ? line->layers[end].t[0] < span.t[0] : line->layers[end].t[1] > span.t[1]) {
                span.t[k] = line->layers[end].t[k];
                span.normal[k] = line->layers[end].normal[k];
            }
    if (line->n_layers == line->room_layers) {
        line->room_layers = 2 * line->room_layers + 16;
        line->layers = g_renew(NcSpan, line->layers, line->room_layers);
    }
    memmove(line->layers + first + 1, line->layers + end,
            (line->n_layers - end) * sizeof *line->layers);
    line->layers[first] = span;
    line->n_layers = line->n_layers + 1 - (end - first);
}

static void add_crossing(Line *line, double t, bool enters)
{
    if (line->n_crossings == line->room_crossings) {
        line->room_crossings = 2 * line->room_crossings + 16;
        line->crossings =
            g_realloc_n(line->crossings, line->room_crossings, sizeof *line->crossings);
    }
    line->crossings[line->n_crossings].t = t;
    line->crossings[line->n_crossings++].enters = enters;
}

static void meet(Line *line, const Bins *bins, size_t tile, int axis, SegVec3 origin)
{
    const double u = nc_along(origin, (axis + 1) % 3), v = nc_along(origin, (axis + 2) % 3);
    int total = 0;
    line->n_layers = line->n_crossings = 0;
    for (size_t i = bins->first[tile]; i < bins->first[tile + 1]; i++) {
        const Reach *reach = &bins->reach[bins->part[i]];
        if (u < reach->low[0] || u > reach->high[0] || v < reach->low[1] || v > reach->high[1])
            continue;
        const NcRoundedPart *part = &bins->parts[bins->part[i]];
        NcSpan span = {.normal = {part->normal, part->normal}};
        double t;
        bool enters;
        if (nc_rounded_crossing(part, axis, origin, &t, &enters)) {
            add_crossing(line, t, enters);
            span.t[0] = span.t[1] = t;
            total += enters ? 1 : -1;
        } else if (bins->r == 0) {
            continue;
        }
        if (bins->r == 0 || nc_rounded_span(part, bins->r, axis, origin, &span))
            add_layer(line, span);
    }
    line->count.rays += line->n_crossings > 0;
    line->count.open += total != 0;
}

/* Whether the gap behind layer i is inside of the surface. */
static bool is_inside(const Line *line, size_t i)
{
    const double from = line->layers[i].t[1];
    int before = 0, behind = 0;
    for (size_t c = 0; c < line->n_crossings; c++) {
        const int step = line->crossings[c].enters ? 1 : -1;
        if (line->crossings[c].t <= from)
            before += step;
        else
            behind -= step;
    }
    return before > 0 && behind > 0;
}

/* Whether the ray of X through a node, which is there before those of Y and Z, has it in material.
 */
static bool x_ray_has(const NcStock *stock, const int32_t node[3])
{
    size_t n;
    const NcDexelEnd *ends = nc_dexel_ray(stock, 0, node[1], node[2], &n);
    bool in = false;
    for (size_t e = 0; e < n && ends[e].depth < nc_dexel_node_depth(stock, node[0]); e++)
        in = !in;
    return in;
}

/* The end of a segment; near a node on the side that the other rays through it have. */
static NcDexelEnd layer_end(const NcStock *stock, const NcFill *fill, const NcSpan *layer, int k)
{
    NcDexelEnd end = {.depth = nc_dexel_depth(stock, fill->axis, layer->t[k])};
    int32_t at;
    nc_dexel_set_normal(&end, layer->normal[k]);
    if (!nc_dexel_near_node(stock, fill->axis, end.depth, layer->normal[k], &at))
        return end;
    int32_t node[3];
    node[fill->axis] = at;
    node[(fill->axis + 1) % 3] = fill->u;
    node[(fill->axis + 2) % 3] = fill->v;
    const int32_t depth = nc_dexel_node_depth(stock, at);
    bool in = k == 0 ? end.depth <= depth : end.depth >= depth;
    if (fill->axis > 0 && at >= 0 && at < stock->n_nodes[fill->axis])
        in = x_ray_has(stock, node);
    end.depth = depth + (in == (k == 1) ? 1 : -1);
    return end;
}

static void fill_tile(NcStock *stock, int axis, int32_t tile, const Bins *bins, Line *line)
{
    NcFill fill;
    for (nc_fill_begin_tile(&fill, stock, axis, tile); nc_fill_next(&fill);) {
        meet(line, bins, (size_t)tile, axis, fill.origin);
        for (size_t i = 0, last; i < line->n_layers; i = last + 1) {
            for (last = i; last + 1 < line->n_layers && is_inside(line, last);)
                last++;
            nc_fill_segment(&fill, layer_end(stock, &fill, &line->layers[i], 0),
                            layer_end(stock, &fill, &line->layers[last], 1));
        }
    }
}
