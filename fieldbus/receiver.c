/* SPDX-License-Identifier: Apache-2.0 */
/* The machine's side of docs/protocol.md as a state machine; fieldbus/transitions.* has its tables,
 * receiver_status.c what it publishes. */
#include "fieldbus/receiver_state.h"
#include "fieldbus/transitions.h"

enum {
    HEARTBEAT_US = 500000,
    ALARM_GATES = 1,
};

static FbAnswer take_order(FbReceiver *r, FbRole role, const uint8_t *bytes, size_t n,
                           int64_t now_us, GArray *actions);
static FbAnswer take_chunk(FbReceiver *r, FbRole role, const uint8_t *bytes, size_t n,
                           GArray *actions);
static FbAnswer take_beat(FbReceiver *r, FbRole role, const uint8_t *bytes, size_t n,
                          int64_t now_us);
static void watch_agent(FbReceiver *r, int64_t now_us, GArray *actions);

FbAnswer fb_receiver_write(FbReceiver *r, FbRole role, FbBlock block, const uint8_t *bytes,
                           size_t n, int64_t now_us, GArray *actions)
{
    FbAnswer answer = FB_ANSWER_MALFORMED;
    watch_agent(r, now_us, actions);
    switch (block) {
    case FB_BLOCK_COMMAND:
        answer = take_order(r, role, bytes, n, now_us, actions);
        break;
    case FB_BLOCK_CHUNK:
        answer = r->chunk_answer = take_chunk(r, role, bytes, n, actions);
        break;
    case FB_BLOCK_BEAT:
        answer = take_beat(r, role, bytes, n, now_us);
        break;
    }
    r->counts[answer]++;
    return answer;
}

static void act(GArray *actions, FbDo what)
{
    if (actions)
        g_array_append_val(actions, what);
}

/* ------------------------------------------------------------------- lease, agent */

/* Lapses the lease, and does what the machine file says about a lost agent. */
static void watch_agent(FbReceiver *r, int64_t now_us, GArray *actions)
{
    const int64_t silence_us = now_us - r->heard_us;
    if (r->lease_token == 0 || silence_us < r->options.agent_timeout_us)
        return;
    if (!r->agent_lost) {
        r->agent_lost = true;
        r->needs_acknowledge = true;
        const bool moves = r->state == FB_STATE_RUNNING || r->state == FB_STATE_TOOL_CHANGE;
        if (moves && r->options.on_agent_loss == CFG_AGENT_LOSS_NEXT_GATE) {
            act(actions, FB_DO_HOLD_AT_GATE);
        } else if (moves && r->options.on_agent_loss == CFG_AGENT_LOSS_HOLD) {
            r->state = FB_STATE_HOLDING;
            act(actions, FB_DO_HOLD);
        }
    }
    if (silence_us >= r->options.lease_timeout_us)
        r->lease_token = 0;
}

static void hear_agent(FbReceiver *r, uint32_t session, uint64_t token, int64_t now_us)
{
    if (token == 0 || token != r->lease_token || session != r->lease_session)
        return;
    r->heard_us = now_us;
    r->agent_lost = false;
}

static FbAnswer take_lease(FbReceiver *r, const FbOrder *o, int64_t now_us)
{
    if (o->token >> 32 == 0)
        return FB_ANSWER_MALFORMED;
    const bool same = o->token == r->lease_token;
    const bool silent = now_us - r->heard_us >= r->options.agent_timeout_us;
    if (r->lease_token != 0 && !(same && (o->session == r->lease_session || silent)))
        return FB_ANSWER_NO_LEASE;
    if (same && o->session != r->lease_session)
        r->needs_acknowledge = true;
    r->lease_token = o->token;
    r->lease_session = o->session;
    hear_agent(r, o->session, o->token, now_us);
    return FB_ANSWER_DONE;
}

