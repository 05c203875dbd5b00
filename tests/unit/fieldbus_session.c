/* SPDX-License-Identifier: Apache-2.0 */
/* Both sides of the delivery over real sockets. */
#include <stdlib.h>

#include "tests/unit/fieldbus_cell.h"

/* Until the delivery has ended, in whatever way; the program's end is its only gate. */
static void deliver(Cell *c, GBytes *p)
{
    const uint64_t end = g_bytes_get_size(p);
    const int before = c->done[FB_TASK_DELIVER];
    fb_session_deliver(c->session, p, &end, 1);
    g_assert_true(run_until(c, &c->done[FB_TASK_DELIVER], before + 1));
}

static void delivers_and_runs(void)
{
    Cell c;
    open_cell(&c);
    open_session(&c);
    g_autoptr(GBytes) p = program(300000);
    deliver(&c, p);
    g_assert_no_error(c.error);
    g_assert_cmpstr(fb_state_name(fb_receiver_state(c.receiver)), ==, "READY");
    g_assert_cmpint(c.starts, ==, 0);
    fb_session_start(c.session);
    g_assert_true(run_until(&c, &c.done[FB_TASK_RUN], 1));
    g_assert_no_error(c.error);
    g_assert_cmpint(c.starts, ==, 1);
    g_assert_true(c.executed && g_bytes_equal(c.executed, p));
    g_assert_cmpstr(fb_state_name(fb_session_status(c.session)->state), ==, "COMPLETE");
    close_cell(&c);
}

/* ----------------------------------------------------------------- hold under load */

/* Connections that send half a header, one byte at a time, and never read. */
static void drip(const int *fds, int n, int round)
{
    static const uint8_t half[] = {0, 1, 0, 0, 0, 200, 1, 16};
    for (int i = 0; i < n; i++)
        if ((size_t)round < sizeof half)
            send(fds[i], half + round, 1, MSG_NOSIGNAL | MSG_DONTWAIT);
}

static void hold_is_never_delayed(void)
{
    Cell c;
    int fds[12];
    open_cell(&c);
    c.slow = true;
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++)
        fds[i] = raw_connect(&c);
    open_session(&c);
    g_autoptr(GBytes) p = program(40000);
    deliver(&c, p);
    fb_session_start(c.session);
    g_assert_true(run_until(&c, &c.starts, 1));
    int64_t worst_us = 0;
    for (int i = 0; i < 20; i++) {
        drip(fds, G_N_ELEMENTS(fds), i);
        const int64_t began_us = g_get_monotonic_time();
        fb_session_command(c.session, FB_COMMAND_HOLD, NULL);
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2 * i + 1));
        worst_us = MAX(worst_us, g_get_monotonic_time() - began_us);
        g_assert_no_error(c.error);
        g_assert_cmpstr(fb_state_name(fb_receiver_state(c.receiver)), ==, "HELD");
        fb_session_command(c.session, FB_COMMAND_RESUME, NULL);
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2 * i + 2));
        g_assert_no_error(c.error);
        g_assert_cmpstr(fb_state_name(fb_receiver_state(c.receiver)), ==, "RUNNING");
    }
    g_test_message("hold, worst of 20 with dripping clients: %.3f ms", (double)worst_us / 1000);
    g_assert_cmpint(worst_us, <, 500000);
    g_assert_cmpint(c.holds, ==, 20);
    fb_session_command(c.session, FB_COMMAND_ABORT, NULL);
    g_assert_true(run_until(&c, &c.done[FB_TASK_RUN], 1));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_ABORTED);
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++)
        close(fds[i]);
    close_cell(&c);
}

/* More clients than there is room for: the silent ones go, the session stays. */
static void crowd(void)
{
    Cell c;
    int fds[60], alive = 0;
    open_cell(&c);
    open_session(&c);
    g_assert_true(run_until(&c, &c.shown, 3));
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++) {
        fds[i] = raw_connect(&c);
        turn(&c, 3);
        g_assert_true(run_until(&c, &c.shown, c.shown + (i % 5 == 0)));
    }
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++) {
        uint8_t byte;
        alive += recv(fds[i], &byte, 1, MSG_DONTWAIT) < 0;
        close(fds[i]);
    }
    g_assert_cmpint(alive, >, 8);
    g_assert_cmpint(alive, <=, 16);
    g_autoptr(GBytes) p = program(1000);
    deliver(&c, p);
    g_assert_no_error(c.error);
    close_cell(&c);
}

/* ----------------------------------------------------------------------- sessions */

