/* SPDX-License-Identifier: Apache-2.0 */
/* What sets the machine in motion does so when a person asks for it, or not at all. */
#include <string.h>

#include "tests/lib/fb_bus.h"
#include "tests/lib/test.h"

/* A machine that nobody reaches for some seconds, from before the act on, or just when it is made.
 */
typedef struct {
    FbCommand command;
    bool before;
    int64_t silent_us;
} Silence;

/* Before the act: a machine that is ready to start, or HELD. */
static Bus *prepare(FbCommand command)
{
    const BusSetup setup = {
        BUS_MODBUS, command == FB_COMMAND_RESTART ? BUS_RESTART : BUS_STORED, 1, 218, false, false};
    Bus *b = bus_new(&setup, NULL, 0);
    if (setup.mode == BUS_STORED) {
        bus_deliver(b);
        g_assert_true(bus_run(b, BUS_WORK, FB_TASK_DELIVER));
    }
    if (command == FB_COMMAND_RESUME) {
        bus_start(b);
        while (b->starts == 0)
            bus_turn(b);
        bus_command(b, FB_COMMAND_HOLD);
        g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
        bus_wait(b, G_USEC_PER_SEC);
        g_assert_cmpint(bus_status(b).state, ==, FB_STATE_HELD);
    }
    return b;
}

static void act(Bus *b, FbCommand command)
{
    if (command == FB_COMMAND_RESUME)
        bus_command(b, FB_COMMAND_RESUME);
    else
        bus_start(b);
}

/* It is on its way to the machine, or next: a RESTART behind the LEASE. */
static bool is_asked(const Bus *b, const BusAgent *a, FbCommand command)
{
    return a->n_flights > 0 && a->kinds[0] == FB_REQUEST_COMMAND &&
           (command != FB_COMMAND_RESTART || bus_status(b).lease_owner != 0);
}

/* START, RESTART or RESUME into the silence; true: the machine was set in motion, however late. */
static bool moves(const Silence *c)
{
    const bool resume = c->command == FB_COMMAND_RESUME;
    const FbTask task = resume ? FB_TASK_COMMAND : FB_TASK_RUN;
    g_autoptr(Bus) b = prepare(c->command);
    const BusAgent *a = &b->agents[resume ? BUS_CONTROL : BUS_WORK];
    if (c->before) {
        b->dead = true;
        bus_wait(b, 2 * G_USEC_PER_SEC);
    }
    act(b, c->command);
    while (!c->before && !is_asked(b, a, c->command))
        bus_turn(b);
    b->dead = true;
    bus_wait(b, c->silent_us);
    g_assert_false(a->ended[task]);
    b->dead = false;
    bus_wait(b, 3 * G_USEC_PER_SEC);
    const bool moved = resume ? b->resumes > 0 : b->starts > 0;
    if (moved)
        return true;
    const FbError error = c->before ? FB_ERROR_REFUSED : FB_ERROR_LINK_LOST;
    g_assert_true(a->ended[task]);
    g_assert_error(a->error, FB_ERROR, (int)error);
    if (a->error && !strstr(a->error->message, "NEEDS_ACKNOWLEDGE"))
        g_assert_nonnull(strstr(a->error->message, c->before ? "was not sent" : "is not known"));
    return false;
}

/* Nothing moves long after the act: whoever stands at the machine then does not expect it. */
static void nothing_moves_late(void)
{
    static const FbCommand movers[] = {FB_COMMAND_START, FB_COMMAND_RESTART, FB_COMMAND_RESUME};
    for (size_t i = 0; i < G_N_ELEMENTS(movers); i++)
        for (int before = 0; before < 2; before++) {
            g_assert_true(moves(&(Silence){movers[i], before, 500000}));
            /* agent_timeout is 5 s: it would want an acknowledgement by itself. */
            for (int64_t s = 3; s < 28; s++)
                g_assert_false(moves(&(Silence){movers[i], before, s * G_USEC_PER_SEC + 100000}));
        }
}