static FbAnswer take_beat(FbReceiver *r, FbRole role, const uint8_t *bytes, size_t n,
                          int64_t now_us)
{
    FbBeat beat;
    const FbAnswer answer = fb_wire_get_beat(bytes, n, &beat);
    if (answer != FB_ANSWER_DONE)
        return answer;
    if (!fb_role_may(role, FB_COMMAND_LEASE))
        return FB_ANSWER_ROLE;
    hear_agent(r, beat.session, beat.token, now_us);
    return beat.token != 0 && beat.token == r->lease_token ? FB_ANSWER_DONE : FB_ANSWER_NO_LEASE;
}

/* ------------------------------------------------------------------------- alarm */

static void set_alarm(FbReceiver *r, const FbAlarm *alarm)
{
    static const FbAlarm none = {0};
    const FbAlarm *a = alarm ? alarm : &none;
    if (a->code == 0 && r->alarm_code == 0)
        return;
    r->alarm_code = a->code;
    fb_wire_text(r->alarm_text, a->text);
    fb_wire_text(r->alarm_advice, a->advice);
    r->alarm_serial++;
}

/* --------------------------------------------------------------------- commands */

static void forget(FbReceiver *r, GArray *actions)
{
    if (r->store.program || r->verified || r->state == FB_STATE_VERIFYING)
        act(actions, FB_DO_FORGET);
    fb_store_clear(&r->store);
    r->verified = false;
    set_alarm(r, NULL);
}

static FbAnswer open_transfer(FbReceiver *r, const FbOrder *o, GArray *actions)
{
    FbStore fresh = {0};
    const FbAnswer answer =
        fb_store_open(&fresh, &o->open, r->transfers + 1, r->options.memory_bytes);
    if (answer != FB_ANSWER_DONE)
        return answer;
    forget(r, actions);
    r->store = fresh;
    r->transfers++;
    r->chunk_answer = FB_ANSWER_NONE;
    return FB_ANSWER_DONE;
}

/* NONE: the machine has to examine the program. */
static FbAnswer verify(FbReceiver *r, const FbOrder *o, GArray *actions)
{
    const char *why;
    const FbAnswer answer = fb_store_verify(&r->store, &why);
    set_alarm(r, why ? &(FbAlarm){ALARM_GATES, why, "Plan the program again."} : NULL);
    if (answer != FB_ANSWER_DONE)
        return answer;
    r->verify_session = o->session;
    act(actions, FB_DO_VERIFY);
    return FB_ANSWER_NONE;
}

/* Whoever sets the machine moving has to beat from now on, or the agent is lost once more. */
static FbAnswer set_moving(FbReceiver *r, FbCommand command, int64_t now_us, GArray *actions)
{
    if (r->needs_acknowledge)
        return FB_ANSWER_NEEDS_ACKNOWLEDGE;
    r->heard_us = now_us;
    r->agent_lost = false;
    if (command != FB_COMMAND_RESUME) {
        r->run++;
        r->run_end = FB_RUN_NONE;
        r->progress.gate = 0;
    }
    act(actions, command == FB_COMMAND_START     ? FB_DO_START
                 : command == FB_COMMAND_RESTART ? FB_DO_RESTART
                                                 : FB_DO_RESUME);
    return FB_ANSWER_DONE;
}

static FbAnswer restart(FbReceiver *r, const FbOrder *o, int64_t now_us, GArray *actions)
{
    const FbStore *store = &r->store;
    if (store->drip)
        return FB_ANSWER_WRONG_STATE;
    if (o->gate == 0 || o->gate >= store->open.gates || store->gates[o->gate - 1] != o->gate_offset)
        return FB_ANSWER_GATE;
    r->restart_gate = o->gate;
    return set_moving(r, o->command, now_us, actions);
}

