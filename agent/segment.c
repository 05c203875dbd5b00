/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/job.h"
#include "agent/table.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_segment = {
    .name = "segment",
    .argument = "PART",
    .synopsis = "PART [--method M] [--set KEY=VALUE …] -o DIR",
    .summary = "divide a part into machining regions",
    .help =
        "Reads IGES, STEP, STL or OFF and writes into DIR: regions.json (the regions: faces,\n"
        "loops, areas, sizes), regions.png (a picture), regions.obj (the tessellation, a group a\n"
        "region) and, with the method feature-size, local.igs and rest.igs. A mesh has one face,\n"
        "so its method is none. The keys of --set are those of a recipe's [segmentation], [part]\n"
        "and [quality].",
    .out_help = "Folder of the results; made where it is missing",
    .takes = AGENT_TAKES_OUT | AGENT_TAKES_METHOD | AGENT_TAKES_SET,
    .needs = AGENT_TAKES_OUT,
    .run = run,
};

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentJob) job = agent_job_for_part(options, error);
    if (!job || !agent_job_segment(job, error) ||
        !agent_job_write_regions(job, options->out, error))
        return false;
    agent_job_describe(job, result);
    if (!options->json)
        agent_table_regions(job->segmentation);
    return true;
}
