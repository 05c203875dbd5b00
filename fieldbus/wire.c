/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/wire.h"

#include <math.h>
#include <string.h>
#include <zlib.h>

#include "fieldbus/bytes.h"

static uint8_t *put_bytes(uint8_t *p, const void *bytes, size_t n)
{
    memcpy(p, bytes, n);
    return p + n;
}

/* `scale` units of the wire a unit of ours; what does not fit is clamped, what is no number is 0.
 */
static uint8_t *put_fixed(uint8_t *p, double v, double scale, double low, double high)
{
    const double w = isfinite(v) ? CLAMP(round(v * scale), low, high) : 0;
    return fb_put32(p, (uint32_t)(int64_t)w);
}

void fb_wire_text(char *to, const char *text)
{
    static const char more[] = "…";
    const char *end;
    const char *from = text ? text : "";
    const size_t length = strnlen(from, FB_TEXT_BYTES);
    const bool fits = length < FB_TEXT_BYTES;
    g_utf8_validate_len(from, fits ? length : FB_TEXT_BYTES - sizeof more, &end);
    memset(to, 0, FB_TEXT_BYTES);
    memcpy(to, from, (size_t)(end - from));
    if (!fits)
        memcpy(to + (end - from), more, sizeof more);
}

static uint8_t *put_text(uint8_t *p, const char *text)
{
    fb_wire_text((char *)p, text);
    return p + FB_TEXT_BYTES;
}

static void get_bytes(const uint8_t **p, void *bytes, size_t n)
{
    memcpy(bytes, *p, n);
    *p += n;
}

static double get_fixed(const uint8_t **p, double scale)
{
    return (int32_t)fb_take32(p) / scale;
}

static void get_text(const uint8_t **p, char *text)
{
    const char *end;
    get_bytes(p, text, FB_TEXT_BYTES);
    text[FB_TEXT_BYTES - 1] = 0;
    g_utf8_validate(text, -1, &end);
    text[end - text] = 0;
}

uint32_t fb_wire_crc(const uint8_t *bytes, size_t n)
{
    return (uint32_t)crc32_z(0, bytes, n);
}

/* CRC of a header of n bytes and of what lies behind the CRC's own four bytes. */
static uint32_t crc_around(const uint8_t *block, size_t n, size_t behind)
{
    return (uint32_t)crc32_z(crc32_z(0, block, n), block + n + 4, behind);
}

/* The last four bytes of a block are the CRC of those before. */
static size_t seal(uint8_t *out, size_t n)
{
    fb_put32(out + n - 4, fb_wire_crc(out, n - 4));
    return n;
}

static bool is_sealed(const uint8_t *in, size_t n, size_t expected)
{
    return n == expected && fb_get32(in + n - 4) == fb_wire_crc(in, n - 4);
}

/* --------------------------------------------------------------------- status, alarm */

enum {
    FLAG_NEEDS_ACKNOWLEDGE = 1 << 0,
    FLAG_AGENT_LOST = 1 << 1,
    FLAG_DRIP = 1 << 2,
    FLAG_STARVING = 1 << 3,
    FLAG_OPTIONAL_STOP = 1 << 4,
};

uint16_t fb_wire_flags(const FbStatus *s)
{
    return (uint16_t)((s->needs_acknowledge ? FLAG_NEEDS_ACKNOWLEDGE : 0) |
                      (s->agent_lost ? FLAG_AGENT_LOST : 0) | (s->drip ? FLAG_DRIP : 0) |
                      (s->starving ? FLAG_STARVING : 0) |
                      (s->optional_stop ? FLAG_OPTIONAL_STOP : 0));
}

