/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Local refinement of T-splines (Sederberg and others, T-spline simplification and local
 * refinement, 2004, §5). Blending functions and the T-mesh are let apart, and brought together
 * again: violation 1  a function lacks a knot that its ray in the T-mesh meets: it is split there;
 *   violation 2  a function has a knot that its ray does not meet: the T-mesh gets it;
 * and where a split function has its centre, the T-mesh gets a vertex. Only lines that exist come
 * in, so this ends.
 */
#include <string.h>

#include "segcore/geom/tmesh.h"

/* A blending function by lines, and the homogeneous point that it carries. */
typedef struct {
    int32_t u[5], v[5];
    double h[4];
    bool alive;
} Function;

typedef struct {
    GArray *knots_u, *knots_v; /* double */
    SegTmesh *mesh;
    GPtrArray *functions; /* Function; grows */
    GHashTable *by_lines; /* the ones alive */
} Refinement;

static bool check_lines(const SegTline *lines, size_t n, GError **error);
static void insert_lines(Refinement *r, const SegTspline *t, SegTline *lines, size_t n);
static bool copy_mesh(Refinement *r, const SegTspline *t, GError **error);
static void split_faces(Refinement *r, const SegTline *lines, size_t n);
static bool settle(Refinement *r, Function *f);
static SegTspline *collect(const Refinement *r, GError **error);
static guint hash_lines(gconstpointer function);
static gboolean equal_lines(gconstpointer a, gconstpointer b);
static void clear(Refinement *r);

SegTspline *seg_tspline_refine(const SegTspline *t, const SegTline *asked, size_t n, GError **error)
{
    if (!check_lines(asked, n, error))
        return NULL;
    Refinement r = {
        g_array_new(FALSE, FALSE, sizeof(double)), g_array_new(FALSE, FALSE, sizeof(double)), NULL,
        g_ptr_array_new_with_free_func(g_free), g_hash_table_new(hash_lines, equal_lines)};
    g_autofree SegTline *lines = g_memdup2(asked, n * sizeof *asked);
    insert_lines(&r, t, lines, n);
    SegTspline *refined = NULL;
    if (copy_mesh(&r, t, error)) {
        split_faces(&r, lines, n);
        bool grown = true;
        while (grown) {
            grown = false;
            for (guint i = 0; i < r.functions->len; i++)
                grown |= settle(&r, r.functions->pdata[i]);
        }
        refined = collect(&r, error);
    }
    clear(&r);
    return refined;
}

static void clear(Refinement *r)
{
    g_array_unref(r->knots_u);
    g_array_unref(r->knots_v);
    seg_tmesh_free(r->mesh);
    g_hash_table_unref(r->by_lines);
    g_ptr_array_unref(r->functions);
}

static bool check_lines(const SegTline *lines, size_t n, GError **error)
{
    for (size_t k = 0; k < n; k++)
        if (!isfinite(lines[k].at) || !isfinite(lines[k].from) || !isfinite(lines[k].to)) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                        "refinement line %zu is %g from %g to %g: numbers must be finite", k,
                        lines[k].at, lines[k].from, lines[k].to);
            return false;
        }
    return true;
}

/* ------------------------------------------------------------------ topological stage */

/* Does the line run through the inside of the face, given by the values of its sides? */
static bool runs_through(const SegTline *l, const SegTface *f, const double *knots_u,
                         const double *knots_v)
{
    const double *across = l->of_u ? knots_u : knots_v, *along = l->of_u ? knots_v : knots_u;
    int32_t a0 = l->of_u ? f->i0 : f->j0, a1 = l->of_u ? f->i1 : f->j1;
    int32_t b0 = l->of_u ? f->j0 : f->i0, b1 = l->of_u ? f->j1 : f->i1;
    return !f->hole && across[a0] < l->at && l->at < across[a1] &&
           fmax(along[b0], l->from) < fmin(along[b1], l->to);
}

/* The value of a line so near that it takes this one's place; else the value itself. */
static double snap(const double *knots, int32_t n, double at)
{
    double near = 1e-9 * (knots[n - 1] - knots[0]);
    for (int32_t i = 0; i < n; i++)
        if (fabs(knots[i] - at) <= near)
            return knots[i];
    return at;
}

static void insert_value(GArray *knots, double at)
{
    guint i = 0;
    while (i < knots->len && g_array_index(knots, double, i) < at)
        i++;
    if (i == knots->len || g_array_index(knots, double, i) != at)
        g_array_insert_val(knots, i, at);
}

static void insert_lines(Refinement *r, const SegTspline *t, SegTline *lines, size_t n)
{
    g_array_append_vals(r->knots_u, t->knots_u, (guint)t->n_u);
    g_array_append_vals(r->knots_v, t->knots_v, (guint)t->n_v);
    for (size_t k = 0; k < n; k++) {
        SegTline *l = &lines[k];
        GArray *knots = l->of_u ? r->knots_u : r->knots_v;
        l->at = snap((const double *)(void *)knots->data, (int32_t)knots->len, l->at);
        bool wanted = false;
        for (int32_t f = 0; f < t->n_faces && !wanted; f++)
            wanted = runs_through(l, &t->faces[f], t->knots_u, t->knots_v);
        if (wanted)
            insert_value(knots, l->at);
    }
}

