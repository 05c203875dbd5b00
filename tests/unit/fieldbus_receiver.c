/* SPDX-License-Identifier: Apache-2.0 */
/* The machine's receiver against docs/protocol.md: its tables are read from the document. */
#include "tests/unit/fieldbus_rig.h"

static FbState state_named(const char *name, FbState otherwise)
{
    for (FbState s = 0; s < FB_STATE_UNKNOWN; s++)
        if (strcmp(fb_state_name(s), name) == 0)
            return s;
    return otherwise;
}

static void assert_state(const Rig *rig, FbState expected, const char *where)
{
    const FbState state = fb_receiver_state(rig->receiver);
    if (state != expected)
        g_test_message("%s", where);
    g_assert_cmpstr(fb_state_name(state), ==, fb_state_name(expected));
}

/* Section 3.1: every state × every command. */
static void commands_as_documented(void)
{
    g_autoptr(GPtrArray) rows = doc_table("### 3.1");
    g_assert_cmpuint(rows->len, ==, FB_STATE_UNKNOWN + 1);
    for (FbState state = 0; state < FB_STATE_UNKNOWN && state + 1 < rows->len; state++) {
        g_assert_cmpstr(doc_cell(rows, state + 1, 0), ==, fb_state_name(state));
        for (FbCommand command = FB_COMMAND_LEASE; command < FB_N_COMMANDS; command++) {
            g_assert_cmpstr(doc_cell(rows, 0, command), ==, fb_command_name(command));
            const char *cell = doc_cell(rows, state + 1, command);
            g_autofree char *where = g_strdup_printf("%s in %s: %s", fb_command_name(command),
                                                     fb_state_name(state), cell);
            Rig rig = rig_new();
            rig_lead(&rig, state);
            const FbAnswer answer = rig_order(&rig, command);
            if (strcmp(cell, "-") == 0) {
                g_assert_cmpstr(fb_answer_name(answer), ==, "WRONG_STATE");
                g_assert_cmpuint(rig.actions->len, ==, 0);
            } else if (command == FB_COMMAND_VERIFY) {
                g_assert_cmpstr(fb_answer_name(answer), ==, "NONE");
            } else {
                g_assert_cmpstr(fb_answer_name(answer), ==, "DONE");
            }
            assert_state(&rig, state_named(cell, state), where);
            rig_free(&rig);
        }
    }
}

/* Section 3.2: every state × every event at the machine. */
static void events_as_documented(void)
{
    g_autoptr(GPtrArray) rows = doc_table("### 3.2");
    g_assert_cmpuint(rows->len, ==, FB_STATE_UNKNOWN + 1);
    for (FbState state = 0; state < FB_STATE_UNKNOWN && state + 1 < rows->len; state++) {
        g_assert_cmpstr(doc_cell(rows, state + 1, 0), ==, fb_state_name(state));
        for (FbMachineEvent event = 0; event <= FB_MACHINE_ACKNOWLEDGED; event++) {
            const char *cell = doc_cell(rows, state + 1, event + 1);
            g_autofree char *where = g_strdup_printf("%s in %s: %s", doc_cell(rows, 0, event + 1),
                                                     fb_state_name(state), cell);
            Rig rig = rig_new();
            rig_lead(&rig, state);
            rig_machine(&rig, event);
            FbState expected = state_named(cell, state);
            if (strcmp(cell, "back") == 0)
                expected = FB_STATE_READY; /* rig_lead had a verified program */
            assert_state(&rig, expected, where);
            rig_free(&rig);
        }
    }
}

static void back_from_alarm(void)
{
    static const FbState before[] = {FB_STATE_IDLE, FB_STATE_LOADING, FB_STATE_VERIFYING};
    static const FbState after[] = {FB_STATE_IDLE, FB_STATE_LOADING, FB_STATE_LOADING};
    for (size_t i = 0; i < G_N_ELEMENTS(before); i++) {
        Rig rig = rig_new();
        rig_lead(&rig, before[i]);
        rig_machine(&rig, FB_MACHINE_ALARM);
        FbStatus s = rig_status(&rig);
        g_assert_cmpint(s.alarm_code, ==, 42);
        g_assert_cmpstr(s.alarm_text, ==, "Axis X beyond its travel");
        if (before[i] == FB_STATE_VERIFYING)
            g_assert_cmpstr(fb_answer_name(s.answer), ==, "PROGRAM");
        rig_machine(&rig, FB_MACHINE_ACKNOWLEDGED);
        assert_state(&rig, after[i], fb_state_name(before[i]));
        g_assert_cmpint(rig_status(&rig).alarm_code, ==, 0);
        g_assert_cmpint(rig_status(&rig).alarm_serial, ==, s.alarm_serial + 1);
        rig_free(&rig);
    }
}

