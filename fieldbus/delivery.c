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
static void count_damage(FbDelivery *d, const char *what);
static int64_t wake_us(const FbDelivery *d);

/* When this connection, or the attempt at one, is given up. */
static int64_t patience_us(const FbDelivery *d)
{
    if (d->link == LINK_CONNECTING)
        return d->deadline_us;
    return d->n_flights > 0 ? d->flights[0].deadline_us : INT64_MAX;
}

void fb_delivery_step(FbDelivery *d, const FbEvent *event, int64_t now_us, FbActions *out)
{
    *out = (FbActions){0};
    switch (event->kind) {
    case FB_EVENT_CONNECTED:
        if (d->link == LINK_CONNECTING)
            d->link = LINK_UP;
        break;
    case FB_EVENT_REPLY:
        take_reply(d, event, now_us, out);
        break;
    case FB_EVENT_NEWS:
        d->poll_us = d->again_us = now_us;
        break;
    case FB_EVENT_ALIVE:
        d->poll_us = now_us + d->options.heartbeat_us;
        break;
    case FB_EVENT_BROKEN:
        break_link(d, event->why, now_us, out);
        break;
    case FB_EVENT_TICK:
        if (now_us >= patience_us(d))
            break_link(d, "no answer in time", now_us, out);
        break;
    }
    if (d->link == LINK_DOWN && d->busy && now_us - d->lost_us >= d->options.give_up_us)
        give_up(d, out);
    if (d->link != LINK_UP)
        fb_task_give_way(d, out);
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
    if (d->link == LINK_CONNECTING)
        return d->deadline_us;
    if (d->link == LINK_DOWN)
        return d->busy ? MIN(d->deadline_us, d->lost_us + d->options.give_up_us) : d->deadline_us;
    if (d->n_flights > 0)
        return patience_us(d);
    const int64_t idle_us = d->leased ? MIN(d->poll_us, d->beat_us) : d->poll_us;
    return d->busy ? MIN(idle_us, d->again_us) : idle_us;
}

/* ---------------------------------------------------------------------- the link */

static void send_request(FbDelivery *d, FbRequestKind kind, int64_t now_us, FbActions *out)
{
    d->request.kind = kind;
    d->flights[d->n_flights++] = (FbFlight){kind, now_us + d->options.reply_timeout_us};
    d->poll_us = now_us + d->options.heartbeat_us;
    out->request = &d->request;
}

void fb_delivery_send_read(FbDelivery *d, FbRequestKind kind, unsigned page, int64_t now_us,
                           FbActions *out)
{
    d->request.page = page;
    d->request.n = 0;
    send_request(d, kind, now_us, out);
}

/* A machine that can be read, but breaks the connection at whatever the task asks, is not tried for
 * ever. The beats of a run ask for nothing: it is followed all the same. */
static void count_break(FbDelivery *d, const char *why)
{
    const FbRequestKind oldest = d->n_flights > 0 ? d->flights[0].kind : FB_REQUEST_STATUS;
    if (oldest != FB_REQUEST_STATUS && (oldest != FB_REQUEST_BEAT || d->task != FB_TASK_RUN))
        count_damage(d, why);
}

static void break_link(FbDelivery *d, const char *why, int64_t now_us, FbActions *out)
{
    if (d->link == LINK_DOWN)
        return;
    count_break(d, why);
    g_free(d->why);
    d->why = g_strdup(why);
    if (d->fresh)
        d->lost_us = now_us;
    out->close = true;
    out->show |= d->status.state != FB_STATE_UNKNOWN;
    d->status.state = FB_STATE_UNKNOWN;
    d->fresh = false;
    d->link = LINK_DOWN;
    d->n_flights = 0;
    d->sent_to = 0;
    d->go_back = false;
    d->deadline_us = now_us + d->options.reconnect_us;
    /* Without the RELEASE the next start wants a person: it is worth one more connection. */
    if (d->finishing && (!d->leased || d->farewells++ > 0))
        fb_task_end(d, out);
}

