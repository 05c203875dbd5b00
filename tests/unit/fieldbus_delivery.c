/* SPDX-License-Identifier: Apache-2.0 */
/* What a delivery does where something or somebody else is in the way; every fault by itself is in
 * fieldbus_sweep.c. */
#include <string.h>

#include "tests/lib/fb_work.h"
#include "tests/lib/test.h"

static const BusSetup MODBUS = {BUS_MODBUS, BUS_STORED, 8, 218, false, false};

static BusAgent *agent(Bus *b)
{
    return &b->agents[BUS_WORK];
}

static const char *message(const Bus *b)
{
    return b->agents[BUS_WORK].error ? b->agents[BUS_WORK].error->message : "";
}

/* Delivers, and leaves the machine running. */
static void start_run(Bus *b)
{
    if (b->setup.mode != BUS_RESTART)
        bus_deliver(b);
    if (b->setup.mode != BUS_RESTART)
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
    bus_start(b);
    while (b->starts == 0)
        bus_turn(b);
}

/* A block of somebody else's, at the machine's door. */
static FbAnswer write_order(Bus *b, FbOrder order)
{
    static uint32_t seq;
    uint8_t block[FB_BLOCK_BYTES];
    order.session = 7;
    order.seq = ++seq;
    order.epoch = b->epoch;
    const FbAnswer answer =
        fb_receiver_write(b->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_COMMAND, block,
                          fb_wire_put_order(block, &order), b->now_us, b->actions);
    bus_act(b);
    return answer;
}

/* A program, and how much of it is sent before the one who sends it is gone. */
typedef struct {
    const uint8_t *bytes;
    size_t n;
    const uint64_t *gates;
    uint32_t n_gates;
    bool drip;
    size_t send;
} Other;

/* Its table of gates, then its bytes; and the CRC of the table. */
static uint8_t *make_stream(const Other *o, size_t entry, uint8_t *id, uint32_t *crc)
{
    uint8_t *stream = g_malloc(o->n_gates * entry + o->n);
    for (uint32_t i = 0; i < o->n_gates; i++) {
        gsize n_id = 32;
        g_autoptr(GChecksum) hash = g_checksum_new(G_CHECKSUM_SHA256);
        g_checksum_update(hash, o->bytes, (gssize)o->gates[i]);
        g_checksum_get_digest(hash, id, &n_id);
        fb_wire_put_gate(stream + i * entry, o->gates[i], o->drip ? id : NULL);
    }
    *crc = fb_wire_crc(stream, o->n_gates * entry);
    memcpy(stream + o->n_gates * entry, o->bytes, o->n);
    return stream;
}

static void deliver_by_another(Bus *b, const Other *o)
{
    const uint64_t token = UINT64_C(9) << 32;
    uint8_t block[FB_BLOCK_BYTES];
    FbOrder open = {
        .token = token,
        .command = FB_COMMAND_OPEN,
        .open = {.program_bytes = o->n, .gates = o->n_gates, .flags = o->drip ? FB_OPEN_DRIP : 0}};
    const size_t entry = fb_wire_gate_bytes(open.open.flags);
    g_autofree uint8_t *stream = make_stream(o, entry, open.open.id, &open.open.gates_crc);
    g_assert_cmpint(write_order(b, (FbOrder){.token = token, .command = FB_COMMAND_LEASE}), ==,
                    FB_ANSWER_DONE);
    g_assert_cmpint(write_order(b, open), ==, FB_ANSWER_DONE);
    const uint32_t transfer = bus_status(b).transfer;
    const size_t end = o->n_gates * entry + o->send;
    for (size_t at = 0; at < end; at += 1000) {
        const FbChunk chunk = {b->epoch, transfer, at, (uint16_t)MIN(1000, end - at), stream + at};
        g_assert_cmpint(fb_receiver_write(b->receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_CHUNK, block,
                                          fb_wire_put_chunk(block, &chunk), b->now_us, b->actions),
                        ==, FB_ANSWER_DONE);
    }
    write_order(b, (FbOrder){.token = token, .command = FB_COMMAND_VERIFY, .transfer = transfer});
    write_order(b, (FbOrder){.token = token, .command = FB_COMMAND_RELEASE});
    g_assert_cmpint(bus_status(b).state, ==, FB_STATE_READY);
}

