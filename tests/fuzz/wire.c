/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Any blocks, in any order, from anybody, on both sides of the delivery. The input is a list of
 * steps: what, how many bytes, the bytes. Blocks may have their CRCs mended, and the two sides may
 * talk to each other with a bit turned over here and there.
 */
#include <glib.h>
#include <string.h>

#include "fieldbus/delivery.h"
#include "tests/lib/fuzz/blocks.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum {
    AS_IT_IS = 0, /* + FbBlock */
    MENDED = 8,
    EVENT = 16,
    WAIT,
    REPLY,
    TASK,
    PROGRESS,
    SETUP,
    IN_A_ROLE,
    TALK,
    N_STEPS
};

enum { LINE_BYTES = 150 };

typedef struct {
    FbReceiver *receiver;
    FbDelivery *delivery;
    GArray *actions;
    int64_t now_us;
    GBytes *program;
    bool connected;
    FbRequest *request; /* the agent's last; NULL: answered */
} Pair;

static void step_delivery(Pair *p, FbEvent event)
{
    FbActions out;
    do {
        fb_delivery_step(p->delivery, &event, p->now_us, &out);
        g_assert(out.wake_us > 0);
        if (out.close)
            p->connected = false;
        if (out.connect)
            p->connected = true;
        if (out.request) {
            g_assert(out.request->n <= FB_BLOCK_BYTES);
            g_free(p->request);
            p->request = g_memdup2(out.request, sizeof *out.request);
        }
        if (out.ended)
            g_clear_error(&out.error);
        event = (FbEvent){.kind = FB_EVENT_TICK};
    } while (out.more);
}

/* Blocks that the agent reads end with their CRC. */
static void mend_reply(uint8_t *block, size_t n)
{
    if (n >= 8)
        fuzz_put_crc(block + n - 4, fb_wire_crc(block, n - 4));
}

static void reply(Pair *p, uint8_t *block, size_t n)
{
    if (n > 0 && block[0] < 0x80)
        mend_reply(block, n);
    step_delivery(p, (FbEvent){.kind = FB_EVENT_CONNECTED});
    step_delivery(p, (FbEvent){.kind = FB_EVENT_REPLY, .bytes = block, .n = n});
}

static size_t answer(const Pair *p, const FbRequest *request, bool ack, uint8_t *out)
{
    FbStatus status;
    fb_receiver_status(p->receiver, p->now_us, &status);
    switch (request->kind) {
    case FB_REQUEST_ALARM:
        return fb_wire_put_alarm(out, &status);
    case FB_REQUEST_OFFSETS:
        return fb_wire_put_offsets(out, fb_receiver_setup(p->receiver));
    case FB_REQUEST_TOOLS:
        return fb_wire_put_tools(out, fb_receiver_setup(p->receiver), request->page);
    case FB_REQUEST_CHUNK:
        return ack ? fb_wire_put_ack(out, &status) : fb_wire_put_status(out, &status);
    default:
        return fb_wire_put_status(out, &status);
    }
}

/* The agent's last request reaches the machine, and the answer the agent. */
static void talk(Pair *p, const uint8_t *how, size_t n_how)
{
    static const FbBlock kinds[] = {[FB_REQUEST_COMMAND] = FB_BLOCK_COMMAND,
                                    [FB_REQUEST_CHUNK] = FB_BLOCK_CHUNK,
                                    [FB_REQUEST_BEAT] = FB_BLOCK_BEAT};
    p->now_us += 20000;
    step_delivery(p, (FbEvent){.kind = FB_EVENT_CONNECTED});
    g_autofree FbRequest *request = g_steal_pointer(&p->request);
    if (!request)
        return;
    const unsigned where = n_how > 1 ? how[1] : 0, bit = n_how > 0 ? how[0] : 0;
    if (bit & 1 && request->n > 0) {
        request->bytes[where % request->n] ^= (uint8_t)(1 << (bit >> 2 & 7));
        if (bit & 2)
            fuzz_mend(kinds[request->kind], request->bytes, request->n);
    }
    if (request->n > 0)
        fb_receiver_write(p->receiver, FB_ROLE_PROGRAMMER, kinds[request->kind], request->bytes,
                          request->n, p->now_us, p->actions);
    uint8_t block[FB_BLOCK_BYTES];
    const size_t n = answer(p, request, bit & 32, block);
    if (bit & 64) {
        block[where % n] ^= (uint8_t)(1 << (bit >> 2 & 7));
        mend_reply(block, n);
    }
    g_autofree uint8_t *exact = g_memdup2(block, n);
    step_delivery(p, (FbEvent){.kind = FB_EVENT_REPLY, .bytes = exact, .n = n});
}

