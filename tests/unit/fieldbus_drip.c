/* SPDX-License-Identifier: Apache-2.0 */
/* A program that drips, as the machine takes it: docs/protocol.md, section 7. */
#include "tests/unit/fieldbus_rig.h"

/* Three passes of a line, two and one. */
static const char PROGRAM[] = "G0 X1\nG1 X2 F100\nG1 X3\nM30\n";
enum {
    BYTES = sizeof PROGRAM - 1,
    GATES = 3,
    TABLE = GATES * FB_DRIP_GATE_BYTES,
    MEMORY = TABLE + 18 /* the first pass and most of the second */
};
static const uint64_t ENDS[GATES] = {6, 23, BYTES};

static Rig drip_rig(uint64_t memory_bytes)
{
    const FbReceiverOptions options = {.epoch = RIG_EPOCH,
                                       .memory_bytes = memory_bytes,
                                       .on_agent_loss = CFG_AGENT_LOSS_NEXT_GATE,
                                       .agent_timeout_us = RIG_AGENT_S * G_USEC_PER_SEC,
                                       .lease_timeout_us = RIG_LEASE_S * G_USEC_PER_SEC};
    Rig rig = {.receiver = fb_receiver_new(&options),
               .actions = g_array_new(FALSE, FALSE, sizeof(FbDo)),
               .now_us = 1000};
    rig_lead(&rig, FB_STATE_IDLE);
    return rig;
}

/* The stream: the table with these gates and the program's running hashes, then the program. */
static void make_stream(uint8_t *stream, const uint64_t *ends, const char *program)
{
    for (size_t i = 0; i < GATES; i++) {
        uint8_t hash[32];
        rig_digest(program, MIN(ends[i], BYTES), hash);
        fb_wire_put_gate(stream + i * FB_DRIP_GATE_BYTES, ends[i], hash);
    }
    memcpy(stream + TABLE, program, BYTES);
}

static FbAnswer open_drip(Rig *rig, const uint8_t *stream)
{
    FbOrder o = rig->last;
    o.seq = ++rig->seq;
    o.command = FB_COMMAND_OPEN;
    o.transfer = 0;
    o.open = (FbOpen){.program_bytes = BYTES,
                      .gates = GATES,
                      .gates_crc = fb_wire_crc(stream, TABLE),
                      .flags = FB_OPEN_DRIP};
    rig_digest(PROGRAM, BYTES, o.open.id);
    const FbAnswer answer = rig_write_order(rig, &o);
    rig->transfer = rig_status(rig).transfer;
    return answer;
}

static void assert_chunk(Rig *rig, const uint8_t *stream, uint64_t from, uint64_t to,
                         const char *answer)
{
    g_assert_cmpstr(fb_answer_name(rig_chunk(rig, from, stream + from, to - from)), ==, answer);
}

/* Opened, prefilled, verified by the machine, started; `sent` bytes of the program are there. */
static Rig running(uint64_t sent)
{
    uint8_t stream[TABLE + BYTES];
    Rig rig = drip_rig(MEMORY);
    make_stream(stream, ENDS, PROGRAM);
    g_assert_cmpint(open_drip(&rig, stream), ==, FB_ANSWER_DONE);
    assert_chunk(&rig, stream, 0, TABLE + sent, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "NONE");
    rig_machine(&rig, FB_MACHINE_VERIFIED);
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "DONE");
    g_array_set_size(rig.actions, 0);
    return rig;
}

static void assert_pass(const Rig *rig, size_t pass, const char *text)
{
    g_autoptr(GBytes) bytes = fb_receiver_pass(rig->receiver, pass);
    g_assert_true((bytes != NULL) == (text != NULL));
    gsize n = 0;
    const char *got = bytes ? g_bytes_get_data(bytes, &n) : NULL;
    if (bytes && text)
        g_assert_true(n == strlen(text) && memcmp(got, text, n) == 0);
}

