/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Strangers at the machine's door: without the lease, in a wrong role, with old commands, foreign
 * transfers, wrong epochs, oversized counts, and plain noise. What the machine publishes stays as
 * it is, byte for byte, but for the fields that say who asked last; nothing is asked of the
 * machine; and each block is counted.
 */
#include "tests/unit/fieldbus_rig.h"

static const FbState STATES[] = {FB_STATE_OFF,      FB_STATE_IDLE,    FB_STATE_LOADING,
                                 FB_STATE_READY,    FB_STATE_RUNNING, FB_STATE_HELD,
                                 FB_STATE_COMPLETE, FB_STATE_ALARM};

/* What a stranger must not change. */
typedef struct {
    uint8_t status[FB_STATUS_BYTES], alarm[FB_ALARM_BYTES];
    uint64_t counted;
    GBytes *program;
    guint actions;
} Picture;

static Picture picture(const Rig *rig)
{
    Picture p = {.program = fb_receiver_program(rig->receiver), .actions = rig->actions->len};
    FbStatus s = rig_status(rig);
    s.command_session = s.command_seq = 0;
    s.command = FB_COMMAND_NONE;
    s.answer = s.chunk_answer = FB_ANSWER_NONE;
    fb_wire_put_status(p.status, &s);
    fb_wire_put_alarm(p.alarm, &s);
    for (int i = 0; i < FB_N_ANSWERS; i++)
        p.counted += fb_receiver_counts(rig->receiver)[i];
    return p;
}

/* `n` blocks came since `before`, and changed nothing. */
static bool is_unmoved(const Rig *rig, const Picture *before, uint64_t n)
{
    const Picture now = picture(rig);
    return memcmp(now.status, before->status, sizeof now.status) == 0 &&
           memcmp(now.alarm, before->alarm, sizeof now.alarm) == 0 &&
           now.program == before->program && now.actions == before->actions &&
           now.counted == before->counted + n;
}

static void assert_refused(Rig *rig, const Picture *before, FbAnswer answer, const char *expected,
                           const char *what)
{
    const bool unmoved = is_unmoved(rig, before, 1);
    if (!unmoved || strcmp(fb_answer_name(answer), expected) != 0)
        g_test_message("%s in %s: %s", what, fb_state_name(rig_status(rig).state),
                       fb_answer_name(answer));
    g_assert_true(unmoved);
    g_assert_cmpstr(fb_answer_name(answer), ==, expected);
    g_assert_cmpuint(fb_receiver_counts(rig->receiver)[answer], >, 0);
}

static FbAnswer write_as(Rig *rig, FbRole role, FbBlock block, const uint8_t *bytes, size_t n)
{
    return fb_receiver_write(rig->receiver, role, block, bytes, n, rig->now_us, rig->actions);
}

static FbOrder next_order(Rig *rig, FbCommand command)
{
    FbOrder o = rig->last;
    o.seq = ++rig->seq;
    o.command = command;
    o.transfer = rig_status(rig).transfer;
    o.open = (FbOpen){.program_bytes = 4, .gates = 1};
    o.gate = 1;
    o.gate_offset = RIG_GATES[0];
    o.arguments = (FbArguments){90, 90, 90, true};
    return o;
}

/* Section 2.10: every role × every command, with the owner's own token. */
static void wrong_roles(void)
{
    g_autoptr(GPtrArray) rows = doc_table("### 2.10");
    const char *operators = doc_cell(rows, 2, 1), *programmers = doc_cell(rows, 3, 1);
    g_assert_cmpstr(doc_cell(rows, 2, 0), ==, "operator");
    uint8_t block[FB_BLOCK_BYTES];
    unsigned refused = 0;
    for (size_t i = 0; i < G_N_ELEMENTS(STATES); i++)
        for (FbRole role = FB_ROLE_NONE; role <= FB_ROLE_OPERATOR; role++)
            for (FbCommand command = FB_COMMAND_LEASE; command < FB_N_COMMANDS; command++) {
                const char *name = fb_command_name(command);
                const bool operates = strstr(operators, name) != NULL;
                g_assert_true(operates || strstr(programmers, name));
                g_assert_cmpint(fb_role_may(role, command), ==,
                                operates && role == FB_ROLE_OPERATOR);
                if (operates && role == FB_ROLE_OPERATOR)
                    continue;
                Rig rig = rig_new();
                rig_lead(&rig, STATES[i]);
                const FbOrder o = next_order(&rig, command);
                const Picture before = picture(&rig);
                const FbAnswer answer =
                    write_as(&rig, role, FB_BLOCK_COMMAND, block, fb_wire_put_order(block, &o));
                assert_refused(&rig, &before, answer, "ROLE", name);
                refused++;
                rig_free(&rig);
            }
    g_test_message("%u commands refused for their role", refused);
}

