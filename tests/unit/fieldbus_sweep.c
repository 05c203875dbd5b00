/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Delivery and run under every single fault: every frame × every kind of fault × both carriers ×
 * every window, of a program that is stored, that drips, and of a restart at a gate. The program is
 * executed as it is, once, or the run stops in a named state at a known block.
 */
#include "tests/lib/fb_work.h"
#include "tests/lib/test.h"

static unsigned frames_without_fault(const BusSetup *setup)
{
    g_autoptr(Bus) b = bus_new(setup, NULL, 0);
    work(b);
    work_settle(b);
    const FbStatus s = bus_status(b);
    work_check(b, 1 << END_DONE);
    g_assert_cmpint(s.state, ==, FB_STATE_COMPLETE);
    g_assert_cmpint(s.lease_owner, ==, 0);
    g_assert_cmpuint(b->starved, ==, 0);
    const BusAgent *a = &b->agents[BUS_WORK];
    if (setup->mode != BUS_RESTART)
        g_assert_cmpuint(a->most_flights, ==, setup->carrier == BUS_CAN ? 1 : setup->window);
    return a->frames;
}

/* Places of a damage: the fields of every kind of block are met. At the windows between the
 * smallest and the largest the first of them will do; below is every byte. */
static const unsigned places[] = {3,   230, 100, 1979, 37,   70,  133,
                                  166, 200, 213, 300,  1000, 500, 1500};
enum { FEW_PLACES = 4 };

typedef struct {
    unsigned cases, ends[END_BAD + 1];
} Tally;

static void one(Tally *tally, const BusSetup *setup, Fault fault)
{
    g_autoptr(Bus) b = bus_new(setup, &fault, 1);
    work(b);
    work_settle(b);
    work_check(b, work_ends(fault.kind));
    g_assert_cmpuint(b->resumes, ==, 0);
    tally->cases++;
    tally->ends[work_end(b)]++;
}

static unsigned sweep(const BusSetup *setup)
{
    const unsigned n = frames_without_fault(setup);
    const bool extreme = setup->window == 1 || setup->window == FB_WINDOW_MOST;
    const size_t n_places = extreme ? G_N_ELEMENTS(places) : FEW_PLACES;
    Tally tally = {0};
    for (FaultKind kind = FAULT_NONE + 1; kind < FAULT_N_KINDS; kind++) {
        const bool damaged = kind == FAULT_REQUEST_DAMAGED || kind == FAULT_REPLY_DAMAGED;
        for (unsigned at = 0; at < n; at++)
            for (size_t i = 0; i < (damaged ? n_places : 1); i++)
                one(&tally, setup, (Fault){kind, BUS_WORK, at, places[i]});
    }
    g_test_message("%s, window %2u, chunks of %4u: %2u frames, %4u cases: %u done, %u refused, "
                   "%u stopped, %u held, %u untold",
                   bus_setup_name(setup), setup->window, setup->chunk_max, n, tally.cases,
                   tally.ends[END_DONE], tally.ends[END_REFUSED], tally.ends[END_STOPPED],
                   tally.ends[END_HELD], tally.ends[END_UNTOLD]);
    return tally.cases;
}

static void modbus(void)
{
    unsigned cases = 0;
    for (BusMode mode = 0; mode < BUS_N_MODES; mode++)
        for (uint16_t window = 1; window <= FB_WINDOW_MOST; window++)
            cases += sweep(&(BusSetup){BUS_MODBUS, mode, window, 218, false, false});
    g_test_message("Modbus: %u cases", cases);
}

/* The window is one, whatever the agent wishes. */
static void can(void)
{
    static const uint16_t chunks[] = {FB_CHUNK_BYTES, 700, 218}, windows[] = {1, FB_WINDOW_MOST};
    unsigned cases = 0;
    for (BusMode mode = 0; mode < BUS_N_MODES; mode++)
        for (size_t i = 0; i < G_N_ELEMENTS(chunks); i++)
            for (size_t j = 0; j < G_N_ELEMENTS(windows); j++)
                cases += sweep(&(BusSetup){BUS_CAN, mode, windows[j], chunks[i], false, false});
    g_test_message("CAN: %u cases", cases);
}

/* Every byte of every frame, there and back, a bit each. */
static void every_damaged_byte(void)
{
    static const BusSetup setups[] = {{BUS_MODBUS, BUS_STORED, 4, 218, false, false},
                                      {BUS_CAN, BUS_DRIP, 1, FB_CHUNK_BYTES, false, false}};
    for (size_t i = 0; i < G_N_ELEMENTS(setups); i++) {
        const unsigned n = frames_without_fault(&setups[i]);
        Tally tally = {0};
        for (unsigned at = 0; at < n; at++)
            for (unsigned byte = 0; byte < FB_STATUS_BYTES; byte++) {
                const unsigned bit = 8 * byte + (at + byte) % 8;
                one(&tally, &setups[i], (Fault){FAULT_REPLY_DAMAGED, BUS_WORK, at, bit});
                one(&tally, &setups[i], (Fault){FAULT_REQUEST_DAMAGED, BUS_WORK, at, bit});
            }
        g_test_message("%s: every byte of %u frames damaged: %u cases", bus_setup_name(&setups[i]),
                       n, tally.cases);
    }
}

static void add(void)
{
    g_test_add_func("/fieldbus/sweep/modbus", modbus);
    g_test_add_func("/fieldbus/sweep/can", can);
    g_test_add_func("/fieldbus/sweep/every-damaged-byte", every_damaged_byte);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
