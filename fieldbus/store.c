/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/store.h"

#include <string.h>

/* GByteArray counts in 32 bits and doubles as it grows. */
static const uint64_t LARGEST_STREAM = UINT64_C(1) << 30;

static size_t table_bytes(const FbStore *s)
{
    return (size_t)s->open.gates * FB_GATE_BYTES;
}

static const uint8_t *bytes(const FbStore *s)
{
    return s->stream ? g_bytes_get_data(s->stream, NULL) : s->growing->data;
}

FbAnswer fb_store_open(FbStore *s, const FbOpen *open, uint32_t transfer, uint64_t memory_bytes)
{
    if (open->program_bytes == 0 || open->gates == 0 || open->gates > open->program_bytes ||
        open->flags != 0)
        return FB_ANSWER_MALFORMED;
    const uint64_t most = MIN(memory_bytes, LARGEST_STREAM);
    if (open->program_bytes > most || open->gates > most / FB_GATE_BYTES ||
        open->program_bytes + open->gates * (uint64_t)FB_GATE_BYTES > most)
        return FB_ANSWER_TOO_LARGE;
    *s = (FbStore){
        .transfer = transfer,
        .open = *open,
        .length = open->program_bytes + open->gates * (uint64_t)FB_GATE_BYTES,
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
    *s = (FbStore){0};
}

uint64_t fb_store_received(const FbStore *s)
{
    return s->growing ? s->growing->len : s->length;
}

FbAnswer fb_store_chunk(FbStore *s, const FbChunk *c)
{
    const uint64_t received = fb_store_received(s);
    if (c->offset > s->length || c->length > s->length - c->offset)
        return FB_ANSWER_MALFORMED;
    if (c->offset + c->length <= received)
        return memcmp(bytes(s) + c->offset, c->bytes, c->length) == 0 ? FB_ANSWER_DONE
                                                                      : FB_ANSWER_CONFLICT;
    if (c->offset != received)
        return FB_ANSWER_GAP;
    g_byte_array_append(s->growing, c->bytes, c->length);
    const uint64_t table = table_bytes(s);
    const uint64_t skip = received < table ? MIN(table - received, c->length) : 0;
    g_checksum_update(s->hash, c->bytes + skip, (gssize)(c->length - skip));
    return FB_ANSWER_DONE;
}

static const char *gates_fault(const FbStore *s, const uint64_t *gates)
{
    const uint8_t *program = bytes(s) + table_bytes(s);
    const size_t n = s->open.gates;
    if (fb_wire_crc(bytes(s), table_bytes(s)) != s->open.gates_crc)
        return "the table of gates is not the one announced";
    if (gates[n - 1] != s->open.program_bytes)
        return "the last gate is not the end of the program";
    for (size_t i = 0; i < n; i++) {
        if (gates[i] == 0 || gates[i] > s->open.program_bytes ||
            (i > 0 && gates[i] <= gates[i - 1]))
            return "the gates do not ascend";
        if (i + 1 < n && program[gates[i] - 1] != '\n')
            return "a gate is not at the end of a line";
    }
    return NULL;
}

FbAnswer fb_store_verify(FbStore *s, const char **why)
{
    if (fb_store_received(s) < s->length)
        return FB_ANSWER_INCOMPLETE;
    if (s->program)
        return FB_ANSWER_DONE;
    if (!s->hashed) {
        gsize n = sizeof s->sha256;
        g_checksum_get_digest(s->hash, s->sha256, &n);
        s->hashed = true;
    }
    g_autofree uint64_t *gates = g_new(uint64_t, s->open.gates);
    fb_wire_get_gates(bytes(s), gates, s->open.gates);
    *why = gates_fault(s, gates);
    if (*why)
        return FB_ANSWER_PROGRAM;
    if (memcmp(s->sha256, s->open.id, sizeof s->sha256) != 0)
        return FB_ANSWER_HASH;
    s->gates = g_steal_pointer(&gates);
    s->stream = g_byte_array_free_to_bytes(g_steal_pointer(&s->growing));
    s->program = g_bytes_new_from_bytes(s->stream, table_bytes(s), (gsize)s->open.program_bytes);
    return FB_ANSWER_DONE;
}
