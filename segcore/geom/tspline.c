/* SPDX-License-Identifier: Apache-2.0 */
/* A T-spline from its lines, faces and points: checks, knot vectors, influence lists. */
#include <string.h>

#include "segcore/geom/part_form.h"
#include "segcore/geom/tmesh.h"
#include "segcore/geom/tspline_patch.h"

static bool check_lines(const char *name, const double *knots, int32_t n, GError **error);
static bool check_points(const SegTspline *t, GError **error);
static bool place_points(const SegTspline *t, SegTmesh *mesh, GError **error);
static bool find_knot_vectors(SegTspline *t, const SegTmesh *mesh, GError **error);
static void list_influences(SegTspline *t);

SegTspline *seg_tspline_new(const double *knots_u, int32_t n_u, const double *knots_v, int32_t n_v,
                            const SegTface *faces, int32_t n_faces, const SegTpoint *points,
                            int32_t n_points, GError **error)
{
    if (!check_lines("u", knots_u, n_u, error) || !check_lines("v", knots_v, n_v, error))
        return NULL;
    if ((int64_t)n_u * n_v > SEG_TSPLINE_MAX_CROSSINGS) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%d lines of u cross %d of v: more than %d",
                    n_u, n_v, SEG_TSPLINE_MAX_CROSSINGS);
        return NULL;
    }
    g_autoptr(SegTspline) t = g_new0(SegTspline, 1);
    t->n_u = n_u, t->n_v = n_v, t->n_faces = n_faces, t->n_points = n_points;
    t->knots_u = g_memdup2(knots_u, (gsize)n_u * sizeof *knots_u);
    t->knots_v = g_memdup2(knots_v, (gsize)n_v * sizeof *knots_v);
    t->faces = g_memdup2(faces, (gsize)n_faces * sizeof *faces);
    t->points = g_memdup2(points, (gsize)n_points * sizeof *points);
    g_autoptr(SegTmesh) mesh = seg_tmesh_new(n_u, n_v, faces, n_faces, error);
    if (!mesh || !check_points(t, error) || !place_points(t, mesh, error) ||
        !find_knot_vectors(t, mesh, error))
        return NULL;
    t->cells = g_steal_pointer(&mesh->cells);
    list_influences(t);
    for (int32_t f = 0; f < n_faces; f++) {
        const SegTface *q = &t->faces[f];
        bool area = knots_u[q->i0] < knots_u[q->i1] && knots_v[q->j0] < knots_v[q->j1];
        if (area && !q->hole && t->first_influence[f] == t->first_influence[f + 1]) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                        "no control point reaches the face from line %d to %d of u and %d to %d of "
                        "v",
                        q->i0, q->i1, q->j0, q->j1);
            return NULL;
        }
    }
    if (t->first_influence[n_faces] == 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "no face of the T-spline has an area");
        return NULL;
    }
    t->patches = seg_tpatches_new(t, error);
    return t->patches ? g_steal_pointer(&t) : NULL;
}

void seg_tspline_free(SegTspline *t)
{
    if (!t)
        return;
    g_free(t->knots_u);
    g_free(t->knots_v);
    g_free(t->faces);
    g_free(t->points);
    g_free(t->lines_u);
    g_free(t->lines_v);
    g_free(t->influence);
    g_free(t->first_influence);
    g_free(t->cells);
    seg_tpatches_free(t->patches);
    g_free(t);
}

void seg_tspline_domain(const SegTspline *t, double *u0, double *u1, double *v0, double *v1)
{
    *u0 = *v0 = INFINITY;
    *u1 = *v1 = -INFINITY;
    for (int32_t f = 0; f < t->n_faces; f++)
        if (t->patches->surfaces[f].n_u > 0) {
            *u0 = fmin(*u0, t->knots_u[t->faces[f].i0]);
            *u1 = fmax(*u1, t->knots_u[t->faces[f].i1]);
            *v0 = fmin(*v0, t->knots_v[t->faces[f].j0]);
            *v1 = fmax(*v1, t->knots_v[t->faces[f].j1]);
        }
}

/* ------------------------------------------------------------------ checks */

static bool check_lines(const char *name, const double *knots, int32_t n, GError **error)
{
    if (n < 2 || n > SEG_TSPLINE_MAX_LINES) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%d lines of %s: from 2 to %d are possible",
                    n, name, SEG_TSPLINE_MAX_LINES);
        return false;
    }
    for (int32_t i = 0; i < n; i++)
        if (!(fabs(knots[i]) <= SEG_FORM_MAX_REAL) || (i > 0 && knots[i] < knots[i - 1])) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                        "line %d of %s is %g: knots are finite and do not descend", i, name,
                        knots[i]);
            return false;
        }
    return true;
}

static bool check_points(const SegTspline *t, GError **error)
{
    for (int32_t k = 0; k < t->n_points; k++) {
        const SegTpoint *p = &t->points[k];
        bool inside = p->i >= 0 && p->i < t->n_u && p->j >= 0 && p->j < t->n_v;
        bool finite = fabs(p->x) <= SEG_FORM_MAX_REAL && fabs(p->y) <= SEG_FORM_MAX_REAL &&
                      fabs(p->z) <= SEG_FORM_MAX_REAL;
        bool weight = p->w >= SEG_TSPLINE_LEAST_WEIGHT && p->w <= 1 / SEG_TSPLINE_LEAST_WEIGHT;
        if (inside && finite && weight)
            continue;
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "point %d, at lines %d, %d, %s", k, p->i,
                    p->j,
                    !inside   ? "is on no line of the T-mesh"
                    : !finite ? "has a coordinate that is not finite or too large"
                              : "has a weight that is not positive or out of range");
        return false;
    }
    return true;
}

