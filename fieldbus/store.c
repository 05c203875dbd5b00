/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/store.h"

#include <string.h>

static FbAnswer read_table(FbStore *s, const char **why);
static FbAnswer take_dripped(FbStore *s, const uint8_t *bytes, size_t n);

static const uint8_t *bytes_at(const FbStore *s, uint64_t offset)
{
    const uint8_t *bytes = s->stream ? g_bytes_get_data(s->stream, NULL) : s->growing->data;
    return bytes + (offset < s->table_bytes ? offset : offset - s->dropped);
}

FbAnswer fb_store_open(FbStore *s, const FbOpen *open, uint32_t transfer, uint64_t memory_bytes)
{
    if (open->program_bytes == 0 || open->gates == 0 || open->gates > open->program_bytes ||
        open->program_bytes > INT64_MAX || open->flags & ~FB_OPEN_DRIP)
        return FB_ANSWER_MALFORMED;
    const bool drip = open->flags & FB_OPEN_DRIP;
    const uint64_t most = MIN(memory_bytes, FB_STREAM_MOST);
    const uint64_t table_bytes = open->gates * (uint64_t)fb_wire_gate_bytes(open->flags);
    if (table_bytes >= most || (!drip && open->program_bytes > most - table_bytes))
        return FB_ANSWER_TOO_LARGE;
    *s = (FbStore){
        .transfer = transfer,
        .open = *open,
        .drip = drip,
        .memory_bytes = most,
        .table_bytes = table_bytes,
        .length = open->program_bytes + table_bytes,
        .growing = g_byte_array_new(),
        .hash = g_checksum_new(G_CHECKSUM_SHA256),
    };
    return FB_ANSWER_DONE;
}

void fb_store_clear(FbStore *s)
{
    if (s->growing)
        g_byte_array_unref(s->growing);
    g_bytes_unref(s->stream);
    g_bytes_unref(s->program);
    if (s->hash)
        g_checksum_free(s->hash);
    g_free(s->gates);
    g_free(s->running);
    *s = (FbStore){0};
}

uint64_t fb_store_received(const FbStore *s)
{
    return s->growing ? s->growing->len + s->dropped : s->length;
}

uint64_t fb_store_may_send_to(const FbStore *s)
{
    return s->drip ? MIN(s->length, s->memory_bytes + s->forgotten) : s->length;
}

uint64_t fb_store_released(const FbStore *s)
{
    if (!s->drip)
        return s->program ? s->length : 0;
    return s->n_released > 0 ? s->table_bytes + s->gates[s->n_released - 1] : 0;
}

FbAnswer fb_store_chunk(FbStore *s, const FbChunk *c)
{
    const uint64_t received = fb_store_received(s);
    if (c->offset > s->length || c->length > s->length - c->offset)
        return FB_ANSWER_MALFORMED;
    if (c->offset + c->length > fb_store_may_send_to(s))
        return FB_ANSWER_TOO_LARGE;
    if (c->offset + c->length <= received) {
        /* What was executed cannot be compared any more; it does no harm. */
        if (s->forgotten > 0 && c->offset < s->table_bytes + s->forgotten)
            return FB_ANSWER_DONE;
        return memcmp(bytes_at(s, c->offset), c->bytes, c->length) == 0 ? FB_ANSWER_DONE
                                                                        : FB_ANSWER_CONFLICT;
    }
    if (c->offset != received)
        return FB_ANSWER_GAP;
    const uint64_t table =
        received < s->table_bytes ? MIN(s->table_bytes - received, c->length) : 0;
    g_byte_array_append(s->growing, c->bytes, (guint)table);
    if (s->drip)
        return take_dripped(s, c->bytes + table, c->length - table);
    g_byte_array_append(s->growing, c->bytes + table, (guint)(c->length - table));
    g_checksum_update(s->hash, c->bytes + table, (gssize)(c->length - table));
    return FB_ANSWER_DONE;
}

static const char *gates_fault(const FbStore *s)
{
    const size_t n = s->open.gates;
    if (fb_wire_crc(bytes_at(s, 0), s->table_bytes) != s->open.gates_crc)
        return "the table of gates is not the one announced";
    if (s->gates[n - 1] != s->open.program_bytes)
        return "the last gate is not the end of the program";
    for (size_t i = 0; i < n; i++)
        if (s->gates[i] == 0 || s->gates[i] > s->open.program_bytes ||
            (i > 0 && s->gates[i] <= s->gates[i - 1]))
            return "the gates do not ascend";
    if (s->drip && memcmp(s->running + 32 * (n - 1), s->open.id, 32) != 0)
        return "the last running hash is not the program's id";
    return NULL;
}

