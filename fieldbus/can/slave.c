/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/can/slave.h"

#include <string.h>

#include "fieldbus/bytes.h"

/* What one HELLO and its WELCOME agreed on. */
typedef struct {
    bool is_open;
    bool fd;
    uint32_t session;
    FbCanKeys keys;
    uint32_t counter;  /* of the last message */
    uint32_t stop_seq; /* of the last STOP */
} Opening;

/* A HELLO may be an old one: its keys only count when a message that needs them has come. */
typedef struct {
    uint16_t id; /* of requests */
    Opening confirmed, offered;
} Channel;

struct FbCanSlave {
    FbCanSlaveOptions options;
    FbReceiver *receiver;
    uint32_t epoch;
    FbCanKey beat_key;
    uint32_t beat_count; /* of the next one */
    FbState beat_state;  /* of the last one */
    uint8_t beat_flags;
    Channel channels[FB_CAN_AGENTS_MOST][FB_CAN_N_CHANNELS];
    FbCanCounts counts;
};

static void welcome(FbCanSlave *s, Channel *channel, const FbCanMessage *message,
                    const uint8_t *nonce, FbCanAnswer *answer);
static Opening *opening_of(FbCanSlave *s, Channel *channel, const FbCanMessage *message);
static bool serve(FbCanSlave *s, const FbCanMessage *message, int64_t now_us, GArray *actions,
                  FbCanAnswer *answer);
static void put_status(FbCanSlave *s, int64_t now_us, FbCanAnswer *answer);

void fb_can_slave_message(FbCanSlave *s, const FbCanMessage *m, const uint8_t *nonce,
                          int64_t now_us, GArray *actions, FbCanAnswer *answer)
{
    answer->n = 0;
    answer->fd = false;
    g_assert(m->agent < s->options.agents);
    Channel *channel = &s->channels[m->agent][m->channel];
    if (fb_can_is_hello(m->bytes, m->n)) {
        welcome(s, channel, m, nonce, answer);
        return;
    }
    Opening *opening = opening_of(s, channel, m);
    if (!opening)
        return;
    if (!serve(s, m, now_us, actions, answer)) {
        s->counts.malformed++;
        return;
    }
    answer->fd = opening->fd;
    answer->n = fb_can_seal(answer->bytes, answer->n, opening->counter, &opening->keys.machine);
}

/* ------------------------------------------------------------------------- opening */

static void welcome(FbCanSlave *s, Channel *channel, const FbCanMessage *m, const uint8_t *nonce,
                    FbCanAnswer *answer)
{
    FbCanHello hello;
    if (m->fd || m->n != FB_CAN_HELLO_BYTES) {
        s->counts.malformed++;
        return;
    }
    if (!fb_can_get_hello(m->bytes, m->n, &s->options.key, channel->id, &hello)) {
        s->counts.forged++;
        return;
    }
    const bool fd = s->options.fd && hello.flags & FB_CAN_FLAG_FD;
    FbCanWelcome w = {.version = FB_PROTOCOL_VERSION,
                      .flags = fd ? FB_CAN_FLAG_FD : 0,
                      .epoch = s->epoch,
                      .beat_count = s->beat_count};
    memcpy(w.nonce, nonce, FB_CAN_NONCE_BYTES);
    s->counts.hellos++;
    channel->offered = (Opening){.is_open = true, .fd = fd, .session = hello.session};
    fb_can_derive(&channel->offered.keys, &s->options.key, channel->id, hello.nonce, nonce);
    answer->fd = false;
    answer->n = fb_can_put_welcome(answer->bytes, &w, &s->options.key, channel->id, hello.nonce);
}

static bool is_sealed_with(const Opening *opening, const FbCanMessage *m, uint32_t *counter)
{
    return opening->is_open && opening->fd == m->fd &&
           fb_can_unseal(m->bytes, m->n, &opening->keys.agent, counter);
}

