/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/wire.h"

#include <math.h>
#include <string.h>
#include <zlib.h>

static uint8_t *put16(uint8_t *p, uint16_t v)
{
    p[0] = (uint8_t)(v >> 8);
    p[1] = (uint8_t)v;
    return p + 2;
}

static uint8_t *put32(uint8_t *p, uint32_t v)
{
    return put16(put16(p, (uint16_t)(v >> 16)), (uint16_t)v);
}

static uint8_t *put64(uint8_t *p, uint64_t v)
{
    return put32(put32(p, (uint32_t)(v >> 32)), (uint32_t)v);
}

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
    return put32(p, (uint32_t)(int64_t)w);
}

void fb_wire_text(char *to, const char *text)
{
    const char *end;
    const char *from = text ? text : "";
    g_utf8_validate_len(from, strnlen(from, FB_TEXT_BYTES - 1), &end);
    memset(to, 0, FB_TEXT_BYTES);
    memcpy(to, from, (size_t)(end - from));
}

static uint8_t *put_text(uint8_t *p, const char *text)
{
    fb_wire_text((char *)p, text);
    return p + FB_TEXT_BYTES;
}

static uint16_t get16(const uint8_t **p)
{
    const uint16_t v = (uint16_t)((*p)[0] << 8 | (*p)[1]);
    *p += 2;
    return v;
}

static uint32_t get32(const uint8_t **p)
{
    const uint32_t high = get16(p);
    return high << 16 | get16(p);
}

static uint64_t get64(const uint8_t **p)
{
    const uint64_t high = get32(p);
    return high << 32 | get32(p);
}

static void get_bytes(const uint8_t **p, void *bytes, size_t n)
{
    memcpy(bytes, *p, n);
    *p += n;
}

