/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/terrain.h"

#include <stdlib.h>

/* A triangle's centre, by which the tree is split. */
typedef struct {
    double at[2];
    int32_t triangle;
} Place;

static void arrange(Place *places, size_t n);
static NcFacet facet_new(const SegVec3 *vertices, const int32_t triangle[3], int32_t id);
static size_t count_nodes(size_t n);
static int32_t add_node(NcTerrain *terrain, size_t first, size_t n);

static inline void grow(SegVec3 *min, SegVec3 *max, SegVec3 p)
{
    min->x = fmin(min->x, p.x), max->x = fmax(max->x, p.x);
    min->y = fmin(min->y, p.y), max->y = fmax(max->y, p.y);
    min->z = fmin(min->z, p.z), max->z = fmax(max->z, p.z);
}

static double farthest(SegVec3 min, SegVec3 max)
{
    double low = fmin(min.x, fmin(min.y, min.z)), high = fmax(max.x, fmax(max.y, max.z));
    return fmax(-low, high);
}

NcTerrain *nc_terrain_new(const SegVec3 *vertices, size_t n_vertices, const int32_t (*triangles)[3],
                          size_t n_triangles)
{
    g_assert(n_triangles <= INT32_MAX);
    NcTerrain *terrain = g_new0(NcTerrain, 1);
    terrain->min = seg_vec3(INFINITY, INFINITY, INFINITY);
    terrain->max = seg_vec3(-INFINITY, -INFINITY, -INFINITY);
    g_autofree Place *places = g_new(Place, n_triangles);
    for (size_t i = 0; i < n_triangles; i++) {
        SegVec3 sum = {0, 0, 0};
        for (int k = 0; k < 3; k++) {
            g_assert(triangles[i][k] >= 0 && (size_t)triangles[i][k] < n_vertices);
            SegVec3 p = vertices[triangles[i][k]];
            g_assert(isfinite(p.x) && isfinite(p.y) && isfinite(p.z));
            grow(&terrain->min, &terrain->max, p);
            sum = seg_add(sum, p);
        }
        places[i] = (Place){{sum.x, sum.y}, (int32_t)i};
    }
    if (n_triangles == 0)
        return terrain;
    terrain->size_mm = farthest(terrain->min, terrain->max);

    arrange(places, n_triangles);
    terrain->n_facets = n_triangles;
    terrain->facets = g_new(NcFacet, n_triangles);
    for (size_t i = 0; i < n_triangles; i++) {
        int32_t id = places[i].triangle;
        terrain->facets[i] = facet_new(vertices, triangles[id], id);
    }
    terrain->nodes = aligned_alloc(_Alignof(NcNode), count_nodes(n_triangles) * sizeof(NcNode));
    g_assert(terrain->nodes);
    add_node(terrain, 0, n_triangles);
    return terrain;
}

void nc_terrain_free(NcTerrain *terrain)
{
    if (!terrain)
        return;
    free(terrain->nodes);
    g_free(terrain->facets);
    g_free(terrain);
}

void nc_terrain_bounds(const NcTerrain *terrain, SegVec3 *min, SegVec3 *max)
{
    *min = terrain->min;
    *max = terrain->max;
}

/* --------------------------------------------------------------------- the order */

/* Every child of a node but the last holds the same power of NC_WIDTH, so that nodes are full. */
static size_t child_capacity(size_t n)
{
    size_t capacity = 1;
    while (capacity * NC_WIDTH < n)
        capacity *= NC_WIDTH;
    return capacity;
}

/* Quickselect (Hoare): the place that belongs at `k` along the axis goes there, lesser ones before
 * it. */
static void select_place(Place *places, ptrdiff_t n, ptrdiff_t k, int axis)
{
    for (ptrdiff_t lo = 0, hi = n - 1; lo < hi;) {
        double pivot = places[k].at[axis];
        ptrdiff_t i = lo, j = hi;
        while (i <= j) {
            while (places[i].at[axis] < pivot)
                i++;
            while (places[j].at[axis] > pivot)
                j--;
            if (i <= j) {
                Place swapped = places[i];
                places[i++] = places[j];
                places[j--] = swapped;
            }
        }
        if (j < k)
            lo = i;
        if (k < i)
            hi = j;
    }
}

/* Halves the places across their longer extent until a part fits a child. */
static void split(Place *places, size_t n, size_t capacity)
{
    size_t n_children = (n + capacity - 1) / capacity;
    if (n_children < 2)
        return;
    double min[2] = {INFINITY, INFINITY}, max[2] = {-INFINITY, -INFINITY};
    for (size_t i = 0; i < n; i++) {
        for (int k = 0; k < 2; k++) {
            min[k] = fmin(min[k], places[i].at[k]);
            max[k] = fmax(max[k], places[i].at[k]);
        }
    }
    size_t left = n_children / 2 * capacity;
    select_place(places, (ptrdiff_t)n, (ptrdiff_t)left, max[1] - min[1] > max[0] - min[0]);
    split(places, left, capacity);
    split(places + left, n - left, capacity);
}

