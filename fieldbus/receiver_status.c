/* SPDX-License-Identifier: Apache-2.0 */
/* What a receiver publishes, and what its machine may ask it. */
#include <string.h>

#include "fieldbus/receiver_state.h"

static uint32_t lease_ms(const FbReceiver *r, int64_t now_us)
{
    const int64_t left_us = r->heard_us + r->options.lease_timeout_us - now_us;
    return r->lease_token ? (uint32_t)CLAMP(left_us / 1000, 0, UINT32_MAX) : 0;
}

void fb_receiver_publish(const FbReceiver *r, FbCarrier carrier, int64_t now_us, FbStatus *s)
{
    const FbStore *store = &r->store;
    *s = (FbStatus){
        .protocol_version = FB_PROTOCOL_VERSION,
        .state = r->state,
        .epoch = r->options.epoch,
        .transfer = store->transfer,
        .length = store->length,
        .received = store->transfer ? fb_store_received(store) : 0,
        .may_send_to = fb_store_may_send_to(store),
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
        .window_max = carrier.window_max,
        .window = CLAMP(store->open.window, 1, carrier.window_max),
        .chunk_max = carrier.chunk_max,
        .alarm_code = r->alarm_code,
        .alarm_serial = r->alarm_serial,
        .feed_override_percent = r->overrides.feed_percent,
        .rapid_override_percent = r->overrides.rapid_percent,
        .spindle_override_percent = r->overrides.spindle_percent,
        .optional_stop = r->overrides.optional_stop,
        .line = r->progress.line,
        .executed_blocks = r->progress.executed_blocks,
        .tool = r->progress.tool,
        .feed_mm_min = r->progress.feed_mm_min,
        .spindle_rpm = r->progress.spindle_rpm,
        .program_time_ms = r->progress.program_time_ms,
        .heartbeat = r->heartbeat,
        .gate = r->progress.gate,
        .stop_line = r->progress.stop_line,
        .drip = store->drip,
        .starving = r->progress.starving,
        .starved = r->progress.starved,
        .starved_ms = r->progress.starved_ms,
        .released = fb_store_released(store),
        .memory_bytes = r->options.memory_bytes,
        .setup_serial = r->setup.serial,
        .n_tools = r->setup.n_tools,
        .work_offset = r->progress.work_offset,
    };
    memcpy(s->position_mm, r->progress.position_mm, sizeof s->position_mm);
    memcpy(s->id, store->open.id, sizeof s->id);
    memcpy(s->sha256, store->sha256, sizeof s->sha256);
    memcpy(s->alarm_text, r->alarm_text, sizeof s->alarm_text);
    memcpy(s->alarm_advice, r->alarm_advice, sizeof s->alarm_advice);
}

void fb_receiver_status(const FbReceiver *r, int64_t now_us, FbStatus *s)
{
    fb_receiver_publish(r, (FbCarrier){FB_CHUNK_BYTES, FB_WINDOW_MOST}, now_us, s);
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

bool fb_receiver_drips(const FbReceiver *r)
{
    return r->store.drip;
}

size_t fb_receiver_released(const FbReceiver *r)
{
    return r->store.n_released;
}

GBytes *fb_receiver_pass(const FbReceiver *r, size_t pass)
{
    return fb_store_pass(&r->store, pass);
}

uint32_t fb_receiver_restart_gate(const FbReceiver *r)
{
    return r->restart_gate;
}

FbArguments fb_receiver_overrides(const FbReceiver *r)
{
    return r->overrides;
}

const FbSetup *fb_receiver_setup(const FbReceiver *r)
{
    return &r->setup;
}

const uint64_t *fb_receiver_counts(const FbReceiver *r)
{
    return r->counts;
}
