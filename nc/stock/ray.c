/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/ray.h"

#include <string.h>

#include "nc/stock/sweep_axis.h"

static void make_end(const NcRay *ray, const NcToolBody *body, const NcChord *chord, double t,
                     SegVec3 normal, bool lower, NcDexelEnd *end);
static double take_out(const NcRay *ray, NcDexelEnd from, NcDexelEnd to, int32_t *middle);

/* The interval to take out; over the highest material its upper end is of no account. */
static bool swept(const NcRay *ray, const NcToolBody *body, const NcChord *chord, double highest,
                  double t[2], SegVec3 normal[2])
{
    SegVec3 a = chord->a, b = chord->b, origin = ray->origin;
    if (ray->axis < 2)
        return nc_swept_level(body, a, b, ray->axis, origin, t, normal);
    t[1] = fmin(a.z, b.z) + body->top;
    normal[1] = seg_vec3(0, 0, 1);
    if (t[1] > highest)
        return nc_swept_floor(body, a, b, origin.x, origin.y, &t[0], &normal[0]);
    return nc_swept_interval(body, a, b, origin, seg_vec3(0, 0, 1), &t[0], &t[1], normal);
}

double nc_ray_subtract(const NcRay *ray, const NcToolBody *body, const NcChord *chord,
                       double *middle_mm)
{
    const NcDexelTile *tile = ray->tile;
    uint32_t first = tile->first[ray->ray], last = tile->first[ray->ray + 1];
    if (first == last)
        return 0;
    double lowest = nc_dexel_mm(ray->stock, ray->axis, tile->ends[first].depth);
    double highest = nc_dexel_mm(ray->stock, ray->axis, tile->ends[last - 1].depth);
    double t[2];
    SegVec3 normal[2];
    if (!swept(ray, body, chord, highest, t, normal) || t[0] >= highest || t[1] <= lowest)
        return 0;
    /* An end outside of all material makes no new one. */
    NcDexelEnd from = {.depth = INT32_MIN}, to = {.depth = INT32_MAX};
    int32_t middle = 0;
    if (t[0] > lowest)
        make_end(ray, body, chord, t[0], normal[0], true, &from);
    if (t[1] < highest)
        make_end(ray, body, chord, t[1], normal[1], false, &to);
    double length = take_out(ray, from, to, &middle);
    *middle_mm = nc_dexel_mm(ray->stock, ray->axis, middle);
    return length;
}

double nc_ray_measure(const NcRay *ray, const NcToolBody *body, const NcChord *chord,
                      double *middle_mm)
{
    const NcDexelTile *tile = ray->tile;
    double t[2], longest = 0;
    SegVec3 normal[2];
    if (!swept(ray, body, chord, INFINITY, t, normal))
        return 0;
    for (uint32_t i = tile->first[ray->ray]; i < tile->first[ray->ray + 1]; i += 2) {
        double in = fmax(nc_dexel_mm(ray->stock, ray->axis, tile->ends[i].depth), t[0]);
        double out = fmin(nc_dexel_mm(ray->stock, ray->axis, tile->ends[i + 1].depth), t[1]);
        if (out - in > longest) {
            longest = out - in;
            *middle_mm = (in + out) / 2;
        }
    }
    return longest;
}

/* The end of the material where the sweep's surface lies: its normal points into the sweep. */
static void make_end(const NcRay *ray, const NcToolBody *body, const NcChord *chord, double t,
                     SegVec3 normal, bool lower, NcDexelEnd *end)
{
    const NcStock *stock = ray->stock;
    end->depth = nc_dexel_depth(stock, ray->axis, t);
    end->cut = chord->cut;
    nc_dexel_set_normal(end, seg_scale(normal, -1));
    int32_t node;
    if (nc_dexel_near_node(stock, ray->axis, end->depth, normal, &node)) {
        SegVec3 p =
            nc_dexel_point(ray->axis, ray->origin, nc_dexel_node_mm(stock, ray->axis, node));
        bool swept = nc_swept_contains(body, chord->a, chord->b, p);
        end->depth = nc_dexel_node_depth(stock, node) + (swept == lower ? -1 : 1);
    }
}

/* Thinner than a film, and no node in it. */
static bool is_film(const NcStock *stock, int32_t from, int32_t to)
{
    return (to - from) * stock->unit_mm < NC_FILM_MM && from >> stock->shift == to >> stock->shift;
}

static double take_out(const NcRay *ray, NcDexelEnd from, NcDexelEnd to, int32_t *middle)
{
    NcDexelTile *tile = ray->tile;
    uint32_t first = tile->first[ray->ray], last = tile->first[ray->ray + 1];
    int32_t longest = 0;
    /* What is out of reach on both sides stays as it is; between, at most two pieces remain. */
    while (first < last && tile->ends[first + 1].depth <= from.depth)
        first += 2;
    while (first < last && tile->ends[last - 2].depth >= to.depth)
        last -= 2;
    if (first == last || from.depth >= to.depth)
        return 0;
    for (uint32_t i = first; i < last; i += 2) {
        int32_t in = MAX(tile->ends[i].depth, from.depth);
        int32_t out = MIN(tile->ends[i + 1].depth, to.depth);
        if (out - in > longest) {
            longest = out - in;
            *middle = in + (out - in) / 2;
        }
    }
    NcDexelEnd left[4];
    uint32_t n = 0, taken = last - first;
    if (tile->ends[first].depth < from.depth &&
        !is_film(ray->stock, tile->ends[first].depth, from.depth)) {
        left[n++] = tile->ends[first];
        left[n++] = from;
    }
    if (tile->ends[last - 1].depth > to.depth &&
        !is_film(ray->stock, to.depth, tile->ends[last - 1].depth)) {
        left[n++] = to;
        left[n++] = tile->ends[last - 1];
    }
    if (n != taken) {
        uint32_t all = tile->first[NC_TILE_RAYS];
        nc_dexel_reserve(tile, all + n - taken);
        memmove(tile->ends + first + n, tile->ends + last, (all - last) * sizeof *tile->ends);
        for (int i = ray->ray + 1; i <= NC_TILE_RAYS; i++)
            tile->first[i] += n - taken;
    }
    memcpy(tile->ends + first, left, n * sizeof *left);
    return longest * ray->stock->unit_mm;
}