/* The table of gates is whole: DONE or PROGRAM; drip: TOO_LARGE. */
static FbAnswer read_table(FbStore *s, const char **why)
{
    const size_t n = s->open.gates, entry = fb_wire_gate_bytes(s->open.flags);
    s->gates = g_new(uint64_t, n);
    if (s->drip)
        s->running = g_malloc(32 * n);
    for (size_t i = 0; i < n; i++) {
        const uint8_t *at = bytes_at(s, i * entry);
        s->gates[i] = fb_wire_get_gate(at);
        if (s->drip)
            memcpy(s->running + 32 * i, at + FB_GATE_BYTES, 32);
    }
    FbAnswer answer = FB_ANSWER_DONE;
    *why = gates_fault(s);
    if (*why)
        answer = FB_ANSWER_PROGRAM;
    else if (s->drip && fb_dripped_bytes(s->gates, n) > s->memory_bytes)
        answer = FB_ANSWER_TOO_LARGE;
    if (answer != FB_ANSWER_DONE) {
        g_clear_pointer(&s->gates, g_free);
        g_clear_pointer(&s->running, g_free);
    }
    return answer;
}

FbAnswer fb_store_verify(FbStore *s, const char **why)
{
    *why = NULL;
    if (fb_store_received(s) < s->table_bytes || (!s->drip && fb_store_received(s) < s->length))
        return FB_ANSWER_INCOMPLETE;
    if (s->program || s->n_released > 0)
        return FB_ANSWER_DONE;
    const FbAnswer table = s->gates ? FB_ANSWER_DONE : read_table(s, why);
    if (table != FB_ANSWER_DONE)
        return table;
    for (size_t i = 0; i < s->open.gates && s->gates[i] < s->open.program_bytes; i++)
        if (!s->drip && *bytes_at(s, s->table_bytes + s->gates[i] - 1) != '\n') {
            *why = "a gate is not at the end of a line";
            return FB_ANSWER_PROGRAM;
        }
    if (s->drip)
        return FB_ANSWER_INCOMPLETE;
    if (!s->hashed) {
        gsize n = sizeof s->sha256;
        g_checksum_get_digest(s->hash, s->sha256, &n);
        s->hashed = true;
    }
    if (memcmp(s->sha256, s->open.id, sizeof s->sha256) != 0)
        return FB_ANSWER_HASH;
    s->stream = g_byte_array_free_to_bytes(g_steal_pointer(&s->growing));
    s->program = g_bytes_new_from_bytes(s->stream, s->table_bytes, (gsize)s->open.program_bytes);
    return FB_ANSWER_DONE;
}

/* ------------------------------------------------------------------------- drip feed */

static bool pass_holds(const FbStore *s, GChecksum *hash)
{
    uint8_t digest[32];
    gsize n = sizeof digest;
    g_autoptr(GChecksum) copy = g_checksum_copy(hash);
    g_checksum_get_digest(copy, digest, &n);
    return memcmp(digest, s->running + 32 * s->n_released, n) == 0;
}

/* Takes bytes up to the next gate at most; a pass that they complete is released, or they are not
 * taken. */
static FbAnswer take_up_to_gate(FbStore *s, const uint8_t *bytes, size_t n, bool completes)
{
    const bool last = s->n_released + 1 == s->open.gates;
    g_autoptr(GChecksum) hash = g_checksum_copy(s->hash);
    g_checksum_update(hash, bytes, (gssize)n);
    if (completes && !last && bytes[n - 1] != '\n')
        return FB_ANSWER_PROGRAM;
    if (completes && !pass_holds(s, hash))
        return FB_ANSWER_HASH;
    g_byte_array_append(s->growing, bytes, (guint)n);
    g_checksum_free(s->hash);
    s->hash = g_steal_pointer(&hash);
    s->n_released += completes;
    if (completes && last) {
        memcpy(s->sha256, s->open.id, sizeof s->sha256); /* its running hash has just held */
        s->hashed = true;
    }
    return FB_ANSWER_DONE;
}

/* The part of a chunk that lies behind the table. */
static FbAnswer take_dripped(FbStore *s, const uint8_t *bytes, size_t n)
{
    const char *why;
    if (fb_store_received(s) < s->table_bytes)
        return FB_ANSWER_DONE;
    FbAnswer answer = s->gates ? FB_ANSWER_DONE : read_table(s, &why);
    while (n > 0 && answer == FB_ANSWER_DONE) {
        const uint64_t at = fb_store_received(s) - s->table_bytes;
        const uint64_t left = s->gates[s->n_released] - at;
        const size_t take = MIN(n, left);
        answer = take_up_to_gate(s, bytes, take, take == left);
        bytes += take;
        n -= take;
    }
    return answer;
}

GBytes *fb_store_pass(const FbStore *s, size_t pass)
{
    if (!s->drip || pass >= s->n_released)
        return NULL;
    const uint64_t from = pass > 0 ? s->gates[pass - 1] : 0;
    if (from < s->forgotten)
        return NULL;
    return g_bytes_new(bytes_at(s, s->table_bytes + from), (gsize)(s->gates[pass] - from));
}

void fb_store_forget(FbStore *s, size_t n)
{
    if (!s->drip || n == 0 || n > s->n_released || s->gates[n - 1] <= s->forgotten)
        return;
    s->forgotten = s->gates[n - 1];
    /* Dropping moves what is left: seldom enough that each byte is moved a few times at most. */
    const uint64_t idle = s->forgotten - s->dropped;
    if (idle < (s->growing->len - s->table_bytes) / 2)
        return;
    g_byte_array_remove_range(s->growing, (guint)s->table_bytes, (guint)idle);
    s->dropped = s->forgotten;
}