/* Sections 3, 4 and 5: numbers and names. */
static void numbers_as_documented(void)
{
    g_autoptr(GPtrArray) states = doc_table("## 3. States");
    g_autoptr(GPtrArray) commands = doc_table("From step 4 on");
    g_autoptr(GPtrArray) answers = doc_table("## 5. Answers");
    for (guint i = 0; i < FB_STATE_UNKNOWN; i++) {
        g_assert_cmpint(atoi(doc_cell(states, i + 1, 0)), ==, (int)i);
        g_assert_cmpstr(doc_cell(states, i + 1, 1), ==, fb_state_name(i));
    }
    for (guint i = 1; i < FB_N_COMMANDS; i++) {
        g_assert_cmpint(atoi(doc_cell(commands, i, 0)), ==, (int)i);
        g_assert_cmpstr(doc_cell(commands, i, 1), ==, fb_command_name(i));
    }
    for (guint i = 0; i < FB_N_ANSWERS; i++) {
        g_assert_cmpint(atoi(doc_cell(answers, i + 1, 0)), ==, (int)i);
        g_assert_cmpstr(doc_cell(answers, i + 1, 1), ==, fb_answer_name(i));
        g_assert_cmpuint(strlen(fb_answer_advice(i)), >, 0);
    }
}

/* The order of checks in section 4, and that a refused command changes nothing. */
static void refusals(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    FbOrder o = rig.last;
    o.command = FB_COMMAND_START;
    o.transfer = rig.transfer;
    o.seq++, o.epoch++;
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "WRONG_EPOCH");
    o.seq++, o.epoch--, o.token++;
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "NO_LEASE");
    o.seq++, o.token--, o.transfer++;
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "WRONG_TRANSFER");
    o.seq++, o.transfer--;
    assert_state(&rig, FB_STATE_READY, "refused");
    g_assert_cmpuint(rig.actions->len, ==, 0);
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_START));
    rig_free(&rig);
}

static void done_once(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "DONE");
    const FbOrder start = rig.last;
    g_assert_true(rig_did(&rig, FB_DO_START));
    rig_machine(&rig, FB_MACHINE_COMPLETE);
    rig_order(&rig, FB_COMMAND_ACKNOWLEDGE);
    assert_state(&rig, FB_STATE_READY, "acknowledged");

    /* A later command was taken: the START that comes late is not done. */
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &start)), ==, "OUT_OF_SEQUENCE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "DONE");
    rig_machine(&rig, FB_MACHINE_ABORTED);
    assert_state(&rig, FB_STATE_READY, "aborted");
    g_array_set_size(rig.actions, 0);

    /* The last command again: answered, not done. With other contents: refused. */
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &rig.last)), ==, "DONE");
    FbOrder other = rig.last;
    other.command = FB_COMMAND_CLOSE;
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &other)), ==, "MALFORMED");
    assert_state(&rig, FB_STATE_READY, "replayed");
    g_assert_cmpuint(rig.actions->len, ==, 0);
    g_assert_cmpuint(rig_status(&rig).run, ==, 2);

    /* Many other sessions later the owner's last command is still known. */
    for (uint32_t i = 0; i < 200; i++)
        rig_write_order(&rig,
                        &(FbOrder){.session = 1000 + i, .seq = 1, .command = FB_COMMAND_HOLD});
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &rig.last)), ==, "DONE");
    g_assert_cmpuint(rig.actions->len, ==, 0);
    rig_free(&rig);
}

static void stop_without_lease(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_RUNNING);
    FbOrder o = {.session = 99, .seq = 1, .command = FB_COMMAND_HOLD};
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_HOLD));
    o = (FbOrder){.session = 99, .seq = 2, .command = FB_COMMAND_RESUME, .epoch = RIG_EPOCH};
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "NO_LEASE");
    o = (FbOrder){.session = 99, .seq = 3, .command = FB_COMMAND_ABORT};
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_ABORT));
    assert_state(&rig, FB_STATE_ABORTING, "aborted by anybody");
    rig_machine(&rig, FB_MACHINE_ABORTED);
    g_assert_cmpint(rig_status(&rig).run_end, ==, FB_RUN_ABORTED);
    rig_free(&rig);
}

