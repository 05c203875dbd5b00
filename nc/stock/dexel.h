/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The tri-dexel stock in memory. Nodes lie on a grid; through each goes one ray of each axis, and
 * a ray keeps the segments of it that are material.
 *
 * Axes are 0, 1, 2 for X, Y, Z. The rays of axis d are numbered (u, v), u being the node's index
 * along axis (d + 1) % 3, v along (d + 2) % 3. Depths along a ray are whole numbers of
 * pitch / 2^shift, counted from node 0: node i lies at depth i·2^shift exactly, and no end of a
 * segment ever does. An end near a node is put on the side that nc_swept_contains gives the node,
 * so the three rays through a node agree whether it is material. (All but a ray that runs in the
 * surface to the last digit, in a wall along it: that one may have its nodes on the other side.)
 */
#ifndef NC_STOCK_DEXEL_H
#define NC_STOCK_DEXEL_H

#include "nc/nc.h"

enum {
    NC_TILE = 8, /* rays along u and v that are kept together */
    NC_TILE_RAYS = NC_TILE * NC_TILE,
    NC_DEXEL_DEPTH_BITS = 30, /* of the largest depth */
};

/* One end of a segment. */
typedef struct {
    int32_t depth;
    int16_t normal[2]; /* outward, octahedral; error below 1e-4 rad */
    uint32_t cut;      /* index of the NcCut that made it; 0: raw stock */
} NcDexelEnd;

/* What the ends say about where they come from; one a block that cut. */
typedef struct {
    uint32_t line;
    int32_t tool;
} NcCut;

/* The rays (u, v) of one tile, u fastest: ends of ray r are [first[r], first[r + 1]), in pairs:
 * into material, out of it, ascending. */
typedef struct {
    NcDexelEnd *ends;
    uint32_t first[NC_TILE_RAYS + 1];
    uint32_t capacity;
    /* Bit i: material may lie in the i-th of 64 even parts of the axis; over all rays. */
    uint64_t occupied;
} NcDexelTile;

/* The rays of one axis. Those beyond n_rays in the last tiles are empty. */
typedef struct {
    int32_t n_rays[2];  /* along u, v */
    int32_t n_tiles[2]; /* along u, v */
    NcDexelTile *tiles; /* u fastest */
} NcDexelField;

struct NcStock {
    double pitch_mm;
    int shift;
    double unit_mm; /* of depths: pitch_mm / 2^shift */
    SegVec3 min, max;
    double node_mm[3]; /* coordinates of node 0: off the faces by an odd part of the pitch */
    int32_t n_nodes[3];
    NcDexelField field[3];
    uint64_t memory_bytes; /* allowed */
    NcCut *cuts;
    uint32_t n_cuts, cuts_capacity;
};

/* The ends of one ray, *n of them (even). */
static inline const NcDexelEnd *nc_dexel_ray(const NcStock *stock, int axis, int32_t u, int32_t v,
                                             size_t *n)
{
    const NcDexelField *field = &stock->field[axis];
    const NcDexelTile *tile =
        &field->tiles[(size_t)(v / NC_TILE) * (size_t)field->n_tiles[0] + (size_t)(u / NC_TILE)];
    int ray = v % NC_TILE * NC_TILE + u % NC_TILE;
    *n = tile->first[ray + 1] - tile->first[ray];
    return tile->ends + tile->first[ray];
}

static inline double nc_dexel_node_mm(const NcStock *stock, int axis, int32_t node)
{
    return stock->node_mm[axis] + node * stock->pitch_mm;
}

static inline int32_t nc_dexel_node_depth(const NcStock *stock, int32_t node)
{
    return node * (1 << stock->shift);
}

static inline double nc_dexel_mm(const NcStock *stock, int axis, int32_t depth)
{
    return stock->node_mm[axis] + depth * stock->unit_mm;
}

/* The nearest depth to a coordinate along the axis; far outside the grid, some depth outside. */
static inline int32_t nc_dexel_depth(const NcStock *stock, int axis, double mm)
{
    const double most = 1 << NC_DEXEL_DEPTH_BITS;
    double depth = (mm - stock->node_mm[axis]) / stock->unit_mm;
    return (int32_t)lrint(depth > most ? most : depth < -most ? -most : depth);
}

/* A ray's point where its own coordinate is 0. */
static inline SegVec3 nc_dexel_origin(const NcStock *stock, int axis, int32_t u, int32_t v)
{
    double at[3] = {0, 0, 0};
    at[(axis + 1) % 3] = nc_dexel_node_mm(stock, (axis + 1) % 3, u);
    at[(axis + 2) % 3] = nc_dexel_node_mm(stock, (axis + 2) % 3, v);
    return seg_vec3(at[0], at[1], at[2]);
}

/* The ray's point at this coordinate. */
static inline SegVec3 nc_dexel_point(int axis, SegVec3 origin, double mm)
{
    return seg_vec3(axis == 0 ? mm : origin.x, axis == 1 ? mm : origin.y,
                    axis == 2 ? mm : origin.z);
}

/* Whether a surface with this normal that crosses a ray at `depth` is so near to a node, by the
 * error of the sweep and of the depth, that it may be on either side. */
bool nc_dexel_near_node(const NcStock *stock, int axis, int32_t depth, SegVec3 normal,
                        int32_t *node);

/* Outward unit normal; of the end into material it points against the ray. */
SegVec3 nc_dexel_normal(const NcDexelEnd *end);
void nc_dexel_set_normal(NcDexelEnd *end, SegVec3 normal);

/* A stock in these bounds with no material yet. Its grid and memory are checked before anything is
 * allocated: NC_ERROR_PLAN. */
NcStock *nc_stock_alloc(SegVec3 min, SegVec3 max, const NcStockOptions *options, GError **error);

/* Makes room in a tile for this many ends in all. */
void nc_dexel_reserve(NcDexelTile *tile, uint32_t n);

/* Sets the tile's `occupied` from its ends. */
void nc_dexel_tile_occupy(const NcStock *stock, int axis, NcDexelTile *tile);

/* The part of the axis, 0 … 63, that a depth falls into. */
static inline int nc_dexel_part(const NcStock *stock, int axis, int32_t depth)
{
    int64_t span = (int64_t)(stock->n_nodes[axis] + 1) << stock->shift;
    int64_t part = ((int64_t)depth + ((int64_t)1 << stock->shift)) * 64 / span;
    return part < 0 ? 0 : part > 63 ? 63 : (int)part;
}

#endif