static void session_without_machine(void)
{
    const CfgAgent agent = {
        .reply_timeout_s = 0.2, .reconnect_s = 0.02, .give_up_s = 0.3, .heartbeat_s = 0.05};
    Cell c;
    open_cell(&c);
    const FbSessionCallbacks callbacks = {on_status, on_done, &c};
    g_assert_null(fb_session_new(&(CfgTarget){.address = (char *)"can:vcan0", .unit_id = 1}, &agent,
                                 &callbacks, c.context, &c.error));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_UNREACHABLE);
    g_clear_error(&c.error);
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(c.server));
    fb_modbus_server_free(g_steal_pointer(&c.server));
    c.session = fb_session_new(&(CfgTarget){.address = address, .unit_id = 1}, &agent, &callbacks,
                               c.context, &c.error);
    fb_session_command(c.session, FB_COMMAND_HOLD, NULL);
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 1));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_UNREACHABLE);
    g_assert_cmpint(fb_session_status(c.session)->state, ==, FB_STATE_UNKNOWN);
    close_cell(&c);
}

/* What waits to set the machine in motion is dropped for a stop, which does not wait behind it. */
static void stop_drops_resumes(void)
{
    const CfgAgent agent = {
        .reply_timeout_s = 2, .reconnect_s = 0.02, .give_up_s = 10, .heartbeat_s = 0.05};
    Cell c;
    open_cell(&c);
    const FbSessionCallbacks callbacks = {on_status, on_done, &c};
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(c.server));
    fb_modbus_server_free(g_steal_pointer(&c.server));
    c.session = fb_session_new(&(CfgTarget){.address = address, .unit_id = 1}, &agent, &callbacks,
                               c.context, &c.error);
    const int64_t began_us = g_get_monotonic_time();
    fb_session_command(c.session, FB_COMMAND_RESUME, NULL);
    fb_session_command(c.session, FB_COMMAND_RESUME, NULL);
    turn(&c, 20);
    g_assert_cmpint(c.done[FB_TASK_COMMAND], ==, 0);
    fb_session_command(c.session, FB_COMMAND_HOLD, NULL);
    for (int resume = 1; resume <= 2; resume++) {
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], resume));
        g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED);
        g_assert_nonnull(c.error ? strstr(c.error->message, "a stop was asked for") : NULL);
    }
    g_assert_cmpint(g_get_monotonic_time() - began_us, <, 5000000);
    g_clear_error(&c.error);
    serve(&c, (uint16_t)strtoul(strrchr(address, ':') + 1, NULL, 10));
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 3)); /* the HOLD, of nothing */
    g_assert_nonnull(c.error ? strstr(c.error->message, "refused HOLD") : NULL);
    close_cell(&c);
}

/* A second agent is refused while the first owns the machine, and may stop it all the same. */
static void two_agents(void)
{
    Cell c;
    open_cell(&c);
    c.slow = true;
    open_session(&c);
    g_autoptr(GBytes) p = program(1000);
    deliver(&c, p);
    FbSession *first = c.session;
    open_session(&c);
    deliver(&c, p);
    g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED);
    fb_session_start(first);
    g_assert_true(run_until(&c, &c.starts, 1));
    fb_session_command(c.session, FB_COMMAND_HOLD, NULL);
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 1));
    g_assert_no_error(c.error);
    g_assert_cmpint(c.holds, ==, 1);
    fb_session_command(c.session, FB_COMMAND_RESUME, NULL);
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED);
    fb_session_free(first);
    close_cell(&c);
}

/* A command straight behind a task goes by the lease as it is, not as it was seen last. */
static void command_behind_a_task(void)
{
    Cell c;
    open_cell(&c);
    open_session(&c);
    g_autoptr(GBytes) p = program(1000);
    for (int i = 0; i < 10; i++) {
        deliver(&c, p);
        fb_session_start(c.session);
        g_assert_true(run_until(&c, &c.done[FB_TASK_RUN], i + 1));
        g_assert_no_error(c.error);
        fb_session_command(c.session, FB_COMMAND_ACKNOWLEDGE, NULL); /* the lease has just gone */
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2 * i + 1));
        g_assert_no_error(c.error);
        deliver(&c, p);
        fb_session_command(c.session, FB_COMMAND_CLOSE, NULL); /* it has just come */
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2 * i + 2));
        g_assert_no_error(c.error);
    }
    close_cell(&c);
}

