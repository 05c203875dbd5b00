/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/fb_bus.h"

#include <string.h>

static const uint64_t TOKEN = UINT64_C(0x1234000056780000);
static const int64_t LATENCY_US = 1000, LATE_US = 3000000, LONGEST_US = 60000000;

/* A block on its way, or the answer to it. */
typedef struct {
    int64_t at_us;
    uint64_t serial; /* of two at the same time the first posted arrives first */
    bool to_machine, copy;
    unsigned agent, connection, ordinal;
    uint32_t transaction;
    FbRequestKind kind;
    unsigned page;
    size_t n;
    uint8_t *bytes;
} Frame;

static void step(Bus *b, unsigned agent, FbEvent event);
static void serve(Bus *b, const Frame *f);
static void new_agent(Bus *b, unsigned agent);

const char *bus_fault_name(FaultKind kind)
{
    static const char *const names[FAULT_N_KINDS] = {
        "none",          "request lost", "reply lost",    "request twice",   "request twice, late",
        "reply twice",   "request late", "reply late",    "request damaged", "reply damaged",
        "closed before", "closed after", "reboot before", "reboot after",    "killed before",
        "killed after"};
    return names[kind];
}

const char *bus_setup_name(const BusSetup *setup)
{
    static const char *const names[BUS_N_CARRIERS][BUS_N_MODES] = {
        {"Modbus, stored", "Modbus, dripping", "Modbus, restart"},
        {"CAN, stored", "CAN, dripping", "CAN, restart"}};
    return names[setup->carrier][setup->mode];
}

static const Fault *fault_at(const Bus *b, unsigned agent, unsigned ordinal)
{
    static const Fault none = {FAULT_NONE, 0, 0, 0};
    for (size_t i = 0; i < BUS_FAULTS; i++)
        if (b->faults[i].kind != FAULT_NONE && b->faults[i].agent == agent &&
            b->faults[i].at == ordinal)
            return &b->faults[i];
    return &none;
}

/* ------------------------------------------------------------------------ frames */

static void clear_frame(void *frame)
{
    g_free(((Frame *)frame)->bytes);
}

static void post(Bus *b, Frame f, const uint8_t *bytes, size_t n, int64_t delay_us)
{
    BusAgent *a = &b->agents[f.agent];
    int64_t *order_us = &a->order_us[f.to_machine];
    f.at_us = b->now_us + delay_us;
    if (b->setup.carrier == BUS_MODBUS && f.connection == a->connection && !f.copy)
        f.at_us = *order_us = MAX(*order_us, f.at_us);
    f.serial = b->posted++;
    f.n = n;
    f.bytes = g_memdup2(bytes, n);
    g_array_append_val(b->flying, f);
}

static void damage(uint8_t *bytes, size_t n, unsigned bit)
{
    if (n > 0)
        bytes[bit / 8 % n] ^= (uint8_t)(1 << bit % 8);
}

/* The connections end; what is in flight is lost with them, but late frames, which a switch or a
 * proxy holds. */
static void cut(Bus *b, unsigned agent)
{
    BusAgent *a = &b->agents[agent];
    for (guint i = b->flying->len; i-- > 0;) {
        const Frame *f = &g_array_index(b->flying, Frame, i);
        if (f->agent == agent && f->connection == a->connection &&
            f->at_us - b->now_us <= LATENCY_US)
            g_array_remove_index(b->flying, i);
    }
    a->cut = true;
}

static void reboot(Bus *b)
{
    bus_boot(b);
    b->reboots++;
    if (b->setup.attended)
        bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    for (unsigned i = 0; i < BUS_N_AGENTS; i++)
        cut(b, i);
}

