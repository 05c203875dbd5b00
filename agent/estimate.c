/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>

#include "agent/agent.h"
#include "agent/program.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_estimate = {
    .name = "estimate",
    .argument = "PROGRAM",
    .synopsis = "PROGRAM --machine FILE",
    .summary = "time a program with a machine's speeds and accelerations",
    .help =
        "Reads the program as the machine would, checks its travel and times every move with the\n"
        "accelerations, tool changes and spindle of the machine's description.",
    .takes = AGENT_TAKES_MACHINE,
    .needs = AGENT_TAKES_MACHINE,
    .run = run,
};

static void print_text(const AgentProgram *program, double length_mm, double air_mm)
{
    printf("%.1f s, %.0f mm cutting, %.0f mm in the air, %d tool changes\n", program->total_s,
           length_mm, air_mm, program->tool_changes);
    for (size_t i = 0; i < program->n_regions; i++)
        printf("  region %d: %.1f s\n", program->regions[i].id, program->regions[i].planned_s);
}

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentMachine) machine = agent_machine_load(options->machine, NULL, error);
    g_autoptr(GBytes) bytes = machine ? agent_program_load(options->argument, error) : NULL;
    g_autoptr(AgentProgram) program = NULL;
    if (bytes)
        program =
            agent_program_read(bytes, options->argument, machine->machine, machine->tools, error);
    if (!program)
        return false;
    g_autofree char *sha256 = g_compute_checksum_for_bytes(G_CHECKSUM_SHA256, bytes);
    agent_json_string(result, "program_sha256", sha256);
    agent_json_number(result, "estimated_s", program->total_s);
    agent_json_number(result, "length_mm", program->length_mm);
    agent_json_number(result, "air_mm", program->air_mm);
    agent_json_integer(result, "tool_changes", program->tool_changes);
    agent_json_array(result, "regions");
    for (size_t i = 0; i < program->n_regions; i++) {
        agent_json_object(result, NULL);
        agent_json_integer(result, "id", program->regions[i].id);
        agent_json_number(result, "estimated_s", program->regions[i].planned_s);
        agent_json_end(result);
    }
    agent_json_end(result);
    if (!options->json)
        print_text(program, program->length_mm, program->air_mm);
    return true;
}
