/* SPDX-License-Identifier: Apache-2.0 */
/* Who has no key on a CAN bus, but hears everything: whatever he sends, on any identifier, nothing
 * changes on the machine, nobody loses his channel, and each message and frame is counted. */
#include "tests/unit/fieldbus_hub.h"

enum { SEED = 20260301, STRANGE = 100000 };

/* STATUS as bytes, without what time alone changes. */
static void snapshot(const CanCell *c, uint8_t *block)
{
    FbStatus s;
    fb_receiver_status(c->cell.receiver, g_get_monotonic_time(), &s);
    s.heartbeat = s.lease_ms = 0;
    fb_wire_put_status(block, &s);
}

/* What the machine has refused; a HELLO that nobody goes on with is one. */
static uint64_t refused(const CanCell *c)
{
    const FbCanCounts n = fb_can_server_counts(c->server);
    return n.forged + n.replayed + n.malformed + n.hellos - n.openings;
}

static void command(CanCell *c, FbCommand what)
{
    const int before = c->cell.done[FB_TASK_COMMAND];
    fb_session_command(c->cell.session, what, NULL);
    g_assert_true(run_until(&c->cell, &c->cell.done[FB_TASK_COMMAND], before + 1));
    g_assert_no_error(c->cell.error);
}

/* A session that has done all that one can: the stranger has it recorded. It is running then. */
static void perform(CanCell *c, GBytes *p)
{
    const int starts = c->cell.starts;
    open_can_session(c);
    can_deliver(c, p);
    g_assert_no_error(c->cell.error);
    fb_session_start(c->cell.session);
    g_assert_true(run_until(&c->cell, &c->cell.starts, starts + 1));
    command(c, FB_COMMAND_HOLD);
    command(c, FB_COMMAND_RESUME);
}

/* The machine runs a program for the session; an earlier one of the same number was aborted. */
static void open_watched(CanCell *c, bool fd)
{
    open_can(c, fd);
    c->cell.slow = true;
    g_autoptr(GBytes) p = program(9000);
    perform(c, p);
    command(c, FB_COMMAND_ABORT);
    g_clear_pointer(&c->cell.session, fb_session_free);
    perform(c, p);
}

static bool is_served(const Sent *sent)
{
    const unsigned offset = (unsigned)sent->id - BASE;
    return sent->frame ? offset < AGENTS
                       : (offset & 0xf) < AGENTS && (offset >> 4 == 2 || offset >> 4 == 4);
}

/* Puts it on the bus, and waits until the machine has judged it. */
static void put_in(CanCell *c, const Sent *sent)
{
    const uint64_t expected = refused(c) + is_served(sent);
    const int64_t end_us = g_get_monotonic_time() + G_USEC_PER_SEC;
    hub_pass(&c->hub, sent, NULL);
    while (refused(c) < expected && g_get_monotonic_time() < end_us)
        g_main_context_iteration(c->cell.context, FALSE);
    if (refused(c) != expected) {
        g_test_message("on %x, %zu bytes, %02x%02x…", sent->id, sent->n, sent->bytes[0],
                       sent->bytes[1]);
        g_assert_cmpuint(refused(c), ==, expected);
    }
}

static void random_bytes(GRand *random, uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++)
        bytes[i] = (uint8_t)g_rand_int(random);
}

/* Random bytes on any identifier of the machine and its agents. */
static void invent(GRand *random, Sent *sent)
{
    static const uint16_t offsets[] = {0, 0x10, 0x20, 0x30, 0x40, 0x50};
    *sent = (Sent){.id = (uint16_t)(BASE + offsets[g_rand_int_range(random, 0, 6)])};
    sent->frame = sent->id <= BEAT_ID;
    if (sent->id != BEAT_ID)
        sent->id = (uint16_t)(sent->id + g_rand_int_range(random, 0, AGENTS + 1));
    sent->fd = !sent->frame && g_rand_boolean(random);
    sent->n = (size_t)g_rand_int_range(random, 1,
                                       sent->frame              ? 9
                                       : g_rand_boolean(random) ? 64
                                                                : FB_CAN_MESSAGE_BYTES + 2);
    random_bytes(random, sent->bytes, sent->n);
    if (!sent->frame && g_rand_boolean(random)) /* as a kind that there is */
        sent->bytes[0] = (uint8_t)g_rand_int_range(random, 1, 22);
}