/* Why the task cannot go on, and what is not known then of the command and of the run. */
static GError *doubt(const FbDelivery *d, FbError error, const char *what)
{
    const bool running = fb_task_may_run(d);
    return g_error_new(FB_ERROR, (int)(running ? FB_ERROR_LINK_LOST : error), "%s%s%s%s%s", what,
                       d->asking ? "; whether it did " : "",
                       d->asking ? fb_command_name(d->order.command) : "",
                       d->asking ? " is not known" : "",
                       running ? "; its state is UNKNOWN, it may be running: look at it" : "");
}

static void give_up(FbDelivery *d, FbActions *out)
{
    g_autofree char *what =
        g_strdup_printf("the machine is not reachable (%s)", d->why ? d->why : "no answer");
    if (!d->finishing)
        fb_task_finish(d, doubt(d, FB_ERROR_UNREACHABLE, what));
    fb_task_end(d, out);
}

static bool show_now(const FbDelivery *d, const FbStatus *before, int64_t now_us)
{
    const FbStatus *s = &d->status;
    if (s->alarm_code != 0 && s->alarm_serial != d->alarm_serial)
        return false; /* with its text, which is read next */
    return d->answered != FB_REQUEST_CHUNK || s->state != before->state ||
           s->transfer != before->transfer || now_us >= d->shown_us + SHOW_US;
}

/* What is asked for again and again, and brings nothing forward, ends the task; `what` happens to
 * it, or NULL: it did bring the task forward. */
static void count_damage(FbDelivery *d, const char *what)
{
    d->damaged = what ? d->damaged + 1 : 0;
    if (!d->busy || d->finishing || d->damaged <= DAMAGED_MOST)
        return;
    g_autofree char *text =
        g_strdup_printf("the machine answers but takes nothing any more (%s; it has "
                        "%" G_GUINT64_FORMAT " bytes): check the line and the machine's log",
                        what, d->status.received);
    fb_task_finish(d, doubt(d, FB_ERROR_PROTOCOL, text));
}

/* What was read belongs to another serial than the status: between two reads the machine changed
 * it, which is no damage. True: look at the status, then read again. */
static bool look_again(FbDelivery *d)
{
    d->must_look = true;
    d->pages = 0;
    count_damage(d, "what it publishes changes from read to read");
    return d->damaged <= DAMAGED_MOST;
}

static bool take_alarm(FbDelivery *d, const FbEvent *event)
{
    FbStatus read = d->status;
    if (!fb_wire_get_alarm(event->bytes, event->n, &read))
        return false;
    if (read.alarm_serial != d->status.alarm_serial || read.alarm_code != d->status.alarm_code)
        return look_again(d);
    d->status = read;
    d->alarm_serial = read.alarm_serial;
    if (d->task != FB_TASK_SETUP)
        count_damage(d, NULL);
    return true;
}

static bool take_setup(FbDelivery *d, const FbEvent *event)
{
    FbSetup read = d->setup;
    const bool tools = d->answered == FB_REQUEST_TOOLS;
    if (tools ? !fb_wire_get_tools(event->bytes, event->n, d->pages - 1, &read)
              : !fb_wire_get_offsets(event->bytes, event->n, &read))
        return false;
    if (read.serial != d->status.setup_serial || (tools && read.n_tools != d->status.n_tools))
        return look_again(d);
    d->setup = read;
    d->pages++;
    return true;
}

static bool decode(FbDelivery *d, const FbEvent *event)
{
    switch (d->answered) {
    case FB_REQUEST_ALARM:
        return take_alarm(d, event);
    case FB_REQUEST_OFFSETS:
    case FB_REQUEST_TOOLS:
        return take_setup(d, event);
    case FB_REQUEST_CHUNK:
        if (event->n == FB_ACK_BYTES)
            return fb_wire_get_ack(event->bytes, event->n, &d->status);
        break;
    default:
        break;
    }
    FbStatus fresh = d->status; /* keeps the texts */
    if (!fb_wire_get_status(event->bytes, event->n, &fresh))
        return false;
    d->status = fresh;
    if (fresh.alarm_code == 0)
        d->status.alarm_text[0] = d->status.alarm_advice[0] = 0;
    return true;
}