/* A delivery that stopped half-way is gone on with, by anybody who has the lease. */
static void goes_on_from_received(void)
{
    const Fault killed = {FAULT_KILLED_AFTER, BUS_WORK, 12, 0};
    g_autoptr(Bus) b = bus_new(&MODBUS, &killed, 1);
    bus_deliver(b);
    g_assert_false(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
    g_assert_cmpuint(agent(b)->lives, ==, 2);
    bus_wait(b, 100000);
    const FbStatus before = bus_status(b);
    g_assert_cmpuint(before.received, >, 0);
    bus_deliver(b);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
    g_assert_no_error(agent(b)->error);
    g_assert_cmpuint(bus_status(b).transfer, ==, before.transfer);
    bus_start(b);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_REFUSED); /* a restarted agent starts none */
    g_assert_nonnull(strstr(message(b), "NEEDS_ACKNOWLEDGE"));
    bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    work(b);
    work_settle(b);
    work_check(b, 1 << END_DONE);
}

/* The link goes while the program runs, and comes back in time: followed on, no second start. */
static void link_loss_while_running(void)
{
    g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
    start_run(b);
    b->dead = true;
    bus_wait(b, 8 * G_USEC_PER_SEC);
    g_assert_false(agent(b)->ended[FB_TASK_RUN]);
    g_assert_cmpint(fb_delivery_status(agent(b)->delivery)->state, ==, FB_STATE_UNKNOWN);
    g_assert_cmpuint(agent(b)->shown_unknown, ==, 1);
    g_assert_cmpuint(b->gate_holds, ==, 1);
    g_assert_cmpint(bus_status(b).state, ==, FB_STATE_HELD);
    b->dead = false;
    bus_wait(b, 5 * G_USEC_PER_SEC);
    g_assert_cmpint(bus_status(b).state, ==, FB_STATE_HELD); /* it does not go on by itself */
    bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    bus_command(b, FB_COMMAND_RESUME);
    g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
    g_assert_no_error(b->agents[BUS_CONTROL].error);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
    work_check(b, 1 << END_DONE);
}

/* The link does not come back: UNKNOWN, and the error says so. */
static void gives_up(void)
{
    g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
    start_run(b);
    b->dead = true;
    const int64_t since_us = b->now_us;
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_LINK_LOST);
    g_assert_cmpint(b->now_us - since_us, >=, 30 * G_USEC_PER_SEC);
    g_assert_cmpint(b->now_us - since_us, <, 33 * G_USEC_PER_SEC);
    g_assert_cmpint(fb_delivery_status(agent(b)->delivery)->state, ==, FB_STATE_UNKNOWN);

    /* Before anything runs the machine is just not reachable. */
    bus_deliver(b);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_UNREACHABLE);
}

/* At any moment of the run, whatever is in flight then: told as what it is. */
static void how_a_run_ends(void)
{
    static const struct {
        FbMachineEvent event;
        FbError error;
    } cases[] = {{FB_MACHINE_ALARM, FB_ERROR_ALARM},
                 {FB_MACHINE_ESTOP, FB_ERROR_ALARM},
                 {FB_MACHINE_ABORTED, FB_ERROR_ABORTED}};
    static const BusSetup setups[] = {{BUS_MODBUS, BUS_STORED, 8, 218, false, false},
                                      {BUS_MODBUS, BUS_DRIP, 8, 218, false, false},
                                      {BUS_CAN, BUS_DRIP, 1, 218, false, false},
                                      {BUS_CAN, BUS_RESTART, 1, FB_CHUNK_BYTES, false, false}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases) * G_N_ELEMENTS(setups); i++)
        for (int turns = 0; turns < 120; turns++) {
            g_autoptr(Bus) b = bus_new(&setups[i / G_N_ELEMENTS(cases)], NULL, 0);
            const size_t c = i % G_N_ELEMENTS(cases);
            start_run(b);
            for (int turn = 0; turn < turns; turn++)
                bus_turn(b);
            g_autofree char *line = g_strdup_printf("in line %u", b->progress.line);
            bus_machine_event(b, cases[c].event);
            bus_act(b);
            g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
            g_assert_cmpuint(bus_status(b).line, ==, 0);
            g_assert_nonnull(strstr(message(b), line));
            if (!g_error_matches(agent(b)->error, FB_ERROR, (int)cases[c].error))
                g_test_message("%s, event %d after %d turns", bus_setup_name(&b->setup),
                               (int)cases[c].event, turns);
            g_assert_error(agent(b)->error, FB_ERROR, (int)cases[c].error);
            if (cases[c].error == FB_ERROR_ALARM)
                g_assert_nonnull(strstr(message(b), "Axis X beyond its travel"));
            g_assert_cmpuint(bus_status(b).lease_owner, ==, 0);
        }
}

