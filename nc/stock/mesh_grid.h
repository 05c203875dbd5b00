/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The grid that the in-process model is contoured on: the nodes where the stock's rays meet, with
 * one layer of empty ones around, each in or out of the material; and where the surface crosses the
 * edges between them.
 *
 * Axes are 0, 1, 2. An edge is named by its lower node and its axis, a cell by its lowest node.
 */
#ifndef NC_STOCK_MESH_GRID_H
#define NC_STOCK_MESH_GRID_H

#include "nc/nc.h"

enum { NC_CELL_EDGES = 12, NC_NO_PATCH = 255 };

/* The pieces of surface in a cell. */
typedef struct {
    uint8_t n;                      /* 0 … 4 */
    bool ambiguous;                 /* a face has its corners in and out crosswise */
    uint8_t of_edge[NC_CELL_EDGES]; /* 0 … n - 1, or NC_NO_PATCH where nothing crosses */
} NcCellPatches;

typedef struct {
    const NcStock *stock;
    int32_t n[3]; /* nodes along an axis, the empty ones included */
    size_t words; /* of a column of nodes along Z, 64 a word */
    uint64_t *inside;
    double origin_mm[3]; /* of node 0, 0, 0 */
    double pitch_mm;
    /* A vertex keeps this far from the sides of its cell, in pitches, so that no two come together,
     * not even in single precision. */
    double margin;
    NcCellPatches *table;
} NcMeshGrid;

/* A node is in where its ray along Z has it in material: the other two agree (dexel.h). */
NcMeshGrid *nc_mesh_grid_new(const NcStock *stock);
void nc_mesh_grid_free(NcMeshGrid *grid);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcMeshGrid, nc_mesh_grid_free)

static inline const uint64_t *nc_mesh_column(const NcMeshGrid *grid, int32_t i, int32_t j)
{
    return grid->inside + ((size_t)i * (size_t)grid->n[1] + (size_t)j) * grid->words;
}

static inline bool nc_mesh_inside(const NcMeshGrid *grid, const int32_t node[3])
{
    return nc_mesh_column(grid, node[0], node[1])[node[2] >> 6] >> (node[2] & 63) & 1;
}

static inline double nc_mesh_coordinate(const NcMeshGrid *grid, int axis, int32_t node)
{
    return grid->origin_mm[axis] + node * grid->pitch_mm;
}

/* Where the surface crosses an edge. */
typedef struct {
    double at; /* 0 at the lower node, 1 at the upper */
    double normal[3];
    int32_t tool;
    uint32_t line;
} NcCrossing;

/* The crossing of an edge with one end in and one out: the first that its ray meets from the inner
 * end. What else crosses the edge is thinner than the pitch and not resolved. */
NcCrossing nc_mesh_crossing(const NcMeshGrid *grid, int axis, const int32_t node[3]);

#endif
