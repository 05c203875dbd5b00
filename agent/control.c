/* SPDX-License-Identifier: Apache-2.0 */
/* hold, resume, abort, override, optional-stop: one command to the machine each. */
#include <stdio.h>
#include <string.h>

#include "agent/execute.h"
#include "agent/kept.h"
#include "agent/progress.h"
#include "agent/token.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_controls[AGENT_N_CONTROLS] = {
    [AGENT_HOLD] =
        {
            .name = "hold",
            .synopsis = "--to NAME",
            .summary = "ask a machine for a controlled hold",
            .help =
                "Anyone may ask for a hold. It is done when the machine has taken the request;\n"
                "how long the axes take to stop is the machine's affair. This is not an\n"
                "emergency stop.",
            .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
            .needs = AGENT_TAKES_TO,
            .run = run,
        },
    [AGENT_RESUME] =
        {
            .name = "resume",
            .synopsis = "--to NAME [--no-follow]",
            .summary = "go on after a hold or a program stop: the machine will move",
            .help =
                "Goes on where the machine holds or stopped for M0 or M1, and follows the run to\n"
                "its end as `run` does: Ctrl-C asks for a hold, a second one for an abort. It\n"
                "needs the lease: the same user's `segmill run` shares its own. With --no-follow\n"
                "it returns at once; where no other segmill is at work with the machine nobody\n"
                "watches it then, and it does what its on_agent_loss says: by default it holds\n"
                "at the next gate again.",
            .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG | AGENT_TAKES_NO_FOLLOW,
            .needs = AGENT_TAKES_TO,
            .run = run,
        },
    [AGENT_ABORT] =
        {
            .name = "abort",
            .synopsis = "--to NAME",
            .summary = "ask a machine to end the run",
            .help =
                "Anyone may ask for an abort. It is done when the machine has taken the request;\n"
                "`segmill status` shows when it stands. This is not an emergency stop.",
            .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
            .needs = AGENT_TAKES_TO,
            .run = run,
        },
    [AGENT_OVERRIDE] =
        {
            .name = "override",
            .synopsis = "[--feed N] [--rapid N] [--spindle N] --to NAME",
            .summary = "change feed, rapids or spindle, in percent of the program's",
            .help = "What is not named stays as it is. An override holds over runs and programs,\n"
                    "until it is changed again. With --feed 0 the machine stands where it feeds.\n"
                    "It needs the lease: the same user's `segmill run` shares its own.",
            .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG | AGENT_TAKES_PERCENT,
            .needs = AGENT_TAKES_TO | AGENT_TAKES_PERCENT,
            .run = run,
        },
    [AGENT_OPTIONAL_STOP] =
        {
            .name = "optional-stop",
            .argument = "on|off",
            .synopsis = "on|off --to NAME",
            .summary = "turn the switch that M1 asks for",
            .help =
                "While it is on, the machine stops at each M1 until `segmill resume`. It needs\n"
                "the lease: the same user's `segmill run` shares its own.",
            .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
            .needs = AGENT_TAKES_TO,
            .run = run,
        },
};

static const FbCommand requests[AGENT_N_CONTROLS] = {
    [AGENT_HOLD] = FB_COMMAND_HOLD,
    [AGENT_RESUME] = FB_COMMAND_RESUME,
    [AGENT_ABORT] = FB_COMMAND_ABORT,
    [AGENT_OVERRIDE] = FB_COMMAND_OVERRIDE,
    [AGENT_OPTIONAL_STOP] = FB_COMMAND_OPTIONAL_STOP,
};

static bool find_arguments(const AgentOptions *options, FbCommand command, AgentLink *link,
                           FbArguments *arguments, GError **error);
static AgentProgram *read_program(AgentLink *link);
static void wait_for_lease(AgentLink *link);
static bool follow(const AgentOptions *options, AgentLink *link, const AgentProgram *program,
                   AgentJson *result, GError **error);
static void describe(const FbStatus *status, FbCommand command, const AgentOptions *options,
                     AgentJson *result);

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    const FbCommand command = requests[options->command - agent_controls];
    const bool stays = command == FB_COMMAND_RESUME && !options->no_follow;
    FbArguments arguments = {0};
    g_autoptr(AgentLink) link = agent_link_open(options, error);
    if (!link || !find_arguments(options, command, link, &arguments, error))
        return false;
    g_autoptr(AgentProgram) program = NULL;
    if (stays) {
        /* Before the machine moves: reading takes time in which nobody would beat. */
        if (!agent_link_wait_status(link, error))
            return false;
        program = read_program(link);
        wait_for_lease(link);
    }
    if (!agent_link_command(link, command, &arguments, error) ||
        !agent_link_wait_status(link, error))
        return false;
    if (stays && !follow(options, link, program, result, error))
        return false;
    describe(fb_session_status(link->session), command, options, result);
    return true;
}

