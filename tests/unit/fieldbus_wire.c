/* SPDX-License-Identifier: Apache-2.0 */
/* The blocks against the tables of docs/protocol.md, section 2, and against anything else. */
#include <math.h>

#include "tests/unit/fieldbus_rig.h"

/* Every field has a value of its own, so that a field in the wrong place shows. */
static FbStatus full_status(void)
{
    FbStatus s = {.protocol_version = 0x0101,
                  .state = FB_STATE_HELD,
                  .epoch = 0x01020304,
                  .transfer = 0x05060708,
                  .length = 0x1112131415161718,
                  .received = 0x0112131415161718,
                  .may_send_to = 0x0212131415161718,
                  .gates = 0x21222324,
                  .gates_crc = 0x25262728,
                  .lease_owner = 0x31323334,
                  .lease_ms = 0x35363738,
                  .command_session = 0x41424344,
                  .command_seq = 0x45464748,
                  .command = FB_COMMAND_RESUME,
                  .answer = FB_ANSWER_CONFLICT,
                  .chunk_answer = FB_ANSWER_GAP,
                  .needs_acknowledge = true,
                  .agent_lost = true,
                  .run = 0x51525354,
                  .run_end = FB_RUN_ALARM,
                  .window_max = 16,
                  .chunk_max = 217,
                  .alarm_code = 0x6162,
                  .alarm_serial = 0x6364,
                  .feed_override_percent = 101,
                  .rapid_override_percent = 102,
                  .spindle_override_percent = 103,
                  .line = 0x71727374,
                  .executed_blocks = 0x7172737475767778,
                  .program_time_ms = 0x01727374,
                  .tool = -3,
                  .position_mm = {-1.001, 2.002, 2000000.003},
                  .feed_mm_min = 4000000.125,
                  .spindle_rpm = -24000.5,
                  .heartbeat = 0x01020305,
                  .window = 0x0708,
                  .work_offset = 59,
                  .starved = 0x21323334,
                  .starved_ms = 0x22333435,
                  .released = 0x0313233343536373,
                  .gate = 0x23343536,
                  .stop_line = 0x24353637,
                  .setup_serial = 0x2536,
                  .n_tools = 27,
                  .memory_bytes = 0x0414243444546474,
                  .drip = true,
                  .starving = true,
                  .optional_stop = true};
    for (int i = 0; i < 32; i++) {
        s.id[i] = (uint8_t)(0x80 + i);
        s.sha256[i] = (uint8_t)(0xa0 + i);
    }
    strcpy(s.alarm_text, "Weg überschritten");
    strcpy(s.alarm_advice, "Nullpunkt prüfen");
    return s;
}

static void status_as_documented(void)
{
    const FbStatus s = full_status();
    uint8_t block[FB_BLOCK_BYTES];
    g_assert_cmpuint(fb_wire_put_status(block, &s), ==, FB_STATUS_BYTES);
    const Expected fields[] = {{"protocol_version", s.protocol_version},
                               {"state", FB_STATE_HELD},
                               {"epoch", s.epoch},
                               {"transfer", s.transfer},
                               {"length", s.length},
                               {"received", s.received},
                               {"may_send_to", s.may_send_to},
                               {"gates", s.gates},
                               {"gates_crc", s.gates_crc},
                               {"id", 0x80818283},
                               {"sha256", 0xa0a1a2a3},
                               {"command_session", s.command_session},
                               {"command_seq", s.command_seq},
                               {"command", FB_COMMAND_RESUME},
                               {"answer", FB_ANSWER_CONFLICT},
                               {"chunk_answer", FB_ANSWER_GAP},
                               {"flags", 31},
                               {"lease_owner", s.lease_owner},
                               {"lease_ms", s.lease_ms},
                               {"heartbeat", s.heartbeat},
                               {"run", s.run},
                               {"run_end", FB_RUN_ALARM},
                               {"alarm_code", s.alarm_code},
                               {"alarm_serial", s.alarm_serial},
                               {"window_max", 16},
                               {"chunk_max", 217},
                               {"feed_override_percent", 101},
                               {"rapid_override_percent", 102},
                               {"spindle_override_percent", 103},
                               {"line", s.line},
                               {"executed_blocks", s.executed_blocks},
                               {"program_time_ms", s.program_time_ms},
                               {"tool", (uint64_t)-3},
                               {"position_x", (uint64_t)-1001},
                               {"position_y", 2002},
                               {"position_z", 2000000003},
                               {"feed", 4000000125},
                               {"spindle", (uint64_t)-24000500},
                               {"window", s.window},
                               {"work_offset", 59},
                               {"starved", s.starved},
                               {"starved_ms", s.starved_ms},
                               {"released", s.released},
                               {"gate", s.gate},
                               {"stop_line", s.stop_line},
                               {"setup_serial", s.setup_serial},
                               {"n_tools", 27},
                               {"memory", s.memory_bytes},
                               {"crc", fb_wire_crc(block, FB_STATUS_BYTES - 4)},
                               {NULL, 0}};
    check_all_named("### 2.2", fields);
    check_layout("### 2.2", block, FB_AT_STATUS, 2, fields);
}

