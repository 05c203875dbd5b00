/* SPDX-License-Identifier: Apache-2.0 */
/* Both sides of the delivery over real sockets on loopback, in one main loop. */
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

/* ----------------------------------------------------------------- raw connections */

static int raw_connect(const Cell *c)
{
    const struct sockaddr_in to = {.sin_family = AF_INET,
                                   .sin_port = htons(fb_modbus_server_port(c->server)),
                                   .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    g_assert_cmpint(connect(fd, (const struct sockaddr *)&to, sizeof to), ==, 0);
    return fd;
}

static void turn(Cell *c, int times)
{
    for (int i = 0; i < times; i++)
        g_main_context_iteration(c->context, FALSE);
}

/* Bytes of the answer; 0: closed; -1: none within a second. */
static ssize_t raw_answer(Cell *c, int fd, uint8_t *answer)
{
    const int64_t end_us = g_get_monotonic_time() + G_USEC_PER_SEC;
    while (g_get_monotonic_time() < end_us) {
        turn(c, 1);
        const ssize_t n = recv(fd, answer, 260, MSG_DONTWAIT);
        if (n >= 0)
            return n;
    }
    return -1;
}

/* Sends a PDU to unit 1 and returns the length of the answer's. */
static ssize_t ask(Cell *c, int fd, const uint8_t *pdu, size_t n, uint8_t *answer)
{
    uint8_t adu[300] = {0xab, 0xcd, 0, 0, (uint8_t)((n + 1) >> 8), (uint8_t)(n + 1), 1};
    uint8_t reply[260];
    memcpy(adu + 7, pdu, n);
    g_assert_cmpint(send(fd, adu, n + 7, MSG_NOSIGNAL), ==, (ssize_t)n + 7);
    const ssize_t got = raw_answer(c, fd, reply);
    if (got < 8)
        return got;
    g_assert_true(memcmp(reply, adu, 4) == 0 && reply[6] == 1);
    g_assert_cmpint(reply[4] << 8 | reply[5], ==, got - 6);
    memcpy(answer, reply + 7, (size_t)got - 7);
    return got - 7;
}

#define BYTES(...) ((const uint8_t[]){__VA_ARGS__}), sizeof((const uint8_t[]){__VA_ARGS__})

static void assert_exception(Cell *c, int fd, const uint8_t *pdu, size_t n, int exception)
{
    uint8_t answer[260] = {0};
    g_assert_cmpint(ask(c, fd, pdu, n, answer), ==, 2);
    g_assert_cmphex(answer[0], ==, pdu[0] | 0x80);
    g_assert_cmpint(answer[1], ==, exception);
}

static void exceptions_as_documented(void)
{
    Cell c;
    uint8_t answer[260];
    open_cell(&c);
    const int fd = raw_connect(&c);
    for (int function = 1; function < 128; function++)
        if (function != 3 && function != 4 && function != 16 && function != 23)
            assert_exception(&c, fd, BYTES((uint8_t)function, 0, 0, 0, 1), 1);
    assert_exception(&c, fd, BYTES(3, 7, 255, 0, 2), 2);
    assert_exception(&c, fd, BYTES(4, 255, 255, 0, 1), 2);
    assert_exception(&c, fd, BYTES(16, 0, 0, 0, 1, 2, 0, 0), 2);
    assert_exception(&c, fd, BYTES(16, 4, 1, 0, 1, 2, 0, 0), 2);
    assert_exception(&c, fd, BYTES(16, 4, 0, 0, 1, 2, 0, 0), 2);
    assert_exception(&c, fd, BYTES(23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 0), 2);
    assert_exception(&c, fd, BYTES(3, 0, 0, 0, 0), 3);
    assert_exception(&c, fd, BYTES(3, 0, 0, 0, 126), 3);
    assert_exception(&c, fd, BYTES(3, 0, 0, 0), 3);
    assert_exception(&c, fd, BYTES(16, 4, 0, 0, 16, 30, 0), 3);
    assert_exception(&c, fd, BYTES(16, 4, 0), 3);
    assert_exception(&c, fd, BYTES(23, 0, 0, 0, 126, 5, 0, 0, 1, 2, 0, 0), 3);
    g_assert_cmpint(ask(&c, fd, BYTES(3, 0, 0, 0, 124), answer), ==, 250);
    g_assert_cmpint(ask(&c, fd, BYTES(4, 0, 0, 0, 1), answer), ==, 4);
    g_assert_cmpint(answer[2] << 8 | answer[3], ==, FB_PROTOCOL_VERSION);

    /* Another unit is not here; 0 and 255 are the device. */
    static const uint8_t units[] = {2, 0, 255};
    for (int i = 0; i < 3; i++) {
        const uint8_t adu[] = {0, 9, 0, 0, 0, 6, units[i], 3, 0, 0, 0, 1};
        g_assert_cmpint(send(fd, adu, sizeof adu, 0), ==, sizeof adu);
        g_assert_cmpint(raw_answer(&c, fd, answer), ==, i == 0 ? 9 : 11);
        g_assert_cmpint(answer[7], ==, i == 0 ? 0x83 : 3);
        g_assert_cmpint(answer[8], ==, i == 0 ? 11 : 2);
    }
    close(fd);

    /* A header that is none ends the connection. */
    static const uint8_t headers[][7] = {{0, 1, 0, 1, 0, 6, 1},
                                         {0, 1, 0, 0, 0, 1, 1},
                                         {0, 1, 0, 0, 0, 255, 1},
                                         {0, 1, 0, 0, 9, 9, 1}};
    for (size_t i = 0; i < G_N_ELEMENTS(headers); i++) {
        const int bad = raw_connect(&c);
        g_assert_cmpint(send(bad, headers[i], 7, 0), ==, 7);
        g_assert_cmpint(raw_answer(&c, bad, answer), ==, 0);
        close(bad);
    }
    close_cell(&c);
}

static size_t order_pdu(uint8_t *pdu, const FbOrder *order)
{
    uint8_t block[FB_BLOCK_BYTES];
    const size_t n = fb_wire_put_order(block, order);
    memcpy(pdu,
           (const uint8_t[]){16, FB_AT_COMMAND >> 8, FB_AT_COMMAND & 255, 0, (uint8_t)(n / 2),
                             (uint8_t)n},
           6);
    memcpy(pdu + 6, block, n);
    return n + 6;
}

/* FC16 and FC3 are enough for a plain master; nobody reads a token back. */
static void plain_master(void)
{
    Cell c;
    uint8_t pdu[260], answer[260];
    FbStatus s = {0};
    open_cell(&c);
    const int fd = raw_connect(&c);
    const FbOrder order = {.session = 3,
                           .seq = 1,
                           .epoch = 77,
                           .token = UINT64_C(0x1111111122222222),
                           .command = FB_COMMAND_LEASE};
    g_assert_cmpint(ask(&c, fd, pdu, order_pdu(pdu, &order), answer), ==, 5);
    g_assert_cmpint(ask(&c, fd, BYTES(3, 0, 0, 0, 124), answer), ==, 250);
    g_assert_true(fb_wire_get_status(answer + 2, 248, &s));
    g_assert_cmphex(s.lease_owner, ==, 0x11111111);
    g_assert_cmpint(s.answer, ==, FB_ANSWER_DONE);
    for (int at = 0; at + 125 <= FB_N_REGISTERS; at += 125) {
        g_assert_cmpint(ask(&c, fd, BYTES(3, (uint8_t)(at >> 8), (uint8_t)at, 0, 125), answer), ==,
                        252);
        g_assert_null(memmem(answer, 252, "\x22\x22\x22\x22", 4));
    }
    close(fd);
    close_cell(&c);
}

/* ------------------------------------------------------------------------ strangers */

enum { ADU_MOST = 270 };

/* An ADU of random bytes, most of them a write of the right size to a block that may be written. */
static size_t stranger(GRand *rand, uint8_t *adu)
{
    static const struct {
        uint16_t at;
        uint8_t registers, size_at, size; /* where the block says its own size */
    } blocks[] = {{FB_AT_COMMAND, 16, 27, 0}, {FB_AT_CHUNK, 121, 17, 218}, {FB_AT_BEAT, 10, 0, 0}};
    const bool both = g_rand_boolean(rand);
    const int i = g_rand_int_range(rand, 0, G_N_ELEMENTS(blocks));
    const size_t at = both ? 12 : 8, n = 2 * (size_t)blocks[i].registers;
    for (size_t j = 0; j < ADU_MOST; j++)
        adu[j] = (uint8_t)g_rand_int(rand);
    adu[2] = adu[3] = adu[4] = 0;
    adu[5] = (uint8_t)g_rand_int_range(rand, 2, 255);
    adu[6] = 1;
    if (g_rand_int_range(rand, 0, 4) == 0)
        return 6 + (size_t)adu[5];
    const uint8_t write[] = {(uint8_t)(blocks[i].at >> 8), (uint8_t)blocks[i].at, 0,
                             blocks[i].registers, (uint8_t)n};
    adu[7] = both ? 23 : 16;
    if (both)
        memcpy(adu + 8, (const uint8_t[]){0, 0, 0, 124}, 4);
    memcpy(adu + at, write, sizeof write);
    adu[at + 5] &= (uint8_t)g_rand_int(rand);
    if (blocks[i].size_at) {
        adu[at + 5 + blocks[i].size_at - 1] = 0;
        adu[at + 5 + blocks[i].size_at] = blocks[i].size;
    }
    adu[5] = (uint8_t)(at - 6 + sizeof write + n);
    return 6 + (size_t)adu[5];
}

static void strangers_change_nothing(void)
{
    Cell c;
    open_cell(&c);
    FbStatus before, after;
    fb_receiver_status(c.receiver, 0, &before);
    int fd = raw_connect(&c);
    g_autoptr(GRand) rand = g_rand_new_with_seed(7);
    for (int i = 0; i < 20000; i++) {
        uint8_t adu[ADU_MOST], answer[260];
        const size_t n = stranger(rand, adu);
        g_assert_cmpint(send(fd, adu, n, MSG_NOSIGNAL), ==, (ssize_t)n);
        if (raw_answer(&c, fd, answer) > 0)
            continue;
        close(fd);
        fd = raw_connect(&c);
    }
    close(fd);
    fb_receiver_status(c.receiver, 0, &after);
    const uint64_t *counts = fb_receiver_counts(c.receiver);
    g_test_message("refused: %" G_GUINT64_FORMAT " malformed, %" G_GUINT64_FORMAT " CRC",
                   counts[FB_ANSWER_MALFORMED], counts[FB_ANSWER_CRC]);
    g_assert_cmpuint(counts[FB_ANSWER_MALFORMED] + counts[FB_ANSWER_CRC], >, 10000);
    g_assert_cmpuint(counts[FB_ANSWER_DONE], ==, 0);
    after.heartbeat = before.heartbeat;
    after.answer = before.answer;
    after.chunk_answer = before.chunk_answer;
    g_assert_true(memcmp(&before, &after, sizeof before) == 0);
    close_cell(&c);
}

/* Pure noise on the stream: the connection ends, the server lives. */
static void noise(void)
{
    Cell c;
    open_cell(&c);
    g_autoptr(GRand) rand = g_rand_new_with_seed(8);
    for (int i = 0; i < 300; i++) {
        uint8_t bytes[512];
        const int fd = raw_connect(&c);
        for (size_t j = 0; j < sizeof bytes; j++)
            bytes[j] = (uint8_t)g_rand_int(rand);
        g_assert_cmpint(send(fd, bytes, (size_t)g_rand_int_range(rand, 1, 512), MSG_NOSIGNAL), >,
                        0);
        turn(&c, 4);
        close(fd);
        turn(&c, 4);
    }
    const int fd = raw_connect(&c);
    uint8_t answer[260];
    g_assert_cmpint(ask(&c, fd, BYTES(3, 0, 0, 0, 124), answer), ==, 250);
    close(fd);
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
    const uint64_t gates[] = {g_bytes_get_size(p)};
    fb_session_deliver(c.session, p, gates, 1);
    g_assert_true(run_until(&c, &c.done[FB_TASK_DELIVER], 1));
    fb_session_start(c.session);
    g_assert_true(run_until(&c, &c.starts, 1));
    int64_t worst_us = 0;
    for (int i = 0; i < 20; i++) {
        drip(fds, G_N_ELEMENTS(fds), i);
        const int64_t began_us = g_get_monotonic_time();
        fb_session_command(c.session, FB_COMMAND_HOLD);
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2 * i + 1));
        worst_us = MAX(worst_us, g_get_monotonic_time() - began_us);
        g_assert_no_error(c.error);
        g_assert_cmpstr(fb_state_name(fb_receiver_state(c.receiver)), ==, "HELD");
        fb_session_command(c.session, FB_COMMAND_RESUME);
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2 * i + 2));
        g_assert_no_error(c.error);
        g_assert_cmpstr(fb_state_name(fb_receiver_state(c.receiver)), ==, "RUNNING");
    }
    g_test_message("hold, worst of 20 with dripping clients: %.3f ms", (double)worst_us / 1000);
    g_assert_cmpint(worst_us, <, 500000);
    g_assert_cmpint(c.holds, ==, 20);
    fb_session_command(c.session, FB_COMMAND_ABORT);
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
    const uint64_t gates[] = {g_bytes_get_size(p)};
    fb_session_deliver(c.session, p, gates, 1);
    g_assert_true(run_until(&c, &c.done[FB_TASK_DELIVER], 1));
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
    g_assert_null(fb_session_new("can://vcan0", 1, &agent, &callbacks, c.context, &c.error));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_UNREACHABLE);
    g_clear_error(&c.error);
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(c.server));
    fb_modbus_server_free(g_steal_pointer(&c.server));
    c.session = fb_session_new(address, 1, &agent, &callbacks, c.context, &c.error);
    fb_session_command(c.session, FB_COMMAND_HOLD);
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 1));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_UNREACHABLE);
    g_assert_cmpint(fb_session_status(c.session)->state, ==, FB_STATE_UNKNOWN);
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
    const uint64_t gates[] = {g_bytes_get_size(p)};
    fb_session_deliver(c.session, p, gates, 1);
    g_assert_true(run_until(&c, &c.done[FB_TASK_DELIVER], 1));
    FbSession *first = c.session;
    open_session(&c);
    fb_session_deliver(c.session, p, gates, 1);
    g_assert_true(run_until(&c, &c.done[FB_TASK_DELIVER], 2));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED);
    fb_session_start(first);
    g_assert_true(run_until(&c, &c.starts, 1));
    fb_session_command(c.session, FB_COMMAND_HOLD);
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 1));
    g_assert_no_error(c.error);
    g_assert_cmpint(c.holds, ==, 1);
    fb_session_command(c.session, FB_COMMAND_RESUME);
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 2));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED);
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
    const uint64_t gates[] = {g_bytes_get_size(p)};
    fb_session_deliver(c.session, p, gates, 1);
    g_assert_true(run_until(&c, &c.done[FB_TASK_DELIVER], 1));
    fb_receiver_status(c.receiver, 0, &s);
    g_assert_cmphex(s.lease_owner, !=, 0);
    fb_session_free(g_steal_pointer(&c.session));
    turn(&c, 20);
    fb_receiver_status(c.receiver, 0, &s);
    g_assert_cmphex(s.lease_owner, ==, 0);
    close_cell(&c);
}