static void pass_by_pass(void)
{
    uint8_t stream[TABLE + BYTES];
    Rig rig = drip_rig(MEMORY);
    make_stream(stream, ENDS, PROGRAM);
    open_drip(&rig, stream);
    FbStatus s = rig_status(&rig);
    g_assert_true(s.drip);
    g_assert_cmpuint(s.length, ==, TABLE + BYTES);
    g_assert_cmpuint(s.may_send_to, ==, MEMORY);
    g_assert_cmpuint(s.memory_bytes, ==, MEMORY);
    assert_chunk(&rig, stream, 0, 50, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "INCOMPLETE");
    assert_chunk(&rig, stream, 50, TABLE + 5, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "INCOMPLETE");
    g_assert_cmpuint(rig_status(&rig).released, ==, 0);
    assert_chunk(&rig, stream, TABLE + 5, TABLE + 7, "DONE"); /* over the gate */
    g_assert_cmpuint(rig_status(&rig).released, ==, TABLE + 6);
    assert_chunk(&rig, stream, TABLE + 7, TABLE + 19, "TOO_LARGE"); /* no credit */
    assert_chunk(&rig, stream, TABLE + 7, TABLE + 18, "DONE");
    g_assert_cmpuint(rig.actions->len, ==, 0); /* nothing is to be examined before VERIFY */
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "NONE");
    g_assert_true(rig_did(&rig, FB_DO_VERIFY));
    g_assert_null(fb_receiver_program(rig.receiver));
    g_assert_true(fb_receiver_drips(rig.receiver));
    g_assert_cmpuint(fb_receiver_released(rig.receiver), ==, 1);
    assert_pass(&rig, 0, "G0 X1\n");
    assert_pass(&rig, 1, NULL);
    rig_machine(&rig, FB_MACHINE_VERIFIED);
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "DONE");
    g_array_set_size(rig.actions, 0);

    /* A gate that is passed makes room; what lay before it is gone, and harmless when it comes
     * again. */
    fb_receiver_progress(rig.receiver, &(FbProgress){.gate = 1});
    g_assert_cmpuint(rig_status(&rig).may_send_to, ==, MEMORY + 6);
    assert_pass(&rig, 0, NULL);
    assert_chunk(&rig, stream, TABLE + 18, TABLE + 23, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_PASS));
    assert_pass(&rig, 1, "G1 X2 F100\nG1 X3\n");
    assert_chunk(&rig, stream, 0, 30, "DONE");
    assert_chunk(&rig, stream, TABLE, TABLE + 10, "DONE");
    assert_chunk(&rig, stream, TABLE + 8, TABLE + 20, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, TABLE + 8, "XXXX", 4)), ==, "CONFLICT");
    assert_chunk(&rig, stream, TABLE + 22, TABLE + 24, "GAP");
    fb_receiver_progress(rig.receiver, &(FbProgress){.gate = 2});
    assert_chunk(&rig, stream, TABLE + 23, TABLE + BYTES, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_PASS));
    s = rig_status(&rig);
    g_assert_cmpuint(s.received, ==, s.length);
    g_assert_cmpuint(s.released, ==, s.length);
    g_assert_true(memcmp(s.sha256, s.id, sizeof s.id) == 0);
    rig_free(&rig);
}

/* Any way to cut the stream into chunks gives the same passes. */
static void any_chunks(void)
{
    uint8_t stream[TABLE + BYTES];
    make_stream(stream, ENDS, PROGRAM);
    for (uint64_t size = 1; size <= TABLE + BYTES; size++) {
        Rig rig = drip_rig(1 << 20);
        open_drip(&rig, stream);
        for (uint64_t at = 0; at < TABLE + BYTES; at += size)
            assert_chunk(&rig, stream, at, MIN(at + size, TABLE + BYTES), "DONE");
        rig_order(&rig, FB_COMMAND_VERIFY);
        g_assert_cmpuint(fb_receiver_released(rig.receiver), ==, GATES);
        assert_pass(&rig, 0, "G0 X1\n");
        assert_pass(&rig, 1, "G1 X2 F100\nG1 X3\n");
        assert_pass(&rig, 2, "M30\n");
        rig_free(&rig);
    }
}

/* A pass that is not the announced one: its last bytes are not taken, and the machine stops. */
static void wrong_bytes(void)
{
    uint8_t stream[TABLE + BYTES];
    Rig rig = running(6);
    make_stream(stream, ENDS, PROGRAM);
    stream[TABLE + 12] ^= 1;
    assert_chunk(&rig, stream, TABLE + 6, TABLE + 18, "DONE");
    fb_receiver_progress(rig.receiver, &(FbProgress){.gate = 1});
    g_assert_cmpuint(rig.actions->len, ==, 0);
    assert_chunk(&rig, stream, TABLE + 18, TABLE + 23, "HASH");
    g_assert_true(rig_did(&rig, FB_DO_HOLD_AT_GATE));
    g_assert_cmpuint(rig_status(&rig).received, ==, TABLE + 18);
    g_assert_cmpuint(fb_receiver_released(rig.receiver), ==, 1);
    rig_free(&rig);
}

