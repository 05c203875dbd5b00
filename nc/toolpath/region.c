/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/region.h"

#include <float.h>

#include "nc/toolpath/mesh_normals.h"

/* Samples: one for each square of this side, within these bounds. */
#define SAMPLE_PITCH_MM 0.5
#define SAMPLES_LEAST 400
#define SAMPLES_MOST 6000

static void add_facet(NcRegion *region, const SegPart *part, const NcSetup *setup,
                      const NcTerrain *terrain, int32_t triangle, const SegVec3 normals[3]);
static NcBend bend_of(const SegVec3 corner[3], const SegVec3 normal[3], SegVec3 facet_normal);
static void sample_facets(NcRegion *region);
static NcTerrain *terrain_of(const NcRegion *region);
static SegVec3 up_normal(SegVec3 a, SegVec3 b, SegVec3 c, bool *downward);

static void grow(NcRegion *region, SegVec3 p)
{
    region->min =
        seg_vec3(fmin(region->min.x, p.x), fmin(region->min.y, p.y), fmin(region->min.z, p.z));
    region->max =
        seg_vec3(fmax(region->max.x, p.x), fmax(region->max.y, p.y), fmax(region->max.z, p.z));
}

static bool kept_out(int32_t face, const int32_t *keep_out, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (keep_out[i] == face)
            return true;
    return false;
}

NcRegion *nc_region_new(const SegPart *part, const NcSetup *setup, const NcTerrain *terrain,
                        const SegRegion *const *regions, size_t n_regions, const int32_t *keep_out,
                        size_t n_keep_out)
{
    size_t most = 0, n_pieces = 0;
    for (size_t r = 0; r < n_regions; r++) {
        most += regions[r]->n_triangles;
        n_pieces += regions[r]->n_pieces;
    }
    NcRegion *region = g_new0(NcRegion, 1);
    region->facets = g_new(NcPatch, most + 1);
    region->pieces = g_new(const SegPiece *, n_pieces + 1);
    region->min = seg_vec3(DBL_MAX, DBL_MAX, DBL_MAX);
    region->max = seg_vec3(-DBL_MAX, -DBL_MAX, -DBL_MAX);
    region->min_concave_radius_mm = INFINITY;

    g_autofree SegVec3(*normals)[3] = nc_corner_normals(part);
    for (size_t r = 0; r < n_regions; r++) {
        const SegRegion *from = regions[r];
        region->min_concave_radius_mm =
            fmin(region->min_concave_radius_mm, from->min_concave_radius_mm);
        for (size_t i = 0; i < from->n_pieces; i++)
            if (!kept_out(from->pieces[i].face, keep_out, n_keep_out))
                region->pieces[region->n_pieces++] = &from->pieces[i];
        for (size_t i = 0; i < from->n_triangles; i++)
            if (!kept_out(part->triangles[from->triangles[i]].face, keep_out, n_keep_out))
                add_facet(region, part, setup, terrain, from->triangles[i],
                          normals[from->triangles[i]]);
    }
    sample_facets(region);
    region->terrain = terrain_of(region);
    return region;
}

NcRegion *nc_region_split(const NcRegion *region, const uint8_t *apart, bool marked)
{
    NcRegion *part = g_new0(NcRegion, 1);
    part->facets = g_new(NcPatch, region->n_facets + 1);
    part->min_concave_radius_mm = region->min_concave_radius_mm;
    part->min = seg_vec3(DBL_MAX, DBL_MAX, DBL_MAX);
    part->max = seg_vec3(-DBL_MAX, -DBL_MAX, -DBL_MAX);
    for (size_t f = 0; f < region->n_facets; f++) {
        const NcPatch *facet = &region->facets[f];
        if ((apart[f] != 0) != marked)
            continue;
        part->facets[part->n_facets++] = *facet;
        part->area_mm2 += facet->area_mm2;
        grow(part, facet->a);
        grow(part, facet->b);
        grow(part, facet->c);
    }
    part->n_pieces = marked ? 0 : region->n_pieces;
    part->pieces = g_memdup2(region->pieces, (region->n_pieces + 1) * sizeof *region->pieces);
    sample_facets(part);
    part->terrain = terrain_of(part);
    return part;
}

void nc_region_free(NcRegion *region)
{
    if (!region)
        return;
    g_free(region->facets);
    g_free(region->samples);
    nc_terrain_free(region->terrain);
    g_free(region->pieces);
    g_free(region);
}

