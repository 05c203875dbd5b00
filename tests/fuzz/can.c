/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's side on a CAN bus, fed with messages and frames. The input is a list of steps:
 * what, where, how many bytes, the bytes. Bytes as they are cannot have a right seal: they must
 * change nothing. Others are sealed here, with a right CRC if asked, so that they get behind it.
 */
#include <glib.h>
#include <string.h>

#include "fieldbus/can/slave.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { RAW, SEALED, SEALED_MENDED, HELLO, STOP_RAW, STOP, EVENT, WAIT, BEAT, N_STEPS };
enum { AGENTS = 2, EPOCH = 7, BASE = 0x100, HEAD_BYTES = 4 };

static const FbCanKey KEY = {"an example's key", 16};

typedef struct {
    FbReceiver *receiver;
    FbCanSlave *slave;
    GArray *actions;
    int64_t now_us;
    uint8_t nonces; /* used so far */
    struct {
        FbCanKeys keys;
        bool fd;
        uint32_t counter, seq;
    } open[AGENTS][FB_CAN_N_CHANNELS];
} Rig;

typedef struct {
    unsigned what, agent;
    FbCanChannel channel;
    bool fd;
    const uint8_t *bytes;
    size_t n;
} Step;

static void put_crc(uint8_t *block, size_t n, size_t at)
{
    uint8_t joined[FB_CAN_MESSAGE_BYTES];
    if (n < at + 4)
        return;
    memcpy(joined, block, at);
    memcpy(joined + at, block + at + 4, n - at - 4);
    const uint32_t crc = fb_wire_crc(joined, n - 4);
    for (int i = 0; i < 4; i++)
        block[at + (size_t)i] = (uint8_t)(crc >> (24 - 8 * i));
}

static void mend(uint8_t *message, size_t n)
{
    const size_t chunk = n > FB_CHUNK_HEADER_BYTES
                             ? FB_CHUNK_HEADER_BYTES + (size_t)(message[17] << 8 | message[18])
                             : n;
    if (message[0] == FB_CAN_COMMAND)
        put_crc(message + 1, n - 1, FB_COMMAND_BYTES - 4);
    else if (message[0] == FB_CAN_CHUNK)
        put_crc(message + 1, MIN(n - 1, chunk), FB_CHUNK_HEADER_BYTES - 4);
    else if (message[0] == FB_CAN_BEAT)
        put_crc(message + 1, n - 1, FB_BEAT_BYTES - 4);
}

static FbStatus status_of(const Rig *rig)
{
    FbStatus s;
    fb_receiver_status(rig->receiver, rig->now_us, &s);
    return s;
}

static uint64_t refused(const Rig *rig)
{
    const FbCanCounts c = fb_can_slave_counts(rig->slave);
    return c.forged + c.replayed + c.malformed;
}

static void send_message(Rig *rig, const Step *step, const uint8_t *bytes, size_t n,
                         FbCanAnswer *answer)
{
    const FbCanMessage message = {step->agent, step->channel, step->fd, bytes, n};
    uint8_t nonce[FB_CAN_NONCE_BYTES] = {++rig->nonces};
    fb_can_slave_message(rig->slave, &message, nonce, rig->now_us, rig->actions, answer);
    g_assert(answer->n <= FB_CAN_MESSAGE_BYTES);
}

/* Nobody's: counted, not answered, nothing changed. */
static void stranger(Rig *rig, const Step *step, FbCanAnswer *answer)
{
    uint8_t before[FB_BLOCK_BYTES], after[FB_BLOCK_BYTES];
    FbStatus s = status_of(rig);
    const uint64_t counted = refused(rig);
    const size_t n = fb_wire_put_status(before, &s);
    if (step->what == RAW)
        send_message(rig, step, step->bytes, step->n, answer);
    else
        fb_can_slave_stop(rig->slave, step->agent, step->bytes, step->n, rig->now_us, rig->actions,
                          answer);
    s = status_of(rig);
    fb_wire_put_status(after, &s);
    g_assert(answer->n == 0 && refused(rig) == counted + 1);
    g_assert(memcmp(before, after, n) == 0);
}

static void hello(Rig *rig, const Step *step, FbCanAnswer *answer)
{
    FbCanHello h = {
        .version = FB_PROTOCOL_VERSION, .flags = step->fd, .session = 1 + step->channel};
    FbCanWelcome w;
    uint8_t message[FB_CAN_MESSAGE_BYTES];
    const uint16_t id = fb_can_request_id(BASE, step->agent, step->channel);
    memcpy(h.nonce, step->bytes, MIN(step->n, sizeof h.nonce));
    Step classic = *step;
    classic.fd = false;
    send_message(rig, &classic, message, fb_can_put_hello(message, &h, &KEY, id), answer);
    g_assert(!answer->fd && fb_can_get_welcome(answer->bytes, answer->n, &KEY, id, h.nonce, &w));
    fb_can_derive(&rig->open[step->agent][step->channel].keys, &KEY, id, h.nonce, w.nonce);
    rig->open[step->agent][step->channel].fd = w.flags & FB_CAN_FLAG_FD;
    rig->open[step->agent][step->channel].counter = 0;
}