/* Where the old lines are among the new: those of equal value keep their order. */
static int32_t *map_lines(const double *old, int32_t n, const GArray *knots)
{
    int32_t *map = g_new(int32_t, n);
    guint at = 0;
    for (int32_t i = 0; i < n; i++, at++) {
        while (g_array_index(knots, double, at) != old[i])
            at++;
        map[i] = (int32_t)at;
    }
    return map;
}

static void add_function(Refinement *r, const int32_t u[5], const int32_t v[5], const double h[4],
                         double share);

static bool copy_mesh(Refinement *r, const SegTspline *t, GError **error)
{
    if (r->knots_u->len > SEG_TSPLINE_MAX_LINES || r->knots_v->len > SEG_TSPLINE_MAX_LINES ||
        (int64_t)r->knots_u->len * r->knots_v->len > SEG_TSPLINE_MAX_CROSSINGS) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                    "the refined T-spline would have %u lines of u and %u of v: too many",
                    r->knots_u->len, r->knots_v->len);
        return false;
    }
    g_autofree int32_t *map_u = map_lines(t->knots_u, t->n_u, r->knots_u);
    g_autofree int32_t *map_v = map_lines(t->knots_v, t->n_v, r->knots_v);
    g_autofree SegTface *faces = g_new(SegTface, t->n_faces);
    for (int32_t f = 0; f < t->n_faces; f++) {
        const SegTface *q = &t->faces[f];
        faces[f] = (SegTface){map_u[q->i0], map_u[q->i1], map_v[q->j0], map_v[q->j1], q->hole};
    }
    r->mesh =
        seg_tmesh_new((int32_t)r->knots_u->len, (int32_t)r->knots_v->len, faces, t->n_faces, error);
    if (!r->mesh)
        return false;
    for (int32_t k = 0; k < t->n_points; k++) {
        const SegTpoint *p = &t->points[k];
        int32_t u[5], v[5];
        for (int i = 0; i < 5; i++) {
            u[i] = map_u[t->lines_u[k][i]];
            v[i] = map_v[t->lines_v[k][i]];
        }
        seg_tmesh_add_vertex(r->mesh, u[2], v[2]);
        add_function(r, u, v, (const double[]){p->w * p->x, p->w * p->y, p->w * p->z, p->w}, 1);
    }
    return true;
}

static const double *values(const GArray *knots)
{
    return (const double *)(void *)knots->data;
}

/* The first line of the value between two others. */
static int32_t line_between(const double *knots, int32_t low, int32_t high, double at)
{
    for (int32_t i = low + 1; i < high; i++)
        if (knots[i] == at)
            return i;
    g_assert_not_reached();
}

static void split_faces(Refinement *r, const SegTline *lines, size_t n)
{
    const double *knots_u = values(r->knots_u), *knots_v = values(r->knots_v);
    for (size_t k = 0; k < n; k++)
        for (int32_t f = 0; f < (int32_t)r->mesh->faces->len; f++) {
            const SegTface q = *seg_tmesh_face(r->mesh, f);
            if (!runs_through(&lines[k], &q, knots_u, knots_v))
                continue;
            if (lines[k].of_u)
                seg_tmesh_split_u(r->mesh, f, line_between(knots_u, q.i0, q.i1, lines[k].at));
            else
                seg_tmesh_split_v(r->mesh, f, line_between(knots_v, q.j0, q.j1, lines[k].at));
        }
}

/* ------------------------------------------------------------------ blending functions */

static guint hash_lines(gconstpointer function)
{
    const Function *f = function;
    guint hash = 5381;
    for (int i = 0; i < 5; i++)
        hash = (hash * 33 + (guint)f->u[i]) * 33 + (guint)f->v[i];
    return hash;
}

static gboolean equal_lines(gconstpointer a, gconstpointer b)
{
    const Function *f = a, *g = b;
    return memcmp(f->u, g->u, sizeof f->u) == 0 && memcmp(f->v, g->v, sizeof f->v) == 0;
}

/* Equal functions become one: their points add up (P1 eq. 16). */
static void add_function(Refinement *r, const int32_t u[5], const int32_t v[5], const double h[4],
                         double share)
{
    Function *f = g_new0(Function, 1);
    memcpy(f->u, u, sizeof f->u);
    memcpy(f->v, v, sizeof f->v);
    Function *same = g_hash_table_lookup(r->by_lines, f);
    if (same) {
        g_free(f);
        f = same;
    } else {
        f->alive = true;
        g_ptr_array_add(r->functions, f);
        g_hash_table_add(r->by_lines, f);
    }
    for (int x = 0; x < 4; x++)
        f->h[x] += share * h[x];
}

/* The nearest line that the ray meets and the function has not, inside its support; or -1. And the
 * nearest that the function has and the ray does not meet. */