static FbAnswer override(FbReceiver *r, const FbArguments *a, GArray *actions)
{
    if (a->feed_percent > FB_OVERRIDE_MOST_PERCENT || a->rapid_percent > FB_RAPID_MOST_PERCENT ||
        a->spindle_percent < FB_SPINDLE_LEAST_PERCENT ||
        a->spindle_percent > FB_OVERRIDE_MOST_PERCENT)
        return FB_ANSWER_MALFORMED;
    /* A run that stands at 0 % would move. */
    const FbArguments *now = &r->overrides;
    if (r->needs_acknowledge && fb_state_runs(r->state) &&
        (a->feed_percent > now->feed_percent || a->rapid_percent > now->rapid_percent))
        return FB_ANSWER_NEEDS_ACKNOWLEDGE;
    const bool optional_stop = r->overrides.optional_stop;
    r->overrides = *a;
    r->overrides.optional_stop = optional_stop;
    act(actions, FB_DO_OVERRIDE);
    return FB_ANSWER_DONE;
}

/* What the command does beside the change of state: DONE, NONE, or why it does not. */
static FbAnswer effect(FbReceiver *r, const FbOrder *o, bool changes, int64_t now_us,
                       GArray *actions)
{
    switch (o->command) {
    case FB_COMMAND_LEASE:
        return take_lease(r, o, now_us);
    case FB_COMMAND_RELEASE:
        r->lease_token = 0;
        r->agent_lost = false;
        break;
    case FB_COMMAND_OPEN:
        return open_transfer(r, o, actions);
    case FB_COMMAND_VERIFY:
        return verify(r, o, actions);
    case FB_COMMAND_START:
    case FB_COMMAND_RESUME:
        return set_moving(r, o->command, now_us, actions);
    case FB_COMMAND_RESTART:
        return restart(r, o, now_us, actions);
    case FB_COMMAND_OVERRIDE:
        return override(r, &o->arguments, actions);
    case FB_COMMAND_OPTIONAL_STOP:
        r->overrides.optional_stop = o->arguments.optional_stop;
        act(actions, FB_DO_OPTIONAL_STOP);
        break;
    case FB_COMMAND_HOLD:
    case FB_COMMAND_ABORT:
        if (changes)
            act(actions, o->command == FB_COMMAND_HOLD ? FB_DO_HOLD : FB_DO_ABORT);
        break;
    case FB_COMMAND_CLOSE:
        forget(r, actions);
        break;
    case FB_COMMAND_ACKNOWLEDGE:
        if (r->store.drip)
            forget(r, actions);
        break;
    default:
        break;
    }
    return FB_ANSWER_DONE;
}

/* A dripped program is gone when its run is over: there is nothing to be READY with. */
static FbState without_dripped(const FbReceiver *r, FbState next)
{
    return next == FB_STATE_READY && r->store.transfer == 0 ? FB_STATE_IDLE : next;
}

/* Section 4, steps 4 to 8. */
static FbAnswer obey(FbReceiver *r, const FbOrder *o, int64_t now_us, GArray *actions)
{
    const bool stop = fb_command_stops(o->command);
    const bool names_transfer = o->command == FB_COMMAND_VERIFY || o->command == FB_COMMAND_START ||
                                o->command == FB_COMMAND_RESUME ||
                                o->command == FB_COMMAND_ACKNOWLEDGE ||
                                o->command == FB_COMMAND_RESTART || o->command == FB_COMMAND_CLOSE;
    if (!stop && o->epoch != r->options.epoch)
        return FB_ANSWER_WRONG_EPOCH;
    if (!stop && o->command != FB_COMMAND_LEASE &&
        (r->lease_token == 0 || o->token != r->lease_token))
        return FB_ANSWER_NO_LEASE;
    const int next = fb_after_command(r->state, o->command);
    if (next == FB_STAY_REFUSED)
        return FB_ANSWER_WRONG_STATE;
    if (names_transfer && o->transfer != r->store.transfer)
        return FB_ANSWER_WRONG_TRANSFER;
    const FbAnswer answer = effect(r, o, next != FB_STAY, now_us, actions);
    if (next != FB_STAY && (answer == FB_ANSWER_DONE || answer == FB_ANSWER_NONE))
        r->state = without_dripped(r, (FbState)next);
    return answer;
}

