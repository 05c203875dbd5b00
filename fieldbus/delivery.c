/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/delivery.h"

#include <string.h>

enum {
    SHOW_US = 50000,  /* statuses that only count bytes are shown this often */
    AGAIN_US = 50000, /* asking again what is not ready yet */
    DAMAGED_MOST = 8, /* answers in a row that bring nothing forward */
};

typedef enum { LINK_DOWN, LINK_CONNECTING, LINK_WAITING, LINK_UP } Link;

struct FbDelivery {
    FbDeliveryOptions options;

    Link link;
    int64_t deadline_us; /* DOWN: to connect; CONNECTING, WAITING: to give this connection up */
    int64_t lost_us;     /* since when there is no status; meaningless while `fresh` */
    char *why;           /* the last break */
    bool fresh;          /* `status` was read on this connection */
    FbStatus status;
    uint32_t epoch;        /* of the last status */
    uint16_t alarm_serial; /* the texts in `status` belong to it */
    FbRequest request;     /* in flight, or the last one */
    int64_t poll_us, again_us, shown_us;

    bool leased; /* by this session */
    int64_t beat_us;
    uint32_t beats;

    FbOrder order; /* the last command */
    bool asking;   /* it is not answered yet */

    bool busy; /* with `task` */
    FbTask task;
    FbCommand command; /* of TASK_COMMAND */
    int64_t since_us;
    uint32_t task_epoch; /* another one ends the task; 0: none seen yet */
    bool finishing;      /* the task is over, with `outcome`, but for the release of the lease */
    GError *outcome;

    GBytes *program;
    FbOpen open;
    uint8_t *table;    /* of the gates, as on the wire */
    uint32_t transfer; /* what was delivered, or is on its way */
    bool opened;       /* by this task */
    bool must_open;    /* what the machine holds is of no use */
    uint64_t received; /* seen in this task */
    unsigned damaged;
    bool started;
    uint32_t run;
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

static void finish(FbDelivery *d, GError *error);
static void end_task(FbDelivery *d, FbActions *out);

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
        end_task(d, out);
}

static void give_up(FbDelivery *d, FbActions *out)
{
    const bool running = d->task == FB_TASK_RUN &&
                         (d->started || (d->asking && d->order.command == FB_COMMAND_START));
    const char *doubt = d->asking ? "; whether it did " : "";
    finish(d,
           g_error_new(FB_ERROR, running ? FB_ERROR_LINK_LOST : FB_ERROR_UNREACHABLE,
                       "the machine is not reachable (%s)%s%s%s%s", d->why ? d->why : "no answer",
                       doubt, d->asking ? fb_command_name(d->order.command) : "",
                       d->asking ? " is not known" : "",
                       running ? "; its state is UNKNOWN, it may be running: look at it" : ""));
    end_task(d, out);
}