/* A stop that is asked for behind a RESUME that nobody answers ends it at once, and finds the
 * connection free; a START is not sent again, but what became of it is looked at. */
static void stops_withdraw(void)
{
    g_autoptr(Bus) b = prepare(FB_COMMAND_RESUME);
    BusAgent *control = &b->agents[BUS_CONTROL];
    act(b, FB_COMMAND_RESUME);
    while (!is_asked(b, control, FB_COMMAND_RESUME))
        bus_turn(b);
    b->dead = true;
    bus_wait(b, 1200000); /* its time-out has passed */
    g_assert_false(control->ended[FB_TASK_COMMAND]);
    const int64_t since_us = b->now_us;
    fb_delivery_withdraw(control->delivery);
    control->wake_us = b->now_us;
    g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
    g_assert_cmpint(b->now_us - since_us, <, 1000);
    g_assert_error(control->error, FB_ERROR, FB_ERROR_LINK_LOST);
    b->dead = false;
    bus_command(b, FB_COMMAND_HOLD);
    g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
    g_assert_no_error(control->error);
    g_assert_cmpuint(b->resumes, ==, 0);
    g_assert_cmpint(bus_status(b).state, ==, FB_STATE_HELD);

    for (unsigned taken = 0; taken < 2; taken++) {
        g_autoptr(Bus) c = prepare(FB_COMMAND_START);
        BusAgent *a = &c->agents[BUS_WORK];
        c->faults[0] =
            (Fault){taken ? FAULT_REPLY_LOST : FAULT_REQUEST_LOST, BUS_WORK, a->frames + 1, 0};
        bus_start(c);
        bus_wait(c, 500000);
        fb_delivery_withdraw(a->delivery);
        a->wake_us = c->now_us;
        if (taken) {
            g_assert_true(bus_run(c, BUS_WORK, FB_TASK_RUN));
            g_assert_no_error(a->error);
        } else {
            bus_wait(c, 5 * G_USEC_PER_SEC);
            g_assert_true(a->ended[FB_TASK_RUN]);
            g_assert_error(a->error, FB_ERROR, FB_ERROR_LINK_LOST);
        }
        g_assert_cmpuint(c->starts, ==, taken);
    }
}

/* The answer to START comes when a beat is due, and the machine has answered a HOLD since: the beat
 * brings that one's answer, and START's must have been taken before. */
static void answer_before_beat(void)
{
    g_autoptr(Bus) b = prepare(FB_COMMAND_START);
    BusAgent *a = &b->agents[BUS_WORK];
    bus_start(b);
    while (!is_asked(b, a, FB_COMMAND_START))
        bus_turn(b);
    a->order_us[0] = b->now_us + 600000; /* more than a heartbeat, less than the time-out */
    while (b->starts == 0)
        bus_turn(b);
    fb_delivery_withdraw(a->delivery);
    bus_command(b, FB_COMMAND_HOLD);
    g_assert_true(bus_run(b, BUS_CONTROL, FB_TASK_COMMAND));
    g_assert_no_error(b->agents[BUS_CONTROL].error);
    bus_wait(b, G_USEC_PER_SEC);
    g_assert_false(a->ended[FB_TASK_RUN]);
    g_assert_no_error(a->error);
    bus_command(b, FB_COMMAND_RESUME);
    g_assert_true(bus_run(b, BUS_WORK, FB_TASK_RUN));
    g_assert_no_error(a->error);
    g_assert_cmpuint(b->completed, ==, 1);
}

static void add(void)
{
    g_test_add_func("/fieldbus/movers/nothing-moves-late", nothing_moves_late);
    g_test_add_func("/fieldbus/movers/stops-withdraw", stops_withdraw);
    g_test_add_func("/fieldbus/movers/answer-before-beat", answer_before_beat);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
