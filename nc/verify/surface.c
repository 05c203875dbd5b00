/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/verify/surface.h"

/* Chords of the trimming loops, mm. */
#define LOOP_CHORD_MM 1e-3

/* Meshes are stepped over from above; a triangle steeper than this (its normal's Z) is a wall. */
#define STEEP 0.02

typedef struct {
    SegLoopPolygon *loops;
    size_t n_loops;
} Outline;

struct NcSurface {
    const SegPart *part;
    const NcSetup *setup;
    const NcTerrain *terrain;
    NcRegion *whole;   /* every triangle with its outside, neighbours near each other */
    int32_t *facet_of; /* of each triangle; -1: it has no area */
    Outline *outlines; /* of each face */
};

static void turn_outward(NcSurface *surface);
static void outlines_init(NcSurface *surface);
static bool place_at(const NcSurface *surface, const NcPatch *facet, double s, double t,
                     NcPlace *place);
static bool place_on_face(const NcSurface *surface, const NcPatch *facet, double u, double v,
                          NcPlace *place);
static bool step_on_mesh(const NcSurface *surface, const NcPlace *from, SegVec3 step, NcPlace *to);

NcSurface *nc_surface_new(const SegPart *part, const NcSetup *setup, const NcTerrain *terrain)
{
    NcSurface *surface = g_new0(NcSurface, 1);
    surface->part = part;
    surface->setup = setup;
    surface->terrain = terrain;
    size_t n = (size_t)part->n_triangles;
    g_autofree int32_t *all = g_new(int32_t, n + 1);
    surface->facet_of = g_new(int32_t, n + 1);
    for (size_t t = 0; t < n; t++) {
        all[t] = (int32_t)t;
        surface->facet_of[t] = -1;
    }
    const SegRegion region = {
        .triangles = all, .n_triangles = n, .min_concave_radius_mm = INFINITY};
    const SegRegion *regions[] = {&region};
    surface->whole = nc_region_new(part, setup, terrain, regions, 1, NULL, 0);
    for (size_t f = 0; f < surface->whole->n_facets; f++)
        surface->facet_of[surface->whole->facets[f].triangle] = (int32_t)f;
    turn_outward(surface);
    outlines_init(surface);
    return surface;
}

/* A facet that looks down though the sky is above it looks up. */
static void turn_outward(NcSurface *surface)
{
    NcRegion *whole = surface->whole;
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t f = 0; f < whole->n_facets; f++) {
        NcPatch *facet = &whole->facets[f];
        SegVec3 middle = seg_scale(seg_add(facet->a, seg_add(facet->b, facet->c)), 1.0 / 3);
        if (facet->downward && nc_wall_side(surface->terrain, middle, facet->normal) > 0)
            facet->downward = false;
    }
}

const NcPatch *nc_surface_facets(const NcSurface *surface, size_t *n)
{
    *n = surface->whole->n_facets;
    return surface->whole->facets;
}

void nc_surface_free(NcSurface *surface)
{
    if (!surface)
        return;
    for (int32_t f = 0; f < surface->part->n_faces; f++) {
        Outline *outline = &surface->outlines[f];
        for (size_t i = 0; i < outline->n_loops; i++)
            g_free(outline->loops[i].uv);
        g_free(outline->loops);
    }
    g_free(surface->outlines);
    g_free(surface->facet_of);
    nc_region_free(surface->whole);
    g_free(surface);
}

static void outlines_init(NcSurface *surface)
{
    const SegPart *part = surface->part;
    surface->outlines = g_new0(Outline, (size_t)part->n_faces + 1);
    for (int32_t f = 0; f < part->n_faces; f++) {
        const SegFace *face = &part->faces[f];
        Outline *outline = &surface->outlines[f];
        outline->loops = g_new0(SegLoopPolygon, (size_t)face->n_loops + 1);
        for (int32_t i = 0; i < face->n_loops; i++)
            outline->loops[outline->n_loops++] =
                seg_loop_polygon(part, face->first_loop + i, LOOP_CHORD_MM);
    }
}

double nc_surface_area_mm2(const NcSurface *surface, const int32_t *zones, int32_t zone)
{
    double area = 0;
    for (size_t f = 0; f < surface->whole->n_facets; f++)
        if (zones[surface->whole->facets[f].triangle] == zone)
            area += surface->whole->facets[f].area_mm2;
    return area;
}

/* ------------------------------------------------------------------------ spread */

