/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/execute.h"
#include "agent/job.h"
#include "agent/kept.h"
#include "agent/out/run_json.h"
#include "agent/preflight.h"
#include "agent/progress.h"
#include "agent/table.h"

#define DEFAULT_FOLDER "segmill-out"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_run = {
    .name = "run",
    .argument = "RECIPE",
    .synopsis = "RECIPE [--set KEY=VALUE …] [-o DIR] --to NAME [--accept-cautions]",
    .summary = "plan, deliver, verify, START and follow: the machine will move",
    .help =
        "Does what `plan` does, compares tools and work offsets with the machine's (pre-flight: a\n"
        "caution blocks the start, exit status 8), delivers the program, lets the machine verify\n"
        "it, starts it, and follows it to its end. To call this command is the explicit act of a "
        "person that a start\n"
        "needs. DIR also gets run.json: states, times of each region, alarms, holds. Ctrl-C asks\n"
        "for a hold, a second one for an abort. If the link is lost while running, the machine's\n"
        "state is UNKNOWN (exit status 7): look at the machine.\n\n"
        "NAME is looked up in --config FILE, else in $XDG_CONFIG_HOME/segmill/agent.ini, else in\n"
        "/etc/segmill/agent.ini; without any of them there is one machine, sim, at\n"
        "modbus://127.0.0.1:1502.",
    .out_help = "Folder of the results; " DEFAULT_FOLDER " where it is not given",
    .takes = AGENT_TAKES_OUT | AGENT_TAKES_SET | AGENT_TAKES_TO | AGENT_TAKES_ACCEPT |
             AGENT_TAKES_CONFIG,
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

/* Pre-flight, then the copy for a restart, then the machine. */
static bool start(const AgentOptions *options, const AgentJob *job, AgentExecution *execution,
                  GArray **findings, GError **error)
{
    const NcProgram *program = job->program;
    /* The description is the job's; only its file names are new. */
    AgentMachine machine = {job->recipe->machine_file, agent_job_tools_file(job), job->machine,
                            job->tools};
    AgentPreflight flight = {
        .program = program, .needs = execution->follow->program, .machine = &machine};
    *findings = agent_preflight(execution->link, &flight, error);
    return *findings && agent_preflight_allows(*findings, options->accept_cautions, error) &&
           agent_kept_store(program, machine.machine_file, machine.tools_file, error) &&
           agent_execute_deliver(execution, program->bytes, program->gates, program->n_gates,
                                 error) &&
           agent_preflight_again(execution->link, &flight, options->accept_cautions, findings,
                                 error) &&
           agent_execute_start(execution, NULL, error);
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
    AgentFollow follow;
    agent_follow_init(&follow, timed);
    AgentExecution execution = agent_execution(link, &follow, options->to);
    AgentRunReport report = {
        .program_sha256 = program->sha256, .machine = options->to, .follow = &follow};
    agent_run_begin(&report);
    g_autoptr(GArray) findings = NULL;
    g_autoptr(GError) ended = NULL;
    bool ok = start(options, job, &execution, &findings, &ended);
    link->status = NULL;
    report.error = ended;
    report.findings = findings;
    bool written =
        agent_run_write(&report, options->out ? options->out : DEFAULT_FOLDER, ok ? error : NULL);
    if (ok && written) {
        agent_preflight_write(findings, result);
        agent_run_describe(&report, result, options->json);
    }
    agent_run_end(&report);
    agent_follow_clear(&follow);
    if (!ok)
        g_propagate_error(error, g_steal_pointer(&ended));
    return ok && written;
}
