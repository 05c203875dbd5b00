/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/verify_json.h"

#include "agent/out/json.h"

static void write_judgement(AgentJson *json, const NcJudgement *judgement, double tolerance_mm);
static void write_collisions(AgentJson *json, const GArray *collisions);

char *agent_verify_json(const NcVerdict *verdict, const CfgRecipe *recipe, const SegPart *part,
                        const char *program_sha256)
{
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_string(json, "program_sha256", program_sha256);
    agent_json_string(json, "part_sha256", part->sha256);
    agent_json_bool(json, "in_tolerance", verdict->in_tolerance);
    agent_json_number(json, "gouge_limit_mm", verdict->gouge_limit_mm);
    agent_json_number(json, "excess_limit_mm", verdict->excess_limit_mm);
    agent_json_number(json, "stock_to_leave_mm", recipe->stock_to_leave_mm);
    write_judgement(json, &verdict->whole, recipe->tolerance_mm);
    agent_json_array(json, "regions");
    for (size_t i = 0; i < verdict->n_regions; i++) {
        agent_json_object(json, NULL);
        agent_json_integer(json, "id", verdict->regions[i].region);
        write_judgement(json, &verdict->regions[i], recipe->tolerance_mm);
        agent_json_end(json);
    }
    agent_json_end(json);
    write_collisions(json, verdict->collisions);
    agent_json_number(json, "collision_pitch_mm", verdict->collision_pitch_mm);
    agent_json_number(json, "cut_s", verdict->cut_s);
    return agent_json_finish(json);
}

static void write_position(AgentJson *json, SegVec3 p)
{
    agent_json_numbers(json, "position", (const double[]){p.x, p.y, p.z}, 3);
}

/* null where there is nothing of the kind. */
static void write_worst(AgentJson *json, const char *key, const NcWorst *worst)
{
    if (worst->depth_mm <= 0) {
        agent_json_string(json, key, NULL);
        return;
    }
    agent_json_object(json, key);
    if (worst->line > 0)
        agent_json_integer(json, "line", worst->line);
    else
        agent_json_string(json, "line", NULL);
    write_position(json, worst->point);
    agent_json_end(json);
}

static void write_judgement(AgentJson *json, const NcJudgement *judgement, double tolerance_mm)
{
    agent_json_number(json, "gouge_max_mm", judgement->gouge_max.depth_mm);
    write_worst(json, "gouge_at", &judgement->gouge_max);
    agent_json_number(json, "excess_max_mm", judgement->excess_max.depth_mm);
    write_worst(json, "excess_at", &judgement->excess_max);
    agent_json_number(json, "excess_p99_mm", judgement->excess_p99_mm);
    agent_json_number(json, "tolerance_mm", tolerance_mm);
    agent_json_number(json, "requested_area_mm2", judgement->requested_area_mm2);
    agent_json_number(json, "unreachable_area_mm2", judgement->unreachable_area_mm2);
    agent_json_number(json, "coverage_percent", judgement->coverage_percent);
    agent_json_number(json, "within_tolerance_percent", judgement->within_tolerance_percent);
    agent_json_object(json, "sampling");
    agent_json_integer(json, "spots", (int64_t)judgement->n_spots);
    agent_json_number(json, "survey_pitch_mm", judgement->survey_pitch_mm);
    agent_json_integer(json, "profiles", (int64_t)judgement->n_profiles);
    agent_json_number(json, "profile_pitch_mm", judgement->profile_pitch_mm);
    agent_json_number(json, "stepover_mm", judgement->stepover_mm);
    agent_json_number(json, "profile_pitch_share", judgement->pitch_share);
    agent_json_end(json);
}

static void write_collisions(AgentJson *json, const GArray *collisions)
{
    agent_json_array(json, "collisions");
    for (guint i = 0; i < collisions->len; i++) {
        const NcCollision *collision = &g_array_index(collisions, NcCollision, i);
        agent_json_object(json, NULL);
        agent_json_integer(json, "line", collision->line);
        agent_json_string(json, "kind", nc_collision_name(collision->kind));
        write_position(json, collision->position);
        agent_json_number(json, "depth_mm", collision->depth_mm);
        agent_json_end(json);
    }
    agent_json_end(json);
}