static void arrange(Place *places, size_t n)
{
    size_t capacity = child_capacity(n);
    split(places, n, capacity);
    for (size_t i = 0; capacity > 1 && i < n; i += capacity)
        arrange(places + i, MIN(capacity, n - i));
}

/* --------------------------------------------------------------------- the facets */

static NcFacet facet_new(const SegVec3 *vertices, const int32_t triangle[3], int32_t id)
{
    NcFacet f = {.v = {vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]},
                 .id = id};
    SegVec3 e1 = seg_sub(f.v[1], f.v[0]), e2 = seg_sub(f.v[2], f.v[0]);
    SegVec3 normal = seg_cross(e1, e2), e3 = seg_sub(e2, e1);
    if (normal.z < 0) {
        SegVec3 swapped = f.v[1];
        f.v[1] = f.v[2];
        f.v[2] = swapped;
        normal = seg_scale(normal, -1);
    }
    /* normal.z, twice the area in (x,y), is known within some 1e-15 longest². */
    double longest2 =
        fmax(e1.x * e1.x + e1.y * e1.y, fmax(e2.x * e2.x + e2.y * e2.y, e3.x * e3.x + e3.y * e3.y));
    f.thin = normal.z <= 1e-7 * longest2;
    if (normal.z <= 1e-14 * longest2)
        return f;
    double length = seg_norm(normal), level = sqrt(normal.x * normal.x + normal.y * normal.y);
    f.slope_cos = normal.z / length;
    f.slope_sin = level / length;
    if (level > 0) {
        f.up_x = -normal.x / level;
        f.up_y = -normal.y / level;
    }
    return f;
}

/* --------------------------------------------------------------------- the nodes */

/* A plane steeper than this says no more about a box than the box's top does. */
static const double STEEPEST = 10;

static size_t count_nodes(size_t n)
{
    size_t capacity = child_capacity(n), count = 1;
    if (capacity > 1)
        count += n / capacity * count_nodes(capacity);
    if (n % capacity > 1)
        count += count_nodes(n % capacity);
    return count;
}

/* Box, plane and top of the child `i` over facets [first, first + n). */
static void describe(NcNode *node, int i, const NcFacet *facets, size_t n)
{
    SegVec3 min = {INFINITY, INFINITY, INFINITY}, max = {-INFINITY, -INFINITY, -INFINITY};
    SegVec3 sum = {0, 0, 0}; /* normals, as long as the facets are large */
    for (size_t j = 0; j < n; j++) {
        const SegVec3 *v = facets[j].v;
        for (int k = 0; k < 3; k++)
            grow(&min, &max, v[k]);
        sum = seg_add(sum, seg_cross(seg_sub(v[1], v[0]), seg_sub(v[2], v[0])));
    }
    node->lo_x[i] = min.x, node->hi_x[i] = max.x;
    node->lo_y[i] = min.y, node->hi_y[i] = max.y;
    node->z[i] = node->top[i] = max.z;
    double level = sqrt(sum.x * sum.x + sum.y * sum.y);
    if (level == 0)
        return;
    double up_x = -sum.x / level, up_y = -sum.y / level;
    double slope = level < STEEPEST * sum.z ? level / sum.z : STEEPEST;
    double z = -INFINITY;
    for (size_t j = 0; j < n; j++) {
        for (int k = 0; k < 3; k++) {
            SegVec3 p = facets[j].v[k];
            z = fmax(z, p.z - slope * up_x * (p.x - min.x) - slope * up_y * (p.y - min.y));
        }
    }
    /* The plane that is lower over the middle of the box. */
    double middle = z + slope * (up_x * (max.x - min.x) + up_y * (max.y - min.y)) / 2;
    if (middle < max.z) {
        node->z[i] = z;
        node->slope[i] = slope;
        node->slope_sin[i] = slope / sqrt(1 + slope * slope);
        node->up_x[i] = up_x;
        node->up_y[i] = up_y;
    }
}

static int32_t add_node(NcTerrain *terrain, size_t first, size_t n)
{
    int32_t index = (int32_t)terrain->n_nodes++;
    NcNode *node = &terrain->nodes[index];
    *node = (NcNode){0};
    for (int i = 0; i < NC_WIDTH; i++)
        node->top[i] = -INFINITY;
    size_t capacity = child_capacity(n), at = 0;
    for (int i = 0; at < n; i++, at += capacity) {
        size_t part = MIN(capacity, n - at);
        describe(node, i, terrain->facets + first + at, part);
        node->child[i] = part > 1 ? add_node(terrain, first + at, part) : ~(int32_t)(first + at);
    }
    return index;
}