/* What a fault does to a request that leaves; true: it does not leave. */
static bool spoil_request(Bus *b, const Fault *fault, Frame *f, uint8_t *bytes, size_t n)
{
    switch (fault->kind) {
    case FAULT_REQUEST_LOST:
        return true;
    case FAULT_REQUEST_DAMAGED:
        damage(bytes, n, fault->bit);
        return false;
    case FAULT_REQUEST_LATE:
        post(b, *f, bytes, n, LATE_US);
        return true;
    case FAULT_CLOSED_BEFORE:
        cut(b, f->agent);
        return true;
    case FAULT_REBOOT_BEFORE:
        reboot(b);
        return true;
    case FAULT_KILLED_BEFORE:
        b->agents[f->agent].killed = true;
        return true;
    default:
        return false;
    }
}

/* The first chunk of a row, with nothing but a beat in flight, begins where the machine's prefix
 * ends. */
static void check_first_chunk(const BusAgent *a, const FbRequest *request)
{
    FbChunk chunk;
    for (unsigned i = 0; i < a->n_flights; i++)
        if (a->kinds[i] == FB_REQUEST_CHUNK)
            return;
    g_assert_cmpint(fb_wire_get_chunk(request->bytes, request->n, &chunk), ==, FB_ANSWER_DONE);
    g_assert_cmpuint(chunk.offset, ==, fb_delivery_status(a->delivery)->received);
}

static void send_request(Bus *b, unsigned agent, const FbRequest *request)
{
    BusAgent *a = &b->agents[agent];
    if (a->cut || a->killed)
        return;
    Frame f = {.to_machine = true,
               .agent = agent,
               .connection = a->connection,
               .ordinal = a->frames++,
               .transaction = ++a->transaction,
               .kind = request->kind,
               .page = request->page};
    const Fault *fault = fault_at(b, agent, f.ordinal);
    uint8_t bytes[FB_BLOCK_BYTES];
    memcpy(bytes, request->bytes, request->n);
    g_assert(a->n_flights < FB_WINDOW_MOST);
    if (request->kind == FB_REQUEST_CHUNK)
        check_first_chunk(a, request);
    a->kinds[a->n_flights] = request->kind;
    a->flights[a->n_flights++] = f.transaction;
    g_assert(request->n <= (b->setup.carrier == BUS_CAN
                                ? (size_t)FB_BLOCK_BYTES
                                : FB_CHUNK_HEADER_BYTES + FB_MODBUS_CHUNK_BYTES));
    a->most_flights = MAX(a->most_flights, a->n_flights);
    if (b->closes[request->kind]) {
        cut(b, agent);
        return;
    }
    if (spoil_request(b, fault, &f, bytes, request->n))
        return;
    post(b, f, bytes, request->n, LATENCY_US);
    f.copy = true;
    if (fault->kind == FAULT_REQUEST_TWICE)
        post(b, f, bytes, request->n, LATENCY_US);
    if (fault->kind == FAULT_REQUEST_TWICE_LATE)
        post(b, f, bytes, request->n, LATE_US);
    a->killed |= fault->kind == FAULT_KILLED_AFTER;
}

/* A connection: on Modbus TCP's handshake, on CAN HELLO and WELCOME. */
static void open_connection(Bus *b, unsigned agent)
{
    BusAgent *a = &b->agents[agent];
    const Fault *fault = fault_at(b, agent, a->frames++);
    a->order_us[false] = a->order_us[true] = 0;
    a->n_flights = 0;
    a->cut = false;
    a->connect_us = INT64_MAX;
    switch (fault->kind) {
    case FAULT_REQUEST_LOST:
    case FAULT_REPLY_LOST:
    case FAULT_REQUEST_LATE:
    case FAULT_REPLY_LATE:
    case FAULT_REQUEST_DAMAGED:
    case FAULT_REPLY_DAMAGED:
        return;
    case FAULT_CLOSED_BEFORE:
    case FAULT_CLOSED_AFTER:
        a->cut = true;
        return;
    case FAULT_REBOOT_BEFORE:
    case FAULT_REBOOT_AFTER:
        reboot(b);
        return;
    case FAULT_KILLED_BEFORE:
    case FAULT_KILLED_AFTER:
        a->killed = true;
        return;
    default:
        a->connect_us = b->now_us + (b->setup.carrier == BUS_CAN ? 2 : 1) * LATENCY_US;
    }
}

