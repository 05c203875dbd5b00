/* SPDX-License-Identifier: Apache-2.0 */
/* The strategies: one region and one tool to pieces of cutting. */
#ifndef NC_TOOLPATH_STRATEGY_H
#define NC_TOOLPATH_STRATEGY_H

#include "nc/toolpath/trace.h"

typedef struct {
    const SegPart *part;
    const NcSetup *setup;
    const NcRegion *region;
    NcTrace trace;
    double scallop_mm;
    double tessellation_mm;
} NcJob;

/* What a strategy yields. */
typedef struct {
    GArray *pieces; /* NcPiece; tips of the grown cutter */
    double stepover_mm;
} NcCuts;

/*
 * Iso-planar: vertical planes whose normal is at `direction_rad` + 90°. Planes lie at the spacing
 * that is cheapest for the region as a whole; between them, where slope or curvature needs it,
 * planes at a half, a quarter … of it, cut only there. The least spacing is 1/16 of the first:
 * ground leaning across the planes by more than about 86° keeps higher scallops.
 */
NcCuts nc_iso_planar(const NcJob *job, double direction_rad);

/* The direction that promises the least cutting and turning time, and that time. */
double nc_iso_planar_direction(const NcJob *job, double feed_mm_min, double turn_s);

/* Area of the region that iso-planar passes cannot finish: walls, where no plane touches more than
 * their edge. */
double nc_iso_planar_left_mm2(const NcJob *job, const uint8_t *reached);

#endif
