/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An agent's FbDelivery and a machine's FbReceiver in memory, on a clock of the test's, with a bus
 * between them that does one fault (or two) to the n-th request and what belongs to it.
 */
#ifndef TESTS_UNIT_FIELDBUS_BUS_H
#define TESTS_UNIT_FIELDBUS_BUS_H

#include "fieldbus/delivery.h"
#include "tests/unit/fieldbus_rig.h"

typedef enum {
    FAULT_NONE,
    FAULT_REQUEST_LOST,
    FAULT_REPLY_LOST,
    FAULT_REQUEST_TWICE,
    FAULT_REQUEST_DAMAGED,
    FAULT_REPLY_DAMAGED,
    FAULT_CLOSED_BEFORE, /* the machine never sees the request */
    FAULT_CLOSED_AFTER,  /* the agent never sees the reply */
    FAULT_REQUEST_LATE,  /* arrives when the agent is on a new connection */
    FAULT_REPLY_LATE,
    FAULT_REBOOT_BEFORE, /* the machine starts again: new epoch, nothing in memory */
    FAULT_REBOOT_AFTER,
    FAULT_AGENT_KILLED, /* a new one begins from the start, with the same token */
    N_FAULTS
} FaultKind;

typedef struct {
    FaultKind kind;
    unsigned at;  /* request, counted from 0 */
    unsigned bit; /* of a damaged block, modulo its size */
} Fault;

typedef struct {
    int64_t at_us;
    bool to_machine;
    unsigned connection;
    FbRequest request; /* a reply's block is in there too */
} Frame;

typedef struct {
    int64_t now_us;
    FbDelivery *delivery;
    FbReceiver *receiver;
    GArray *actions; /* of FbDo */
    GArray *frames;  /* of Frame, on their way */
    int64_t wake_us, tick_us;
    int64_t connect_us; /* when a connect succeeds; INT64_MAX: none is on its way */
    unsigned connection, requests;
    Fault faults[2];
    bool dead; /* the machine answers nobody */

    uint32_t epoch;
    int64_t run_ends_us; /* INT64_MAX: nothing runs */
    int64_t run_us;      /* how long a run takes */
    unsigned starts, kills, holds_at_gate;
    GBytes *executed; /* what the last start ran */

    bool ended[3];
    GError *error; /* of the last task */
    unsigned shown_unknown;
} Bus;

static const int64_t BUS_LATENCY_US = 1000;

static inline void bus_boot(Bus *b)
{
    const FbReceiverOptions options = {.epoch = ++b->epoch,
                                       .memory_bytes = 1 << 20,
                                       .on_agent_loss = CFG_AGENT_LOSS_NEXT_GATE,
                                       .agent_timeout_us = 5 * G_USEC_PER_SEC,
                                       .lease_timeout_us = 30 * G_USEC_PER_SEC};
    fb_receiver_free(b->receiver);
    b->receiver = fb_receiver_new(&options);
    b->run_ends_us = INT64_MAX;
    b->tick_us = b->now_us;
}

static inline void bus_agent(Bus *b)
{
    const FbDeliveryOptions options = {.session = 100 + b->kills,
                                       .token = RIG_TOKEN,
                                       .reply_timeout_us = 1000000,
                                       .reconnect_us = 500000,
                                       .give_up_us = 30000000,
                                       .heartbeat_us = 500000};
    fb_delivery_free(b->delivery);
    b->delivery = fb_delivery_new(&options, b->now_us);
    b->wake_us = b->now_us;
    b->connection++;
    b->connect_us = INT64_MAX;
}

static inline Bus *bus_new(Fault first, Fault second)
{
    Bus *b = g_new0(Bus, 1);
    b->now_us = 1000000;
    b->actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    b->frames = g_array_new(FALSE, FALSE, sizeof(Frame));
    b->faults[0] = first;
    b->faults[1] = second;
    b->run_us = 2000000;
    b->epoch = 500;
    bus_boot(b);
    bus_agent(b);
    fb_receiver_machine(b->receiver, FB_MACHINE_ACKNOWLEDGED, NULL, b->now_us, b->actions);
    return b;
}

