/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The in-process model: dual contouring of the stock's rays.
 *
 * Every patch of surface in a cell of the grid is a vertex, at the point that fits the planes of
 * its crossings best, so edges and corners stay sharp; every crossed edge of the grid is a quad
 * between the four patches around it. That is closed and manifold: a crossed edge has one patch in
 * each of its four cells, and a patch is one ring of crossed edges (mesh_cell.h). No two vertices
 * come to lie in one place, and no triangle is without an area or upside down: a vertex lies in its
 * own cell, off the sides that other vertices may reach, so that a quad seen along its edge is a
 * four-cornered star around it (mesh_faces.c).
 */
#include "nc/stock/mesh_contour.h"

#include "nc/stock/mesh_fit.h"

#include <string.h>

static void list_cells(NcContour *contour);
static void count_vertices(NcContour *contour);
static void place_vertices(const NcContour *contour, SegVec3 *vertices);
static void place_cell(const NcContour *contour, const int32_t node[3], size_t cell,
                       SegVec3 *vertices);

NcMesh *nc_stock_mesh(const NcStock *stock)
{
    g_autoptr(NcMeshGrid) grid = nc_mesh_grid_new(stock);
    NcContour contour = {.grid = grid};
    NcMesh *mesh = g_new0(NcMesh, 1);
    list_cells(&contour);
    count_vertices(&contour);
    const size_t n_columns = nc_contour_column(&contour, grid->n[0] - 1, 0);
    mesh->n_vertices = contour.vertex[contour.column[n_columns]];
    mesh->vertices = g_new(SegVec3, mesh->n_vertices);
    contour.made = g_new(NcVertexOrigin, mesh->n_vertices);
    place_vertices(&contour, mesh->vertices);
    nc_contour_faces(&contour, mesh);
    g_free(contour.made);
    g_free(contour.vertex);
    g_free(contour.level);
    g_free(contour.column);
    return mesh;
}

void nc_mesh_free(NcMesh *mesh)
{
    if (!mesh)
        return;
    g_free(mesh->vertices);
    g_free(mesh->triangles);
    g_free(mesh);
}

size_t nc_contour_find(const NcContour *contour, const int32_t node[3])
{
    const size_t column = nc_contour_column(contour, node[0], node[1]);
    size_t first = contour->column[column], end = contour->column[column + 1];
    while (end - first > 1) {
        const size_t middle = first + (end - first) / 2;
        if (contour->level[middle] <= node[2])
            first = middle;
        else
            end = middle;
    }
    return first;
}

/* ----------------------------------------------------------------------------- cells */

/* Of 64 cells from node 64·word upwards, a bit each: whether the surface passes. */
static uint64_t passed(const NcMeshGrid *grid, int32_t i, int32_t j, size_t word)
{
    uint64_t any[2] = {0, 0}, all[2] = {~0ull, ~0ull};
    const bool last = word + 1 == grid->words;
    for (int c = 0; c < 4; c++) {
        const uint64_t *column = nc_mesh_column(grid, i + (c & 1), j + (c >> 1)) + word;
        const uint64_t above = column[0] >> 1 | (last ? 0 : column[1] << 63);
        any[0] |= column[0];
        any[1] |= above;
        all[0] &= column[0];
        all[1] &= above;
    }
    return (any[0] | any[1]) & ~(all[0] & all[1]);
}

static void list_cells(NcContour *contour)
{
    const NcMeshGrid *grid = contour->grid;
    const size_t n_columns = nc_contour_column(contour, grid->n[0] - 1, 0);
    contour->column = g_new(size_t, n_columns + 1);
    contour->column[0] = 0;
#pragma omp parallel for schedule(static)
    for (int32_t i = 0; i < grid->n[0] - 1; i++)
        for (int32_t j = 0; j < grid->n[1] - 1; j++) {
            size_t n = 0;
            for (size_t w = 0; w < grid->words; w++)
                n += (size_t)__builtin_popcountll(passed(grid, i, j, w));
            contour->column[nc_contour_column(contour, i, j) + 1] = n;
        }
    for (size_t c = 0; c < n_columns; c++)
        contour->column[c + 1] += contour->column[c];
    contour->level = g_new(int32_t, contour->column[n_columns]);
#pragma omp parallel for schedule(dynamic, 8)
    for (int32_t i = 0; i < grid->n[0] - 1; i++)
        for (int32_t j = 0; j < grid->n[1] - 1; j++) {
            size_t cell = contour->column[nc_contour_column(contour, i, j)];
            for (size_t w = 0; w < grid->words; w++)
                for (uint64_t bits = passed(grid, i, j, w); bits; bits &= bits - 1)
                    contour->level[cell++] = (int32_t)(64 * w) + __builtin_ctzll(bits);
        }
}

