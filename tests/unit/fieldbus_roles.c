/* SPDX-License-Identifier: Apache-2.0 */
/* Who may do what: docs/protocol.md, section 2.10, by certificates over TLS. */
#include "tests/unit/fieldbus_rig.h"
#include "tests/unit/fieldbus_tls.h"

static const uint64_t TOKEN = UINT64_C(0x700000001);

/* Writes a block (registers at `at`) and reads STATUS back. */
static FbStatus write_block(Cell *c, Peer *p, unsigned at, const uint8_t *block, size_t n)
{
    FbStatus status = {0};
    const int before = p->answers;
    uint8_t adu[FB_ADU_BYTES] = {0, 1, 0, 0, 0, (uint8_t)(11 + n), 1, 23, 0, 0, 0, 124};
    const uint8_t write[] = {(uint8_t)(at >> 8), (uint8_t)at, 0, (uint8_t)(n / 2), (uint8_t)n};
    memcpy(adu + 12, write, sizeof write);
    memcpy(adu + 17, block, n);
    if (p->mbap)
        fb_mbap_send(p->mbap, adu, 17 + n);
    g_assert_true(run_until(c, &p->answers, before + 1));
    g_assert_true(p->n == 9 + FB_STATUS_BYTES &&
                  fb_wire_get_status(p->answer + 9, FB_STATUS_BYTES, &status));
    return status;
}

/* Whether the document's row of this role has the word, itself or by "all that an operator may". */
static bool documented(const GPtrArray *table, const char *role, const char *word)
{
    for (guint i = 1; i < table->len; i++) {
        g_auto(GStrv) may = g_strsplit(doc_cell(table, i, 1), ", ", -1);
        if (strcmp(doc_cell(table, i, 0), role) != 0)
            continue;
        if (g_strv_contains((const char *const *)may, "and all that an operator may") &&
            documented(table, "operator", word))
            return true;
        return g_strv_contains((const char *const *)may, word);
    }
    return false;
}

/* The lease is there, whatever came before: what is refused is refused for the role. */
static void hold_lease(Cell *c, uint32_t seq)
{
    uint8_t block[FB_BLOCK_BYTES];
    const FbOrder order = {
        .session = 8, .seq = seq, .epoch = 77, .token = TOKEN, .command = FB_COMMAND_LEASE};
    const size_t n = fb_wire_put_order(block, &order);
    fb_receiver_write(c->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block, n,
                      g_get_monotonic_time(), NULL);
}

static void check_commands(Cell *c, Peer *p, const GPtrArray *table, const char *role)
{
    uint8_t block[FB_BLOCK_BYTES];
    FbStatus before;
    const uint64_t *counts = fb_receiver_counts(c->receiver);
    for (FbCommand command = FB_COMMAND_LEASE; command < FB_N_COMMANDS; command++) {
        const FbOrder order = {.session = 9,
                               .seq = command,
                               .epoch = 77,
                               .token = TOKEN,
                               .command = command,
                               .arguments = {90, 90, 90, true},
                               .gate = 1,
                               .open = {.program_bytes = 10, .gates = 1}};
        const size_t n = fb_wire_put_order(block, &order);
        const bool may = documented(table, role, fb_command_name(command));
        const uint64_t refused = counts[FB_ANSWER_ROLE];
        hold_lease(c, command);
        fb_receiver_status(c->receiver, 0, &before);
        const FbStatus s = write_block(c, p, FB_AT_COMMAND, block, n);
        g_test_message("%s: %s", fb_command_name(command), fb_answer_name(s.answer));
        g_assert_cmpint(s.command_seq, ==, command);
        g_assert_cmpint(s.answer == FB_ANSWER_ROLE, ==, !may);
        if (command != FB_COMMAND_LEASE) /* which is another session's */
            g_assert_cmpint(s.answer, !=, FB_ANSWER_NO_LEASE);
        g_assert_cmpuint(counts[FB_ANSWER_ROLE] - refused, ==, !may);
        if (!may)
            g_assert_true(s.state == before.state && s.transfer == before.transfer &&
                          s.lease_owner == before.lease_owner &&
                          s.feed_override_percent == before.feed_override_percent &&
                          s.optional_stop == before.optional_stop);
        else if (command == FB_COMMAND_OPEN)
            g_assert_cmpint(s.state, ==, FB_STATE_LOADING);
    }
}

static void check_role(const GPtrArray *table, const char *certificate, const char *role)
{
    Cell c;
    Peer p;
    uint8_t block[FB_BLOCK_BYTES];
    g_test_message("%s", certificate);
    open_tls_cell(&c);
    peer_open(&c, &p, certificate, "127.0.0.1");
    g_assert_true(run_until(&c, &p.ready, 1));
    check_commands(&c, &p, table, role);
    const uint64_t *counts = fb_receiver_counts(c.receiver);
    const FbChunk chunk = {.epoch = 77, .transfer = 1, .length = 2, .bytes = (const uint8_t *)"G0"};
    size_t n = fb_wire_put_chunk(block, &chunk);
    const FbStatus s = write_block(&c, &p, FB_AT_CHUNK, block, n);
    g_assert_cmpint(s.chunk_answer == FB_ANSWER_ROLE, ==, !documented(table, role, "chunks"));
    n = fb_wire_put_beat(block, &(FbBeat){9, TOKEN, 1});
    const uint64_t before = counts[FB_ANSWER_ROLE];
    write_block(&c, &p, FB_AT_BEAT, block, n);
    g_assert_cmpuint(counts[FB_ANSWER_ROLE] - before, ==, !documented(table, role, "beats"));
    fb_mbap_free(p.mbap);
    close_cell(&c);
}

/* Each role, each command and block, against the table of the document. */
static void who_may_do_what(void)
{
    static const char *const others[] = {"no-role", "wrong-word", "long-word", "empty-word"};
    g_autoptr(GPtrArray) table = doc_table("### 2.10");
    g_assert_cmpuint(table->len, ==, 4);
    g_assert_true(documented(table, "operator", "START"));
    g_assert_false(documented(table, "operator", "OPEN"));
    for (FbRole role = FB_ROLE_OBSERVER; role <= FB_ROLE_PROGRAMMER; role++)
        check_role(table, fb_role_name(role), fb_role_name(role));
    for (size_t i = 0; i < G_N_ELEMENTS(others); i++)
        check_role(table, others[i], "observer");
}

/* What a session says of it. */
static void an_observer_is_told(void)
{
    Cell c;
    open_tls_cell(&c);
    c.session = tls_session(&c, "observer", "127.0.0.1", 1);
    fb_session_command(c.session, FB_COMMAND_HOLD, NULL);
    g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 1));
    g_assert_error(c.error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_nonnull(c.error ? strstr(c.error->message, "ROLE") : NULL);
    g_assert_cmpint(c.holds, ==, 0);
    close_cell(&c);
}

static void add(void)
{
    make_certificates();
    g_test_add_func("/fieldbus/roles/who-may-do-what", who_may_do_what);
    g_test_add_func("/fieldbus/roles/an-observer-is-told", an_observer_is_told);
}

int main(int argc, char **argv)
{
    folder = test_folder();
    const int status = test_main(argc, argv, add);
    test_folder_remove(folder);
    return status;
}
