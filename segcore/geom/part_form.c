/* SPDX-License-Identifier: Apache-2.0 */
/* Adopts a part form. Nothing in it is believed before it has been looked at. */
#include "segcore/geom/part_form.h"

#include "segcore/geom/bspline.h"

#include <string.h>

_Static_assert(sizeof(SegPartHeader) == 160 && sizeof(SegFace) == 176 && sizeof(SegLoop) == 16 &&
                   sizeof(SegCoedge) == 48 && sizeof(SegEdge) == 96 && sizeof(SegVertex) == 64 &&
                   sizeof(SegTriangle) == 16 && sizeof(SegIgesEntity) == 8,
               "the records are the part form's bytes");
_Static_assert(G_BYTE_ORDER == G_LITTLE_ENDIAN, "the part form is read in place");

static bool lay_out(SegPart *part, GError **error);
static bool check_reals(const SegPart *part, GError **error);
static bool check_faces(const SegPart *part, GError **error);
static bool check_loops(const SegPart *part, GError **error);
static bool check_edges(const SegPart *part, GError **error);
static bool check_tessellation(const SegPart *part, GError **error);

SegPart *seg_part_from_form(GBytes *memory, GError **error)
{
    g_autoptr(SegPart) part = g_new0(SegPart, 1);
    part->ref_count = 1;
    gsize length;
    const void *bytes = g_bytes_get_data(memory, &length);
    bool aligned = (uintptr_t)bytes % sizeof(double) == 0;
    part->memory = aligned ? g_bytes_ref(memory) : g_bytes_new(bytes, length);

    if (lay_out(part, error) && check_reals(part, error) && check_faces(part, error) &&
        check_loops(part, error) && check_edges(part, error) && check_tessellation(part, error))
        return g_steal_pointer(&part);
    return NULL;
}

G_GNUC_PRINTF(2, 3) static bool refuse(GError **error, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_autofree char *what = g_strdup_vprintf(format, arguments);
    va_end(arguments);
    g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "part form: %s", what);
    return false;
}

/* ------------------------------------------------------------------ header and tables */

static bool check_header(const SegPartHeader *h, GError **error)
{
    if (memcmp(h->magic, SEG_FORM_MAGIC, sizeof h->magic) != 0)
        return refuse(error, "the header does not begin with " SEG_FORM_MAGIC);
    if (h->byte_order != SEG_FORM_BYTE_ORDER)
        return refuse(error, "byte order mark 0x%08x, expected 0x%08x", h->byte_order,
                      SEG_FORM_BYTE_ORDER);
    if (h->version != SEG_FORM_VERSION)
        return refuse(error, "version %u, this program reads version %d", h->version,
                      SEG_FORM_VERSION);
    if (!(h->chord_mm >= 0 && h->chord_mm <= SEG_FORM_MAX_REAL))
        return refuse(error, "chord_mm is %g", h->chord_mm);
    if (!(h->unit_mm > 0 && h->unit_mm <= SEG_FORM_MAX_REAL))
        return refuse(error, "unit_mm is %g", h->unit_mm);
    for (size_t i = 0; i < sizeof h->sha256; i++)
        if (!g_ascii_isxdigit(h->sha256[i]) || g_ascii_isupper(h->sha256[i]))
            return refuse(error, "sha256 is not 64 lower-case hex digits");
    return true;
}

