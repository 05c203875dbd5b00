/* SPDX-License-Identifier: Apache-2.0 */
/* The machine's Modbus server as plain masters, strangers and a foreign tool see it:
 * docs/protocol.md, section 2.9. */
#include <errno.h>
#include <sys/resource.h>

#include "tests/unit/fieldbus_cell.h"

/* ----------------------------------------------------------------- raw connections */

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
    const uint64_t before = fb_modbus_server_exceptions(c->server);
    g_assert_cmpint(ask(c, fd, pdu, n, answer), ==, 2);
    g_assert_cmphex(answer[0], ==, pdu[0] | 0x80);
    g_assert_cmpint(answer[1], ==, exception);
    g_assert_cmpuint(fb_modbus_server_exceptions(c->server), ==, before + 1);
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

/* Somebody who asks as fast as it can and never reads is closed once his answers fill the sockets
 * and OUT_BYTES: the machine's memory does not grow by what he asks. */
static void deaf_flood(void)
{
    enum { REQUESTS = 512, SOCKETS_BYTES = 20 << 20 }; /* Linux's buffers: 4 MB, 6 MB; twice that */
    static const uint8_t read[] = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 124};
    uint8_t many[REQUESTS * sizeof read], answer[260];
    Cell c;
    size_t asked = 0;
    open_cell(&c);
    const int deaf = raw_connect(&c), other = raw_connect(&c);
    for (size_t i = 0; i < REQUESTS; i++)
        memcpy(many + i * sizeof read, read, sizeof read);
    while (asked * 257 / sizeof read < 2 * SOCKETS_BYTES) {
        const ssize_t n = send(deaf, many, sizeof many, MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n < 0 && errno != EAGAIN)
            break;
        asked += (size_t)MAX(n, 0) / sizeof read * sizeof read;
        if (n > 0 && (size_t)n % sizeof read)
            send(deaf, read + (size_t)n % sizeof read, sizeof read - (size_t)n % sizeof read,
                 MSG_NOSIGNAL);
        turn(&c, 6); /* as many reads as that takes */
    }
    g_test_message("closed after %zu bytes of answers", asked / sizeof read * 257);
    g_assert_cmpuint(asked * 257 / sizeof read, <, SOCKETS_BYTES);
    g_assert_cmpint(ask(&c, other, BYTES(3, 0, 0, 0, 124), answer), ==, 250);
    close(deaf);
    close(other);
    close_cell(&c);
}

/* Where no descriptor is left the server waits, and does not spin; then it goes on. */
static void no_descriptor(void)
{
    struct rlimit before;
    Cell c;
    uint8_t answer[260];
    int turns = 0;
    open_cell(&c);
    turn(&c, 4);
    const int fd = raw_connect(&c), lowest_free = dup(fd);
    close(lowest_free);
    g_assert_cmpint(getrlimit(RLIMIT_NOFILE, &before), ==, 0);
    const struct rlimit none = {(rlim_t)lowest_free, before.rlim_max};
    g_assert_cmpint(setrlimit(RLIMIT_NOFILE, &none), ==, 0);
    const int64_t end_us = g_get_monotonic_time() + 350000;
    while (g_get_monotonic_time() < end_us)
        turns += g_main_context_iteration(c.context, FALSE);
    g_assert_cmpint(setrlimit(RLIMIT_NOFILE, &before), ==, 0);
    g_test_message("%d turns", turns);
    g_assert_cmpint(turns, >, 2);
    g_assert_cmpint(turns, <, 40);
    g_assert_cmpint(ask(&c, fd, BYTES(3, 0, 0, 0, 124), answer), ==, 250);
    close(fd);
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
    g_assert_nonnull(out ? strstr(out, "0x0101") : NULL); /* version */
    g_assert_nonnull(out ? strstr(out, "0x0001") : NULL); /* IDLE */
    g_assert_nonnull(out ? strstr(out, "0x004D") : NULL); /* epoch 77, low word */
    g_free(out);
    close_cell(&c);
}

static void add(void)
{
    g_test_add_func("/fieldbus/modbus/exceptions-as-documented", exceptions_as_documented);
    g_test_add_func("/fieldbus/modbus/plain-master", plain_master);
    g_test_add_func("/fieldbus/modbus/strangers-change-nothing", strangers_change_nothing);
    g_test_add_func("/fieldbus/modbus/noise", noise);
    g_test_add_func("/fieldbus/modbus/deaf-flood", deaf_flood);
    g_test_add_func("/fieldbus/modbus/no-descriptor", no_descriptor);
    g_test_add_func("/fieldbus/modbus/mbpoll-reads-the-map", mbpoll_reads_the_map);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