static void chunks(void)
{
    Rig rig = rig_new();
    const char *p = RIG_PROGRAM;
    static const uint8_t zeros[100];
    uint8_t table[2 * FB_GATE_BYTES];
    rig_put_gates(table, RIG_GATES, 2);
    rig_lead(&rig, FB_STATE_IDLE);
    rig.transfer = 1;
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 0, p, 4)), ==, "WRONG_STATE");
    rig_open(&rig, p, RIG_PROGRAM_BYTES, RIG_GATES, 2);
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 0, table, 16)), ==, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 16, p, 5)), ==, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 16, p, 5)), ==, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 17, p + 1, 3)), ==, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 16, "g0 X1", 5)), ==, "CONFLICT");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 22, p + 6, 4)), ==, "GAP");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 20, p + 4, 4)), ==, "GAP");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 21, zeros, sizeof zeros)), ==, "MALFORMED");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, UINT64_MAX, p + 5, 2)), ==, "MALFORMED");
    FbChunk c = {RIG_EPOCH + 1, rig.transfer, 21, 4, (const uint8_t *)p + 5};
    g_assert_cmpstr(fb_answer_name(rig_write_chunk(&rig, &c)), ==, "WRONG_EPOCH");
    c = (FbChunk){RIG_EPOCH, rig.transfer + 1, 21, 4, (const uint8_t *)p + 5};
    g_assert_cmpstr(fb_answer_name(rig_write_chunk(&rig, &c)), ==, "WRONG_TRANSFER");
    FbStatus s = rig_status(&rig);
    g_assert_cmpuint(s.received, ==, 21);
    g_assert_cmpuint(s.length, ==, 16 + RIG_PROGRAM_BYTES);
    g_assert_cmpstr(fb_answer_name(s.chunk_answer), ==, "WRONG_TRANSFER");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "INCOMPLETE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "WRONG_STATE");
    g_assert_cmpstr(fb_answer_name(rig_chunk(&rig, 21, p + 5, RIG_PROGRAM_BYTES - 5)), ==, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "WRONG_STATE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "NONE");
    g_assert_true(rig_did(&rig, FB_DO_VERIFY));
    size_t n_gates = 0;
    const uint64_t *gates = fb_receiver_gates(rig.receiver, &n_gates);
    g_assert_cmpuint(n_gates, ==, 2);
    g_assert_true(gates && gates[0] == 6 && gates[1] == RIG_PROGRAM_BYTES);
    GBytes *program = fb_receiver_program(rig.receiver);
    g_assert_true(program && g_bytes_get_size(program) == RIG_PROGRAM_BYTES &&
                  memcmp(g_bytes_get_data(program, NULL), p, RIG_PROGRAM_BYTES) == 0);
    rig_free(&rig);
}

/* Every bit of a chunk and of a command: a damaged one is refused and changes nothing. */
static void damaged_blocks(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_LOADING);
    rig_open(&rig, RIG_PROGRAM, RIG_PROGRAM_BYTES, RIG_GATES, 2);
    uint8_t table[2 * FB_GATE_BYTES], block[FB_BLOCK_BYTES];
    rig_put_gates(table, RIG_GATES, 2);
    const size_t n_chunk =
        fb_wire_put_chunk(block, &(FbChunk){RIG_EPOCH, rig.transfer, 0, 16, table});
    for (size_t bit = 0; bit < 8 * n_chunk; bit++) {
        block[bit / 8] ^= (uint8_t)(1 << bit % 8);
        const FbAnswer answer = fb_receiver_write(rig.receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_CHUNK,
                                                  block, n_chunk, rig.now_us, rig.actions);
        g_assert_true(answer == FB_ANSWER_CRC || answer == FB_ANSWER_MALFORMED);
        block[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
    g_assert_cmpuint(rig_status(&rig).received, ==, 0);

    rig_load(&rig);
    rig_order(&rig, FB_COMMAND_VERIFY);
    rig_machine(&rig, FB_MACHINE_VERIFIED);
    g_array_set_size(rig.actions, 0);
    FbOrder start = rig.last;
    start.seq++;
    start.command = FB_COMMAND_START;
    const size_t n_order = fb_wire_put_order(block, &start);
    for (size_t bit = 0; bit < 8 * n_order; bit++) {
        block[bit / 8] ^= (uint8_t)(1 << bit % 8);
        const FbAnswer answer =
            fb_receiver_write(rig.receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block, n_order,
                              rig.now_us, rig.actions);
        g_assert_true(answer == FB_ANSWER_CRC || answer == FB_ANSWER_MALFORMED);
        block[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
    assert_state(&rig, FB_STATE_READY, "damaged");
    g_assert_cmpuint(rig.actions->len, ==, 0);
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &start)), ==, "DONE");
    g_assert_cmpuint(fb_receiver_counts(rig.receiver)[FB_ANSWER_CRC], >, 500);
    rig_free(&rig);
}