static void alarm_as_documented(void)
{
    const FbStatus s = full_status();
    uint8_t block[FB_BLOCK_BYTES];
    g_assert_cmpuint(fb_wire_put_alarm(block, &s), ==, FB_ALARM_BYTES);
    const Expected fields[] = {{"alarm_serial", s.alarm_serial},
                               {"alarm_code", s.alarm_code},
                               {"alarm_text", number_at((const uint8_t *)"Weg ", 4)},
                               {"alarm_advice", number_at((const uint8_t *)"Null", 4)},
                               {"crc", fb_wire_crc(block, FB_ALARM_BYTES - 4)},
                               {NULL, 0}};
    check_layout("### 2.3", block, FB_AT_ALARM, 2, fields);
}

/* Each flag by itself in its place. */
static void flags_as_documented(void)
{
    for (int bit = 0; bit < 5; bit++) {
        const FbStatus s = {.protocol_version = 0x0101,
                            .epoch = 1,
                            .chunk_max = 1,
                            .needs_acknowledge = bit == 0,
                            .agent_lost = bit == 1,
                            .drip = bit == 2,
                            .starving = bit == 3,
                            .optional_stop = bit == 4};
        FbStatus back = {0};
        uint8_t block[FB_BLOCK_BYTES];
        g_assert_true(fb_wire_get_status(block, fb_wire_put_status(block, &s), &back));
        g_assert_cmpuint(number_at(block + 2 * 61, 2), ==, 1u << bit);
        g_assert_true(back.needs_acknowledge == s.needs_acknowledge &&
                      back.agent_lost == s.agent_lost && back.drip == s.drip &&
                      back.starving == s.starving && back.optional_stop == s.optional_stop);
    }
}

static FbSetup full_setup(void)
{
    FbSetup setup = {.serial = 0x7172, .n_tools = FB_TOOLS_MOST, .work_offset = 57};
    for (int i = 0; i < 6; i++)
        for (int axis = 0; axis < 3; axis++)
            setup.work_offset_mm[i][axis] = -1000.0 * i - 100.0 * axis - 0.0001;
    for (int i = 0; i < FB_TOOLS_MOST; i++)
        setup.tools[i] = (FbTool){i + 3, (CfgToolKind)(i % 3), i + 0.5, 0.25, 100.0 + i * 0.0001};
    return setup;
}

static void offsets_as_documented(void)
{
    const FbSetup setup = full_setup();
    uint8_t block[FB_BLOCK_BYTES];
    g_assert_cmpuint(fb_wire_put_offsets(block, &setup), ==, FB_OFFSETS_BYTES);
    const Expected fields[] = {{"setup_serial", setup.serial},
                               {"work_offset", 57},
                               {"offsets", (uint64_t)-1},
                               {"crc", fb_wire_crc(block, FB_OFFSETS_BYTES - 4)},
                               {NULL, 0}};
    check_all_named("### 2.4", fields);
    check_layout("### 2.4", block, FB_AT_OFFSETS, 2, fields);
    /* Z of G59, the last of the eighteen. */
    g_assert_cmpint((int32_t)number_at(block + 4 + 17 * 4, 4), ==, -52000001);
    FbSetup back = {0};
    g_assert_true(fb_wire_get_offsets(block, FB_OFFSETS_BYTES, &back));
    test_near(back.work_offset_mm[5][2], -5200.0001, 1e-9, 0);
    g_assert_false(fb_wire_get_offsets(block, FB_OFFSETS_BYTES - 2, &back));
}

