/* SPDX-License-Identifier: Apache-2.0 */
/* What a delivery asks the machine for, decided from the machine's last status. */
#include "fieldbus/delivery_task.h"

#include <string.h>

static void judge(FbDelivery *d, int64_t now_us);
static bool must_release(const FbDelivery *d);
static void deliver_next(FbDelivery *d, int64_t now_us, FbActions *out);
static void run_next(FbDelivery *d, int64_t now_us, FbActions *out);
static void command_next(FbDelivery *d, int64_t now_us, FbActions *out);
static void setup_next(FbDelivery *d, int64_t now_us, FbActions *out);
static bool is_ours(const FbDelivery *d);

/* True where the answer to the command in question is in the status. */
static bool is_answered(const FbDelivery *d)
{
    const FbStatus *s = &d->status;
    return s->command_session == d->options.session && s->command_seq == d->order.seq &&
           s->answer != FB_ANSWER_NONE;
}

/* What may set the machine in motion. */
static bool is_mover(FbCommand command)
{
    return command == FB_COMMAND_START || command == FB_COMMAND_RESTART ||
           command == FB_COMMAND_RESUME;
}

/* Long after the act, or after a stop, nobody expects the machine to move: then it is not asked to,
 * nor asked again. */
static bool is_late(const FbDelivery *d, FbCommand command, int64_t now_us)
{
    return is_mover(command) && (d->withdrawn || now_us - d->since_us > FB_MOVE_US);
}

static GError *late_error(const FbDelivery *d, FbCommand command)
{
    const char *why = d->withdrawn ? "a stop was asked for meanwhile"
                                   : "more than 3 s have passed since it was asked for";
    if (!d->asking || d->order.command != command)
        return g_error_new(FB_ERROR, FB_ERROR_REFUSED, "%s was not sent: %s; ask again",
                           fb_command_name(command), why);
    return g_error_new(
        FB_ERROR, FB_ERROR_LINK_LOST,
        "%s was sent, its answer was lost (%s), and it is not sent again: %s; whether "
        "the machine did it is not known: look at it",
        fb_command_name(command), d->why ? d->why : "damaged", why);
}

void fb_task_judge(FbDelivery *d, int64_t now_us)
{
    if (d->asking && is_answered(d))
        judge(d, now_us);
}

void fb_task_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    if (d->asking && !d->finishing && is_late(d, d->order.command, now_us))
        fb_task_finish(d, late_error(d, d->order.command));
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
    else if (d->task == FB_TASK_SETUP)
        setup_next(d, now_us, out);
    else
        command_next(d, now_us, out);
}

void fb_delivery_withdraw(FbDelivery *d)
{
    d->withdrawn =
        d->busy &&
        (d->task == FB_TASK_RUN ? !d->started : d->task == FB_TASK_COMMAND && is_mover(d->command));
}

void fb_task_give_way(FbDelivery *d, FbActions *out)
{
    if (!d->busy || !d->withdrawn || d->task != FB_TASK_COMMAND)
        return;
    if (!d->finishing)
        fb_task_finish(d, late_error(d, d->command));
    fb_task_end(d, out);
}

bool fb_task_streams(const FbDelivery *d)
{
    const FbStatus *s = &d->status;
    const bool delivers = d->task == FB_TASK_DELIVER && s->state == FB_STATE_LOADING;
    const bool drips = d->task == FB_TASK_RUN && d->started && s->drip && s->run == d->run;
    return d->leased && !d->outcome && (delivers || drips) && s->transfer == d->transfer &&
           is_ours(d);
}

void fb_task_judge_chunk(FbDelivery *d)
{
    const FbAnswer answer = d->status.chunk_answer;
    const bool hopeless = answer == FB_ANSWER_HASH || answer == FB_ANSWER_PROGRAM ||
                          answer == FB_ANSWER_ROLE ||
                          (answer == FB_ANSWER_TOO_LARGE && d->status.drip);
    if (!hopeless || !d->busy || d->finishing || d->outcome)
        return;
    GError *error =
        g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                    "the machine refused the program at byte %" G_GUINT64_FORMAT ": %s. %s",
                    d->status.received, fb_answer_name(answer), fb_answer_advice(answer));
    if (d->task == FB_TASK_RUN && d->started)
        d->outcome = error; /* it still moves, up to a gate: stay with it until it stands */
    else
        fb_task_finish(d, error);
}

bool fb_task_may_run(const FbDelivery *d)
{
    return d->task == FB_TASK_RUN &&
           (d->started || (d->asking && (d->order.command == FB_COMMAND_START ||
                                         d->order.command == FB_COMMAND_RESTART)));
}

