/* SPDX-License-Identifier: Apache-2.0 */
/* Any bytes as a program: read, gated and timed, or refused with a message; and a refused block
 * leaves the interpreter as it was. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "nc/nc.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static CfgTool tool_list[] = {{.number = 1, .length_mm = 50.0, .diameter_mm = 2.0},
                              {.number = 2, .length_mm = 60.0}};
static const CfgToolTable tools = {tool_list, G_N_ELEMENTS(tool_list)};

static CfgMachine new_machine(void)
{
    CfgMachine machine = {.spindle_max_rpm = 1e5,
                          .spindle_rpm_per_s = 1000.0,
                          .tool_change_s = 5.0,
                          .work_offset_mm = {{0.0, 0.0, 0.0}, {10.0, 20.0, -30.0}}};
    for (int axis = 0; axis < 3; axis++)
        machine.axis[axis] = (CfgAxis){-1000.0, 1000.0, 6000.0, 500.0, 0.0};
    machine.rotary[0] = machine.rotary[2] = (CfgRotary){true, -720.0, 720.0, 3600.0, 1000.0, 0.0};
    return machine;
}

/* Half way, or not at all: as the line says. */
static bool touches(const NcMove *move, bool away, SegVec3 *where, void *data)
{
    (void)data;
    *where = (SegVec3){0.5 * (move->from.x + move->to.x), 0.5 * (move->from.y + move->to.y),
                       0.5 * (move->from.z + move->to.z)};
    return (move->line % 2 == 0) != away;
}

static void check_motion(const CfgMachine *machine, const GArray *moves)
{
    const NcMove *move = (const NcMove *)(const void *)moves->data;
    g_autoptr(NcMotion) motion = nc_motion_new(machine, NC_NO_OVERRIDE, 0, move, moves->len);
    for (guint i = 0; i < moves->len; i++) {
        double duration_s = nc_motion_duration_s(motion, i);
        g_assert(isfinite(duration_s) && duration_s >= 0.0);
        NcPoint middle = nc_motion_at(motion, nc_motion_start_s(motion, i) + 0.5 * duration_s);
        for (int axis = 0; axis < 6; axis++)
            g_assert(isfinite(middle.position[axis]));
    }
}

/* Each goes on where the last one ended, and is of no earlier line. */
static void check_chain(const GArray *moves)
{
    for (guint i = 1; i < moves->len; i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        g_assert(seg_distance(move->from, move[-1].to) == 0.0 && move->line >= move[-1].line);
    }
}

static void read_whole(const CfgMachine *machine, const char *text, size_t size)
{
    g_autoptr(GError) error = NULL, gate_error = NULL;
    g_autoptr(GBytes) bytes = g_bytes_new(text, size);
    g_autoptr(GArray) moves = nc_read_program(text, size, machine, &tools, &error);
    g_autoptr(NcProgram) program = nc_program_from_bytes(bytes, machine, &tools, &gate_error);
    g_assert(!moves == !program && !moves == (error != NULL));
    if (!moves) {
        g_assert(error->domain == NC_ERROR && g_str_equal(error->message, gate_error->message));
        return;
    }
    check_motion(machine, moves);
    check_chain(moves);
    g_assert(program->n_gates > 0 && program->gates[program->n_gates - 1] == size);
    for (size_t i = 1; i < program->n_gates; i++)
        g_assert(program->gates[i] > program->gates[i - 1]);
}

/* The same blocks, going on after those that are refused: with and without them the moves that
 * follow are the same. */
static void read_blocks(const CfgMachine *machine, const char *text, size_t size)
{
    g_autoptr(NcInterpreter) all = nc_interpreter_new(machine, &tools);
    g_autoptr(NcInterpreter) good = nc_interpreter_new(machine, &tools);
    nc_interpreter_set_probe(all, touches, NULL);
    nc_interpreter_set_probe(good, touches, NULL);
    g_autoptr(GArray) of_all = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autoptr(GArray) of_good = g_array_new(FALSE, FALSE, sizeof(NcMove));
    for (const char *at = text, *end = text + size; at < end;) {
        const char *newline = memchr(at, '\n', (size_t)(end - at));
        size_t length = (size_t)((newline ? newline + 1 : end) - at);
        if (nc_interpreter_block(all, at, length, of_all, NULL))
            g_assert(nc_interpreter_block(good, at, length, of_good, NULL));
        at += length;
    }
    g_assert(of_all->len == of_good->len);
    for (guint i = 0; i < of_all->len; i++) {
        const NcMove *a = &g_array_index(of_all, NcMove, i);
        const NcMove *b = &g_array_index(of_good, NcMove, i);
        g_assert(a->kind == b->kind && seg_distance(a->to, b->to) == 0.0);
        g_assert(a->region == b->region && a->feed_mm_min == b->feed_mm_min);
        g_assert(memcmp(a->to_deg, b->to_deg, sizeof a->to_deg) == 0);
        g_assert(a->spindle_rpm == b->spindle_rpm && a->tool == b->tool);
        if (a->kind == NC_MOVE_MESSAGE)
            g_assert(g_str_equal(nc_interpreter_message(all, a), nc_interpreter_message(good, b)));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    CfgMachine machine = new_machine();
    read_whole(&machine, (const char *)data, size);
    read_blocks(&machine, (const char *)data, size);
    return 0;
}
