/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The bytes of a TCP stream to the machine's Modbus side, in pieces of any size: how many bytes,
 * the bytes, and so on. Each whole ADU with a possible header is answered, in order, by its
 * transaction id; the first impossible header ends the connection; and however the stream is cut
 * into pieces, the answers are the same.
 */
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fieldbus/modbus/slave.h"
#include "tests/lib/fuzz/blocks.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

typedef struct {
    GMainContext *context;
    FbReceiver *receiver;
    FbModbusSlave *slave;
    FbMbap *mbap; /* NULL: ended */
    int peer;
    GByteArray *sent, *answers;
} Link;

static void act(FbDo what, void *data)
{
    Link *l = data;
    if (what == FB_DO_VERIFY)
        fb_receiver_machine(l->receiver, FB_MACHINE_VERIFIED, NULL, 1, NULL);
}

static void on_ready(FbMbap *mbap, void *data)
{
    (void)mbap;
    (void)data;
}

static void on_adu(FbMbap *mbap, const uint8_t *adu, size_t n, void *data)
{
    Link *l = data;
    FbModbusAnswer answer;
    fb_modbus_slave_adu(l->slave, fb_mbap_role(mbap), adu, n, 1, &answer);
    fb_mbap_send(mbap, answer.bytes, answer.n);
}

static void on_broken(FbMbap *mbap, const char *why, void *data)
{
    (void)why;
    ((Link *)data)->mbap = NULL;
    fb_mbap_free(mbap);
}

static void turn(Link *l)
{
    uint8_t bytes[4096];
    ssize_t got;
    while (g_main_context_iteration(l->context, FALSE))
        ;
    while ((got = recv(l->peer, bytes, sizeof bytes, MSG_DONTWAIT)) > 0)
        g_byte_array_append(l->answers, bytes, (guint)got);
}

static unsigned u16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

/* The next ADU of a stream: its bytes; 0: not whole; -1: impossible. */
static int next_adu(const uint8_t *bytes, size_t n)
{
    if (n < 6)
        return 0;
    const unsigned length = u16(bytes + 4);
    if (u16(bytes + 2) != 0 || length < 2 || length > 254)
        return -1;
    return n < length + 6 ? 0 : (int)length + 6;
}

static void check(const Link *l)
{
    const uint8_t *asked = l->sent->data, *told = l->answers->data;
    size_t n_asked = l->sent->len, n_told = l->answers->len;
    int n, n_answer;
    for (; (n = next_adu(asked, n_asked)) > 0; asked += n, n_asked -= (size_t)n) {
        n_answer = next_adu(told, n_told);
        g_assert(n_answer > 0);
        g_assert(u16(told) == u16(asked) && told[6] == asked[6] &&
                 (told[7] & 0x7f) == (asked[7] & 0x7f));
        told += n_answer;
        n_told -= (size_t)n_answer;
    }
    g_assert(n_told == 0);
    g_assert((n < 0) == (l->mbap == NULL));
    fuzz_check_machine(l->receiver, 1);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const FbMbapCallbacks callbacks = {on_ready, on_adu, on_broken};
    const FbReceiverOptions machine = {.epoch = 1,
                                       .memory_bytes = 4096,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    int pair[2];
    Link l = {.context = g_main_context_new(),
              .receiver = fb_receiver_new(&machine),
              .sent = g_byte_array_new(),
              .answers = g_byte_array_new()};
    g_assert(socketpair(AF_UNIX, SOCK_STREAM, 0, pair) == 0);
    fb_receiver_machine(l.receiver, FB_MACHINE_ACKNOWLEDGED, NULL, 1, NULL);
    l.peer = pair[0];
    l.slave = fb_modbus_slave_new(1, l.receiver, act, &l);
    l.mbap = fb_mbap_new(pair[1], NULL, NULL, &callbacks, &l, l.context);
    turn(&l);
    while (size >= 1 && l.mbap) {
        const size_t n = MIN(data[0], size - 1);
        if (n > 0 && send(l.peer, data + 1, n, MSG_NOSIGNAL) == (ssize_t)n)
            g_byte_array_append(l.sent, data + 1, (guint)n);
        turn(&l);
        data += 1 + n;
        size -= 1 + n;
    }
    turn(&l);
    check(&l);
    fb_mbap_free(l.mbap);
    fb_modbus_slave_free(l.slave);
    fb_receiver_free(l.receiver);
    g_main_context_unref(l.context);
    g_byte_array_unref(l.sent);
    g_byte_array_unref(l.answers);
    close(l.peer);
    return 0;
}