FbStatus bus_status(const Bus *b)
{
    FbStatus s;
    fb_receiver_status(b->receiver, b->now_us, &s);
    s.chunk_max = b->setup.chunk_max;
    if (b->setup.untold)
        s.memory_bytes = 0;
    if (b->setup.carrier == BUS_CAN)
        s.window_max = 1;
    return s;
}

static size_t put_reply(const Bus *b, const Frame *f, uint8_t *out)
{
    const FbStatus s = bus_status(b);
    switch (f->kind) {
    case FB_REQUEST_ALARM:
        return fb_wire_put_alarm(out, &s);
    case FB_REQUEST_OFFSETS:
        return fb_wire_put_offsets(out, fb_receiver_setup(b->receiver));
    case FB_REQUEST_TOOLS:
        return fb_wire_put_tools(out, fb_receiver_setup(b->receiver), f->page);
    case FB_REQUEST_CHUNK:
        if (b->setup.carrier == BUS_CAN)
            return fb_wire_put_ack(out, &s);
        break;
    default:
        break;
    }
    return fb_wire_put_status(out, &s);
}

/* A request reaches the machine; the answer goes back on its connection, where that still is. */
static void serve(Bus *b, const Frame *f)
{
    static const FbBlock block[] = {[FB_REQUEST_COMMAND] = FB_BLOCK_COMMAND,
                                    [FB_REQUEST_CHUNK] = FB_BLOCK_CHUNK,
                                    [FB_REQUEST_BEAT] = FB_BLOCK_BEAT};
    BusAgent *a = &b->agents[f->agent];
    const Fault *fault = fault_at(b, f->agent, f->ordinal);
    const FaultKind kind = f->copy ? FAULT_NONE : fault->kind;
    uint8_t reply[FB_BLOCK_BYTES];
    if (b->dead)
        return;
    if (f->n > 0) {
        fb_receiver_write(b->receiver, FB_ROLE_PROGRAMMER, block[f->kind], f->bytes, f->n,
                          b->now_us, b->actions);
        bus_act(b);
    }
    if (kind == FAULT_REBOOT_AFTER) {
        reboot(b);
        return;
    }
    if (f->connection != a->connection || a->cut)
        return;
    if (kind == FAULT_CLOSED_AFTER) {
        cut(b, f->agent);
        return;
    }
    if (kind == FAULT_REPLY_LOST)
        return;
    const size_t n = put_reply(b, f, reply);
    Frame back = *f;
    back.to_machine = false;
    if (kind == FAULT_REPLY_DAMAGED)
        damage(reply, n, fault->bit);
    post(b, back, reply, n, kind == FAULT_REPLY_LATE ? LATE_US : LATENCY_US);
    if (kind == FAULT_REPLY_TWICE)
        post(b, back, reply, n, LATENCY_US);
}

/* An answer reaches the agent's transport, which knows whose it is. */
static void take_answer(Bus *b, const Frame *f)
{
    BusAgent *a = &b->agents[f->agent];
    if (f->connection != a->connection || a->cut)
        return;
    if (a->n_flights == 0 || a->flights[0] != f->transaction) {
        if (b->setup.carrier == BUS_MODBUS)
            cut(b, f->agent);
        return; /* CAN: a counter that is not asked for is ignored */
    }
    memmove(a->flights, a->flights + 1, --a->n_flights * sizeof *a->flights);
    memmove(a->kinds, a->kinds + 1, a->n_flights * sizeof *a->kinds);
    step(b, f->agent, (FbEvent){.kind = FB_EVENT_REPLY, .bytes = f->bytes, .n = f->n});
}

/* ------------------------------------------------------------------------ agents */