/* Sets the part's tables and counts; they fill the block to its last byte. */
static bool lay_out(SegPart *part, GError **error)
{
    gsize length;
    const uint8_t *bytes = g_bytes_get_data(part->memory, &length);
    if (length < sizeof(SegPartHeader))
        return refuse(error, "%zu bytes are less than a header", length);
    SegPartHeader h;
    memcpy(&h, bytes, sizeof h);
    if (!check_header(&h, error))
        return false;

    const struct {
        const char *name;
        int64_t n;
        size_t size;
    } tables[] = {
        {"faces", h.n_faces, sizeof(SegFace)},
        {"loops", h.n_loops, sizeof(SegLoop)},
        {"coedges", h.n_coedges, sizeof(SegCoedge)},
        {"edges", h.n_edges, sizeof(SegEdge)},
        {"iges_curves", h.n_iges_curves, sizeof(SegIgesEntity)},
        {"vertices", h.n_vertices, sizeof(SegVertex)},
        {"triangles", h.n_triangles, sizeof(SegTriangle)},
        {"reals", h.n_reals, sizeof(double)},
    };
    size_t offset[G_N_ELEMENTS(tables)];
    size_t end = sizeof h;
    for (size_t i = 0; i < G_N_ELEMENTS(tables); i++) {
        if (tables[i].n < 0 || tables[i].n > SEG_FORM_MAX_COUNT)
            return refuse(error, "%" G_GINT64_FORMAT " %s: more than %d or less than none",
                          tables[i].n, tables[i].name, SEG_FORM_MAX_COUNT);
        offset[i] = end;
        end += (size_t)tables[i].n * tables[i].size; /* 2^28 entries of 176 bytes cannot wrap */
    }
    if (end != length)
        return refuse(error, "its tables take %zu bytes, it has %zu", end, length);

    part->faces = (const SegFace *)(bytes + offset[0]);
    part->loops = (const SegLoop *)(bytes + offset[1]);
    part->coedges = (const SegCoedge *)(bytes + offset[2]);
    part->edges = (const SegEdge *)(bytes + offset[3]);
    part->iges_curves = (const SegIgesEntity *)(bytes + offset[4]);
    part->vertices = (const SegVertex *)(bytes + offset[5]);
    part->triangles = (const SegTriangle *)(bytes + offset[6]);
    part->reals = (const double *)(bytes + offset[7]);
    part->n_faces = (int32_t)h.n_faces;
    part->n_loops = (int32_t)h.n_loops;
    part->n_coedges = (int32_t)h.n_coedges;
    part->n_edges = (int32_t)h.n_edges;
    part->n_iges_curves = (int32_t)h.n_iges_curves;
    part->n_vertices = (int32_t)h.n_vertices;
    part->n_triangles = (int32_t)h.n_triangles;
    part->n_reals = h.n_reals;
    part->chord_mm = h.chord_mm;
    part->unit_mm = h.unit_mm;
    memcpy(part->sha256, h.sha256, sizeof h.sha256);
    return true;
}

/* ------------------------------------------------------------------ numbers */

/* Finite, and within what a part can reach: squares and cubes stay finite too. */
static inline bool sane(double x)
{
    return fabs(x) <= SEG_FORM_MAX_REAL;
}

static bool sane_vec(SegVec3 v)
{
    return sane(v.x) && sane(v.y) && sane(v.z);
}

static bool is_unit(SegVec3 v)
{
    return fabs(seg_dot(v, v) - 1) <= 1e-6;
}

static bool is_flag(int32_t x)
{
    return x == 0 || x == 1;
}

/* Is [first, first + n) within a table of `total` entries? */
static bool in_table(int64_t first, int64_t n, int64_t total)
{
    return first >= 0 && n >= 0 && first <= total && n <= total - first;
}

static bool check_reals(const SegPart *part, GError **error)
{
    for (int64_t i = 0; i < part->n_reals; i++)
        if (!sane(part->reals[i]))
            return refuse(error, "reals[%" G_GINT64_FORMAT "] is %g", i, part->reals[i]);
    return true;
}

/* ------------------------------------------------------------------ splines */

/* The functions below say what is wrong, or NULL. */

static const char *knots_fault(const double *knots, int32_t degree, int32_t n)
{
    for (int64_t i = 0; i < (int64_t)n + degree; i++)
        if (!(knots[i] <= knots[i + 1]))
            return "knots decrease";
    return knots[n] > knots[degree] ? NULL : "the domain is empty";
}

static const char *weights_fault(const double *weights, int64_t n)
{
    for (int64_t i = 0; i < n; i++)
        if (!(weights[i] >= SEG_FORM_MIN_WEIGHT))
            return "a weight is not positive";
    return NULL;
}

static const char *degree_fault(int32_t degree, int32_t n)
{
    if (degree < 1 || degree > SEG_MAX_DEGREE)
        return "the degree is not in 1…25";
    if (n <= degree || n > SEG_FORM_MAX_COUNT)
        return "the number of poles does not suit the degree";
    return NULL;
}

static const char *curve_fault(const SegPart *part, const SegCurve *c, int32_t dim, double t_first,
                               double t_last)
{
    const char *fault = degree_fault(c->degree, c->n_poles);
    if (fault)
        return fault;
    if (c->dim != dim || !is_flag(c->rational))
        return "the dimension or the rational flag is wrong";
    int64_t n = c->n_poles, n_knots = n + c->degree + 1;
    if (!in_table(c->data, n_knots + n * (dim + c->rational), part->n_reals))
        return "the curve lies outside the reals";
    const double *knots = part->reals + c->data;
    fault = knots_fault(knots, c->degree, c->n_poles);
    if (!fault && c->rational)
        fault = weights_fault(knots + n_knots + n * dim, n);
    if (fault)
        return fault;
    double a = knots[c->degree], b = knots[n], slack = 1e-6 * (b - a);
    if (!(t_first < t_last && t_first >= a - slack && t_last <= b + slack))
        return "the parameter range is empty or outside the curve";
    return NULL;
}

