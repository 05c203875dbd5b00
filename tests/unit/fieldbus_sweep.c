/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Delivery and run under every single fault: every frame × every kind of fault × both carriers ×
 * every window, of a program that is stored, that drips, and of a restart at a gate. The program is
 * executed as it is, once, or the run stops in a named state at a known block.
 */
#include <string.h>

#include "tests/lib/fb_bus.h"
#include "tests/lib/test.h"

/* How one work under faults ended. */
typedef enum {
    END_DONE,     /* told so; executed whole, once; COMPLETE, the lease free */
    END_REFUSED,  /* an error that says why; nothing was executed */
    END_STOPPED,  /* an error that says what is known; executed up to a line */
    END_HELD,     /* the agent died: HELD at a gate, or COMPLETE */
    END_LOST_END, /* the agent died, or the link at the very end: COMPLETE all the same */
    END_BAD,
} End;

static const char *const end_names[] = {"done", "refused", "stopped", "held", "lost end", "BAD"};

static uint64_t first_byte(const Bus *b)
{
    return b->setup.mode == BUS_RESTART ? bus_gates()[0] : 0;
}

/* What was executed is the program's, from where it was to begin. */
static bool executed_is_prefix(const Bus *b)
{
    static GBytes *program;
    if (!program)
        program = bus_program();
    gsize n;
    const uint8_t *bytes = g_bytes_get_data(program, &n);
    const uint64_t from = first_byte(b);
    return b->executed->len <= n - from &&
           memcmp(b->executed->data ? b->executed->data : bytes + from, bytes + from,
                  b->executed->len) == 0;
}

static bool executed_whole(const Bus *b)
{
    return executed_is_prefix(b) && b->executed->len == bus_gates()[BUS_GATES - 1] - first_byte(b);
}

static bool executed_to_a_gate(const Bus *b)
{
    const uint64_t at = b->executed->len + first_byte(b);
    for (int i = 0; i < BUS_GATES; i++)
        if (bus_gates()[i] == at)
            return executed_is_prefix(b);
    return false;
}

/* A person's work: delivers, and starts once; an agent that died is begun again. A machine that
 * was started is left alone. What such an agent may not do without it is acknowledged. */
static void work(Bus *b)
{
    BusAgent *a = &b->agents[BUS_WORK];
    for (unsigned i = 0; i < 6 && b->starts == 0; i++) {
        const unsigned lives = a->lives;
        if (b->setup.mode != BUS_RESTART) {
            bus_deliver(b);
            if (!bus_run(b, BUS_WORK, FB_TASK_DELIVER) || a->error) {
                if (a->lives == lives)
                    return;
                continue;
            }
        }
        bus_start(b);
        bus_run(b, BUS_WORK, FB_TASK_RUN);
        if (a->lives == lives && (a->lives == 1 || i > 0) && !bus_status(b).needs_acknowledge)
            return;
        if (bus_status(b).state == FB_STATE_OFF)
            return;
        if (b->starts == 0)
            bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    }
}

/* Until nothing moves any more. */
static void settle(Bus *b)
{
    const int64_t end_us = b->now_us + 60 * G_USEC_PER_SEC;
    while (b->now_us < end_us && b->on && bus_status(b).state != FB_STATE_HELD)
        bus_turn(b);
    bus_wait(b, 4 * G_USEC_PER_SEC); /* whatever is late arrives */
}

static End judge(const Bus *b)
{
    const BusAgent *a = &b->agents[BUS_WORK];
    const FbStatus s = bus_status(b);
    if (b->starts > 1 || !executed_is_prefix(b) || b->resumes > 0)
        return END_BAD;
    if (a->error && a->error->domain != FB_ERROR)
        return END_BAD;
    if (a->ended[FB_TASK_RUN] && !a->error)
        return executed_whole(b) && b->completed == 1 && s.run_end <= FB_RUN_COMPLETE ? END_DONE
                                                                                      : END_BAD;
    if (b->starts == 0)
        return a->error ? END_REFUSED : END_BAD;
    if (a->lives > 1 && s.state == FB_STATE_HELD)
        return executed_to_a_gate(b) && s.run == 1 ? END_HELD : END_BAD;
    const bool lost = g_error_matches(a->error, FB_ERROR, FB_ERROR_LINK_LOST);
    if (b->completed == 1)
        return executed_whole(b) && (lost || a->lives > 1) ? END_LOST_END : END_BAD;
    return lost ? END_STOPPED : END_BAD;
}

/* Bits: of these may the ends be. */
static unsigned allowed(FaultKind kind)
{
    switch (kind) {
    case FAULT_REBOOT_BEFORE:
    case FAULT_REBOOT_AFTER:
        return 1 << END_DONE | 1 << END_REFUSED | 1 << END_STOPPED | 1 << END_LOST_END;
    case FAULT_KILLED_BEFORE:
    case FAULT_KILLED_AFTER:
        return 1 << END_DONE | 1 << END_HELD | 1 << END_LOST_END;
    default: /* the task goes on as if nothing had been */
        return 1 << END_DONE;
    }
}

