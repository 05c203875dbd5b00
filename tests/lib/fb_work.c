/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/fb_work.h"

#include <string.h>

const char *end_name(End end)
{
    static const char *const names[] = {"done",   "refused", "stopped", "held",
                                        "untold", "aborted", "BAD"};
    return names[end];
}

void work(Bus *b)
{
    const BusAgent *a = &b->agents[BUS_WORK];
    for (unsigned i = 0; i < 8 && b->starts == 0; i++) {
        const unsigned lives = a->lives;
        if (b->setup.mode != BUS_RESTART) {
            bus_deliver(b);
            if (!bus_run(b, BUS_WORK, FB_TASK_DELIVER)) {
                if (a->lives == lives)
                    return;
                continue;
            }
            if (b->starts > 0 || (a->error && !b->setup.attended))
                return;
            if (a->error)
                continue;
        }
        bus_start(b);
        const bool ended = bus_run(b, BUS_WORK, FB_TASK_RUN);
        /* Who is told that it may not have started looks, and starts it. */
        const bool again = b->starts == 0 && bus_status(b).state == FB_STATE_READY;
        if (ended && !again && !bus_status(b).needs_acknowledge)
            return;
        if (a->lives == lives && bus_status(b).state != FB_STATE_READY)
            return;
        if (bus_status(b).needs_acknowledge && bus_status(b).state == FB_STATE_READY)
            bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    }
}

void work_settle(Bus *b)
{
    const int64_t end_us = b->now_us + 60 * G_USEC_PER_SEC;
    while (b->now_us < end_us && b->on && bus_status(b).state != FB_STATE_HELD)
        bus_turn(b);
    bus_wait(b, 4 * G_USEC_PER_SEC);
}

/* Where the execution stands in the program; UINT64_MAX: it is not the program's. */
static uint64_t executed_to(const Bus *b)
{
    gsize n;
    const uint8_t *bytes = g_bytes_get_data(bus_program(), &n);
    const uint64_t from = b->setup.mode == BUS_RESTART ? bus_gates()[0] : 0;
    const GByteArray *executed = b->executed;
    if (executed->len == 0)
        return from;
    const bool same = executed->len <= n - from &&
                      memcmp(executed->data, bytes + from, executed->len) == 0 &&
                      executed->data[executed->len - 1] == '\n';
    return same ? from + executed->len : UINT64_MAX;
}

static bool is_gate(uint64_t offset)
{
    for (int i = 0; i < BUS_GATES; i++)
        if (bus_gates()[i] == offset)
            return true;
    return offset == 0;
}

End work_end(const Bus *b)
{
    const BusAgent *a = &b->agents[BUS_WORK];
    const FbStatus s = bus_status(b);
    const uint64_t at = executed_to(b);
    const bool whole = at == bus_gates()[BUS_GATES - 1];
    const bool told = a->ended[FB_TASK_RUN] && !a->error;
    if (b->starts > 1 || b->completed > 1 || at == UINT64_MAX || whole != (b->completed == 1) ||
        (a->error && a->error->domain != FB_ERROR))
        return END_BAD;
    if (told)
        return whole ? END_DONE : END_BAD;
    if (b->starts == 0)
        return a->error || (a->lives > 1 && s.state == FB_STATE_OFF) ? END_REFUSED : END_BAD;
    const bool lost = g_error_matches(a->error, FB_ERROR, FB_ERROR_LINK_LOST);
    if (whole)
        return lost || a->lives > 1 ? END_UNTOLD : END_BAD;
    if (b->aborted == 1)
        return g_error_matches(a->error, FB_ERROR, FB_ERROR_ABORTED) || a->lives > 1 || lost
                   ? END_ABORTED
                   : END_BAD;
    if (s.state == FB_STATE_HELD)
        return b->gate_holds > 0 && is_gate(at) && s.run == 1 ? END_HELD : END_BAD;
    const bool rebooted =
        b->reboots > 0 && !b->on && (s.state == FB_STATE_OFF || b->setup.attended);
    return rebooted && (lost || a->lives > 1) ? END_STOPPED : END_BAD;
}

unsigned work_ends(FaultKind kind)
{
    switch (kind) {
    case FAULT_REBOOT_BEFORE:
    case FAULT_REBOOT_AFTER:
        return 1 << END_DONE | 1 << END_REFUSED | 1 << END_STOPPED | 1 << END_UNTOLD;
    case FAULT_KILLED_BEFORE:
    case FAULT_KILLED_AFTER:
        return 1 << END_DONE | 1 << END_HELD | 1 << END_UNTOLD;
    default: /* the task goes on as if nothing had been */
        return 1 << END_DONE;
    }
}

bool work_check(const Bus *b, unsigned ends)
{
    const End end = work_end(b);
    if (ends & 1u << end)
        return true;
    g_autoptr(GString) faults = g_string_new(NULL);
    for (int i = 0; i < BUS_FAULTS; i++)
        if (b->faults[i].kind != FAULT_NONE)
            g_string_append_printf(faults, "%s%s at %u of %s, bit %u", i > 0 ? "; " : "",
                                   bus_fault_name(b->faults[i].kind), b->faults[i].at,
                                   b->faults[i].agent == BUS_WORK ? "work" : "control",
                                   b->faults[i].bit);
    const BusAgent *a = &b->agents[BUS_WORK];
    g_test_message("%s, window %u, chunks of %u: %s: %s: %u starts, %u bytes executed, %u lives, "
                   "%s, %s",
                   bus_setup_name(&b->setup), b->setup.window, b->setup.chunk_max, faults->str,
                   end_name(end), b->starts, b->executed->len, a->lives,
                   fb_state_name(bus_status(b).state), a->error ? a->error->message : "no error");
    g_test_fail();
    return false;
}
