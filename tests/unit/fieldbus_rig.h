/* SPDX-License-Identifier: Apache-2.0 */
/* What the fieldbus tests share: the tables of docs/protocol*.md, a receiver in any state,
 * programs.
 */
#ifndef TESTS_UNIT_FIELDBUS_RIG_H
#define TESTS_UNIT_FIELDBUS_RIG_H

#include <glib.h>
#include <string.h>

#include "fieldbus/receiver.h"
#include "tests/lib/test.h"

/* The rows (cells, stripped; with the head, without the rule) of the first table behind the line
 * that begins with `heading`; fails the test where there is none. */
static inline GPtrArray *doc_table(const char *heading)
{
    g_autofree char *general = NULL, *can = NULL;
    GPtrArray *rows = g_ptr_array_new_with_free_func((GDestroyNotify)g_strfreev);
    g_file_get_contents("docs/protocol.md", &general, NULL, NULL);
    g_file_get_contents("docs/protocol-can.md", &can, NULL, NULL);
    g_autofree char *text = g_strconcat(general ? general : "", can, NULL);
    g_auto(GStrv) lines = g_strsplit(text, "\n", -1);
    char **line = lines;
    while (*line && !g_str_has_prefix(*line, heading))
        line++;
    while (*line && (*line)[0] != '|')
        line++;
    for (; *line && (*line)[0] == '|'; line++) {
        if (g_str_has_prefix(*line, "|---"))
            continue;
        char **cells = g_strsplit(*line + 1, "|", -1);
        for (char **cell = cells; *cell; cell++)
            g_strstrip(*cell);
        g_ptr_array_add(rows, cells);
    }
    g_assert_cmpuint(rows->len, >, 1);
    return rows;
}

static inline const char *doc_cell(const GPtrArray *rows, guint row, guint column)
{
    char **cells = rows->pdata[row];
    return column < g_strv_length(cells) ? cells[column] : "";
}

typedef struct {
    const char *field;
    uint64_t value;
} Expected;

static inline uint64_t number_at(const uint8_t *bytes, guint n)
{
    uint64_t v = 0;
    for (guint i = 0; i < n; i++)
        v = v << 8 | bytes[i];
    return v;
}

static inline const Expected *find_field(const Expected *fields, const char *field)
{
    while (fields->field && strcmp(fields->field, field) != 0)
        fields++;
    return fields->field ? fields : NULL;
}

/* Each row of a table "position | type | field" against the bytes; `unit` bytes a position. */
static inline void check_layout(const char *heading, const uint8_t *bytes, guint first, guint unit,
                                const Expected *fields)
{
    g_autoptr(GPtrArray) rows = doc_table(heading);
    guint checked = 0, known = 0;
    while (fields[known].field)
        known++;
    for (guint i = 1; i < rows->len; i++) {
        const guint at = (guint)(atoi(doc_cell(rows, i, 0)) - (int)first) * unit;
        const char *type = doc_cell(rows, i, 1), *field = doc_cell(rows, i, 2);
        const Expected *e = find_field(fields, field);
        if (!e)
            continue;
        checked++;
        const guint n = g_str_has_prefix(type, "bytes") ? 4 : (guint)atoi(type + 1) / 8;
        const uint64_t mask = n == 8 ? UINT64_MAX : (UINT64_C(1) << 8 * n) - 1;
        if (number_at(bytes + at, n) != (e->value & mask)) {
            g_test_message("%s at %s", field, doc_cell(rows, i, 0));
            g_assert_cmphex(number_at(bytes + at, n), ==, e->value & mask);
        }
    }
    g_assert_cmpuint(checked, ==, known);
}

/* No row of the table is forgotten here, but what is reserved. */
static inline void check_all_named(const char *heading, const Expected *fields)
{
    g_autoptr(GPtrArray) rows = doc_table(heading);
    for (guint i = 1; i < rows->len; i++) {
        const char *field = doc_cell(rows, i, 2);
        if (strcmp(field, "reserved") != 0 && !find_field(fields, field)) {
            g_test_message("%s %s is not tested", heading, field);
            g_test_fail();
        }
    }
}