static inline void bus_free(Bus *b)
{
    fb_delivery_free(b->delivery);
    fb_receiver_free(b->receiver);
    g_array_unref(b->actions);
    g_array_unref(b->frames);
    g_bytes_unref(b->executed);
    g_clear_error(&b->error);
    g_free(b);
}

static inline void bus_machine_event(Bus *b, FbMachineEvent event)
{
    const FbAlarm alarm = {42, "Axis X beyond its travel", "Check the work offset."};
    fb_receiver_machine(b->receiver, event, &alarm, b->now_us, b->actions);
}

static inline void bus_do(Bus *b, FbDo what)
{
    switch (what) {
    case FB_DO_VERIFY:
        bus_machine_event(b, FB_MACHINE_VERIFIED);
        break;
    case FB_DO_START:
        b->starts++;
        b->run_ends_us = b->now_us + b->run_us;
        g_bytes_unref(b->executed);
        b->executed = g_bytes_ref(fb_receiver_program(b->receiver));
        break;
    case FB_DO_HOLD_AT_GATE:
        b->holds_at_gate++;
        break;
    case FB_DO_ABORT:
        b->run_ends_us = INT64_MAX;
        bus_machine_event(b, FB_MACHINE_ABORTED);
        break;
    default:
        break;
    }
}

static inline void bus_do_all(Bus *b)
{
    for (guint i = 0; i < b->actions->len; i++)
        bus_do(b, g_array_index(b->actions, FbDo, i));
    g_array_set_size(b->actions, 0);
}

static inline const Fault *bus_fault(const Bus *b, unsigned request)
{
    for (int i = 0; i < 2; i++)
        if (b->faults[i].kind != FAULT_NONE && b->faults[i].at == request)
            return &b->faults[i];
    static const Fault none = {FAULT_NONE, 0, 0};
    return &none;
}

static inline void bus_step(Bus *b, FbEvent event);

static inline void bus_break(Bus *b)
{
    bus_step(b, (FbEvent){.kind = FB_EVENT_BROKEN, .why = "closed by the test"});
}

static inline void bus_damage(FbRequest *request, unsigned bit)
{
    if (request->n > 0)
        request->bytes[bit / 8 % request->n] ^= (uint8_t)(1 << bit % 8);
}

static inline void bus_post(Bus *b, bool to_machine, int64_t delay_us, const FbRequest *request)
{
    const Frame f = {b->now_us + delay_us, to_machine, b->connection, *request};
    g_array_append_val(b->frames, f);
}

/* A request leaves the agent, into whatever fault waits for it. */
static inline void bus_send(Bus *b, const FbRequest *request)
{
    const Fault *fault = bus_fault(b, b->requests++);
    FbRequest r = *request;
    switch (fault->kind) {
    case FAULT_REQUEST_LOST:
        return;
    case FAULT_REQUEST_TWICE:
        bus_post(b, true, BUS_LATENCY_US, &r);
        break;
    case FAULT_REQUEST_DAMAGED:
        bus_damage(&r, fault->bit);
        break;
    case FAULT_REQUEST_LATE:
        bus_post(b, true, 3000000, &r);
        return;
    case FAULT_CLOSED_BEFORE:
        b->connection++; /* the frame is lost with its connection; told below, from the loop */
        b->connect_us = INT64_MIN;
        return;
    case FAULT_REBOOT_BEFORE:
        bus_boot(b);
        b->connection++;
        b->connect_us = INT64_MIN;
        return;
    case FAULT_AGENT_KILLED:
        b->connect_us = INT64_MIN + 1;
        break;
    default:
        break;
    }
    bus_post(b, true, BUS_LATENCY_US, &r);
}