/* --------------------------------------------------------------------------- judge */

static void on_mbpoll(GObject *object, GAsyncResult *result, gpointer data)
{
    char **out = data;
    g_subprocess_communicate_utf8_finish(G_SUBPROCESS(object), result, out, NULL, NULL);
    if (!*out)
        *out = g_strdup("");
}

/* mbpoll, a master that we did not write, reads what the document says. */
static void mbpoll_reads_the_map(void)
{
    g_autofree char *program_path = g_find_program_in_path("mbpoll");
    if (!program_path) {
        g_test_skip("mbpoll is not installed");
        return;
    }
    Cell c;
    char *out = NULL;
    g_autoptr(GError) error = NULL;
    open_cell(&c);
    g_autofree char *port = g_strdup_printf("%u", fb_modbus_server_port(c.server));
    g_main_context_push_thread_default(c.context);
    g_autoptr(GSubprocess) mbpoll = g_subprocess_new(
        G_SUBPROCESS_FLAGS_STDOUT_PIPE, &error, program_path, "-0", "-1", "-m", "tcp", "-p", port,
        "-a", "1", "-r", "0", "-c", "4", "-t", "4:hex", "127.0.0.1", NULL);
    g_assert_no_error(error);
    g_subprocess_communicate_utf8_async(mbpoll, NULL, NULL, on_mbpoll, &out);
    g_main_context_pop_thread_default(c.context);
    const int64_t end_us = g_get_monotonic_time() + 10 * G_USEC_PER_SEC;
    while (!out && g_get_monotonic_time() < end_us)
        if (!g_main_context_iteration(c.context, FALSE))
            g_usleep(1000);
    g_assert_nonnull(out);
    g_test_message("%s", out ? out : "");
    g_assert_nonnull(out ? strstr(out, "0x0100") : NULL); /* version */
    g_assert_nonnull(out ? strstr(out, "0x0001") : NULL); /* IDLE */
    g_assert_nonnull(out ? strstr(out, "0x004D") : NULL); /* epoch 77, low word */
    g_free(out);
    close_cell(&c);
}

static void add(void)
{
    g_test_add_func("/fieldbus/modbus/delivers-and-runs", delivers_and_runs);
    g_test_add_func("/fieldbus/modbus/exceptions-as-documented", exceptions_as_documented);
    g_test_add_func("/fieldbus/modbus/plain-master", plain_master);
    g_test_add_func("/fieldbus/modbus/strangers-change-nothing", strangers_change_nothing);
    g_test_add_func("/fieldbus/modbus/noise", noise);
    g_test_add_func("/fieldbus/modbus/hold-is-never-delayed", hold_is_never_delayed);
    g_test_add_func("/fieldbus/modbus/crowd", crowd);
    g_test_add_func("/fieldbus/modbus/session-without-machine", session_without_machine);
    g_test_add_func("/fieldbus/modbus/two-agents", two_agents);
    g_test_add_func("/fieldbus/modbus/farewell", farewell);
    g_test_add_func("/fieldbus/modbus/mbpoll-reads-the-map", mbpoll_reads_the_map);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