/* True where the answer to the command in question is in the status. */
static bool is_answered(const FbDelivery *d)
{
    const FbStatus *s = &d->status;
    return s->command_session == d->options.session && s->command_seq == d->order.seq &&
           s->answer != FB_ANSWER_NONE;
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
        finish(d,
               g_error_new(
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
            d->again_us = now_us + AGAIN_US;
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

static void send_order(FbDelivery *d, int64_t now_us, FbActions *out)
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

/* A new command: from now on it is sent, with this number, until its answer is known. */
static void ask(FbDelivery *d, FbCommand command, int64_t now_us, FbActions *out)
{
    set_order(d, command);
    d->asking = true;
    send_order(d, now_us, out);
}

static void send_beat(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbBeat beat = {d->options.session, d->options.token, ++d->beats};
    d->request.n = fb_wire_put_beat(d->request.bytes, &beat);
    d->beat_us = now_us + d->options.heartbeat_us;
    send_request(d, FB_REQUEST_BEAT, now_us, out);
}

static void send_chunk(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    const uint64_t table_bytes = (uint64_t)d->open.gates * FB_GATE_BYTES;
    const uint64_t to = MIN(s->length, s->may_send_to);
    if (s->received >= to) { /* no credit */
        d->again_us = now_us + AGAIN_US;
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

/* -------------------------------------------------------------------- tasks */

static void finish(FbDelivery *d, GError *error)
{
    d->finishing = true;
    d->outcome = error;
}

static void end_task(FbDelivery *d, FbActions *out)
{
    out->ended = true;
    out->task = d->task;
    out->error = g_steal_pointer(&d->outcome);
    d->busy = d->finishing = d->asking = false;
}

static GError *refusal(const FbDelivery *d, FbCommand command, FbAnswer answer)
{
    const FbStatus *s = &d->status;
    const bool told = s->alarm_code != 0;
    return g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                       "the machine refused %s in state %s: %s. %s%s%s%s", fb_command_name(command),
                       fb_state_name(s->state), fb_answer_name(answer), fb_answer_advice(answer),
                       told ? " " : "", told ? s->alarm_text : "", told ? ". " : "");
}

/* The lease is kept for the next task only by a delivery, and by who lets a run go on. */
static bool must_release(const FbDelivery *d)
{
    const bool keeps = d->task == FB_TASK_DELIVER ||
                       (d->task == FB_TASK_COMMAND && d->command == FB_COMMAND_RESUME);
    return d->leased && !(keeps && !d->outcome);
}

/* What the answer to the last command means for the task. */
static void judge(FbDelivery *d, int64_t now_us)
{
    const FbStatus *s = &d->status;
    const FbCommand command = d->order.command;
    const FbAnswer answer = s->answer;
    const bool done = answer == FB_ANSWER_DONE;
    d->asking = false;
    if (command == FB_COMMAND_RELEASE)
        d->leased = false;
    if (d->finishing)
        return;
    if (command == FB_COMMAND_LEASE && done) {
        d->leased = true;
        d->beat_us = now_us + d->options.heartbeat_us;
    } else if (command == FB_COMMAND_LEASE && answer == FB_ANSWER_NO_LEASE &&
               s->lease_owner == (uint32_t)(d->options.token >> 32) &&
               now_us - d->since_us < d->options.give_up_us) {
        /* Our own earlier session: it is given to us when the machine has not heard of it. */
        d->again_us = now_us + d->options.heartbeat_us;
    } else if (command == FB_COMMAND_OPEN && done) {
        d->opened = true;
        d->must_open = false;
        d->transfer = s->transfer;
        d->received = 0;
    } else if (command == FB_COMMAND_START && done) {
        d->started = true;
        d->run = s->run;
    } else if (command == FB_COMMAND_VERIFY && !d->opened &&
               (answer == FB_ANSWER_HASH || answer == FB_ANSWER_PROGRAM)) {
        d->must_open = true; /* somebody else's remains: deliver it ourselves before judging it */
    } else if (!done) {
        finish(d, refusal(d, command, answer));
    } else if (d->task == FB_TASK_COMMAND && command == d->command) {
        finish(d, NULL);
    }
}

/* True where the machine's transfer is of this very program. */
static bool is_ours(const FbDelivery *d)
{
    const FbStatus *s = &d->status;
    return s->transfer != 0 && memcmp(s->id, d->open.id, sizeof s->id) == 0 &&
           s->gates == d->open.gates && s->gates_crc == d->open.gates_crc &&
           s->length == d->open.program_bytes + (uint64_t)d->open.gates * FB_GATE_BYTES;
}

static void deliver_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    const bool holds =
        s->state == FB_STATE_LOADING || s->state == FB_STATE_READY || s->state == FB_STATE_COMPLETE;
    if (!d->leased) {
        ask(d, FB_COMMAND_LEASE, now_us, out);
    } else if (d->opened && s->transfer != d->transfer) {
        finish(d,
               g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                           "another program was opened on the machine meanwhile: deliver again"));
    } else if (s->state == FB_STATE_VERIFYING) {
        d->again_us = now_us + AGAIN_US;
    } else if (s->state != FB_STATE_IDLE && !holds) {
        finish(d, refusal(d, FB_COMMAND_OPEN, FB_ANSWER_WRONG_STATE));
    } else if (!is_ours(d) || d->must_open) {
        ask(d, FB_COMMAND_OPEN, now_us, out);
    } else if (s->state == FB_STATE_COMPLETE) {
        ask(d, FB_COMMAND_ACKNOWLEDGE, now_us, out);
    } else if (s->state == FB_STATE_LOADING && s->received < s->length) {
        send_chunk(d, now_us, out);
    } else if (s->state == FB_STATE_LOADING) {
        ask(d, FB_COMMAND_VERIFY, now_us, out);
    } else if (memcmp(s->sha256, d->open.id, sizeof s->sha256) != 0) {
        finish(d, g_error_new(FB_ERROR, FB_ERROR_PROTOCOL,
                              "the machine is READY with another hash than the program's"));
    } else {
        d->transfer = s->transfer;
        finish(d, NULL);
    }
}

static void run_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    if (!d->started && (d->transfer == 0 || s->transfer != d->transfer)) {
        finish(d, g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                              "the machine does not hold the delivered program: deliver again"));
    } else if (!d->started) {
        ask(d, d->leased ? FB_COMMAND_START : FB_COMMAND_LEASE, now_us, out);
    } else if (s->run != d->run) {
        finish(d, g_error_new(FB_ERROR, FB_ERROR_PROTOCOL,
                              "the machine was started by somebody else (run %u, ours was %u)",
                              s->run, d->run));
    } else if (s->run_end == FB_RUN_COMPLETE) {
        finish(d, NULL);
    } else if (s->run_end == FB_RUN_ABORTED) {
        finish(d, g_error_new(FB_ERROR, FB_ERROR_ABORTED, "aborted in line %u", s->line));
    } else if (s->run_end == FB_RUN_ALARM) {
        finish(d,
               g_error_new(FB_ERROR, FB_ERROR_ALARM, "alarm %u in line %u: %s. %s", s->alarm_code,
                           s->line, s->alarm_code ? s->alarm_text : "acknowledged meanwhile",
                           s->alarm_code ? s->alarm_advice : ""));
    } else {
        d->again_us = INT64_MAX; /* the beats follow it */
    }
}

