/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/delivery_task.h"

#include <string.h>

enum {
    SHOW_US = 50000,  /* statuses that only count bytes are shown this often */
    DAMAGED_MOST = 8, /* answers in a row that bring nothing forward */
};

static void take_reply(FbDelivery *d, const FbEvent *event, int64_t now_us, FbActions *out);
static void break_link(FbDelivery *d, const char *why, int64_t now_us, FbActions *out);
static void advance(FbDelivery *d, int64_t now_us, FbActions *out);
static void give_up(FbDelivery *d, FbActions *out);
static int64_t wake_us(const FbDelivery *d);

void fb_delivery_step(FbDelivery *d, const FbEvent *event, int64_t now_us, FbActions *out)
{
    *out = (FbActions){0};
    switch (event->kind) {
    case FB_EVENT_CONNECTED:
        d->link = LINK_UP;
        break;
    case FB_EVENT_REPLY:
        take_reply(d, event, now_us, out);
        break;
    case FB_EVENT_BROKEN:
        break_link(d, event->why, now_us, out);
        break;
    case FB_EVENT_TICK:
        if (d->link != LINK_UP && d->link != LINK_DOWN && now_us >= d->deadline_us)
            break_link(d, "no answer in time", now_us, out);
        break;
    }
    if (d->link == LINK_DOWN && d->busy && now_us - d->lost_us >= d->options.give_up_us)
        give_up(d, out);
    if (d->link == LINK_DOWN && now_us >= d->deadline_us) {
        out->connect = true;
        d->link = LINK_CONNECTING;
        d->deadline_us = now_us + d->options.reply_timeout_us;
    }
    if (d->link == LINK_UP)
        advance(d, now_us, out);
    out->wake_us = wake_us(d);
}

static int64_t wake_us(const FbDelivery *d)
{
    if (d->link != LINK_UP) {
        const int64_t give_up_us = d->lost_us + d->options.give_up_us;
        return d->busy && d->link == LINK_DOWN ? MIN(d->deadline_us, give_up_us) : d->deadline_us;
    }
    const int64_t idle_us = d->leased ? MIN(d->poll_us, d->beat_us) : d->poll_us;
    return d->busy ? MIN(idle_us, d->again_us) : idle_us;
}

/* ---------------------------------------------------------------------- the link */

static void send_request(FbDelivery *d, FbRequestKind kind, int64_t now_us, FbActions *out)
{
    d->request.kind = kind;
    if (kind == FB_REQUEST_STATUS || kind == FB_REQUEST_ALARM)
        d->request.n = 0;
    d->link = LINK_WAITING;
    d->deadline_us = now_us + d->options.reply_timeout_us;
    d->poll_us = now_us + d->options.heartbeat_us;
    out->request = &d->request;
}

static void break_link(FbDelivery *d, const char *why, int64_t now_us, FbActions *out)
{
    if (d->link == LINK_DOWN)
        return;
    g_free(d->why);
    d->why = g_strdup(why);
    if (d->fresh)
        d->lost_us = now_us;
    out->close = true;
    out->show |= d->status.state != FB_STATE_UNKNOWN;
    d->status.state = FB_STATE_UNKNOWN;
    d->fresh = false;
    d->link = LINK_DOWN;
    d->deadline_us = now_us + d->options.reconnect_us;
    if (d->finishing)
        fb_task_end(d, out);
}

static void give_up(FbDelivery *d, FbActions *out)
{
    const bool running = fb_task_may_run(d);
    const char *doubt = d->asking ? "; whether it did " : "";
    fb_task_finish(
        d, g_error_new(FB_ERROR, running ? FB_ERROR_LINK_LOST : FB_ERROR_UNREACHABLE,
                       "the machine is not reachable (%s)%s%s%s%s", d->why ? d->why : "no answer",
                       doubt, d->asking ? fb_command_name(d->order.command) : "",
                       d->asking ? " is not known" : "",
                       running ? "; its state is UNKNOWN, it may be running: look at it" : ""));
    fb_task_end(d, out);
}