/* The table of gates of a stored program, as on the wire. */
static inline void rig_put_gates(uint8_t *table, const uint64_t *gates, size_t n)
{
    for (size_t i = 0; i < n; i++)
        fb_wire_put_gate(table + i * FB_GATE_BYTES, gates[i], NULL);
}

enum { RIG_SESSION = 11, RIG_EPOCH = 0x5e91a77, RIG_AGENT_S = 5, RIG_LEASE_S = 30 };
static const uint64_t RIG_TOKEN = UINT64_C(0x1234000056780000);

static const char RIG_PROGRAM[] = "G0 X1\nG1 X2 F100\nM30\n";
enum { RIG_PROGRAM_BYTES = sizeof RIG_PROGRAM - 1 };
static const uint64_t RIG_GATES[] = {6, RIG_PROGRAM_BYTES};

/* A receiver and who talks to it. */
typedef struct {
    FbReceiver *receiver;
    GArray *actions; /* of FbDo, since the last rig_clear */
    int64_t now_us;
    uint32_t seq;
    uint32_t transfer; /* of the last OPEN */
    FbOrder last;
} Rig;

static inline Rig rig_new_with(CfgAgentLoss on_agent_loss)
{
    const FbReceiverOptions options = {.epoch = RIG_EPOCH,
                                       .memory_bytes = 1 << 20,
                                       .on_agent_loss = on_agent_loss,
                                       .agent_timeout_us = RIG_AGENT_S * G_USEC_PER_SEC,
                                       .lease_timeout_us = RIG_LEASE_S * G_USEC_PER_SEC};
    return (Rig){.receiver = fb_receiver_new(&options),
                 .actions = g_array_new(FALSE, FALSE, sizeof(FbDo)),
                 .now_us = 1000};
}

static inline Rig rig_new(void)
{
    return rig_new_with(CFG_AGENT_LOSS_NEXT_GATE);
}

static inline void rig_free(Rig *rig)
{
    fb_receiver_free(rig->receiver);
    g_array_unref(rig->actions);
}

static inline FbStatus rig_status(const Rig *rig)
{
    FbStatus status;
    fb_receiver_status(rig->receiver, rig->now_us, &status);
    return status;
}

/* Whether the receiver asked for `what` since the last time, and for nothing else. */
static inline bool rig_did(Rig *rig, FbDo what)
{
    const bool did = rig->actions->len == 1 && g_array_index(rig->actions, FbDo, 0) == what;
    g_array_set_size(rig->actions, 0);
    return did;
}

static inline FbAnswer rig_write_order(Rig *rig, const FbOrder *order)
{
    uint8_t block[FB_BLOCK_BYTES];
    const size_t n = fb_wire_put_order(block, order);
    return fb_receiver_write(rig->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block, n,
                             rig->now_us, rig->actions);
}

/* The next command of the rig's own session, as it should be; OPEN needs rig_open. */
static inline FbAnswer rig_order(Rig *rig, FbCommand command)
{
    rig->last = (FbOrder){.session = RIG_SESSION,
                          .seq = ++rig->seq,
                          .epoch = RIG_EPOCH,
                          .transfer = rig_status(rig).transfer,
                          .token = RIG_TOKEN,
                          .command = command,
                          .open = {.program_bytes = 4, .gates = 1},
                          .gate = 1,
                          .gate_offset = RIG_GATES[0],
                          .arguments = {100, 100, 100, false}};
    return rig_write_order(rig, &rig->last);
}

static inline void rig_digest(const void *bytes, size_t n, uint8_t *sha256)
{
    gsize n_digest = 32;
    g_autoptr(GChecksum) hash = g_checksum_new(G_CHECKSUM_SHA256);
    g_checksum_update(hash, bytes, (gssize)n);
    g_checksum_get_digest(hash, sha256, &n_digest);
}

static inline FbAnswer rig_open(Rig *rig, const void *program, size_t n, const uint64_t *gates,
                                uint32_t n_gates)
{
    g_autofree uint8_t *table = g_malloc(n_gates * FB_GATE_BYTES);
    FbOrder order = {.session = RIG_SESSION,
                     .seq = ++rig->seq,
                     .epoch = RIG_EPOCH,
                     .token = RIG_TOKEN,
                     .command = FB_COMMAND_OPEN,
                     .open = {.program_bytes = n, .gates = n_gates}};
    rig_put_gates(table, gates, n_gates);
    order.open.gates_crc = fb_wire_crc(table, n_gates * FB_GATE_BYTES);
    rig_digest(program, n, order.open.id);
    const FbAnswer answer = rig_write_order(rig, &order);
    rig->transfer = rig_status(rig).transfer;
    return answer;
}

