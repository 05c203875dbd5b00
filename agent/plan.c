/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/job.h"
#include "agent/table.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_plan = {
    .name = "plan",
    .argument = "RECIPE",
    .synopsis = "RECIPE [--set KEY=VALUE …] -o DIR",
    .summary = "plan every region's tool and toolpath, and write one program",
    .help =
        "Writes into DIR: program.ngc (RS-274/NGC), plan.json (tools, feeds, lengths, times, and\n"
        "the saving against the best plan of the whole part with one tool), and what `segment`\n"
        "writes. The same recipe and files give the same bytes.",
    .out_help = "Folder of the results; made where it is missing",
    .takes = AGENT_TAKES_OUT | AGENT_TAKES_SET,
    .needs = AGENT_TAKES_OUT,
    .run = run,
};

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentJob) job = agent_job_for_recipe(options, error);
    if (!job || !agent_job_segment(job, error) || !agent_job_plan(job, error) ||
        !agent_job_write_regions(job, options->out, error) ||
        !agent_job_write_plan(job, options->out, error))
        return false;
    agent_job_describe(job, result);
    agent_job_describe_plan(job, result);
    agent_job_show_notes(job);
    if (!options->json)
        agent_table_plan(job->plan, job->baseline);
    return true;
}