static const char *surface_fault(const SegPart *part, const SegSurface *s)
{
    const char *fault = degree_fault(s->degree_u, s->n_u);
    if (!fault)
        fault = degree_fault(s->degree_v, s->n_v);
    if (fault)
        return fault;
    if (!is_flag(s->rational))
        return "the rational flag is wrong";
    int64_t n_poles = (int64_t)s->n_u * s->n_v;
    int64_t knots_u = (int64_t)s->n_u + s->degree_u + 1,
            knots_v = (int64_t)s->n_v + s->degree_v + 1;
    if (!in_table(s->data, knots_u + knots_v + n_poles * (3 + s->rational), part->n_reals))
        return "the surface lies outside the reals";
    const double *reals = part->reals + s->data;
    fault = knots_fault(reals, s->degree_u, s->n_u);
    if (!fault)
        fault = knots_fault(reals + knots_u, s->degree_v, s->n_v);
    if (!fault && s->rational)
        fault = weights_fault(reals + knots_u + knots_v + n_poles * 3, n_poles);
    return fault;
}

/* ------------------------------------------------------------------ faces, loops, edges */

static const char *elementary_fault(const SegFace *f)
{
    if (!sane_vec(f->origin) || !sane_vec(f->axis) || !sane_vec(f->x_axis) || !sane(f->radius_mm) ||
        !sane(f->minor_radius_mm) || !sane(f->half_angle_rad))
        return "a parameter of the original surface is not finite";
    switch (f->type) {
    case SEG_SURFACE_CYLINDER:
    case SEG_SURFACE_SPHERE:
    case SEG_SURFACE_TORUS:
        if (!(f->radius_mm > 0) || (f->type == SEG_SURFACE_TORUS && !(f->minor_radius_mm > 0)))
            return "the radius is not positive";
        G_GNUC_FALLTHROUGH;
    case SEG_SURFACE_CONE:
    case SEG_SURFACE_PLANE:
        return is_unit(f->axis) && is_unit(f->x_axis) ? NULL : "an axis is not a unit vector";
    default:
        return NULL;
    }
}

static const char *face_fault(const SegPart *part, const SegFace *f)
{
    if (f->type < 0 || f->type >= SEG_N_SURFACE_TYPES)
        return "unknown surface type";
    if (!is_flag(f->reversed))
        return "the reversed flag is neither 0 nor 1";
    if (f->iges_type < 0 || f->iges_de < 0 || f->iges_surface_type < 0 || f->iges_surface_de < 0)
        return "an IGES number is negative";
    if (!in_table(f->first_iges_curve, f->n_iges_curves, part->n_iges_curves))
        return "IGES curves outside their table";
    if (f->type == SEG_SURFACE_MESH) {
        bool bare = f->surface.n_u == 0 && f->surface.n_v == 0 && f->n_loops == 0;
        return bare ? NULL : "a mesh has neither surface nor loops";
    }
    const char *fault = surface_fault(part, &f->surface);
    if (!fault && f->n_loops < 1)
        fault = "no loop bounds it";
    return fault ? fault : elementary_fault(f);
}

/* Loops and triangles belong to the faces in order: each to one. */
static bool check_faces(const SegPart *part, GError **error)
{
    int64_t loops = 0, triangles = 0;
    for (int32_t i = 0; i < part->n_faces; i++) {
        const SegFace *f = &part->faces[i];
        const char *fault = face_fault(part, f);
        if (fault)
            return refuse(error, "faces[%d]: %s", i, fault);
        if (f->first_loop != loops || !in_table(loops, f->n_loops, part->n_loops))
            return refuse(error, "faces[%d]: loops %d + %d, expected from %" G_GINT64_FORMAT, i,
                          f->first_loop, f->n_loops, loops);
        if (f->first_triangle != triangles ||
            !in_table(triangles, f->n_triangles, part->n_triangles))
            return refuse(error, "faces[%d]: triangles %d + %d, expected from %" G_GINT64_FORMAT, i,
                          f->first_triangle, f->n_triangles, triangles);
        loops += f->n_loops;
        triangles += f->n_triangles;
    }
    if (loops != part->n_loops || triangles != part->n_triangles)
        return refuse(error, "loops or triangles that no face owns");
    for (int32_t i = 0; i < part->n_iges_curves; i++)
        if (part->iges_curves[i].type < 0 || part->iges_curves[i].de < 0)
            return refuse(error, "iges_curves[%d]: a number is negative", i);
    return true;
}

