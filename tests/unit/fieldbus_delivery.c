/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Delivery and run under every single fault: the program arrives as it is and runs once, or the
 * task ends with an error that says what is known.
 */
#include "tests/unit/fieldbus_bus.h"

static const Fault NONE = {FAULT_NONE, 0, 0};

/* About five chunks, with three gates. */
static GBytes *make_program(uint64_t *gates)
{
    GString *s = g_string_new(NULL);
    for (int i = 0; i < 60; i++) {
        g_string_append_printf(s, "N%d G1 X%d.5 Y%d\n", i, i % 7, i % 11);
        if (i == 20 || i == 40)
            gates[i / 20 - 1] = s->len;
    }
    gates[2] = s->len;
    return g_string_free_to_bytes(s);
}

static void deliver(Bus *b, GBytes *program, const uint64_t *gates)
{
    fb_delivery_deliver(b->delivery, program, gates, 3, b->now_us);
    b->wake_us = b->now_us;
}

static void start(Bus *b)
{
    fb_delivery_start(b->delivery, b->now_us);
    b->wake_us = b->now_us;
}

/* Delivers, and leaves the machine running. */
static void start_run(Bus *b, GBytes *program, const uint64_t *gates)
{
    deliver(b, program, gates);
    g_assert_true(bus_run(b, FB_TASK_DELIVER));
    start(b);
    while (b->starts == 0)
        bus_turn(b);
}

/* Delivers and runs; after a kill a new agent does so from the start, unless the person who starts
 * it sees that the program has been started. */
static void work(Bus *b, GBytes *program, const uint64_t *gates)
{
    for (unsigned lives = 0; lives < 3; lives++) {
        const unsigned kills = b->kills;
        b->ended[FB_TASK_DELIVER] = b->ended[FB_TASK_RUN] = false;
        deliver(b, program, gates);
        if (bus_run(b, FB_TASK_DELIVER) && !b->error) {
            start(b);
            bus_run(b, FB_TASK_RUN);
        }
        if (b->kills == kills || b->starts > 0)
            return;
    }
}

static unsigned requests_without_fault(GBytes *program, const uint64_t *gates)
{
    Bus *b = bus_new(NONE, NONE);
    work(b, program, gates);
    const unsigned n = b->requests;
    g_assert_no_error(b->error);
    g_assert_cmpuint(b->starts, ==, 1);
    bus_free(b);
    return n;
}

static bool is_reboot(Fault f)
{
    return f.kind == FAULT_REBOOT_BEFORE || f.kind == FAULT_REBOOT_AFTER;
}

/* One delivery under these faults. `forgiven`: none of them may be seen in the result. */
static void check(GBytes *program, const uint64_t *gates, Fault first, Fault second, bool forgiven)
{
    Bus *b = bus_new(first, second);
    work(b, program, gates);
    bool good = (b->ended[FB_TASK_DELIVER] || b->kills > 0) && b->starts <= 1;
    if (b->starts > 0)
        good = good && g_bytes_equal(b->executed, program);
    if (!b->error)
        good = good && b->starts == 1 && (b->kills > 0 || b->ended[FB_TASK_RUN]);
    else
        good = good && b->error->domain == FB_ERROR && !forgiven;
    if (!good) {
        g_test_message("faults %d at %u bit %u, %d at %u bit %u: %u starts, %s", first.kind,
                       first.at, first.bit, second.kind, second.at, second.bit, b->starts,
                       b->error ? b->error->message : "no error");
        g_test_fail();
    }
    bus_free(b);
}

static void every_single_fault(void)
{
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    const unsigned n = requests_without_fault(program, gates);
    unsigned cases = 0;
    for (FaultKind kind = FAULT_REQUEST_LOST; kind < N_FAULTS; kind++)
        for (unsigned at = 0; at < n; at++) {
            const Fault fault = {kind, at, at * 7919};
            const bool forgiven = kind < FAULT_REBOOT_BEFORE;
            check(program, gates, fault, NONE, forgiven);
            cases++;
        }
    g_test_message("%u requests × %d faults: %u cases", n, N_FAULTS - 1, cases);
    g_assert_cmpuint(n, >, 12);
}

