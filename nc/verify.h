/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Part of nc/nc.h, which others include: what a program makes of the stock, against the CAD faces.
 * Workpiece coordinates, lengths in mm, times in s.
 *
 * A deviation is measured at a point of a CAD face, along its outward normal, to the surface of the
 * cut part; recipe.stock_to_leave_mm is taken off. Positive: excess, negative: gouge. It is exact
 * at the point (nc/stock/probe.h); which points are looked at is said in docs/verify.md. Nothing is
 * looked for further than NC_VERIFY_MOST_MM: a deviation that large is at least that.
 */
#ifndef NC_VERIFY_H
#define NC_VERIFY_H

#include "nc/gcode.h"
#include "nc/stock.h"

#define NC_VERIFY_MOST_MM 10.0

/* A point of the survey: an even sample of the faces. */
typedef struct {
    SegVec3 point, normal; /* the normal points out of the part */
    int32_t triangle;      /* of the part's tessellation, at the point */
    int32_t region;        /* id; 0: nobody asked for it (kept out, skipped, in no region) */
    bool reached;          /* the plan's tool for the region can touch it */
    double area_mm2;       /* it stands for */
    double deviation_mm;
} NcSpot;

typedef struct {
    double depth_mm; /* >= 0 */
    SegVec3 point;
    uint32_t line; /* of the block that made it; 0: none, stock is left */
} NcWorst;

/* One region, or the whole part. */
typedef struct {
    int32_t region;     /* id; 0: the whole part */
    NcWorst gouge_max;  /* wherever it is */
    NcWorst excess_max; /* of what can be reached, as all that follows but coverage */
    double excess_p99_mm;
    double requested_area_mm2;
    double unreachable_area_mm2;     /* that the plan's tools cannot touch */
    double coverage_percent;         /* of the requested: no more than the excess limit is left */
    double within_tolerance_percent; /* of the requested less unreachable: within both limits */
    size_t n_spots, n_profiles;
    double survey_pitch_mm;  /* of the spots: one for each square of this side */
    double profile_pitch_mm; /* widest along a profile, across the passes; 0: there is none */
    double stepover_mm;      /* median of those that profiles show; NAN: none, or the whole part */
    double pitch_share;      /* greatest of pitch / step-over, each of the same profile */
} NcJudgement;

typedef struct {
    double gouge_limit_mm;  /* quality.tolerance_mm */
    double excess_limit_mm; /* quality.scallop_mm + quality.tolerance_mm */
    NcJudgement whole;
    NcJudgement *regions; /* those asked for, in the segmentation's order */
    size_t n_regions;
    NcSpot *spots;
    size_t n_spots;
    GArray *collisions;        /* NcCollision, by line */
    double collision_pitch_mm; /* of the stock they were found with */
    double cut_s;              /* the machine's time of G1, G2 and G3 */
    bool in_tolerance;         /* both limits hold everywhere, and nothing collides */
} NcVerdict;

/*
 * Judges a program, placed by the recipe's setup and work offset. Regions and what can be reached
 * come from the recipe as the plan takes them, not from the program. Does not depend on the number
 * of threads. Errors: as nc_plan_new, as nc_stock_cut.
 */
NcVerdict *nc_verify(const NcPlanInput *input, const NcMove *moves, size_t n, GError **error);
void nc_verdict_free(NcVerdict *verdict);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcVerdict, nc_verdict_free)

#endif
