/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/rounded.h"

#include <stdlib.h>

/* Slabs reach this far beyond their sides, so that no line slips between two of them. */
#define SEAM_MM 1e-7

static bool slab_span(const NcRoundedPart *face, double r, int axis, SegVec3 origin, NcSpan *span);
static bool capsule_span(const NcRoundedPart *edge, double r, int axis, SegVec3 origin,
                         NcSpan *span);

bool nc_rounded_span(const NcRoundedPart *part, double r, int axis, SegVec3 origin, NcSpan *span)
{
    return part->n == 3 ? slab_span(part, r, axis, origin, span)
                        : capsule_span(part, r, axis, origin, span);
}

static SegVec3 axis_vector(int axis)
{
    return seg_vec3(axis == 0, axis == 1, axis == 2);
}

/* Keeps of the span what lies on the near side of the plane normal·x <= offset. */
static bool clip(SegVec3 normal, double offset, int axis, SegVec3 origin, NcSpan *span)
{
    const double slope = nc_along(normal, axis), beyond = seg_dot(normal, origin) - offset;
    if (fabs(slope) < 1e-12)
        return beyond <= 0;
    const double t = -beyond / slope;
    const int end = slope > 0 ? 1 : 0;
    if (end == 1 ? t < span->t[1] : t > span->t[0]) {
        span->t[end] = t;
        span->normal[end] = normal;
    }
    return span->t[0] < span->t[1];
}

static bool slab_span(const NcRoundedPart *face, double r, int axis, SegVec3 origin, NcSpan *span)
{
    const double level = seg_dot(face->normal, face->p[0]);
    *span = (NcSpan){.t = {-INFINITY, INFINITY}};
    bool meets = clip(face->normal, level + r, axis, origin, span) &&
                 clip(seg_scale(face->normal, -1), r - level, axis, origin, span);
    for (int i = 0; i < 3 && meets; i++)
        meets =
            clip(face->side[i], seg_dot(face->side[i], face->p[i]) + SEAM_MM, axis, origin, span);
    return meets;
}

static int by_place(SegVec3 a, SegVec3 b)
{
    if (a.x != b.x)
        return a.x < b.x ? -1 : 1;
    if (a.y != b.y)
        return a.y < b.y ? -1 : 1;
    return (a.z > b.z) - (a.z < b.z);
}

/* Which side of a-b the line passes, seen along it. Told from the ends in one order, so that two
 * faces never both have, nor both miss, a line that meets their edge. */
static bool passes_left(SegVec3 a, SegVec3 b, int axis, SegVec3 origin)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const bool turned = by_place(a, b) > 0;
    const SegVec3 from = turned ? b : a, to = turned ? a : b;
    const SegVec3 along = seg_sub(to, from), off = seg_sub(origin, from);
    const double side =
        nc_along(along, u) * nc_along(off, v) - nc_along(along, v) * nc_along(off, u);
    return (side >= 0) != turned;
}

bool nc_rounded_crossing(const NcRoundedPart *part, int axis, SegVec3 origin, double *t,
                         bool *enters)
{
    const double slope = part->n == 3 ? nc_along(part->normal, axis) : 0;
    if (fabs(slope) < 1e-12)
        return false;
    const bool left = passes_left(part->p[0], part->p[1], axis, origin);
    if (passes_left(part->p[1], part->p[2], axis, origin) != left ||
        passes_left(part->p[2], part->p[0], axis, origin) != left)
        return false;
    *t = seg_dot(part->normal, seg_sub(part->p[0], origin)) / slope;
    *enters = !left;
    return true;
}

static void widen(NcSpan *span, int end, double t, SegVec3 from, int axis, SegVec3 origin, double r)
{
    if (end == 0 ? t >= span->t[0] : t <= span->t[1])
        return;
    const SegVec3 at = seg_along(origin, axis_vector(axis), t);
    span->t[end] = t;
    span->normal[end] = seg_scale(seg_sub(at, from), 1 / r);
}

/* The ends lie on the balls around the ends of the edge, or on the cylinder between: the balls lie
 * wholly in the part, of the cylinder what is between them. */
