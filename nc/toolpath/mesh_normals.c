/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/mesh_normals.h"

#include <stdlib.h>
#include <string.h>

#define CREASE_COS 0.866

/* A corner of a triangle and where it is. */
typedef struct {
    SegVec3 position;
    int32_t triangle;
    int corner;
} Corner;

static void smooth(const SegPart *part, Corner *corners, size_t n, SegVec3 (*normals)[3]);

SegVec3 (*nc_corner_normals(const SegPart *part))[3]
{
    size_t n = (size_t)part->n_triangles, n_mesh = 0;
    SegVec3(*normals)[3] = g_malloc_n(n + 1, sizeof *normals);
    g_autofree Corner *corners = g_new(Corner, 3 * n + 1);
    for (int32_t t = 0; t < part->n_triangles; t++) {
        const SegTriangle *triangle = &part->triangles[t];
        bool mesh = part->faces[triangle->face].surface.n_u == 0;
        for (int k = 0; k < 3; k++) {
            const SegVertex *vertex = &part->vertices[triangle->vertex[k]];
            normals[t][k] = vertex->normal;
            if (mesh)
                corners[n_mesh++] = (Corner){vertex->position, t, k};
        }
    }
    smooth(part, corners, n_mesh, normals);
    return normals;
}

static int by_position(const void *a, const void *b)
{
    const Corner *p = a, *q = b;
    if (p->position.x != q->position.x)
        return p->position.x < q->position.x ? -1 : 1;
    if (p->position.y != q->position.y)
        return p->position.y < q->position.y ? -1 : 1;
    if (p->position.z != q->position.z)
        return p->position.z < q->position.z ? -1 : 1;
    return p->triangle != q->triangle ? (p->triangle > q->triangle) - (p->triangle < q->triangle)
                                      : p->corner - q->corner;
}

/* Twice the area, along the normal. */
static SegVec3 cross_of(const SegPart *part, int32_t t)
{
    const int32_t *v = part->triangles[t].vertex;
    SegVec3 a = part->vertices[v[0]].position;
    return seg_cross(seg_sub(part->vertices[v[1]].position, a),
                     seg_sub(part->vertices[v[2]].position, a));
}

static void smooth(const SegPart *part, Corner *corners, size_t n, SegVec3 (*normals)[3])
{
    qsort(corners, n, sizeof *corners, by_position);
    for (size_t from = 0, to; from < n; from = to) {
        for (to = from + 1; to < n; to++)
            if (seg_distance(corners[from].position, corners[to].position) > 0)
                break;
        for (size_t i = from; i < to; i++) {
            SegVec3 own = seg_unit(cross_of(part, corners[i].triangle)), sum = {0, 0, 0};
            for (size_t k = from; k < to; k++) {
                SegVec3 other = cross_of(part, corners[k].triangle);
                if (seg_dot(own, other) >= CREASE_COS * seg_norm(other))
                    sum = seg_add(sum, other);
            }
            normals[corners[i].triangle][corners[i].corner] =
                seg_norm(sum) > 0 ? seg_unit(sum) : own;
        }
    }
}
