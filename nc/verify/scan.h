/* SPDX-License-Identifier: Apache-2.0 */
/* Closer looks than the survey's: profiles across the passes, and climbs to the worst place near.
 */
#ifndef NC_VERIFY_SCAN_H
#define NC_VERIFY_SCAN_H

#include "nc/verify/verifier.h"

/* A profile's pitch is this share of the narrowest step-over that it shows, or less. */
#define NC_PROFILE_SHARE 0.05

typedef struct {
    double pitch_mm;     /* 0: no move has cut here, so there is none */
    double stepover_mm;  /* between passes as the profile shows them; 0: it shows one pass alone */
    NcPlace top, bottom; /* its highest and lowest places */
    double top_mm, bottom_mm;
} NcProfile;

/*
 * The deviations along a line over the surface, through `middle` and across the pass that cut it,
 * one and a half step-overs long where the face is. It begins with the step-over that the recipe's
 * scallop allows the tool on a plane; where passes turn out to lie closer it is taken again with a
 * twentieth of that. `top` is the highest place that the region's tools reach, unless it has none.
 */
NcProfile nc_profile(const NcVerifier *verifier, size_t region, const NcPlace *middle);

typedef enum { NC_CLIMB_EXCESS, NC_CLIMB_GOUGE } NcClimb;

/*
 * From a place to the greatest excess or gouge near it, by steps in two directions that begin at
 * `step_mm` and are halved down to 1/64 of it (a compass search: Kolda, Lewis, Torczon 2003).
 * Towards excess only places that region's tools reach are stepped on.
 */
NcWorst nc_climb(const NcVerifier *verifier, size_t region, const NcPlace *from, NcClimb towards,
                 double step_mm);

#endif
