/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Faults on the connection that carries HOLD, RESUME and ABORT, and several faults in one work, at
 * random. `make check` takes the same ones each time; SEGMILL_SWEEP=N takes N others, with a seed
 * that is printed, and that SEGMILL_SEED gives again.
 */
#include <stdlib.h>

#include "tests/lib/fb_work.h"
#include "tests/lib/test.h"

/* ------------------------------------------------------------- the control connection */

/* A person's button: pressed again by a person whose agent died, while the machine does not do what
 * was asked. False: it was refused, or cannot be said. */
static bool press(Bus *b, FbCommand command, FbState until)
{
    const BusAgent *a = &b->agents[BUS_CONTROL];
    for (int i = 0; i < 4; i++) {
        const unsigned lives = a->lives;
        bus_command(b, command);
        bus_run(b, BUS_CONTROL, FB_TASK_COMMAND);
        if (a->lives == lives)
            return a->ended[FB_TASK_COMMAND] && !a->error;
        bus_wait(b, G_USEC_PER_SEC);
        if (bus_status(b).state == until)
            return true;
    }
    return false;
}

typedef enum { HOLD_WHILE_LOADING, HOLD_AND_RESUME, ABORT_RUN, HOLD_AND_ABORT, N_SCRIPTS } Script;

static const char *const script_names[] = {"HOLD while loading", "HOLD, RESUME", "ABORT",
                                           "HOLD, ABORT"};

/* The faults count from here. */
static void arm(Bus *b, const Fault *fault)
{
    b->faults[0] = *fault;
    b->faults[0].at += b->agents[BUS_CONTROL].frames;
}

static void hold(Bus *b)
{
    const BusAgent *a = &b->agents[BUS_CONTROL];
    const bool held = press(b, FB_COMMAND_HOLD, FB_STATE_HELD);
    bus_wait(b, G_USEC_PER_SEC);
    const FbState state = bus_status(b).state;
    if (held && state != FB_STATE_OFF && b->on)
        g_assert_cmpstr(fb_state_name(state), ==, "HELD");
    if (a->lives == 1)
        g_assert_cmpuint(b->holds, <=, 1);
}

/* Until the run is on and its first lines are executed. */
static void run_begins(Bus *b)
{
    bus_deliver(b);
    bus_run(b, BUS_WORK, FB_TASK_DELIVER);
    bus_start(b);
    while (b->executed->len < 300)
        bus_turn(b);
}

/* The script under the fault; the frames of the control connection that it took. */
static unsigned play(Bus *b, Script script, const Fault *fault)
{
    BusAgent *control = &b->agents[BUS_CONTROL];
    unsigned first;
    if (script == HOLD_WHILE_LOADING) {
        bus_deliver(b);
        while (bus_status(b).received < 3000 && !b->agents[BUS_WORK].ended[FB_TASK_DELIVER])
            bus_turn(b);
        first = control->frames;
        arm(b, fault);
        g_assert_false(press(b, FB_COMMAND_HOLD, FB_STATE_HELD));
        bus_run(b, BUS_WORK, FB_TASK_DELIVER);
        bus_start(b);
    } else {
        run_begins(b);
        first = control->frames;
        arm(b, fault);
        if (script != ABORT_RUN)
            hold(b);
        if (script == HOLD_AND_RESUME && b->on)
            press(b, FB_COMMAND_RESUME, FB_STATE_RUNNING);
        else if (b->on)
            press(b, FB_COMMAND_ABORT, FB_STATE_READY);
    }
    const unsigned frames = control->frames - first;
    bus_run(b, BUS_WORK, FB_TASK_RUN);
    work_settle(b);
    return frames;
}

static unsigned script_ends(Script script, FaultKind kind)
{
    const bool reboot = kind == FAULT_REBOOT_BEFORE || kind == FAULT_REBOOT_AFTER;
    const unsigned aborts = script == ABORT_RUN || script == HOLD_AND_ABORT;
    return (aborts ? 1 << END_ABORTED : 1 << END_DONE) |
           (reboot ? 1 << END_STOPPED | 1 << END_REFUSED : 0);
}

static unsigned control_case(const BusSetup *setup, Script script, Fault fault)
{
    g_autoptr(Bus) b = bus_new(setup, NULL, 0);
    const unsigned frames = play(b, script, &fault);
    const unsigned lives = b->agents[BUS_CONTROL].lives;
    const bool good = work_check(b, script_ends(script, fault.kind));
    g_assert_cmpuint(b->resumes, <=, script == HOLD_AND_RESUME ? lives : 0);
    g_assert_cmpuint(b->holds, <=, lives);
    if (!good)
        g_test_message("in the script %s", script_names[script]);
    return frames;
}