static bool place_points(const SegTspline *t, SegTmesh *mesh, GError **error)
{
    g_autofree uint8_t *taken = g_new0(uint8_t, (gsize)t->n_u * (gsize)t->n_v);
    for (int32_t k = 0; k < t->n_points; k++) {
        const SegTpoint *p = &t->points[k];
        uint8_t *at = &taken[(ptrdiff_t)p->i * t->n_v + p->j];
        bool inside = seg_tmesh_inside(mesh, p->i, p->j) >= 0;
        if (*at || inside) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "point %d, at lines %d, %d, %s", k, p->i,
                        p->j, *at ? "is there twice" : "is inside a face, on no edge of it");
            return false;
        }
        *at = 1;
        seg_tmesh_add_vertex(mesh, p->i, p->j);
    }
    return true;
}

/* ------------------------------------------------------------------ what reaches where */

static bool has_patch(const SegTspline *t, int32_t face)
{
    const SegTface *f = &t->faces[face];
    return !f->hole && t->knots_u[f->i0] < t->knots_u[f->i1] &&
           t->knots_v[f->j0] < t->knots_v[f->j1];
}

static bool overlap(const double *knots, const int32_t lines[5], int32_t from, int32_t to)
{
    return fmax(knots[lines[0]], knots[from]) < fmin(knots[lines[4]], knots[to]);
}

/* Appends the faces of the surface that the function with these lines is not zero all over, each
 * once; `seen` has the number of the last function that met a face. */
static void append_faces(const SegTspline *t, const int32_t *cells, const int32_t u[5],
                         const int32_t v[5], int32_t number, int32_t *seen, GArray *to)
{
    for (int32_t i = u[0]; i < u[4]; i++)
        for (int32_t j = v[0]; j < v[4];) {
            int32_t face = cells[(ptrdiff_t)i * (t->n_v - 1) + j];
            const SegTface *f = &t->faces[face];
            j = f->j1;
            if (seen[face] == number)
                continue;
            seen[face] = number;
            if (has_patch(t, face) && overlap(t->knots_u, u, f->i0, f->i1) &&
                overlap(t->knots_v, v, f->j0, f->j1))
                g_array_append_val(to, face);
        }
}

/* Every vertex has a point, but where its function would not reach the surface. */
static bool find_knot_vectors(SegTspline *t, const SegTmesh *mesh, GError **error)
{
    g_autofree uint8_t *has_point = g_new0(uint8_t, (gsize)t->n_u * (gsize)t->n_v);
    t->lines_u = g_malloc_n((gsize)t->n_points, sizeof *t->lines_u);
    t->lines_v = g_malloc_n((gsize)t->n_points, sizeof *t->lines_v);
    for (int32_t k = 0; k < t->n_points; k++) {
        const SegTpoint *p = &t->points[k];
        has_point[(ptrdiff_t)p->i * t->n_v + p->j] = 1;
        seg_tmesh_lines(mesh, p->i, p->j, t->lines_u[k], t->lines_v[k]);
    }
    g_autoptr(GArray) reached = g_array_new(FALSE, FALSE, sizeof(int32_t));
    g_autofree int32_t *seen = g_new0(int32_t, t->n_faces);
    int32_t number = 0;
    for (int32_t i = 0; i < t->n_u; i++)
        for (int32_t j = 0; j < t->n_v; j++) {
            if (!seg_tmesh_is_vertex(mesh, i, j) || has_point[(ptrdiff_t)i * t->n_v + j])
                continue;
            int32_t u[5], v[5];
            seg_tmesh_lines(mesh, i, j, u, v);
            append_faces(t, mesh->cells, u, v, ++number, seen, reached);
            if (reached->len > 0) {
                g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                            "the vertex at lines %d, %d has no control point, and its function "
                            "reaches the surface",
                            i, j);
                return false;
            }
        }
    return true;
}

/* First the faces of each point, then turned round by counting. */
static void list_influences(SegTspline *t)
{
    g_autoptr(GArray) faces = g_array_new(FALSE, FALSE, sizeof(int32_t));
    g_autofree guint *ends = g_new(guint, t->n_points);
    g_autofree int32_t *seen = g_new0(int32_t, t->n_faces);
    for (int32_t k = 0; k < t->n_points; k++) {
        append_faces(t, t->cells, t->lines_u[k], t->lines_v[k], k + 1, seen, faces);
        ends[k] = faces->len;
    }
    t->first_influence = g_new0(int32_t, t->n_faces + 1);
    t->influence = g_new(int32_t, faces->len);
    for (guint i = 0; i < faces->len; i++)
        t->first_influence[g_array_index(faces, int32_t, i) + 1]++;
    for (int32_t f = 0; f < t->n_faces; f++)
        t->first_influence[f + 1] += t->first_influence[f];
    g_autofree int32_t *next = g_memdup2(t->first_influence, (gsize)t->n_faces * sizeof *next);
    guint i = 0;
    for (int32_t k = 0; k < t->n_points; k++)
        for (; i < ends[k]; i++)
            t->influence[next[g_array_index(faces, int32_t, i)]++] = k;
}
