/* SPDX-License-Identifier: Apache-2.0 */
/* The machine's side of docs/protocol.md as a state machine; the tables below are its section 3. */
#include "fieldbus/receiver.h"

#include <string.h>

#include "fieldbus/store.h"

enum {
    N_RECORDS = 32,
    N_STATES = FB_STATE_ESTOP + 1,
    N_EVENTS = FB_MACHINE_ACKNOWLEDGED + 1,
    HEARTBEAT_US = 500000,
    ALARM_GATES = 1,
};

/* The last command of a session, and what became of it. */
typedef struct {
    uint32_t session, seq, crc;
    FbCommand command;
    FbAnswer answer;
    uint64_t used; /* ascending: who is longest unused */
} Record;

struct FbReceiver {
    FbReceiverOptions options;
    FbState state;
    bool verified; /* what the store holds is ready to run */
    FbStore store;
    uint32_t transfers; /* handles given */

    uint64_t lease_token; /* 0: free */
    uint32_t lease_session;
    int64_t heard_us; /* the owner's last sign of life */
    bool agent_lost;
    bool needs_acknowledge;

    Record records[N_RECORDS];
    uint64_t n_used;
    Record last; /* as published */
    uint32_t verify_session;
    FbAnswer chunk_answer;

    uint32_t run;
    FbRunEnd run_end;
    uint16_t alarm_code, alarm_serial;
    char alarm_text[FB_TEXT_BYTES], alarm_advice[FB_TEXT_BYTES];
    FbProgress progress;
    uint32_t heartbeat;
    int64_t heartbeat_us; /* when it counts next */
    uint64_t counts[FB_N_ANSWERS];
};

static FbAnswer take_order(FbReceiver *r, const uint8_t *bytes, size_t n, int64_t now_us,
                           GArray *actions);
static FbAnswer take_chunk(FbReceiver *r, const uint8_t *bytes, size_t n);
static FbAnswer take_beat(FbReceiver *r, const uint8_t *bytes, size_t n, int64_t now_us);
static void watch_agent(FbReceiver *r, int64_t now_us, GArray *actions);