int nc_wall_side(const NcTerrain *terrain, SegVec3 point, SegVec3 normal)
{
    const NcCutter probe = {0.005, 0.005};
    const double off_mm = 0.05;
    SegVec3 outside = seg_along(point, normal, off_mm), inside = seg_along(point, normal, -off_mm);
    bool open = nc_sweep_clear(terrain, probe, outside, outside, 0);
    bool back = nc_sweep_clear(terrain, probe, inside, inside, 0);
    return open - back;
}

double nc_bend_along(const NcBend *w, SegVec3 q)
{
    return w->xx * q.x * q.x + w->yy * q.y * q.y + w->zz * q.z * q.z +
           2 * (w->xy * q.x * q.y + w->yz * q.y * q.z + w->zx * q.z * q.x);
}

static void add_facet(NcRegion *region, const SegPart *part, const NcSetup *setup,
                      const NcTerrain *terrain, int32_t triangle, const SegVec3 normals[3])
{
    SegVec3 corner[3], normal[3];
    for (int k = 0; k < 3; k++) {
        const SegVertex *vertex = &part->vertices[part->triangles[triangle].vertex[k]];
        corner[k] = nc_setup_point(setup, vertex->position);
        normal[k] = nc_setup_direction(setup, normals[k]);
    }
    SegVec3 cross = seg_cross(seg_sub(corner[1], corner[0]), seg_sub(corner[2], corner[0]));
    double area = seg_norm(cross) / 2;
    if (!(area > 0))
        return;
    NcPatch *facet = &region->facets[region->n_facets++];
    *facet = (NcPatch){
        .a = corner[0], .b = corner[1], .c = corner[2], .area_mm2 = area, .triangle = triangle};
    facet->normal = up_normal(corner[0], corner[1], corner[2], &facet->downward);
    SegVec3 middle = seg_scale(seg_add(corner[0], seg_add(corner[1], corner[2])), 1.0 / 3);
    if (facet->normal.z < NC_WALL_UP && nc_wall_side(terrain, middle, facet->normal) < 0)
        facet->normal = seg_scale(facet->normal, -1);
    for (int k = 0; k < 3; k++) {
        if (seg_dot(normal[k], facet->normal) < 0)
            normal[k] = seg_scale(normal[k], -1);
        grow(region, corner[k]);
    }
    facet->bend = bend_of(corner, normal, facet->normal);
    region->area_mm2 += area;
}

/*
 * The tensor whose product with an edge is, in the least squares of the three edges, the change of
 * the normal along it: Rusinkiewicz 2004, "Estimating curvatures and their derivatives on triangle
 * meshes", §3; the sign turned so that concave is positive.
 */
static NcBend bend_of(const SegVec3 corner[3], const SegVec3 normal[3], SegVec3 facet_normal)
{
    SegVec3 u = seg_unit(seg_sub(corner[1], corner[0]));
    SegVec3 v = seg_cross(facet_normal, u);
    double m[3][3] = {{0}}, right[3] = {0};
    for (int k = 0; k < 3; k++) {
        SegVec3 edge = seg_sub(corner[(k + 1) % 3], corner[k]);
        SegVec3 turn = seg_sub(normal[(k + 1) % 3], normal[k]);
        double eu = seg_dot(edge, u), ev = seg_dot(edge, v);
        double row[2][3] = {{eu, ev, 0}, {0, eu, ev}};
        double value[2] = {seg_dot(turn, u), seg_dot(turn, v)};
        for (int r = 0; r < 2; r++)
            for (int i = 0; i < 3; i++) {
                right[i] += row[r][i] * value[r];
                for (int j = 0; j < 3; j++)
                    m[i][j] += row[r][i] * row[r][j];
            }
    }
    /* A sliver leaves a direction undetermined: no curvature is then the answer there. */
    double keep = 1e-6 * (m[0][0] + m[1][1] + m[2][2]);
    double w[3];
    for (int i = 0; i < 3; i++)
        m[i][i] += keep;
    for (int i = 0; i < 3; i++)
        for (int j = i + 1; j < 3; j++) {
            double f = m[j][i] / m[i][i];
            for (int k = i; k < 3; k++)
                m[j][k] -= f * m[i][k];
            right[j] -= f * right[i];
        }
    for (int i = 2; i >= 0; i--) {
        w[i] = right[i];
        for (int k = i + 1; k < 3; k++)
            w[i] -= m[i][k] * w[k];
        w[i] /= m[i][i];
    }
    double a = -w[0], b = -w[1], c = -w[2];
    return (NcBend){.xx = a * u.x * u.x + 2 * b * u.x * v.x + c * v.x * v.x,
                    .yy = a * u.y * u.y + 2 * b * u.y * v.y + c * v.y * v.y,
                    .zz = a * u.z * u.z + 2 * b * u.z * v.z + c * v.z * v.z,
                    .xy = a * u.x * u.y + b * (u.x * v.y + u.y * v.x) + c * v.x * v.y,
                    .yz = a * u.y * u.z + b * (u.y * v.z + u.z * v.y) + c * v.y * v.z,
                    .zx = a * u.z * u.x + b * (u.z * v.x + u.x * v.z) + c * v.z * v.x};
}