/* Every byte of every frame, one bit each. */
static void every_damaged_byte(void)
{
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    const unsigned n = requests_without_fault(program, gates);
    for (unsigned at = 0; at < n; at++)
        for (unsigned byte = 0; byte < FB_STATUS_BYTES; byte++) {
            const unsigned bit = 8 * byte + (at + byte) % 8;
            check(program, gates, (Fault){FAULT_REPLY_DAMAGED, at, bit}, NONE, true);
            check(program, gates, (Fault){FAULT_REQUEST_DAMAGED, at, bit}, NONE, true);
        }
    g_test_message("%u cases", 2 * n * FB_STATUS_BYTES);
}

static void pairs_of_faults(void)
{
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    const unsigned n = requests_without_fault(program, gates);
    for (int i = 0; i < 5000; i++) {
        Fault f[2];
        for (int j = 0; j < 2; j++)
            f[j] = (Fault){(FaultKind)g_test_rand_int_range(1, N_FAULTS),
                           (unsigned)g_test_rand_int_range(0, (int)n + 4),
                           (unsigned)g_test_rand_int_range(0, 8 * FB_STATUS_BYTES)};
        const bool forgiven = !is_reboot(f[0]) && !is_reboot(f[1]) &&
                              f[0].kind != FAULT_AGENT_KILLED && f[1].kind != FAULT_AGENT_KILLED;
        check(program, gates, f[0], f[1], forgiven);
    }
}

/* A delivery that stopped half-way is gone on with, by anybody who has the lease. */
static void goes_on_from_received(void)
{
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    Bus *b = bus_new((Fault){FAULT_AGENT_KILLED, 5, 0}, NONE);
    deliver(b, program, gates);
    g_assert_false(bus_run(b, FB_TASK_DELIVER));
    g_assert_cmpuint(b->kills, ==, 1);
    FbStatus s;
    fb_receiver_status(b->receiver, b->now_us, &s);
    g_assert_cmpuint(s.received, >, 0);
    const uint32_t transfer = s.transfer;
    const unsigned before = b->requests;
    work(b, program, gates);
    g_assert_error(b->error, FB_ERROR, FB_ERROR_REFUSED); /* a restarted agent starts nothing */
    g_assert_cmpuint(b->starts, ==, 0);
    bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    work(b, program, gates);
    g_assert_no_error(b->error);
    g_assert_true(b->ended[FB_TASK_RUN]);
    g_assert_cmpuint(b->starts, ==, 1);
    fb_receiver_status(b->receiver, b->now_us, &s);
    g_assert_cmpuint(s.transfer, ==, transfer);
    g_assert_cmpuint(b->requests, >, before);
    bus_free(b);
}

/* The link goes while the program runs, and comes back in time: followed on, no second start. */
static void link_loss_while_running(void)
{
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    Bus *b = bus_new(NONE, NONE);
    b->run_us = 20 * G_USEC_PER_SEC;
    start_run(b, program, gates);
    b->dead = true;
    const int64_t back_us = b->now_us + 10 * G_USEC_PER_SEC;
    while (b->now_us < back_us)
        bus_turn(b);
    g_assert_false(b->ended[FB_TASK_RUN]);
    g_assert_cmpint(fb_delivery_status(b->delivery)->state, ==, FB_STATE_UNKNOWN);
    g_assert_cmpuint(b->shown_unknown, ==, 1);
    g_assert_cmpuint(b->holds_at_gate, ==, 1);
    b->dead = false;
    g_assert_true(bus_run(b, FB_TASK_RUN));
    g_assert_no_error(b->error);
    g_assert_cmpuint(b->starts, ==, 1);
    bus_free(b);
}

/* The link does not come back: UNKNOWN, and the error says so. */
static void gives_up(void)
{
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    Bus *b = bus_new(NONE, NONE);
    b->run_us = 1000 * (int64_t)G_USEC_PER_SEC;
    start_run(b, program, gates);
    b->dead = true;
    const int64_t since_us = b->now_us;
    g_assert_true(bus_run(b, FB_TASK_RUN));
    g_assert_error(b->error, FB_ERROR, FB_ERROR_LINK_LOST);
    g_assert_cmpint(b->now_us - since_us, >=, 30 * G_USEC_PER_SEC);
    g_assert_cmpint(b->now_us - since_us, <, 33 * G_USEC_PER_SEC);
    g_assert_cmpint(fb_delivery_status(b->delivery)->state, ==, FB_STATE_UNKNOWN);

    /* Before anything runs the machine is just not reachable. */
    b->ended[FB_TASK_DELIVER] = false;
    deliver(b, program, gates);
    g_assert_true(bus_run(b, FB_TASK_DELIVER));
    g_assert_error(b->error, FB_ERROR, FB_ERROR_UNREACHABLE);
    bus_free(b);
}

