/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The triangles of the in-process model: around each crossed edge of the grid a ring of four
 * vertices, one in each cell, seen along the edge one in each quadrant. The ring is cut along the
 * diagonal that leaves both triangles upright in that view; where both do, along the one whose
 * surface comes closer to the crossing. A ring that passes doubled faces has more corners and is a
 * fan around a vertex at the crossing.
 */
#include "nc/stock/mesh_contour.h"

#include <string.h>

/* A row of cells is done by one thread: its triangles and vertices, then joined in order. */
typedef struct {
    NcMeshTriangle *triangles;
    SegVec3 *centres; /* vertices of its own, numbered -1, -2, … until they are joined */
    size_t n_triangles, n_centres, room_triangles, room_centres;
} Row;

enum { RING_MOST = 8 };

typedef struct {
    int axis;
    double line[2]; /* of the edge, along u and v */
    double height;  /* of the crossing, along the axis */
    NcCrossing crossing;
    int32_t corner[RING_MOST]; /* vertices, anticlockwise seen from the end of the axis */
    NcVertexOrigin made[RING_MOST];
    int n;
} Ring;

static void contour_row(const NcContour *contour, int32_t i, const SegVec3 *vertices, Row *row);
static Ring ring_of(const NcContour *contour, const int32_t node[3], int axis);
static void cut_ring(const SegVec3 *vertices, const Ring *ring, bool upwards, Row *row);
static void fan_ring(const Ring *ring, const NcMeshGrid *grid, const int32_t node[3], bool upwards,
                     Row *row);
static void join_rows(Row *rows, size_t n_rows, NcMesh *mesh);

void nc_contour_faces(const NcContour *contour, NcMesh *mesh)
{
    const int32_t n_rows = contour->grid->n[0] - 1;
    Row *rows = g_new0(Row, (size_t)n_rows);
#pragma omp parallel for schedule(dynamic, 4)
    for (int32_t i = 0; i < n_rows; i++)
        contour_row(contour, i, mesh->vertices, &rows[i]);
    join_rows(rows, (size_t)n_rows, mesh);
    g_free(rows);
}

static void contour_row(const NcContour *contour, int32_t i, const SegVec3 *vertices, Row *row)
{
    const NcMeshGrid *grid = contour->grid;
    for (int32_t j = 0; j < grid->n[1] - 1; j++) {
        const size_t *column = contour->column + nc_contour_column(contour, i, j);
        for (size_t c = column[0]; c < column[1]; c++) {
            const int32_t node[3] = {i, j, contour->level[c]};
            const uint8_t corners = nc_cell_corners(grid, node);
            const bool inside = corners & 1;
            for (int axis = 0; axis < 3; axis++) {
                if ((corners >> (1 << axis) & 1) == inside)
                    continue;
                const Ring ring = ring_of(contour, node, axis);
                if (ring.n == 4)
                    cut_ring(vertices, &ring, inside, row);
                else
                    fan_ring(&ring, grid, node, inside, row);
            }
        }
    }
}

/* ------------------------------------------------------------------------------ rings */

typedef struct {
    int32_t node[3];
    size_t cell;
    NcCellPatches patches;
    int edge; /* the ring's, in this cell */
} RingCell;

static RingCell ring_cell(const NcContour *contour, const int32_t node[3], int axis, int a, int b)
{
    RingCell at = {.edge = nc_cell_edge(axis, a, b)};
    memcpy(at.node, node, sizeof at.node);
    at.node[(axis + 1) % 3] -= a;
    at.node[(axis + 2) % 3] -= b;
    at.cell = nc_contour_find(contour, at.node);
    at.patches = nc_cell_patches(contour->grid, at.node, nc_cell_corners(contour->grid, at.node));
    return at;
}

static void add_corner(const NcContour *contour, size_t vertex, Ring *ring)
{
    g_assert(vertex <= G_MAXINT32);
    ring->corner[ring->n] = (int32_t)vertex;
    ring->made[ring->n] = contour->made[vertex];
    ring->n++;
}