static void tools_as_documented(void)
{
    const FbSetup setup = full_setup();
    FbSetup back = {.serial = setup.serial};
    uint8_t block[FB_BLOCK_BYTES];
    for (unsigned page = 0; page < FB_TOOLS_PAGES; page++) {
        const FbTool *t = &setup.tools[page * FB_TOOLS_A_PAGE];
        g_assert_cmpuint(fb_wire_put_tools(block, &setup, page), ==, FB_TOOLS_BYTES);
        const Expected fields[] = {{"setup_serial", setup.serial},
                                   {"n_tools", FB_TOOLS_MOST},
                                   {"tools", (uint64_t)t->number},
                                   {"crc", fb_wire_crc(block, FB_TOOLS_BYTES - 4)},
                                   {NULL, 0}};
        const Expected entry[] = {{"number", (uint64_t)t->number},
                                  {"type", t->kind},
                                  {"diameter", (uint64_t)(t->diameter_mm * 10000)},
                                  {"corner_radius", 2500},
                                  {"length", (uint64_t)(1000000 + (t - setup.tools))},
                                  {NULL, 0}};
        check_all_named("TOOLS is the tool table", fields);
        check_layout("TOOLS is the tool table", block, 0, 2, fields);
        check_all_named("| Entry's register", entry);
        check_layout("| Entry's register", block + 4, 0, 2, entry);
        g_assert_true(fb_wire_get_tools(block, FB_TOOLS_BYTES, page, &back));
    }
    for (int i = 0; i < FB_TOOLS_MOST; i++) {
        g_assert_cmpint(back.tools[i].number, ==, i + 3);
        g_assert_cmpint(back.tools[i].kind, ==, setup.tools[i].kind);
        test_near(back.tools[i].length_mm, setup.tools[i].length_mm, 1e-9, 0);
    }
    /* A page of another table. */
    back.serial++;
    g_assert_true(fb_wire_get_tools(block, FB_TOOLS_BYTES, 0, &back));
    g_assert_cmpuint(back.serial, ==, setup.serial);
}

static void ack_as_documented(void)
{
    const FbStatus s = full_status();
    FbStatus back = full_status();
    uint8_t block[FB_BLOCK_BYTES];
    g_assert_cmpuint(fb_wire_put_ack(block, &s), ==, FB_ACK_BYTES);
    const Expected fields[] = {{"epoch", s.epoch},
                               {"transfer", s.transfer},
                               {"received", s.received},
                               {"may_send_to", s.may_send_to},
                               {"state", FB_STATE_HELD},
                               {"chunk_answer", FB_ANSWER_GAP},
                               {"crc", fb_wire_crc(block, FB_ACK_BYTES - 4)},
                               {NULL, 0}};
    check_all_named("### 2.8", fields);
    check_layout("### 2.8", block, 0, 1, fields);
    back.transfer = 0;
    back.received = 0;
    g_assert_true(fb_wire_get_ack(block, FB_ACK_BYTES, &back));
    g_assert_cmpuint(back.received, ==, s.received);
    back.length = s.received - 1; /* more than the stream has */
    back.transfer = 0;
    g_assert_false(fb_wire_get_ack(block, FB_ACK_BYTES, &back));
    g_assert_cmpuint(back.transfer, ==, 0);
}

static FbOrder full_order(void)
{
    FbOrder o = {.session = 0x01020304,
                 .seq = 0x05060708,
                 .epoch = 0x090a0b0c,
                 .transfer = 0x0d0e0f10,
                 .token = 0x1112131415161718,
                 .command = FB_COMMAND_OPEN,
                 .open = {.program_bytes = 0x2122232425262728,
                          .gates = 0x31323334,
                          .gates_crc = 0x35363738,
                          .flags = 0x4142,
                          .window = 0x4344}};
    memset(o.open.id, 0x99, sizeof o.open.id);
    return o;
}

