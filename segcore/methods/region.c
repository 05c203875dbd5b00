/* SPDX-License-Identifier: Apache-2.0 */
/* Regions from faces: their measures, triangles and neighbours. */
#include "segcore/methods/region.h"

#include <stdlib.h>
#include <string.h>

static SegFaceMeasure measure_mesh(const SegPart *part, const SegFace *face);

SegFaceMeasure *seg_measure_faces(const SegPart *part, const SegFeatureSizeParams *params)
{
    SegFaceMeasure *measures = g_new(SegFaceMeasure, (size_t)part->n_faces);
    double datum_mm = seg_datum_mm(part, params);
#pragma omp parallel for schedule(dynamic, 1)
    for (int32_t i = 0; i < part->n_faces; i++) {
        if (part->faces[i].type == SEG_SURFACE_MESH)
            measures[i] = measure_mesh(part, &part->faces[i]);
        else
            measures[i] =
                (SegFaceMeasure){seg_boundary_box(part, i, params, datum_mm, NULL),
                                 seg_face_area_mm2(part, i), seg_min_concave_radius_mm(part, i)};
    }
    return measures;
}

static SegFaceMeasure measure_mesh(const SegPart *part, const SegFace *face)
{
    SegFaceMeasure measure = {SEG_BOX_EMPTY, 0, INFINITY};
    for (int32_t t = face->first_triangle; t < face->first_triangle + face->n_triangles; t++) {
        const int32_t *v = part->triangles[t].vertex;
        SegVec3 a = part->vertices[v[0]].position, b = part->vertices[v[1]].position,
                c = part->vertices[v[2]].position;
        measure.area_mm2 += seg_norm(seg_cross(seg_sub(b, a), seg_sub(c, a))) / 2;
        seg_box_add(&measure.box, a);
        seg_box_add(&measure.box, b);
        seg_box_add(&measure.box, c);
    }
    return measure;
}

static void set_size(SegRegion *region, const SegBox *box)
{
    SegFeatureSize size = seg_size_of_box(box);
    region->feature_size_mm[0] = size.diagonal_mm;
    region->feature_size_mm[1] = size.length_mm;
    region->feature_size_mm[2] = size.width_mm;
    region->feature_size_mm[3] = size.height_mm;
}

void seg_region_fill(SegRegion *region, const SegPart *part, const SegFaceMeasure *measures,
                     const int32_t *faces, const int32_t *tags, size_t n_faces)
{
    SegBox box = SEG_BOX_EMPTY;
    region->pieces = g_new0(SegPiece, n_faces);
    region->n_pieces = n_faces;
    region->min_concave_radius_mm = INFINITY;
    for (size_t i = 0; i < n_faces; i++) {
        const SegFace *face = &part->faces[faces[i]];
        const SegFaceMeasure *m = &measures[faces[i]];
        region->pieces[i] = (SegPiece){.face = faces[i], .tag = tags ? tags[i] : 0};
        region->area_mm2 += m->area_mm2;
        region->min_concave_radius_mm =
            fmin(region->min_concave_radius_mm, m->min_concave_radius_mm);
        region->n_triangles += (size_t)face->n_triangles;
        seg_box_join(&box, &m->box);
    }
    set_size(region, &box);
    region->triangles = g_new(int32_t, region->n_triangles);
    int32_t *out = region->triangles;
    for (size_t i = 0; i < n_faces; i++) {
        const SegFace *face = &part->faces[faces[i]];
        for (int32_t t = 0; t < face->n_triangles; t++)
            *out++ = face->first_triangle + t;
    }
}

/* ------------------------------------------------------------------ neighbours */

static int compare_pairs(const void *a, const void *b)
{
    const SegFacePair *p = a, *q = b;
    return p->a != q->a ? (p->a > q->a) - (p->a < q->a) : (p->b > q->b) - (p->b < q->b);
}

void seg_regions_connect(SegRegion *regions, size_t n_regions, const GArray *adjacency,
                         const int32_t *region_of)
{
    g_autoptr(GArray) pairs = g_array_new(FALSE, FALSE, sizeof(SegFacePair));
    for (guint i = 0; i < adjacency->len; i++) {
        const SegFacePair *faces = &g_array_index(adjacency, SegFacePair, i);
        SegFacePair there = {region_of[faces->a], region_of[faces->b]};
        SegFacePair back = {there.b, there.a};
        if (there.a < 0 || there.b < 0 || there.a == there.b)
            continue;
        g_array_append_val(pairs, there);
        g_array_append_val(pairs, back);
    }
    g_array_sort(pairs, compare_pairs);
    const SegFacePair *all = (const SegFacePair *)(void *)pairs->data;
    guint at = 0;
    for (size_t r = 0; r < n_regions; r++) {
        SegRegion *region = &regions[r];
        guint from = at;
        while (at < pairs->len && all[at].a == (int32_t)r)
            at++;
        region->neighbours = g_new(int32_t, at - from);
        for (guint i = from; i < at; i++)
            if (i == from || all[i].b != all[i - 1].b)
                region->neighbours[region->n_neighbours++] = regions[all[i].b].id;
    }
}