typedef struct {
    const char *what;
    uint64_t gates[3];
    FbAnswer answer;
} GateCase;

static void verify_refuses(void)
{
    static const GateCase cases[] = {
        {"right", {6, 17, RIG_PROGRAM_BYTES}, FB_ANSWER_NONE},
        {"inside a line", {5, 17, RIG_PROGRAM_BYTES}, FB_ANSWER_PROGRAM},
        {"descending", {17, 6, RIG_PROGRAM_BYTES}, FB_ANSWER_PROGRAM},
        {"twice", {6, 6, RIG_PROGRAM_BYTES}, FB_ANSWER_PROGRAM},
        {"zero", {0, 6, RIG_PROGRAM_BYTES}, FB_ANSWER_PROGRAM},
        {"beyond", {6, UINT64_MAX, RIG_PROGRAM_BYTES}, FB_ANSWER_PROGRAM},
        {"no end", {6, 17, RIG_PROGRAM_BYTES - 1}, FB_ANSWER_PROGRAM},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        uint8_t table[3 * FB_GATE_BYTES];
        Rig rig = rig_new();
        rig_lead(&rig, FB_STATE_IDLE);
        rig_put_gates(table, cases[i].gates, 3);
        rig_open(&rig, RIG_PROGRAM, RIG_PROGRAM_BYTES, cases[i].gates, 3);
        rig_chunk(&rig, 0, table, sizeof table);
        rig_chunk(&rig, sizeof table, RIG_PROGRAM, RIG_PROGRAM_BYTES);
        g_test_message("%s", cases[i].what);
        g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==,
                        fb_answer_name(cases[i].answer));
        if (cases[i].answer == FB_ANSWER_PROGRAM)
            g_assert_cmpint(rig_status(&rig).alarm_code, ==, 1);
        rig_free(&rig);
    }

    /* Other bytes than announced, each chunk with a right CRC: the hash finds it. */
    Rig rig = rig_new();
    uint8_t table[2 * FB_GATE_BYTES];
    const char *other = "G0 X1\nG1 X9 F100\nM30\n";
    rig_lead(&rig, FB_STATE_IDLE);
    rig_put_gates(table, RIG_GATES, 2);
    rig_open(&rig, RIG_PROGRAM, RIG_PROGRAM_BYTES, RIG_GATES, 2);
    rig_chunk(&rig, 0, table, sizeof table);
    rig_chunk(&rig, sizeof table, other, RIG_PROGRAM_BYTES);
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "HASH");
    uint8_t sha256[32];
    rig_digest(other, RIG_PROGRAM_BYTES, sha256);
    const FbStatus s = rig_status(&rig);
    g_assert_true(memcmp(s.sha256, sha256, sizeof sha256) == 0);
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "WRONG_STATE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_VERIFY)), ==, "HASH");
    g_assert_null(fb_receiver_program(rig.receiver));
    g_assert_cmpuint(rig.actions->len, ==, 0);
    rig_free(&rig);
}

static void machine_refuses_program(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_VERIFYING);
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &rig.last)), ==, "NONE");
    rig_machine(&rig, FB_MACHINE_REFUSED);
    g_assert_cmpstr(fb_answer_name(rig_status(&rig).answer), ==, "PROGRAM");
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &rig.last)), ==, "PROGRAM");
    assert_state(&rig, FB_STATE_LOADING, "refused");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_CLOSE)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_FORGET));
    g_assert_cmpint(rig_status(&rig).alarm_code, ==, 0);
    g_assert_cmpuint(rig_status(&rig).transfer, ==, 0);
    rig_free(&rig);
}