typedef struct {
    FbMachineEvent event;
    FbError error;
} EndCase;

static void how_a_run_ends(void)
{
    static const EndCase cases[] = {{FB_MACHINE_ALARM, FB_ERROR_ALARM},
                                    {FB_MACHINE_ESTOP, FB_ERROR_ALARM},
                                    {FB_MACHINE_ABORTED, FB_ERROR_ABORTED}};
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Bus *b = bus_new(NONE, NONE);
        start_run(b, program, gates);
        b->run_ends_us = INT64_MAX;
        bus_machine_event(b, cases[i].event);
        g_assert_true(bus_run(b, FB_TASK_RUN));
        g_assert_error(b->error, FB_ERROR, (int)cases[i].error);
        if (b->error && cases[i].error == FB_ERROR_ALARM)
            g_assert_nonnull(strstr(b->error->message, "Axis X beyond its travel"));
        FbStatus s;
        fb_receiver_status(b->receiver, b->now_us, &s);
        g_assert_cmpuint(s.lease_owner, ==, 0);
        bus_free(b);
    }
}

static void lease_of_another_is_respected(void)
{
    uint64_t gates[3];
    uint8_t block[FB_BLOCK_BYTES];
    g_autoptr(GBytes) program = make_program(gates);
    Bus *b = bus_new(NONE, NONE);
    const FbOrder other = {.session = 5,
                           .seq = 1,
                           .epoch = b->epoch,
                           .token = UINT64_C(9) << 32,
                           .command = FB_COMMAND_LEASE};
    fb_receiver_write(b->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block,
                      fb_wire_put_order(block, &other), b->now_us, b->actions);
    work(b, program, gates);
    g_assert_error(b->error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_cmpuint(b->starts, ==, 0);

    /* A hold needs none; an acknowledgement of COMPLETE does. */
    fb_delivery_command(b->delivery, FB_COMMAND_CLOSE, NULL, b->now_us);
    b->wake_us = b->now_us;
    g_assert_true(bus_run(b, FB_TASK_COMMAND));
    g_assert_error(b->error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_nonnull(strstr(b->error->message, "NO_LEASE"));
    bus_free(b);
}

/* A machine that is switched off, or that refuses, is told of in words. */
static void refusals_are_told(void)
{
    uint64_t gates[3];
    g_autoptr(GBytes) program = make_program(gates);
    Bus *b = bus_new(NONE, NONE);
    bus_boot(b);
    work(b, program, gates);
    g_assert_error(b->error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_nonnull(strstr(b->error->message, "OFF"));
    bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    work(b, program, gates);
    g_assert_no_error(b->error);
    g_assert_cmpuint(b->starts, ==, 1);

    b->ended[FB_TASK_RUN] = false;
    start(b);
    g_assert_true(bus_run(b, FB_TASK_RUN));
    g_assert_error(b->error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_nonnull(strstr(b->error->message, "COMPLETE"));
    g_assert_cmpuint(b->starts, ==, 1);
    bus_free(b);
}

static void add(void)
{
    g_test_add_func("/fieldbus/delivery/every-single-fault", every_single_fault);
    g_test_add_func("/fieldbus/delivery/every-damaged-byte", every_damaged_byte);
    g_test_add_func("/fieldbus/delivery/pairs-of-faults", pairs_of_faults);
    g_test_add_func("/fieldbus/delivery/goes-on-from-received", goes_on_from_received);
    g_test_add_func("/fieldbus/delivery/link-loss-while-running", link_loss_while_running);
    g_test_add_func("/fieldbus/delivery/gives-up", gives_up);
    g_test_add_func("/fieldbus/delivery/how-a-run-ends", how_a_run_ends);
    g_test_add_func("/fieldbus/delivery/lease-of-another", lease_of_another_is_respected);
    g_test_add_func("/fieldbus/delivery/refusals-are-told", refusals_are_told);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
