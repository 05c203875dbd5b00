/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Any blocks, in any order, on both sides of the delivery. The input is a list of steps: what, how
 * many bytes, the bytes. A step may have its CRC mended, or else nothing would come past it; what
 * the machine publishes must stay possible, and what is READY must have the hash that was
 * announced.
 */
#include <glib.h>
#include <string.h>

#include "fieldbus/delivery.h"
#include "fieldbus/receiver.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { AS_IT_IS = 0, MENDED = 8, EVENT = 16, WAIT = 17, REPLY = 18, TASK = 19 };

typedef struct {
    FbReceiver *receiver;
    FbDelivery *delivery;
    GArray *actions;
    int64_t now_us;
    GBytes *program;
} Pair;

static void put_crc(uint8_t *at, uint32_t crc)
{
    for (int i = 0; i < 4; i++)
        at[i] = (uint8_t)(crc >> (24 - 8 * i));
}

/* The CRC at byte `at` of a block whose bytes behind it count too. */
static void mend(uint8_t *block, size_t n, size_t at)
{
    uint8_t joined[FB_BLOCK_BYTES];
    if (n < at + 4)
        return;
    memcpy(joined, block, at);
    memcpy(joined + at, block + at + 4, n - at - 4);
    put_crc(block + at, fb_wire_crc(joined, n - 4));
}

static void check_machine(const Pair *p)
{
    FbStatus s, back = {0};
    uint8_t block[FB_BLOCK_BYTES], digest[32];
    gsize n = sizeof digest;
    fb_receiver_status(p->receiver, p->now_us, &s);
    g_assert(fb_wire_get_status(block, fb_wire_put_status(block, &s), &back));
    g_assert(fb_wire_get_alarm(block, fb_wire_put_alarm(block, &s), &back));
    GBytes *program = fb_receiver_program(p->receiver);
    if (s.state < FB_STATE_READY || s.state > FB_STATE_COMPLETE)
        return;
    g_assert(program);
    g_autoptr(GChecksum) hash = g_checksum_new(G_CHECKSUM_SHA256);
    g_checksum_update(hash, g_bytes_get_data(program, NULL), (gssize)g_bytes_get_size(program));
    g_checksum_get_digest(hash, digest, &n);
    g_assert(memcmp(digest, s.id, 32) == 0 && memcmp(digest, s.sha256, 32) == 0);
}

static void write_block(Pair *p, unsigned what, uint8_t *block, size_t n)
{
    const unsigned kind = what % 4;
    if (what >= MENDED && kind == FB_BLOCK_COMMAND)
        mend(block, n, FB_COMMAND_BYTES - 4);
    else if (what >= MENDED && kind == FB_BLOCK_CHUNK && n > FB_CHUNK_HEADER_BYTES)
        mend(block, MIN(n, FB_CHUNK_HEADER_BYTES + (size_t)(block[16] << 8 | block[17])),
             FB_CHUNK_HEADER_BYTES - 4);
    else if (what >= MENDED && kind == FB_BLOCK_BEAT)
        mend(block, n, FB_BEAT_BYTES - 4);
    fb_receiver_write(p->receiver, FB_ROLE_PROGRAMMER, (FbBlock)kind, block, n, p->now_us,
                      p->actions);
}

static void step_delivery(Pair *p, FbEvent event)
{
    FbActions out;
    fb_delivery_step(p->delivery, &event, p->now_us, &out);
    g_assert(out.wake_us > 0);
    g_assert(!out.request || out.request->n <= FB_BLOCK_BYTES);
    if (out.ended)
        g_clear_error(&out.error);
}

static void reply(Pair *p, uint8_t *block, size_t n)
{
    if (n >= 8 && block[0] == 1)
        put_crc(block + n - 4, fb_wire_crc(block, n - 4));
    step_delivery(p, (FbEvent){.kind = FB_EVENT_CONNECTED});
    step_delivery(p, (FbEvent){.kind = FB_EVENT_REPLY, .bytes = block, .n = n});
}

static void task(Pair *p, unsigned which)
{
    const uint64_t gates[] = {g_bytes_get_size(p->program)};
    if (fb_delivery_busy(p->delivery))
        return;
    if (which % 3 == 0)
        fb_delivery_deliver(p->delivery, p->program, gates, 1, p->now_us);
    else if (which % 3 == 1)
        fb_delivery_start(p->delivery, p->now_us);
    else
        fb_delivery_command(p->delivery, (FbCommand)(1 + which % (FB_N_COMMANDS - 1)), NULL,
                            p->now_us);
}

static void step(Pair *p, unsigned what, uint8_t *bytes, size_t n)
{
    const FbAlarm alarm = {7, "text", NULL};
    const unsigned first = n > 0 ? bytes[0] : 0;
    if (what < EVENT)
        write_block(p, what, bytes, n);
    else if (what == EVENT)
        fb_receiver_machine(p->receiver, (FbMachineEvent)(first % (FB_MACHINE_ACKNOWLEDGED + 1)),
                            &alarm, p->now_us, p->actions);
    else if (what == WAIT)
        p->now_us += (int64_t)first * 100000;
    else if (what == REPLY)
        reply(p, bytes, n);
    else
        task(p, first);
    fb_receiver_tick(p->receiver, p->now_us, p->actions);
    step_delivery(p, (FbEvent){.kind = FB_EVENT_TICK});
    check_machine(p);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const FbReceiverOptions machine = {.epoch = 1,
                                       .memory_bytes = 4096,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    const FbDeliveryOptions agent = {
        1, UINT64_C(1) << 32, 1000000, 500000, 30000000, 500000, 4, CFG_DRIP_AUTO};
    Pair p = {.receiver = fb_receiver_new(&machine),
              .delivery = fb_delivery_new(&agent, 1),
              .actions = g_array_new(FALSE, FALSE, sizeof(FbDo)),
              .now_us = 1,
              .program = g_bytes_new_static("G0 X1\nM30\n", 10)};
    while (size >= 2) {
        const size_t n = MIN(MIN(data[1], FB_BLOCK_BYTES), size - 2);
        g_autofree uint8_t *block = g_memdup2(data + 2, n);
        step(&p, data[0] % (TASK + 1), block, n);
        data += 2 + n;
        size -= 2 + n;
    }
    fb_receiver_free(p.receiver);
    fb_delivery_free(p.delivery);
    g_array_unref(p.actions);
    g_bytes_unref(p.program);
    return 0;
}
