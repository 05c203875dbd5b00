/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "agent/execute.h"
#include "agent/job.h"
#include "agent/out/file.h"
#include "agent/out/run_json.h"
#include "agent/progress.h"
#include "agent/table.h"

#define DEFAULT_FOLDER "segmill-out"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_run = {
    .name = "run",
    .argument = "RECIPE",
    .synopsis = "RECIPE [--set KEY=VALUE …] [-o DIR] --to NAME",
    .summary = "plan, deliver, verify, START and follow: the machine will move",
    .help =
        "Does what `plan` does, delivers the program, lets the machine verify it, starts it, and\n"
        "follows it to its end. To call this command is the explicit act of a person that a start\n"
        "needs. DIR also gets run.json: states, times of each region, alarms, holds. Ctrl-C asks\n"
        "for a hold, a second one for an abort. If the link is lost while running, the machine's\n"
        "state is UNKNOWN (exit status 7): look at the machine.\n\n"
        "NAME is looked up in --config FILE, else in $XDG_CONFIG_HOME/segmill/agent.ini, else in\n"
        "/etc/segmill/agent.ini; without any of them there is one machine, sim, at\n"
        "modbus://127.0.0.1:1502.",
    .out_help = "Folder of the results; " DEFAULT_FOLDER " where it is not given",
    .takes = AGENT_TAKES_OUT | AGENT_TAKES_SET | AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_TO,
    .run = run,
};

static bool ready(const AgentOptions *options, GError **error);
static bool execute(const AgentOptions *options, const AgentJob *job, AgentJson *result,
                    GError **error);

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    const char *folder = options->out ? options->out : DEFAULT_FOLDER;
    g_autoptr(AgentJob) job = agent_job_for_recipe(options, error);
    /* Before the work of planning: whether there is a machine that would take the program. */
    if (!job || !ready(options, error) || !agent_job_segment(job, error) ||
        !agent_job_plan(job, error) || !agent_job_write_regions(job, folder, error) ||
        !agent_job_write_plan(job, folder, error))
        return false;
    agent_job_show_notes(job);
    agent_job_describe(job, result);
    agent_job_describe_plan(job, result);
    if (!options->json)
        agent_table_plan(job->plan, job->baseline);
    return execute(options, job, result, error);
}

static bool ready(const AgentOptions *options, GError **error)
{
    agent_progress_step("looking for the machine");
    g_autoptr(AgentLink) link = agent_link_open(options, error);
    bool is_ready = link && agent_link_wait_ready(link, error);
    agent_progress_end();
    return is_ready;
}

static bool write_report(const AgentOptions *options, const AgentJob *job, const char *started,
                         const AgentFollow *follow, const GError *ended, GError **error)
{
    AgentRunReport report = {.program_sha256 = job->program->sha256,
                             .machine = options->to,
                             .started = started,
                             .error = ended,
                             .follow = follow};
    g_autofree char *text = agent_run_json(&report);
    return agent_file_write(options->out ? options->out : DEFAULT_FOLDER, "run.json", text,
                            strlen(text), error);
}

static void describe(const AgentFollow *follow, AgentJson *result, bool json)
{
    agent_json_string(result, "outcome", agent_run_outcome(NULL));
    agent_json_integer(result, "blocks", (int64_t)follow->blocks);
    agent_json_number(result, "planned_s", follow->program->total_s);
    agent_json_number(result, "actual_s", follow->actual_s);
    if (!json)
        printf("done: %.1f s machine time (planned %.1f s), %" G_GUINT64_FORMAT " blocks\n",
               follow->actual_s, follow->program->total_s, follow->blocks);
}

static bool execute(const AgentOptions *options, const AgentJob *job, AgentJson *result,
                    GError **error)
{
    const NcProgram *program = job->program;
    g_autoptr(AgentProgram) timed =
        agent_program_read(program->bytes, "program.ngc", job->machine, job->tools, error);
    g_autoptr(AgentLink) link = timed ? agent_link_open(options, error) : NULL;
    if (!link)
        return false;
    g_autoptr(GDateTime) now = g_date_time_new_now_utc();
    g_autofree char *started = g_date_time_format_iso8601(now);
    AgentFollow follow;
    agent_follow_init(&follow, timed);
    AgentExecution execution = {.link = link,
                                .follow = &follow,
                                .start_us = g_get_monotonic_time(),
                                .state = FB_N_STATES,
                                .name = options->to};
    g_autoptr(GError) ended = NULL;
    bool ok = agent_execute_deliver(&execution, program->bytes, program->gates, program->n_gates,
                                    &ended) &&
              agent_execute_start(&execution, &ended);
    link->status = NULL;
    bool written = write_report(options, job, started, &follow, ended, ok ? error : NULL);
    if (ok && written)
        describe(&follow, result, options->json);
    agent_follow_clear(&follow);
    if (!ok)
        g_propagate_error(error, g_steal_pointer(&ended));
    return ok && written;
}
