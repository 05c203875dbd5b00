/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The terrain's triangles and the tree over them, and the walk that drop and sweep share.
 *
 * The tree is flat in Z: it is searched by (x,y), and a branch is left when no point of it can lift
 * the cutter above what was found. A branch carries a box in (x,y) and a plane above all of its
 * points; against such a pair the lowest tip height has a bound that is nearly exact where the
 * surface is smooth, because the profile h of the cutter is convex (terrain_bound.c).
 */
#ifndef NC_TOOLPATH_TERRAIN_H
#define NC_TOOLPATH_TERRAIN_H

#include "nc/nc.h"

/* Children of a node, side by side in memory so that their bounds are computed together. */
#define NC_WIDTH 8

/* One triangle, ready for contact. */
typedef struct {
    SegVec3 v[3];      /* anticlockwise in (x,y), whatever way it faced */
    double up_x, up_y; /* unit vector uphill in (x,y); (0,0) where level */
    double slope_sin;  /* of the angle to the horizontal */
    double slope_cos;  /* 0: no area in (x,y), only its edges count */
    int32_t id;        /* index in the caller's triangles */
    bool thin;         /* too thin in (x,y) to trust its normal's rounding */
} NcFacet;

/* Per child: box in (x,y); a plane z + slope·up·(q - (lo_x, lo_y)) above all its points, and the
 * highest point. A missing child has top = -INFINITY. */
typedef struct {
    _Alignas(64) double lo_x[NC_WIDTH], hi_x[NC_WIDTH], lo_y[NC_WIDTH], hi_y[NC_WIDTH];
    double z[NC_WIDTH], slope[NC_WIDTH], slope_sin[NC_WIDTH], up_x[NC_WIDTH], up_y[NC_WIDTH];
    double top[NC_WIDTH];
    int32_t child[NC_WIDTH]; /* a node, or ~facet */
} NcNode;

struct NcTerrain {
    NcFacet *facets; /* in the tree's order */
    NcNode *nodes;   /* the root first */
    size_t n_facets, n_nodes;
    SegVec3 min, max;
    double size_mm; /* greatest absolute coordinate */
};

/* A straight move of the tip: middle ± half. A drop is a move of no length at height 0. */
typedef struct {
    SegVec3 middle, half;
} NcMoveSpan;

/*
 * For each child of `node` a number not below p.z - h(|p - c|) - z for any point p of it and any
 * position (c, z) of the tip on the span; -INFINITY for what the cutter does not reach. `slack_mm`
 * is added where the rounding of the sum could tell the difference.
 */
void nc_node_bounds(const NcNode *node, NcCutter cutter, const NcMoveSpan *span, double slack_mm,
                    double bounds[NC_WIDTH]);

/* Looks at a facet; may raise *floor; false ends the walk. */
typedef bool (*NcVisit)(const NcFacet *facet, double *floor, void *data);

/*
 * Visits, most promising first, every facet whose bound over the span is above *floor at that
 * time. The order depends on the terrain, the cutter and the span only, never on the floor.
 */
static inline void nc_terrain_walk(const NcTerrain *terrain, NcCutter cutter,
                                   const NcMoveSpan *span, double floor, NcVisit visit, void *data)
{
    /* 8 levels hold 16 million triangles; the limit of int32_t is reached below 11. */
    struct {
        double bound;
        int32_t child;
    } stack[NC_WIDTH * 12];
    size_t depth = 0;
    double slack_mm = 1e-11 * (1 + terrain->size_mm + cutter.radius_mm);
    if (terrain->n_facets > 0)
        stack[depth++].child = 0, stack[0].bound = INFINITY;
    while (depth > 0) {
        depth--;
        int32_t child = stack[depth].child;
        if (!(stack[depth].bound > floor))
            continue;
        if (child < 0) {
            if (!visit(&terrain->facets[~child], &floor, data))
                return;
            continue;
        }
        const NcNode *node = &terrain->nodes[child];
        double bounds[NC_WIDTH];
        nc_node_bounds(node, cutter, span, slack_mm, bounds);
        size_t first = depth;
        for (int i = 0; i < NC_WIDTH; i++) {
            if (!(bounds[i] > floor))
                continue;
            size_t at = depth++;
            for (; at > first && stack[at - 1].bound > bounds[i]; at--)
                stack[at] = stack[at - 1];
            stack[at].bound = bounds[i];
            stack[at].child = node->child[i];
        }
    }
}

#endif
