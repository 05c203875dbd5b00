/* SPDX-License-Identifier: Apache-2.0 */
/* What the fuzz targets of the delivery share: CRCs made right, or else nothing would come past
 * them, and what a machine may never publish, whatever was written to it. */
#ifndef TESTS_LIB_FUZZ_BLOCKS_H
#define TESTS_LIB_FUZZ_BLOCKS_H

#include <string.h>

#include "fieldbus/receiver.h"

static inline void fuzz_put_crc(uint8_t *at, uint32_t crc)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(crc >> (24 - 8 * i));
}

/* The CRC at byte `at` of a block whose bytes behind it count too. */
static inline void fuzz_mend_at(uint8_t *block, size_t n, size_t at)
{
    uint8_t joined[FB_BLOCK_BYTES];
    if (n < at + 4)
        return;
    memcpy(joined, block, at);
    memcpy(joined + at, block + at + 4, n - at - 4);
    fuzz_put_crc(block + at, fb_wire_crc(joined, n - 4));
}

static inline void fuzz_mend(FbBlock kind, uint8_t *block, size_t n)
{
    if (kind == FB_BLOCK_COMMAND)
        fuzz_mend_at(block, n, FB_COMMAND_BYTES - 4);
    else if (kind == FB_BLOCK_CHUNK && n > FB_CHUNK_HEADER_BYTES)
        fuzz_mend_at(block, MIN(n, FB_CHUNK_HEADER_BYTES + (size_t)(block[16] << 8 | block[17])),
                     FB_CHUNK_HEADER_BYTES - 4);
    else if (kind == FB_BLOCK_BEAT)
        fuzz_mend_at(block, n, FB_BEAT_BYTES - 4);
}

/* What is READY, or runs, is whole and has the hash that was announced; what drips is released only
 * as far as it has come. */
static inline void fuzz_check_machine(const FbReceiver *receiver, int64_t now_us)
{
    FbStatus s, back = {0};
    uint8_t block[FB_BLOCK_BYTES], digest[32];
    gsize n = sizeof digest;
    fb_receiver_status(receiver, now_us, &s);
    g_assert(fb_wire_get_status(block, fb_wire_put_status(block, &s), &back));
    g_assert(fb_wire_get_alarm(block, fb_wire_put_alarm(block, &s), &back));
    g_assert(fb_wire_get_ack(block, fb_wire_put_ack(block, &s), &back));
    g_assert(s.received <= s.may_send_to && s.may_send_to <= s.length);
    g_assert(s.released <= s.received);
    for (size_t i = 0; i < fb_receiver_released(receiver); i++) {
        g_autoptr(GBytes) pass = fb_receiver_pass(receiver, i);
        g_assert(!pass || g_bytes_get_size(pass) > 0);
    }
    GBytes *program = fb_receiver_program(receiver);
    if (s.state < FB_STATE_READY || s.state > FB_STATE_COMPLETE)
        return;
    g_assert(s.transfer != 0);
    if (s.drip) {
        g_assert(!program && fb_receiver_released(receiver) > 0);
        return;
    }
    g_assert(program);
    g_autoptr(GChecksum) hash = g_checksum_new(G_CHECKSUM_SHA256);
    g_checksum_update(hash, g_bytes_get_data(program, NULL), (gssize)g_bytes_get_size(program));
    g_checksum_get_digest(hash, digest, &n);
    g_assert(memcmp(digest, s.id, 32) == 0 && memcmp(digest, s.sha256, 32) == 0);
}

#endif
