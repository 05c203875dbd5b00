/* SPDX-License-Identifier: Apache-2.0 */
/* The in-process model while it is made: the cells that the surface passes, column by column along
 * Z, and their vertices. */
#ifndef NC_STOCK_MESH_CONTOUR_H
#define NC_STOCK_MESH_CONTOUR_H

#include "nc/stock/mesh_cell.h"

/* What made the surface at a vertex. */
typedef struct {
    int32_t tool; /* NC_SEVERAL_TOOLS: ask nc_contour_made_by */
    uint32_t first_line, last_line;
} NcVertexOrigin;

enum { NC_SEVERAL_TOOLS = -1 };

typedef struct {
    const NcMeshGrid *grid;
    size_t *column; /* first cell of each column, ending with their number */
    int32_t *level; /* of each cell: its node along Z, ascending in a column */
    size_t *vertex; /* first vertex of each cell, ending with their number: those of its patches,
                       then those of its doubled lower faces, two each */
    NcVertexOrigin *made;
} NcContour;

static inline size_t nc_contour_column(const NcContour *contour, int32_t i, int32_t j)
{
    return (size_t)i * (size_t)(contour->grid->n[1] - 1) + (size_t)j;
}

/* The cell at a node that the surface passes. */
size_t nc_contour_find(const NcContour *contour, const int32_t node[3]);

/* The lines of `tool` that made the surface in one patch of a cell. */
NcVertexOrigin nc_contour_made_by(const NcContour *contour, const int32_t node[3], int patch,
                                  int32_t tool);

/* The triangles between the vertices; may append vertices of its own. */
void nc_contour_faces(const NcContour *contour, NcMesh *mesh);

#endif