static bool show_now(const FbDelivery *d, const FbStatus *before, int64_t now_us)
{
    const FbStatus *s = &d->status;
    return d->request.kind != FB_REQUEST_CHUNK || s->state != before->state ||
           s->transfer != before->transfer || now_us >= d->shown_us + SHOW_US;
}

static bool decode(FbDelivery *d, const FbEvent *event)
{
    if (d->request.kind == FB_REQUEST_ALARM) {
        if (!fb_wire_get_alarm(event->bytes, event->n, &d->status))
            return false;
        d->alarm_serial = d->status.alarm_serial;
        return true;
    }
    FbStatus fresh = d->status; /* keeps the texts */
    if (!fb_wire_get_status(event->bytes, event->n, &fresh))
        return false;
    d->status = fresh;
    if (fresh.alarm_code == 0)
        d->status.alarm_text[0] = d->status.alarm_advice[0] = 0;
    return true;
}

/* Chunks and commands that are damaged or bring nothing forward, again and again, end the task. */
static void count_damage(FbDelivery *d, bool forward)
{
    d->damaged = forward ? 0 : d->damaged + 1;
    if (d->busy && !d->finishing && d->damaged > DAMAGED_MOST)
        fb_task_finish(
            d, g_error_new(
                   FB_ERROR, FB_ERROR_PROTOCOL,
                   "the machine answers but takes nothing any more (%s at byte %" G_GUINT64_FORMAT
                   "): check the line and the machine's log",
                   fb_answer_name(d->status.chunk_answer), d->status.received));
}

static void take_reply(FbDelivery *d, const FbEvent *event, int64_t now_us, FbActions *out)
{
    if (d->link != LINK_WAITING)
        return;
    const FbStatus before = d->status;
    if (!decode(d, event)) {
        break_link(d, "an answer that the protocol does not allow", now_us, out);
        return;
    }
    const FbStatus *s = &d->status;
    const bool damaged = d->request.kind == FB_REQUEST_COMMAND && s->command_session == 0;
    if (d->request.kind == FB_REQUEST_COMMAND && !damaged &&
        (s->command_session != d->options.session || s->command_seq != d->order.seq)) {
        break_link(d, "an answer to another command", now_us, out);
        return;
    }
    d->link = LINK_UP;
    d->fresh = true;
    d->again_us = now_us;
    if (d->request.kind == FB_REQUEST_COMMAND) {
        count_damage(d, !damaged);
        if (damaged && d->finishing)
            d->leased = false; /* it will lapse */
        if (damaged || s->answer == FB_ANSWER_NONE)
            d->again_us = now_us + FB_AGAIN_US;
    } else if (d->request.kind == FB_REQUEST_CHUNK) {
        count_damage(d, s->received > d->received);
        d->received = MAX(d->received, s->received);
    }
    if (d->leased && s->lease_owner != (uint32_t)(d->options.token >> 32))
        d->leased = false;
    if (show_now(d, &before, now_us)) {
        out->show = true;
        d->shown_us = now_us;
    }
}

/* --------------------------------------------------------------------- asking */

void fb_delivery_send_order(FbDelivery *d, int64_t now_us, FbActions *out)
{
    d->request.n = fb_wire_put_order(d->request.bytes, &d->order);
    send_request(d, FB_REQUEST_COMMAND, now_us, out);
}

static void set_order(FbDelivery *d, FbCommand command)
{
    const bool names_none =
        command == FB_COMMAND_LEASE || command == FB_COMMAND_RELEASE || command == FB_COMMAND_OPEN;
    d->order = (FbOrder){
        .session = d->options.session,
        .seq = d->order.seq + 1,
        .epoch = d->epoch,
        .transfer = names_none ? 0 : d->status.transfer,
        .token = d->options.token,
        .command = command,
        .open = d->open,
    };
}

void fb_delivery_ask(FbDelivery *d, FbCommand command, int64_t now_us, FbActions *out)
{
    set_order(d, command);
    d->asking = true;
    fb_delivery_send_order(d, now_us, out);
}

static void send_beat(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbBeat beat = {d->options.session, d->options.token, ++d->beats};
    d->request.n = fb_wire_put_beat(d->request.bytes, &beat);
    d->beat_us = now_us + d->options.heartbeat_us;
    send_request(d, FB_REQUEST_BEAT, now_us, out);
}