/* What was heard, as it was or damaged, from the same or in another's name. */
static void repeat(GRand *random, const GPtrArray *log, guint n_heard, Sent *sent)
{
    *sent = *(const Sent *)log->pdata[g_rand_int_range(random, 0, (gint32)n_heard)];
    switch (g_rand_int_range(random, 0, 5)) {
    case 0:
        break;
    case 1:
        sent->bytes[g_rand_int_range(random, 0, (gint32)sent->n)] ^=
            (uint8_t)(1 << g_rand_int_range(random, 0, 8));
        break;
    case 2:
        sent->n = (size_t)g_rand_int_range(random, 1, (gint32)sent->n + 1);
        break;
    case 3:
        if (!sent->frame)
            sent->id ^= (uint16_t)(g_rand_boolean(random) ? 0x60 : 1);
        break;
    case 4:
        if (!sent->frame)
            sent->fd = !sent->fd;
        break;
    }
}

/* With keys, but not the right ones; the counter is far ahead. */
static void seal_wrongly(GRand *random, Sent *sent)
{
    FbCanKey key = {.n = 32};
    random_bytes(random, key.bytes, key.n);
    *sent = (Sent){.id = g_rand_boolean(random) ? CONTROL_ID : WORK_ID, .fd = true, .n = 53};
    random_bytes(random, sent->bytes, sent->n);
    sent->bytes[0] = (uint8_t)g_rand_int_range(random, 1, 5);
    sent->n = fb_can_seal(sent->bytes, sent->n, 1 << 30, &key);
}

static void nothing_changes(void)
{
    CanCell c;
    uint8_t before[FB_BLOCK_BYTES], after[FB_BLOCK_BYTES];
    g_autofree Sent *sent = g_new(Sent, 1);
    GRand *random = g_rand_new_with_seed(SEED);
    open_watched(&c, true);
    const guint n_heard = c.hub.log->len; /* the session goes on, and the log with it */
    const FbCanCounts first = fb_can_server_counts(c.server);
    const int starts = c.cell.starts, holds = c.cell.holds;
    snapshot(&c, before);
    const uint64_t enough = refused(&c) + STRANGE;
    unsigned others = 0; /* for the agents: the machine does not take them */
    while (refused(&c) < enough) {
        const int how = g_rand_int_range(random, 0, 5);
        if (how < 2)
            invent(random, sent);
        else if (how < 4)
            repeat(random, c.hub.log, n_heard, sent);
        else
            seal_wrongly(random, sent);
        put_in(&c, sent);
        others += !is_served(sent);
    }
    snapshot(&c, after);
    g_assert_cmpint(memcmp(before, after, FB_STATUS_BYTES), ==, 0);
    g_assert_cmpint(c.cell.starts, ==, starts);
    g_assert_cmpint(c.cell.holds, ==, holds);
    const FbCanCounts last = fb_can_server_counts(c.server);
    g_test_message("seed %d: %d strange messages and frames: %" G_GUINT64_FORMAT
                   " forged, %" G_GUINT64_FORMAT " replayed, %" G_GUINT64_FORMAT
                   " malformed, %" G_GUINT64_FORMAT " hellos; and %u to the agents",
                   SEED, STRANGE, last.forged - first.forged, last.replayed - first.replayed,
                   last.malformed - first.malformed, last.hellos - first.hellos, others);
    g_assert_cmpuint(last.replayed, >, first.replayed + 100);
    g_assert_cmpuint(last.openings, ==, first.openings);
    g_assert_cmpuint(last.breaks, ==, 0);
    /* The session's channels have outlived it all. */
    g_assert_cmpstr(fb_state_name(fb_session_status(c.cell.session)->state), ==, "RUNNING");
    command(&c, FB_COMMAND_ABORT);
    g_assert_cmpuint(fb_can_server_counts(c.server).openings, ==, first.openings);
    close_can(&c);
    g_rand_free(random);
}