static void carry_out(Bus *b, unsigned agent, const FbActions *out)
{
    BusAgent *a = &b->agents[agent];
    a->wake_us = out->wake_us;
    if (out->close) {
        a->connection++;
        a->connect_us = INT64_MAX;
        a->cut = false;
    }
    if (out->connect)
        open_connection(b, agent);
    if (out->show && fb_delivery_status(a->delivery)->state == FB_STATE_UNKNOWN)
        a->shown_unknown++;
    if (out->ended) {
        a->ended[out->task] = true;
        g_clear_error(&a->error);
        a->error = out->error;
    }
    if (out->request)
        send_request(b, agent, out->request);
}

static void step(Bus *b, unsigned agent, FbEvent event)
{
    FbActions out;
    do {
        fb_delivery_step(b->agents[agent].delivery, &event, b->now_us, &out);
        carry_out(b, agent, &out);
        event = (FbEvent){.kind = FB_EVENT_TICK};
    } while (out.more && !b->agents[agent].killed);
}

static void new_agent(Bus *b, unsigned agent)
{
    BusAgent *a = &b->agents[agent];
    const FbDeliveryOptions options = {.session = 100 + 1000 * agent + a->lives++,
                                       .token = TOKEN,
                                       .reply_timeout_us = 1000000,
                                       .reconnect_us = 500000,
                                       .give_up_us = 30000000,
                                       .heartbeat_us = 500000,
                                       .window = b->setup.window,
                                       .drip = b->setup.mode == BUS_DRIP ? CFG_DRIP_ALWAYS
                                               : b->setup.untold         ? CFG_DRIP_AUTO
                                                                         : CFG_DRIP_NEVER};
    fb_delivery_free(a->delivery);
    a->delivery = fb_delivery_new(&options, b->now_us);
    if (b->setup.carrier == BUS_MODBUS)
        fb_delivery_limit_chunks(a->delivery, FB_MODBUS_CHUNK_BYTES);
    a->wake_us = b->now_us;
    a->connection++;
    a->connect_us = INT64_MAX;
    a->cut = a->killed = false; /* what a person was told before stays told */
}

static void begin(Bus *b, unsigned agent, FbTask task)
{
    BusAgent *a = &b->agents[agent];
    a->ended[task] = false;
    g_clear_error(&a->error);
    a->wake_us = b->now_us;
}

void bus_deliver(Bus *b)
{
    begin(b, BUS_WORK, FB_TASK_DELIVER);
    fb_delivery_deliver(b->agents[BUS_WORK].delivery, bus_program(), bus_gates(), BUS_GATES,
                        b->now_us);
}

void bus_start(Bus *b)
{
    const FbStored stored = {.gate = 1, .gate_offset = bus_gates()[0]};
    begin(b, BUS_WORK, FB_TASK_RUN);
    if (b->setup.mode == BUS_RESTART)
        fb_delivery_start_stored(b->agents[BUS_WORK].delivery, &stored, b->now_us);
    else
        fb_delivery_start(b->agents[BUS_WORK].delivery, b->now_us);
}

void bus_command(Bus *b, FbCommand command)
{
    begin(b, BUS_CONTROL, FB_TASK_COMMAND);
    fb_delivery_command(b->agents[BUS_CONTROL].delivery, command, NULL, b->now_us, b->now_us);
}

/* -------------------------------------------------------------------------- time */

static int next_frame(const Bus *b)
{
    int next = -1;
    for (guint i = 0; i < b->flying->len; i++) {
        const Frame *f = &g_array_index(b->flying, Frame, i);
        const Frame *best = next < 0 ? NULL : &g_array_index(b->flying, Frame, next);
        if (!best || f->at_us < best->at_us ||
            (f->at_us == best->at_us && f->serial < best->serial))
            next = (int)i;
    }
    return next;
}

/* What happened to an agent that it is told now, not from inside its own step. */
static bool tell(Bus *b)
{
    for (unsigned i = 0; i < BUS_N_AGENTS; i++) {
        BusAgent *a = &b->agents[i];
        if (a->killed) {
            new_agent(b, i);
            return true;
        }
        if (a->cut) {
            a->connection++;
            step(b, i, (FbEvent){.kind = FB_EVENT_BROKEN, .why = "closed by the test"});
            a->cut = false;
            return true;
        }
    }
    return false;
}