static void wrong_roles_of_chunks_and_beats(void)
{
    uint8_t block[FB_BLOCK_BYTES], table[2 * FB_GATE_BYTES];
    rig_put_gates(table, RIG_GATES, 2);
    for (FbRole role = FB_ROLE_NONE; role <= FB_ROLE_PROGRAMMER; role++) {
        Rig rig = rig_new();
        rig_lead(&rig, FB_STATE_IDLE);
        rig_open(&rig, RIG_PROGRAM, RIG_PROGRAM_BYTES, RIG_GATES, 2);
        const FbChunk chunk = {RIG_EPOCH, rig.transfer, 0, sizeof table, table};
        Picture before = picture(&rig);
        FbAnswer answer =
            write_as(&rig, role, FB_BLOCK_CHUNK, block, fb_wire_put_chunk(block, &chunk));
        if (role < FB_ROLE_PROGRAMMER)
            assert_refused(&rig, &before, answer, "ROLE", "a chunk");
        else
            g_assert_cmpstr(fb_answer_name(answer), ==, "DONE");
        /* A beat of the owner's, but in a role that may not keep a lease. */
        rig.now_us += G_USEC_PER_SEC;
        before = picture(&rig);
        const FbBeat beat = {RIG_SESSION, RIG_TOKEN, 1};
        answer = write_as(&rig, role, FB_BLOCK_BEAT, block, fb_wire_put_beat(block, &beat));
        if (role < FB_ROLE_OPERATOR)
            assert_refused(&rig, &before, answer, "ROLE", "a beat");
        else
            g_assert_cmpstr(fb_answer_name(answer), ==, "DONE");
        rig_free(&rig);
    }
}

/* No token, half of it, another's; another epoch; another transfer. */
static void without_the_lease(void)
{
    static const uint64_t tokens[] = {0, UINT64_C(0x1234000000000000),
                                      UINT64_C(0x9999000056780000)};
    uint8_t block[FB_BLOCK_BYTES];
    for (size_t i = 0; i < G_N_ELEMENTS(STATES); i++)
        for (FbCommand command = FB_COMMAND_LEASE; command < FB_N_COMMANDS; command++) {
            if (command == FB_COMMAND_HOLD || command == FB_COMMAND_ABORT)
                continue; /* anybody may stop */
            Rig rig = rig_new();
            rig_lead(&rig, STATES[i]);
            for (size_t j = 0; j < G_N_ELEMENTS(tokens); j++) {
                FbOrder o = next_order(&rig, command);
                o.session = 77;
                o.token = tokens[j];
                const Picture before = picture(&rig);
                const FbAnswer answer = write_as(&rig, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block,
                                                 fb_wire_put_order(block, &o));
                assert_refused(&rig, &before, answer,
                               command == FB_COMMAND_LEASE && tokens[j] == 0 ? "MALFORMED"
                                                                             : "NO_LEASE",
                               fb_command_name(command));
            }
            FbOrder o = next_order(&rig, command);
            o.session = 77;
            o.epoch++;
            const Picture before = picture(&rig);
            const FbAnswer answer = write_as(&rig, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block,
                                             fb_wire_put_order(block, &o));
            assert_refused(&rig, &before, answer, "WRONG_EPOCH", fb_command_name(command));
            rig_free(&rig);
        }
}

/* Every command that was ever taken comes again, at the end, from wherever it was recorded. */
static void replayed_commands(void)
{
    uint8_t block[FB_BLOCK_BYTES];
    for (size_t i = 0; i < G_N_ELEMENTS(STATES); i++) {
        Rig rig = rig_new();
        rig_lead(&rig, STATES[i]);
        FbOrder o = next_order(&rig, FB_COMMAND_OVERRIDE);
        rig_write_order(&rig, &o);
        g_array_set_size(rig.actions, 0);
        for (FbCommand command = FB_COMMAND_LEASE; command < FB_N_COMMANDS; command++)
            for (uint32_t seq = 1; seq < rig.seq; seq++) {
                o = next_order(&rig, command);
                rig.seq--;
                o.seq = seq;
                rig.now_us += 1000;
                const Picture before = picture(&rig);
                const FbAnswer answer = write_as(&rig, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block,
                                                 fb_wire_put_order(block, &o));
                assert_refused(&rig, &before, answer, "OUT_OF_SEQUENCE", fb_command_name(command));
            }
        rig_free(&rig);
    }
}

typedef enum {
    AGAIN,
    RELEASED,
    TAKEN_BY_ANOTHER,
    RAN_TO_ITS_END,
    READY_AGAIN,
    N_MEANWHILE
} Meanwhile;