/* A request reaches the machine; the reply goes back on the same connection. */
static inline void bus_serve(Bus *b, const Frame *f)
{
    static const FbBlock block[] = {[FB_REQUEST_COMMAND] = FB_BLOCK_COMMAND,
                                    [FB_REQUEST_CHUNK] = FB_BLOCK_CHUNK,
                                    [FB_REQUEST_BEAT] = FB_BLOCK_BEAT};
    const Fault *fault = bus_fault(b, b->requests - 1);
    FbRequest reply = {.kind = f->request.kind};
    FbStatus status;
    if (b->dead)
        return;
    if (f->request.n > 0) {
        fb_receiver_write(b->receiver, FB_ROLE_PROGRAMMER, block[f->request.kind], f->request.bytes,
                          f->request.n, b->now_us, b->actions);
        bus_do_all(b);
    }
    fb_receiver_status(b->receiver, b->now_us, &status);
    status.chunk_max = 218;
    reply.n = reply.kind == FB_REQUEST_ALARM ? fb_wire_put_alarm(reply.bytes, &status)
                                             : fb_wire_put_status(reply.bytes, &status);
    if (f->connection != b->connection)
        return;
    int64_t delay_us = BUS_LATENCY_US;
    switch (fault->kind) {
    case FAULT_REPLY_LOST:
        return;
    case FAULT_REPLY_DAMAGED:
        bus_damage(&reply, fault->bit);
        break;
    case FAULT_REPLY_LATE:
        delay_us = 3000000;
        break;
    case FAULT_REBOOT_AFTER:
        bus_boot(b);
        bus_break(b);
        return;
    case FAULT_CLOSED_AFTER:
        bus_break(b);
        return;
    default:
        break;
    }
    bus_post(b, false, delay_us, &reply);
}

static inline void bus_step(Bus *b, FbEvent event)
{
    FbActions out;
    fb_delivery_step(b->delivery, &event, b->now_us, &out);
    b->wake_us = out.wake_us;
    if (out.close) {
        b->connection++;
        b->connect_us = INT64_MAX;
    }
    if (out.connect)
        b->connect_us = b->now_us + BUS_LATENCY_US;
    if (out.show && fb_delivery_status(b->delivery)->state == FB_STATE_UNKNOWN)
        b->shown_unknown++;
    if (out.ended) {
        b->ended[out.task] = true;
        g_clear_error(&b->error);
        b->error = out.error;
    }
    if (out.request)
        bus_send(b, out.request);
}

/* The frame that arrives next; NULL where none is on its way. */
static inline int bus_next_frame(const Bus *b)
{
    int next = -1;
    for (guint i = 0; i < b->frames->len; i++)
        if (next < 0 ||
            g_array_index(b->frames, Frame, i).at_us < g_array_index(b->frames, Frame, next).at_us)
            next = (int)i;
    return next;
}

/* Does the one thing that comes next in time. */
static inline void bus_turn(Bus *b)
{
    const int next = bus_next_frame(b);
    const int64_t frame_us = next < 0 ? INT64_MAX : g_array_index(b->frames, Frame, next).at_us;
    if (b->connect_us == INT64_MIN) {
        b->connect_us = INT64_MAX;
        bus_break(b);
        return;
    }
    if (b->connect_us == INT64_MIN + 1) {
        b->kills++;
        bus_agent(b);
        return;
    }
    const int64_t at_us =
        MIN(MIN(MIN(frame_us, b->wake_us), MIN(b->connect_us, b->tick_us)), b->run_ends_us);
    b->now_us = MAX(b->now_us, at_us);
    if (at_us == frame_us) {
        const Frame f = g_array_index(b->frames, Frame, next);
        g_array_remove_index(b->frames, (guint)next);
        if (f.to_machine)
            bus_serve(b, &f);
        else if (f.connection == b->connection)
            bus_step(b,
                     (FbEvent){.kind = FB_EVENT_REPLY, .bytes = f.request.bytes, .n = f.request.n});
    } else if (at_us == b->run_ends_us) {
        b->run_ends_us = INT64_MAX;
        bus_machine_event(b, FB_MACHINE_COMPLETE);
    } else if (at_us == b->tick_us) {
        b->tick_us = fb_receiver_tick(b->receiver, b->now_us, b->actions);
        bus_do_all(b);
    } else if (at_us == b->connect_us) {
        b->connect_us = INT64_MAX;
        bus_step(b, (FbEvent){.kind = FB_EVENT_CONNECTED});
    } else {
        bus_step(b, (FbEvent){.kind = FB_EVENT_TICK});
    }
}

/* Turns until the task has ended or the agent was killed, for a minute of the bus' time at most. */
static inline bool bus_run(Bus *b, FbTask task)
{
    const int64_t end_us = b->now_us + 60 * G_USEC_PER_SEC;
    const unsigned kills = b->kills;
    while (!b->ended[task] && b->kills == kills && b->now_us < end_us)
        bus_turn(b);
    return b->ended[task];
}

#endif