static unsigned control_script(const BusSetup *setup, Script script)
{
    const unsigned n = control_case(setup, script, (Fault){.agent = BUS_CONTROL});
    unsigned cases = 0;
    for (FaultKind kind = FAULT_NONE + 1; kind < FAULT_N_KINDS; kind++) {
        const bool damaged = kind == FAULT_REQUEST_DAMAGED || kind == FAULT_REPLY_DAMAGED;
        for (unsigned at = 0; at < n; at++)
            for (unsigned bit = 3; bit < (damaged ? 1900u : 4u); bit += 230, cases++)
                control_case(setup, script, (Fault){kind, BUS_CONTROL, at, bit});
    }
    return cases;
}

static void control(void)
{
    for (BusCarrier carrier = 0; carrier < BUS_N_CARRIERS; carrier++)
        for (BusMode mode = BUS_STORED; mode <= BUS_DRIP; mode++)
            for (Script script = 0; script < N_SCRIPTS; script++) {
                unsigned cases = 0;
                const uint16_t windows = carrier == BUS_CAN ? 1 : FB_WINDOW_MOST;
                const uint16_t chunk = carrier == BUS_CAN ? 700 : 218;
                BusSetup setup = {carrier, mode, 1, chunk, false, false};
                for (; setup.window <= windows; setup.window++)
                    cases += control_script(&setup, script);
                g_test_message("%s, %s: %u cases", bus_setup_name(&setup), script_names[script],
                               cases);
            }
}

/* ----------------------------------------------------------------------------- random */

/* What several faults may lead to: what each may. An agent that was cut off for long enough to be
 * lost leaves the machine HELD at a gate. And where a command of one that died comes late, another
 * program of this agent seems to be at work, and the next one is refused. */
static unsigned ends_of_all(const Fault *faults, unsigned n)
{
    unsigned ends = 1 << END_HELD;
    for (unsigned i = 0; i < n; i++)
        ends |= work_ends(faults[i].kind) |
                (faults[i].kind >= FAULT_KILLED_BEFORE ? 1 << END_REFUSED : 0);
    return ends;
}

static void random_case(GRand *rand)
{
    static const uint16_t chunks[] = {218, 218, 700, FB_CHUNK_BYTES};
    Fault faults[BUS_FAULTS] = {0};
    const unsigned n = (unsigned)g_rand_int_range(rand, 2, BUS_FAULTS + 1);
    BusSetup setup = {.carrier = (BusCarrier)g_rand_int_range(rand, 0, BUS_N_CARRIERS),
                      .mode = (BusMode)g_rand_int_range(rand, 0, BUS_N_MODES),
                      .window = (uint16_t)g_rand_int_range(rand, 1, FB_WINDOW_MOST + 1)};
    setup.attended = g_rand_boolean(rand);
    setup.chunk_max = setup.carrier == BUS_MODBUS ? 218 : chunks[g_rand_int_range(rand, 0, 4)];
    const int most = setup.mode == BUS_RESTART ? 40 : 90;
    for (unsigned i = 0; i < n; i++) {
        faults[i] = (Fault){(FaultKind)g_rand_int_range(rand, 1, FAULT_N_KINDS), BUS_WORK,
                            (unsigned)g_rand_int_range(rand, 0, most),
                            (unsigned)g_rand_int_range(rand, 0, 8 * FB_BLOCK_BYTES)};
        /* Half of them come close behind the one before: they meet in the recovery. */
        if (i > 0 && g_rand_boolean(rand))
            faults[i].at = faults[i - 1].at + (unsigned)g_rand_int_range(rand, 1, 6);
    }
    g_autoptr(Bus) b = bus_new(&setup, faults, n);
    work(b);
    work_settle(b);
    work_check(b, ends_of_all(faults, n));
}

static void pairs_and_triples(void)
{
    const char *asked = g_getenv("SEGMILL_SWEEP"), *given = g_getenv("SEGMILL_SEED");
    const unsigned long cases = asked ? strtoul(asked, NULL, 10) : 10000;
    const guint32 seed = given ? (guint32)strtoul(given, NULL, 10) : asked ? g_random_int() : 1;
    g_autoptr(GRand) rand = g_rand_new_with_seed(seed);
    g_test_message("SEGMILL_SEED=%u SEGMILL_SWEEP=%lu", seed, cases);
    for (unsigned long i = 0; i < cases; i++)
        random_case(rand);
    g_test_message("pairs and triples of faults: %lu cases", cases);
}

static void add(void)
{
    g_test_add_func("/fieldbus/faults/control", control);
    g_test_add_func("/fieldbus/faults/pairs-and-triples", pairs_and_triples);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