size_t fb_wire_put_status(uint8_t *out, const FbStatus *s)
{
    uint8_t *p = fb_put16(fb_put16(out, s->protocol_version), (uint16_t)s->state);
    p = fb_put32(fb_put32(p, s->epoch), s->transfer);
    p = fb_put64(fb_put64(fb_put64(p, s->length), s->received), s->may_send_to);
    p = fb_put32(fb_put32(p, s->gates), s->gates_crc);
    p = put_bytes(put_bytes(p, s->id, sizeof s->id), s->sha256, sizeof s->sha256);
    p = fb_put32(fb_put32(p, s->command_session), s->command_seq);
    p = fb_put16(fb_put16(p, (uint16_t)s->command), (uint16_t)s->answer);
    p = fb_put16(p, (uint16_t)s->chunk_answer);
    p = fb_put16(p, fb_wire_flags(s));
    p = fb_put32(fb_put32(p, s->lease_owner), s->lease_ms);
    p = fb_put32(fb_put32(p, s->heartbeat), s->run);
    p = fb_put16(fb_put16(fb_put16(p, (uint16_t)s->run_end), s->alarm_code), s->alarm_serial);
    p = fb_put16(fb_put16(p, s->window_max), s->chunk_max);
    p = fb_put16(p, s->feed_override_percent);
    p = fb_put16(fb_put16(p, s->rapid_override_percent), s->spindle_override_percent);
    p = fb_put32(p, s->line);
    p = fb_put64(p, s->executed_blocks);
    p = fb_put32(fb_put32(p, s->program_time_ms), (uint32_t)s->tool);
    for (int i = 0; i < 3; i++)
        p = put_fixed(p, s->position_mm[i], 1000, INT32_MIN, INT32_MAX);
    p = put_fixed(p, s->feed_mm_min, 1000, 0, UINT32_MAX);
    p = put_fixed(p, s->spindle_rpm, 1000, INT32_MIN, INT32_MAX);
    p = fb_put16(fb_put16(p, s->window), s->work_offset);
    p = fb_put32(fb_put32(p, s->starved), s->starved_ms);
    p = fb_put64(p, s->released);
    p = fb_put32(fb_put32(p, s->gate), s->stop_line);
    p = fb_put16(fb_put16(p, s->setup_serial), s->n_tools);
    p = fb_put64(p, s->memory_bytes);
    memset(p, 0, (size_t)(out + FB_STATUS_BYTES - p));
    return seal(out, FB_STATUS_BYTES);
}

static bool status_is_possible(const FbStatus *s)
{
    return s->protocol_version >> 8 == FB_PROTOCOL_VERSION >> 8 && s->state < FB_STATE_UNKNOWN &&
           s->command < 32 && s->answer < 32 && s->chunk_answer < 32 && s->run_end < 4 &&
           s->epoch != 0 && s->received <= s->length && s->chunk_max >= 1 &&
           s->chunk_max <= FB_CHUNK_BYTES && s->n_tools <= FB_TOOLS_MOST;
}

bool fb_wire_get_status(const uint8_t *in, size_t n, FbStatus *s)
{
    const uint8_t *p = in;
    if (!is_sealed(in, n, FB_STATUS_BYTES))
        return false;
    s->protocol_version = fb_take16(&p);
    s->state = (FbState)fb_take16(&p);
    s->epoch = fb_take32(&p);
    s->transfer = fb_take32(&p);
    s->length = fb_take64(&p);
    s->received = fb_take64(&p);
    s->may_send_to = fb_take64(&p);
    s->gates = fb_take32(&p);
    s->gates_crc = fb_take32(&p);
    get_bytes(&p, s->id, sizeof s->id);
    get_bytes(&p, s->sha256, sizeof s->sha256);
    s->command_session = fb_take32(&p);
    s->command_seq = fb_take32(&p);
    s->command = (FbCommand)fb_take16(&p);
    s->answer = (FbAnswer)fb_take16(&p);
    s->chunk_answer = (FbAnswer)fb_take16(&p);
    const uint16_t flags = fb_take16(&p);
    s->needs_acknowledge = flags & FLAG_NEEDS_ACKNOWLEDGE;
    s->agent_lost = flags & FLAG_AGENT_LOST;
    s->drip = flags & FLAG_DRIP;
    s->starving = flags & FLAG_STARVING;
    s->optional_stop = flags & FLAG_OPTIONAL_STOP;
    s->lease_owner = fb_take32(&p);
    s->lease_ms = fb_take32(&p);
    s->heartbeat = fb_take32(&p);
    s->run = fb_take32(&p);
    s->run_end = (FbRunEnd)fb_take16(&p);
    s->alarm_code = fb_take16(&p);
    s->alarm_serial = fb_take16(&p);
    s->window_max = fb_take16(&p);
    s->chunk_max = fb_take16(&p);
    s->feed_override_percent = fb_take16(&p);
    s->rapid_override_percent = fb_take16(&p);
    s->spindle_override_percent = fb_take16(&p);
    s->line = fb_take32(&p);
    s->executed_blocks = fb_take64(&p);
    s->program_time_ms = fb_take32(&p);
    s->tool = (int32_t)fb_take32(&p);
    for (int i = 0; i < 3; i++)
        s->position_mm[i] = get_fixed(&p, 1000);
    s->feed_mm_min = fb_take32(&p) / 1000.0;
    s->spindle_rpm = get_fixed(&p, 1000);
    s->window = fb_take16(&p);
    s->work_offset = fb_take16(&p);
    s->starved = fb_take32(&p);
    s->starved_ms = fb_take32(&p);
    s->released = fb_take64(&p);
    s->gate = fb_take32(&p);
    s->stop_line = fb_take32(&p);
    s->setup_serial = fb_take16(&p);
    s->n_tools = fb_take16(&p);
    s->memory_bytes = fb_take64(&p);
    return status_is_possible(s);
}