/* The session's record; where it has none the one longest unused, but not the owner's. */
static FbRecord *find_record(FbReceiver *r, uint32_t session)
{
    FbRecord *oldest = NULL;
    for (FbRecord *e = r->records; e < r->records + FB_N_RECORDS; e++) {
        if (e->session == session)
            return e;
        const bool owner = r->lease_token != 0 && e->session == r->lease_session;
        if (!owner && (!oldest || e->used < oldest->used))
            oldest = e;
    }
    *oldest = (FbRecord){.session = session};
    return oldest;
}

static FbAnswer take_order(FbReceiver *r, FbRole role, const uint8_t *bytes, size_t n,
                           int64_t now_us, GArray *actions)
{
    FbOrder o;
    FbAnswer answer = fb_wire_get_order(bytes, n, &o);
    r->last = (FbRecord){.session = o.session, .seq = o.seq, .answer = answer};
    if (o.command < FB_N_COMMANDS)
        r->last.command = o.command;
    if (answer != FB_ANSWER_DONE)
        return answer;
    if (!fb_role_may(role, o.command))
        return r->last.answer = FB_ANSWER_ROLE;
    FbRecord *record = find_record(r, o.session);
    record->used = ++r->n_used;
    if (o.seq < record->seq)
        return r->last.answer = FB_ANSWER_OUT_OF_SEQUENCE;
    hear_agent(r, o.session, o.token, now_us); /* what comes late is no sign of life */
    if (o.seq == record->seq)
        return r->last.answer = o.crc == record->crc ? record->answer : FB_ANSWER_MALFORMED;
    record->seq = o.seq;
    record->crc = o.crc;
    record->command = o.command;
    answer = record->answer = obey(r, &o, now_us, actions);
    return r->last.answer = answer;
}

/* VERIFY was answered NONE; this is what became of it. */
static void settle_verify(FbReceiver *r, FbAnswer answer)
{
    for (FbRecord *e = r->records; e < r->records + FB_N_RECORDS; e++)
        if (e->session == r->verify_session && e->command == FB_COMMAND_VERIFY)
            e->answer = answer;
    if (r->last.session == r->verify_session && r->last.command == FB_COMMAND_VERIFY &&
        r->last.answer == FB_ANSWER_NONE)
        r->last.answer = answer;
}

/* ------------------------------------------------------------------------ chunks */

/* A program that drips goes on coming in while it is run. */
static bool takes_chunks(const FbReceiver *r)
{
    return r->state == FB_STATE_LOADING ||
           (r->store.drip && (r->state == FB_STATE_READY || fb_state_runs(r->state)));
}

static FbAnswer take_chunk(FbReceiver *r, FbRole role, const uint8_t *bytes, size_t n,
                           GArray *actions)
{
    FbChunk chunk;
    FbAnswer answer = fb_wire_get_chunk(bytes, n, &chunk);
    if (answer != FB_ANSWER_DONE)
        return answer;
    if (!fb_role_may(role, FB_COMMAND_OPEN))
        return FB_ANSWER_ROLE;
    if (chunk.epoch != r->options.epoch)
        return FB_ANSWER_WRONG_EPOCH;
    if (!takes_chunks(r))
        return FB_ANSWER_WRONG_STATE;
    if (chunk.transfer != r->store.transfer)
        return FB_ANSWER_WRONG_TRANSFER;
    const size_t released = r->store.n_released;
    answer = fb_store_chunk(&r->store, &chunk);
    if (r->verified && r->store.n_released > released)
        act(actions, FB_DO_PASS);
    if ((answer == FB_ANSWER_HASH || answer == FB_ANSWER_PROGRAM) && fb_state_runs(r->state))
        act(actions, FB_DO_HOLD_AT_GATE);
    return answer;
}

/* ----------------------------------------------------------------------- machine */

