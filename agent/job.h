/* SPDX-License-Identifier: Apache-2.0 */
/* The steps that `segment`, `plan` and `run` share, in order: load, segment, plan, write. */
#ifndef AGENT_JOB_H
#define AGENT_JOB_H

#include "agent/agent.h"
#include "config/config.h"
#include "nc/nc.h"
#include "segcore/segcore.h"

typedef struct {
    CfgRecipe *recipe;
    CfgMachine *machine; /* NULL in `segment` */
    CfgToolTable *tools; /* NULL in `segment` */
    SegLoadOptions load; /* what the part was read with */
    SegPart *part;
    SegSegmentation *segmentation;
    NcPlan *plan;
    NcPlan *baseline; /* NULL where no single tool does */
    NcProgram *program;
    char *no_baseline;                         /* why there is none */
    GPtrArray *files;                          /* char *: names written to the folder */
    double read_s, segment_s, plan_s, write_s; /* wall time of the steps */
} AgentJob;

void agent_job_free(AgentJob *job);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(AgentJob, agent_job_free)

/* The file that `tools` came from. */
char *agent_job_tools_file(const AgentJob *job);

/* For `segment`: the defaults, with the command line's overrides, and the part. */
AgentJob *agent_job_for_part(const AgentOptions *options, GError **error);

/* For `plan`, `run` and `verify`: the recipe, machine, tools and the part. */
AgentJob *agent_job_for_recipe(const AgentOptions *options, GError **error);

bool agent_job_segment(AgentJob *job, GError **error);

/* The segmented job as nc takes it; progress is shown as that of `step`, which outlives it. */
NcPlanInput agent_job_input(const AgentJob *job, char *step);

/* Plan, baseline and program. */
bool agent_job_plan(AgentJob *job, GError **error);

/* regions.json, regions.png, regions.obj and, by feature size, local.igs and rest.igs. */
bool agent_job_write_regions(AgentJob *job, const char *folder, GError **error);

/* program.ngc and plan.json. */
bool agent_job_write_plan(AgentJob *job, const char *folder, GError **error);

/* What the steps took and wrote, into the --json object. */
void agent_job_describe(const AgentJob *job, AgentJson *result);

/* The same for the plan and its program. */
void agent_job_describe_plan(const AgentJob *job, AgentJson *result);

/* What the plan left or skipped, on stderr. */
void agent_job_show_notes(const AgentJob *job);

/* The recipe's parameters as segcore wants them; the arrays stay the recipe's. */
SegFeatureSizeParams agent_feature_size_params(const CfgRecipe *recipe);

#endif