static inline FbAnswer rig_write_chunk(Rig *rig, const FbChunk *chunk)
{
    uint8_t block[FB_BLOCK_BYTES];
    const size_t n = fb_wire_put_chunk(block, chunk);
    return fb_receiver_write(rig->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_CHUNK, block, n,
                             rig->now_us, rig->actions);
}

static inline FbAnswer rig_chunk(Rig *rig, uint64_t offset, const void *bytes, size_t n)
{
    return rig_write_chunk(rig, &(FbChunk){RIG_EPOCH, rig->transfer, offset, (uint16_t)n, bytes});
}

static inline void rig_machine(Rig *rig, FbMachineEvent event)
{
    const FbAlarm alarm = {42, "Axis X beyond its travel", "Check the work offset."};
    fb_receiver_machine(rig->receiver, event, &alarm, rig->now_us, rig->actions);
}

static inline FbAnswer rig_beat(Rig *rig)
{
    uint8_t block[FB_BLOCK_BYTES];
    const size_t n = fb_wire_put_beat(block, &(FbBeat){RIG_SESSION, RIG_TOKEN, 1});
    return fb_receiver_write(rig->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_BEAT, block, n,
                             rig->now_us, rig->actions);
}

/* Opens the rig's program and sends all of it. */
static inline void rig_load(Rig *rig)
{
    uint8_t table[2 * FB_GATE_BYTES];
    rig_put_gates(table, RIG_GATES, 2);
    g_assert_cmpint(rig_open(rig, RIG_PROGRAM, RIG_PROGRAM_BYTES, RIG_GATES, 2), ==,
                    FB_ANSWER_DONE);
    g_assert_cmpint(rig_chunk(rig, 0, table, sizeof table), ==, FB_ANSWER_DONE);
    g_assert_cmpint(rig_chunk(rig, sizeof table, RIG_PROGRAM, RIG_PROGRAM_BYTES), ==,
                    FB_ANSWER_DONE);
}

/* Leads a fresh receiver into a state, with the lease taken; no actions are left behind. */
static inline void rig_lead(Rig *rig, FbState state)
{
    static const FbMachineEvent by_event[] = {[FB_STATE_HELD] = FB_MACHINE_HELD,
                                              [FB_STATE_PROGRAM_STOP] = FB_MACHINE_PROGRAM_STOP,
                                              [FB_STATE_COMPLETE] = FB_MACHINE_COMPLETE,
                                              [FB_STATE_TOOL_CHANGE] = FB_MACHINE_TOOL_CHANGE,
                                              [FB_STATE_ALARM] = FB_MACHINE_ALARM,
                                              [FB_STATE_ESTOP] = FB_MACHINE_ESTOP};
    rig_order(rig, FB_COMMAND_LEASE);
    if (state != FB_STATE_OFF)
        rig_machine(rig, FB_MACHINE_ACKNOWLEDGED);
    if (state > FB_STATE_IDLE)
        rig_load(rig);
    if (state >= FB_STATE_VERIFYING)
        rig_order(rig, FB_COMMAND_VERIFY);
    if (state >= FB_STATE_READY)
        rig_machine(rig, FB_MACHINE_VERIFIED);
    if (state >= FB_STATE_RUNNING)
        rig_order(rig, FB_COMMAND_START);
    if (state == FB_STATE_HOLDING)
        rig_order(rig, FB_COMMAND_HOLD);
    else if (state == FB_STATE_ABORTING)
        rig_order(rig, FB_COMMAND_ABORT);
    else if (state > FB_STATE_RUNNING)
        rig_machine(rig, by_event[state]);
    g_assert_cmpstr(fb_state_name(rig_status(rig).state), ==, fb_state_name(state));
    g_array_set_size(rig->actions, 0);
}

#endif
