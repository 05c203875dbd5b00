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

/* The direction that promises the least time of cutting, and of turning at the ends of planes. */
double nc_iso_planar_direction(const NcJob *job, double feed_mm_min, double turn_s);

/*
 * Iso-parametric: on each face lines of one parameter of its surface, the one that gives the
 * shorter path, clipped by the trimming loops; stepped so that the scallop holds at the worst of 48
 * places along the line, but by no less than 1/8 of what the median of them allows. The cutter
 * touches the surface at right angles, and is lifted where it would enter the part elsewhere.
 */
NcCuts nc_iso_parametric(const NcJob *job);

/* Have all pieces of the region a surface? */
bool nc_iso_parametric_can(const NcRegion *region, const SegPart *part);

#endif
