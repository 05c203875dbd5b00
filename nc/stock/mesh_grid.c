/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/mesh_grid.h"

#include <float.h>

#include "nc/stock/dexel.h"
#include "nc/stock/mesh_cell.h"

/* Of the pitch: far below what a sharp edge may be off. */
#define MARGIN 4e-4

static void fill_column(const NcStock *stock, int32_t u, int32_t v, uint64_t *column);

NcMeshGrid *nc_mesh_grid_new(const NcStock *stock)
{
    NcMeshGrid *grid = g_new0(NcMeshGrid, 1);
    double farthest_mm = 0;
    grid->stock = stock;
    grid->pitch_mm = stock->pitch_mm;
    for (int d = 0; d < 3; d++) {
        grid->n[d] = stock->n_nodes[d] + 2;
        grid->origin_mm[d] = nc_dexel_node_mm(stock, d, -1);
        farthest_mm = fmax(farthest_mm, fmax(fabs(nc_mesh_coordinate(grid, d, 0)),
                                             fabs(nc_mesh_coordinate(grid, d, grid->n[d]))));
    }
    grid->margin = fmin(0.25, fmax(MARGIN, 2 * farthest_mm * (double)FLT_EPSILON / grid->pitch_mm));
    grid->words = ((size_t)grid->n[2] + 63) / 64;
    grid->inside = g_new0(uint64_t, (size_t)grid->n[0] * (size_t)grid->n[1] * grid->words);
    grid->table = nc_cell_table_new();
#pragma omp parallel for schedule(dynamic, 8)
    for (int32_t i = 0; i < stock->n_nodes[0]; i++)
        for (int32_t j = 0; j < stock->n_nodes[1]; j++)
            fill_column(stock, i, j, (uint64_t *)nc_mesh_column(grid, i + 1, j + 1));
    return grid;
}

void nc_mesh_grid_free(NcMeshGrid *grid)
{
    if (!grid)
        return;
    g_free(grid->inside);
    g_free(grid->table);
    g_free(grid);
}

/* The bits from `first` to `last`. */
static void set_bits(uint64_t *words, int32_t first, int32_t last)
{
    for (int32_t at = first; at <= last; at = (at | 63) + 1) {
        const int32_t end = MIN(last, at | 63);
        words[at >> 6] |= ~0ull >> (63 - (end - at)) << (at & 63);
    }
}

/* No end of a segment lies on a node (dexel.h). */
static void fill_column(const NcStock *stock, int32_t u, int32_t v, uint64_t *column)
{
    size_t n;
    const NcDexelEnd *ends = nc_dexel_ray(stock, 2, u, v, &n);
    for (size_t e = 0; e < n; e += 2)
        set_bits(column, (ends[e].depth >> stock->shift) + 2,
                 (ends[e + 1].depth >> stock->shift) + 1);
}

/* The number of ends below a depth. */
static size_t ends_below(const NcDexelEnd *ends, size_t n, int64_t depth)
{
    size_t first = 0;
    while (n > 0) {
        const size_t half = n / 2;
        if (ends[first + half].depth < depth) {
            first += half + 1;
            n -= half + 1;
        } else {
            n = half;
        }
    }
    return first;
}

static NcDexelEnd unseen_end(int axis, bool upwards, int64_t low, int64_t high)
{
    const double out = upwards ? 1 : -1;
    NcDexelEnd end = {.depth = (int32_t)((low + high) / 2)};
    nc_dexel_set_normal(&end,
                        seg_vec3(axis == 0 ? out : 0, axis == 1 ? out : 0, axis == 2 ? out : 0));
    return end;
}

/* Where a surface grazes a node within rounding its rays may disagree: then the nearest end serves,
 * or the middle of the edge, so that the mesh is closed all the same. */
NcCrossing nc_mesh_crossing(const NcMeshGrid *grid, int axis, const int32_t node[3])
{
    const NcStock *stock = grid->stock;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const int64_t low = nc_dexel_node_depth(stock, node[axis] - 1);
    const int64_t high = low + ((int64_t)1 << stock->shift);
    const bool upwards = nc_mesh_inside(grid, node); /* out of the material */
    size_t n;
    const NcDexelEnd *ends = nc_dexel_ray(stock, axis, node[u] - 1, node[v] - 1, &n);
    size_t at = upwards ? ends_below(ends, n, low) : ends_below(ends, n, high);
    at -= at > 0 && (!upwards || at == n);
    const NcDexelEnd end = n > 0 ? ends[at] : unseen_end(axis, upwards, low, high);
    const NcCut *cut = &stock->cuts[end.cut];
    const SegVec3 normal = nc_dexel_normal(&end);
    return (NcCrossing){.at = CLAMP((double)(end.depth - low) / (double)(high - low), 0, 1),
                        .normal = {normal.x, normal.y, normal.z},
                        .tool = cut->tool,
                        .line = cut->line};
}