static void lease_of_another_is_respected(void)
{
    g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
    write_order(b, (FbOrder){.token = UINT64_C(9) << 32, .command = FB_COMMAND_LEASE});
    work(b);
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_cmpuint(b->starts, ==, 0);

    /* A hold needs none; to forget a program one does. */
    bus_command(b, FB_COMMAND_CLOSE);
    g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
    const GError *error = b->agents[BUS_CONTROL].error;
    g_assert_error(error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_nonnull(error ? strstr(error->message, "NO_LEASE") : NULL);
}

/* A machine that is switched off, or that refuses, is told of in words. */
static void refusals_are_told(void)
{
    g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
    bus_boot(b);
    work(b);
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_nonnull(strstr(message(b), "OFF"));
    bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    work(b);
    work_check(b, 1 << END_DONE);

    bus_start(b);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_REFUSED);
    g_assert_nonnull(strstr(message(b), "COMPLETE"));
    g_assert_cmpuint(b->starts, ==, 1);
}

/* A start of what the machine holds is not repeated in another epoch, although it holds the same
 * again. */
static void start_of_another_epoch(void)
{
    static const BusSetup setup = {BUS_MODBUS, BUS_RESTART, 1, 218, false, false};
    gsize n;
    const uint8_t *bytes = g_bytes_get_data(bus_program(), &n);
    g_autoptr(Bus) b = bus_new(&setup, NULL, 0);
    start_run(b);
    bus_wait(b, 100000);
    b->dead = true;
    bus_wait(b, 2 * G_USEC_PER_SEC);
    bus_boot(b);
    bus_machine_event(b, FB_MACHINE_ACKNOWLEDGED);
    deliver_by_another(b, &(Other){bytes, n, bus_gates(), BUS_GATES, false, n});
    b->dead = false;
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_LINK_LOST);
    g_assert_cmpuint(b->starts, ==, 1);
    g_assert_cmpint(bus_status(b).state, ==, FB_STATE_READY);
}

/* Who delivered one program and starts another that drips has no bytes for it. */
static void no_bytes_of_another_program(void)
{
    static const BusSetup setup = {BUS_MODBUS, BUS_DRIP, 4, 218, false, false};
    gsize n;
    const uint8_t *bytes = g_bytes_get_data(bus_program(), &n);
    g_autofree uint8_t *twice = g_malloc(2 * n);
    uint64_t gates[2 * BUS_GATES];
    for (size_t i = 0; i < 2 * BUS_GATES; i++)
        gates[i] = bus_gates()[i % BUS_GATES] + (i < BUS_GATES ? 0 : n);
    memcpy(twice, bytes, n);
    memcpy(twice + n, bytes, n);
    g_autoptr(Bus) b = bus_new(&setup, NULL, 0);
    bus_deliver(b);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
    g_assert_no_error(agent(b)->error);
    bus_command(b, FB_COMMAND_RELEASE);
    g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
    deliver_by_another(b, &(Other){twice, 2 * n, gates, 2 * BUS_GATES, true, gates[0]});
    const uint64_t received = bus_status(b).received;
    fb_delivery_start_stored(agent(b)->delivery, &(FbStored){0}, b->now_us);
    agent(b)->wake_us = b->now_us;
    bus_wait(b, 2 * G_USEC_PER_SEC);
    g_assert_cmpuint(b->starts, ==, 1);
    g_assert_cmpuint(b->starved, ==, 1);
    g_assert_cmpuint(bus_status(b).received, ==, received);
    g_assert_cmpuint(fb_receiver_counts(b->receiver)[FB_ANSWER_HASH], ==, 0);
}