static void sealed(Rig *rig, const Step *step, FbCanAnswer *answer)
{
    uint8_t message[FB_CAN_MESSAGE_BYTES];
    uint32_t counter;
    const size_t n = MIN(step->n, 1 + FB_CAN_BODY_BYTES);
    if (n == 0 || step->bytes[0] == FB_CAN_HELLO)
        return;
    memcpy(message, step->bytes, n);
    if (step->what == SEALED_MENDED)
        mend(message, n);
    const uint64_t counted = refused(rig);
    const FbCanKeys *keys = &rig->open[step->agent][step->channel].keys;
    uint32_t *mine = &rig->open[step->agent][step->channel].counter;
    Step on = *step;
    on.fd = rig->open[step->agent][step->channel].fd;
    send_message(rig, &on, message, fb_can_seal(message, n, ++*mine, &keys->agent), answer);
    g_assert((answer->n == 0) == (refused(rig) == counted + 1));
    g_assert(answer->n == 0 || (fb_can_unseal(answer->bytes, answer->n, &keys->machine, &counter) &&
                                counter == *mine && answer->fd == on.fd));
}

static void stop(Rig *rig, const Step *step, FbCanAnswer *answer)
{
    uint8_t frame[FB_CAN_FRAME_BYTES];
    const unsigned first = step->n > 0 ? step->bytes[0] : FB_COMMAND_HOLD;
    uint32_t *seq = &rig->open[step->agent][FB_CAN_CONTROL_CHANNEL].seq;
    *seq += step->n > 1 ? step->bytes[1] % 4 : 1;
    fb_can_put_stop(frame, (FbCommand)first, *seq,
                    &rig->open[step->agent][FB_CAN_CONTROL_CHANNEL].keys.agent);
    fb_can_slave_stop(rig->slave, step->agent, frame, sizeof frame, rig->now_us, rig->actions,
                      answer);
}

static void do_step(Rig *rig, const Step *step)
{
    const FbAlarm alarm = {7, "text", NULL};
    const unsigned first = step->n > 0 ? step->bytes[0] : 0;
    uint8_t frame[FB_CAN_FRAME_BYTES];
    g_autofree FbCanAnswer *answer = g_new(FbCanAnswer, 1);
    if (step->what == RAW || step->what == STOP_RAW)
        stranger(rig, step, answer);
    else if (step->what == SEALED || step->what == SEALED_MENDED)
        sealed(rig, step, answer);
    else if (step->what == HELLO)
        hello(rig, step, answer);
    else if (step->what == STOP)
        stop(rig, step, answer);
    else if (step->what == EVENT)
        fb_receiver_machine(rig->receiver, (FbMachineEvent)(first % (FB_MACHINE_ACKNOWLEDGED + 1)),
                            &alarm, rig->now_us, rig->actions);
    else if (step->what == WAIT)
        rig->now_us += (int64_t)first * 100000;
    else
        fb_can_slave_beat(rig->slave, rig->now_us, frame);
    if (step->what == WAIT)
        fb_receiver_tick(rig->receiver, rig->now_us, rig->actions);
    g_array_set_size(rig->actions, 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const FbReceiverOptions machine = {.epoch = EPOCH,
                                       .memory_bytes = 1 << 16,
                                       .on_agent_loss = CFG_AGENT_LOSS_HOLD,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    const FbCanSlaveOptions options = {.key = KEY, .base = BASE, .agents = AGENTS, .fd = true};
    g_autofree Rig *rig = g_new0(Rig, 1);
    rig->receiver = fb_receiver_new(&machine);
    rig->slave = fb_can_slave_new(&options, rig->receiver);
    rig->actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    rig->now_us = 1000;
    while (size >= HEAD_BYTES) {
        Step step = {.what = data[0] % N_STEPS,
                     .agent = data[1] & 1,
                     .channel = data[1] >> 1 & 1,
                     .fd = data[1] >> 2 & 1,
                     .bytes = data + HEAD_BYTES};
        step.n = MIN((size_t)(data[2] << 8 | data[3]), size - HEAD_BYTES);
        do_step(rig, &step);
        data += HEAD_BYTES + step.n;
        size -= HEAD_BYTES + step.n;
    }
    fb_can_slave_free(rig->slave);
    fb_receiver_free(rig->receiver);
    g_array_unref(rig->actions);
    return 0;
}
