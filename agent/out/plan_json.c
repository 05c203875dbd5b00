/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/plan_json.h"

#include <math.h>

#include "agent/out/json.h"

static void write_operation(AgentJson *json, const NcOperation *operation);
static void write_baseline(AgentJson *json, const NcPlan *baseline);

double agent_saving_percent(const NcPlan *plan, const NcPlan *baseline)
{
    return baseline ? 100 * (1 - plan->estimated_s / baseline->estimated_s) : NAN;
}

double agent_speedup_percent(const NcPlan *plan, const NcPlan *baseline)
{
    return baseline ? 100 * (baseline->estimated_s / plan->estimated_s - 1) : NAN;
}

char *agent_plan_json(const NcPlan *plan, const NcPlan *baseline, const NcProgram *program)
{
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_string(json, "program_sha256", program->sha256);
    agent_json_number(json, "estimated_s", plan->estimated_s);
    agent_json_number(json, "length_mm", plan->length_mm);
    agent_json_number(json, "air_mm", plan->air_mm);
    agent_json_integer(json, "reversals", plan->reversals);
    agent_json_integer(json, "tool_changes", plan->tool_changes);
    agent_json_array(json, "regions");
    for (size_t i = 0; i < plan->n_operations; i++)
        write_operation(json, &plan->operations[i]);
    agent_json_end(json);
    write_baseline(json, baseline);
    agent_json_number(json, "saving_percent", agent_saving_percent(plan, baseline));
    agent_json_number(json, "speedup_percent", agent_speedup_percent(plan, baseline));
    return agent_json_finish(json);
}

static void write_operation(AgentJson *json, const NcOperation *operation)
{
    agent_json_object(json, NULL);
    agent_json_integer(json, "id", operation->region);
    agent_json_string(json, "strategy", nc_strategy_name(operation->strategy));
    agent_json_integer(json, "tool", operation->tool->number);
    agent_json_number(json, "tool_diameter_mm", operation->tool->diameter_mm);
    agent_json_number(json, "feed_mm_min", operation->feed_mm_min);
    agent_json_number(json, "spindle_rpm", operation->spindle_rpm);
    agent_json_number(json, "stepover_mm", operation->stepover_mm);
    agent_json_number(json, "length_mm", operation->length_mm);
    agent_json_integer(json, "reversals", operation->reversals);
    agent_json_number(json, "estimated_s", operation->estimated_s);
    agent_json_number(json, "requested_area_mm2", operation->requested_area_mm2);
    agent_json_number(json, "unreachable_area_mm2", operation->unreachable_area_mm2);
    agent_json_end(json);
}

static void write_baseline(AgentJson *json, const NcPlan *baseline)
{
    if (!baseline || baseline->n_operations == 0) {
        agent_json_string(json, "baseline", NULL);
        return;
    }
    const NcOperation *operation = &baseline->operations[0];
    agent_json_object(json, "baseline");
    agent_json_string(json, "method", "none");
    agent_json_string(json, "strategy", nc_strategy_name(operation->strategy));
    agent_json_number(json, "tool_diameter_mm", operation->tool->diameter_mm);
    agent_json_number(json, "length_mm", baseline->length_mm);
    agent_json_integer(json, "reversals", baseline->reversals);
    agent_json_number(json, "estimated_s", baseline->estimated_s);
    agent_json_end(json);
}