/* Whatever single request or reply is lost, a run that was seen to its end leaves the lease free,
 * so that the next start wants nobody at the machine. */
static void releases_whatever_is_lost(void)
{
    unsigned frames = 1;
    for (unsigned at = 0; at < 2 * frames; at++) {
        const Fault lost = {at % 2 ? FAULT_REPLY_LOST : FAULT_REQUEST_LOST, BUS_WORK, at / 2, 0};
        g_autoptr(Bus) b = bus_new(&MODBUS, &lost, 1);
        bus_deliver(b);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
        bus_start(b);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
        g_assert_no_error(agent(b)->error);
        g_assert_cmpuint(bus_status(b).lease_owner, ==, 0);
        g_assert_false(bus_status(b).needs_acknowledge);
        frames = MAX(frames, agent(b)->frames);
    }
    g_assert_cmpuint(frames, >, 20);
}

/* A machine may publish what its carrier cannot take. */
static void chunks_fit_their_carrier(void)
{
    static const BusSetup setup = {BUS_MODBUS, BUS_STORED, 4, FB_CHUNK_BYTES, false, false};
    g_autoptr(Bus) b = bus_new(&setup, NULL, 0); /* which asserts it */
    work(b);
    work_settle(b);
    work_check(b, 1 << END_DONE);
}

/* A machine that does not say how large its memory is gets the program stored. */
static void memory_untold(void)
{
    static const BusSetup setup = {BUS_MODBUS, BUS_STORED, 4, 218, false, true};
    g_autoptr(Bus) b = bus_new(&setup, NULL, 0);
    bus_deliver(b);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
    g_assert_no_error(agent(b)->error);
    g_assert_cmpint(bus_status(b).state, ==, FB_STATE_READY);
    g_assert_false(bus_status(b).drip);
}

static void read_setup(Bus *b)
{
    agent(b)->ended[FB_TASK_SETUP] = false;
    agent(b)->wake_us = b->now_us;
    fb_delivery_read_setup(agent(b)->delivery, b->now_us);
}

static void set_setup(Bus *b, uint16_t n_tools)
{
    FbSetup setup = {.n_tools = n_tools, .work_offset = 54};
    for (uint16_t i = 0; i < n_tools; i++)
        setup.tools[i] = (FbTool){i + 1, CFG_TOOL_FLAT, 6, 0, n_tools};
    fb_receiver_set_setup(b->receiver, &setup);
}

/* A machine that publishes neither tools nor offsets is not asked for them. */
static void no_setup(void)
{
    g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
    g_assert_cmpuint(bus_status(b).setup_serial, ==, 0);
    read_setup(b);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_SETUP));
    g_assert_no_error(agent(b)->error);
    const FbSetup *setup = fb_delivery_setup(agent(b)->delivery);
    g_assert_nonnull(setup);
    g_assert_cmpuint(setup ? setup->serial : 1, ==, 0);
    g_assert_cmpuint(agent(b)->frames, ==, 2); /* a connect, and a STATUS */
}

/* The setup changes at any moment between the reads: all of it is of one serial, and the link is
 * never given up. */