/* All that an earlier opening heard, in its order: HELLO, messages, STOP. */
static void replayed_in_order(void)
{
    CanCell c;
    uint8_t before[FB_BLOCK_BYTES], after[FB_BLOCK_BYTES];
    open_watched(&c, false);
    const guint n = c.hub.log->len;
    unsigned put = 0;
    snapshot(&c, before);
    for (guint i = 0; i < n; i++) {
        const Sent *sent = c.hub.log->pdata[i];
        if (!is_served(sent))
            continue;
        put_in(&c, sent);
        put++;
    }
    snapshot(&c, after);
    g_assert_cmpint(memcmp(before, after, FB_STATUS_BYTES), ==, 0);
    g_assert_cmpuint(put, >, 30);
    command(&c, FB_COMMAND_HOLD);
    close_can(&c);
}

static void wrong_key(void)
{
    CanCell c;
    uint8_t before[FB_BLOCK_BYTES], after[FB_BLOCK_BYTES];
    static const FbCanKey other = {"another one's key", 16};
    open_can(&c, true);
    snapshot(&c, before);
    c.cell.session = new_can_session(&c, hub_bus(&c.hub), &other, 0, 0.1);
    g_autoptr(GBytes) p = program(500);
    can_deliver(&c, p);
    g_assert_error(c.cell.error, FB_ERROR, FB_ERROR_UNREACHABLE);
    snapshot(&c, after);
    g_assert_cmpint(memcmp(before, after, FB_STATUS_BYTES), ==, 0);
    g_assert_cmpuint(fb_can_server_counts(c.server).forged, >, 10);
    g_assert_cmpuint(fb_can_server_counts(c.server).hellos, ==, 0);
    close_can(&c);
}

/* Beats of yesterday and invented ones: the agent asks for nothing because of them. */
static void strange_beats(void)
{
    CanCell c;
    GRand *random = g_rand_new_with_seed(SEED);
    g_autofree Sent *sent = g_new0(Sent, 1);
    open_can(&c, false);
    const CfgAgent rarely = {
        .reply_timeout_s = 1, .reconnect_s = 0.02, .give_up_s = 5, .heartbeat_s = 60, .window = 1};
    const FbSessionCallbacks callbacks = {on_status, on_done, &c.cell};
    g_autoptr(FbCanAgent) who = fb_can_agent_new_on(hub_bus(&c.hub), &KEY, BASE, 0);
    c.cell.session = fb_session_new_on_can("can://hub", who, &rarely, &callbacks, c.cell.context);
    g_autoptr(GBytes) p = program(500);
    can_deliver(&c, p);
    g_assert_no_error(c.cell.error);
    turn(&c.cell, 1000);
    const guint n = c.hub.log->len;
    for (int i = 0; i < 20000; i++) {
        *sent = *(const Sent *)c.hub.log->pdata[g_rand_int_range(random, 0, (gint32)n)];
        const bool old = sent->frame && sent->id == BEAT_ID && i % 2 == 0;
        if (!old) {
            *sent = (Sent){.id = BEAT_ID, .frame = true, .n = 8};
            random_bytes(random, sent->bytes, sent->n);
        }
        hub_pass(&c.hub, sent, NULL);
        turn(&c.cell, 4);
    }
    for (guint i = n; i < c.hub.log->len; i++)
        g_assert_cmphex(((const Sent *)c.hub.log->pdata[i])->id, ==, BEAT_ID);
    close_can(&c);
    g_rand_free(random);
}

static void add(void)
{
    g_test_add_func("/fieldbus/can-strangers/nothing-changes", nothing_changes);
    g_test_add_func("/fieldbus/can-strangers/replayed-in-order", replayed_in_order);
    g_test_add_func("/fieldbus/can-strangers/wrong-key", wrong_key);
    g_test_add_func("/fieldbus/can-strangers/beats", strange_beats);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