static size_t vertices_of(const NcMeshGrid *grid, const int32_t node[3])
{
    const NcCellPatches patches = nc_cell_patches(grid, node, nc_cell_corners(grid, node));
    size_t n = patches.n;
    for (int axis = 0; axis < 3 && patches.ambiguous; axis++)
        n += nc_cell_lower_face(grid, node, &patches, axis) == NC_FACE_SINGLE ? 0 : 2;
    return n;
}

static void count_vertices(NcContour *contour)
{
    const NcMeshGrid *grid = contour->grid;
    const size_t n_cells = contour->column[nc_contour_column(contour, grid->n[0] - 1, 0)];
    contour->vertex = g_new(size_t, n_cells + 1);
    contour->vertex[0] = 0;
#pragma omp parallel for schedule(dynamic, 8)
    for (int32_t i = 0; i < grid->n[0] - 1; i++)
        for (int32_t j = 0; j < grid->n[1] - 1; j++) {
            const size_t *column = contour->column + nc_contour_column(contour, i, j);
            for (size_t c = column[0]; c < column[1]; c++)
                contour->vertex[c + 1] =
                    vertices_of(grid, (const int32_t[3]){i, j, contour->level[c]});
        }
    for (size_t c = 0; c < n_cells; c++)
        contour->vertex[c + 1] += contour->vertex[c];
}

/* -------------------------------------------------------------------------- vertices */

static void place_vertices(const NcContour *contour, SegVec3 *vertices)
{
    const NcMeshGrid *grid = contour->grid;
#pragma omp parallel for schedule(dynamic, 8)
    for (int32_t i = 0; i < grid->n[0] - 1; i++)
        for (int32_t j = 0; j < grid->n[1] - 1; j++) {
            const size_t *column = contour->column + nc_contour_column(contour, i, j);
            for (size_t c = column[0]; c < column[1]; c++)
                place_cell(contour, (const int32_t[3]){i, j, contour->level[c]}, c, vertices);
        }
}

/* Rounded to what single precision holds: nothing is lost where the mesh is written. */
static SegVec3 to_space(const NcMeshGrid *grid, const int32_t node[3], const double local[3])
{
    double p[3];
    for (int d = 0; d < 3; d++)
        p[d] = (double)(float)(nc_mesh_coordinate(grid, d, node[d]) + local[d] * grid->pitch_mm);
    return seg_vec3(p[0], p[1], p[2]);
}

/* A crossing in the cell, from 0 to 1 along each axis. */
static NcCrossing cross_locally(const NcMeshGrid *grid, const int32_t node[3], int edge,
                                double point[3])
{
    int32_t lower[3];
    nc_cell_edge_node(node, edge, lower);
    const NcCrossing crossing = nc_mesh_crossing(grid, edge / 4, lower);
    for (int d = 0; d < 3; d++)
        point[d] = lower[d] - node[d];
    point[edge / 4] = crossing.at;
    return crossing;
}

static NcVertexOrigin made_by(NcVertexOrigin made, bool first, const NcCrossing *crossing)
{
    if (first)
        return (NcVertexOrigin){crossing->tool, crossing->line, crossing->line};
    if (made.tool != crossing->tool)
        made.tool = NC_SEVERAL_TOOLS;
    made.first_line = MIN(made.first_line, crossing->line);
    made.last_line = MAX(made.last_line, crossing->line);
    return made;
}

/*
 * The box for a patch's vertex. It keeps off a side that another vertex may reach: off all sides,
 * but for one axis where all edges of the patch run along it (a face parallel to the grid, which
 * may lie right on it) and no surface is behind.
 */
static void bounds_of(const NcMeshGrid *grid, const int32_t node[3], unsigned directions,
                      double low[3], double high[3])
{
    for (int d = 0; d < 3; d++) {
        low[d] = grid->margin;
        high[d] = 1 - grid->margin;
        if (directions != 1u << d)
            continue;
        int32_t next[3] = {node[0], node[1], node[2]};
        next[d]--;
        if (next[d] < 0 || nc_cell_corners(grid, next) % 255 == 0)
            low[d] = 0;
        next[d] += 2;
        if (next[d] > grid->n[d] - 2 || nc_cell_corners(grid, next) % 255 == 0)
            high[d] = 1;
    }
}

