/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/mesh_cell.h"

#include <string.h>

enum { ALONG_U_LOW, ALONG_U_HIGH, ALONG_V_LOW, ALONG_V_HIGH };

static NcCellPatches trace(uint8_t corners, const bool joined[6]);
static bool is_ambiguous(uint8_t corners, int axis, int side);
static bool goes_around_first(uint8_t corners, int axis, int side, bool joined);
static bool is_joined(const NcMeshGrid *grid, const int32_t face[3], int axis);

uint8_t nc_cell_corners(const NcMeshGrid *grid, const int32_t node[3])
{
    const size_t word = (size_t)node[2] >> 6;
    const unsigned bit = (unsigned)node[2] & 63;
    unsigned corners = 0;
    for (int c = 0; c < 4; c++) {
        const uint64_t *column = nc_mesh_column(grid, node[0] + (c & 1), node[1] + (c >> 1));
        const uint64_t low = column[word] >> bit & 1;
        const uint64_t high = bit < 63 ? column[word] >> (bit + 1) & 1 : column[word + 1] & 1;
        corners |= (unsigned)(low | high << 4) << c;
    }
    return (uint8_t)corners;
}

NcCellPatches nc_cell_patches(const NcMeshGrid *grid, const int32_t node[3], uint8_t corners)
{
    if (!grid->table[corners].ambiguous)
        return grid->table[corners];
    bool joined[6] = {false};
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            int32_t face[3] = {node[0], node[1], node[2]};
            face[axis] += side;
            if (is_ambiguous(corners, axis, side))
                joined[2 * axis + side] = is_joined(grid, face, axis);
        }
    return trace(corners, joined);
}

NcCellPatches *nc_cell_table_new(void)
{
    const bool joined[6] = {false};
    NcCellPatches *table = g_new(NcCellPatches, 256);
    for (unsigned corners = 0; corners < 256; corners++)
        table[corners] = trace((uint8_t)corners, joined);
    return table;
}

NcFaceLines nc_cell_lower_face(const NcMeshGrid *grid, const int32_t node[3],
                               const NcCellPatches *patches, int axis)
{
    int mine[4], its[4];
    nc_cell_face_edges(axis, 0, mine);
    nc_cell_face_edges(axis, 1, its);
    const uint8_t *of_edge = patches->of_edge;
    for (int e = 0; e < 4; e++)
        if (of_edge[mine[e]] == NC_NO_PATCH)
            return NC_FACE_SINGLE;
    int32_t below[3] = {node[0], node[1], node[2]};
    below[axis]--;
    const uint8_t corners = nc_cell_corners(grid, below);
    const NcCellPatches other = nc_cell_patches(grid, below, corners);
    if (of_edge[mine[ALONG_U_LOW]] != of_edge[mine[ALONG_U_HIGH]] ||
        other.of_edge[its[ALONG_U_LOW]] != other.of_edge[its[ALONG_U_HIGH]])
        return NC_FACE_SINGLE;
    return goes_around_first(corners, axis, 1, is_joined(grid, node, axis))
               ? NC_FACE_DOUBLED
               : NC_FACE_DOUBLED_CROSSED;
}

void nc_cell_face_edges(int axis, int side, int edges[4])
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    edges[ALONG_U_LOW] = nc_cell_edge(u, 0, side);
    edges[ALONG_U_HIGH] = nc_cell_edge(u, 1, side);
    edges[ALONG_V_LOW] = nc_cell_edge(v, side, 0);
    edges[ALONG_V_HIGH] = nc_cell_edge(v, side, 1);
}

void nc_cell_edge_node(const int32_t node[3], int edge, int32_t of_edge[3])
{
    const int axis = edge / 4;
    memcpy(of_edge, node, 3 * sizeof *node);
    of_edge[(axis + 1) % 3] += edge & 1;
    of_edge[(axis + 2) % 3] += edge >> 1 & 1;
}

/* ---------------------------------------------------------------------------- tracing */

static bool is_in(uint8_t corners, int axis, int side, int a, int b)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    return corners >> (side << axis | a << u | b << v) & 1;
}

