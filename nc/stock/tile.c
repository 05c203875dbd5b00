/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/tile.h"

#include <string.h>

#include "nc/motion/path.h"
#include "nc/stock/ray.h"

/* A tile while groups pass over it; coordinates (u, v, w) along its axis's cycle. */
typedef struct {
    NcRay ray;
    double mid_u, mid_v;     /* of the square its rays fill */
    double half;             /* of its side */
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
            float u = (float)nc_axis_value(at, (axis + 1) % 3);
            float v = (float)nc_axis_value(at, (axis + 2) % 3);
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
    tile->half = (NC_TILE - 1) * stock->pitch_mm / 2;
    tile->mid_u = nc_dexel_node_mm(stock, (axis + 1) % 3, u) + tile->half;
    tile->mid_v = nc_dexel_node_mm(stock, (axis + 2) % 3, v) + tile->half;
    return true;
}

/* Is there material on some ray between these places, counted from the lanes' origin? */
static bool is_occupied(const Tile *tile, double origin, float low, float high)
{
    const NcStock *stock = tile->ray.stock;
    int axis = tile->ray.axis;
    int first = nc_dexel_part(stock, axis, nc_dexel_depth(stock, axis, origin + low));
    int last = nc_dexel_part(stock, axis, nc_dexel_depth(stock, axis, origin + high));
    return tile->ray.tile->occupied & (UINT64_MAX << first) & (UINT64_MAX >> (63 - last));
}

/* The chords of the group that can reach material of the tile, as bits. */
static uint64_t choose_chords(const Tile *tile)
{
    const NcLanes *all = &tile->group->lanes[tile->ray.axis];
    int axis = tile->ray.axis;
    double origin = nc_axis_value(all->origin, axis);
    float u = (float)(tile->mid_u - nc_axis_value(all->origin, (axis + 1) % 3));
    float v = (float)(tile->mid_v - nc_axis_value(all->origin, (axis + 2) % 3));
    float low[NC_GROUP], high[NC_GROUP], overlap[NC_GROUP];
    uint64_t chosen = 0;
    for (int k = 0; k < NC_N_PARTS; k++) {
        if (!tile->group->meets[k])
            continue;
        nc_lanes_bounds(all, &tile->group->group->cutter->reach[k], u, v, (float)tile->half, low,
                        high);
        memset(overlap, 0, sizeof overlap);
        nc_lanes_overlap(all, low, high, (float)(tile->lowest - origin),
                         (float)(tile->highest - origin), overlap);
        for (int i = 0; i < all->n; i++)
            if (overlap[i] > 0 && is_occupied(tile, origin, low[i], high[i]))
                chosen |= (uint64_t)1 << i;
    }
    return chosen;
}

/* ---------------------------------------------------------------------- one ray */

/* An end of the ray's material, counted from the lanes' origin. */
static float from_origin(const Tile *tile, double origin, const NcDexelEnd *end)
{
    return (float)(nc_dexel_mm(tile->ray.stock, tile->ray.axis, end->depth) - origin);
}

/* The chord that seems to take most goes first, and most others find nothing left. */
static void cut_freely(Tile *tile, float u, float v)
{
    const NcGroup *group = tile->group->group;
    const NcToolBody *body = &group->cutter->part[NC_PART_CUTTING];
    const NcDexelTile *rays = tile->ray.tile;
    double middle, origin = nc_axis_value(tile->lanes.origin, tile->ray.axis);
    float low[NC_GROUP], high[NC_GROUP];
    nc_lanes_bounds(&tile->lanes, body, u, v, 0, low, high);
    for (;;) {
        int32_t longest = 0;
        for (uint32_t k = rays->first[tile->ray.ray]; k < rays->first[tile->ray.ray + 1]; k += 2) {
            float in = from_origin(tile, origin, &rays->ends[k]);
            float out = from_origin(tile, origin, &rays->ends[k + 1]);
            longest = MAX(longest, nc_lanes_longest(&tile->lanes, low, high, in, out));
        }
        if (longest == 0)
            return;
        int lane = nc_lanes_lane(longest);
        nc_ray_subtract(&tile->ray, body, &group->chords[tile->lanes.chord[lane]], &middle);
        low[lane] = INFINITY;
        high[lane] = -INFINITY;
    }
}

