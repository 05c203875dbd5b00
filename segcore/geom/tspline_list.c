/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A T-spline from points that bring their knot vectors, with the edges between them. Each different
 * parameter is a line; the faces are what the edges enclose.
 */
#include <string.h>

#include "segcore/geom/tspline_file.h"

typedef struct {
    const SegPointList *list;
    double *values[2]; /* of the lines of u and v */
    int32_t n[2];
    int32_t (*place)[2]; /* of each point, its lines */
    uint8_t *wall_u;     /* [n_u - 1][n_v]: an edge from (i, j) to (i + 1, j) */
    uint8_t *wall_v;     /* [n_u][n_v - 1]: from (i, j) to (i, j + 1) */
    GArray *faces;       /* SegTface */
} Builder;

static bool find_lines(Builder *b, GError **error);
static bool lay_edges(Builder *b, GError **error);
static bool enclose_faces(Builder *b, GError **error);
static bool check_knots(const Builder *b, const SegTspline *t, GError **error);

SegPointList *seg_point_list_new(void)
{
    SegPointList *list = g_new(SegPointList, 1);
    list->points = g_array_new(FALSE, TRUE, sizeof(SegListedPoint));
    list->edges = g_array_new(FALSE, FALSE, sizeof(int32_t[2]));
    return list;
}

void seg_point_list_free(SegPointList *list)
{
    if (!list)
        return;
    g_array_unref(list->points);
    g_array_unref(list->edges);
    g_free(list);
}

static const SegListedPoint *listed(const SegPointList *list, guint k)
{
    return &g_array_index(list->points, SegListedPoint, k);
}

static SegTspline *build(const Builder *b, GError **error)
{
    guint n = b->list->points->len;
    g_autofree SegTpoint *points = g_new(SegTpoint, n);
    for (guint k = 0; k < n; k++) {
        const SegListedPoint *p = listed(b->list, k);
        points[k] = (SegTpoint){b->place[k][0], b->place[k][1], p->x, p->y, p->z, p->w};
    }
    g_autoptr(SegTspline) t = seg_tspline_new(b->values[0], b->n[0], b->values[1], b->n[1],
                                              (const SegTface *)(void *)b->faces->data,
                                              (int32_t)b->faces->len, points, (int32_t)n, error);
    return t && check_knots(b, t, error) ? g_steal_pointer(&t) : NULL;
}

SegTspline *seg_tspline_from_list(const SegPointList *list, GError **error)
{
    Builder b = {.list = list, .faces = g_array_new(FALSE, FALSE, sizeof(SegTface))};
    SegTspline *t = NULL;
    if (find_lines(&b, error) && lay_edges(&b, error) && enclose_faces(&b, error))
        t = build(&b, error);
    g_free(b.values[0]);
    g_free(b.values[1]);
    g_free(b.place);
    g_free(b.wall_u);
    g_free(b.wall_v);
    g_array_unref(b.faces);
    return t;
}

G_GNUC_PRINTF(2, 3) static bool refuse(GError **error, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_autofree char *what = g_strdup_vprintf(format, arguments);
    va_end(arguments);
    g_set_error_literal(error, SEG_ERROR, SEG_ERROR_INPUT, what);
    return false;
}

/* ------------------------------------------------------------------ lines */

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static const double *knots_of(const SegListedPoint *p, int d)
{
    return d == 0 ? p->knots_u : p->knots_v;
}

/* The centre of a point's knot vector is its parameter. */
static void sort_values(Builder *b, int d)
{
    guint n = b->list->points->len;
    double *values = b->values[d] = g_new(double, n);
    for (guint k = 0; k < n; k++)
        values[k] = knots_of(listed(b->list, k), d)[2];
    qsort(values, n, sizeof *values, compare_doubles);
    for (guint k = 0; k < n; k++)
        if (k == 0 || values[k] > values[b->n[d] - 1])
            values[b->n[d]++] = values[k];
}

static bool find_lines(Builder *b, GError **error)
{
    guint n = b->list->points->len;
    b->place = g_malloc0_n(n, sizeof *b->place);
    for (int d = 0; d < 2; d++) {
        sort_values(b, d);
        if (b->n[d] < 2 || b->n[d] > SEG_TSPLINE_MAX_LINES)
            return refuse(error, "the points lie on %d lines of %s: from 2 to %d are possible",
                          b->n[d], d == 0 ? "u" : "v", SEG_TSPLINE_MAX_LINES);
        for (guint k = 0; k < n; k++) {
            const double *at = bsearch(&knots_of(listed(b->list, k), d)[2], b->values[d],
                                       (size_t)b->n[d], sizeof *at, compare_doubles);
            b->place[k][d] = (int32_t)(at - b->values[d]);
        }
    }
    if ((int64_t)b->n[0] * b->n[1] > SEG_TSPLINE_MAX_CROSSINGS)
        return refuse(error, "%d lines of u cross %d of v: more than %d", b->n[0], b->n[1],
                      SEG_TSPLINE_MAX_CROSSINGS);
    return true;
}