static bool capsule_span(const NcRoundedPart *edge, double r, int axis, SegVec3 origin,
                         NcSpan *span)
{
    *span = (NcSpan){.t = {INFINITY, -INFINITY}};
    for (int i = 0; i < 2; i++) {
        const double middle = nc_along(seg_sub(edge->p[i], origin), axis);
        const SegVec3 off = seg_sub(seg_along(origin, axis_vector(axis), middle), edge->p[i]);
        const double left = r * r - seg_dot(off, off);
        for (int end = 0; end < 2 && left > 0; end++)
            widen(span, end, middle + (end ? 1 : -1) * sqrt(left), edge->p[i], axis, origin, r);
    }
    const SegVec3 along = seg_sub(edge->p[1], edge->p[0]);
    const double length2 = seg_dot(along, along);
    const SegVec3 from = seg_sub(origin, edge->p[0]);
    /* Square to the edge: |p + t·q| = r. */
    const SegVec3 p = seg_along(from, along, -seg_dot(from, along) / length2);
    const SegVec3 q = seg_along(axis_vector(axis), along, -nc_along(along, axis) / length2);
    const double qq = seg_dot(q, q), pq = seg_dot(p, q);
    const double root = pq * pq - qq * (seg_dot(p, p) - r * r);
    for (int end = 0; end < 2 && qq > 1e-12 && root > 0; end++) {
        const double t = (-pq + (end ? 1 : -1) * sqrt(root)) / qq;
        const double s = (seg_dot(from, along) + t * nc_along(along, axis)) / length2;
        if (s >= 0 && s <= 1)
            widen(span, end, t, seg_along(edge->p[0], along, s), axis, origin, r);
    }
    return span->t[0] < span->t[1];
}

/* ----------------------------------------------------------------------------- parts */

/* An edge of a face, its ends in one order whichever face it is of. */
typedef struct {
    SegVec3 p[2];
    guint face;    /* index of its part */
    SegVec3 third; /* the face's other corner */
} Edge;

static int same_edge(const Edge *a, const Edge *b)
{
    const int first = by_place(a->p[0], b->p[0]);
    return first != 0 ? first : by_place(a->p[1], b->p[1]);
}

static int by_edge(const void *first, const void *second)
{
    const Edge *a = first, *b = second;
    const int order = same_edge(a, b);
    return order != 0 ? order : (a->face > b->face) - (a->face < b->face);
}

static bool face_of(const SegVec3 *vertices, const int32_t triangle[3], NcRoundedPart *face)
{
    *face = (NcRoundedPart){.n = 3};
    for (int i = 0; i < 3; i++)
        face->p[i] = vertices[triangle[i]];
    const SegVec3 cross =
        seg_cross(seg_sub(face->p[1], face->p[0]), seg_sub(face->p[2], face->p[0]));
    if (!(seg_norm(cross) > 1e-100))
        return false;
    face->normal = seg_unit(cross);
    for (int i = 0; i < 3; i++) {
        const SegVec3 along = seg_sub(face->p[(i + 1) % 3], face->p[i]);
        face->side[i] = seg_unit(seg_cross(along, face->normal));
    }
    return true;
}

/* The slabs of two faces cover the outside of their edge where the other corner of one is not
 * behind the plane of the other. */
static bool is_covered(const GArray *parts, const Edge *edges)
{
    const NcRoundedPart *face = &g_array_index(parts, NcRoundedPart, edges[0].face);
    return seg_dot(face->normal, seg_sub(edges[1].third, face->p[0])) >= 0;
}

/* One edge of how many faces. */
static size_t count_faces(const Edge *edges, size_t n)
{
    size_t faces = 1;
    while (faces < n && same_edge(&edges[0], &edges[faces]) == 0)
        faces++;
    return faces;
}

GArray *nc_rounded_parts(const SegVec3 *vertices, const int32_t (*triangles)[3], size_t n)
{
    GArray *parts = g_array_new(FALSE, FALSE, sizeof(NcRoundedPart));
    g_autofree Edge *edges = g_new(Edge, 3 * n);
    size_t n_edges = 0;
    for (size_t t = 0; t < n; t++) {
        NcRoundedPart face;
        if (!face_of(vertices, triangles[t], &face))
            continue;
        for (int i = 0; i < 3; i++) {
            const SegVec3 a = face.p[i], b = face.p[(i + 1) % 3];
            const bool turned = by_place(a, b) > 0;
            edges[n_edges++] =
                (Edge){{turned ? b : a, turned ? a : b}, parts->len, face.p[(i + 2) % 3]};
        }
        g_array_append_val(parts, face);
    }
    qsort(edges, n_edges, sizeof *edges, by_edge);
    bool closed = true;
    for (size_t e = 0, faces; e < n_edges; e += faces) {
        faces = count_faces(edges + e, n_edges - e);
        closed = closed && faces == 2;
    }
    for (size_t e = 0, faces; e < n_edges; e += faces) {
        faces = count_faces(edges + e, n_edges - e);
        const NcRoundedPart edge = {.n = 2, .p = {edges[e].p[0], edges[e].p[1]}};
        if (!closed || !is_covered(parts, edges + e))
            g_array_append_val(parts, edge);
    }
    return parts;
}