static void setup_moves(void)
{
    for (int turns = 0; turns < 30; turns++) {
        g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
        set_setup(b, 40);
        read_setup(b);
        for (int turn = 0; turn < turns; turn++)
            bus_turn(b);
        const bool before = agent(b)->ended[FB_TASK_SETUP];
        set_setup(b, 30);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_SETUP));
        g_assert_no_error(agent(b)->error);
        g_assert_cmpuint(agent(b)->shown_unknown, ==, 0);
        const FbSetup *setup = fb_delivery_setup(agent(b)->delivery);
        g_assert_nonnull(setup);
        for (uint16_t i = 0; setup && i < setup->n_tools; i++)
            g_assert_cmpfloat(setup->tools[i].length_mm, ==, setup->n_tools);
        if (setup && !before && setup->n_tools != 30)
            g_assert_cmpuint(setup->n_tools, ==, 40); /* it was read to its end before */
    }

    /* One that changes all the time is told of. */
    g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
    set_setup(b, 40);
    read_setup(b);
    for (int turn = 0; turn < 10000 && !agent(b)->ended[FB_TASK_SETUP]; turn++) {
        bus_turn(b);
        set_setup(b, 40);
    }
    g_assert_true(agent(b)->ended[FB_TASK_SETUP]);
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_PROTOCOL);
    g_assert_nonnull(strstr(message(b), "changes from read to read"));
}

/* A second alarm while the first one's text is read: no break, and the text is the second one's. */
static void alarm_moves(void)
{
    for (int turns = 0; turns < 12; turns++) {
        g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
        start_run(b);
        bus_machine_event(b, FB_MACHINE_ALARM);
        for (int turn = 0; turn < turns; turn++)
            bus_turn(b);
        bus_machine_event(b, FB_MACHINE_ESTOP);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
        bus_wait(b, G_USEC_PER_SEC);
        const FbStatus *s = fb_delivery_status(agent(b)->delivery);
        g_assert_cmpuint(agent(b)->shown_unknown, ==, 0);
        g_assert_cmpint(s->state, ==, FB_STATE_ESTOP);
        g_assert_cmpuint(s->alarm_serial, ==, bus_status(b).alarm_serial);
        g_assert_cmpstr(s->alarm_text, ==, "Axis X beyond its travel");
    }
}

/* A machine that is read without fault but closes the connection at what the task asks for: the
 * task ends, soon, and says so. */
static void closes_at_every_request(void)
{
    static const FbRequestKind kinds[] = {FB_REQUEST_CHUNK, FB_REQUEST_COMMAND, FB_REQUEST_OFFSETS,
                                          FB_REQUEST_TOOLS};
    for (size_t i = 0; i < G_N_ELEMENTS(kinds); i++)
        for (uint16_t window = 1; window <= 8; window += 7) {
            const bool setup = kinds[i] == FB_REQUEST_OFFSETS || kinds[i] == FB_REQUEST_TOOLS;
            g_autoptr(Bus) b =
                bus_new(&(BusSetup){BUS_MODBUS, BUS_STORED, window, 218, false, false}, NULL, 0);
            b->closes[kinds[i]] = true;
            set_setup(b, 3);
            if (setup)
                read_setup(b);
            else
                bus_deliver(b);
            g_assert_true(bus_run(b, BUS_WORK, setup ? FB_TASK_SETUP : FB_TASK_DELIVER));
            g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_PROTOCOL);
            g_assert_nonnull(strstr(message(b), "takes nothing any more (closed by the test"));
            g_assert_cmpint(b->now_us, <, 10 * G_USEC_PER_SEC);
        }

    /* What is asked for on a run leaves it in doubt. */
    static const BusSetup drip = {BUS_MODBUS, BUS_DRIP, 4, 218, false, false};
    g_autoptr(Bus) b = bus_new(&drip, NULL, 0);
    start_run(b);
    b->closes[FB_REQUEST_CHUNK] = true;
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
    g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_LINK_LOST);
    g_assert_nonnull(strstr(message(b), "takes nothing any more (closed by the test"));
}

/* A run is followed although no beat is answered. */
static void closes_at_every_beat(void)
{
    g_autoptr(Bus) b = bus_new(&MODBUS, NULL, 0);
    start_run(b);
    b->closes[FB_REQUEST_BEAT] = true;
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN) || bus_status(b).state == FB_STATE_HELD);
    g_assert_no_error(agent(b)->error);
    g_assert_cmpint(bus_status(b).state, ==, FB_STATE_HELD); /* nobody is heard to attend to it */
    g_assert_false(agent(b)->ended[FB_TASK_RUN]);
}

/* The rest of a program that is fed is not what was announced: whoever follows the run stays with
 * it until the machine stands, and is told that the run is still on. */
