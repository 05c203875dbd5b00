/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How thick the part is under a point of its surface. What is gone there is a gouge no deeper than
 * that: behind the part's other side nothing was to be left.
 */
#ifndef NC_VERIFY_THICKNESS_H
#define NC_VERIFY_THICKNESS_H

#include "nc/verify/surface.h"

typedef struct NcThickness NcThickness;

/* The facets of the whole part; they stay the caller's. `chord_mm`: the tessellation's. */
NcThickness *nc_thickness_new(const NcPatch *facets, size_t n, const SegPart *part);
void nc_thickness_free(NcThickness *thickness);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcThickness, nc_thickness_free)

/* From the point inward to where the part ends, at most `most_mm`. Crossings of the point's own
 * face count from twice the tessellation's chord on. */
double nc_thickness_mm(const NcThickness *thickness, SegVec3 point, SegVec3 normal, int32_t face,
                       double most_mm);

#endif