/* A place on a curve that visits the cells of a 1024² grid so that neighbours on it are neighbours
 * in the plane (Morton 1966), downward ground and walls apart, in this order. */
static uint64_t order_of(const NcRegion *region, const NcPatch *facet)
{
    double size = fmax(fmax(region->max.x - region->min.x, region->max.y - region->min.y), 1e-9);
    SegVec3 middle = seg_scale(seg_add(facet->a, seg_add(facet->b, facet->c)), 1.0 / 3);
    uint64_t x = (uint64_t)((middle.x - region->min.x) / size * 1023);
    uint64_t y = (uint64_t)((middle.y - region->min.y) / size * 1023);
    uint64_t code = facet->normal.z < NC_WALL_UP ? 2 : facet->downward;
    for (int bit = 9; bit >= 0; bit--)
        code = code << 2 | (x >> bit & 1) << 1 | (y >> bit & 1);
    return code;
}

static gint by_place(gconstpointer a, gconstpointer b, gpointer data)
{
    const NcPatch *p = a, *q = b;
    uint64_t i = order_of(data, p), j = order_of(data, q);
    return i != j ? (i > j) - (i < j) : (p->triangle > q->triangle) - (p->triangle < q->triangle);
}

/* Equal steps along the running sum of the areas choose the triangle, the golden-ratio sequence in
 * two dimensions (Roberts 2018) the place in it: even, and the same at every run. */
static void sample_facets(NcRegion *region)
{
    double wanted = region->area_mm2 / (SAMPLE_PITCH_MM * SAMPLE_PITCH_MM);
    size_t n = (size_t)fmin(fmax(wanted, SAMPLES_LEAST), SAMPLES_MOST);
    if (region->n_facets == 0)
        n = 0;
    region->samples = g_new(NcSample, n + 1);
    region->n_samples = n;
    /* Alike facets side by side, or the steps would miss and hit them by chance. */
    g_qsort_with_data(region->facets, (gint)region->n_facets, sizeof *region->facets, by_place,
                      region);
    double passed = 0;
    for (size_t i = 0, f = 0; i < n; i++) {
        double at = region->area_mm2 * ((double)i + 0.5) / (double)n;
        while (f + 1 < region->n_facets && passed + region->facets[f].area_mm2 < at)
            passed += region->facets[f++].area_mm2;
        double s = fmod(0.5 + 0.7548776662466927 * (double)i, 1);
        double t = fmod(0.5 + 0.5698402909980532 * (double)i, 1);
        if (s + t > 1) {
            s = 1 - s;
            t = 1 - t;
        }
        const NcPatch *facet = &region->facets[f];
        SegVec3 p = seg_along(facet->a, seg_sub(facet->b, facet->a), s);
        region->samples[i] = (NcSample){.point = seg_along(p, seg_sub(facet->c, facet->a), t),
                                        .normal = facet->normal,
                                        .facet = f,
                                        .area_mm2 = region->area_mm2 / (double)n};
    }
}

static NcTerrain *terrain_of(const NcRegion *region)
{
    size_t n = region->n_facets;
    while (n > 0 && region->facets[n - 1].normal.z < NC_WALL_UP)
        n--;
    g_autofree SegVec3 *vertices = g_new(SegVec3, 3 * n + 1);
    g_autofree int32_t(*triangles)[3] = g_malloc_n(n + 1, sizeof *triangles);
    for (size_t f = 0; f < n; f++) {
        vertices[3 * f] = region->facets[f].a;
        vertices[3 * f + 1] = region->facets[f].b;
        vertices[3 * f + 2] = region->facets[f].c;
        for (int k = 0; k < 3; k++)
            triangles[f][k] = (int32_t)(3 * f) + k;
    }
    return nc_terrain_new(vertices, 3 * n, (const int32_t(*)[3])triangles, n);
}

static SegVec3 up_normal(SegVec3 a, SegVec3 b, SegVec3 c, bool *downward)
{
    SegVec3 n = seg_unit(seg_cross(seg_sub(b, a), seg_sub(c, a)));
    *downward = n.z < -NC_WALL_UP;
    return *downward ? seg_scale(n, -1) : n;
}