static void wrong_tables(void)
{
    static const struct {
        const char *what, *chunk, *verify;
        uint64_t ends[GATES], memory;
    } cases[] = {
        {"right", "DONE", "NONE", {6, 23, BYTES}, 1 << 20},
        {"a pass that does not fit", "TOO_LARGE", "TOO_LARGE", {6, 23, BYTES}, TABLE + 16},
        {"descending", "PROGRAM", "PROGRAM", {23, 6, BYTES}, 1 << 20},
        {"zero", "PROGRAM", "PROGRAM", {0, 6, BYTES}, 1 << 20},
        {"no end", "PROGRAM", "PROGRAM", {6, 23, BYTES - 1}, 1 << 20},
        {"beyond", "PROGRAM", "PROGRAM", {6, 1 << 20, BYTES}, 1 << 20},
        {"inside a line", "PROGRAM", "INCOMPLETE", {5, 23, BYTES}, 1 << 20},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        uint8_t stream[TABLE + BYTES];
        Rig rig = drip_rig(cases[i].memory);
        make_stream(stream, cases[i].ends, PROGRAM);
        open_drip(&rig, stream);
        g_test_message("%s", cases[i].what);
        assert_chunk(&rig, stream, 0, TABLE,
                     strcmp(cases[i].verify, "INCOMPLETE") == 0 ||
                             strcmp(cases[i].verify, "NONE") == 0
                         ? "DONE"
                         : cases[i].chunk);
        assert_chunk(&rig, stream, TABLE, TABLE + 16, cases[i].chunk);
        g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, cases[i].verify);
        if (strcmp(cases[i].verify, "PROGRAM") == 0)
            g_assert_cmpint(rig_status(&rig).alarm_code, ==, 1);
        rig_free(&rig);
    }

    /* The last running hash is not the id. */
    uint8_t stream[TABLE + BYTES];
    Rig rig = drip_rig(1 << 20);
    make_stream(stream, ENDS, PROGRAM);
    stream[TABLE - 1] ^= 1;
    open_drip(&rig, stream);
    assert_chunk(&rig, stream, 0, TABLE, "PROGRAM");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "PROGRAM");
    rig_free(&rig);
}

/* Section 3.2: what was executed is gone, whatever ends the run. */
static void forgotten_at_its_end(void)
{
    static const struct {
        FbMachineEvent event;
        FbState then;
    } cases[] = {{FB_MACHINE_ABORTED, FB_STATE_IDLE},
                 {FB_MACHINE_ALARM, FB_STATE_ALARM},
                 {FB_MACHINE_ESTOP, FB_STATE_ESTOP},
                 {FB_MACHINE_COMPLETE, FB_STATE_COMPLETE}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Rig rig = running(18);
        rig_machine(&rig, cases[i].event);
        const bool complete = cases[i].event == FB_MACHINE_COMPLETE;
        g_assert_cmpint(rig_status(&rig).state, ==, cases[i].then);
        g_assert_cmpint(rig_status(&rig).transfer != 0, ==, complete);
        if (complete)
            g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_ACKNOWLEDGE)), ==, "DONE");
        else
            rig_machine(&rig, FB_MACHINE_ACKNOWLEDGED);
        g_assert_true(rig_did(&rig, FB_DO_FORGET));
        g_assert_cmpint(rig_status(&rig).state, ==, FB_STATE_IDLE);
        g_assert_cmpuint(rig_status(&rig).transfer, ==, 0);
        g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "WRONG_STATE");
        rig_free(&rig);
    }
}

static void no_restart(void)
{
    uint8_t stream[TABLE + BYTES];
    Rig rig = drip_rig(1 << 20);
    make_stream(stream, ENDS, PROGRAM);
    open_drip(&rig, stream);
    assert_chunk(&rig, stream, 0, TABLE + BYTES, "DONE");
    rig_order(&rig, FB_COMMAND_VERIFY);
    rig_machine(&rig, FB_MACHINE_VERIFIED);
    g_array_set_size(rig.actions, 0);
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_RESTART)), ==, "WRONG_STATE");
    g_assert_cmpint(rig_status(&rig).state, ==, FB_STATE_READY);
    g_assert_cmpuint(rig_status(&rig).run, ==, 0);
    g_assert_cmpuint(rig.actions->len, ==, 0);
    rig_free(&rig);
}

static void add(void)
{
    g_test_add_func("/fieldbus/drip/pass-by-pass", pass_by_pass);
    g_test_add_func("/fieldbus/drip/any-chunks", any_chunks);
    g_test_add_func("/fieldbus/drip/wrong-bytes", wrong_bytes);
    g_test_add_func("/fieldbus/drip/wrong-tables", wrong_tables);
    g_test_add_func("/fieldbus/drip/forgotten-at-its-end", forgotten_at_its_end);
    g_test_add_func("/fieldbus/drip/no-restart", no_restart);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