static void turn_agent(Bus *b, unsigned agent)
{
    BusAgent *a = &b->agents[agent];
    const bool connected = a->connect_us <= a->wake_us;
    if (connected)
        a->connect_us = INT64_MAX;
    step(b, agent, (FbEvent){.kind = connected ? FB_EVENT_CONNECTED : FB_EVENT_TICK});
}

void bus_turn(Bus *b)
{
    if (tell(b))
        return;
    const int next = next_frame(b);
    const int64_t frame_us = next < 0 ? INT64_MAX : g_array_index(b->flying, Frame, next).at_us;
    const BusAgent *a = b->agents;
    const int64_t agent_us[] = {MIN(a[0].wake_us, a[0].connect_us),
                                MIN(a[1].wake_us, a[1].connect_us)};
    const int64_t machine_us = MIN(b->tick_us, b->line_us);
    const int64_t at_us = MIN(MIN(frame_us, machine_us), MIN(agent_us[0], agent_us[1]));
    b->now_us = MAX(b->now_us, at_us);
    if (at_us == frame_us) {
        const Frame f = g_array_index(b->flying, Frame, next);
        g_array_index(b->flying, Frame, next).bytes = NULL;
        g_array_remove_index(b->flying, (guint)next);
        if (f.to_machine)
            serve(b, &f);
        else
            take_answer(b, &f);
        g_free(f.bytes);
    } else if (at_us == machine_us) {
        if (at_us == b->line_us)
            bus_execute_line(b);
        else
            b->tick_us = fb_receiver_tick(b->receiver, b->now_us, b->actions);
        bus_act(b);
    } else {
        turn_agent(b, agent_us[BUS_WORK] == at_us ? BUS_WORK : BUS_CONTROL);
    }
}

void bus_wait(Bus *b, int64_t us)
{
    const int64_t end_us = b->now_us + us;
    while (b->now_us < end_us)
        bus_turn(b);
}

bool bus_run(Bus *b, unsigned agent, FbTask task)
{
    const BusAgent *a = &b->agents[agent];
    const int64_t end_us = b->now_us + LONGEST_US;
    const unsigned lives = a->lives;
    while (!a->ended[task] && a->lives == lives && b->now_us < end_us)
        bus_turn(b);
    return a->ended[task] && a->lives == lives;
}

/* -------------------------------------------------------------------------- life */

Bus *bus_new(const BusSetup *setup, const Fault *faults, size_t n_faults)
{
    Bus *b = g_new0(Bus, 1);
    b->setup = *setup;
    b->now_us = 1000000;
    b->actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    b->flying = g_array_new(FALSE, FALSE, sizeof(Frame));
    g_array_set_clear_func(b->flying, clear_frame);
    b->executed = g_byte_array_new();
    b->epoch = 500;
    bus_boot(b);
    for (unsigned i = 0; i < BUS_N_AGENTS; i++)
        new_agent(b, i);
    bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    if (setup->mode == BUS_RESTART) {
        bus_deliver(b);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
        g_assert_no_error(b->agents[BUS_WORK].error);
    }
    for (unsigned i = 0; i < BUS_N_AGENTS; i++)
        b->agents[i].frames = 0;
    for (size_t i = 0; i < n_faults; i++)
        b->faults[i] = faults[i];
    return b;
}

void bus_free(Bus *b)
{
    for (unsigned i = 0; i < BUS_N_AGENTS; i++) {
        fb_delivery_free(b->agents[i].delivery);
        g_clear_error(&b->agents[i].error);
    }
    fb_receiver_free(b->receiver);
    g_array_unref(b->actions);
    g_array_unref(b->flying);
    g_byte_array_unref(b->executed);
    g_free(b);
}