void fb_task_finish(FbDelivery *d, GError *error)
{
    d->finishing = true;
    g_clear_error(&d->outcome);
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
    if (fb_state_runs(state))
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

/* The lease is kept for the next task only by a delivery, and by who lets a run go on; a stop never
 * took it, and who let the run go on still has to beat. */
static bool must_release(const FbDelivery *d)
{
    const bool commands = d->task == FB_TASK_COMMAND;
    if (commands && d->withdrawn)
        return false; /* the stop waits behind it */
    const bool keeps = d->task == FB_TASK_DELIVER || (commands && d->command == FB_COMMAND_RESUME);
    return d->leased && !(commands && fb_command_stops(d->command)) && !(keeps && !d->outcome);
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
    } else if ((command == FB_COMMAND_START || command == FB_COMMAND_RESTART) && done) {
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
    return s->transfer != 0 && d->table && memcmp(s->id, d->open.id, sizeof s->id) == 0 &&
           s->gates == d->open.gates && s->gates_crc == d->open.gates_crc &&
           s->length == d->open.program_bytes + d->table_bytes &&
           s->drip == (d->open.flags & FB_OPEN_DRIP);
}

static bool wants_drip(const FbDelivery *d)
{
    const uint64_t whole = fb_stored_bytes(g_bytes_get_size(d->program), d->open.gates);
    return d->options.drip == CFG_DRIP_ALWAYS ||
           (d->options.drip == CFG_DRIP_AUTO && d->status.memory_bytes != 0 &&
            whole > d->status.memory_bytes);
}

/* The table of gates as the wire wants it, and what OPEN says of it; once a task, when the
 * machine's memory is known. */
static void make_table(FbDelivery *d)
{
    FbOpen *open = &d->open;
    const uint8_t *program = g_bytes_get_data(d->program, NULL);
    open->flags = wants_drip(d) ? FB_OPEN_DRIP : 0;
    const size_t entry = fb_wire_gate_bytes(open->flags);
    d->table_bytes = open->gates * (uint64_t)entry;
    d->table = g_malloc(d->table_bytes);
    g_autoptr(GChecksum) hash = g_checksum_new(G_CHECKSUM_SHA256);
    uint64_t at = 0;
    for (uint32_t i = 0; i < open->gates; i++) {
        uint8_t digest[32];
        gsize n = sizeof digest;
        if (open->flags & FB_OPEN_DRIP) {
            g_checksum_update(hash, program + at, (gssize)(d->gates[i] - at));
            g_autoptr(GChecksum) running = g_checksum_copy(hash);
            g_checksum_get_digest(running, digest, &n);
        }
        fb_wire_put_gate(d->table + i * entry, d->gates[i],
                         open->flags & FB_OPEN_DRIP ? digest : NULL);
        at = d->gates[i];
    }
    open->gates_crc = fb_wire_crc(d->table, d->table_bytes);
    open->window = d->options.window;
}

static void deliver_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    const bool holds =
        s->state == FB_STATE_LOADING || s->state == FB_STATE_READY || s->state == FB_STATE_COMPLETE;
    if (!d->table)
        make_table(d);
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
    } else if (!is_ours(d) || d->must_open || (s->drip && s->state == FB_STATE_COMPLETE)) {
        fb_delivery_ask(d, FB_COMMAND_OPEN, now_us, out);
    } else if (s->state == FB_STATE_COMPLETE) {
        fb_delivery_ask(d, FB_COMMAND_ACKNOWLEDGE, now_us, out);
    } else if (s->state == FB_STATE_LOADING && s->received < MIN(s->length, s->may_send_to)) {
        d->transfer = s->transfer;
        fb_delivery_send_chunk(d, now_us, out);
    } else if (s->state == FB_STATE_LOADING) {
        fb_delivery_ask(d, FB_COMMAND_VERIFY, now_us, out);
    } else if (!s->drip && memcmp(s->sha256, d->open.id, sizeof s->sha256) != 0) {
        fb_task_finish(d, g_error_new(FB_ERROR, FB_ERROR_PROTOCOL,
                                      "the machine is READY with another hash than the program's"));
    } else {
        d->transfer = s->transfer;
        fb_task_finish(d, NULL);
    }
}

static void ask_in_time(FbDelivery *d, FbCommand command, int64_t now_us, FbActions *out)
{
    if (!is_late(d, command, now_us))
        fb_delivery_ask(d, command, now_us, out);
    else if (d->status.needs_acknowledge)
        fb_task_finish(d, refusal(d, command, FB_ANSWER_NEEDS_ACKNOWLEDGE));
    else
        fb_task_finish(d, late_error(d, command));
}