/* The same agent twice: refused as soon as the first one is seen alive. */
static void same_agent_twice(void)
{
    Cell c;
    open_cell(&c);
    open_session(&c);
    fb_session_set_token(c.session, UINT64_C(0x500000007));
    g_autoptr(GBytes) p = program(1000);
    deliver(&c, p);
    FbSession *first = c.session;
    open_session(&c);
    fb_session_set_token(c.session, UINT64_C(0x500000007));
    const int64_t began_us = g_get_monotonic_time();
    deliver(&c, p);
    g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED);
    if (c.error)
        g_assert_nonnull(strstr(c.error->message, "another program with this agent's token"));
    /* reply_timeout and some beats; agent_timeout, when it would be reclaimed, is 5 s. */
    g_assert_cmpint(g_get_monotonic_time() - began_us, <, 4500000);
    FbStatus s;
    fb_session_free(g_steal_pointer(&c.session));
    turn(&c, 20);
    fb_receiver_status(c.receiver, g_get_monotonic_time(), &s);
    g_assert_cmphex(s.lease_owner, ==, 5);
    fb_session_free(first);
    close_cell(&c);
}

/* A session that ends in good order gives the lease back at once. */
static void farewell(void)
{
    Cell c;
    FbStatus s;
    open_cell(&c);
    open_session(&c);
    g_autoptr(GBytes) p = program(1000);
    deliver(&c, p);
    fb_receiver_status(c.receiver, 0, &s);
    g_assert_cmphex(s.lease_owner, !=, 0);
    fb_session_free(g_steal_pointer(&c.session));
    turn(&c, 20);
    fb_receiver_status(c.receiver, 0, &s);
    g_assert_cmphex(s.lease_owner, ==, 0);
    close_cell(&c);
}

/* The machine is switched off and on while it runs: never a second start, never a false end. */
static void machine_restarts(void)
{
    Cell c;
    open_cell(&c);
    c.slow = true;
    open_session(&c);
    g_autoptr(GBytes) p = program(1000);
    deliver(&c, p);
    fb_session_start(c.session);
    g_assert_true(run_until(&c, &c.starts, 1));
    const uint16_t port = fb_modbus_server_port(c.server);
    fb_modbus_server_free(c.server);
    fb_receiver_free(c.receiver);
    const FbReceiverOptions options = {.epoch = 78,
                                       .memory_bytes = 1 << 20,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    c.receiver = fb_receiver_new(&options);
    serve(&c, port);
    g_assert_true(run_until(&c, &c.done[FB_TASK_RUN], 1));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_LINK_LOST);
    g_assert_cmpint(c.starts, ==, 1);
    deliver(&c, p);
    g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED); /* it is OFF */
    machine(&c, FB_MACHINE_ACKNOWLEDGED);
    deliver(&c, p);
    g_assert_no_error(c.error);
    close_cell(&c);
}

/* Session numbers use all their bits: what the machine was told by, in many sessions. */
static void session_numbers(void)
{
    uint32_t all = UINT32_MAX, any = 0;
    for (int i = 0; i < 64; i++) {
        Cell c;
        FbStatus s;
        open_cell(&c);
        open_session(&c);
        fb_session_command(c.session, FB_COMMAND_HOLD, NULL);
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 1));
        fb_receiver_status(c.receiver, g_get_monotonic_time(), &s);
        g_assert_cmpuint(s.command_session, !=, 0);
        all &= s.command_session;
        any |= s.command_session;
        close_cell(&c);
    }
    g_assert_cmphex(all, ==, 0); /* by chance once in 10^17 tests */
    g_assert_cmphex(any, ==, UINT32_MAX);
}

static void add(void)
{
    g_test_add_func("/fieldbus/session/delivers-and-runs", delivers_and_runs);
    g_test_add_func("/fieldbus/session/hold-is-never-delayed", hold_is_never_delayed);
    g_test_add_func("/fieldbus/session/crowd", crowd);
    g_test_add_func("/fieldbus/session/without-machine", session_without_machine);
    g_test_add_func("/fieldbus/session/stop-drops-resumes", stop_drops_resumes);
    g_test_add_func("/fieldbus/session/two-agents", two_agents);
    g_test_add_func("/fieldbus/session/command-behind-a-task", command_behind_a_task);
    g_test_add_func("/fieldbus/session/same-agent-twice", same_agent_twice);
    g_test_add_func("/fieldbus/session/farewell", farewell);
    g_test_add_func("/fieldbus/session/numbers", session_numbers);
    g_test_add_func("/fieldbus/session/machine-restarts", machine_restarts);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