/* A START that was done, or was never seen, arrives when things have gone on. */
static void late_start(void)
{
    static const char *const answers[2][N_MEANWHILE] = {
        {"DONE", "OUT_OF_SEQUENCE", "OUT_OF_SEQUENCE", "DONE", "OUT_OF_SEQUENCE"},
        {NULL, "OUT_OF_SEQUENCE", "OUT_OF_SEQUENCE", NULL, NULL}};
    for (int unseen = 0; unseen < 2; unseen++)
        for (Meanwhile meanwhile = 0; meanwhile < N_MEANWHILE; meanwhile++) {
            if (!answers[unseen][meanwhile])
                continue;
            Rig rig = rig_new();
            rig_lead(&rig, FB_STATE_READY);
            const FbOrder start = next_order(&rig, FB_COMMAND_START);
            if (!unseen)
                g_assert_cmpint(rig_write_order(&rig, &start), ==, FB_ANSWER_DONE);
            if (!unseen && meanwhile != AGAIN)
                rig_machine(&rig, FB_MACHINE_COMPLETE);
            if (meanwhile == READY_AGAIN)
                rig_order(&rig, FB_COMMAND_ACKNOWLEDGE);
            if (meanwhile == RELEASED || meanwhile == TAKEN_BY_ANOTHER)
                rig_order(&rig, FB_COMMAND_RELEASE);
            if (meanwhile == TAKEN_BY_ANOTHER)
                g_assert_cmpint(rig_write_order(&rig, &(FbOrder){.session = 5,
                                                                 .seq = 1,
                                                                 .epoch = RIG_EPOCH,
                                                                 .token = UINT64_C(7) << 32,
                                                                 .command = FB_COMMAND_LEASE}),
                                ==, FB_ANSWER_DONE);
            const Picture before = picture(&rig);
            const FbAnswer answer = rig_write_order(&rig, &start);
            assert_refused(&rig, &before, answer, answers[unseen][meanwhile], "a late START");
            rig_free(&rig);
        }

    /* Never seen, and the agent itself was begun again: a person decides, not what comes late. */
    Rig again = rig_new();
    rig_lead(&again, FB_STATE_READY);
    const FbOrder unseen = next_order(&again, FB_COMMAND_START);
    again.now_us += RIG_AGENT_S * G_USEC_PER_SEC;
    g_assert_cmpint(rig_write_order(&again, &(FbOrder){.session = 12,
                                                       .seq = 1,
                                                       .epoch = RIG_EPOCH,
                                                       .token = RIG_TOKEN,
                                                       .command = FB_COMMAND_LEASE}),
                    ==, FB_ANSWER_DONE);
    Picture before = picture(&again);
    assert_refused(&again, &before, rig_write_order(&again, &unseen), "NEEDS_ACKNOWLEDGE",
                   "a START of the dead");
    rig_free(&again);

    /* Never seen, from a session that is silent, and the lease has lapsed by now. */
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    const FbOrder start = next_order(&rig, FB_COMMAND_START);
    rig.now_us += RIG_LEASE_S * G_USEC_PER_SEC;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    before = picture(&rig);
    assert_refused(&rig, &before, rig_write_order(&rig, &start), "NO_LEASE", "a START too late");
    rig_free(&rig);
}

static void foreign_chunks(void)
{
    uint8_t bytes[100] = {'G'};
    for (size_t i = 0; i < G_N_ELEMENTS(STATES); i++) {
        Rig rig = rig_new();
        rig_lead(&rig, STATES[i]);
        const uint32_t transfer = rig_status(&rig).transfer;
        const uint64_t length = rig_status(&rig).length;
        const bool loading = STATES[i] == FB_STATE_LOADING;
        const struct {
            const char *answer;
            FbChunk chunk;
        } cases[] = {
            {"WRONG_EPOCH", {RIG_EPOCH + 1, transfer, 0, 4, bytes}},
            {loading ? "WRONG_TRANSFER" : "WRONG_STATE", {RIG_EPOCH, transfer + 1, 0, 4, bytes}},
            {loading ? "MALFORMED" : "WRONG_STATE", {RIG_EPOCH, transfer, length, 4, bytes}},
            {loading ? "MALFORMED" : "WRONG_STATE", {RIG_EPOCH, transfer, UINT64_MAX, 4, bytes}},
            {loading ? "MALFORMED" : "WRONG_STATE", {RIG_EPOCH, transfer, 0, 100, bytes}},
            {loading ? "CONFLICT" : "WRONG_STATE", {RIG_EPOCH, transfer, 16, 4, bytes}},
        };
        for (size_t j = 0; j < G_N_ELEMENTS(cases); j++) {
            const Picture before = picture(&rig);
            const FbAnswer answer = rig_write_chunk(&rig, &cases[j].chunk);
            assert_refused(&rig, &before, answer, cases[j].answer, "a foreign chunk");
        }
        rig_free(&rig);
    }
}