static void command_as_documented(void)
{
    const FbOrder o = full_order();
    uint8_t block[FB_BLOCK_BYTES], joined[FB_BLOCK_BYTES];
    const size_t n = fb_wire_put_order(block, &o);
    g_assert_cmpuint(n, ==, FB_COMMAND_BYTES + FB_OPEN_BYTES);
    memcpy(joined, block, FB_COMMAND_BYTES - 4);
    memcpy(joined + FB_COMMAND_BYTES - 4, block + FB_COMMAND_BYTES, FB_OPEN_BYTES);
    const Expected fields[] = {{"session", o.session},
                               {"seq", o.seq},
                               {"epoch", o.epoch},
                               {"transfer", o.transfer},
                               {"token", o.token},
                               {"command", FB_COMMAND_OPEN},
                               {"argument_bytes", FB_OPEN_BYTES},
                               {"crc", fb_wire_crc(joined, n - 4)},
                               {NULL, 0}};
    const Expected arguments[] = {{"id", 0x99999999},
                                  {"program_bytes", o.open.program_bytes},
                                  {"gates", o.open.gates},
                                  {"gates_crc", o.open.gates_crc},
                                  {"flags", o.open.flags},
                                  {"window", o.open.window},
                                  {NULL, 0}};
    check_layout("### 2.5", block, 0, 1, fields);
    check_all_named("Arguments of OPEN", arguments);
    check_layout("Arguments of OPEN", block, 0, 1, arguments);
}

/* The arguments of the others, and that a command with those of another is malformed. */
static void arguments_as_documented(void)
{
    FbOrder o = full_order(), back;
    o.gate = 0x51525354;
    o.gate_offset = 0x6162636465666768;
    o.arguments = (FbArguments){0x7172, 0x7374, 0x7576, true};
    const struct {
        FbCommand command;
        const char *heading;
        size_t n;
        Expected fields[4];
    } cases[] = {
        {FB_COMMAND_RESTART,
         "Arguments of RESTART",
         FB_RESTART_BYTES,
         {{"gate", o.gate}, {"gate_offset", o.gate_offset}}},
        {FB_COMMAND_OVERRIDE,
         "Arguments of OVERRIDE",
         FB_OVERRIDE_BYTES,
         {{"feed_percent", 0x7172}, {"rapid_percent", 0x7374}, {"spindle_percent", 0x7576}}},
        {FB_COMMAND_OPTIONAL_STOP,
         "Arguments of OPTIONAL_STOP",
         FB_OPTIONAL_STOP_BYTES,
         {{"on", 1}}},
        {FB_COMMAND_START, NULL, 0, {{NULL, 0}}},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        uint8_t block[FB_BLOCK_BYTES];
        o.command = cases[i].command;
        const size_t n = fb_wire_put_order(block, &o);
        g_assert_cmpuint(n, ==, FB_COMMAND_BYTES + cases[i].n);
        g_assert_cmpuint(number_at(block + 26, 2), ==, cases[i].n);
        if (cases[i].heading) {
            check_all_named(cases[i].heading, cases[i].fields);
            check_layout(cases[i].heading, block, 0, 1, cases[i].fields);
        }
        g_assert_cmpint(fb_wire_get_order(block, n, &back), ==, FB_ANSWER_DONE);
        uint8_t again[FB_BLOCK_BYTES];
        g_assert_cmpuint(fb_wire_put_order(again, &back), ==, n);
        g_assert_true(memcmp(block, again, n) == 0);
        for (FbCommand other = 0; other < 40; other++) {
            const bool bare = other != FB_COMMAND_OPEN && other != FB_COMMAND_NONE &&
                              (other < FB_COMMAND_RESTART) && cases[i].n == 0;
            uint8_t changed[FB_BLOCK_BYTES], joined[FB_BLOCK_BYTES];
            memcpy(changed, block, n);
            changed[25] = (uint8_t)other;
            memcpy(joined, changed, 28);
            memcpy(joined + 28, changed + 32, n - 32);
            const uint32_t crc = fb_wire_crc(joined, n - 4);
            for (int j = 0; j < 4; j++)
                changed[28 + j] = (uint8_t)(crc >> (24 - 8 * j));
            g_assert_cmpint(fb_wire_get_order(changed, n, &back), ==,
                            other == o.command || bare ? FB_ANSWER_DONE : FB_ANSWER_MALFORMED);
        }
    }
}