void fb_delivery_send_chunk(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    const uint64_t table_bytes = (uint64_t)d->open.gates * FB_GATE_BYTES;
    const uint64_t to = MIN(s->length, s->may_send_to);
    if (s->received >= to) { /* no credit */
        d->again_us = now_us + FB_AGAIN_US;
        return;
    }
    uint8_t bytes[FB_CHUNK_BYTES];
    const uint8_t *program = g_bytes_get_data(d->program, NULL);
    const FbChunk chunk = {.epoch = d->epoch,
                           .transfer = s->transfer,
                           .offset = s->received,
                           .length = (uint16_t)MIN(to - s->received, s->chunk_max),
                           .bytes = bytes};
    for (uint16_t i = 0; i < chunk.length; i++) {
        const uint64_t at = chunk.offset + i;
        bytes[i] = at < table_bytes ? d->table[at] : program[at - table_bytes];
    }
    d->request.n = fb_wire_put_chunk(d->request.bytes, &chunk);
    send_request(d, FB_REQUEST_CHUNK, now_us, out);
}

static void take_epoch(FbDelivery *d)
{
    if (d->epoch == d->status.epoch)
        return;
    const bool running = fb_task_may_run(d);
    if (d->busy && d->task_epoch != 0 && !d->finishing)
        fb_task_finish(d, g_error_new(FB_ERROR, running ? FB_ERROR_LINK_LOST : FB_ERROR_REFUSED,
                                      "the machine was restarted (epoch %08x, was %08x)%s",
                                      d->status.epoch, d->epoch,
                                      running ? " while it ran: what it did last is not known"
                                              : ": deliver again"));
    d->epoch = d->task_epoch = d->status.epoch;
    d->leased = d->started = false;
    d->transfer = 0;
    d->alarm_serial = 0;
}

static void advance(FbDelivery *d, int64_t now_us, FbActions *out)
{
    if (!d->fresh || d->must_look) {
        d->must_look = false;
        send_request(d, FB_REQUEST_STATUS, now_us, out);
        return;
    }
    take_epoch(d);
    if (d->status.alarm_code != 0 && d->status.alarm_serial != d->alarm_serial) {
        send_request(d, FB_REQUEST_ALARM, now_us, out);
        return;
    }
    if (d->leased && now_us >= d->beat_us) {
        send_beat(d, now_us, out);
        return;
    }
    while (d->busy && d->link == LINK_UP && !out->ended) {
        const bool was_finishing = d->finishing;
        fb_task_next(d, now_us, out);
        if (d->finishing == was_finishing)
            break;
    }
    if (d->link == LINK_UP && now_us >= d->poll_us)
        send_request(d, FB_REQUEST_STATUS, now_us, out);
}

bool fb_delivery_busy(const FbDelivery *d)
{
    return d->busy;
}

const FbStatus *fb_delivery_status(const FbDelivery *d)
{
    return &d->status;
}

const FbRequest *fb_delivery_farewell(FbDelivery *d)
{
    const FbState state = d->status.state;
    if (!d->leased || !d->fresh || (state >= FB_STATE_RUNNING && state <= FB_STATE_ABORTING))
        return NULL;
    set_order(d, FB_COMMAND_RELEASE);
    d->request.n = fb_wire_put_order(d->request.bytes, &d->order);
    d->request.kind = FB_REQUEST_COMMAND;
    return &d->request;
}

void fb_delivery_set_token(FbDelivery *d, uint64_t token)
{
    d->options.token = token;
}

FbDelivery *fb_delivery_new(const FbDeliveryOptions *options, int64_t now_us)
{
    FbDelivery *d = g_new0(FbDelivery, 1);
    d->options = *options;
    d->status.state = FB_STATE_UNKNOWN;
    d->deadline_us = d->lost_us = now_us;
    return d;
}

void fb_delivery_free(FbDelivery *d)
{
    if (!d)
        return;
    g_free(d->why);
    g_clear_error(&d->outcome);
    g_bytes_unref(d->program);
    g_free(d->table);
    g_free(d);
}