static int32_t find_lacking(const int32_t has[5], const int32_t dictated[5], int32_t *extra)
{
    *extra = -1;
    for (int m = 1; m >= 0; m--)
        if (has[m] != dictated[m]) {
            if (dictated[m] > has[m])
                return dictated[m];
            *extra = has[m];
            break;
        }
    for (int m = 3; m <= 4; m++)
        if (has[m] != dictated[m]) {
            if (dictated[m] < has[m])
                return dictated[m];
            *extra = has[m];
            break;
        }
    return -1;
}

/* The line k put between s[m] and s[m + 1] splits the function in two (P1 eq. 17-20): the lines of
 * both and their shares. */
static void insert_knot(const int32_t s[5], int32_t k, const double *knots, int32_t both[2][5],
                        double share[2])
{
    int m = 0;
    while (m < 3 && s[m + 1] < k)
        m++;
    int32_t six[6];
    for (int i = 0; i < 6; i++)
        six[i] = i <= m ? s[i] : i == m + 1 ? k : s[i - 1];
    memcpy(both[0], six, sizeof both[0]);
    memcpy(both[1], six + 1, sizeof both[1]);
    double at = knots[k], s0 = knots[s[0]], s1 = knots[s[1]], s3 = knots[s[3]], s4 = knots[s[4]];
    share[0] = m == 3 ? 1 : s3 > s0 ? (at - s0) / (s3 - s0) : 0;
    share[1] = m == 0 ? 1 : s4 > s1 ? (s4 - at) / (s4 - s1) : 0;
}

static void split_function(Refinement *r, Function *f, bool in_u, int32_t line)
{
    int32_t both[2][5];
    double share[2];
    g_hash_table_remove(r->by_lines, f);
    f->alive = false;
    if (in_u)
        insert_knot(f->u, line, values(r->knots_u), both, share);
    else
        insert_knot(f->v, line, values(r->knots_v), both, share);
    for (int i = 0; i < 2; i++)
        if (share[i] > 0)
            add_function(r, in_u ? both[i] : f->u, in_u ? f->v : both[i], f->h, share[i]);
}

/* Makes (i, j) a place where rays stop: a vertex on an edge, or an edge across. */
static void grow(SegTmesh *mesh, bool in_u, int32_t i, int32_t j)
{
    int32_t face = seg_tmesh_inside(mesh, i, j);
    if (face < 0)
        seg_tmesh_add_vertex(mesh, i, j);
    else if (in_u)
        seg_tmesh_split_u(mesh, face, i);
    else
        seg_tmesh_split_v(mesh, face, j);
}

/* Splits the function, or lets the T-mesh grow, where they disagree. True where the T-mesh grew. */
static bool settle(Refinement *r, Function *f)
{
    bool grown = false;
    int32_t i = f->u[2], j = f->v[2], u[5], v[5], extra_u, extra_v;
    if (!f->alive)
        return false;
    while (!seg_tmesh_is_vertex(r->mesh, i, j)) {
        grow(r->mesh, true, i, j);
        grown = true;
    }
    seg_tmesh_lines(r->mesh, i, j, u, v);
    int32_t lacking_u = find_lacking(f->u, u, &extra_u);
    int32_t lacking_v = find_lacking(f->v, v, &extra_v);
    if (lacking_u >= 0 || lacking_v >= 0) {
        split_function(r, f, lacking_u >= 0, lacking_u >= 0 ? lacking_u : lacking_v);
        return grown;
    }
    if (extra_u >= 0)
        grow(r->mesh, true, extra_u, j);
    if (extra_v >= 0)
        grow(r->mesh, false, i, extra_v);
    return grown || extra_u >= 0 || extra_v >= 0;
}

/* ------------------------------------------------------------------ the result */

static int compare_faces(const void *a, const void *b)
{
    const SegTface *f = a, *g = b;
    return f->i0 != g->i0 ? f->i0 - g->i0 : f->j0 - g->j0;
}

static int compare_points(const void *a, const void *b)
{
    const SegTpoint *p = a, *q = b;
    return p->i != q->i ? p->i - q->i : p->j - q->j;
}

static SegTspline *collect(const Refinement *r, GError **error)
{
    g_autoptr(GArray) points = g_array_new(FALSE, FALSE, sizeof(SegTpoint));
    for (guint k = 0; k < r->functions->len; k++) {
        const Function *f = r->functions->pdata[k];
        double w = f->h[3];
        SegTpoint p = {f->u[2], f->v[2], f->h[0] / w, f->h[1] / w, f->h[2] / w, w};
        if (f->alive)
            g_array_append_val(points, p);
    }
    g_array_sort(points, compare_points);
    g_array_sort(r->mesh->faces, compare_faces);
    return seg_tspline_new(values(r->knots_u), (int32_t)r->knots_u->len, values(r->knots_v),
                           (int32_t)r->knots_v->len, seg_tmesh_face(r->mesh, 0),
                           (int32_t)r->mesh->faces->len, (const SegTpoint *)(void *)points->data,
                           (int32_t)points->len, error);
}