/* ------------------------------------------------------------------- arguments */

static bool find_arguments(const AgentOptions *options, FbCommand command, AgentLink *link,
                           FbArguments *arguments, GError **error)
{
    if (command == FB_COMMAND_OPTIONAL_STOP) {
        arguments->optional_stop = strcmp(options->argument, "on") == 0;
        if (arguments->optional_stop || strcmp(options->argument, "off") == 0)
            return true;
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE, "'%s' is neither on nor off",
                    options->argument);
        return false;
    }
    if (command != FB_COMMAND_OVERRIDE)
        return true;
    if (!agent_link_wait_status(link, error))
        return false;
    const FbStatus *status = fb_session_status(link->session);
    arguments->feed_percent = options->feed_percent >= 0 ? (uint16_t)options->feed_percent
                                                         : status->feed_override_percent;
    arguments->rapid_percent = options->rapid_percent >= 0 ? (uint16_t)options->rapid_percent
                                                           : status->rapid_override_percent;
    arguments->spindle_percent = options->spindle_percent >= 0 ? (uint16_t)options->spindle_percent
                                                               : status->spindle_override_percent;
    return true;
}

/* ---------------------------------------------------------------------- follow */

/* The program that the machine holds, timed, where its copy and description are there: a run can
 * be watched without, but then nobody knows how far it is. */
static AgentProgram *read_program(AgentLink *link)
{
    const FbStatus *status = fb_session_status(link->session);
    g_autoptr(GError) error = NULL;
    g_autoptr(AgentKept) kept = agent_kept_load(status->id, &error);
    const char *tools_file = NULL;
    const char *file =
        kept ? agent_kept_machine_file(kept, NULL, link->target.machine_file, &tools_file) : NULL;
    g_autoptr(AgentMachine) machine = file ? agent_machine_load(file, tools_file, &error) : NULL;
    AgentProgram *program = NULL;
    if (machine)
        program = agent_program_read(kept->program->bytes, kept->program->sha256, machine->machine,
                                     machine->tools, &error);
    if (!program)
        agent_progress_note("how far the run is will not be shown: %s",
                            error ? error->message : "no description of the machine is known");
    return program;
}

/* The lease of this user's own process that died: nobody beats for it, and only when it has lapsed
 * can this process take it and keep the machine's agent alive. */
static bool is_orphaned(const FbStatus *status)
{
    return status->state != FB_STATE_UNKNOWN && status->agent_lost && !status->needs_acknowledge &&
           status->lease_owner == (uint32_t)(agent_token() >> 32);
}

static void wait_for_lease(AgentLink *link)
{
    const FbStatus *status = fb_session_status(link->session);
    if (is_orphaned(status))
        agent_progress_note("waiting %.0f s for the lease of the process that died",
                            status->lease_ms * 1e-3);
    while (is_orphaned(status))
        g_main_context_iteration(link->context, true);
}

static bool follow(const AgentOptions *options, AgentLink *link, const AgentProgram *program,
                   AgentJson *result, GError **error)
{
    AgentFollow record;
    AgentExecution execution = agent_execution(link, program ? &record : NULL, options->to);
    if (program) {
        agent_follow_init(&record, program);
        agent_follow_join(&record, fb_session_status(link->session));
    }
    bool ok = agent_execute_watch(&execution, error);
    if (program)
        agent_follow_clear(&record);
    agent_json_string(result, "outcome", "complete");
    return ok;
}

/* -------------------------------------------------------------------- describe */

static void describe(const FbStatus *status, FbCommand command, const AgentOptions *options,
                     AgentJson *result)
{
    const char *state = fb_state_name(status->state);
    agent_json_string(result, "state", state);
    if (command == FB_COMMAND_OVERRIDE) {
        agent_json_integer(result, "feed_percent", status->feed_override_percent);
        agent_json_integer(result, "rapid_percent", status->rapid_override_percent);
        agent_json_integer(result, "spindle_percent", status->spindle_override_percent);
    }
    if (command == FB_COMMAND_OPTIONAL_STOP)
        agent_json_bool(result, "optional_stop", status->optional_stop);
    if (options->json)
        return;
    printf("%s taken; the machine is %s\n", fb_command_name(command), state);
    if (command == FB_COMMAND_OVERRIDE)
        printf("feed %u %%, rapids %u %%, spindle %u %%\n", status->feed_override_percent,
               status->rapid_override_percent, status->spindle_override_percent);
}
