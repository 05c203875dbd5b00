/* SPDX-License-Identifier: Apache-2.0 */
/* Replies past a filter: what is lost, doubled, damaged or late, and in which order they go. */
#include "fieldbus/replies.h"

#include <string.h>

#include "tests/lib/test.h"

typedef struct {
    FbFate fate;     /* of the next one */
    GString *sent;   /* "A1 B2 ": connection and byte */
    int64_t last_us; /* when something was sent last */
} Wire;

static FbFate fate_of(void *data)
{
    return ((Wire *)data)->fate;
}

static void on_send(void *connection, const uint8_t *bytes, size_t n, void *data)
{
    Wire *wire = data;
    g_string_append_printf(wire->sent, "%s%u ", (const char *)connection, n == 1 ? bytes[0] : 999);
    wire->last_us = g_get_monotonic_time();
}

static bool send_one(FbReplies *replies, Wire *wire, const char *connection, uint8_t byte,
                     FbFate fate)
{
    wire->fate = fate;
    return fb_replies_send(replies, (void *)(uintptr_t)connection, &byte, 1);
}

static void wait_until(int64_t end_us)
{
    while (g_get_monotonic_time() < end_us)
        if (!g_main_context_iteration(NULL, FALSE))
            g_usleep(1000);
}

static char a[] = "A", b[] = "B";

static void at_once(void)
{
    Wire wire = {.sent = g_string_new(NULL)};
    g_autoptr(FbReplies) replies = fb_replies_new(on_send, &wire, NULL);
    g_assert_true(send_one(replies, &wire, a, 1, (FbFate){.close = true}));
    fb_replies_filter(replies, fate_of, &wire);
    g_assert_true(send_one(replies, &wire, a, 2, (FbFate){.copies = 1}));
    g_assert_true(send_one(replies, &wire, a, 3, (FbFate){.copies = 0}));
    g_assert_true(send_one(replies, &wire, a, 4, (FbFate){.copies = 2}));
    g_assert_true(send_one(replies, &wire, a, 8, (FbFate){1, 0, true, 2, false}));
    g_assert_true(send_one(replies, &wire, a, 8, (FbFate){1, 0, true, 8000000, false}));
    g_assert_false(send_one(replies, &wire, a, 6, (FbFate){.copies = 1, .close = true}));
    g_assert_cmpstr(wire.sent->str, ==, "A1 A2 A4 A4 A12 A9 ");
    g_string_free(wire.sent, TRUE);
}

/* A late one holds up its own connection and no other; what waits dies with its connection. */
static void late(void)
{
    Wire wire = {.sent = g_string_new(NULL)};
    g_autoptr(FbReplies) replies = fb_replies_new(on_send, &wire, NULL);
    fb_replies_filter(replies, fate_of, &wire);
    const int64_t begin_us = g_get_monotonic_time();
    send_one(replies, &wire, a, 1, (FbFate){1, 60000, false, 0, false});
    send_one(replies, &wire, a, 2, (FbFate){.copies = 1});
    send_one(replies, &wire, a, 3, (FbFate){2, 1000, false, 0, false});
    send_one(replies, &wire, b, 4, (FbFate){.copies = 1});
    send_one(replies, &wire, b, 5, (FbFate){1, 20000, false, 0, false});
    g_assert_cmpstr(wire.sent->str, ==, "B4 ");
    wait_until(begin_us + 100000);
    g_assert_cmpstr(wire.sent->str, ==, "B4 B5 A1 A2 A3 A3 ");
    g_assert_cmpint(wire.last_us, >=, begin_us + 60000);
    send_one(replies, &wire, a, 6, (FbFate){1, 10000, false, 0, false});
    send_one(replies, &wire, b, 7, (FbFate){1, 10000, false, 0, false});
    fb_replies_forget(replies, a);
    wait_until(g_get_monotonic_time() + 30000);
    g_assert_cmpstr(wire.sent->str, ==, "B4 B5 A1 A2 A3 A3 B7 ");
    send_one(replies, &wire, a, 8, (FbFate){1, 1000000, false, 0, false});
    g_string_free(wire.sent, TRUE);
}

static void add(void)
{
    g_test_add_func("/fieldbus/replies/at-once", at_once);
    g_test_add_func("/fieldbus/replies/late", late);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