static SegVec3 mean_of(const NcMeshGrid *grid, const int32_t node[3], const NcPlaneFit *fit)
{
    double point[3];
    nc_plane_fit_mean(fit, point);
    for (int d = 0; d < 3; d++)
        point[d] = CLAMP(point[d], grid->margin, 1 - grid->margin);
    return to_space(grid, node, point);
}

static void place_patches(const NcContour *contour, const int32_t node[3],
                          const NcCellPatches *patches, SegVec3 *vertices, NcVertexOrigin *made)
{
    NcPlaneFit fits[4] = {0};
    unsigned directions[4] = {0};
    double low[3], high[3], point[3];
    for (int e = 0; e < NC_CELL_EDGES; e++) {
        const uint8_t patch = patches->of_edge[e];
        if (patch == NC_NO_PATCH)
            continue;
        const NcCrossing crossing = cross_locally(contour->grid, node, e, point);
        made[patch] = made_by(made[patch], fits[patch].n == 0, &crossing);
        nc_plane_fit_add(&fits[patch], point, crossing.normal);
        directions[patch] |= 1u << e / 4;
    }
    for (int i = 0; i < patches->n; i++) {
        bounds_of(contour->grid, node, directions[i], low, high);
        nc_plane_fit_best(&fits[i], low, high, point);
        vertices[i] = to_space(contour->grid, node, point);
    }
    /* Two patches that fit one point: the means of their crossings lie apart. */
    for (int i = 0; i < patches->n; i++)
        for (int j = 0; j < i; j++)
            if (seg_distance(vertices[i], vertices[j]) == 0) {
                vertices[i] = mean_of(contour->grid, node, &fits[i]);
                vertices[j] = mean_of(contour->grid, node, &fits[j]);
            }
}

/* A vertex half-way along each of the two lines in which the surface crosses a lower face. */
static void place_doubled(const NcContour *contour, const int32_t node[3], int axis,
                          NcFaceLines lines, SegVec3 *vertices, NcVertexOrigin *made)
{
    const double margin = contour->grid->margin;
    double middle[2][3] = {0}, point[3];
    bool met[2] = {false};
    int edges[4];
    nc_cell_face_edges(axis, 0, edges);
    for (int e = 0; e < 4; e++) {
        const int line = nc_face_line(lines, e), along = edges[e] / 4;
        const NcCrossing crossing = cross_locally(contour->grid, node, edges[e], point);
        point[along] = CLAMP(point[along], margin, 1 - margin);
        for (int d = 0; d < 3; d++)
            middle[line][d] += point[d] / 2;
        made[line] = made_by(made[line], !met[line], &crossing);
        met[line] = true;
    }
    for (int line = 0; line < 2; line++)
        vertices[line] = to_space(contour->grid, node, middle[line]);
}

static void place_cell(const NcContour *contour, const int32_t node[3], size_t cell,
                       SegVec3 *vertices)
{
    const NcMeshGrid *grid = contour->grid;
    const NcCellPatches patches = nc_cell_patches(grid, node, nc_cell_corners(grid, node));
    size_t at = contour->vertex[cell];
    place_patches(contour, node, &patches, vertices + at, contour->made + at);
    at += patches.n;
    for (int axis = 0; axis < 3 && patches.ambiguous; axis++) {
        const NcFaceLines lines = nc_cell_lower_face(grid, node, &patches, axis);
        if (lines == NC_FACE_SINGLE)
            continue;
        place_doubled(contour, node, axis, lines, vertices + at, contour->made + at);
        at += 2;
    }
}

NcVertexOrigin nc_contour_made_by(const NcContour *contour, const int32_t node[3], int patch,
                                  int32_t tool)
{
    const NcMeshGrid *grid = contour->grid;
    const NcCellPatches patches = nc_cell_patches(grid, node, nc_cell_corners(grid, node));
    NcVertexOrigin made = {.tool = NC_SEVERAL_TOOLS};
    bool met = false;
    for (int e = 0; e < NC_CELL_EDGES; e++) {
        double point[3];
        if (patches.of_edge[e] != patch)
            continue;
        const NcCrossing crossing = cross_locally(grid, node, e, point);
        if (crossing.tool != tool)
            continue;
        made = made_by(made, !met, &crossing);
        met = true;
    }
    return made;
}
