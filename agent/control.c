/* SPDX-License-Identifier: Apache-2.0 */
/* hold, resume, abort: one command to the machine each. */
#include <stdio.h>

#include "agent/link.h"

static bool run_hold(const AgentOptions *options, AgentJson *result, GError **error);
static bool run_resume(const AgentOptions *options, AgentJson *result, GError **error);
static bool run_abort(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_hold = {
    .name = "hold",
    .synopsis = "--to NAME",
    .summary = "ask a machine for a controlled hold",
    .help = "Anyone may ask for a hold. It is done when the machine has taken the request; how\n"
            "long the axes take to stop is the machine's affair. This is not an emergency stop.",
    .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_TO,
    .run = run_hold,
};

const AgentCommand agent_resume = {
    .name = "resume",
    .synopsis = "--to NAME",
    .summary = "go on after a hold or a program stop: the machine will move",
    .help =
        "Goes on where the machine holds or stopped for M0. It needs the lease: the same\n"
        "user's `segmill run` shares its own. Where that has ended nobody watches the machine,\n"
        "and it does what its on_agent_loss says: by default it holds at the next gate again.",
    .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_TO,
    .run = run_resume,
};

const AgentCommand agent_abort = {
    .name = "abort",
    .synopsis = "--to NAME",
    .summary = "ask a machine to end the run",
    .help = "Anyone may ask for an abort. It is done when the machine has taken the request;\n"
            "`segmill status` shows when it stands. This is not an emergency stop.",
    .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_TO,
    .run = run_abort,
};

static bool control(const AgentOptions *options, FbCommand command, AgentJson *result,
                    GError **error)
{
    g_autoptr(AgentLink) link = agent_link_open(options, error);
    if (!link || !agent_link_command(link, command, error) || !agent_link_wait_status(link, error))
        return false;
    const char *state = fb_state_name(fb_session_status(link->session)->state);
    agent_json_string(result, "state", state);
    if (!options->json)
        printf("%s taken; the machine is %s\n", fb_command_name(command), state);
    return true;
}

static bool run_hold(const AgentOptions *options, AgentJson *result, GError **error)
{
    return control(options, FB_COMMAND_HOLD, result, error);
}

static bool run_resume(const AgentOptions *options, AgentJson *result, GError **error)
{
    return control(options, FB_COMMAND_RESUME, result, error);
}

static bool run_abort(const AgentOptions *options, AgentJson *result, GError **error)
{
    return control(options, FB_COMMAND_ABORT, result, error);
}
