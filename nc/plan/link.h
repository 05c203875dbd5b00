/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_PLAN_LINK_H
#define NC_PLAN_LINK_H

#include "nc/toolpath/trace.h"

/* Rapid moves keep this far from the stock (the part grown by the allowance), on all sides. */
#define NC_SAFETY_MM 0.5

typedef struct {
    const NcTrace *trace;
    double allowance_mm;
    double clearance_mm; /* Z of the way to and from other operations, tool's own tip */
    double direct_mm;    /* ends no further apart are joined along the surface */
} NcLinker;

/*
 * Joins ordered pieces into one toolpath, from clearance to clearance: down by rapid as far as the
 * stock allows, on by a lead, a quarter circle into the direction of cutting where there is room
 * for it, else straight down; to a near piece along the surface at feed, to any other over the
 * least height that is clear for tool and holder. Locations are the tips of the tool itself.
 */
NcToolpath nc_link(const NcLinker *linker, const GArray *pieces);

#endif