static bool check_coedge(const SegPart *part, int32_t face, int32_t index, GError **error)
{
    const SegCoedge *c = &part->coedges[index];
    if (c->edge < 0 || c->edge >= part->n_edges)
        return refuse(error, "coedges[%d]: edge %d of %d", index, c->edge, part->n_edges);
    if (!is_flag(c->reversed))
        return refuse(error, "coedges[%d]: the reversed flag is neither 0 nor 1", index);
    const SegEdge *e = &part->edges[c->edge];
    bool full = e->face[0] >= 0 && e->face[1] >= 0; /* where three faces meet, two are named */
    if (e->face[0] != face && e->face[1] != face && !full)
        return refuse(error, "coedges[%d]: edge %d does not name face %d", index, c->edge, face);
    const char *fault = curve_fault(part, &c->pcurve, 2, c->t_first, c->t_last);
    return !fault || refuse(error, "coedges[%d]: %s", index, fault);
}

/* Coedges belong to the loops in order, loops to the faces. */
static bool check_loops(const SegPart *part, GError **error)
{
    int64_t coedges = 0;
    for (int32_t i = 0; i < part->n_faces; i++) {
        const SegFace *f = &part->faces[i];
        for (int32_t l = f->first_loop; l < f->first_loop + f->n_loops; l++) {
            const SegLoop *loop = &part->loops[l];
            if (!is_flag(loop->outer) || (loop->outer && l != f->first_loop))
                return refuse(error, "loops[%d]: only a face's first loop can be outer", l);
            if (loop->n_coedges < 1 || loop->first_coedge != coedges ||
                !in_table(coedges, loop->n_coedges, part->n_coedges))
                return refuse(error, "loops[%d]: coedges %d + %d, expected from %" G_GINT64_FORMAT,
                              l, loop->first_coedge, loop->n_coedges, coedges);
            coedges += loop->n_coedges;
            for (int32_t c = 0; c < loop->n_coedges; c++)
                if (!check_coedge(part, i, loop->first_coedge + c, error))
                    return false;
        }
    }
    return coedges == part->n_coedges || refuse(error, "coedges that no loop owns");
}

static bool check_edges(const SegPart *part, GError **error)
{
    for (int32_t i = 0; i < part->n_edges; i++) {
        const SegEdge *e = &part->edges[i];
        if (e->face[0] < 0 || e->face[0] >= part->n_faces || e->face[1] < -1 ||
            e->face[1] >= part->n_faces)
            return refuse(error, "edges[%d]: faces %d and %d of %d", i, e->face[0], e->face[1],
                          part->n_faces);
        if (!sane_vec(e->ends[0]) || !sane_vec(e->ends[1]))
            return refuse(error, "edges[%d]: an end is not finite", i);
        bool degenerate = e->curve.n_poles == 0;
        if (degenerate && sane(e->t_first) && sane(e->t_last))
            continue;
        const char *fault = curve_fault(part, &e->curve, 3, e->t_first, e->t_last);
        if (fault)
            return refuse(error, "edges[%d]: %s", i, fault);
    }
    return true;
}

/* ------------------------------------------------------------------ tessellation */

/* A face's vertices come after those of the faces before it. */
static bool check_triangles(const SegPart *part, int32_t face, int32_t *free, GError **error)
{
    const SegFace *f = &part->faces[face];
    int32_t first = *free;
    for (int32_t t = f->first_triangle; t < f->first_triangle + f->n_triangles; t++) {
        const SegTriangle *triangle = &part->triangles[t];
        if (triangle->face != face)
            return refuse(error, "triangles[%d]: face %d, expected %d", t, triangle->face, face);
        for (int k = 0; k < 3; k++) {
            int32_t v = triangle->vertex[k];
            if (v < first || v >= part->n_vertices)
                return refuse(error, "triangles[%d]: vertex %d is not in %d…%d", t, v, first,
                              part->n_vertices - 1);
            *free = MAX(*free, v + 1);
        }
    }
    return true;
}

static bool check_tessellation(const SegPart *part, GError **error)
{
    for (int32_t i = 0; i < part->n_vertices; i++) {
        const SegVertex *v = &part->vertices[i];
        if (!sane_vec(v->position) || !sane(v->u) || !sane(v->v))
            return refuse(error, "vertices[%d]: a coordinate is not finite", i);
        if (!is_unit(v->normal) && seg_norm(v->normal) != 0)
            return refuse(error, "vertices[%d]: the normal is neither a unit vector nor zero", i);
    }
    int32_t free = 0; /* vertices from here on belong to no face yet */
    for (int32_t i = 0; i < part->n_faces; i++)
        if (!check_triangles(part, i, &free, error))
            return false;
    return true;
}
