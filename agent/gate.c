/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/gate.h"

#include <string.h>

static void find_block(const NcProgram *program, uint64_t at, AgentGate *gate);
static void find_state(AgentGate *gate, const NcMove *moves, size_t n, uint32_t line);
static void find_rest(AgentGate *gate, const NcMove *moves, const NcMotion *motion, size_t n,
                      uint32_t line);

uint32_t *agent_gate_lines(const NcProgram *program)
{
    const char *text = g_bytes_get_data(program->bytes, NULL);
    uint32_t *lines = g_new(uint32_t, program->n_gates);
    uint32_t line = 1;
    uint64_t at = 0;
    for (size_t i = 0; i < program->n_gates; i++) {
        for (; at < program->gates[i]; at++)
            line += text[at] == '\n';
        lines[i] = line;
    }
    return lines;
}

bool agent_gate_read(const NcProgram *program, uint32_t number, const AgentMachine *machine,
                     AgentGate *gate, GError **error)
{
    size_t length;
    const char *text = g_bytes_get_data(program->bytes, &length);
    g_autoptr(GArray) moves =
        nc_read_program(text, length, machine->machine, machine->tools, error);
    if (!moves)
        return false;
    const NcMove *move = (const NcMove *)(void *)moves->data;
    g_autoptr(NcMotion) motion =
        nc_motion_new(machine->machine, NC_NO_OVERRIDE, 0, move, moves->len);
    g_autofree uint32_t *lines = agent_gate_lines(program);
    const double *home = machine->machine->tool_change_mm; /* where every program begins */
    *gate = (AgentGate){.number = number,
                        .line = lines[number - 1],
                        .work_offset = 54,
                        .position_mm = seg_vec3(home[0], home[1], home[2])};
    find_state(gate, move, moves->len, gate->line);
    find_rest(gate, move, motion, moves->len, gate->line);
    find_block(program, program->gates[number - 1], gate);
    return true;
}

void agent_gate_clear(AgentGate *gate)
{
    g_clear_pointer(&gate->text, g_free);
}

/* What the last action before the gate left in force. */
static void find_state(AgentGate *gate, const NcMove *moves, size_t n, uint32_t line)
{
    const NcMove *before = NULL;
    for (size_t i = 0; i < n && moves[i].line < line; i++)
        before = &moves[i];
    if (!before)
        return;
    gate->tool = before->tool;
    gate->spindle_rpm = before->spindle_rpm;
    gate->mist = before->coolant_mist;
    gate->flood = before->coolant_flood;
    gate->work_offset = before->work_offset;
    gate->feed_mm_min = before->feed_mm_min;
    gate->position_mm = before->to;
}

static void find_rest(AgentGate *gate, const NcMove *moves, const NcMotion *motion, size_t n,
                      uint32_t line)
{
    size_t i = 0;
    while (i < n && moves[i].line < line)
        i++;
    if (i == n)
        return;
    gate->region = moves[i].region;
    gate->left_s = nc_motion_total_s(motion) - nc_motion_start_s(motion, i);
    for (; i < n; i++)
        gate->left_blocks += i + 1 == n || moves[i].line != moves[i + 1].line;
}

/* Empty lines and those with nothing but a comment are passed over. */
static void find_block(const NcProgram *program, uint64_t at, AgentGate *gate)
{
    size_t length;
    const char *text = g_bytes_get_data(program->bytes, &length);
    while (at < length) {
        const char *newline = memchr(text + at, '\n', length - at);
        uint64_t end = newline ? (uint64_t)(newline - text) : length;
        g_autofree char *block = g_strndup(text + at, end - at);
        g_strstrip(block);
        if (*block != '\0' && *block != '(' && *block != ';') {
            gate->text = g_steal_pointer(&block);
            return;
        }
        gate->line += newline != NULL;
        at = end + 1;
    }
    gate->text = g_strdup("");
}
