/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Where at most each chord of a group can meet a ray: single precision, all chords at once, never
 * too narrow. It tells which chords the exact kernel must be asked for.
 */
#ifndef NC_STOCK_BOUNDS_H
#define NC_STOCK_BOUNDS_H

#include "nc/stock/chords.h"

/* Chords with their coordinates turned to (u, v, w) of an axis, w along the rays, from `origin`;
 * [0, n), filled up to a multiple of NC_LANES with ones that meet nothing. */
enum { NC_LANES = 16 };

typedef struct {
    int axis, n;
    SegVec3 origin;
    float margin;                                   /* covers the rounding */
    float u[NC_GROUP], v[NC_GROUP], w[NC_GROUP];    /* start */
    float du[NC_GROUP], dv[NC_GROUP], dw[NC_GROUP]; /* to the end */
    float tu[NC_GROUP], tv[NC_GROUP];               /* unit direction in (u, v) */
    float level[NC_GROUP];                          /* length in (u, v) */
    float slope[NC_GROUP], sine[NC_GROUP];          /* of w along it; 0 and ±1 where level is 0 */
    int chord[NC_GROUP];                            /* index in the group */
} NcLanes;

/* All chords of the group, for those parts that count. */
void nc_lanes_load(NcLanes *lanes, const NcGroup *group, const bool meets[NC_N_PARTS], int axis);

/* Those of `all` whose index is in `chosen`, ascending. */
void nc_lanes_choose(NcLanes *lanes, const NcLanes *all, uint64_t chosen);

/* For each lane an interval [low, high] of w, counted from the origin's, that holds all that `body`
 * sweeps on any ray within `half` of (u, v) along u and v; these too are counted from the origin.
 * Empty (low > high) where there is none. Of a ball on a single ray (half = 0) it is exact but for
 * rounding. */
void nc_lanes_bounds(const NcLanes *lanes, const NcToolBody *body, float u, float v, float half,
                     float *low, float *high);

/* For each lane how much of [in, out] its interval covers, kept where `overlap` is more already. */
void nc_lanes_overlap(const NcLanes *lanes, const float *low, const float *high, float in,
                      float out, float *overlap);

/* The lane whose interval covers most of [in, out], of nearly equal ones the first: greater for a
 * longer piece, and nc_lanes_lane of it is the lane; 0 where no interval covers any. */
int32_t nc_lanes_longest(const NcLanes *lanes, const float *low, const float *high, float in,
                         float out);

static inline int nc_lanes_lane(int32_t longest)
{
    return NC_GROUP - 1 - longest % NC_GROUP;
}

#endif