/* ------------------------------------------------------------------ edges and faces */

static uint8_t *wall_u_at(const Builder *b, int32_t i, int32_t j)
{
    return &b->wall_u[(ptrdiff_t)i * b->n[1] + j];
}

static uint8_t *wall_v_at(const Builder *b, int32_t i, int32_t j)
{
    return &b->wall_v[(ptrdiff_t)i * (b->n[1] - 1) + j];
}

static bool lay_edges(Builder *b, GError **error)
{
    b->wall_u = g_new0(uint8_t, (gsize)(b->n[0] - 1) * (gsize)b->n[1]);
    b->wall_v = g_new0(uint8_t, (gsize)b->n[0] * (gsize)(b->n[1] - 1));
    const int32_t(*edges)[2] = (const int32_t(*)[2])(void *)b->list->edges->data;
    for (guint e = 0; e < b->list->edges->len; e++) {
        const int32_t *p = b->place[edges[e][0]], *q = b->place[edges[e][1]];
        if ((p[0] == q[0]) == (p[1] == q[1]))
            return refuse(error,
                          "the edge from point %d to %d follows no line of parameters: "
                          "extraordinary points are not supported",
                          edges[e][0] + 1, edges[e][1] + 1);
        for (int32_t i = MIN(p[0], q[0]); i < MAX(p[0], q[0]); i++)
            *wall_u_at(b, i, p[1]) = 1;
        for (int32_t j = MIN(p[1], q[1]); j < MAX(p[1], q[1]); j++)
            *wall_v_at(b, p[0], j) = 1;
    }
    return true;
}

static bool is_closed(const Builder *b, const SegTface *f)
{
    for (int32_t i = f->i0; i < f->i1; i++)
        if (!*wall_u_at(b, i, f->j0) || !*wall_u_at(b, i, f->j1))
            return false;
    for (int32_t j = f->j0; j < f->j1; j++)
        if (!*wall_v_at(b, f->i0, j) || !*wall_v_at(b, f->i1, j))
            return false;
    for (int32_t i = f->i0; i < f->i1; i++)
        for (int32_t j = f->j0; j < f->j1; j++)
            if ((j > f->j0 && *wall_u_at(b, i, j)) || (i > f->i0 && *wall_v_at(b, i, j)))
                return false;
    return true;
}

/* From each cell that no face has yet, up to the next edges. */
static bool enclose_faces(Builder *b, GError **error)
{
    int32_t columns = b->n[1] - 1;
    g_autofree uint8_t *taken = g_new0(uint8_t, (gsize)(b->n[0] - 1) * (gsize)columns);
    for (int32_t i = 0; i + 1 < b->n[0]; i++)
        for (int32_t j = 0; j < columns; j++) {
            if (taken[(ptrdiff_t)i * columns + j])
                continue;
            SegTface f = {i, i + 1, j, j + 1, 0};
            while (f.i1 < b->n[0] - 1 && !*wall_v_at(b, f.i1, j))
                f.i1++;
            while (f.j1 < columns && !*wall_u_at(b, i, f.j1))
                f.j1++;
            if (!is_closed(b, &f))
                return refuse(error,
                              "the T-mesh is not closed: the face at (%g, %g) is no rectangle of "
                              "edges",
                              b->values[0][i], b->values[1][j]);
            for (int32_t k = f.i0; k < f.i1; k++)
                memset(&taken[(ptrdiff_t)k * columns + f.j0], 1, (size_t)(f.j1 - f.j0));
            g_array_append_val(b->faces, f);
        }
    return true;
}

/* ------------------------------------------------------------------ knot vectors */

static bool check_knots(const Builder *b, const SegTspline *t, GError **error)
{
    for (guint k = 0; k < b->list->points->len; k++)
        for (int d = 0; d < 2; d++)
            for (int i = 0; i < 5; i++) {
                int32_t line = d == 0 ? t->lines_u[k][i] : t->lines_v[k][i];
                double given = knots_of(listed(b->list, k), d)[i], found = b->values[d][line];
                if (given != found)
                    return refuse(error,
                                  "point %u: knot %d of %s is %g, and the ray in the T-mesh finds "
                                  "%g: points with knot vectors of their own are not supported",
                                  k + 1, i + 1, d == 0 ? "u" : "v", given, found);
            }
    return true;
}