size_t fb_wire_put_alarm(uint8_t *out, const FbStatus *s)
{
    uint8_t *p = fb_put16(fb_put16(out, s->alarm_serial), s->alarm_code);
    put_text(put_text(p, s->alarm_text), s->alarm_advice);
    return seal(out, FB_ALARM_BYTES);
}

bool fb_wire_get_alarm(const uint8_t *in, size_t n, FbStatus *s)
{
    const uint8_t *p = in;
    if (!is_sealed(in, n, FB_ALARM_BYTES))
        return false;
    s->alarm_serial = fb_take16(&p);
    s->alarm_code = fb_take16(&p);
    get_text(&p, s->alarm_text);
    get_text(&p, s->alarm_advice);
    return true;
}

size_t fb_wire_put_ack(uint8_t *out, const FbStatus *s)
{
    uint8_t *p = fb_put32(fb_put32(out, s->epoch), s->transfer);
    p = fb_put64(fb_put64(p, s->received), s->may_send_to);
    fb_put16(fb_put16(p, (uint16_t)s->state), (uint16_t)s->chunk_answer);
    return seal(out, FB_ACK_BYTES);
}

bool fb_wire_get_ack(const uint8_t *in, size_t n, FbStatus *status)
{
    const uint8_t *p = in;
    FbStatus s = *status;
    if (!is_sealed(in, n, FB_ACK_BYTES))
        return false;
    s.epoch = fb_take32(&p);
    s.transfer = fb_take32(&p);
    s.received = fb_take64(&p);
    s.may_send_to = fb_take64(&p);
    s.state = (FbState)fb_take16(&p);
    s.chunk_answer = (FbAnswer)fb_take16(&p);
    if (!status_is_possible(&s))
        return false;
    *status = s;
    return true;
}

/* ---------------------------------------------------------------- tools and offsets */

#define UNITS_A_MM 10000.0 /* of 0.1 µm */

static uint8_t *put_length(uint8_t *p, double mm)
{
    return put_fixed(p, mm, UNITS_A_MM, INT32_MIN, INT32_MAX);
}

size_t fb_wire_put_offsets(uint8_t *out, const FbSetup *setup)
{
    uint8_t *p = fb_put16(fb_put16(out, setup->serial), setup->work_offset);
    for (int i = 0; i < 6; i++)
        for (int axis = 0; axis < 3; axis++)
            p = put_length(p, setup->work_offset_mm[i][axis]);
    return seal(out, FB_OFFSETS_BYTES);
}

bool fb_wire_get_offsets(const uint8_t *in, size_t n, FbSetup *setup)
{
    const uint8_t *p = in;
    if (!is_sealed(in, n, FB_OFFSETS_BYTES))
        return false;
    setup->serial = fb_take16(&p);
    setup->work_offset = fb_take16(&p);
    for (int i = 0; i < 6; i++)
        for (int axis = 0; axis < 3; axis++)
            setup->work_offset_mm[i][axis] = get_fixed(&p, UNITS_A_MM);
    return true;
}

size_t fb_wire_put_tools(uint8_t *out, const FbSetup *setup, unsigned page)
{
    uint8_t *p = fb_put16(fb_put16(out, setup->serial), setup->n_tools);
    memset(p, 0, (size_t)(out + FB_TOOLS_BYTES - p));
    for (unsigned i = page * FB_TOOLS_A_PAGE; i < MIN(setup->n_tools, (page + 1) * FB_TOOLS_A_PAGE);
         i++) {
        const FbTool *t = &setup->tools[i];
        p = fb_put16(fb_put16(fb_put32(p, (uint32_t)t->number), (uint16_t)t->kind), 0);
        p = put_length(put_length(put_length(p, t->diameter_mm), t->corner_radius_mm),
                       t->length_mm);
    }
    return seal(out, FB_TOOLS_BYTES);
}