static void meet(Tile *tile, NcContact new)
{
    GArray *contacts = tile->contacts;
    uint32_t first = tile->group->group->chords[0].cut;
    for (guint i = contacts->len; i > tile->others; i--) {
        NcContact *old = &g_array_index(contacts, NcContact, i - 1);
        if (old->cut < first)
            break;
        if (old->cut == new.cut && old->kind == new.kind && old->rubs == new.rubs) {
            if (new.length_mm > old->length_mm)
                *old = new;
            return;
        }
    }
    g_array_append_val(contacts, new);
}

/* How much of one segment of the ray's material lies in each lane's interval, at most. */
static void find_overlaps(const Tile *tile, const float *low, const float *high, float *overlap)
{
    const NcDexelTile *rays = tile->ray.tile;
    double origin = nc_axis_value(tile->lanes.origin, tile->ray.axis);
    memset(overlap, 0, NC_GROUP * sizeof *overlap);
    for (uint32_t k = rays->first[tile->ray.ray]; k < rays->first[tile->ray.ray + 1]; k += 2)
        nc_lanes_overlap(&tile->lanes, low, high, from_origin(tile, origin, &rays->ends[k]),
                         from_origin(tile, origin, &rays->ends[k + 1]), overlap);
}

/*
 * A shank as thick as the cutter takes nothing out of the cutter's own hole or slot, and touches
 * its walls: rays across them tell, and how far above the shank's lower end they run. A thicker
 * one has taken what it met; one that is pulled straight out touches what it did before.
 */
static void rub(Tile *tile, const NcChord *chord)
{
    const NcCutterParts *cutter = tile->group->group->cutter;
    double x = chord->b.x - chord->a.x, y = chord->b.y - chord->a.y, level2 = x * x + y * y;
    if (tile->ray.axis == 2 ||
        cutter->part[NC_PART_SHANK].radius > cutter->part[NC_PART_CUTTING].radius ||
        (level2 == 0 && chord->b.z > chord->a.z))
        return;
    double middle;
    const NcToolBody *shank = &cutter->reach[NC_PART_SHANK];
    if (!(nc_ray_measure(&tile->ray, shank, chord, &middle) > NC_CONTACT_MM))
        return;
    SegVec3 p = nc_dexel_point(tile->ray.axis, tile->ray.origin, middle);
    /* Straight down it ends at the bottom, else it comes past the place on its way. */
    double s = level2 > 0 ? ((p.x - chord->a.x) * x + (p.y - chord->a.y) * y) / level2 : 1;
    double tip = seg_lerp(chord->a, chord->b, CLAMP(s, 0, 1)).z;
    meet(tile, (NcContact){.cut = chord->cut,
                           .kind = NC_COLLISION_SHANK,
                           .rubs = true,
                           .length_mm = p.z - tip - shank->bottom,
                           .position = p});
}

/* Chord by chord, and of each its parts from the tip up: what the cutting part has taken the shank
 * does not meet. */
static void cut_in_order(Tile *tile, float u, float v)
{
    const NcGroup *group = tile->group->group;
    float low[NC_N_PARTS][NC_GROUP], high[NC_N_PARTS][NC_GROUP], overlap[NC_N_PARTS][NC_GROUP];
    for (int k = 0; k < NC_N_PARTS; k++)
        if (tile->group->meets[k]) {
            nc_lanes_bounds(&tile->lanes, &group->cutter->reach[k], u, v, 0, low[k], high[k]);
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
                meet(tile, (NcContact){
                               .cut = chord->cut,
                               .kind = kind,
                               .axis = tile->ray.axis,
                               .length_mm = length,
                               .position = nc_dexel_point(tile->ray.axis, tile->ray.origin, middle),
                           });
            if (k == NC_PART_SHANK)
                rub(tile, chord);
        }
}
