/* SPDX-License-Identifier: Apache-2.0 */
/* A machine with its Modbus server, and a session with it, over loopback in one main loop. */
#ifndef TESTS_UNIT_FIELDBUS_CELL_H
#define TESTS_UNIT_FIELDBUS_CELL_H

#include <arpa/inet.h>
#include <gio/gio.h>
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
    int starts, holds, done[FB_N_TASKS], shown;
    GBytes *executed;
    GError *error;
} Cell;

static inline void machine(Cell *c, FbMachineEvent event)
{
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    fb_receiver_machine(c->receiver, event, NULL, g_get_monotonic_time(), actions);
    g_assert_cmpuint(actions->len, ==, 0);
}

static inline void act(FbDo what, void *data)
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

static inline void on_status(const FbStatus *status, void *data)
{
    (void)status;
    ((Cell *)data)->shown++;
}

static inline void on_done(FbTask task, const GError *error, void *data)
{
    Cell *c = data;
    c->done[task]++;
    g_clear_error(&c->error);
    c->error = error ? g_error_copy(error) : NULL;
}

static inline void open_session(Cell *c)
{
    const CfgAgent agent = {
        .reply_timeout_s = 2, .reconnect_s = 0.02, .give_up_s = 5, .heartbeat_s = 0.05};
    const FbSessionCallbacks callbacks = {on_status, on_done, c};
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(c->server));
    c->session = fb_session_new(&(CfgTarget){.address = address, .unit_id = 1}, &agent, &callbacks,
                                c->context, &c->error);
    g_assert_no_error(c->error);
}

/* The machine's server, plain, on this port. */
static inline void serve(Cell *c, uint16_t port)
{
    const FbModbusServerOptions options = {.host = "127.0.0.1", .port = port, .unit_id = 1};
    c->server = fb_modbus_server_new(&options, c->receiver, act, c, c->context, &c->error);
    g_assert_no_error(c->error);
}

static inline void open_cell(Cell *c)
{
    const FbReceiverOptions options = {.epoch = 77,
                                       .memory_bytes = 8 << 20,
                                       .on_agent_loss = CFG_AGENT_LOSS_HOLD,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    *c = (Cell){.context = g_main_context_new(), .receiver = fb_receiver_new(&options)};
    serve(c, 0);
    machine(c, FB_MACHINE_ACKNOWLEDGED);
}

static inline void close_cell(Cell *c)
{
    fb_session_free(c->session);
    fb_modbus_server_free(c->server);
    fb_receiver_free(c->receiver);
    g_main_context_unref(c->context);
    g_bytes_unref(c->executed);
    g_clear_error(&c->error);
}

/* Runs the loop until *count reaches `least`, for 20 s at most. */
static inline bool run_until(Cell *c, const int *count, int least)
{
    const int64_t end_us = g_get_monotonic_time() + 20000000;
    while (*count < least && g_get_monotonic_time() < end_us)
        if (!g_main_context_iteration(c->context, FALSE))
            g_usleep(200);
    return *count >= least;
}

static inline GBytes *program(size_t n)
{
    GString *s = g_string_new(NULL);
    for (int i = 0; s->len < n; i++)
        g_string_append_printf(s, "N%d G1 X%d.%03d\n", i, i % 97, i % 1000);
    return g_string_free_to_bytes(s);
}

static inline int raw_connect(const Cell *c)
{
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons(fb_modbus_server_port(c->server)),
                                   .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    g_assert_cmpint(connect(fd, (const struct sockaddr *)&to, sizeof to), ==, 0);
    return fd;
}

static inline void turn(Cell *c, int times)
{
    for (int i = 0; i < times; i++)
        g_main_context_iteration(c->context, FALSE);
}

#endif