static void open_limits(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    FbOrder o = rig.last;
    o.command = FB_COMMAND_OPEN;
    const struct {
        FbOpen open;
        const char *answer;
    } cases[] = {
        {{.program_bytes = (1 << 20) - 7, .gates = 1}, "TOO_LARGE"},
        {{.program_bytes = INT64_MAX, .gates = UINT32_MAX}, "TOO_LARGE"},
        {{.program_bytes = UINT64_MAX, .gates = UINT32_MAX}, "MALFORMED"},
        {{.program_bytes = 0, .gates = 1}, "MALFORMED"},
        {{.program_bytes = 4, .gates = 0}, "MALFORMED"},
        {{.program_bytes = 4, .gates = 5}, "MALFORMED"},
        {{.program_bytes = 4, .gates = 1, .flags = 2}, "MALFORMED"},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        o.seq++;
        o.open = cases[i].open;
        g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, cases[i].answer);
        assert_state(&rig, FB_STATE_READY, "OPEN refused");
        g_assert_nonnull(fb_receiver_program(rig.receiver));
    }
    const uint32_t before = rig_status(&rig).transfer;
    o.seq++;
    o.open = (FbOpen){.program_bytes = (1 << 20) - 8, .gates = 1};
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_FORGET));
    g_assert_cmpuint(rig_status(&rig).transfer, !=, before);
    rig_free(&rig);
}

static FbAnswer write_next(Rig *rig, FbOrder *o)
{
    o->seq = ++rig->seq;
    return rig_write_order(rig, o);
}

static void restart_at_a_gate(void)
{
    static const struct {
        uint32_t gate;
        uint64_t offset;
    } wrong[] = {{0, 0}, {0, 6}, {1, 0}, {1, 7}, {2, RIG_PROGRAM_BYTES}, {3, 6}, {UINT32_MAX, 6}};
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    FbOrder o = rig.last;
    o.command = FB_COMMAND_RESTART;
    o.transfer = rig.transfer;
    for (size_t i = 0; i < G_N_ELEMENTS(wrong); i++) {
        o.gate = wrong[i].gate;
        o.gate_offset = wrong[i].offset;
        g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "GATE");
    }
    g_assert_cmpuint(rig.actions->len, ==, 0);
    assert_state(&rig, FB_STATE_READY, "no gate");
    o.gate = 1;
    o.gate_offset = RIG_GATES[0];
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_RESTART));
    g_assert_cmpuint(fb_receiver_restart_gate(rig.receiver), ==, 1);
    g_assert_cmpuint(rig_status(&rig).run, ==, 1);
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &o)), ==, "DONE"); /* again: not done */
    g_assert_cmpuint(rig.actions->len, ==, 0);
    g_assert_cmpuint(rig_status(&rig).run, ==, 1);

    /* As START it needs an acknowledgement after an alarm. */
    rig_machine(&rig, FB_MACHINE_ALARM);
    rig_machine(&rig, FB_MACHINE_ACKNOWLEDGED);
    rig.now_us += RIG_AGENT_S * G_USEC_PER_SEC;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "NEEDS_ACKNOWLEDGE");
    rig_free(&rig);
}

/* A run that stands at 0 % is as good as held: a lost agent leaves it there until a person is at
 * the machine. Less is always allowed. */
static void overrides_of_a_lost_agent(void)
{
    Rig rig = rig_new_with(CFG_AGENT_LOSS_FINISH);
    rig_lead(&rig, FB_STATE_RUNNING);
    FbOrder o = rig.last;
    o.command = FB_COMMAND_OVERRIDE;
    o.arguments = (FbArguments){0, 50, 100, false};
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "DONE");
    rig.now_us += RIG_AGENT_S * G_USEC_PER_SEC;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    g_array_set_size(rig.actions, 0);
    o.arguments.feed_percent = 1;
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "NEEDS_ACKNOWLEDGE");
    o.arguments = (FbArguments){0, 51, 100, false};
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "NEEDS_ACKNOWLEDGE");
    g_assert_cmpuint(rig.actions->len, ==, 0);
    o.arguments = (FbArguments){0, 25, 120, false};
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "DONE");
    rig_machine(&rig, FB_MACHINE_ACKNOWLEDGED);
    o.arguments.feed_percent = 100;
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "DONE");
    rig_free(&rig);
}

