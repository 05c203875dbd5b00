/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/geom/tmesh.h"

static bool place_face(SegTmesh *m, int32_t face, GError **error);

SegTmesh *seg_tmesh_new(int32_t n_u, int32_t n_v, const SegTface *faces, int32_t n_faces,
                        GError **error)
{
    g_autoptr(SegTmesh) m = g_new0(SegTmesh, 1);
    size_t rows = (size_t)n_u, columns = (size_t)n_v, cells = (rows - 1) * (columns - 1);
    m->n_u = n_u;
    m->n_v = n_v;
    m->faces = g_array_new(FALSE, FALSE, sizeof(SegTface));
    g_array_append_vals(m->faces, faces, (guint)n_faces);
    m->cells = g_new(int32_t, cells);
    m->vertex = g_new0(uint8_t, rows * columns);
    m->edge_u = g_new0(uint8_t, (rows - 1) * columns);
    m->edge_v = g_new0(uint8_t, rows * (columns - 1));
    for (size_t i = 0; i < cells; i++)
        m->cells[i] = -1;
    for (int32_t f = 0; f < n_faces; f++)
        if (!place_face(m, f, error))
            return NULL;
    for (size_t i = 0; i < cells; i++)
        if (m->cells[i] < 0) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                        "the T-mesh is not closed: no face lies between lines %zu, %zu of u and "
                        "%zu, %zu of v; add a face or a hole",
                        i / (columns - 1), i / (columns - 1) + 1, i % (columns - 1),
                        i % (columns - 1) + 1);
            return NULL;
        }
    return g_steal_pointer(&m);
}

void seg_tmesh_free(SegTmesh *m)
{
    if (!m)
        return;
    g_array_unref(m->faces);
    g_free(m->cells);
    g_free(m->vertex);
    g_free(m->edge_u);
    g_free(m->edge_v);
    g_free(m);
}

static inline uint8_t *vertex_at(const SegTmesh *m, int32_t i, int32_t j)
{
    return &m->vertex[(ptrdiff_t)i * m->n_v + j];
}

/* An edge is known by its lower end. */
static inline uint8_t *edge_u_at(const SegTmesh *m, int32_t i, int32_t j)
{
    return &m->edge_u[(ptrdiff_t)i * m->n_v + j];
}

static inline uint8_t *edge_v_at(const SegTmesh *m, int32_t i, int32_t j)
{
    return &m->edge_v[(ptrdiff_t)i * (m->n_v - 1) + j];
}

static inline int32_t *cell_at(const SegTmesh *m, int32_t i, int32_t j)
{
    return &m->cells[(ptrdiff_t)i * (m->n_v - 1) + j];
}

static void lay_edge_u(SegTmesh *m, int32_t i0, int32_t i1, int32_t j)
{
    for (int32_t i = i0; i < i1; i++)
        *edge_u_at(m, i, j) = 1;
    *vertex_at(m, i0, j) = *vertex_at(m, i1, j) = 1;
}

static void lay_edge_v(SegTmesh *m, int32_t i, int32_t j0, int32_t j1)
{
    for (int32_t j = j0; j < j1; j++)
        *edge_v_at(m, i, j) = 1;
    *vertex_at(m, i, j0) = *vertex_at(m, i, j1) = 1;
}

static bool place_face(SegTmesh *m, int32_t face, GError **error)
{
    const SegTface *f = seg_tmesh_face(m, face);
    if (f->i0 < 0 || f->i0 >= f->i1 || f->i1 >= m->n_u || f->j0 < 0 || f->j0 >= f->j1 ||
        f->j1 >= m->n_v) {
        g_set_error(
            error, SEG_ERROR, SEG_ERROR_INPUT,
            "face %d runs from line %d to %d of u and %d to %d of v; lines ascend from 0 to "
            "%d and %d",
            face, f->i0, f->i1, f->j0, f->j1, m->n_u - 1, m->n_v - 1);
        return false;
    }
    for (int32_t i = f->i0; i < f->i1; i++)
        for (int32_t j = f->j0; j < f->j1; j++) {
            int32_t *cell = cell_at(m, i, j);
            if (*cell >= 0) {
                g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                            "faces %d and %d overlap between lines %d, %d of u and %d, %d of v",
                            *cell, face, i, i + 1, j, j + 1);
                return false;
            }
            *cell = face;
        }
    lay_edge_u(m, f->i0, f->i1, f->j0);
    lay_edge_u(m, f->i0, f->i1, f->j1);
    lay_edge_v(m, f->i0, f->j0, f->j1);
    lay_edge_v(m, f->i1, f->j0, f->j1);
    return true;
}

