/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/mesh_check.h"

#include <stdlib.h>
#include <string.h>

/* A triangle's edge, from and to; `next` is the triangle's third corner. */
typedef struct {
    int32_t from, to, next;
} Edge;

static int by_ends(const void *a, const void *b)
{
    const Edge *x = a, *y = b;
    if (x->from != y->from)
        return x->from < y->from ? -1 : 1;
    return (x->to > y->to) - (x->to < y->to);
}

static Edge *edges_of(const NcMesh *mesh)
{
    Edge *edges = g_new(Edge, 3 * mesh->n_triangles);
    for (size_t t = 0; t < mesh->n_triangles; t++) {
        const int32_t *v = mesh->triangles[t].vertex;
        for (int i = 0; i < 3; i++)
            edges[3 * t + (size_t)i] = (Edge){v[i], v[(i + 1) % 3], v[(i + 2) % 3]};
    }
    qsort(edges, 3 * mesh->n_triangles, sizeof *edges, by_ends);
    return edges;
}

static const Edge *find(const Edge *edges, size_t n, int32_t from, int32_t to)
{
    const Edge key = {from, to, 0};
    return bsearch(&key, edges, n, sizeof *edges, by_ends);
}

static size_t count_open(const Edge *edges, size_t n)
{
    size_t bad = 0;
    for (size_t e = 0; e < n; e++) {
        bad += e > 0 && by_ends(&edges[e - 1], &edges[e]) == 0;
        bad += edges[e].from == edges[e].to;
        bad += !find(edges, n, edges[e].to, edges[e].from);
    }
    return bad;
}

/* Vertices whose triangles are not one fan. Around a vertex, from edge to edge: each triangle
 * (v, to, next) is followed by the one that begins with (v, next). */
static size_t count_split(const Edge *edges, size_t n, size_t n_vertices)
{
    size_t bad = n_vertices;
    for (size_t first = 0, end; first < n; first = end) {
        size_t walked = 0;
        int32_t to = edges[first].to;
        for (end = first; end < n && edges[end].from == edges[first].from;)
            end++;
        do {
            const Edge *at = find(edges, n, edges[first].from, to);
            if (!at)
                break;
            to = at->next;
            walked++;
        } while (to != edges[first].to && walked <= end - first);
        bad -= walked == end - first;
    }
    return bad;
}

static int by_place(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(SegVec3));
}

static size_t count_coincident(const NcMesh *mesh)
{
    g_autofree SegVec3 *sorted = g_memdup2(mesh->vertices, mesh->n_vertices * sizeof *sorted);
    size_t bad = 0;
    for (size_t i = 0; i < mesh->n_vertices; i++)
        sorted[i] = seg_add(sorted[i], seg_vec3(0, 0, 0)); /* no -0 */
    qsort(sorted, mesh->n_vertices, sizeof *sorted, by_place);
    for (size_t i = 1; i < mesh->n_vertices; i++)
        bad += by_place(&sorted[i - 1], &sorted[i]) == 0;
    return bad;
}

static SegVec3 corner(const NcMesh *mesh, size_t t, int i)
{
    return mesh->vertices[mesh->triangles[t].vertex[i]];
}

static double signed_volume(const NcMesh *mesh, size_t t)
{
    const SegVec3 o = mesh->vertices[0];
    return seg_dot(seg_sub(corner(mesh, t, 0), o),
                   seg_cross(seg_sub(corner(mesh, t, 1), o), seg_sub(corner(mesh, t, 2), o))) /
           6;
}

static size_t count_flat(const NcMesh *mesh)
{
    size_t bad = 0;
    for (size_t t = 0; t < mesh->n_triangles; t++) {
        const SegVec3 a = corner(mesh, t, 0);
        const SegVec3 cross =
            seg_cross(seg_sub(corner(mesh, t, 1), a), seg_sub(corner(mesh, t, 2), a));
        bad += seg_norm(cross) > 0 ? 0 : 1;
    }
    return bad;
}

void test_mesh_is_solid(const NcMesh *mesh)
{
    g_autofree Edge *edges = edges_of(mesh);
    const size_t n = 3 * mesh->n_triangles;
    g_assert_cmpuint(count_open(edges, n), ==, 0);
    g_assert_cmpuint(count_split(edges, n, mesh->n_vertices), ==, 0);
    g_assert_cmpuint(count_coincident(mesh), ==, 0);
    g_assert_cmpuint(count_flat(mesh), ==, 0);
}

double test_mesh_volume_mm3(const NcMesh *mesh)
{
    double volume = 0;
    for (size_t t = 0; t < mesh->n_triangles; t++)
        volume += signed_volume(mesh, t);
    return volume;
}

size_t test_mesh_shells(const NcMesh *mesh)
{
    g_autofree int32_t *of = g_new(int32_t, mesh->n_vertices);
    size_t n = mesh->n_vertices;
    for (size_t v = 0; v < mesh->n_vertices; v++)
        of[v] = (int32_t)v;
    for (size_t t = 0; t < mesh->n_triangles; t++)
        for (int i = 0; i < 3; i++) {
            int32_t a = mesh->triangles[t].vertex[i], b = mesh->triangles[t].vertex[(i + 1) % 3];
            while (of[a] != a)
                a = of[a] = of[of[a]];
            while (of[b] != b)
                b = of[b] = of[of[b]];
            n -= a != b;
            of[MAX(a, b)] = MIN(a, b);
        }
    return n;
}
