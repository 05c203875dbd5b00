/* SPDX-License-Identifier: Apache-2.0 */
/* What a delivery asks the machine for, decided from the machine's last status. */
#include "fieldbus/delivery_task.h"

#include <string.h>

static void judge(FbDelivery *d, int64_t now_us);
static bool must_release(const FbDelivery *d);
static void deliver_next(FbDelivery *d, int64_t now_us, FbActions *out);
static void run_next(FbDelivery *d, int64_t now_us, FbActions *out);
static void command_next(FbDelivery *d, int64_t now_us, FbActions *out);

/* True where the answer to the command in question is in the status. */
static bool is_answered(const FbDelivery *d)
{
    const FbStatus *s = &d->status;
    return s->command_session == d->options.session && s->command_seq == d->order.seq &&
           s->answer != FB_ANSWER_NONE;
}

void fb_task_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    if (d->asking && is_answered(d))
        judge(d, now_us);
    if (d->finishing && d->asking && d->order.command != FB_COMMAND_RELEASE)
        d->asking = false;
    if (d->finishing && !d->asking && !must_release(d)) {
        fb_task_end(d, out);
        return;
    }
    if (now_us < d->again_us)
        return;
    if (d->asking)
        fb_delivery_send_order(d, now_us, out);
    else if (d->finishing)
        fb_delivery_ask(d, FB_COMMAND_RELEASE, now_us, out);
    else if (d->task == FB_TASK_DELIVER)
        deliver_next(d, now_us, out);
    else if (d->task == FB_TASK_RUN)
        run_next(d, now_us, out);
    else
        command_next(d, now_us, out);
}

bool fb_task_may_run(const FbDelivery *d)
{
    return d->task == FB_TASK_RUN &&
           (d->started || (d->asking && d->order.command == FB_COMMAND_START));
}

void fb_task_finish(FbDelivery *d, GError *error)
{
    d->finishing = true;
    d->outcome = error;
}

void fb_task_end(FbDelivery *d, FbActions *out)
{
    out->ended = true;
    out->task = d->task;
    out->error = g_steal_pointer(&d->outcome);
    d->busy = d->finishing = d->asking = false;
}

static const char *advice(FbState state, FbAnswer answer)
{
    if (answer != FB_ANSWER_WRONG_STATE)
        return fb_answer_advice(answer);
    if (state == FB_STATE_OFF)
        return "Switch it on and acknowledge at the machine.";
    if (state == FB_STATE_ALARM || state == FB_STATE_ESTOP)
        return "Mend the cause, then acknowledge at the machine.";
    if (state >= FB_STATE_RUNNING && state <= FB_STATE_ABORTING)
        return "A program is on: wait for its end, or abort it.";
    return fb_answer_advice(answer);
}

static bool is_own_lease(const FbDelivery *d)
{
    return d->status.lease_owner == (uint32_t)(d->options.token >> 32);
}

/* Who has the lease that was refused, and until when; caller frees. */
static char *owner_text(const FbDelivery *d)
{
    if (is_own_lease(d))
        return g_strdup(" It is another program with this agent's token that is at work with it.");
    return g_strdup_printf(" Its owner is %08x; without a sign of life it lapses in %.0f s.",
                           d->status.lease_owner, d->status.lease_ms * 1e-3);
}

static GError *refusal(const FbDelivery *d, FbCommand command, FbAnswer answer)
{
    const FbStatus *s = &d->status;
    g_autofree char *alarm = s->alarm_code ? g_strdup_printf(" Alarm %u: %s. %s", s->alarm_code,
                                                             s->alarm_text, s->alarm_advice)
                                           : NULL;
    g_autofree char *owner =
        answer == FB_ANSWER_NO_LEASE && s->lease_owner != 0 ? owner_text(d) : NULL;
    return g_error_new(FB_ERROR, FB_ERROR_REFUSED, "the machine refused %s in state %s: %s. %s%s%s",
                       fb_command_name(command), fb_state_name(s->state), fb_answer_name(answer),
                       advice(s->state, answer), owner ? owner : "", alarm ? alarm : "");
}

/* The lease is kept for the next task only by a delivery, and by who lets a run go on. */
static bool must_release(const FbDelivery *d)
{
    const bool keeps = d->task == FB_TASK_DELIVER ||
                       (d->task == FB_TASK_COMMAND && d->command == FB_COMMAND_RESUME);
    return d->leased && !(keeps && !d->outcome);
}

/* The lease of our own earlier session is given to us when the machine has not heard of that
 * session for a while. Where it lapses later than it did, by more than an answer can take, that
 * session is alive: it is another program's. */