bool fb_wire_get_tools(const uint8_t *in, size_t n, unsigned page, FbSetup *setup)
{
    const uint8_t *p = in;
    if (!is_sealed(in, n, FB_TOOLS_BYTES))
        return false;
    setup->serial = fb_take16(&p);
    setup->n_tools = fb_take16(&p);
    if (setup->n_tools > FB_TOOLS_MOST)
        return false;
    for (unsigned i = page * FB_TOOLS_A_PAGE; i < MIN(setup->n_tools, (page + 1) * FB_TOOLS_A_PAGE);
         i++) {
        FbTool *t = &setup->tools[i];
        t->number = (int32_t)fb_take32(&p);
        const uint16_t kind = fb_take16(&p);
        if (kind >= CFG_N_TOOL_KINDS)
            return false;
        t->kind = (CfgToolKind)kind;
        p += 2;
        t->diameter_mm = get_fixed(&p, UNITS_A_MM);
        t->corner_radius_mm = get_fixed(&p, UNITS_A_MM);
        t->length_mm = get_fixed(&p, UNITS_A_MM);
    }
    return true;
}

/* ---------------------------------------------------------------- command, chunk, beat */

static size_t argument_bytes(FbCommand command)
{
    switch (command) {
    case FB_COMMAND_OPEN:
        return FB_OPEN_BYTES;
    case FB_COMMAND_RESTART:
        return FB_RESTART_BYTES;
    case FB_COMMAND_OVERRIDE:
        return FB_OVERRIDE_BYTES;
    case FB_COMMAND_OPTIONAL_STOP:
        return FB_OPTIONAL_STOP_BYTES;
    default:
        return 0;
    }
}

static void put_arguments(uint8_t *p, const FbOrder *o)
{
    const FbArguments *a = &o->arguments;
    switch (o->command) {
    case FB_COMMAND_OPEN:
        p = put_bytes(p, o->open.id, sizeof o->open.id);
        p = fb_put32(fb_put32(fb_put64(p, o->open.program_bytes), o->open.gates),
                     o->open.gates_crc);
        fb_put16(fb_put16(p, o->open.flags), o->open.window);
        break;
    case FB_COMMAND_RESTART:
        fb_put64(fb_put32(p, o->gate), o->gate_offset);
        break;
    case FB_COMMAND_OVERRIDE:
        fb_put16(fb_put16(fb_put16(p, a->feed_percent), a->rapid_percent), a->spindle_percent);
        break;
    case FB_COMMAND_OPTIONAL_STOP:
        fb_put16(p, a->optional_stop);
        break;
    default:
        break;
    }
}

static void get_arguments(const uint8_t *p, FbOrder *o)
{
    FbArguments *a = &o->arguments;
    switch (o->command) {
    case FB_COMMAND_OPEN:
        get_bytes(&p, o->open.id, sizeof o->open.id);
        o->open.program_bytes = fb_take64(&p);
        o->open.gates = fb_take32(&p);
        o->open.gates_crc = fb_take32(&p);
        o->open.flags = fb_take16(&p);
        o->open.window = fb_take16(&p);
        break;
    case FB_COMMAND_RESTART:
        o->gate = fb_take32(&p);
        o->gate_offset = fb_take64(&p);
        break;
    case FB_COMMAND_OVERRIDE:
        a->feed_percent = fb_take16(&p);
        a->rapid_percent = fb_take16(&p);
        a->spindle_percent = fb_take16(&p);
        break;
    case FB_COMMAND_OPTIONAL_STOP:
        a->optional_stop = fb_take16(&p) != 0;
        break;
    default:
        break;
    }
}

size_t fb_wire_put_order(uint8_t *out, const FbOrder *o)
{
    const size_t arguments = argument_bytes(o->command);
    uint8_t *p = fb_put32(fb_put32(out, o->session), o->seq);
    p = fb_put64(fb_put32(fb_put32(p, o->epoch), o->transfer), o->token);
    p = fb_put16(fb_put16(p, (uint16_t)o->command), (uint16_t)arguments);
    put_arguments(p + 4, o);
    fb_put32(p, crc_around(out, FB_COMMAND_BYTES - 4, arguments));
    return FB_COMMAND_BYTES + arguments;
}