/* An entry of the table of gates, with and without its running hash. */
static void gates_as_documented(void)
{
    uint8_t entry[FB_DRIP_GATE_BYTES], hash[32];
    memset(hash, 0x9a, sizeof hash);
    fb_wire_put_gate(entry, 0x0102030405060708, hash);
    g_assert_cmphex(number_at(entry, 8), ==, 0x0102030405060708);
    g_assert_true(memcmp(entry + 8, hash, sizeof hash) == 0);
    g_assert_cmphex(fb_wire_get_gate(entry), ==, 0x0102030405060708);
    g_assert_cmpuint(fb_wire_gate_bytes(0), ==, 8);
    g_assert_cmpuint(fb_wire_gate_bytes(FB_OPEN_DRIP), ==, 40);
}

static void chunk_and_beat_as_documented(void)
{
    uint8_t block[FB_BLOCK_BYTES], joined[FB_BLOCK_BYTES];
    const FbChunk c = {0x01020304, 0x05060708, 0x1112131415161718, 5, (const uint8_t *)"G1 X1"};
    g_assert_cmpuint(fb_wire_put_chunk(block, &c), ==, 30);
    memcpy(joined, block, 20);
    memcpy(joined + 20, block + 24, 5);
    const Expected chunk[] = {
        {"epoch", c.epoch}, {"transfer", c.transfer},         {"offset", c.offset},
        {"length", 5},      {"crc", fb_wire_crc(joined, 25)}, {NULL, 0}};
    check_layout("### 2.6", block, 0, 1, chunk);
    g_assert_true(memcmp(block + 24, "G1 X1\0", 6) == 0);

    const FbBeat b = {0x21222324, 0x3132333435363738, 0x41424344};
    g_assert_cmpuint(fb_wire_put_beat(block, &b), ==, FB_BEAT_BYTES);
    const Expected beat[] = {{"session", b.session},
                             {"token", b.token},
                             {"count", b.count},
                             {"crc", fb_wire_crc(block, 16)},
                             {NULL, 0}};
    check_layout("### 2.7", block, 0, 1, beat);
}

static void map_as_documented(void)
{
    static const struct {
        const char *block;
        int at, registers;
    } blocks[] = {{"STATUS", FB_AT_STATUS, FB_STATUS_BYTES / 2},
                  {"ALARM", FB_AT_ALARM, FB_ALARM_BYTES / 2},
                  {"OFFSETS", FB_AT_OFFSETS, FB_OFFSETS_BYTES / 2},
                  {"TOOLS, page 0", FB_AT_TOOLS, FB_TOOLS_BYTES / 2},
                  {"TOOLS, page 4", FB_AT_TOOLS + 4 * FB_TOOLS_PAGE_REGISTERS, FB_TOOLS_BYTES / 2},
                  {"COMMAND", FB_AT_COMMAND, FB_COMMAND_BYTES / 2},
                  {"CHUNK", FB_AT_CHUNK, FB_CHUNK_HEADER_BYTES / 2 + 1},
                  {"BEAT", FB_AT_BEAT, FB_BEAT_BYTES / 2}};
    g_autoptr(GPtrArray) rows = doc_table("### 2.1");
    int end = 0;
    guint found = 0;
    for (guint i = 1; i < rows->len; i++) {
        g_assert_cmpint(atoi(doc_cell(rows, i, 1)), >=, end);
        end = atoi(doc_cell(rows, i, 1)) + atoi(doc_cell(rows, i, 2));
        for (guint j = 0; j < G_N_ELEMENTS(blocks); j++)
            if (strcmp(doc_cell(rows, i, 0), blocks[j].block) == 0) {
                found++;
                g_assert_cmpint(atoi(doc_cell(rows, i, 1)), ==, blocks[j].at);
                g_assert_cmpint(atoi(doc_cell(rows, i, 2)), ==, blocks[j].registers);
            }
    }
    g_assert_cmpuint(found, ==, G_N_ELEMENTS(blocks));
    g_assert_cmpint(end, ==, FB_N_REGISTERS);
}