static void rest_is_refused(void)
{
    static const BusSetup setups[] = {{BUS_MODBUS, BUS_DRIP, 4, 218, false, false},
                                      {BUS_CAN, BUS_DRIP, 1, FB_CHUNK_BYTES, false, false}};
    for (size_t i = 0; i < G_N_ELEMENTS(setups); i++) {
        gsize n;
        const uint8_t *bytes = g_bytes_get_data(bus_program(), &n);
        g_autofree uint8_t *mine = g_memdup2(bytes, n);
        g_autoptr(GBytes) program = g_bytes_new_static(mine, n);
        g_autoptr(Bus) b = bus_new(&setups[i], NULL, 0);
        agent(b)->wake_us = b->now_us;
        fb_delivery_deliver(agent(b)->delivery, program, bus_gates(), BUS_GATES, b->now_us);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
        g_assert_no_error(agent(b)->error);
        mine[n - 3] ^= 1; /* in the last pass, which is not on its way yet */
        bus_start(b);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
        g_assert_error(agent(b)->error, FB_ERROR, FB_ERROR_REFUSED);
        g_assert_nonnull(strstr(message(b), "HASH"));
        g_assert_nonnull(strstr(message(b), "HELD) and the run is still on: abort it"));
        g_assert_cmpint(bus_status(b).state, ==, FB_STATE_HELD);
        g_assert_false(bus_status(b).agent_lost);
        bus_command(b, FB_COMMAND_ABORT);
        g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
        g_assert_no_error(b->agents[BUS_CONTROL].error);
    }
}

/* The credit that a gate brings is used before the next beat would tell of it. */
static void credit_is_used_at_once(void)
{
    static const BusSetup setup = {BUS_MODBUS, BUS_DRIP, 4, 218, false, false};
    g_autoptr(Bus) b = bus_new(&setup, NULL, 0);
    start_run(b);
    for (uint32_t gate = 1; gate < BUS_GATES - 1; gate++) {
        while (b->on && b->progress.gate < gate)
            bus_turn(b);
        const uint64_t received = bus_status(b).received;
        const int64_t since_us = b->now_us;
        while (b->on && bus_status(b).received == received)
            bus_turn(b);
        g_assert_cmpint(b->now_us - since_us, <, 100000);
    }
}

static void add(void)
{
    g_test_add_func("/fieldbus/delivery/goes-on-from-received", goes_on_from_received);
    g_test_add_func("/fieldbus/delivery/link-loss-while-running", link_loss_while_running);
    g_test_add_func("/fieldbus/delivery/gives-up", gives_up);
    g_test_add_func("/fieldbus/delivery/how-a-run-ends", how_a_run_ends);
    g_test_add_func("/fieldbus/delivery/lease-of-another", lease_of_another_is_respected);
    g_test_add_func("/fieldbus/delivery/refusals-are-told", refusals_are_told);
    g_test_add_func("/fieldbus/delivery/start-of-another-epoch", start_of_another_epoch);
    g_test_add_func("/fieldbus/delivery/chunks-fit-their-carrier", chunks_fit_their_carrier);
    g_test_add_func("/fieldbus/delivery/releases-whatever-is-lost", releases_whatever_is_lost);
    g_test_add_func("/fieldbus/delivery/memory-untold", memory_untold);
    g_test_add_func("/fieldbus/delivery/no-setup", no_setup);
    g_test_add_func("/fieldbus/delivery/setup-moves", setup_moves);
    g_test_add_func("/fieldbus/delivery/alarm-moves", alarm_moves);
    g_test_add_func("/fieldbus/delivery/closes-at-every-request", closes_at_every_request);
    g_test_add_func("/fieldbus/delivery/closes-at-every-beat", closes_at_every_beat);
    g_test_add_func("/fieldbus/delivery/rest-is-refused", rest_is_refused);
    g_test_add_func("/fieldbus/delivery/credit-is-used-at-once", credit_is_used_at_once);
    g_test_add_func("/fieldbus/delivery/no-bytes-of-another-program", no_bytes_of_another_program);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
