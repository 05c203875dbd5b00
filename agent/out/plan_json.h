/* SPDX-License-Identifier: Apache-2.0 */
/* plan.json: docs/schema/plan.json. */
#ifndef AGENT_OUT_PLAN_JSON_H
#define AGENT_OUT_PLAN_JSON_H

#include "nc/nc.h"

/* What the plan saves of the baseline's time: 100(1 - T/T_baseline), and how much faster it is:
 * 100(T_baseline/T - 1). NAN where there is no baseline. */
double agent_saving_percent(const NcPlan *plan, const NcPlan *baseline);
double agent_speedup_percent(const NcPlan *plan, const NcPlan *baseline);

/* The text; `baseline` may be NULL. Caller frees. */
char *agent_plan_json(const NcPlan *plan, const NcPlan *baseline, const NcProgram *program);

#endif