FbAnswer fb_receiver_write(FbReceiver *r, FbBlock block, const uint8_t *bytes, size_t n,
                           int64_t now_us, GArray *actions)
{
    FbAnswer answer = FB_ANSWER_MALFORMED;
    watch_agent(r, now_us, actions);
    switch (block) {
    case FB_BLOCK_COMMAND:
        answer = take_order(r, bytes, n, now_us, actions);
        break;
    case FB_BLOCK_CHUNK:
        answer = r->chunk_answer = take_chunk(r, bytes, n);
        break;
    case FB_BLOCK_BEAT:
        answer = take_beat(r, bytes, n, now_us);
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

static bool is_run(FbState state)
{
    return state >= FB_STATE_RUNNING && state <= FB_STATE_ABORTING;
}

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

static FbAnswer take_beat(FbReceiver *r, const uint8_t *bytes, size_t n, int64_t now_us)
{
    FbBeat beat;
    const FbAnswer answer = fb_wire_get_beat(bytes, n, &beat);
    if (answer != FB_ANSWER_DONE)
        return answer;
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

enum { NO = -1, KEEP = -2 };

/* Section 3.1: state × command → the state after it; commands in the order of FbCommand. */
static const int8_t after_command[N_STATES][FB_N_COMMANDS] = {
#define S(x) FB_STATE_##x
    /*                   NONE LEASE RELEASE OPEN VERIFY START HOLD RESUME ABORT ACKNOWLEDGE CLOSE */
    [S(OFF)] = {NO, KEEP, KEEP, NO, NO, NO, NO, NO, NO, NO, NO},
    [S(IDLE)] = {NO, KEEP, KEEP, S(LOADING), NO, NO, NO, NO, NO, NO, NO},
    [S(LOADING)] = {NO, KEEP, KEEP, S(LOADING), S(VERIFYING), NO, NO, NO, NO, NO, S(IDLE)},
    [S(VERIFYING)] = {NO, KEEP, KEEP, NO, NO, NO, NO, NO, NO, NO, NO},
    [S(READY)] = {NO, KEEP, KEEP, S(LOADING), NO, S(RUNNING), NO, NO, NO, NO, S(IDLE)},
    [S(RUNNING)] = {NO, KEEP, NO, NO, NO, NO, S(HOLDING), NO, S(ABORTING), NO, NO},
    [S(HOLDING)] = {NO, KEEP, NO, NO, NO, NO, KEEP, NO, S(ABORTING), NO, NO},
    [S(HELD)] = {NO, KEEP, NO, NO, NO, NO, KEEP, S(RUNNING), S(ABORTING), NO, NO},
    [S(PROGRAM_STOP)] = {NO, KEEP, NO, NO, NO, NO, KEEP, S(RUNNING), S(ABORTING), NO, NO},
    [S(TOOL_CHANGE)] = {NO, KEEP, NO, NO, NO, NO, S(HOLDING), NO, S(ABORTING), NO, NO},
    [S(ABORTING)] = {NO, KEEP, NO, NO, NO, NO, KEEP, NO, KEEP, NO, NO},
    [S(COMPLETE)] = {NO, KEEP, KEEP, S(LOADING), NO, NO, NO, NO, NO, S(READY), S(IDLE)},
    [S(ALARM)] = {NO, KEEP, KEEP, NO, NO, NO, NO, NO, NO, NO, NO},
    [S(ESTOP)] = {NO, KEEP, KEEP, NO, NO, NO, NO, NO, NO, NO, NO},
#undef S
};

static void forget(FbReceiver *r, GArray *actions)
{
    if (r->store.program)
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
    const char *why = NULL;
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
    if (command == FB_COMMAND_START) {
        r->run++;
        r->run_end = FB_RUN_NONE;
    }
    act(actions, command == FB_COMMAND_START ? FB_DO_START : FB_DO_RESUME);
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
    case FB_COMMAND_HOLD:
    case FB_COMMAND_ABORT:
        if (changes)
            act(actions, o->command == FB_COMMAND_HOLD ? FB_DO_HOLD : FB_DO_ABORT);
        break;
    case FB_COMMAND_CLOSE:
        forget(r, actions);
        break;
    default:
        break;
    }
    return FB_ANSWER_DONE;
}

/* Section 4, steps 3 to 7. */
static FbAnswer obey(FbReceiver *r, const FbOrder *o, int64_t now_us, GArray *actions)
{
    const bool stop = o->command == FB_COMMAND_HOLD || o->command == FB_COMMAND_ABORT;
    const bool names_transfer = o->command == FB_COMMAND_VERIFY || o->command == FB_COMMAND_START ||
                                o->command == FB_COMMAND_RESUME ||
                                o->command == FB_COMMAND_ACKNOWLEDGE ||
                                o->command == FB_COMMAND_CLOSE;
    if (!stop && o->epoch != r->options.epoch)
        return FB_ANSWER_WRONG_EPOCH;
    if (!stop && o->command != FB_COMMAND_LEASE &&
        (r->lease_token == 0 || o->token != r->lease_token))
        return FB_ANSWER_NO_LEASE;
    const int8_t next = after_command[r->state][o->command];
    if (next == NO)
        return FB_ANSWER_WRONG_STATE;
    if (names_transfer && o->transfer != r->store.transfer)
        return FB_ANSWER_WRONG_TRANSFER;
    const FbAnswer answer = effect(r, o, next != KEEP, now_us, actions);
    if (next != KEEP && (answer == FB_ANSWER_DONE || answer == FB_ANSWER_NONE))
        r->state = (FbState)next;
    return answer;
}

/* The session's record; where it has none the one longest unused, but not the owner's. */
static Record *find_record(FbReceiver *r, uint32_t session)
{
    Record *oldest = NULL;
    for (Record *e = r->records; e < r->records + N_RECORDS; e++) {
        if (e->session == session)
            return e;
        const bool owner = r->lease_token != 0 && e->session == r->lease_session;
        if (!owner && (!oldest || e->used < oldest->used))
            oldest = e;
    }
    *oldest = (Record){.session = session};
    return oldest;
}

static FbAnswer take_order(FbReceiver *r, const uint8_t *bytes, size_t n, int64_t now_us,
                           GArray *actions)
{
    FbOrder o;
    FbAnswer answer = fb_wire_get_order(bytes, n, &o);
    r->last = (Record){.session = o.session, .seq = o.seq, .answer = answer};
    if (o.command < FB_N_COMMANDS)
        r->last.command = o.command;
    if (answer != FB_ANSWER_DONE)
        return answer;
    hear_agent(r, o.session, o.token, now_us);
    Record *record = find_record(r, o.session);
    record->used = ++r->n_used;
    if (o.seq < record->seq)
        return r->last.answer = FB_ANSWER_OUT_OF_SEQUENCE;
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
    for (Record *e = r->records; e < r->records + N_RECORDS; e++)
        if (e->session == r->verify_session && e->command == FB_COMMAND_VERIFY)
            e->answer = answer;
    if (r->last.session == r->verify_session && r->last.command == FB_COMMAND_VERIFY &&
        r->last.answer == FB_ANSWER_NONE)
        r->last.answer = answer;
}

/* ------------------------------------------------------------------------ chunks */

static FbAnswer take_chunk(FbReceiver *r, const uint8_t *bytes, size_t n)
{
    FbChunk chunk;
    const FbAnswer answer = fb_wire_get_chunk(bytes, n, &chunk);
    if (answer != FB_ANSWER_DONE)
        return answer;
    if (chunk.epoch != r->options.epoch)
        return FB_ANSWER_WRONG_EPOCH;
    if (r->state != FB_STATE_LOADING)
        return FB_ANSWER_WRONG_STATE;
    if (chunk.transfer != r->store.transfer)
        return FB_ANSWER_WRONG_TRANSFER;
    return fb_store_chunk(&r->store, &chunk);
}

/* ----------------------------------------------------------------------- machine */

enum { BACK = -3 };

/* Section 3.2: state × what happens at the machine → the state after it. */
static const int8_t after_event[N_STATES][N_EVENTS] = {
#define S(x) FB_STATE_##x
    /* VERIFIED REFUSED RUNNING HELD PROGRAM_STOP TOOL_CHANGE COMPLETE ABORTED ALARM ESTOP ACKN. */
    [S(OFF)] = {NO, NO, NO, NO, NO, NO, NO, NO, NO, S(ESTOP), S(IDLE)},
    [S(IDLE)] = {NO, NO, NO, NO, NO, NO, NO, NO, S(ALARM), S(ESTOP), NO},
    [S(LOADING)] = {NO, NO, NO, NO, NO, NO, NO, NO, S(ALARM), S(ESTOP), NO},
    [S(VERIFYING)] = {S(READY), S(LOADING), NO, NO, NO, NO, NO, NO, S(ALARM), S(ESTOP), NO},
    [S(READY)] = {NO, NO, NO, NO, NO, NO, NO, NO, S(ALARM), S(ESTOP), NO},
    [S(RUNNING)] = {NO, NO, NO, S(HELD), S(PROGRAM_STOP), S(TOOL_CHANGE), S(COMPLETE), S(READY),
                    S(ALARM), S(ESTOP), NO},
    [S(HOLDING)] = {NO, NO, NO, S(HELD), S(PROGRAM_STOP), NO, S(COMPLETE), S(READY), S(ALARM),
                    S(ESTOP), NO},
    [S(HELD)] = {NO, NO, S(RUNNING), NO, NO, NO, NO, S(READY), S(ALARM), S(ESTOP), NO},
    [S(PROGRAM_STOP)] = {NO, NO, S(RUNNING), NO, NO, NO, S(COMPLETE), S(READY), S(ALARM), S(ESTOP),
                         NO},
    [S(TOOL_CHANGE)] = {NO, NO, S(RUNNING), S(HELD), S(PROGRAM_STOP), NO, S(COMPLETE), S(READY),
                        S(ALARM), S(ESTOP), NO},
    [S(ABORTING)] = {NO, NO, NO, NO, NO, NO, S(COMPLETE), S(READY), S(ALARM), S(ESTOP), NO},
    [S(COMPLETE)] = {NO, NO, NO, NO, NO, NO, NO, NO, S(ALARM), S(ESTOP), NO},
    [S(ALARM)] = {NO, NO, NO, NO, NO, NO, NO, NO, NO, S(ESTOP), BACK},
    [S(ESTOP)] = {NO, NO, NO, NO, NO, NO, NO, NO, NO, NO, BACK},
#undef S
};

static FbState state_behind_alarm(const FbReceiver *r)
{
    if (r->verified)
        return FB_STATE_READY;
    return r->store.transfer ? FB_STATE_LOADING : FB_STATE_IDLE;
}

static void end_run(FbReceiver *r, FbRunEnd how)
{
    if (is_run(r->state))
        r->run_end = how;
}

static void stop_by_alarm(FbReceiver *r, const FbAlarm *alarm)
{
    end_run(r, FB_RUN_ALARM);
    if (r->state == FB_STATE_VERIFYING)
        settle_verify(r, FB_ANSWER_PROGRAM);
    r->needs_acknowledge = true;
    set_alarm(r, alarm);
}

void fb_receiver_machine(FbReceiver *r, FbMachineEvent event, const FbAlarm *alarm, int64_t now_us,
                         GArray *actions)
{
    watch_agent(r, now_us, actions);
    const int8_t next = after_event[r->state][event];
    if (event == FB_MACHINE_ACKNOWLEDGED) {
        r->needs_acknowledge = false;
        if (next != NO)
            set_alarm(r, NULL);
    }
    if (next == NO)
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
        end_run(r, FB_RUN_COMPLETE);
        break;
    case FB_MACHINE_ABORTED:
        end_run(r, FB_RUN_ABORTED);
        break;
    case FB_MACHINE_ALARM:
    case FB_MACHINE_ESTOP:
        stop_by_alarm(r, alarm);
        break;
    default:
        break;
    }
    r->state = next == BACK ? state_behind_alarm(r) : (FbState)next;
}

void fb_receiver_progress(FbReceiver *r, const FbProgress *progress)
{
    const uint64_t executed = MAX(r->progress.executed_blocks, progress->executed_blocks);
    r->progress = *progress;
    r->progress.executed_blocks = executed;
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

/* ------------------------------------------------------------------ what is published */

static uint32_t lease_ms(const FbReceiver *r, int64_t now_us)
{
    const int64_t left_us = r->heard_us + r->options.lease_timeout_us - now_us;
    return r->lease_token ? (uint32_t)CLAMP(left_us / 1000, 0, UINT32_MAX) : 0;
}

void fb_receiver_status(const FbReceiver *r, int64_t now_us, FbStatus *s)
{
    const FbStore *store = &r->store;
    *s = (FbStatus){
        .protocol_version = FB_PROTOCOL_VERSION,
        .state = r->state,
        .epoch = r->options.epoch,
        .transfer = store->transfer,
        .length = store->length,
        .received = store->transfer ? fb_store_received(store) : 0,
        .may_send_to = store->length,
        .gates = store->open.gates,
        .gates_crc = store->open.gates_crc,
        .lease_owner = (uint32_t)(r->lease_token >> 32),
        .lease_ms = lease_ms(r, now_us),
        .command_session = r->last.session,
        .command_seq = r->last.seq,
        .command = r->last.command,
        .answer = r->last.answer,
        .chunk_answer = r->chunk_answer,
        .needs_acknowledge = r->needs_acknowledge || r->state == FB_STATE_OFF,
        .agent_lost = r->agent_lost,
        .run = r->run,
        .run_end = r->run_end,
        .window_max = 1,
        .chunk_max = FB_CHUNK_BYTES,
        .alarm_code = r->alarm_code,
        .alarm_serial = r->alarm_serial,
        .feed_override_percent = 100,
        .rapid_override_percent = 100,
        .spindle_override_percent = 100,
        .line = r->progress.line,
        .executed_blocks = r->progress.executed_blocks,
        .tool = r->progress.tool,
        .feed_mm_min = r->progress.feed_mm_min,
        .spindle_rpm = r->progress.spindle_rpm,
        .program_time_ms = r->progress.program_time_ms,
        .heartbeat = r->heartbeat,
    };
    memcpy(s->position_mm, r->progress.position_mm, sizeof s->position_mm);
    memcpy(s->id, store->open.id, sizeof s->id);
    memcpy(s->sha256, store->sha256, sizeof s->sha256);
    memcpy(s->alarm_text, r->alarm_text, sizeof s->alarm_text);
    memcpy(s->alarm_advice, r->alarm_advice, sizeof s->alarm_advice);
}

FbState fb_receiver_state(const FbReceiver *r)
{
    return r->state;
}

GBytes *fb_receiver_program(const FbReceiver *r)
{
    return r->store.program;
}

const uint64_t *fb_receiver_gates(const FbReceiver *r, size_t *n)
{
    *n = r->store.gates ? r->store.open.gates : 0;
    return r->store.gates;
}

const uint64_t *fb_receiver_counts(const FbReceiver *r)
{
    return r->counts;
}

FbReceiver *fb_receiver_new(const FbReceiverOptions *options)
{
    FbReceiver *r = g_new0(FbReceiver, 1);
    g_assert(options->epoch != 0);
    r->options = *options;
    r->state = FB_STATE_OFF;
    return r;
}

void fb_receiver_free(FbReceiver *r)
{
    if (!r)
        return;
    fb_store_clear(&r->store);
    g_free(r);
}
