/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/tile.h"

#include "nc/stock/ray.h"

/* A tile while groups pass over it; coordinates (u, v, w) along its axis's cycle. */
typedef struct {
    NcRay ray;
    double u0, v0;           /* of its first ray */
    double half_u, half_v;   /* of the rectangle its rays fill */
    double mid_u, mid_v;     /* its middle */
    double lowest, highest;  /* all its material lies between */
    const NcPrepared *group; /* the one at work, with the lanes that can reach the tile */
    NcLanes lanes;
    GArray *contacts;
    guint others; /* contacts of other tiles, in front */
} Tile;

static bool look_at(Tile *tile, const NcStock *stock, int axis, size_t index);
static uint64_t choose_chords(const Tile *tile);
static void cut_freely(Tile *tile, float u, float v);
static void cut_in_order(Tile *tile, float u, float v);

static double coordinate(SegVec3 p, int axis)
{
    return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}

/* Nothing but cutting can happen. */
static bool is_free(const NcPrepared *group)
{
    return group->group->forbidden < 0 && !group->meets[NC_PART_SHANK] &&
           !group->meets[NC_PART_HOLDER];
}

void nc_tile_remove(NcStock *stock, int axis, size_t index, const NcPrepared *const *groups,
                    size_t n, GArray *contacts)
{
    NcDexelField *field = &stock->field[axis];
    Tile tile = {.contacts = contacts, .others = contacts->len};
    int32_t tile_u = (int32_t)(index % (size_t)field->n_tiles[0]) * NC_TILE;
    int32_t tile_v = (int32_t)(index / (size_t)field->n_tiles[0]) * NC_TILE;
    for (size_t g = 0; g < n && look_at(&tile, stock, axis, index); g++) {
        tile.group = groups[g];
        const NcLanes *all = &groups[g]->lanes[axis];
        uint64_t chosen = choose_chords(&tile);
        if (!chosen)
            continue;
        nc_lanes_choose(&tile.lanes, all, chosen);
        for (int i = 0; i < NC_TILE_RAYS; i++) {
            if (tile.ray.tile->first[i] == tile.ray.tile->first[i + 1])
                continue;
            tile.ray.ray = i;
            tile.ray.origin =
                nc_dexel_origin(stock, axis, tile_u + i % NC_TILE, tile_v + i / NC_TILE);
            SegVec3 at = seg_sub(tile.ray.origin, all->origin);
            float u = (float)coordinate(at, (axis + 1) % 3);
            float v = (float)coordinate(at, (axis + 2) % 3);
            if (is_free(tile.group))
                cut_freely(&tile, u, v);
            else
                cut_in_order(&tile, u, v);
        }
    }
    nc_dexel_tile_occupy(stock, axis, tile.ray.tile);
}

/* Where its rays and its material are; false where it has none. */
static bool look_at(Tile *tile, const NcStock *stock, int axis, size_t index)
{
    const NcDexelField *field = &stock->field[axis];
    NcDexelTile *rays = &field->tiles[index];
    int32_t low = INT32_MAX, high = INT32_MIN;
    tile->ray = (NcRay){.stock = stock, .axis = axis, .tile = rays};
    for (int i = 0; i < NC_TILE_RAYS; i++)
        if (rays->first[i] < rays->first[i + 1]) {
            low = MIN(low, rays->ends[rays->first[i]].depth);
            high = MAX(high, rays->ends[rays->first[i + 1] - 1].depth);
        }
    if (low >= high)
        return false;
    tile->lowest = nc_dexel_mm(stock, axis, low);
    tile->highest = nc_dexel_mm(stock, axis, high);
    int32_t u = (int32_t)(index % (size_t)field->n_tiles[0]) * NC_TILE;
    int32_t v = (int32_t)(index / (size_t)field->n_tiles[0]) * NC_TILE;
    tile->half_u = tile->half_v = (NC_TILE - 1) * stock->pitch_mm / 2;
    tile->mid_u = nc_dexel_node_mm(stock, (axis + 1) % 3, u) + tile->half_u;
    tile->mid_v = nc_dexel_node_mm(stock, (axis + 2) % 3, v) + tile->half_v;
    return true;
}

/* ------------------------------------------------------------ chords over the tile */

static double off_interval(double a, double b, double from, double to)
{
    return fmax(fmax(from - fmax(a, b), fmin(a, b) - to), 0);
}

/* Z rays: is the tile nearer than the radius, and its material higher than the profile there? */
static bool reaches_upright(const Tile *tile, const NcBody *body, const NcChord *chord)
{
    double dx = chord->b.x - chord->a.x, dy = chord->b.y - chord->a.y;
    double px = tile->mid_u - chord->a.x, py = tile->mid_v - chord->a.y, square = dx * dx + dy * dy;
    double t = square > 0 ? fmin(fmax((px * dx + py * dy) / square, 0), 1) : 0;
    double off = hypot(px - t * dx, py - t * dy) - hypot(tile->half_u, tile->half_v);
    double bottom = fmin(chord->a.z, chord->b.z), top = fmax(chord->a.z, chord->b.z) + body->top;
    return bottom + nc_body_height_mm(body, fmax(off, 0)) < tile->highest && top > tile->lowest;
}

/* X and Y rays: is the section at the tile's upper edge wide enough to reach it, and material on
 * it? */
