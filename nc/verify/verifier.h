/* SPDX-License-Identifier: Apache-2.0 */
/* What every step of judging reads; made once for a program. */
#ifndef NC_VERIFY_VERIFIER_H
#define NC_VERIFY_VERIFIER_H

#include "nc/plan/planner.h"
#include "nc/stock/probe.h"
#include "nc/verify/thickness.h"

typedef struct {
    const NcPlanInput *input;
    const NcMove *moves;
    NcPlanner planner;
    NcSurface *surface;
    NcThickness *thickness;
    NcProbing *probing;
    NcStock *stock;             /* before the first cut, until collisions are looked for */
    double pitch_mm;            /* of the stock */
    SegVec3 zero;               /* the work zero in machine coordinates of the gauge point */
    int32_t *zones;             /* of each triangle: the region's id, 0 where nobody asked for it */
    const CfgTool *(*tools)[2]; /* of each region of the segmentation */
    double excess_limit_mm, gouge_limit_mm;
} NcVerifier;

/* Deviation of the cut part at a place; `move` (may be NULL) as NcProbed has it. */
double nc_verifier_measure(const NcVerifier *verifier, const NcPlace *place, size_t *move);

/* Can a tool of the plan for that region (index in the segmentation) touch the place? */
bool nc_verifier_reaches(const NcVerifier *verifier, size_t region, const NcPlace *place);

/* The work zero of the move's tool tip in machine coordinates of the gauge point. */
SegVec3 nc_verifier_offset(const NcVerifier *verifier, const NcMove *move);

/* The line of the program that a move comes from; 0 for NC_PROBING_UNCUT. */
uint32_t nc_verifier_line(const NcVerifier *verifier, size_t move);

/* The deeper one stays. */
void nc_worst_take(NcWorst *worst, NcWorst other);

#endif
