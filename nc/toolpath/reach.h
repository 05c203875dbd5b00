/* SPDX-License-Identifier: Apache-2.0 */
/* Where a tool can go: its body against the part, and the part of a region it can touch. */
#ifndef NC_TOOLPATH_REACH_H
#define NC_TOOLPATH_REACH_H

#include "nc/toolpath/region.h"

/*
 * A tool as what it must not hit. The stock to leave grows the cutter on all sides; every height
 * is measured from the tip of the GROWN cutter, which lies leave_mm under the tool's own. Shank
 * and holder are flat cylinders that must keep clear of the stock too, so they are grown by its
 * allowance.
 */
typedef struct {
    NcCutter tool; /* as it is: what leaves scallops */
    NcCutter cutter;
    NcCutter shank;
    NcCutter holder;
    double leave_mm;
    double depth_mm;  /* largest depth of cut */
    double shank_mm;  /* from the tip of the grown cutter up to the end of the flutes */
    double holder_mm; /* and to the holder's nose; both less the allowance */
} NcBody;

NcBody nc_body(const CfgTool *tool, double leave_mm, double allowance_mm);

/* Do shank and holder clear the part with the grown cutter's tip here? */
bool nc_body_clear(const NcTerrain *terrain, const NcBody *body, SegVec3 tip);

/* The least height of the tip over that place at which they do. */
double nc_body_least_z(const NcTerrain *terrain, const NcBody *body, SegVec3 tip);

/* Can the cutter, backed off by `tolerance_mm`, touch the point from the side of its normal, which
 * does not look down, and be clear of the whole part? */
bool nc_reach_point(const NcTerrain *terrain, SegVec3 point, SegVec3 normal, const NcBody *body,
                    double floor_mm, double tolerance_mm);

/* Why points of a region cannot be touched, mm². */
typedef struct {
    double requested_mm2;
    double downward_mm2; /* looks down, or lies under something */
    double cutter_mm2;   /* the cutter would enter the part elsewhere */
    double body_mm2;     /* shank or holder would */
    double floor_mm2;    /* the tip would go below the part, where the table is */
} NcReach;

double nc_reach_unreachable_mm2(const NcReach *reach);

/*
 * Measures it: a sample is reached where the cutter, touching it from the side of its normal but
 * backed off by `tolerance_mm`, is clear of the whole part. Only every `stride`th sample is looked
 * at. `reached` (may be NULL) has a byte for each sample of the region; 0 for those left out.
 */
NcReach nc_reach(const NcTerrain *terrain, const NcRegion *region, const NcBody *body,
                 double floor_mm, double tolerance_mm, size_t stride, uint8_t *reached);

#endif