/* What is left of a program whose rest was refused is executed up to a gate. */
static void refused_next(FbDelivery *d)
{
    const FbStatus *s = &d->status;
    d->again_us = INT64_MAX; /* the beats follow it */
    if (s->state != FB_STATE_HELD && !s->starving)
        return;
    g_autoptr(GError) refused = g_steal_pointer(&d->outcome);
    fb_task_finish(d, g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                                  "%s The machine stands at a gate (%s) and the run is still on: "
                                  "abort it.",
                                  refused->message, fb_state_name(s->state)));
}

static void run_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const FbStatus *s = &d->status;
    GError *why = NULL;
    if (d->stored && !d->started && d->transfer == 0 && s->state == FB_STATE_READY &&
        (!d->wanted.id || memcmp(s->id, d->wanted.id, sizeof s->id) == 0))
        d->transfer = s->transfer;
    if (!d->started && (d->transfer == 0 || s->transfer != d->transfer)) {
        fb_task_finish(
            d, g_error_new(FB_ERROR, FB_ERROR_REFUSED,
                           "the machine (%s) does not hold the program that is meant, ready to "
                           "start: deliver again",
                           fb_state_name(s->state)));
    } else if (!d->started) {
        const FbCommand start =
            d->stored && d->wanted.gate > 0 ? FB_COMMAND_RESTART : FB_COMMAND_START;
        ask_in_time(d, d->leased ? start : FB_COMMAND_LEASE, now_us, out);
    } else if (fb_run_ended(s, d->epoch, d->run, &why)) {
        fb_task_finish(d, why);
    } else if (d->outcome) {
        refused_next(d);
    } else if (s->drip && s->received < MIN(s->length, s->may_send_to) && is_ours(d)) {
        fb_delivery_send_chunk(d, now_us, out);
    } else if (s->drip && s->received < s->length && is_ours(d)) {
        /* The next gate brings new credit: a beat would tell of it too late. */
        d->poll_us = MIN(d->poll_us, now_us + FB_AGAIN_US);
        d->again_us = d->poll_us;
    } else {
        d->again_us = INT64_MAX; /* the beats follow it */
    }
}

/* The offsets, then page by page the tools; from the beginning where they change meanwhile. */
static void setup_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const unsigned pages = (d->status.n_tools + FB_TOOLS_A_PAGE - 1u) / FB_TOOLS_A_PAGE;
    if (d->status.setup_serial == 0) { /* it publishes none of this */
        d->setup = (FbSetup){0};
        d->setup_known = true;
        fb_task_finish(d, NULL);
        return;
    }
    if (d->setup.serial != d->status.setup_serial)
        d->pages = 0;
    if (d->pages == 0)
        fb_delivery_send_read(d, FB_REQUEST_OFFSETS, 0, now_us, out);
    else if (d->pages <= pages)
        fb_delivery_send_read(d, FB_REQUEST_TOOLS, d->pages - 1, now_us, out);
    else {
        d->setup.n_tools = d->status.n_tools;
        d->setup_known = true;
        fb_task_finish(d, NULL);
    }
}

static void command_next(FbDelivery *d, int64_t now_us, FbActions *out)
{
    const bool nobody = d->status.lease_owner == 0;
    ask_in_time(d, nobody && !fb_command_stops(d->command) ? FB_COMMAND_LEASE : d->command, now_us,
                out);
}

/* ---------------------------------------------------------------------- begin */

static void begin(FbDelivery *d, FbTask task, int64_t now_us)
{
    g_assert(!d->busy);
    d->busy = true;
    d->task = task;
    d->since_us = d->again_us = now_us;
    d->withdrawn = false;
    d->damaged = 0;
    d->farewells = 0;
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
    g_free(d->gates);
    d->gates = g_memdup2(gates, n_gates * sizeof *gates);
    g_clear_pointer(&d->table, g_free);
    d->open = (FbOpen){.program_bytes = n, .gates = (uint32_t)n_gates};
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
    d->started = d->stored = false;
}

void fb_delivery_start_stored(FbDelivery *d, const FbStored *stored, int64_t now_us)
{
    begin(d, FB_TASK_RUN, now_us);
    d->started = false;
    d->stored = true;
    d->transfer = 0;
    d->task_epoch = 0;
    d->wanted = *stored;
    if (stored->id) {
        memcpy(d->wanted_id, stored->id, sizeof d->wanted_id);
        d->wanted.id = d->wanted_id;
    }
}

void fb_delivery_command(FbDelivery *d, FbCommand command, const FbArguments *arguments,
                         int64_t asked_us, int64_t now_us)
{
    begin(d, FB_TASK_COMMAND, now_us);
    d->since_us = asked_us;
    d->command = command;
    d->must_look = !fb_command_stops(command);
    if (arguments)
        d->arguments = *arguments;
}

void fb_delivery_read_setup(FbDelivery *d, int64_t now_us)
{
    begin(d, FB_TASK_SETUP, now_us);
    d->pages = 0;
    d->setup_known = false;
}