static void there_and_back(void)
{
    uint8_t block[FB_BLOCK_BYTES], again[FB_BLOCK_BYTES];
    const FbStatus s = full_status();
    FbStatus back = {0};
    FbOrder o;
    FbChunk c;
    FbBeat b;
    size_t n = fb_wire_put_status(block, &s);
    g_assert_true(fb_wire_get_status(block, n, &back));
    fb_wire_put_status(again, &back);
    g_assert_true(memcmp(block, again, n) == 0);
    n = fb_wire_put_alarm(block, &s);
    g_assert_true(fb_wire_get_alarm(block, n, &back));
    g_assert_cmpstr(back.alarm_text, ==, s.alarm_text);
    g_assert_cmpstr(back.alarm_advice, ==, s.alarm_advice);
    back.alarm_serial++; /* which the status said */
    back.alarm_code++;
    g_assert_true(fb_wire_get_alarm(block, n, &back));
    g_assert_cmpuint(back.alarm_serial, ==, s.alarm_serial);
    g_assert_cmpuint(back.alarm_code, ==, s.alarm_code);

    const FbOrder order = full_order();
    n = fb_wire_put_order(block, &order);
    g_assert_cmpint(fb_wire_get_order(block, n, &o), ==, FB_ANSWER_DONE);
    fb_wire_put_order(again, &o);
    g_assert_true(memcmp(block, again, n) == 0);
    for (uint16_t length = 1; length <= FB_CHUNK_BYTES; length++) {
        uint8_t bytes[FB_CHUNK_BYTES];
        memset(bytes, length, sizeof bytes);
        n = fb_wire_put_chunk(block, &(FbChunk){1, 2, 3, length, bytes});
        g_assert_cmpuint(n, <=, FB_BLOCK_BYTES);
        g_assert_cmpint(fb_wire_get_chunk(block, n, &c), ==, FB_ANSWER_DONE);
        g_assert_true(c.length == length && memcmp(c.bytes, bytes, length) == 0);
    }
    n = fb_wire_put_beat(block, &(FbBeat){1, 2, 3});
    g_assert_cmpint(fb_wire_get_beat(block, n, &b), ==, FB_ANSWER_DONE);
    g_assert_true(b.session == 1 && b.token == 2 && b.count == 3);
}

static void numbers_that_do_not_fit(void)
{
    uint8_t block[FB_BLOCK_BYTES];
    FbStatus s = full_status(), back = {0};
    s.position_mm[0] = 1e300;
    s.position_mm[1] = -1e300;
    s.position_mm[2] = (double)NAN;
    s.feed_mm_min = -1;
    g_assert_true(fb_wire_get_status(block, fb_wire_put_status(block, &s), &back));
    test_near(back.position_mm[0], INT32_MAX / 1000.0, 1e-9, 0);
    test_near(back.position_mm[1], INT32_MIN / 1000.0, 1e-9, 0);
    test_near(back.position_mm[2], 0, 0, 0);
    test_near(back.feed_mm_min, 0, 0, 0);
}

/* A text is cut between characters, says so, and always ends. */
static void texts(void)
{
    char text[FB_TEXT_BYTES];
    g_autoptr(GString) s = g_string_new("x");
    while (s->len < 2 * FB_TEXT_BYTES)
        g_string_append(s, "ü");
    fb_wire_text(text, s->str);
    g_assert_cmpuint(strlen(text), ==, FB_TEXT_BYTES - 2);
    g_assert_true(g_utf8_validate(text, -1, NULL) && g_str_has_suffix(text, "ü…"));
    fb_wire_text(text, s->str + 1);
    g_assert_cmpuint(strlen(text), ==, FB_TEXT_BYTES - 1);
    g_assert_true(g_utf8_validate(text, -1, NULL) && g_str_has_suffix(text, "ü…"));
    g_string_truncate(s, FB_TEXT_BYTES - 1); /* as long as can be */
    fb_wire_text(text, s->str);
    g_assert_cmpstr(text, ==, s->str);
    fb_wire_text(text, NULL);
    g_assert_cmpstr(text, ==, "");
    fb_wire_text(text, "ab\xff"
                       "cd");
    g_assert_cmpstr(text, ==, "ab");
}