static void add_patch(const NcContour *contour, const RingCell *at, Ring *ring)
{
    const uint8_t patch = at->patches.of_edge[at->edge];
    add_corner(contour, contour->vertex[at->cell] + patch, ring);
    NcVertexOrigin *made = &ring->made[ring->n - 1];
    if (made->tool == NC_SEVERAL_TOOLS)
        *made = nc_contour_made_by(contour, at->node, patch, ring->crossing.tool);
}

/* The vertex of the line that leads through the lower face of a cell, if that face is doubled. */
static void add_doubled(const NcContour *contour, const RingCell *at, int face, Ring *ring)
{
    size_t vertex = contour->vertex[at->cell] + at->patches.n;
    for (int axis = 0; axis <= face; axis++) {
        const NcFaceLines lines = nc_cell_lower_face(contour->grid, at->node, &at->patches, axis);
        if (lines == NC_FACE_SINGLE)
            continue;
        if (axis < face) {
            vertex += 2;
            continue;
        }
        int edges[4], e = 0;
        nc_cell_face_edges(axis, 0, edges);
        while (edges[e] != at->edge)
            e++;
        add_corner(contour, vertex + (size_t)nc_face_line(lines, e), ring);
    }
}

static Ring ring_of(const NcContour *contour, const int32_t node[3], int axis)
{
    /* Sides of the edge in its four cells; the face to the next is the lower face of the cell that
     * lies higher across it. */
    static const int sides[4][2] = {{1, 1}, {0, 1}, {0, 0}, {1, 0}};
    static const int higher[4] = {1, 2, 2, 3};
    const NcMeshGrid *grid = contour->grid;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Ring ring = {.axis = axis, .crossing = nc_mesh_crossing(grid, axis, node)};
    ring.line[0] = nc_mesh_coordinate(grid, u, node[u]);
    ring.line[1] = nc_mesh_coordinate(grid, v, node[v]);
    ring.height = nc_mesh_coordinate(grid, axis, node[axis]) + ring.crossing.at * grid->pitch_mm;
    RingCell cells[4];
    for (int c = 0; c < 4; c++)
        cells[c] = ring_cell(contour, node, axis, sides[c][0], sides[c][1]);
    for (int c = 0; c < 4; c++) {
        add_patch(contour, &cells[c], &ring);
        if (cells[c].patches.ambiguous && cells[(c + 1) % 4].patches.ambiguous)
            add_doubled(contour, &cells[higher[c]], c % 2 == 0 ? u : v, &ring);
    }
    return ring;
}

/* -------------------------------------------------------------------------- triangles */

/* What made a triangle: its crossing's tool, and the lines of that tool around. */
static void add_triangle(const Ring *ring, bool upwards, const int corner[3], int32_t centre,
                         Row *row)
{
    if (row->n_triangles == row->room_triangles) {
        row->room_triangles = 2 * row->room_triangles + 64;
        row->triangles = g_renew(NcMeshTriangle, row->triangles, row->room_triangles);
    }
    NcMeshTriangle triangle = {.tool = ring->crossing.tool,
                               .first_line = ring->crossing.line,
                               .last_line = ring->crossing.line};
    for (int i = 0; i < 3; i++) {
        const int c = corner[i];
        triangle.vertex[upwards ? i : 2 - i] = c < 0 ? centre : ring->corner[c];
        if (c < 0 || ring->made[c].tool != triangle.tool)
            continue;
        triangle.first_line = MIN(triangle.first_line, ring->made[c].first_line);
        triangle.last_line = MAX(triangle.last_line, ring->made[c].last_line);
    }
    row->triangles[row->n_triangles++] = triangle;
}

/* A corner seen along the edge. */
typedef struct {
    double u, v, height;
} Seen;