static bool is_ambiguous(uint8_t corners, int axis, int side)
{
    const bool first = is_in(corners, axis, side, 0, 0);
    return first == is_in(corners, axis, side, 1, 1) && first != is_in(corners, axis, side, 1, 0) &&
           first != is_in(corners, axis, side, 0, 1);
}

/* Of an ambiguous face: the lines part its corners u = v from the others. */
static bool goes_around_first(uint8_t corners, int axis, int side, bool joined)
{
    return is_in(corners, axis, side, 0, 0) != joined;
}

static void link_edges(uint8_t label[NC_CELL_EDGES], int a, int b)
{
    const uint8_t from = label[b], to = label[a];
    for (int e = 0; e < NC_CELL_EDGES; e++)
        if (label[e] == from)
            label[e] = to;
}

/* The surface meets a face in a line between its two crossed edges, or in two lines, each around a
 * corner, where all four are crossed. Edges that such lines join, face by face, are one patch. */
static void link_face(uint8_t corners, int axis, int side, bool joined,
                      uint8_t label[NC_CELL_EDGES])
{
    int e[4];
    nc_cell_face_edges(axis, side, e);
    if (is_ambiguous(corners, axis, side)) {
        const bool around_first = goes_around_first(corners, axis, side, joined);
        link_edges(label, e[ALONG_U_LOW], e[around_first ? ALONG_V_LOW : ALONG_V_HIGH]);
        link_edges(label, e[ALONG_U_HIGH], e[around_first ? ALONG_V_HIGH : ALONG_V_LOW]);
        return;
    }
    int last = -1;
    for (int i = 0; i < 4; i++) {
        if (label[e[i]] == NC_NO_PATCH)
            continue;
        if (last >= 0)
            link_edges(label, last, e[i]);
        last = e[i];
    }
}

static bool is_crossed(uint8_t corners, int edge)
{
    const int axis = edge / 4;
    return is_in(corners, axis, 0, edge & 1, edge >> 1 & 1) !=
           is_in(corners, axis, 1, edge & 1, edge >> 1 & 1);
}

static NcCellPatches trace(uint8_t corners, const bool joined[6])
{
    uint8_t label[NC_CELL_EDGES], number[NC_CELL_EDGES];
    NcCellPatches patches = {0};
    memset(number, NC_NO_PATCH, sizeof number);
    for (int e = 0; e < NC_CELL_EDGES; e++)
        label[e] = is_crossed(corners, e) ? (uint8_t)e : NC_NO_PATCH;
    for (int face = 0; face < 6; face++) {
        link_face(corners, face / 2, face % 2, joined[face], label);
        patches.ambiguous = patches.ambiguous || is_ambiguous(corners, face / 2, face % 2);
    }
    for (int e = 0; e < NC_CELL_EDGES; e++) {
        if (label[e] != NC_NO_PATCH && number[label[e]] == NC_NO_PATCH)
            number[label[e]] = patches.n++;
        patches.of_edge[e] = label[e] == NC_NO_PATCH ? NC_NO_PATCH : number[label[e]];
    }
    return patches;
}

/* Whether the material, in two opposite corners of a face, is one across its middle: where the
 * middle lies behind the surface as its four crossings see it, on the average. Asked of the face,
 * so both its cells get one answer. */
static bool is_joined(const NcMeshGrid *grid, const int32_t face[3], int axis)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    double outside = 0;
    for (int side = 0; side < 2; side++) {
        int32_t node[3] = {face[0], face[1], face[2]};
        node[v] += side;
        const NcCrossing along_u = nc_mesh_crossing(grid, u, node);
        node[v] = face[v];
        node[u] += side;
        const NcCrossing along_v = nc_mesh_crossing(grid, v, node);
        outside += along_u.normal[u] * (0.5 - along_u.at) + along_u.normal[v] * (0.5 - side);
        outside += along_v.normal[v] * (0.5 - along_v.at) + along_v.normal[u] * (0.5 - side);
    }
    return outside < 0;
}