/* ------------------------------------------------------------------ growing */

int32_t seg_tmesh_inside(const SegTmesh *m, int32_t i, int32_t j)
{
    if (i <= 0 || j <= 0 || i >= m->n_u - 1 || j >= m->n_v - 1)
        return -1;
    int32_t face = *cell_at(m, i, j);
    bool same = *cell_at(m, i - 1, j) == face && *cell_at(m, i, j - 1) == face &&
                *cell_at(m, i - 1, j - 1) == face;
    return same ? face : -1;
}

void seg_tmesh_add_vertex(SegTmesh *m, int32_t i, int32_t j)
{
    *vertex_at(m, i, j) = 1;
}

static void split_off(SegTmesh *m, SegTface part)
{
    int32_t face = (int32_t)m->faces->len;
    g_array_append_val(m->faces, part);
    for (int32_t i = part.i0; i < part.i1; i++)
        for (int32_t j = part.j0; j < part.j1; j++)
            *cell_at(m, i, j) = face;
}

void seg_tmesh_split_u(SegTmesh *m, int32_t face, int32_t i)
{
    SegTface part = *seg_tmesh_face(m, face);
    part.i0 = i;
    seg_tmesh_face(m, face)->i1 = i;
    split_off(m, part);
    lay_edge_v(m, i, part.j0, part.j1);
}

void seg_tmesh_split_v(SegTmesh *m, int32_t face, int32_t j)
{
    SegTface part = *seg_tmesh_face(m, face);
    part.j0 = j;
    seg_tmesh_face(m, face)->j1 = j;
    split_off(m, part);
    lay_edge_u(m, part.i0, part.i1, j);
}

/* ------------------------------------------------------------------ rays */

static bool meets_in_u(const SegTmesh *m, int32_t i, int32_t j)
{
    return *vertex_at(m, i, j) || (j < m->n_v - 1 && *edge_v_at(m, i, j)) ||
           (j > 0 && *edge_v_at(m, i, j - 1));
}

static bool meets_in_v(const SegTmesh *m, int32_t i, int32_t j)
{
    return *vertex_at(m, i, j) || (i < m->n_u - 1 && *edge_u_at(m, i, j)) ||
           (i > 0 && *edge_u_at(m, i - 1, j));
}

/* The next line met from (i, j) by `step`, or the last there is. */
static int32_t next_in_u(const SegTmesh *m, int32_t i, int32_t j, int32_t step)
{
    do {
        if (i + step < 0 || i + step >= m->n_u)
            return i;
        i += step;
    } while (!meets_in_u(m, i, j));
    return i;
}

static int32_t next_in_v(const SegTmesh *m, int32_t i, int32_t j, int32_t step)
{
    do {
        if (j + step < 0 || j + step >= m->n_v)
            return j;
        j += step;
    } while (!meets_in_v(m, i, j));
    return j;
}

void seg_tmesh_lines(const SegTmesh *m, int32_t i, int32_t j, int32_t lines_u[5],
                     int32_t lines_v[5])
{
    lines_u[2] = i;
    lines_u[1] = next_in_u(m, i, j, -1);
    lines_u[0] = next_in_u(m, lines_u[1], j, -1);
    lines_u[3] = next_in_u(m, i, j, 1);
    lines_u[4] = next_in_u(m, lines_u[3], j, 1);
    lines_v[2] = j;
    lines_v[1] = next_in_v(m, i, j, -1);
    lines_v[0] = next_in_v(m, i, lines_v[1], -1);
    lines_v[3] = next_in_v(m, i, j, 1);
    lines_v[4] = next_in_v(m, i, lines_v[3], 1);
}
