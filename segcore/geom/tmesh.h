/* SPDX-License-Identifier: Apache-2.0 */
/* The T-mesh of a T-spline in index lines: faces, edges and vertices, rays, and how it grows. */
#ifndef SEGCORE_GEOM_TMESH_H
#define SEGCORE_GEOM_TMESH_H

#include "segcore/segcore.h"

typedef struct {
    int32_t n_u, n_v;
    GArray *faces;   /* SegTface */
    int32_t *cells;  /* [n_u - 1][n_v - 1]: the face there */
    uint8_t *vertex; /* [n_u][n_v] */
    uint8_t *edge_u; /* [n_u - 1][n_v]: from (i, j) to (i + 1, j) */
    uint8_t *edge_v; /* [n_u][n_v - 1]: from (i, j) to (i, j + 1) */
} SegTmesh;

/* The faces with their corners as vertices. SEG_ERROR_INPUT: they do not tile the grid. */
SegTmesh *seg_tmesh_new(int32_t n_u, int32_t n_v, const SegTface *faces, int32_t n_faces,
                        GError **error);
void seg_tmesh_free(SegTmesh *mesh);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SegTmesh, seg_tmesh_free)

static inline SegTface *seg_tmesh_face(const SegTmesh *m, int32_t face)
{
    return &g_array_index(m->faces, SegTface, face);
}

static inline bool seg_tmesh_is_vertex(const SegTmesh *m, int32_t i, int32_t j)
{
    return m->vertex[(ptrdiff_t)i * m->n_v + j] != 0;
}

/* The face that (i, j) is strictly inside of, or -1. */
int32_t seg_tmesh_inside(const SegTmesh *mesh, int32_t i, int32_t j);

/* Makes (i, j), which is on an edge, a vertex. */
void seg_tmesh_add_vertex(SegTmesh *mesh, int32_t i, int32_t j);

/* Splits a face along line i of u, or line j of v, strictly inside it; the ends become vertices. */
void seg_tmesh_split_u(SegTmesh *mesh, int32_t face, int32_t i);
void seg_tmesh_split_v(SegTmesh *mesh, int32_t face, int32_t j);

/* The knot vectors of (i, j) by ray intersection (P1 §2.1), in lines. */
void seg_tmesh_lines(const SegTmesh *mesh, int32_t i, int32_t j, int32_t lines_u[5],
                     int32_t lines_v[5]);

#endif
