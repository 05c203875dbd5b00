/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Feature size of a face (P0 §2.2): its boundary is repaired with points at equal arc lengths, or
 * with every extremum, and its characteristic cuboid is the axis-aligned box of these points. A
 * face that bulges reaches outside the cuboid of its boundary: a known limit of the method.
 */
#include "segcore/methods/region.h"

/* The rule's number of divisions of an edge against the datum length. */
static int divisions(double length_mm, double datum_mm)
{
    double ratio = length_mm / datum_mm;
    return ratio > 0.7 ? 8 : ratio > 0.5 ? 6 : ratio > 0.3 ? 4 : ratio > 0.1 ? 2 : 1;
}

/* The points between the ends that divide the edge into `n` parts of equal length. */
static void add_divisions(const SegPart *part, const SegEdge *e, double length_mm, int n,
                          SegBox *box)
{
    for (int i = 1; i < n; i++) {
        double t = seg_curve_at_length(part, &e->curve, e->t_first, e->t_last, length_mm * i / n,
                                       length_mm);
        seg_box_add(box, seg_curve_evaluate(part, &e->curve, t, NULL));
    }
}

/* Returns the number of points added between the edge's ends. */
static size_t add_edge(const SegPart *part, const SegEdge *e, const SegFeatureSizeParams *params,
                       double datum_mm, SegBox *box)
{
    if (e->curve.n_poles == 0) {
        seg_box_add(box, e->ends[0]);
        return 0;
    }
    if (params->repair == SEG_REPAIR_EXACT)
        return seg_curve_box(part, &e->curve, e->t_first, e->t_last, box);
    seg_box_add(box, seg_curve_evaluate(part, &e->curve, e->t_first, NULL));
    seg_box_add(box, seg_curve_evaluate(part, &e->curve, e->t_last, NULL));
    double length_mm = seg_curve_length_mm(part, &e->curve, e->t_first, e->t_last);
    int n = params->repair == SEG_REPAIR_RULE ? divisions(length_mm, datum_mm) : params->points + 1;
    if (!(length_mm > 0) || n < 2)
        return 0;
    add_divisions(part, e, length_mm, n, box);
    return (size_t)n - 1;
}

SegBox seg_boundary_box(const SegPart *part, int32_t face, const SegFeatureSizeParams *params,
                        double datum_mm, size_t *n_points)
{
    SegBox box = SEG_BOX_EMPTY;
    size_t n = 0;
    const SegFace *f = &part->faces[face];
    for (int32_t l = f->first_loop; l < f->first_loop + f->n_loops; l++)
        for (int32_t i = 0; i < part->loops[l].n_coedges; i++) {
            int32_t edge = part->coedges[part->loops[l].first_coedge + i].edge;
            n += add_edge(part, &part->edges[edge], params, datum_mm, &box);
        }
    if (n_points)
        *n_points = n;
    return box;
}

double seg_datum_mm(const SegPart *part, const SegFeatureSizeParams *params)
{
    if (params->datum_mm > 0 || params->repair != SEG_REPAIR_RULE)
        return params->datum_mm;
    SegBox box = SEG_BOX_EMPTY;
    for (int32_t i = 0; i < part->n_edges; i++) {
        const SegEdge *e = &part->edges[i];
        if (e->curve.n_poles > 0)
            seg_curve_box(part, &e->curve, e->t_first, e->t_last, &box);
    }
    return seg_box_diagonal(&box);
}

SegFeatureSize seg_size_of_box(const SegBox *box)
{
    if (seg_box_is_empty(box))
        return (SegFeatureSize){0};
    SegVec3 d = seg_sub(box->max, box->min);
    double longest = fmax(d.x, fmax(d.y, d.z)), shortest = fmin(d.x, fmin(d.y, d.z));
    double middle = fmax(fmin(d.x, d.y), fmin(fmax(d.x, d.y), d.z));
    return (SegFeatureSize){seg_norm(d), longest, middle, shortest};
}

SegFeatureSize seg_feature_size(const SegPart *part, int32_t face,
                                const SegFeatureSizeParams *params, size_t *n_points)
{
    SegBox box = seg_boundary_box(part, face, params, seg_datum_mm(part, params), n_points);
    return seg_size_of_box(&box);
}
