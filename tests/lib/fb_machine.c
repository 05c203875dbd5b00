/* SPDX-License-Identifier: Apache-2.0 */
/* The machine on the test's bus: it executes a line of the program at a time. */
#include <string.h>

#include "tests/lib/fb_bus.h"

/* Two passes are more than sixteen chunks of 218 bytes. */
GBytes *bus_program(void)
{
    static GBytes *program;
    if (!program) {
        GString *s = g_string_new(NULL);
        for (int i = 0; i < BUS_LINES; i++)
            g_string_append_printf(s, "N%d G1 X%d.5 Y%d.25 Z-%d.125 F%d (%0*d)\n", i, i % 7, i % 11,
                                   i % 3, 1000 + i, 140, i);
        program = g_string_free_to_bytes(s);
    }
    return program;
}

/* A gate behind every tenth line. */
const uint64_t *bus_gates(void)
{
    static uint64_t gates[BUS_GATES];
    if (gates[0] == 0) {
        gsize n;
        const char *text = g_bytes_get_data(bus_program(), &n);
        for (gsize i = 0, lines = 0; i < n; i++)
            if (text[i] == '\n' && ++lines % (BUS_LINES / BUS_GATES) == 0)
                gates[lines / (BUS_LINES / BUS_GATES) - 1] = i + 1;
    }
    return gates;
}

/* Of a program that drips the machine holds its table and two passes, but never all. */
static uint64_t memory_bytes(const Bus *b)
{
    return b->setup.mode == BUS_DRIP ? BUS_GATES * FB_DRIP_GATE_BYTES + bus_gates()[1] + 100
                                     : 1 << 20;
}

void bus_boot(Bus *b)
{
    const FbReceiverOptions options = {.epoch = ++b->epoch,
                                       .memory_bytes = memory_bytes(b),
                                       .on_agent_loss = CFG_AGENT_LOSS_NEXT_GATE,
                                       .agent_timeout_us = 5 * G_USEC_PER_SEC,
                                       .lease_timeout_us = 30 * G_USEC_PER_SEC};
    fb_receiver_free(b->receiver);
    b->receiver = fb_receiver_new(&options);
    g_array_set_size(b->actions, 0);
    b->on = b->stops = b->stops_at_gate = b->aborts = false;
    b->line_us = INT64_MAX;
    b->progress = (FbProgress){0};
    b->tick_us = b->now_us;
}

void bus_machine_event(Bus *b, FbMachineEvent event)
{
    const FbAlarm alarm = {event == FB_MACHINE_ESTOP ? 43 : 42, "Axis X beyond its travel",
                           "Check the work offset."};
    if (event == FB_MACHINE_COMPLETE || event == FB_MACHINE_ABORTED || event == FB_MACHINE_ALARM ||
        event == FB_MACHINE_ESTOP) {
        b->on = false;
        b->line_us = INT64_MAX;
        b->progress.stop_line = event == FB_MACHINE_COMPLETE ? 0 : b->progress.line;
        b->progress.line = 0;
        fb_receiver_progress(b->receiver, &b->progress);
    }
    fb_receiver_machine(b->receiver, event, &alarm, b->now_us, b->actions);
}

/* The pass that comes next, and where it begins; NULL: it is not there yet. */
static GBytes *next_pass(const Bus *b, uint64_t *from)
{
    const uint32_t gate = b->progress.gate;
    *from = 0;
    if (!fb_receiver_drips(b->receiver))
        return g_bytes_ref(fb_receiver_program(b->receiver));
    *from = gate > 0 ? bus_gates()[gate - 1] : 0;
    return gate < fb_receiver_released(b->receiver) ? fb_receiver_pass(b->receiver, gate) : NULL;
}

/* A stored program lasts longer than it takes to lose an agent; one that drips would only be waited
 * for: its machine stands still where the agent is gone. */
static int64_t line_us(const Bus *b)
{
    return b->setup.mode == BUS_DRIP ? 50000 : 250000;
}

/* Stands still at a block, or begins the next. */
static void go_on(Bus *b)
{
    uint64_t from;
    g_autoptr(GBytes) pass = b->on ? next_pass(b, &from) : NULL;
    const bool at_gate = b->progress.gate > 0 && b->next == bus_gates()[b->progress.gate - 1];
    b->line_us = INT64_MAX;
    b->progress.starving = false;
    if (!b->on)
        return;
    if (b->aborts) {
        b->aborted++;
        bus_machine_event(b, FB_MACHINE_ABORTED);
    } else if (b->stops || (b->stops_at_gate && (at_gate || !pass))) {
        b->stops = b->stops_at_gate = false;
        bus_machine_event(b, FB_MACHINE_HELD);
    } else if (!pass) {
        b->progress.starving = true;
        b->starved++;
    } else {
        b->line_us = b->now_us + line_us(b);
    }
    if (b->on)
        fb_receiver_progress(b->receiver, &b->progress);
}

void bus_execute_line(Bus *b)
{
    uint64_t from;
    gsize n;
    g_autoptr(GBytes) pass = next_pass(b, &from);
    const char *text = g_bytes_get_data(pass, &n);
    const char *line = text + (b->next - from);
    const size_t length =
        (size_t)((const char *)memchr(line, '\n', n - (b->next - from)) + 1 - line);
    g_byte_array_append(b->executed, (const guint8 *)line, (guint)length);
    b->next += length;
    b->progress.executed_blocks++;
    b->progress.line++;
    b->progress.gate += b->next == bus_gates()[b->progress.gate];
    fb_receiver_progress(b->receiver, &b->progress);
    if (b->progress.gate == BUS_GATES) {
        b->completed++;
        bus_machine_event(b, FB_MACHINE_COMPLETE);
    } else {
        go_on(b);
    }
}

static void start_machine(Bus *b, uint32_t gate)
{
    b->starts++;
    b->on = true;
    b->stops = b->stops_at_gate = b->aborts = false;
    b->progress.gate = gate;
    b->progress.line = gate * (BUS_LINES / BUS_GATES) + 1;
    b->next = gate > 0 ? bus_gates()[gate - 1] : 0;
    go_on(b);
}

static void do_one(Bus *b, FbDo what)
{
    switch (what) {
    case FB_DO_VERIFY:
        bus_machine_event(b, FB_MACHINE_VERIFIED);
        break;
    case FB_DO_START:
        start_machine(b, 0);
        break;
    case FB_DO_RESTART:
        start_machine(b, fb_receiver_restart_gate(b->receiver));
        break;
    case FB_DO_HOLD:
        b->holds++;
        b->stops = true;
        break;
    case FB_DO_HOLD_AT_GATE:
        b->gate_holds++;
        b->stops_at_gate = true;
        break;
    case FB_DO_RESUME:
        b->resumes++;
        b->stops = b->stops_at_gate = false;
        break;
    case FB_DO_ABORT:
        b->aborts = true;
        break;
    default:
        break;
    }
    const bool stands = b->line_us == INT64_MAX;
    if (stands && (what == FB_DO_HOLD || what == FB_DO_HOLD_AT_GATE || what == FB_DO_RESUME ||
                   what == FB_DO_ABORT || (what == FB_DO_PASS && b->progress.starving)))
        go_on(b);
}

void bus_act(Bus *b)
{
    for (guint i = 0; i < b->actions->len; i++)
        do_one(b, g_array_index(b->actions, FbDo, i));
    g_array_set_size(b->actions, 0);
}
