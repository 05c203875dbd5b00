/* SPDX-License-Identifier: Apache-2.0 */
/* What every step of planning reads; made once for a plan. */
#ifndef NC_PLAN_PLANNER_H
#define NC_PLAN_PLANNER_H

#include "nc/toolpath/strategy.h"

typedef struct {
    const NcPlanInput *input;
    NcSetup setup;
    NcBudget budget;
    NcTerrain *terrain;
    double floor_mm;     /* lowest tip: the bottom of the part */
    double clearance_mm; /* Z of ways between operations */
    GPtrArray *notes;
} NcPlanner;

/* NC_ERROR_PLAN where part, tools and recipe do not go together; nothing is to be cleared then. */
bool nc_planner_init(NcPlanner *planner, const NcPlanInput *input, GError **error);
void nc_planner_clear(NcPlanner *planner);

/* The tools that a plan gives each region of the segmentation: for most of it and for its rest;
 * NULL for none. */
bool nc_planner_allot(const NcPlanner *planner, const CfgTool *(*tools)[2], GError **error);

/* The tools the recipe lets the planner use, ascending by number; GPtrArray of const CfgTool *. */
GPtrArray *nc_planner_tools(const NcPlanner *planner, GError **error);

/* "tool 3 (ball Ø6)", for messages; caller frees. */
char *nc_planner_tool_name(const CfgTool *tool);

/* Cuts one region with the operation's tool, feed and spindle: strategy, order, links, time. What
 * the passes leave of the `reached` samples is added to unreachable_area_mm2. The path is empty
 * where nothing was touched. */
bool nc_planner_cut(const NcPlanner *planner, const NcRegion *region, const uint8_t *reached,
                    const CfgRegion *wish, NcOperation *operation, GError **error);

#endif
