/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The blocks of docs/protocol.md, section 2, as bytes: the only place that knows them. Modbus
 * carries a block as big-endian registers, so bytes and registers are the same thing here.
 *
 * Encoders write exactly the bytes that they return; buffers are at least FB_BLOCK_BYTES. Decoders
 * trust nothing: any bytes, any length.
 */
#ifndef FIELDBUS_WIRE_H
#define FIELDBUS_WIRE_H

#include "fieldbus/fieldbus.h"

enum {
    FB_PROTOCOL_VERSION = 0x0101,

    FB_AT_STATUS = 0, /* first registers */
    FB_AT_ALARM = 128,
    FB_AT_OFFSETS = 256,
    FB_AT_TOOLS = 384, /* page 0; the others follow */
    FB_AT_COMMAND = 1024,
    FB_AT_CHUNK = 1152,
    FB_AT_BEAT = 1280,
    FB_N_REGISTERS = 2048,

    FB_STATUS_BYTES = 248,
    FB_ALARM_BYTES = 200,
    FB_OFFSETS_BYTES = 80,
    FB_TOOLS_BYTES = 248, /* a page */
    FB_TOOLS_PAGE_REGISTERS = 128,
    FB_TOOLS_A_PAGE = 12,
    FB_TOOLS_PAGES = FB_TOOLS_MOST / FB_TOOLS_A_PAGE,
    FB_ACK_BYTES = 32,
    FB_COMMAND_BYTES = 32, /* without arguments */
    FB_OPEN_BYTES = 52,    /* arguments of OPEN, */
    FB_RESTART_BYTES = 12, /* RESTART, */
    FB_OVERRIDE_BYTES = 6, /* OVERRIDE, */
    FB_OPTIONAL_STOP_BYTES = 2,
    FB_CHUNK_HEADER_BYTES = 24,
    FB_BEAT_BYTES = 20,
    FB_CHUNK_BYTES = 4050,       /* most bytes of the stream in one chunk, on any carrier */
    FB_MODBUS_CHUNK_BYTES = 218, /* on Modbus: what a FC23 can write less the header */
    FB_BLOCK_BYTES = FB_CHUNK_HEADER_BYTES + FB_CHUNK_BYTES, /* largest block */

    FB_WINDOW_MOST = 16, /* requests in flight on a connection */

    FB_OPEN_DRIP = 1, /* flags of OPEN */
};

typedef struct {
    uint8_t id[32];
    uint64_t program_bytes;
    uint32_t gates, gates_crc;
    uint16_t flags, window;
} FbOpen;

typedef struct {
    uint32_t session, seq, epoch, transfer;
    uint64_t token;
    FbCommand command;
    FbOpen open;   /* of OPEN only */
    uint32_t gate; /* of RESTART only, */
    uint64_t gate_offset;
    FbArguments arguments; /* of OVERRIDE and OPTIONAL_STOP only */
    uint32_t crc;          /* as decoded; says whether two commands are the same, byte for byte */
} FbOrder;

typedef struct {
    uint32_t epoch, transfer;
    uint64_t offset;
    uint16_t length;
    const uint8_t *bytes; /* inside the decoded block */
} FbChunk;

typedef struct {
    uint32_t session;
    uint64_t token;
    uint32_t count;
} FbBeat;

size_t fb_wire_put_status(uint8_t *out, const FbStatus *status);
uint16_t fb_wire_flags(const FbStatus *status); /* the field of STATUS */
size_t fb_wire_put_alarm(uint8_t *out, const FbStatus *status);
size_t fb_wire_put_ack(uint8_t *out, const FbStatus *status);
size_t fb_wire_put_offsets(uint8_t *out, const FbSetup *setup);
size_t fb_wire_put_tools(uint8_t *out, const FbSetup *setup, unsigned page);
size_t fb_wire_put_order(uint8_t *out, const FbOrder *order);
size_t fb_wire_put_chunk(uint8_t *out, const FbChunk *chunk); /* an even number of bytes */
size_t fb_wire_put_beat(uint8_t *out, const FbBeat *beat);

/* False where the block is damaged or breaks the protocol; the texts of `status` are not touched,
 * and `status` is undefined on failure. */
bool fb_wire_get_status(const uint8_t *in, size_t n, FbStatus *status);

/* The serial, code and texts; nothing is changed on failure. Another serial than the status' is not
 * damage: the caller compares. */
bool fb_wire_get_alarm(const uint8_t *in, size_t n, FbStatus *status);

/* What an ACK says, into `status`: state, epoch, transfer, received, may_send_to, chunk_answer.
 * Nothing is changed on failure. */
bool fb_wire_get_ack(const uint8_t *in, size_t n, FbStatus *status);

/* Offsets and serial; then the pages, each with the serial and the number of tools on all pages,
 * which the caller compares. `setup` is undefined on failure. */
bool fb_wire_get_offsets(const uint8_t *in, size_t n, FbSetup *setup);
bool fb_wire_get_tools(const uint8_t *in, size_t n, unsigned page, FbSetup *setup);

/* FB_ANSWER_DONE, _MALFORMED or _CRC. An order is all zero after a wrong size or CRC; with these
 * right and MALFORMED its session and number are the sender's. */
FbAnswer fb_wire_get_order(const uint8_t *in, size_t n, FbOrder *order);
FbAnswer fb_wire_get_chunk(const uint8_t *in, size_t n, FbChunk *chunk);
FbAnswer fb_wire_get_beat(const uint8_t *in, size_t n, FbBeat *beat);

/* `text` (or NULL) into FB_TEXT_BYTES, padded with at least one NUL. What is too long is cut
 * between characters and ends in "…"; what is no UTF-8 is cut before that. */
void fb_wire_text(char *to, const char *text);

/* An entry of the table of gates; `hash` is NULL unless the program drips. */
void fb_wire_put_gate(uint8_t *out, uint64_t offset, const uint8_t *hash);
uint64_t fb_wire_get_gate(const uint8_t *entry);

/* Bytes of an entry under these flags of OPEN. */
static inline size_t fb_wire_gate_bytes(uint16_t open_flags)
{
    return open_flags & FB_OPEN_DRIP ? FB_DRIP_GATE_BYTES : FB_GATE_BYTES;
}
uint32_t fb_wire_crc(const uint8_t *bytes, size_t n);

#endif