/* The first of the running sums that is larger. */
static size_t first_above(const double *sums, size_t n, double at)
{
    size_t low = 0, high = n - 1;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (sums[middle] > at)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* Equal steps along the running sum of the areas choose the triangle, the golden-ratio sequence in
 * two dimensions (Roberts 2018) the place in it, as nc_region_new has it. */
NcPlace *nc_surface_spread(const NcSurface *surface, const int32_t *zones, int32_t zone,
                           double pitch_mm, size_t least, size_t *n)
{
    const NcRegion *whole = surface->whole;
    g_autofree size_t *facets = g_new(size_t, whole->n_facets + 1);
    g_autofree double *sums = g_new(double, whole->n_facets + 1);
    size_t n_facets = 0;
    double area = 0;
    for (size_t f = 0; f < whole->n_facets; f++) {
        if (zones[whole->facets[f].triangle] != zone)
            continue;
        facets[n_facets] = f;
        sums[n_facets++] = area += whole->facets[f].area_mm2;
    }
    size_t wanted =
        n_facets > 0 ? (size_t)fmax(ceil(area / (pitch_mm * pitch_mm)), (double)least) : 0;
    NcPlace *places = g_new(NcPlace, wanted + 1);
    g_autofree bool *found = g_new(bool, wanted + 1);
#pragma omp parallel for schedule(dynamic, 1024)
    for (size_t i = 0; i < wanted; i++) {
        double s = fmod(0.5 + 0.7548776662466927 * (double)i, 1);
        double t = fmod(0.5 + 0.5698402909980532 * (double)i, 1);
        bool beyond = s + t > 1;
        size_t k = first_above(sums, n_facets, area * ((double)i + 0.5) / (double)wanted);
        found[i] = place_at(surface, &whole->facets[facets[k]], beyond ? 1 - s : s,
                            beyond ? 1 - t : t, &places[i]);
    }
    *n = 0;
    for (size_t i = 0; i < wanted; i++)
        if (found[i])
            places[(*n)++] = places[i];
    return places;
}

/* At corner a + s (b - a) + t (c - a) of a triangle. */
static bool place_at(const NcSurface *surface, const NcPatch *facet, double s, double t,
                     NcPlace *place)
{
    const SegPart *part = surface->part;
    const SegTriangle *triangle = &part->triangles[facet->triangle];
    if (part->faces[triangle->face].surface.n_u > 0) {
        const SegVertex *a = &part->vertices[triangle->vertex[0]];
        const SegVertex *b = &part->vertices[triangle->vertex[1]];
        const SegVertex *c = &part->vertices[triangle->vertex[2]];
        return place_on_face(surface, facet, a->u + s * (b->u - a->u) + t * (c->u - a->u),
                             a->v + s * (b->v - a->v) + t * (c->v - a->v), place);
    }
    SegVec3 p = seg_along(facet->a, seg_sub(facet->b, facet->a), s);
    *place = (NcPlace){.point = seg_along(p, seg_sub(facet->c, facet->a), t),
                       .normal = seg_scale(facet->normal, facet->downward ? -1 : 1),
                       .triangle = facet->triangle,
                       .downward = facet->downward};
    return true;
}

/* The outside is told by the facet: a surface's own normal may lie on either side. */
static bool place_on_face(const NcSurface *surface, const NcPatch *facet, double u, double v,
                          NcPlace *place)
{
    const SegPart *part = surface->part;
    int32_t face = part->triangles[facet->triangle].face;
    const Outline *outline = &surface->outlines[face];
    if (outline->n_loops > 0 && !seg_polygons_contain(outline->loops, outline->n_loops, u, v))
        return false;
    SegSurfacePoint at = seg_face_evaluate(part, face, u, v);
    SegVec3 outside = seg_scale(facet->normal, facet->downward ? -1 : 1), normal;
    if (seg_surface_normal(&part->faces[face], &at, &normal)) {
        normal = nc_setup_direction(surface->setup, normal);
        outside = seg_scale(normal, seg_dot(normal, outside) < 0 ? -1 : 1);
    }
    *place = (NcPlace){.point = nc_setup_point(surface->setup, at.p),
                       .normal = outside,
                       .u = u,
                       .v = v,
                       .triangle = facet->triangle,
                       .downward = facet->downward};
    return true;
}

/* -------------------------------------------------------------------------- step */

static SegVec3 to_part(const NcSetup *setup, SegVec3 d)
{
    const double(*r)[3] = setup->rotation;
    return seg_vec3(r[0][0] * d.x + r[1][0] * d.y + r[2][0] * d.z,
                    r[0][1] * d.x + r[1][1] * d.y + r[2][1] * d.z,
                    r[0][2] * d.x + r[1][2] * d.y + r[2][2] * d.z);
}

bool nc_surface_step(const NcSurface *surface, const NcPlace *from, SegVec3 step, NcPlace *to)
{
    const SegPart *part = surface->part;
    int32_t face = part->triangles[from->triangle].face;
    if (part->faces[face].surface.n_u <= 0)
        return step_on_mesh(surface, from, step, to);
    SegSurfacePoint at = seg_face_evaluate(part, face, from->u, from->v);
    SegVec3 d = to_part(surface->setup, step);
    double a = seg_dot(at.pu, at.pu), b = seg_dot(at.pu, at.pv), c = seg_dot(at.pv, at.pv);
    double e = seg_dot(at.pu, d), f = seg_dot(at.pv, d), det = a * c - b * b;
    if (!(det > 1e-12 * a * c))
        return false;
    double u = from->u + (c * e - b * f) / det, v = from->v + (a * f - b * e) / det;
    double u0, u1, v0, v1;
    seg_face_domain(part, face, &u0, &u1, &v0, &v1);
    if (u < u0 || u > u1 || v < v0 || v > v1)
        return false;
    /* The triangle stays that of the start, which tells the outside and the region. */
    if (!place_on_face(surface, &surface->whole->facets[surface->facet_of[from->triangle]], u, v,
                       to))
        return false;
    if (seg_dot(to->normal, from->normal) < 0)
        to->normal = seg_scale(to->normal, -1);
    return true;
}

static bool step_on_mesh(const NcSurface *surface, const NcPlace *from, SegVec3 step, NcPlace *to)
{
    const NcCutter needle = {0, 0};
    SegVec3 p = seg_add(from->point, step);
    if (from->normal.z < STEEP)
        return false;
    int32_t triangle = -1;
    double z = nc_drop(surface->terrain, needle, p.x, p.y, &triangle, NULL);
    if (triangle < 0 || surface->facet_of[triangle] < 0)
        return false;
    const NcPatch *facet = &surface->whole->facets[surface->facet_of[triangle]];
    if (facet->downward || facet->normal.z < STEEP || fabs(z - p.z) > seg_norm(step))
        return false;
    *to = (NcPlace){.point = seg_vec3(p.x, p.y, z), .normal = facet->normal, .triangle = triangle};
    return true;
}