static double get_fixed(const uint8_t **p, double scale)
{
    return (int32_t)get32(p) / scale;
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

/* --------------------------------------------------------------------- status, alarm */

enum { FLAG_NEEDS_ACKNOWLEDGE = 1, FLAG_AGENT_LOST = 2 };

size_t fb_wire_put_status(uint8_t *out, const FbStatus *s)
{
    uint8_t *p = put16(put16(out, s->protocol_version), (uint16_t)s->state);
    p = put32(put32(p, s->epoch), s->transfer);
    p = put64(put64(put64(p, s->length), s->received), s->may_send_to);
    p = put32(put32(p, s->gates), s->gates_crc);
    p = put_bytes(put_bytes(p, s->id, sizeof s->id), s->sha256, sizeof s->sha256);
    p = put32(put32(p, s->command_session), s->command_seq);
    p = put16(put16(p, (uint16_t)s->command), (uint16_t)s->answer);
    p = put16(p, (uint16_t)s->chunk_answer);
    p = put16(p, (uint16_t)((s->needs_acknowledge ? FLAG_NEEDS_ACKNOWLEDGE : 0) |
                            (s->agent_lost ? FLAG_AGENT_LOST : 0)));
    p = put32(put32(p, s->lease_owner), s->lease_ms);
    p = put32(put32(p, s->heartbeat), s->run);
    p = put16(put16(put16(p, (uint16_t)s->run_end), s->alarm_code), s->alarm_serial);
    p = put16(put16(p, s->window_max), s->chunk_max);
    p = put16(p, s->feed_override_percent);
    p = put16(put16(p, s->rapid_override_percent), s->spindle_override_percent);
    p = put32(p, s->line);
    p = put64(p, s->executed_blocks);
    p = put32(put32(p, s->program_time_ms), (uint32_t)s->tool);
    for (int i = 0; i < 3; i++)
        p = put_fixed(p, s->position_mm[i], 1000, INT32_MIN, INT32_MAX);
    p = put_fixed(p, s->feed_mm_min, 1000, 0, UINT32_MAX);
    p = put_fixed(p, s->spindle_rpm, 1000, INT32_MIN, INT32_MAX);
    memset(p, 0, (size_t)(out + FB_STATUS_BYTES - p));
    put32(out + FB_STATUS_BYTES - 4, fb_wire_crc(out, FB_STATUS_BYTES - 4));
    return FB_STATUS_BYTES;
}

static bool status_is_possible(const FbStatus *s)
{
    return s->protocol_version >> 8 == FB_PROTOCOL_VERSION >> 8 && s->state < FB_STATE_UNKNOWN &&
           s->command < 32 && s->answer < 32 && s->chunk_answer < 32 && s->run_end < 4 &&
           s->epoch != 0 && s->received <= s->length && s->chunk_max >= 1 &&
           s->chunk_max <= FB_CHUNK_BYTES;
}

bool fb_wire_get_status(const uint8_t *in, size_t n, FbStatus *s)
{
    const uint8_t *p = in + FB_STATUS_BYTES - 4;
    if (n != FB_STATUS_BYTES || get32(&p) != fb_wire_crc(in, FB_STATUS_BYTES - 4))
        return false;
    p = in;
    s->protocol_version = get16(&p);
    s->state = (FbState)get16(&p);
    s->epoch = get32(&p);
    s->transfer = get32(&p);
    s->length = get64(&p);
    s->received = get64(&p);
    s->may_send_to = get64(&p);
    s->gates = get32(&p);
    s->gates_crc = get32(&p);
    get_bytes(&p, s->id, sizeof s->id);
    get_bytes(&p, s->sha256, sizeof s->sha256);
    s->command_session = get32(&p);
    s->command_seq = get32(&p);
    s->command = (FbCommand)get16(&p);
    s->answer = (FbAnswer)get16(&p);
    s->chunk_answer = (FbAnswer)get16(&p);
    const uint16_t flags = get16(&p);
    s->needs_acknowledge = flags & FLAG_NEEDS_ACKNOWLEDGE;
    s->agent_lost = flags & FLAG_AGENT_LOST;
    s->lease_owner = get32(&p);
    s->lease_ms = get32(&p);
    s->heartbeat = get32(&p);
    s->run = get32(&p);
    s->run_end = (FbRunEnd)get16(&p);
    s->alarm_code = get16(&p);
    s->alarm_serial = get16(&p);
    s->window_max = get16(&p);
    s->chunk_max = get16(&p);
    s->feed_override_percent = get16(&p);
    s->rapid_override_percent = get16(&p);
    s->spindle_override_percent = get16(&p);
    s->line = get32(&p);
    s->executed_blocks = get64(&p);
    s->program_time_ms = get32(&p);
    s->tool = (int32_t)get32(&p);
    for (int i = 0; i < 3; i++)
        s->position_mm[i] = get_fixed(&p, 1000);
    s->feed_mm_min = get32(&p) / 1000.0;
    s->spindle_rpm = get_fixed(&p, 1000);
    return status_is_possible(s);
}

size_t fb_wire_put_alarm(uint8_t *out, const FbStatus *s)
{
    uint8_t *p = put16(put16(out, s->alarm_serial), s->alarm_code);
    p = put_text(put_text(p, s->alarm_text), s->alarm_advice);
    put32(p, fb_wire_crc(out, FB_ALARM_BYTES - 4));
    return FB_ALARM_BYTES;
}

bool fb_wire_get_alarm(const uint8_t *in, size_t n, FbStatus *s)
{
    const uint8_t *p = in + FB_ALARM_BYTES - 4;
    if (n != FB_ALARM_BYTES || get32(&p) != fb_wire_crc(in, FB_ALARM_BYTES - 4))
        return false;
    p = in;
    if (get16(&p) != s->alarm_serial || get16(&p) != s->alarm_code)
        return false;
    get_text(&p, s->alarm_text);
    get_text(&p, s->alarm_advice);
    return true;
}

/* ---------------------------------------------------------------- command, chunk, beat */

size_t fb_wire_put_order(uint8_t *out, const FbOrder *o)
{
    const bool open = o->command == FB_COMMAND_OPEN;
    const uint16_t arguments = open ? FB_OPEN_BYTES : 0;
    uint8_t *p = put32(put32(out, o->session), o->seq);
    p = put64(put32(put32(p, o->epoch), o->transfer), o->token);
    p = put16(put16(p, (uint16_t)o->command), arguments);
    if (open) {
        uint8_t *q = put_bytes(p + 4, o->open.id, sizeof o->open.id);
        q = put32(put32(put64(q, o->open.program_bytes), o->open.gates), o->open.gates_crc);
        put16(put16(q, o->open.flags), o->open.window);
    }
    put32(p, crc_around(out, FB_COMMAND_BYTES - 4, arguments));
    return FB_COMMAND_BYTES + (size_t)arguments;
}

FbAnswer fb_wire_get_order(const uint8_t *in, size_t n, FbOrder *o)
{
    *o = (FbOrder){0};
    if (n < FB_COMMAND_BYTES)
        return FB_ANSWER_MALFORMED;
    const uint8_t *p = in + FB_COMMAND_BYTES - 6;
    const size_t arguments = get16(&p);
    const uint32_t crc = get32(&p);
    if (n != FB_COMMAND_BYTES + arguments)
        return FB_ANSWER_MALFORMED;
    if (crc != crc_around(in, FB_COMMAND_BYTES - 4, arguments))
        return FB_ANSWER_CRC;
    p = in;
    o->session = get32(&p);
    o->seq = get32(&p);
    o->epoch = get32(&p);
    o->transfer = get32(&p);
    o->token = get64(&p);
    o->command = (FbCommand)get16(&p);
    o->crc = crc;
    p = in + FB_COMMAND_BYTES;
    const size_t expected = o->command == FB_COMMAND_OPEN ? FB_OPEN_BYTES : 0;
    if (arguments != expected || o->command == FB_COMMAND_NONE || o->command >= FB_N_COMMANDS ||
        o->session == 0 || o->seq == 0)
        return FB_ANSWER_MALFORMED;
    if (o->command == FB_COMMAND_OPEN) {
        get_bytes(&p, o->open.id, sizeof o->open.id);
        o->open.program_bytes = get64(&p);
        o->open.gates = get32(&p);
        o->open.gates_crc = get32(&p);
        o->open.flags = get16(&p);
        o->open.window = get16(&p);
    }
    return FB_ANSWER_DONE;
}

size_t fb_wire_put_chunk(uint8_t *out, const FbChunk *c)
{
    uint8_t *p = put64(put32(put32(out, c->epoch), c->transfer), c->offset);
    p = put16(put16(p, c->length), 0);
    uint8_t *end = put_bytes(p + 4, c->bytes, c->length);
    put32(p, crc_around(out, FB_CHUNK_HEADER_BYTES - 4, c->length));
    if (c->length % 2)
        *end++ = 0;
    return (size_t)(end - out);
}

FbAnswer fb_wire_get_chunk(const uint8_t *in, size_t n, FbChunk *c)
{
    if (n <= FB_CHUNK_HEADER_BYTES)
        return FB_ANSWER_MALFORMED;
    const uint8_t *p = in;
    c->epoch = get32(&p);
    c->transfer = get32(&p);
    c->offset = get64(&p);
    c->length = get16(&p);
    p += 2;
    const uint32_t crc = get32(&p);
    c->bytes = p;
    if (c->length == 0 || c->length > FB_CHUNK_BYTES ||
        n != FB_CHUNK_HEADER_BYTES + (size_t)c->length + c->length % 2)
        return FB_ANSWER_MALFORMED;
    return crc == crc_around(in, FB_CHUNK_HEADER_BYTES - 4, c->length) ? FB_ANSWER_DONE
                                                                       : FB_ANSWER_CRC;
}

size_t fb_wire_put_beat(uint8_t *out, const FbBeat *b)
{
    uint8_t *p = put32(put64(put32(out, b->session), b->token), b->count);
    put32(p, fb_wire_crc(out, FB_BEAT_BYTES - 4));
    return FB_BEAT_BYTES;
}

FbAnswer fb_wire_get_beat(const uint8_t *in, size_t n, FbBeat *b)
{
    if (n != FB_BEAT_BYTES)
        return FB_ANSWER_MALFORMED;
    const uint8_t *p = in;
    b->session = get32(&p);
    b->token = get64(&p);
    b->count = get32(&p);
    return get32(&p) == fb_wire_crc(in, FB_BEAT_BYTES - 4) ? FB_ANSWER_DONE : FB_ANSWER_CRC;
}

/* -------------------------------------------------------------------------- gates */

void fb_wire_put_gates(uint8_t *out, const uint64_t *gates, size_t n)
{
    for (size_t i = 0; i < n; i++)
        out = put64(out, gates[i]);
}

void fb_wire_get_gates(const uint8_t *in, uint64_t *gates, size_t n)
{
    for (size_t i = 0; i < n; i++)
        gates[i] = get64(&in);
}