static void command_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const bool stop = d->command == FB_COMMAND_HOLD || d->command == FB_COMMAND_ABORT;
    const bool nobody = d->status.lease_owner == 0;
    ask(d, nobody && !stop ? FB_COMMAND_LEASE : d->command, now_us, out);
}

static void task_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    if (d->asking && is_answered(d))
        judge(d, now_us);
    if (d->finishing && d->asking && d->order.command != FB_COMMAND_RELEASE)
        d->asking = false;
    if (d->finishing && !d->asking && !must_release(d)) {
        end_task(d, out);
        return;
    }
    if (now_us < d->again_us)
        return;
    if (d->asking)
        send_order(d, now_us, out);
    else if (d->finishing)
        ask(d, FB_COMMAND_RELEASE, now_us, out);
    else if (d->task == FB_TASK_DELIVER)
        deliver_next(d, now_us, out);
    else if (d->task == FB_TASK_RUN)
        run_next(d, now_us, out);
    else
        command_next(d, now_us, out);
}

static void take_epoch(FbDelivery *d)
{
    if (d->epoch == d->status.epoch)
        return;
    if (d->busy && d->task_epoch != 0 && !d->finishing)
        finish(d, g_error_new(FB_ERROR, d->started ? FB_ERROR_LINK_LOST : FB_ERROR_REFUSED,
                              "the machine was restarted (epoch %08x, was %08x)%s", d->status.epoch,
                              d->epoch,
                              d->started ? " while it ran: what it did last is not known"
                                         : ": deliver again"));
    d->epoch = d->task_epoch = d->status.epoch;
    d->leased = d->started = false;
    d->transfer = 0;
    d->alarm_serial = 0;
}

static void advance(FbDelivery *d, int64_t now_us, FbActions *out)
{
    if (!d->fresh) {
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
        task_next(d, now_us, out);
        if (d->finishing == was_finishing)
            break;
    }
    if (d->link == LINK_UP && now_us >= d->poll_us)
        send_request(d, FB_REQUEST_STATUS, now_us, out);
}

static void begin(FbDelivery *d, FbTask task, int64_t now_us)
{
    g_return_if_fail(!d->busy);
    d->busy = true;
    d->task = task;
    d->since_us = d->again_us = now_us;
    d->damaged = 0;
    d->task_epoch = d->fresh ? d->epoch : 0;
    if (!d->fresh)
        d->lost_us = now_us;
    if (d->link == LINK_DOWN)
        d->deadline_us = now_us;
}

void fb_delivery_deliver(FbDelivery *d, GBytes *program, const uint64_t *gates, size_t n_gates,
                         int64_t now_us)
{
    gsize n, n_digest = sizeof d->open.id;
    const uint8_t *bytes = g_bytes_get_data(program, &n);
    begin(d, FB_TASK_DELIVER, now_us);
    g_bytes_ref(program);
    g_bytes_unref(d->program);
    d->program = program;
    g_free(d->table);
    d->table = g_malloc(n_gates * FB_GATE_BYTES);
    fb_wire_put_gates(d->table, gates, n_gates);
    d->open = (FbOpen){.program_bytes = n,
                       .gates = (uint32_t)n_gates,
                       .gates_crc = fb_wire_crc(d->table, n_gates * FB_GATE_BYTES)};
    g_autoptr(GChecksum) hash = g_checksum_new(G_CHECKSUM_SHA256);
    g_checksum_update(hash, bytes, (gssize)n);
    g_checksum_get_digest(hash, d->open.id, &n_digest);
    d->transfer = 0;
    d->received = 0;
    d->opened = d->must_open = d->started = false;
}

void fb_delivery_start(FbDelivery *d, int64_t now_us)
{
    begin(d, FB_TASK_RUN, now_us);
    d->started = false;
}

void fb_delivery_command(FbDelivery *d, FbCommand command, int64_t now_us)
{
    begin(d, FB_TASK_COMMAND, now_us);
    d->command = command;
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