/* What a machine may never publish is refused although its CRC is right. */
static void impossible_statuses(void)
{
    for (int i = 0; i < 9; i++) {
        uint8_t block[FB_BLOCK_BYTES];
        FbStatus s = full_status(), back = {0};
        if (i == 0)
            s.protocol_version = 0x0200;
        if (i == 1)
            s.state = FB_STATE_UNKNOWN;
        if (i == 2)
            s.answer = 32;
        if (i == 3)
            s.epoch = 0;
        if (i == 4)
            s.received = s.length + 1;
        if (i == 5)
            s.chunk_max = FB_CHUNK_BYTES + 1;
        if (i == 6)
            s.chunk_max = 0;
        if (i == 7)
            s.run_end = 4;
        if (i == 8)
            s.n_tools = FB_TOOLS_MOST + 1;
        g_assert_false(fb_wire_get_status(block, fb_wire_put_status(block, &s), &back));
    }
}

/* Any bytes of any length are refused or decoded, and read no further than their end. */
static void any_bytes(void)
{
    FbStatus s = full_status();
    FbSetup setup = full_setup();
    FbOrder o;
    FbChunk c;
    FbBeat b;
    g_autoptr(GRand) rand = g_rand_new_with_seed(20240607); /* a CRC is met once in 4e9 */
    for (int i = 0; i < 100000; i++) {
        const bool long_one = i % 100 == 0;
        const size_t n = (size_t)g_rand_int_range(rand, 0, long_one ? FB_BLOCK_BYTES + 1 : 300);
        g_autofree uint8_t *bytes = g_malloc(n + 1);
        for (size_t j = 0; j < n; j++)
            bytes[j] = (uint8_t)g_rand_int(rand);
        g_assert_false(fb_wire_get_status(bytes, n, &s));
        g_assert_false(fb_wire_get_alarm(bytes, n, &s));
        g_assert_false(fb_wire_get_ack(bytes, n, &s));
        g_assert_false(fb_wire_get_offsets(bytes, n, &setup));
        g_assert_false(fb_wire_get_tools(bytes, n, (unsigned)i % FB_TOOLS_PAGES, &setup));
        g_assert_cmpint(fb_wire_get_order(bytes, n, &o), !=, FB_ANSWER_DONE);
        g_assert_cmpint(fb_wire_get_chunk(bytes, n, &c), !=, FB_ANSWER_DONE);
        g_assert_cmpint(fb_wire_get_beat(bytes, n, &b), !=, FB_ANSWER_DONE);
    }
}

static void add(void)
{
    g_test_add_func("/fieldbus/wire/status-as-documented", status_as_documented);
    g_test_add_func("/fieldbus/wire/alarm-as-documented", alarm_as_documented);
    g_test_add_func("/fieldbus/wire/command-as-documented", command_as_documented);
    g_test_add_func("/fieldbus/wire/chunk-and-beat-as-documented", chunk_and_beat_as_documented);
    g_test_add_func("/fieldbus/wire/flags-as-documented", flags_as_documented);
    g_test_add_func("/fieldbus/wire/offsets-as-documented", offsets_as_documented);
    g_test_add_func("/fieldbus/wire/tools-as-documented", tools_as_documented);
    g_test_add_func("/fieldbus/wire/ack-as-documented", ack_as_documented);
    g_test_add_func("/fieldbus/wire/arguments-as-documented", arguments_as_documented);
    g_test_add_func("/fieldbus/wire/gates-as-documented", gates_as_documented);
    g_test_add_func("/fieldbus/wire/map-as-documented", map_as_documented);
    g_test_add_func("/fieldbus/wire/there-and-back", there_and_back);
    g_test_add_func("/fieldbus/wire/numbers-that-do-not-fit", numbers_that_do_not_fit);
    g_test_add_func("/fieldbus/wire/texts", texts);
    g_test_add_func("/fieldbus/wire/impossible-statuses", impossible_statuses);
    g_test_add_func("/fieldbus/wire/any-bytes", any_bytes);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