FbAnswer fb_wire_get_order(const uint8_t *in, size_t n, FbOrder *o)
{
    *o = (FbOrder){0};
    if (n < FB_COMMAND_BYTES)
        return FB_ANSWER_MALFORMED;
    const uint8_t *p = in + FB_COMMAND_BYTES - 6;
    const size_t arguments = fb_take16(&p);
    const uint32_t crc = fb_take32(&p);
    if (n != FB_COMMAND_BYTES + arguments)
        return FB_ANSWER_MALFORMED;
    if (crc != crc_around(in, FB_COMMAND_BYTES - 4, arguments))
        return FB_ANSWER_CRC;
    p = in;
    o->session = fb_take32(&p);
    o->seq = fb_take32(&p);
    o->epoch = fb_take32(&p);
    o->transfer = fb_take32(&p);
    o->token = fb_take64(&p);
    o->command = (FbCommand)fb_take16(&p);
    o->crc = crc;
    const uint8_t *on = in + FB_COMMAND_BYTES;
    if (o->command == FB_COMMAND_NONE || o->command >= FB_N_COMMANDS || o->session == 0 ||
        o->seq == 0 || arguments != argument_bytes(o->command) ||
        (o->command == FB_COMMAND_OPTIONAL_STOP && fb_take16(&on) > 1))
        return FB_ANSWER_MALFORMED;
    get_arguments(in + FB_COMMAND_BYTES, o);
    return FB_ANSWER_DONE;
}

size_t fb_wire_put_chunk(uint8_t *out, const FbChunk *c)
{
    uint8_t *p = fb_put64(fb_put32(fb_put32(out, c->epoch), c->transfer), c->offset);
    p = fb_put16(fb_put16(p, c->length), 0);
    uint8_t *end = put_bytes(p + 4, c->bytes, c->length);
    fb_put32(p, crc_around(out, FB_CHUNK_HEADER_BYTES - 4, c->length));
    if (c->length % 2)
        *end++ = 0;
    return (size_t)(end - out);
}

FbAnswer fb_wire_get_chunk(const uint8_t *in, size_t n, FbChunk *c)
{
    if (n <= FB_CHUNK_HEADER_BYTES)
        return FB_ANSWER_MALFORMED;
    const uint8_t *p = in;
    c->epoch = fb_take32(&p);
    c->transfer = fb_take32(&p);
    c->offset = fb_take64(&p);
    c->length = fb_take16(&p);
    p += 2;
    const uint32_t crc = fb_take32(&p);
    c->bytes = p;
    if (c->length == 0 || c->length > FB_CHUNK_BYTES ||
        n != FB_CHUNK_HEADER_BYTES + (size_t)c->length + c->length % 2)
        return FB_ANSWER_MALFORMED;
    return crc == crc_around(in, FB_CHUNK_HEADER_BYTES - 4, c->length) ? FB_ANSWER_DONE
                                                                       : FB_ANSWER_CRC;
}

size_t fb_wire_put_beat(uint8_t *out, const FbBeat *b)
{
    fb_put32(fb_put64(fb_put32(out, b->session), b->token), b->count);
    return seal(out, FB_BEAT_BYTES);
}

FbAnswer fb_wire_get_beat(const uint8_t *in, size_t n, FbBeat *b)
{
    if (n != FB_BEAT_BYTES)
        return FB_ANSWER_MALFORMED;
    const uint8_t *p = in;
    b->session = fb_take32(&p);
    b->token = fb_take64(&p);
    b->count = fb_take32(&p);
    return is_sealed(in, n, FB_BEAT_BYTES) ? FB_ANSWER_DONE : FB_ANSWER_CRC;
}

/* -------------------------------------------------------------------------- gates */

void fb_wire_put_gate(uint8_t *out, uint64_t offset, const uint8_t *hash)
{
    uint8_t *p = fb_put64(out, offset);
    if (hash)
        put_bytes(p, hash, FB_DRIP_GATE_BYTES - FB_GATE_BYTES);
}

uint64_t fb_wire_get_gate(const uint8_t *entry)
{
    return fb_take64(&entry);
}
