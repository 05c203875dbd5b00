/* SPDX-License-Identifier: Apache-2.0 */
/* Each face of a T-spline as a B-spline surface of its own. */
#ifndef SEGCORE_GEOM_TSPLINE_PATCH_H
#define SEGCORE_GEOM_TSPLINE_PATCH_H

#include "segcore/segcore.h"

/* Least weight of a point; the reciprocal of the largest. */
#define SEG_TSPLINE_LEAST_WEIGHT 1e-9

typedef struct SegTpatches {
    SegSurface *surfaces; /* one a face; n_u 0 for holes and faces of no area */
    GArray *reals;        /* double: what their `data` counts into */
} SegTpatches;

/* From the influence lists of `t`, which is complete but for this. */
SegTpatches *seg_tpatches_new(const SegTspline *t, GError **error);
void seg_tpatches_free(SegTpatches *patches);

#endif
