/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/cover.h"

#include <string.h>

#define CELLS_MOST 1000000
#define SEARCH_STEPS 40

typedef struct {
    SegVec3 a, b;
} Move;

/* Moves by the squares that their cutter touches from above. */
typedef struct {
    double x0, y0, cell;
    size_t nx, ny;
    size_t *first; /* of each cell, n + 1 */
    size_t *index; /* into moves */
    GArray *moves; /* Move */
} Grid;

static Grid grid_new(const NcTrace *trace, const GArray *pieces);
static bool is_cut(const Grid *grid, NcCutter cutter, SegVec3 q);

double nc_cover_left_mm2(const NcTrace *trace, const GArray *pieces, double height_mm,
                         const uint8_t *reached)
{
    const NcRegion *region = trace->region;
    Grid grid = grid_new(trace, pieces);
    g_autofree uint8_t *cut = g_new0(uint8_t, region->n_samples + 1);
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t i = 0; i < region->n_samples; i++) {
        const NcSample *sample = &region->samples[i];
        if (reached[i])
            cut[i] = is_cut(&grid, trace->body.cutter,
                            seg_along(sample->point, sample->normal, height_mm));
    }
    double left = 0;
    for (size_t i = 0; i < region->n_samples; i++)
        left += reached[i] && !cut[i] ? region->samples[i].area_mm2 : 0;
    g_array_unref(grid.moves);
    g_free(grid.first);
    g_free(grid.index);
    return left;
}

static size_t cell_of(double at, double from, double cell, size_t n)
{
    double i = floor((at - from) / cell);
    return (size_t)fmin(fmax(i, 0), (double)(n - 1));
}

/* Counts a move in the cells under it (index NULL), or writes it there. */
static void spread(const Grid *grid, double radius, size_t k, size_t *count, size_t *index)
{
    const Move *m = &g_array_index(grid->moves, Move, k);
    size_t i0 = cell_of(fmin(m->a.x, m->b.x) - radius, grid->x0, grid->cell, grid->nx);
    size_t i1 = cell_of(fmax(m->a.x, m->b.x) + radius, grid->x0, grid->cell, grid->nx);
    size_t j0 = cell_of(fmin(m->a.y, m->b.y) - radius, grid->y0, grid->cell, grid->ny);
    size_t j1 = cell_of(fmax(m->a.y, m->b.y) + radius, grid->y0, grid->cell, grid->ny);
    for (size_t i = i0; i <= i1; i++)
        for (size_t j = j0; j <= j1; j++) {
            size_t cell = i * grid->ny + j;
            if (index)
                index[count[cell]] = k;
            count[cell]++;
        }
}

static Grid grid_new(const NcTrace *trace, const GArray *pieces)
{
    double radius = trace->body.cutter.radius_mm;
    Grid grid = {.moves = g_array_new(FALSE, FALSE, sizeof(Move))};
    for (guint p = 0; p < pieces->len; p++) {
        const NcPiece *piece = &g_array_index(pieces, NcPiece, p);
        for (size_t k = 0; k < piece->n; k++) {
            /* Long moves are cut up: a slanting one would lie in every cell of its box. */
            Move move = {piece->tips[k > 0 ? k - 1 : 0], piece->tips[k]};
            double level = hypot(move.b.x - move.a.x, move.b.y - move.a.y);
            size_t parts = (size_t)fmin(ceil(level / radius), 1000) + 1;
            for (size_t i = 0; i < parts; i++) {
                double s = (double)i / (double)parts, e = (double)(i + 1) / (double)parts;
                Move part = {seg_lerp(move.a, move.b, s), seg_lerp(move.a, move.b, e)};
                g_array_append_val(grid.moves, part);
            }
        }
    }
    const NcRegion *region = trace->region;
    double width = fmax(region->max.x - region->min.x, 1e-3);
    double depth = fmax(region->max.y - region->min.y, 1e-3);
    grid.x0 = region->min.x;
    grid.y0 = region->min.y;
    grid.cell = fmax(radius / 2, sqrt(width * depth / CELLS_MOST));
    grid.nx = (size_t)ceil(width / grid.cell);
    grid.ny = (size_t)ceil(depth / grid.cell);
    size_t n = grid.nx * grid.ny;
    g_autofree size_t *count = g_new0(size_t, n + 1);
    for (size_t k = 0; k < grid.moves->len; k++)
        spread(&grid, radius, k, count, NULL);
    grid.first = g_new0(size_t, n + 1);
    for (size_t c = 0; c < n; c++)
        grid.first[c + 1] = grid.first[c] + count[c];
    memcpy(count, grid.first, n * sizeof *count);
    grid.index = g_new(size_t, grid.first[n] + 1);
    for (size_t k = 0; k < grid.moves->len; k++)
        spread(&grid, radius, k, count, grid.index);
    return grid;
}

/* How far q lies above the cutter's surface with the tip at t of the move; concave in t. */
static double inside(const Move *m, NcCutter cutter, SegVec3 q, double t)
{
    SegVec3 tip = seg_lerp(m->a, m->b, t);
    return q.z - tip.z - nc_cutter_height_mm(cutter, hypot(q.x - tip.x, q.y - tip.y));
}

static bool passes_through(const Move *m, NcCutter cutter, SegVec3 q)
{
    if (q.z < fmin(m->a.z, m->b.z))
        return false;
    double dx = m->b.x - m->a.x, dy = m->b.y - m->a.y, l2 = dx * dx + dy * dy;
    double px = q.x - m->a.x, py = q.y - m->a.y;
    double near = l2 > 0 ? fmin(fmax((px * dx + py * dy) / l2, 0), 1) : 0;
    double off2 = (px - near * dx) * (px - near * dx) + (py - near * dy) * (py - near * dy);
    double r2 = cutter.radius_mm * cutter.radius_mm;
    if (off2 > r2)
        return false;
    /* The part of the move during which q is under the cutter, then the highest place of it. */
    double half = l2 > 0 ? sqrt((r2 - off2) / l2) : 0;
    double lo = fmax(near - half, 0), hi = l2 > 0 ? fmin(near + half, 1) : 1;
    for (int i = 0; i < SEARCH_STEPS && hi > lo; i++) {
        double s = lo + (hi - lo) * 0.382, e = lo + (hi - lo) * 0.618;
        double at_s = inside(m, cutter, q, s), at_e = inside(m, cutter, q, e);
        if (at_s >= 0 || at_e >= 0)
            return true;
        if (at_s < at_e)
            lo = s;
        else
            hi = e;
    }
    return inside(m, cutter, q, (lo + hi) / 2) >= 0;
}

static bool is_cut(const Grid *grid, NcCutter cutter, SegVec3 q)
{
    size_t i = cell_of(q.x, grid->x0, grid->cell, grid->nx);
    size_t j = cell_of(q.y, grid->y0, grid->cell, grid->ny);
    size_t cell = i * grid->ny + j;
    for (size_t k = grid->first[cell]; k < grid->first[cell + 1]; k++)
        if (passes_through(&g_array_index(grid->moves, Move, grid->index[k]), cutter, q))
            return true;
    return false;
}