/* Lengths and counts of every size in blocks that are right otherwise. */
static void oversized_counts(void)
{
    static const FbBlock kinds[] = {FB_BLOCK_COMMAND, FB_BLOCK_CHUNK, FB_BLOCK_BEAT};
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    uint8_t block[FB_BLOCK_BYTES + 100] = {0}, bytes[FB_CHUNK_BYTES] = {0};
    for (size_t k = 0; k < G_N_ELEMENTS(kinds); k++)
        for (size_t n = 0; n < sizeof block; n += n < 300 ? 1 : 97) {
            FbOrder o = next_order(&rig, FB_COMMAND_OPEN);
            const FbChunk chunk = {RIG_EPOCH, rig.transfer, 0, FB_CHUNK_BYTES, bytes};
            const size_t right = kinds[k] == FB_BLOCK_COMMAND ? fb_wire_put_order(block, &o)
                                 : kinds[k] == FB_BLOCK_CHUNK
                                     ? fb_wire_put_chunk(block, &chunk)
                                     : fb_wire_put_beat(block, &(FbBeat){1, 2, 3});
            if (n == right)
                continue;
            const Picture before = picture(&rig);
            const FbAnswer answer = write_as(&rig, FB_ROLE_PROGRAMMER, kinds[k], block, n);
            assert_refused(&rig, &before, answer, "MALFORMED", "a block of another size");
        }
    /* What the header says of the bytes behind it. */
    for (unsigned value = 0; value <= 0xffff; value += value < 300 ? 1 : 251) {
        FbOrder o = next_order(&rig, FB_COMMAND_START);
        const size_t n = fb_wire_put_order(block, &o);
        block[26] = (uint8_t)(value >> 8);
        block[27] = (uint8_t)value;
        const Picture before = picture(&rig);
        if (value > 0)
            assert_refused(&rig, &before,
                           write_as(&rig, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block, n),
                           "MALFORMED", "argument_bytes");
    }
    rig_free(&rig);
}

/* Noise of any length; every fourth block begins as one that was right a moment ago. */
static void noise(void)
{
    enum { BLOCKS = 100000 };
    g_autoptr(GRand) rand = g_rand_new_with_seed(20261122);
    for (size_t i = 0; i < G_N_ELEMENTS(STATES); i++) {
        Rig rig = rig_new();
        rig_lead(&rig, STATES[i]);
        const Picture before = picture(&rig);
        const unsigned blocks = BLOCKS / G_N_ELEMENTS(STATES);
        for (unsigned j = 0; j < blocks; j++) {
            uint8_t block[FB_BLOCK_BYTES];
            const FbBlock kind =
                (FbBlock)g_rand_int_range(rand, FB_BLOCK_COMMAND, FB_BLOCK_BEAT + 1);
            size_t n = (size_t)g_rand_int_range(rand, 0, j % 50 ? 300 : FB_BLOCK_BYTES + 1);
            for (size_t k = 0; k < n; k++)
                block[k] = (uint8_t)g_rand_int(rand);
            if (j % 4 == 0) {
                n = fb_wire_put_order(block, &rig.last);
                block[g_rand_int_range(rand, 0, (gint32)n)] ^= (uint8_t)(1 << j / 4 % 8);
            }
            const FbAnswer answer =
                write_as(&rig, (FbRole)(j % 4), j % 4 ? kind : FB_BLOCK_COMMAND, block, n);
            g_assert_true(answer == FB_ANSWER_MALFORMED || answer == FB_ANSWER_CRC);
        }
        g_assert_true(is_unmoved(&rig, &before, blocks));
        rig_free(&rig);
    }
    g_test_message("%d random blocks", BLOCKS);
}

static void add(void)
{
    g_test_add_func("/fieldbus/strangers/wrong-roles", wrong_roles);
    g_test_add_func("/fieldbus/strangers/wrong-roles-of-chunks", wrong_roles_of_chunks_and_beats);
    g_test_add_func("/fieldbus/strangers/without-the-lease", without_the_lease);
    g_test_add_func("/fieldbus/strangers/replayed-commands", replayed_commands);
    g_test_add_func("/fieldbus/strangers/late-start", late_start);
    g_test_add_func("/fieldbus/strangers/foreign-chunks", foreign_chunks);
    g_test_add_func("/fieldbus/strangers/oversized-counts", oversized_counts);
    g_test_add_func("/fieldbus/strangers/noise", noise);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
