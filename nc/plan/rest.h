/* SPDX-License-Identifier: Apache-2.0 */
/* Rest machining: what a wide tool leaves of a region beside finer neighbours. */
#ifndef NC_PLAN_REST_H
#define NC_PLAN_REST_H

#include "nc/plan/planner.h"

typedef struct {
    const CfgTool *tool;      /* for the region */
    const CfgTool *rest_tool; /* for the facets marked in `rest`; NULL where there are none */
    uint8_t *rest;            /* a byte for each facet of the region */
} NcAllotment;

/*
 * The tool that reaches all of a region is often narrow only because of a strip along a fillet of
 * the next region, which a finer tool cuts anyway. So `whole`, the tool for the whole region, is
 * weighed against every wider one of its kind with one of the `finer` tools (those of the
 * neighbours) for the facets that the wider one leaves: the shortest time wins, by at least
 * NC_REST_GAIN. Both together must suit the region as `whole` does (NC_SUITS).
 */
#define NC_REST_GAIN 0.05
NcAllotment nc_allot(const NcPlanner *planner, const NcRegion *region, const CfgTool *whole,
                     const CfgTool *const *finer, size_t n_finer);

#endif
