/* SPDX-License-Identifier: Apache-2.0 */
/* Which tool a region gets, and how fast it turns and moves. */
#ifndef NC_PLAN_TECHNOLOGY_H
#define NC_PLAN_TECHNOLOGY_H

#include "nc/plan/planner.h"

/* A tool suits a region when it leaves at most this share of it more than the best tool does, and,
 * of what no tip may touch lest it goes below the part, at most the second: a smaller tool would
 * gain no more there than a strip. */
#define NC_SUITS 0.01
#define NC_SUITS_FLOOR 0.1

/*
 * The tool for a region: of the tools that suit it by their reach and their kind (flat ends only
 * where the ground is level or a wall), and whose corner is not larger than the smallest concave
 * radius where there are such, the one that finishes it soonest: step-over for the scallop height
 * times feed. Of one kind of tool that is the largest. The first of the table where no tool reaches
 * anything.
 */
const CfgTool *nc_technology_tool(const NcPlanner *planner, const NcRegion *region);

/* The one tool for all regions: it suits each of them, or, where none does, leaves least. */
const CfgTool *nc_technology_one_tool(const NcPlanner *planner, NcRegion *const *regions,
                                      size_t n_regions, const NcRegion *whole);

/* What one tool reaches; `reached` as of nc_reach, may be NULL. */
NcReach nc_technology_reach(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                            uint8_t *reached);

/* Seconds of cutting over the samples marked in `reached`, for passes that lie worst: along the
 * slope; INFINITY where none is. */
double nc_technology_time_s(const NcPlanner *planner, const NcRegion *region, const CfgTool *tool,
                            const uint8_t *reached);

/*
 * Spindle n = 1000·vc / (π·D) within the spindle's range, feed n·z·fz within the axes' speeds, by
 * the recipe's material, whole numbers; plunge 0.4 of the feed. `wish` (may be NULL) overrides. A
 * material the tool has no data for is NC_ERROR_PLAN.
 */
bool nc_technology_cutting(const NcPlanner *planner, const CfgRegion *wish, NcOperation *operation,
                           GError **error);

/* Refuses stock that is thicker, at right angles to the surface, than the tool may take. */
bool nc_technology_depth(const NcPlanner *planner, const NcOperation *operation, GError **error);

#endif