static void task(Pair *p, unsigned which)
{
    const uint64_t gates[] = {LINE_BYTES, 2 * LINE_BYTES};
    const FbStored stored = {.gate = which >> 4, .gate_offset = LINE_BYTES};
    const FbArguments arguments = {50, 50, 50, true};
    if (fb_delivery_busy(p->delivery))
        return;
    switch (which % 5) {
    case 0:
        fb_delivery_deliver(p->delivery, p->program, gates, 2, p->now_us);
        break;
    case 1:
        fb_delivery_start(p->delivery, p->now_us);
        break;
    case 2:
        fb_delivery_command(p->delivery, (FbCommand)(1 + which / 5 % (FB_N_COMMANDS - 1)),
                            &arguments, p->now_us, p->now_us);
        break;
    case 3:
        fb_delivery_start_stored(p->delivery, &stored, p->now_us);
        break;
    default:
        fb_delivery_read_setup(p->delivery, p->now_us);
    }
}

static void set_up(Pair *p, const uint8_t *bytes, size_t n)
{
    FbSetup setup = {.n_tools = (uint16_t)MIN(n, FB_TOOLS_MOST), .work_offset = 54};
    for (uint16_t i = 0; i < setup.n_tools; i++)
        setup.tools[i] = (FbTool){bytes[i], (CfgToolKind)(bytes[i] % 3), bytes[i], 0, 1e9 * i};
    fb_receiver_set_setup(p->receiver, &setup);
}

static void step(Pair *p, unsigned what, uint8_t *bytes, size_t n)
{
    const FbAlarm alarm = {7, "text", NULL};
    const unsigned first = n > 0 ? bytes[0] : 0;
    const FbBlock kind = (FbBlock)((what == IN_A_ROLE ? first >> 2 : what) % 4);
    if (what < EVENT) {
        if (what >= MENDED)
            fuzz_mend(kind, bytes, n);
        fb_receiver_write(p->receiver, FB_ROLE_PROGRAMMER, kind, bytes, n, p->now_us, p->actions);
    } else if (what == IN_A_ROLE && n > 0) {
        fuzz_mend(kind, bytes + 1, n - 1);
        fb_receiver_write(p->receiver, (FbRole)(first % 4), kind, bytes + 1, n - 1, p->now_us,
                          p->actions);
    } else if (what == EVENT) {
        fb_receiver_machine(p->receiver, (FbMachineEvent)(first % (FB_MACHINE_ACKNOWLEDGED + 1)),
                            &alarm, p->now_us, p->actions);
    } else if (what == WAIT) {
        p->now_us += (int64_t)first * 100000;
    } else if (what == REPLY) {
        reply(p, bytes, n);
    } else if (what == TASK) {
        task(p, first);
    } else if (what == PROGRESS) {
        fb_receiver_progress(p->receiver, &(FbProgress){.gate = first, .executed_blocks = first});
    } else if (what == SETUP) {
        set_up(p, bytes, n);
    } else {
        talk(p, bytes, n);
    }
    fb_receiver_tick(p->receiver, p->now_us, p->actions);
    step_delivery(p, (FbEvent){.kind = FB_EVENT_TICK});
    fuzz_check_machine(p->receiver, p->now_us);
}

/* Two lines, a gate behind each. */
static GBytes *make_program(void)
{
    char *text = g_malloc(2 * LINE_BYTES);
    memset(text, 'X', 2 * LINE_BYTES);
    text[LINE_BYTES - 1] = text[2 * LINE_BYTES - 1] = '\n';
    return g_bytes_new_take(text, 2 * LINE_BYTES);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    /* The first byte says whether the program is too large for the machine. */
    const FbReceiverOptions machine = {.epoch = 1,
                                       .memory_bytes = size > 0 && data[0] & 0x80 ? 250 : 4096,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    const FbDeliveryOptions agent = {1, UINT64_C(1) << 32, 1000000, 500000, 30000000, 500000,
                                     4, CFG_DRIP_AUTO};
    Pair p = {.receiver = fb_receiver_new(&machine),
              .delivery = fb_delivery_new(&agent, 1),
              .actions = g_array_new(FALSE, FALSE, sizeof(FbDo)),
              .now_us = 1,
              .program = make_program()};
    while (size >= 2) {
        const size_t n = MIN(data[1], size - 2);
        g_autofree uint8_t *block = g_memdup2(data + 2, n);
        step(&p, (data[0] & 0x7f) % N_STEPS, block, n);
        data += 2 + n;
        size -= 2 + n;
    }
    fb_receiver_free(p.receiver);
    fb_delivery_free(p.delivery);
    g_free(p.request);
    g_array_unref(p.actions);
    g_bytes_unref(p.program);
    return 0;
}
