/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>

#include "agent/execute.h"
#include "agent/kept.h"
#include "agent/preflight.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_send = {
    .name = "send",
    .argument = "PROGRAM",
    .synopsis = "PROGRAM --to NAME [--start] [--accept-cautions] [--machine FILE]",
    .summary = "deliver a program and let the machine verify it; without --start nothing moves",
    .help =
        "Delivers the bytes of any program. Its gates, the places where the tool is clear of the\n"
        "part, are found with the machine's description: --machine, or the file that the agent's\n"
        "configuration names for the machine. Without one the only gate is the program's end.\n"
        "The pre-flight compares tools, work offsets and memory with the machine's; a caution\n"
        "blocks the delivery, as a button may start what is delivered. With --start the program\n"
        "is started and followed, as by `run`.",
    .takes = AGENT_TAKES_TO | AGENT_TAKES_START | AGENT_TAKES_ACCEPT | AGENT_TAKES_MACHINE |
             AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_TO,
    .run = run,
};

/* What is to be delivered. */
typedef struct {
    NcProgram *program;
    AgentMachine *machine; /* NULL without a description */
    AgentProgram *timed;   /* NULL together with it */
} Load;

static void load_clear(Load *load)
{
    g_clear_pointer(&load->program, nc_program_free);
    g_clear_pointer(&load->timed, agent_program_free);
    g_clear_pointer(&load->machine, agent_machine_free);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Load, load_clear)

static bool load_program(const AgentOptions *options, const AgentLink *link, Load *load,
                         GError **error)
{
    g_autoptr(GBytes) bytes = agent_program_load(options->argument, error);
    if (!bytes)
        return false;
    const char *file = options->machine ? options->machine : link->target.machine_file;
    if (!file) {
        /* Without the machine's description the end is the one place that is known to be clear. */
        const uint64_t end = g_bytes_get_size(bytes);
        load->program = nc_program_new(bytes, &end, 1);
        return true;
    }
    AgentMachine *machine = load->machine = agent_machine_load(file, NULL, error);
    if (!machine)
        return false;
    load->timed =
        agent_program_read(bytes, options->argument, machine->machine, machine->tools, error);
    if (load->timed)
        load->program = nc_program_from_bytes(bytes, machine->machine, machine->tools, error);
    return load->program;
}

/* Without --start, too, caution blocks: a button at the machine starts what is READY. */
static bool deliver(const AgentOptions *options, AgentLink *link, const Load *load,
                    AgentFollow *follow, GArray **findings, GError **error)
{
    const NcProgram *program = load->program;
    const AgentMachine *machine = load->machine;
    AgentExecution execution = agent_execution(link, follow, options->to);
    AgentPreflight flight = {.program = program, .needs = load->timed, .machine = machine};
    *findings = agent_preflight(link, &flight, error);
    bool ok =
        *findings && agent_preflight_allows(*findings, options->accept_cautions, error) &&
        agent_kept_store(program, machine ? machine->machine_file : NULL,
                         machine ? machine->tools_file : NULL, error) &&
        agent_execute_deliver(&execution, program->bytes, program->gates, program->n_gates, error);
    if (ok && options->start)
        ok = agent_preflight_again(link, &flight, options->accept_cautions, findings, error) &&
             agent_execute_start(&execution, NULL, error);
    link->status = NULL;
    return ok;
}

static void describe(const AgentOptions *options, const Load *load, const GArray *findings,
                     const FbStatus *status, AgentJson *result)
{
    size_t length = g_bytes_get_size(load->program->bytes);
    agent_json_string(result, "program_sha256", load->program->sha256);
    agent_json_integer(result, "program_bytes", (int64_t)length);
    agent_json_integer(result, "gates", (int64_t)load->program->n_gates);
    agent_preflight_write(findings, result);
    agent_json_string(result, "state", fb_state_name(status->state));
    if (!options->json)
        printf("%s: %zu bytes delivered and verified; the machine is %s\n", options->argument,
               length, fb_state_name(status->state));
}

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentLink) link = agent_link_open(options, error);
    g_auto(Load) load = {0};
    if (!link || !load_program(options, link, &load, error) || !agent_link_wait_ready(link, error))
        return false;
    g_autoptr(GArray) findings = NULL;
    AgentFollow follow = {0};
    if (load.timed)
        agent_follow_init(&follow, load.timed);
    bool ok = deliver(options, link, &load, load.timed ? &follow : NULL, &findings, error);
    if (load.timed)
        agent_follow_clear(&follow);
    if (ok)
        describe(options, &load, findings, fb_session_status(link->session), result);
    return ok;
}
