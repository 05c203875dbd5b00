/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_PLAN_ESTIMATE_H
#define NC_PLAN_ESTIMATE_H

#include "nc/nc.h"

/* Fills in lengths, air and reversals of an operation from its path. */
void nc_estimate_lengths(NcOperation *operation);

/* Seconds of one operation by itself, without its tool change. */
double nc_estimate_operation_s(const NcOperation *operation, const CfgRecipe *recipe,
                               const CfgMachine *machine, double blend_mm);

/* Times and sums of the whole plan, tool changes and ways between operations included; the time of
 * a tool change counts for the operation that it precedes. */
void nc_estimate_plan(NcPlan *plan, const CfgRecipe *recipe, const CfgMachine *machine);

#endif