static FbState state_behind_alarm(const FbReceiver *r)
{
    if (r->verified)
        return FB_STATE_READY;
    return r->store.transfer ? FB_STATE_LOADING : FB_STATE_IDLE;
}

static void end_run(FbReceiver *r, FbRunEnd how, GArray *actions)
{
    if (!fb_state_runs(r->state))
        return;
    r->run_end = how;
    if (r->store.drip && how != FB_RUN_COMPLETE)
        forget(r, actions);
}

static void stop_by_alarm(FbReceiver *r, const FbAlarm *alarm, GArray *actions)
{
    end_run(r, FB_RUN_ALARM, actions);
    if (r->state == FB_STATE_VERIFYING)
        settle_verify(r, FB_ANSWER_PROGRAM);
    r->needs_acknowledge = true;
    set_alarm(r, alarm);
}

void fb_receiver_machine(FbReceiver *r, FbMachineEvent event, const FbAlarm *alarm, int64_t now_us,
                         GArray *actions)
{
    watch_agent(r, now_us, actions);
    const int next = fb_after_event(r->state, event);
    if (event == FB_MACHINE_ACKNOWLEDGED) {
        r->needs_acknowledge = false;
        if (next != FB_STAY_REFUSED)
            set_alarm(r, NULL);
    }
    if (next == FB_STAY_REFUSED)
        return;
    switch (event) {
    case FB_MACHINE_VERIFIED:
        r->verified = true;
        settle_verify(r, FB_ANSWER_DONE);
        break;
    case FB_MACHINE_REFUSED:
        settle_verify(r, FB_ANSWER_PROGRAM);
        set_alarm(r, alarm);
        break;
    case FB_MACHINE_COMPLETE:
        end_run(r, FB_RUN_COMPLETE, actions);
        break;
    case FB_MACHINE_ABORTED:
        end_run(r, FB_RUN_ABORTED, actions);
        break;
    case FB_MACHINE_ALARM:
    case FB_MACHINE_ESTOP:
        stop_by_alarm(r, alarm, actions);
        break;
    default:
        break;
    }
    r->state = next == FB_BACK ? state_behind_alarm(r) : without_dripped(r, (FbState)next);
}

void fb_receiver_progress(FbReceiver *r, const FbProgress *progress)
{
    const uint64_t executed = MAX(r->progress.executed_blocks, progress->executed_blocks);
    r->progress = *progress;
    r->progress.executed_blocks = executed;
    if (fb_state_runs(r->state))
        fb_store_forget(&r->store, progress->gate);
}

void fb_receiver_set_setup(FbReceiver *r, const FbSetup *setup)
{
    const uint16_t serial = r->setup.serial;
    r->setup = *setup;
    r->setup.serial = serial == UINT16_MAX ? 1 : (uint16_t)(serial + 1);
}

int64_t fb_receiver_tick(FbReceiver *r, int64_t now_us, GArray *actions)
{
    watch_agent(r, now_us, actions);
    if (now_us >= r->heartbeat_us) {
        r->heartbeat++;
        r->heartbeat_us = now_us + HEARTBEAT_US;
    }
    int64_t next_us = r->heartbeat_us;
    if (r->lease_token != 0)
        next_us = MIN(next_us, r->heard_us + (r->agent_lost ? r->options.lease_timeout_us
                                                            : r->options.agent_timeout_us));
    return next_us;
}

/* -------------------------------------------------------------------------- life */

FbReceiver *fb_receiver_new(const FbReceiverOptions *options)
{
    FbReceiver *r = g_new0(FbReceiver, 1);
    g_assert(options->epoch != 0);
    r->options = *options;
    r->options.memory_bytes = MIN(options->memory_bytes, FB_STREAM_MOST);
    r->state = FB_STATE_OFF;
    r->overrides = (FbArguments){100, 100, 100, false};
    return r;
}

void fb_receiver_free(FbReceiver *r)
{
    if (!r)
        return;
    fb_store_clear(&r->store);
    g_free(r);
}