/* The opening that the message belongs to, its counter taken; NULL: counted, and nothing else. */
static Opening *opening_of(FbCanSlave *s, Channel *channel, const FbCanMessage *m)
{
    uint32_t counter;
    if (m->n < 1 + FB_CAN_SEAL_BYTES || m->n > FB_CAN_MESSAGE_BYTES) {
        s->counts.malformed++;
        return NULL;
    }
    if (is_sealed_with(&channel->offered, m, &counter)) {
        channel->confirmed = channel->offered;
        channel->offered = (Opening){0};
        s->counts.openings++;
    } else if (!is_sealed_with(&channel->confirmed, m, &counter)) {
        s->counts.forged++;
        return NULL;
    }
    Opening *opening = &channel->confirmed;
    if (counter > FB_CAN_COUNTER_MOST) {
        s->counts.malformed++;
        return NULL;
    }
    if (counter <= opening->counter) {
        s->counts.replayed++;
        return NULL;
    }
    opening->counter = counter;
    return opening;
}

/* ------------------------------------------------------------------------ messages */

static FbStatus status_of(const FbCanSlave *s, int64_t now_us)
{
    FbStatus status;
    fb_receiver_publish(s->receiver, (FbCarrier){FB_CHUNK_BYTES, 1}, now_us, &status);
    return status;
}

static void put_status(FbCanSlave *s, int64_t now_us, FbCanAnswer *answer)
{
    const FbStatus status = status_of(s, now_us);
    answer->bytes[0] = FB_CAN_STATUS;
    answer->n = 1 + fb_wire_put_status(answer->bytes + 1, &status);
}

/* False where the register is not the first of a block that can be read. */
static bool put_block(FbCanSlave *s, unsigned at, int64_t now_us, FbCanAnswer *answer)
{
    const FbStatus status = status_of(s, now_us);
    const FbSetup *setup = fb_receiver_setup(s->receiver);
    const unsigned page = (at - FB_AT_TOOLS) / FB_TOOLS_PAGE_REGISTERS;
    uint8_t *block = answer->bytes + 1;
    if (at == FB_AT_STATUS) {
        put_status(s, now_us, answer);
    } else if (at == FB_AT_ALARM) {
        answer->bytes[0] = FB_CAN_ALARM;
        answer->n = 1 + fb_wire_put_alarm(block, &status);
    } else if (at == FB_AT_OFFSETS) {
        answer->bytes[0] = FB_CAN_OFFSETS;
        answer->n = 1 + fb_wire_put_offsets(block, setup);
    } else if (at >= FB_AT_TOOLS && page < FB_TOOLS_PAGES &&
               at == FB_AT_TOOLS + page * FB_TOOLS_PAGE_REGISTERS) {
        answer->bytes[0] = FB_CAN_TOOLS;
        answer->n = 1 + fb_wire_put_tools(block, setup, page);
    } else {
        return false;
    }
    return true;
}

static void take_chunk(FbCanSlave *s, const uint8_t *body, size_t n, int64_t now_us,
                       GArray *actions, FbCanAnswer *answer)
{
    uint8_t block[FB_CAN_BODY_BYTES + 1];
    memcpy(block, body, n);
    block[n] = 0; /* what makes an odd chunk even did not travel */
    fb_receiver_write(s->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_CHUNK, block, n + n % 2, now_us,
                      actions);
    const FbStatus status = status_of(s, now_us);
    answer->bytes[0] = FB_CAN_ACK;
    answer->n = 1 + fb_wire_put_ack(answer->bytes + 1, &status);
}

