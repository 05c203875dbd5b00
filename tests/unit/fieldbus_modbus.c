/* SPDX-License-Identifier: Apache-2.0 */
/* Both sides of the delivery over real sockets on loopback, in one main loop. */
#include <arpa/inet.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fieldbus/fieldbus.h"
#include "fieldbus/wire.h"
#include "tests/lib/test.h"

/* A machine that runs a program in no time unless `slow`, and a session with it. */
typedef struct {
    GMainContext *context;
    FbReceiver *receiver;
    FbModbusServer *server;
    FbSession *session;
    bool slow;
    int starts, holds, done[3], shown;
    GBytes *executed;
    GError *error;
} Cell;

static void machine(Cell *c, FbMachineEvent event)
{
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    fb_receiver_machine(c->receiver, event, NULL, g_get_monotonic_time(), actions);
    g_assert_cmpuint(actions->len, ==, 0);
}

static void act(FbDo what, void *data)
{
    Cell *c = data;
    switch (what) {
    case FB_DO_VERIFY:
        machine(c, FB_MACHINE_VERIFIED);
        break;
    case FB_DO_START:
        c->starts++;
        g_clear_pointer(&c->executed, g_bytes_unref);
        c->executed = g_bytes_ref(fb_receiver_program(c->receiver));
        if (!c->slow)
            machine(c, FB_MACHINE_COMPLETE);
        break;
    case FB_DO_HOLD:
        c->holds++;
        machine(c, FB_MACHINE_HELD);
        break;
    case FB_DO_RESUME:
        machine(c, FB_MACHINE_RUNNING);
        break;
    case FB_DO_ABORT:
        machine(c, FB_MACHINE_ABORTED);
        break;
    default:
        break;
    }
}

static void on_status(const FbStatus *status, void *data)
{
    (void)status;
    ((Cell *)data)->shown++;
}

static void on_done(FbTask task, const GError *error, void *data)
{
    Cell *c = data;
    c->done[task]++;
    g_clear_error(&c->error);
    c->error = error ? g_error_copy(error) : NULL;
}

static void open_session(Cell *c)
{
    const CfgAgent agent = {
        .reply_timeout_s = 2, .reconnect_s = 0.02, .give_up_s = 5, .heartbeat_s = 0.05};
    const FbSessionCallbacks callbacks = {on_status, on_done, c};
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(c->server));
    c->session = fb_session_new(address, 1, &agent, &callbacks, c->context, &c->error);
    g_assert_no_error(c->error);
}

static void open_cell(Cell *c)
{
    const FbReceiverOptions options = {.epoch = 77,
                                       .memory_bytes = 8 << 20,
                                       .on_agent_loss = CFG_AGENT_LOSS_HOLD,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    *c = (Cell){.context = g_main_context_new(), .receiver = fb_receiver_new(&options)};
    c->server = fb_modbus_server_new("127.0.0.1", 0, 1, c->receiver, act, c, c->context, &c->error);
    g_assert_no_error(c->error);
    machine(c, FB_MACHINE_ACKNOWLEDGED);
}

static void close_cell(Cell *c)
{
    fb_session_free(c->session);
    fb_modbus_server_free(c->server);
    fb_receiver_free(c->receiver);
    g_main_context_unref(c->context);
    g_bytes_unref(c->executed);
    g_clear_error(&c->error);
}

/* Runs the loop until *count reaches `least`, for 20 s at most. */
static bool run_until(Cell *c, const int *count, int least)
{
    const int64_t end_us = g_get_monotonic_time() + 20000000;
    while (*count < least && g_get_monotonic_time() < end_us)
        if (!g_main_context_iteration(c->context, FALSE))
            g_usleep(200);
    return *count >= least;
}

static GBytes *program(size_t n)
{
    GString *s = g_string_new(NULL);
    for (int i = 0; s->len < n; i++)
        g_string_append_printf(s, "N%d G1 X%d.%03d\n", i, i % 97, i % 1000);
    return g_string_free_to_bytes(s);
}

static void delivers_and_runs(void)
{
    Cell c;
    open_cell(&c);
    open_session(&c);
    g_autoptr(GBytes) p = program(300000);
    const uint64_t gates[] = {g_bytes_get_size(p)};
    fb_session_deliver(c.session, p, gates, 1);
    g_assert_true(run_until(&c, &c.done[FB_TASK_DELIVER], 1));
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

static void add(void)
{
    g_test_add_func("/fieldbus/modbus/delivers-and-runs", delivers_and_runs);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