static bool may_reclaim(FbDelivery *d, int64_t now_us)
{
    const int64_t lapses_us = now_us + (int64_t)d->status.lease_ms * 1000;
    if (d->lapses_us == 0)
        d->lapses_us = lapses_us;
    if (!is_own_lease(d) || lapses_us > d->lapses_us + d->options.reply_timeout_us ||
        now_us - d->since_us >= d->options.give_up_us)
        return false;
    d->again_us = now_us + d->options.heartbeat_us;
    return true;
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
               may_reclaim(d, now_us)) {
        return;
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
        fb_task_finish(d, refusal(d, command, answer));
    } else if (d->task == FB_TASK_COMMAND && command == d->command) {
        fb_task_finish(d, NULL);
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
        fb_delivery_ask(d, FB_COMMAND_LEASE, now_us, out);
    } else if (d->opened && s->transfer != d->transfer) {
        fb_task_finish(
            d, g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                           "another program was opened on the machine meanwhile: deliver again"));
    } else if (s->state == FB_STATE_VERIFYING) {
        d->again_us = now_us + FB_AGAIN_US;
    } else if (s->state != FB_STATE_IDLE && !holds) {
        fb_task_finish(d, refusal(d, FB_COMMAND_OPEN, FB_ANSWER_WRONG_STATE));
    } else if (!is_ours(d) || d->must_open) {
        fb_delivery_ask(d, FB_COMMAND_OPEN, now_us, out);
    } else if (s->state == FB_STATE_COMPLETE) {
        fb_delivery_ask(d, FB_COMMAND_ACKNOWLEDGE, now_us, out);
    } else if (s->state == FB_STATE_LOADING && s->received < s->length) {
        fb_delivery_send_chunk(d, now_us, out);
    } else if (s->state == FB_STATE_LOADING) {
        fb_delivery_ask(d, FB_COMMAND_VERIFY, now_us, out);
    } else if (memcmp(s->sha256, d->open.id, sizeof s->sha256) != 0) {
        fb_task_finish(d, g_error_new(FB_ERROR, FB_ERROR_PROTOCOL,
                                      "the machine is READY with another hash than the program's"));
    } else {
        d->transfer = s->transfer;
        fb_task_finish(d, NULL);
    }
}

static void run_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    if (!d->started && (d->transfer == 0 || s->transfer != d->transfer)) {
        fb_task_finish(
            d, g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                           "the machine does not hold the delivered program: deliver again"));
    } else if (!d->started) {
        fb_delivery_ask(d, d->leased ? FB_COMMAND_START : FB_COMMAND_LEASE, now_us, out);
    } else if (s->run != d->run) {
        fb_task_finish(d,
                       g_error_new(FB_ERROR, FB_ERROR_PROTOCOL,
                                   "the machine was started by somebody else (run %u, ours was %u)",
                                   s->run, d->run));
    } else if (s->run_end == FB_RUN_COMPLETE) {
        fb_task_finish(d, NULL);
    } else if (s->run_end == FB_RUN_ABORTED) {
        fb_task_finish(d, g_error_new(FB_ERROR, FB_ERROR_ABORTED, "aborted in line %u", s->line));
    } else if (s->run_end == FB_RUN_ALARM) {
        fb_task_finish(d, g_error_new(FB_ERROR, FB_ERROR_ALARM, "alarm %u in line %u: %s. %s",
                                      s->alarm_code, s->line,
                                      s->alarm_code ? s->alarm_text : "acknowledged meanwhile",
                                      s->alarm_code ? s->alarm_advice : ""));
    } else {
        d->again_us = INT64_MAX; /* the beats follow it */
    }
}

/* What needs no lease, and waits for nothing. */
static bool is_stop(FbCommand command)
{
    return command == FB_COMMAND_HOLD || command == FB_COMMAND_ABORT;
}

static void command_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const bool nobody = d->status.lease_owner == 0;
    fb_delivery_ask(d, nobody && !is_stop(d->command) ? FB_COMMAND_LEASE : d->command, now_us, out);
}

/* ---------------------------------------------------------------------- begin */

static void begin(FbDelivery *d, FbTask task, int64_t now_us)
{
    g_return_if_fail(!d->busy);
    d->busy = true;
    d->task = task;
    d->since_us = d->again_us = now_us;
    d->damaged = 0;
    d->lapses_us = 0;
    d->must_look = true;
    /* What was delivered is started on the machine that took it, or not at all. */
    d->task_epoch = d->fresh || task == FB_TASK_RUN ? d->epoch : 0;
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
    d->must_look = !is_stop(command);
}