static void complain(const Bus *b, End end)
{
    GString *text = g_string_new(NULL);
    for (int i = 0; i < BUS_FAULTS; i++)
        if (b->faults[i].kind != FAULT_NONE)
            g_string_append_printf(text, "%s%s at %u bit %u", i > 0 ? ", " : "",
                                   bus_fault_name(b->faults[i].kind), b->faults[i].at,
                                   b->faults[i].bit);
    const BusAgent *a = &b->agents[BUS_WORK];
    g_test_message("carrier %d mode %d window %u chunk %u: %s: %s; %u starts, %u bytes executed, "
                   "%u lives, %s, %s",
                   b->setup.carrier, b->setup.mode, b->setup.window, b->setup.chunk_max, text->str,
                   end_names[end], b->starts, b->executed->len, a->lives,
                   fb_state_name(bus_status(b).state), a->error ? a->error->message : "no error");
    g_string_free(text, TRUE);
    g_test_fail();
}

static End run_case(const BusSetup *setup, const Fault *faults, size_t n, unsigned ends)
{
    g_autoptr(Bus) b = bus_new(setup, faults, n);
    work(b);
    settle(b);
    const End end = judge(b);
    if (!(ends & 1u << end))
        complain(b, end);
    return end;
}

static unsigned frames_without_fault(const BusSetup *setup)
{
    g_autoptr(Bus) b = bus_new(setup, NULL, 0);
    work(b);
    settle(b);
    const FbStatus s = bus_status(b);
    g_assert_cmpstr(end_names[judge(b)], ==, "done");
    g_assert_cmpint(s.state, ==, FB_STATE_COMPLETE);
    g_assert_cmpint(s.lease_owner, ==, 0);
    g_assert_cmpuint(b->starved, ==, 0);
    return b->agents[BUS_WORK].frames;
}

/* Places of a damage: the fields of every kind of block are met. */
static const unsigned places[] = {3,   37,  70,  100, 133,  166,  200,
                                  213, 230, 300, 500, 1000, 1500, 1979};

static unsigned sweep(const BusSetup *setup)
{
    const unsigned n = frames_without_fault(setup);
    unsigned cases = 0, ends[END_BAD + 1] = {0};
    for (FaultKind kind = FAULT_NONE + 1; kind < FAULT_N_KINDS; kind++) {
        const bool damaged = kind == FAULT_REQUEST_DAMAGED || kind == FAULT_REPLY_DAMAGED;
        for (unsigned at = 0; at < n; at++)
            for (unsigned i = 0; i < (damaged ? G_N_ELEMENTS(places) : 1); i++, cases++)
                ends[run_case(setup, &(Fault){kind, BUS_WORK, at, places[i]}, 1, allowed(kind))]++;
    }
    g_test_message("%s, %s, window %2u, chunks of %4u: %3u frames, %5u cases: %u done, %u refused, "
                   "%u stopped, %u held, %u completed without their agent",
                   setup->carrier == BUS_CAN ? "CAN" : "Modbus",
                   setup->mode == BUS_STORED ? "stored"
                   : setup->mode == BUS_DRIP ? "dripping"
                                             : "restart",
                   setup->window, setup->chunk_max, n, cases, ends[END_DONE], ends[END_REFUSED],
                   ends[END_STOPPED], ends[END_HELD], ends[END_LOST_END]);
    return cases;
}

static void modbus(void)
{
    unsigned cases = 0;
    for (BusMode mode = 0; mode < BUS_N_MODES; mode++)
        for (uint16_t window = 1; window <= FB_WINDOW_MOST; window++)
            cases += sweep(&(BusSetup){BUS_MODBUS, mode, window, 218});
    g_test_message("Modbus: %u cases", cases);
}

static void can(void)
{
    static const uint16_t chunks[] = {FB_CHUNK_BYTES, 700, 218}, windows[] = {1, FB_WINDOW_MOST};
    unsigned cases = 0;
    for (BusMode mode = 0; mode < BUS_N_MODES; mode++)
        for (size_t i = 0; i < G_N_ELEMENTS(chunks); i++)
            for (size_t j = 0; j < G_N_ELEMENTS(windows); j++)
                cases += sweep(&(BusSetup){BUS_CAN, mode, windows[j], chunks[i]});
    g_test_message("CAN: %u cases", cases);
}

static void add(void)
{
    g_test_add_func("/fieldbus/sweep/modbus", modbus);
    g_test_add_func("/fieldbus/sweep/can", can);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