static void take_reply(FbDelivery *d, const FbEvent *event, int64_t now_us, FbActions *out)
{
    if (d->link != LINK_UP || d->n_flights == 0)
        return;
    const FbStatus before = d->status;
    d->answered = d->flights[0].kind;
    memmove(d->flights, d->flights + 1, --d->n_flights * sizeof *d->flights);
    if (!decode(d, event)) {
        break_link(d, "an answer that the protocol does not allow", now_us, out);
        return;
    }
    const FbStatus *s = &d->status;
    const bool command = d->answered == FB_REQUEST_COMMAND;
    const bool damaged = command && s->command_session == 0;
    if (command && !damaged &&
        (s->command_session != d->options.session || s->command_seq != d->order.seq)) {
        break_link(d, "an answer to another command", now_us, out);
        return;
    }
    d->fresh = true;
    d->again_us = now_us;
    if (command) {
        count_damage(d, damaged ? fb_answer_name(s->answer) : NULL);
        if (damaged && d->finishing)
            d->leased = false; /* it will lapse */
        if (damaged || s->answer == FB_ANSWER_NONE)
            d->again_us = now_us + FB_AGAIN_US;
    } else if (d->answered == FB_REQUEST_CHUNK) {
        /* One that was lost makes all behind it gaps: together they are one damage. */
        if (!d->go_back)
            count_damage(d, s->received > d->received ? NULL : fb_answer_name(s->chunk_answer));
        d->received = MAX(d->received, s->received);
        d->go_back |= s->chunk_answer != FB_ANSWER_DONE;
        /* An ACK does not say what has become of the run, or of the lease. */
        d->must_look |= s->chunk_answer != FB_ANSWER_DONE && event->n == FB_ACK_BYTES;
        fb_task_judge_chunk(d);
    } else if (d->transfer != 0 && s->transfer == d->transfer && s->received > d->received) {
        count_damage(d, NULL); /* it was taken, although the answer was lost */
        d->received = s->received;
    }
    if (d->n_flights == 0) {
        d->sent_to = 0;
        d->go_back = false;
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
        .gate = d->wanted.gate,
        .gate_offset = d->wanted.gate_offset,
        .arguments = d->arguments,
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

/* Bytes of the stream: the table of gates, then the program. */
static void copy_stream(const FbDelivery *d, uint64_t offset, uint8_t *to, size_t n)
{
    const uint8_t *program = g_bytes_get_data(d->program, NULL);
    const size_t table = offset < d->table_bytes ? MIN(n, d->table_bytes - offset) : 0;
    if (table > 0)
        memcpy(to, d->table + offset, table);
    if (n > table)
        memcpy(to + table, program + (offset + table - d->table_bytes), n - table);
}

void fb_delivery_send_chunk(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    const uint64_t from = MAX(d->sent_to, s->received);
    const uint64_t to = MIN(s->length, s->may_send_to);
    if (from >= to) { /* no credit, or all is on its way */
        d->again_us = now_us + FB_AGAIN_US;
        return;
    }
    uint8_t bytes[FB_CHUNK_BYTES];
    const FbChunk chunk = {.epoch = d->epoch,
                           .transfer = s->transfer,
                           .offset = from,
                           .length = (uint16_t)MIN(to - from, MIN(s->chunk_max, d->chunk_most)),
                           .bytes = bytes};
    copy_stream(d, from, bytes, chunk.length);
    d->sent_to = from + chunk.length;
    d->request.n = fb_wire_put_chunk(d->request.bytes, &chunk);
    send_request(d, FB_REQUEST_CHUNK, now_us, out);
}

/* Another epoch ends the task: it belongs to the one in which the machine was first looked at. */
static void take_epoch(FbDelivery *d)
{
    if (d->epoch == d->status.epoch) {
        if (d->task_epoch == 0 && !d->must_look)
            d->task_epoch = d->epoch;
        return;
    }
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

/* Requests that may be in flight now. */
static unsigned window(const FbDelivery *d)
{
    const unsigned granted = MIN(d->status.window, d->status.window_max);
    return MIN(MIN(d->options.window, FB_WINDOW_MOST), granted);
}

static bool only_chunks(const FbDelivery *d)
{
    for (unsigned i = 0; i < d->n_flights; i++)
        if (d->flights[i].kind != FB_REQUEST_CHUNK && d->flights[i].kind != FB_REQUEST_BEAT)
            return false;
    return true;
}

static void advance(FbDelivery *d, int64_t now_us, FbActions *out)
{
    if (d->n_flights > 0 && (d->n_flights >= window(d) || !only_chunks(d)))
        return;
    if (d->fresh)
        take_epoch(d);
    const bool alarm = d->status.alarm_code != 0 && d->status.alarm_serial != d->alarm_serial;
    if (!d->fresh || d->must_look || alarm) {
        const bool look = !d->fresh || d->must_look;
        if (d->n_flights > 0)
            return;
        d->must_look = false;
        fb_delivery_send_read(d, look ? FB_REQUEST_STATUS : FB_REQUEST_ALARM, 0, now_us, out);
        return;
    }
    fb_task_judge(d, now_us);
    if (d->leased && now_us >= d->beat_us) {
        send_beat(d, now_us, out);
        out->more = true;
        return;
    }
    if (d->n_flights > 0) { /* only more of the same may join them */
        if (d->busy && !d->finishing && !d->asking && !d->go_back && fb_task_streams(d)) {
            fb_delivery_send_chunk(d, now_us, out);
            out->more = out->request != NULL;
        }
        return;
    }
    while (d->busy && d->n_flights == 0 && !out->ended) {
        const bool was_finishing = d->finishing;
        fb_task_next(d, now_us, out);
        if (d->finishing == was_finishing)
            break;
    }
    if (d->link == LINK_UP && d->n_flights == 0 && now_us >= d->poll_us)
        fb_delivery_send_read(d, FB_REQUEST_STATUS, 0, now_us, out);
    out->more = out->request && out->request->kind == FB_REQUEST_CHUNK;
}

unsigned fb_request_register(const FbRequest *request)
{
    switch (request->kind) {
    case FB_REQUEST_ALARM:
        return FB_AT_ALARM;
    case FB_REQUEST_OFFSETS:
        return FB_AT_OFFSETS;
    case FB_REQUEST_TOOLS:
        return FB_AT_TOOLS + request->page * FB_TOOLS_PAGE_REGISTERS;
    default:
        return FB_AT_STATUS;
    }
}

bool fb_delivery_busy(const FbDelivery *d)
{
    return d->busy;
}

const FbStatus *fb_delivery_status(const FbDelivery *d)
{
    return &d->status;
}

const char *fb_delivery_why(const FbDelivery *d)
{
    return d->why;
}

const FbSetup *fb_delivery_setup(const FbDelivery *d)
{
    return d->setup_known ? &d->setup : NULL;
}

const FbRequest *fb_delivery_farewell(FbDelivery *d)
{
    /* Whether a run is on the machine knows better: the status may be older than its end. */
    if (!d->leased || !d->fresh)
        return NULL;
    set_order(d, FB_COMMAND_RELEASE);
    d->request.n = fb_wire_put_order(d->request.bytes, &d->order);
    d->request.kind = FB_REQUEST_COMMAND;
    return &d->request;
}

uint32_t fb_delivery_session(const FbDelivery *d)
{
    return d->options.session;
}

void fb_delivery_limit_chunks(FbDelivery *d, uint16_t bytes)
{
    d->chunk_most = bytes;
}

void fb_delivery_set_token(FbDelivery *d, uint64_t token)
{
    d->options.token = token;
}

FbDelivery *fb_delivery_new(const FbDeliveryOptions *options, int64_t now_us)
{
    FbDelivery *d = g_new0(FbDelivery, 1);
    d->options = *options;
    d->chunk_most = FB_CHUNK_BYTES;
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
    g_free(d->gates);
    g_free(d->table);
    g_free(d);
}