static double twice_area(Seen a, Seen b, Seen c)
{
    return (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
}

/* The smaller of the two triangles' areas, twice; and how far their surface passes from the
 * crossing. The diagonal is a-c. */
static double examine_cut(Seen a, Seen b, Seen c, Seen d, double height, double *miss)
{
    const Seen edge = {0, 0, 0};
    const bool in_abc = twice_area(a, edge, c) >= 0;
    const Seen t[3] = {a, in_abc ? b : c, in_abc ? c : d};
    const double all = twice_area(t[0], t[1], t[2]);
    const double there =
        (twice_area(edge, t[1], t[2]) * t[0].height + twice_area(t[0], edge, t[2]) * t[1].height +
         twice_area(t[0], t[1], edge) * t[2].height) /
        all;
    *miss = all > 0 ? fabs(there - height) : INFINITY;
    return fmin(twice_area(a, b, c), twice_area(a, c, d));
}

static void cut_ring(const SegVec3 *vertices, const Ring *ring, bool upwards, Row *row)
{
    static const int cuts[2][2][3] = {{{0, 1, 2}, {0, 2, 3}}, {{1, 2, 3}, {1, 3, 0}}};
    const int d = ring->axis, u = (d + 1) % 3, v = (d + 2) % 3;
    Seen s[4];
    for (int i = 0; i < 4; i++) {
        const SegVec3 p = vertices[ring->corner[i]];
        const double at[3] = {p.x, p.y, p.z};
        s[i] = (Seen){at[u] - ring->line[0], at[v] - ring->line[1], at[d]};
    }
    double miss[2];
    const double area[2] = {examine_cut(s[0], s[1], s[2], s[3], ring->height, &miss[0]),
                            examine_cut(s[1], s[2], s[3], s[0], ring->height, &miss[1])};
    /* Of two that come equally close, as on a plane, the one with the rounder triangles. */
    const double same = 1e-6 * fabs(s[0].u - s[2].u);
    int best = area[0] >= area[1] ? 0 : 1;
    if (area[1 - best] > 0 && miss[1 - best] < miss[best] - same)
        best = 1 - best;
    for (int t = 0; t < 2; t++)
        add_triangle(ring, upwards, cuts[best][t], 0, row);
}

static void fan_ring(const Ring *ring, const NcMeshGrid *grid, const int32_t node[3], bool upwards,
                     Row *row)
{
    if (row->n_centres == row->room_centres) {
        row->room_centres = 2 * row->room_centres + 16;
        row->centres = g_renew(SegVec3, row->centres, row->room_centres);
    }
    double at[3];
    for (int d = 0; d < 3; d++)
        at[d] = nc_mesh_coordinate(grid, d, node[d]);
    at[ring->axis] += CLAMP(ring->crossing.at, grid->margin, 1 - grid->margin) * grid->pitch_mm;
    row->centres[row->n_centres++] =
        seg_vec3((double)(float)at[0], (double)(float)at[1], (double)(float)at[2]);
    for (int i = 0; i < ring->n; i++)
        add_triangle(ring, upwards, (const int[3]){-1, i, (i + 1) % ring->n},
                     -(int32_t)row->n_centres, row);
}

/* Each is freed as soon as it is joined: the triangles need not fit twice. */
static void join_rows(Row *rows, size_t n_rows, NcMesh *mesh)
{
    size_t n_vertices = mesh->n_vertices;
    for (size_t r = 0; r < n_rows; r++) {
        mesh->n_triangles += rows[r].n_triangles;
        n_vertices += rows[r].n_centres;
    }
    g_assert(n_vertices <= G_MAXINT32);
    mesh->vertices = g_renew(SegVec3, mesh->vertices, n_vertices);
    mesh->triangles = g_new(NcMeshTriangle, mesh->n_triangles);
    NcMeshTriangle *to = mesh->triangles;
    for (size_t r = 0; r < n_rows; r++) {
        const Row *row = &rows[r];
        for (size_t t = 0; t < row->n_triangles; t++, to++) {
            *to = row->triangles[t];
            for (int i = 0; i < 3; i++)
                if (to->vertex[i] < 0)
                    to->vertex[i] = (int32_t)mesh->n_vertices - 1 - to->vertex[i];
        }
        if (row->n_centres > 0)
            memcpy(mesh->vertices + mesh->n_vertices, row->centres,
                   row->n_centres * sizeof *row->centres);
        mesh->n_vertices += row->n_centres;
        g_free(row->triangles);
        g_free(row->centres);
    }
}
