/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/geom/bspline.h"
#include "segcore/methods/region.h"

/* A surface flatter than this is not concave. */
static const double LEAST_CURVATURE = 1e-6; /* 1/mm */

/* Where a tangent, times the domain, is shorter than this part of the face, a pole is near. */
static const double LEAST_TANGENT = 1e-3;

/* In a span this short against the domain the second derivatives are mostly rounding. */
static const double LEAST_SPAN = 1e-5;

enum { MOST_SAMPLES = 300 }; /* of centres, and of vertices */

typedef struct {
    const SegPart *part;
    const SegFace *face;
    SegSurfaceTables tables;
    double extent_u, extent_v; /* of the domain */
    double least_mm;           /* least tangent times extent */
    double k_max;
} Sampler;

/* The face's vertices, which are its own, and the size of their box. */
typedef struct {
    int32_t first, last;
    double diagonal_mm;
} Span;

static bool is_in_short_span(const double *knots, int degree, int n, double t, double extent)
{
    int span = seg_knot_span(knots, degree, n, t);
    return knots[span + 1] - knots[span] < LEAST_SPAN * extent;
}

static bool sample(Sampler *s, double u, double v)
{
    const SegSurface *surface = &s->face->surface;
    if (is_in_short_span(s->tables.knots_u, surface->degree_u, surface->n_u, u, s->extent_u) ||
        is_in_short_span(s->tables.knots_v, surface->degree_v, surface->n_v, v, s->extent_v))
        return false;
    SegSurfacePoint p = seg_surface_evaluate(s->part->reals, surface, u, v, 2);
    double k_min, k_max;
    if (seg_norm(p.pu) * s->extent_u < s->least_mm || seg_norm(p.pv) * s->extent_v < s->least_mm ||
        !seg_surface_curvature(s->face, &p, &k_min, &k_max))
        return false;
    s->k_max = fmax(s->k_max, k_max);
    return true;
}

static Span vertices_of(const SegPart *part, const SegFace *f)
{
    Span span = {INT32_MAX, -1, 0};
    SegBox box = SEG_BOX_EMPTY;
    for (int32_t t = f->first_triangle; t < f->first_triangle + f->n_triangles; t++)
        for (int k = 0; k < 3; k++) {
            int32_t v = part->triangles[t].vertex[k];
            span.first = MIN(span.first, v);
            span.last = MAX(span.last, v);
            seg_box_add(&box, part->vertices[v].position);
        }
    span.diagonal_mm = seg_box_diagonal(&box);
    return span;
}

static bool sample_centre(Sampler *s, const SegTriangle *triangle)
{
    double u = 0, v = 0;
    for (int k = 0; k < 3; k++) {
        const SegVertex *corner = &s->part->vertices[triangle->vertex[k]];
        u += corner->u / 3;
        v += corner->v / 3;
    }
    return sample(s, u, v);
}

/* A cylinder or a sphere is the same everywhere; its first good point will do. */
static void sample_all(Sampler *s, const Span *span)
{
    const SegFace *f = s->face;
    bool same_everywhere = f->type == SEG_SURFACE_CYLINDER || f->type == SEG_SURFACE_SPHERE;
    int32_t step = 1 + f->n_triangles / MOST_SAMPLES;
    for (int32_t t = 0; t < f->n_triangles; t += step)
        if (sample_centre(s, &s->part->triangles[f->first_triangle + t]) && same_everywhere)
            return;
    step = 1 + (span->last - span->first) / MOST_SAMPLES;
    for (int32_t i = span->first; i <= span->last; i += step)
        sample(s, s->part->vertices[i].u, s->part->vertices[i].v);
}

double seg_min_concave_radius_mm(const SegPart *part, int32_t face)
{
    const SegFace *f = &part->faces[face];
    if (f->surface.n_u == 0 || f->type == SEG_SURFACE_PLANE || f->n_triangles == 0)
        return INFINITY;
    double u0, u1, v0, v1;
    seg_face_domain(part, face, &u0, &u1, &v0, &v1);
    Span span = vertices_of(part, f);
    Sampler s = {part,    f,       seg_surface_tables(part->reals, &f->surface),
                 u1 - u0, v1 - v0, LEAST_TANGENT * span.diagonal_mm,
                 0};
    sample_all(&s, &span);
    return s.k_max > LEAST_CURVATURE ? 1 / s.k_max : INFINITY;
}
