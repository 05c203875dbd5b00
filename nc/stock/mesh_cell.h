/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the surface passes through one cell of the grid: its patches, each of which becomes one
 * vertex of the mesh (Nielson, "Dual Marching Cubes", 2004).
 *
 * Corners: bit 0 is X, bit 1 Y, bit 2 Z. With u and v the axes behind axis d in the cycle X, Y, Z,
 * edge 4d + a + 2b runs along d at side a of u and side b of v.
 */
#ifndef NC_STOCK_MESH_CELL_H
#define NC_STOCK_MESH_CELL_H

#include "nc/stock/mesh_grid.h"

/* The eight corners that are in; 0 or 255: the surface does not pass. */
uint8_t nc_cell_corners(const NcMeshGrid *grid, const int32_t node[3]);

/* The patches of the cell with these corners; `node` is its lowest. */
NcCellPatches nc_cell_patches(const NcMeshGrid *grid, const int32_t node[3], uint8_t corners);

/*
 * The surface may go through the lower face of `axis` in two lines that join the same patch on one
 * side of the face and the same on the other. The one edge between these two vertices would have
 * four triangles, so each line gets a vertex of its own.
 */
typedef enum {
    NC_FACE_SINGLE,
    NC_FACE_DOUBLED,         /* a line around the corners u = v = 0, the other around u = v = 1 */
    NC_FACE_DOUBLED_CROSSED, /* around the other two corners */
} NcFaceLines;

NcFaceLines nc_cell_lower_face(const NcMeshGrid *grid, const int32_t node[3],
                               const NcCellPatches *patches, int axis);

/* Which of the two lines, 0 or 1, ends on edge 0 … 3 of nc_cell_face_edges. */
static inline int nc_face_line(NcFaceLines lines, int edge)
{
    return edge < 2 ? edge : (edge - 2) ^ (lines == NC_FACE_DOUBLED_CROSSED);
}

static inline int nc_cell_edge(int axis, int a, int b)
{
    return 4 * axis + a + 2 * b;
}

/* The edges around the lower face of `axis`: along u at v = 0 and 1, along v at u = 0 and 1. */
void nc_cell_face_edges(int axis, int side, int edges[4]);

/* The lower node of one of the cell's edges. */
void nc_cell_edge_node(const int32_t node[3], int edge, int32_t of_edge[3]);

/* The patches of every set of corners, as far as the corners alone say it; 256, g_free. */
NcCellPatches *nc_cell_table_new(void);

#endif
