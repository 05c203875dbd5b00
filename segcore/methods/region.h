/* SPDX-License-Identifier: Apache-2.0 */
/* What every method needs to turn faces into regions. */
#ifndef SEGCORE_METHODS_REGION_H
#define SEGCORE_METHODS_REGION_H

#include "segcore/geom/curve.h"
#include "segcore/segcore.h"

/* What is measured of each face once. */
typedef struct {
    SegBox box; /* characteristic cuboid of its boundary; of a mesh: of its vertices */
    double area_mm2;
    double min_concave_radius_mm; /* of its surface inside the loops; INFINITY: none */
} SegFaceMeasure;

/* Boxes by P0's repair `params`; one a face, caller frees. The faces are shared out to threads;
 * each is measured by one, so the result does not depend on their number. */
SegFaceMeasure *seg_measure_faces(const SegPart *part, const SegFeatureSizeParams *params);

/* Box of one face's boundary (seg_feature_size before it is a size); `datum_mm` is L of the rule.
 */
SegBox seg_boundary_box(const SegPart *part, int32_t face, const SegFeatureSizeParams *params,
                        double datum_mm, size_t *n_points);

/* First feature size of the whole part, from the exact boxes of its edges: L where the caller gives
 * none (P0 §2.2: "the estimated first feature size"). */
double seg_datum_mm(const SegPart *part, const SegFeatureSizeParams *params);

/* A cuboid's sizes, length >= width >= height. */
SegFeatureSize seg_size_of_box(const SegBox *box);

/*
 * Smallest concave radius of a face's surface: up to 300 vertices and as many centres of
 * triangles are sampled; points where the surface is (nearly) singular are left out, and radii
 * above 1 km count as none. Sharp edges between faces are no matter of a surface.
 */
double seg_min_concave_radius_mm(const SegPart *part, int32_t face);

/* Fills a region from its faces (ascending) and their tags: all but id, name, kind, neighbours. */
void seg_region_fill(SegRegion *region, const SegPart *part, const SegFaceMeasure *measures,
                     const int32_t *faces, const int32_t *tags, size_t n_faces);

/* Sets every region's neighbours; `region_of[face]` is the index of its region or -1. */
void seg_regions_connect(SegRegion *regions, size_t n_regions, const GArray *adjacency,
                         const int32_t *region_of);

#endif