/* What an agent that holds the key asks for; false where that is nothing. */
static bool serve(FbCanSlave *s, const FbCanMessage *m, int64_t now_us, GArray *actions,
                  FbCanAnswer *answer)
{
    const uint8_t *body = m->bytes + 1;
    const size_t n = m->n - 1 - FB_CAN_SEAL_BYTES;
    switch ((FbCanKind)m->bytes[0]) {
    case FB_CAN_COMMAND:
    case FB_CAN_BEAT:
        fb_receiver_write(s->receiver, FB_ROLE_PROGRAMMER,
                          m->bytes[0] == FB_CAN_COMMAND ? FB_BLOCK_COMMAND : FB_BLOCK_BEAT, body, n,
                          now_us, actions);
        put_status(s, now_us, answer);
        return true;
    case FB_CAN_CHUNK:
        take_chunk(s, body, n, now_us, actions, answer);
        return true;
    case FB_CAN_READ:
        return n == 2 && put_block(s, fb_get16(body), now_us, answer);
    default:
        return false;
    }
}

/* ---------------------------------------------------------------------------- STOP */

void fb_can_slave_stop(FbCanSlave *s, unsigned agent, const uint8_t *bytes, size_t n,
                       int64_t now_us, GArray *actions, FbCanAnswer *answer)
{
    uint8_t block[FB_BLOCK_BYTES];
    FbOrder order = {0};
    answer->n = 0;
    answer->fd = false;
    g_assert(agent < s->options.agents);
    Opening *opening = &s->channels[agent][FB_CAN_CONTROL_CHANNEL].confirmed;
    if (n != FB_CAN_FRAME_BYTES) {
        s->counts.malformed++;
    } else if (!opening->is_open ||
               !fb_can_get_stop(bytes, &opening->keys.agent, &order.command, &order.seq)) {
        s->counts.forged++;
    } else if (order.seq <= opening->stop_seq) {
        s->counts.replayed++;
    } else if (!fb_command_stops(order.command)) {
        s->counts.malformed++;
    } else {
        opening->stop_seq = order.seq;
        order.session = opening->session;
        const size_t n_block = fb_wire_put_order(block, &order);
        fb_receiver_write(s->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block, n_block, now_us,
                          actions);
        put_status(s, now_us, answer);
        answer->fd = opening->fd;
        answer->n = fb_can_seal(answer->bytes, answer->n, fb_can_stop_counter(order.seq),
                                &opening->keys.machine);
    }
}

/* ---------------------------------------------------------------------------- beat */

bool fb_can_slave_has_news(const FbCanSlave *s, int64_t now_us)
{
    const FbStatus status = status_of(s, now_us);
    return status.state != s->beat_state || (uint8_t)fb_wire_flags(&status) != s->beat_flags;
}

void fb_can_slave_beat(FbCanSlave *s, int64_t now_us, uint8_t *frame)
{
    const FbStatus status = status_of(s, now_us);
    s->beat_state = status.state;
    s->beat_flags = (uint8_t)fb_wire_flags(&status);
    fb_can_put_beat(frame, &(FbCanMachineBeat){s->beat_state, s->beat_flags, s->beat_count++},
                    &s->beat_key);
}

/* ---------------------------------------------------------------------------- life */

FbCanCounts fb_can_slave_counts(const FbCanSlave *s)
{
    return s->counts;
}

FbCanSlave *fb_can_slave_new(const FbCanSlaveOptions *options, FbReceiver *receiver)
{
    FbCanSlave *s = g_new0(FbCanSlave, 1);
    FbStatus status;
    fb_receiver_status(receiver, 0, &status);
    g_assert(options->agents <= FB_CAN_AGENTS_MOST);
    s->options = *options;
    s->receiver = receiver;
    s->epoch = status.epoch;
    s->beat_count = 1;
    fb_can_beat_key(&s->beat_key, &options->key, s->epoch);
    for (unsigned agent = 0; agent < FB_CAN_AGENTS_MOST; agent++)
        for (FbCanChannel c = 0; c < FB_CAN_N_CHANNELS; c++)
            s->channels[agent][c].id = fb_can_request_id(options->base, agent, c);
    return s;
}

void fb_can_slave_free(FbCanSlave *s)
{
    if (!s)
        return;
    explicit_bzero(s, sizeof *s);
    g_free(s);
}