static bool reaches_level(const Tile *tile, const NcBody *body, const NcChord *chord)
{
    int axis = tile->ray.axis, across = 1 - axis;
    double z = axis == 0 ? tile->mid_v : tile->mid_u, half_z = tile->half_u;
    double other = axis == 0 ? tile->mid_u : tile->mid_v, half_other = half_z;
    double bottom = fmin(chord->a.z, chord->b.z), top = fmax(chord->a.z, chord->b.z) + body->top;
    double r = z - half_z > top ? -1 : nc_body_radius_mm(body, z + half_z - bottom);
    double off = off_interval(coordinate(chord->a, across), coordinate(chord->b, across),
                              other - half_other, other + half_other);
    if (r < off)
        return false;
    double a = coordinate(chord->a, axis), b = coordinate(chord->b, axis);
    double half = sqrt((r - off) * (r + off));
    double from = fmin(a, b) - half, to = fmax(a, b) + half;
    if (from >= tile->highest || to <= tile->lowest)
        return false;
    const NcStock *stock = tile->ray.stock;
    int first = nc_dexel_part(stock, axis, nc_dexel_depth(stock, axis, from));
    int last = nc_dexel_part(stock, axis, nc_dexel_depth(stock, axis, to));
    return tile->ray.tile->occupied & (UINT64_MAX << first) & (UINT64_MAX >> (63 - last));
}

static uint64_t choose_chords(const Tile *tile)
{
    const NcGroup *group = tile->group->group;
    uint64_t chosen = 0;
    for (int i = 0; i < group->n; i++)
        for (int k = 0; k < NC_N_PARTS; k++) {
            const NcBody *body = &group->cutter->part[k];
            if (tile->group->meets[k] &&
                (tile->ray.axis == 2 ? reaches_upright(tile, body, &group->chords[i])
                                     : reaches_level(tile, body, &group->chords[i])))
                chosen |= (uint64_t)1 << i;
        }
    return chosen;
}

/* ---------------------------------------------------------------------- one ray */

/* How much of the ray's material lies in each lane's interval, at most: of one segment. */
static void find_overlaps(const Tile *tile, const float *low, const float *high, float *overlap)
{
    const NcRay *ray = &tile->ray;
    const NcDexelEnd *ends = ray->tile->ends;
    double origin = coordinate(tile->lanes.origin, ray->axis);
    for (int i = 0; i < NC_GROUP; i++)
        overlap[i] = 0;
    for (uint32_t k = ray->tile->first[ray->ray]; k < ray->tile->first[ray->ray + 1]; k += 2)
        nc_lanes_overlap(&tile->lanes, low, high,
                         (float)(nc_dexel_mm(ray->stock, ray->axis, ends[k].depth) - origin),
                         (float)(nc_dexel_mm(ray->stock, ray->axis, ends[k + 1].depth) - origin),
                         overlap);
}

/* The chord that seems to take most goes first, and most others find nothing left. */
static void cut_freely(Tile *tile, float u, float v)
{
    const NcGroup *group = tile->group->group;
    const NcBody *body = &group->cutter->part[NC_PART_CUTTING];
    float low[NC_GROUP], high[NC_GROUP], overlap[NC_GROUP];
    double middle;
    nc_lanes_bounds(&tile->lanes, body, u, v, low, high);
    for (;;) {
        find_overlaps(tile, low, high, overlap);
        int i = nc_lanes_longest(&tile->lanes, overlap);
        if (i < 0)
            return;
        nc_ray_subtract(&tile->ray, body, &group->chords[tile->lanes.chord[i]], &middle);
        low[i] = INFINITY;
        high[i] = -INFINITY;
    }
}

static void meet(Tile *tile, uint32_t cut, int kind, double length_mm, double middle_mm)
{
    GArray *contacts = tile->contacts;
    SegVec3 p = nc_dexel_point(tile->ray.axis, tile->ray.origin, middle_mm);
    NcContact new = {cut, kind, tile->ray.axis, length_mm, p};
    uint32_t first = tile->group->group->chords[0].cut;
    for (guint i = contacts->len; i > tile->others; i--) {
        NcContact *old = &g_array_index(contacts, NcContact, i - 1);
        if (old->cut < first)
            break;
        if (old->cut == cut && old->kind == kind) {
            if (length_mm > old->length_mm)
                *old = new;
            return;
        }
    }
    g_array_append_val(contacts, new);
}

/* Chord by chord, and of each its parts from the tip up: what the cutting part has taken the shank
 * does not meet. */
static void cut_in_order(Tile *tile, float u, float v)
{
    const NcGroup *group = tile->group->group;
    float low[NC_N_PARTS][NC_GROUP], high[NC_N_PARTS][NC_GROUP], overlap[NC_N_PARTS][NC_GROUP];
    for (int k = 0; k < NC_N_PARTS; k++)
        if (tile->group->meets[k]) {
            nc_lanes_bounds(&tile->lanes, &group->cutter->part[k], u, v, low[k], high[k]);
            find_overlaps(tile, low[k], high[k], overlap[k]);
        }
    for (int i = 0; i < tile->lanes.n; i++)
        for (int k = 0; k < NC_N_PARTS; k++) {
            if (!tile->group->meets[k] || !(overlap[k][i] > 0))
                continue;
            const NcChord *chord = &group->chords[tile->lanes.chord[i]];
            double middle,
                length = nc_ray_subtract(&tile->ray, &group->cutter->part[k], chord, &middle);
            int kind = k == NC_PART_CUTTING ? group->forbidden
                       : k == NC_PART_SHANK ? (int)NC_COLLISION_SHANK
                                            : (int)NC_COLLISION_HOLDER;
            if (kind >= 0 && length > NC_CONTACT_MM)
                meet(tile, chord->cut, kind, length, middle);
        }
}