static void overrides(void)
{
    static const FbArguments wrong[] = {{201, 100, 100, false},
                                        {100, 101, 100, false},
                                        {100, 100, 49, false},
                                        {100, 100, 201, false},
                                        {0xffff, 0, 100, false}};
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    FbOrder o = rig.last;
    o.command = FB_COMMAND_OPTIONAL_STOP;
    o.arguments.optional_stop = true;
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_OPTIONAL_STOP));
    o.command = FB_COMMAND_OVERRIDE;
    for (size_t i = 0; i < G_N_ELEMENTS(wrong); i++) {
        o.arguments = wrong[i];
        g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "MALFORMED");
    }
    g_assert_cmpuint(rig.actions->len, ==, 0);
    o.arguments = (FbArguments){0, 25, 200, false};
    g_assert_cmpstr(fb_answer_name(write_next(&rig, &o)), ==, "DONE");
    g_assert_true(rig_did(&rig, FB_DO_OVERRIDE));
    /* They stay over runs and transfers. */
    rig_order(&rig, FB_COMMAND_START);
    rig_machine(&rig, FB_MACHINE_ABORTED);
    rig_open(&rig, RIG_PROGRAM, RIG_PROGRAM_BYTES, RIG_GATES, 2);
    const FbStatus s = rig_status(&rig);
    g_assert_cmpuint(s.feed_override_percent, ==, 0);
    g_assert_cmpuint(s.rapid_override_percent, ==, 25);
    g_assert_cmpuint(s.spindle_override_percent, ==, 200);
    g_assert_true(s.optional_stop);
    const FbArguments now = fb_receiver_overrides(rig.receiver);
    g_assert_true(now.feed_percent == 0 && now.optional_stop);
    rig_free(&rig);

    /* 2 is neither on nor off. */
    uint8_t block[FB_BLOCK_BYTES], joined[FB_BLOCK_BYTES];
    o.command = FB_COMMAND_OPTIONAL_STOP;
    const size_t n = fb_wire_put_order(block, &o);
    block[n - 1] = 2;
    memcpy(joined, block, FB_COMMAND_BYTES - 4);
    memcpy(joined + FB_COMMAND_BYTES - 4, block + FB_COMMAND_BYTES, n - FB_COMMAND_BYTES);
    const uint32_t crc = fb_wire_crc(joined, n - 4);
    for (int i = 0; i < 4; i++)
        block[FB_COMMAND_BYTES - 4 + i] = (uint8_t)(crc >> (24 - 8 * i));
    g_assert_cmpint(fb_wire_get_order(block, n, &o), ==, FB_ANSWER_MALFORMED);
}

static void setup_is_published(void)
{
    Rig rig = rig_new();
    const uint16_t serial = rig_status(&rig).setup_serial;
    const FbSetup setup = {.serial = 999, .n_tools = 2, .tools = {{.number = 1}, {.number = 4}}};
    fb_receiver_set_setup(rig.receiver, &setup);
    const FbStatus s = rig_status(&rig);
    g_assert_cmpuint(s.setup_serial, ==, serial + 1);
    g_assert_cmpuint(s.n_tools, ==, 2);
    g_assert_cmpint(fb_receiver_setup(rig.receiver)->tools[1].number, ==, 4);
    rig_free(&rig);

    /* Memory that could not be filled is not promised. */
    const FbReceiverOptions large = {.epoch = 1, .memory_bytes = UINT64_C(1) << 40};
    g_autoptr(FbReceiver) receiver = fb_receiver_new(&large);
    FbStatus status;
    fb_receiver_status(receiver, 0, &status);
    g_assert_cmpuint(status.memory_bytes, ==, UINT64_C(1) << 30);
}

static void add(void)
{
    g_test_add_func("/fieldbus/receiver/commands-as-documented", commands_as_documented);
    g_test_add_func("/fieldbus/receiver/events-as-documented", events_as_documented);
    g_test_add_func("/fieldbus/receiver/back-from-alarm", back_from_alarm);
    g_test_add_func("/fieldbus/receiver/numbers-as-documented", numbers_as_documented);
    g_test_add_func("/fieldbus/receiver/refusals", refusals);
    g_test_add_func("/fieldbus/receiver/done-once", done_once);
    g_test_add_func("/fieldbus/receiver/stop-without-lease", stop_without_lease);
    g_test_add_func("/fieldbus/receiver/chunks", chunks);
    g_test_add_func("/fieldbus/receiver/damaged-blocks", damaged_blocks);
    g_test_add_func("/fieldbus/receiver/verify-refuses", verify_refuses);
    g_test_add_func("/fieldbus/receiver/machine-refuses-program", machine_refuses_program);
    g_test_add_func("/fieldbus/receiver/open-limits", open_limits);
    g_test_add_func("/fieldbus/receiver/restart-at-a-gate", restart_at_a_gate);
    g_test_add_func("/fieldbus/receiver/overrides", overrides);
    g_test_add_func("/fieldbus/receiver/overrides-of-a-lost-agent", overrides_of_a_lost_agent);
    g_test_add_func("/fieldbus/receiver/setup-is-published", setup_is_published);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
