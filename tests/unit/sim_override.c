/* SPDX-License-Identifier: Apache-2.0 */
/* Overrides in a run: speeds, times, limits of the axes; the same however the clock is looked at.
 */
#include "tests/unit/sim_trace.h"

#define SECOND 1000000

/* X to 100 mm at 50 mm/s, 800 mm/s². */
static const char *const straight = "G21 G90 G53 G1 X100 F3000\nM30\n";

/* From 50 to 100 and to 25 mm/s: 62.5 and 31.25 ms, 4.6875 and 1.171875 mm. */
static void steps_of_feed(void)
{
    static const struct {
        int percent;
        double speed_mm_s, ramp_s;
    } cases[] = {{200, 100, 0.0625}, {50, 25, 0.03125}, {150, 75, 0.03125}, {1, 0.5, 0.061875}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Rig rig;
        rig_start(&rig, 1, straight, NULL, 0);
        rig_tick(&rig, SECOND);
        const double x = rig_see(&rig).position_mm[0], v = cases[i].speed_mm_s;
        rig_override(&rig, cases[i].percent, 100, 100);
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
        test_near(rig_see(&rig).feed_mm_min, 3000, 1e-9, 0);
        rig_tick(&rig, (int64_t)(cases[i].ramp_s * SECOND / 2));
        test_near(rig_see(&rig).feed_mm_min, 60 * (50 + v) / 2, 0.1, 0);
        rig_tick(&rig, (int64_t)(cases[i].ramp_s * SECOND / 2) + 1000);
        test_near(rig_see(&rig).feed_mm_min, 60 * v, 1e-9, 0);
        rig_run(&rig, 10000, 200);
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
        const double ramp_mm = (50 + v) / 2 * cases[i].ramp_s, stop_mm = v * v / 1600;
        const double end_s = 1 + cases[i].ramp_s + (100 - x - ramp_mm - stop_mm) / v + v / 800;
        test_near(rig_block(&rig, 0).end_s, end_s, 1e-9, 0);
        rig_clear(&rig);
    }
}

/* Before the start it is in force from the first move; the plan is the machine's own. */
static void before_the_start(void)
{
    Rig rig;
    rig_init(&rig, 1, 1000);
    rig_load(&rig, "G21 G90 G53 G0 X100\nG53 G1 X200 F3000\nM30\n", NULL, 0);
    rig_override(&rig, 50, 25, 100);
    rig_do(&rig, SIM_START);
    rig_run(&rig, 1000, 60);
    /* 200 mm/s at 25 % is 50; 50 at 50 % is 25. Both from rest? No: the corner is none, the two are
     * collinear, so 25 in between. */
    const double rapid_s = 50.0 / 800 + 25.0 / 800 + (100 - (2500 + 2500 - 625) / 1600.0) / 50;
    test_near(rig_block(&rig, 0).end_s, rapid_s, 1e-9, 0);
    test_near(rig_block(&rig, 1).end_s - rapid_s, 25.0 / 800 + (100 - 625 / 1600.0) / 25, 1e-9, 0);
    rig_clear(&rig);
}

/* 0 %: stands within what it forbids, RUNNING, until it is raised; the clock does not count. */
static void nought(void)
{
    Rig rig;
    rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, SECOND);
    const double x = rig_see(&rig).position_mm[0];
    rig_override(&rig, 0, 100, 100);
    rig_run(&rig, 1000, 1);
    FbProgress see = rig_see(&rig);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
    test_near(see.position_mm[0], x + 1.5625, 1e-9, 0);
    g_assert_cmpfloat(see.feed_mm_min, ==, 0);
    g_assert_false(see.starving);
    rig_tick(&rig, 100 * SECOND);
    g_assert_cmpuint(rig_see(&rig).program_time_ms, ==, see.program_time_ms);
    /* It can be held and resumed there, and stands. */
    rig_do(&rig, SIM_HOLD);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    rig_do(&rig, SIM_RESUME);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
    g_assert_false(sim_controller_moving(rig.controller));
    rig_override(&rig, 100, 100, 100);
    g_assert_true(sim_controller_moving(rig.controller));
    rig_run(&rig, 1000, 10);
    test_near(rig_block(&rig, 0).end_s, 2.0625 + 0.0625, 1e-9, 0);
    rig_clear(&rig);
    /* Feed 0 does not stop rapids, rapid 0 no feed: it stands before the first forbidden move. */
    const char *both = "G21 G90 F3000\nG53 G0 X50\nG53 G1 X60\nG53 G0 X100\nM30\n";
    rig_start(&rig, 1, both, NULL, 0);
    rig_override(&rig, 0, 100, 100);
    rig_run(&rig, 1000, 10);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 50);
    rig_override(&rig, 100, 0, 100);
    rig_run(&rig, 1000, 10);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 60);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
    g_assert_cmpuint(rig_blocks(&rig), ==, 2);
    rig_do(&rig, SIM_ABORT);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_READY);
    /* Nothing sets off before it may, the way to the program neither. */
    rig_do(&rig, SIM_START);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
    g_assert_false(sim_controller_moving(rig.controller));
    rig_override(&rig, 100, 100, 100);
    rig_run(&rig, 1000, 60);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
}

/* The spindle goes over at its own rate, within its range; a programmed change waits for it. */
static void spindle(void)
{
    Rig rig;
    rig_start(&rig, 1, "G21 G90 S15000 M3\nG4 P10\nS10000\nG4 P1\nM5\nM30\n", NULL, 0);
    rig_tick(&rig, SECOND);
    g_assert_cmpfloat(rig_see(&rig).spindle_rpm, ==, 5000);
    rig_tick(&rig, 4 * SECOND);
    g_assert_cmpfloat(rig_see(&rig).spindle_rpm, ==, 15000);
    rig_override(&rig, 100, 100, 120);
    g_assert_cmpfloat(rig_see(&rig).spindle_rpm, ==, 15000);
    rig_tick(&rig, SECOND / 2);
    test_near(rig_see(&rig).spindle_rpm, 17500, 1e-6, 0);
    rig_override(&rig, 100, 100, 200);
    rig_tick(&rig, 2 * SECOND);
    g_assert_cmpfloat(rig_see(&rig).spindle_rpm, ==, 20000); /* the machine's most */
    /* Just before the change to S10000 with 50 %: 20000 → 5000 in 3 s, 0.1 s in the dwell. */
    while (rig_see(&rig).program_time_ms < 12900)
        rig_tick(&rig, 1000);
    rig_override(&rig, 100, 100, 50);
    rig_run(&rig, 1000, 60);
    const SimBlock change = rig_block(&rig, 2);
    g_assert_cmpuint(change.line, ==, 3);
    g_assert_cmpfloat(change.spindle_rpm, ==, 5000);
    test_near(change.end_s - change.start_s, 2.9, 2e-3, 0);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
    /* In the spin-up itself: what is left of the way is longer, or shorter. */
    rig_start(&rig, 1, "S5000 M3\nG4 P1\nM30\n", NULL, 0);
    rig_tick(&rig, SECOND / 2);
    rig_override(&rig, 100, 100, 200);
    rig_run(&rig, 1000, 60);
    test_near(rig_block(&rig, 0).end_s, 2, 1e-9, 0);
    g_assert_cmpfloat(rig_block(&rig, 0).spindle_rpm, ==, 10000);
    rig_clear(&rig);
}

/* ------------------------------------------------------------- random programs, at random */

static char *random_program(GRand *rand)
{
    GString *text = g_string_new("G21 G90 G94 G64 P0.02 F5000\n");
    double x = 0, y = 0, z = 0;
    for (int i = 0; i < 200; i++) {
        const int kind = g_rand_int_range(rand, 0, 12);
        const double reach = kind < 6 ? 40 : 0.5;
        if (kind == 0) {
            g_string_append(text, "G4 P0.05\n");
        } else if (kind == 1) {
            g_string_append_printf(text, "G53 G1 X%.4f Y%.4f Z%.4f\n", x, y, z);
        } else if (kind <= 3) {
            g_string_append_printf(text, "G91 G%d I%.4f J%.4f\nG90\n", kind,
                                   g_rand_double_range(rand, 0.5, 20),
                                   g_rand_double_range(rand, -20, 20));
        } else {
            x = CLAMP(x + g_rand_double_range(rand, -reach, reach), -400, 400);
            y = CLAMP(y + g_rand_double_range(rand, -reach, reach), -400, 400);
            z = CLAMP(z + g_rand_double_range(rand, -reach, reach), -400, 400);
            g_string_append_printf(text, "G53 G%d X%.4f Y%.4f Z%.4f", kind > 4, x, y, z);
            g_string_append_printf(text, kind > 4 ? " F%d\n" : "\n",
                                   500 * g_rand_int_range(rand, 1, 20));
        }
    }
    g_string_append(text, "M30\n");
    return g_string_free(text, FALSE);
}

static void random_override(Rig *rig, GRand *rand)
{
    static const int feeds[] = {0, 10, 50, 90, 100, 110, 150, 200}, rapids[] = {0, 5, 50, 100};
    rig_override(rig, feeds[g_rand_int_range(rand, 0, 8)], rapids[g_rand_int_range(rand, 0, 4)],
                 g_rand_int_range(rand, 50, 201));
}

/* Sampled every millisecond: no limit of an axis is exceeded, whatever is turned and held when. */
static void turn_at_random(GRand *rand, double jerk, unsigned *n_overrides, unsigned *stood)
{
    Rig rig;
    rig_init(&rig, 1, 100000);
    for (int axis = 0; axis < 3; axis++)
        rig.machine.axis[axis].max_mm_s3 = jerk * (1 + axis);
    g_autofree char *text = random_program(rand);
    const SimProgram *program = rig_load(&rig, text, NULL, 0);
    rig_do(&rig, SIM_START);
    Trace trace = {.n = 0};
    int wrong = 0;
    while (program && rig_state(&rig) != FB_STATE_COMPLETE && rig.now_us < 900 * SECOND) {
        if (g_rand_int_range(rand, 0, 150) == 0) {
            random_override(&rig, rand);
            ++*n_overrides;
        } else if (g_rand_int_range(rand, 0, 900) == 0) {
            rig_do(&rig, SIM_HOLD);
        } else if (rig_state(&rig) == FB_STATE_HELD) {
            rig_do(&rig, SIM_RESUME);
        }
        if (!sim_controller_moving(rig.controller) && rig_state(&rig) == FB_STATE_RUNNING) {
            ++*stood;
            rig_override(&rig, 100, 100, 100);
        }
        rig_tick(&rig, 1000);
        wrong += trace_excess(&trace, &rig.machine, rig_see(&rig).position_mm) > 0;
    }
    g_test_message("%d excesses", wrong);
    g_assert_cmpint(wrong, ==, 0);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
}

static void limits_are_kept(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(31);
    unsigned n_overrides = 0, stood = 0;
    for (int trial = 0; trial < 6; trial++)
        turn_at_random(rand, trial % 2 * 20000, &n_overrides, &stood);
    g_test_message("%u overrides, stood %u times", n_overrides, stood);
    g_assert_cmpuint(n_overrides, >, 100);
    g_assert_cmpuint(stood, >, 5);
}

/* Turned down while the plan brakes into a rounded corner, and up again: where little jerk is
 * allowed, levelling off takes so long that it may not reach past the corner. */
static void turn_at_corners(GRand *rand)
{
    Rig rig;
    rig_init(&rig, 1, 100000);
    for (int axis = 0; axis < 3; axis++)
        rig.machine.axis[axis].max_mm_s3 = 1000 * (1 + axis);
    g_autoptr(GString) text = g_string_new("G21 G90 G94 G64 P0.02 F5000\n");
    for (int i = 1; i <= 60; i++)
        g_string_append_printf(text, "G53 G1 X%.3f Y%.3f\n",
                               40 * (i % 2) + g_rand_double_range(rand, -2, 2), 5.0 * i);
    g_string_append(text, "M30\n");
    rig_load(&rig, text->str, NULL, 0);
    rig_do(&rig, SIM_START);
    Trace trace = {.n = 0};
    int wrong = 0, n = 0;
    while (rig_state(&rig) == FB_STATE_RUNNING && rig.now_us < 900 * SECOND) {
        if (g_rand_int_range(rand, 0, 150) == 0)
            rig_override(&rig, n++ % 2 ? 100 : 30, 100, 100);
        rig_tick(&rig, 1000);
        wrong += trace_excess(&trace, &rig.machine, rig_see(&rig).position_mm) > 0;
    }
    g_test_message("%d overrides, %d excesses", n, wrong);
    g_assert_cmpint(n, >, 400);
    g_assert_cmpint(wrong, ==, 0);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
}

static void corners(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(1);
    for (int trial = 0; trial < 6; trial++)
        turn_at_corners(rand);
}

/* -------------------------------------------------------------------------- exactness */

/* The ends of all blocks, with overrides at the same program times. */
static void run_with_overrides(const char *text, double speed, int64_t tick_us, const double *at_s,
                               size_t n_at, GArray *ends)
{
    static const int percents[] = {40, 180, 100, 15, 200, 70, 100};
    Rig rig;
    rig_start(&rig, speed, text, NULL, 0);
    size_t next = 0;
    while (rig_state(&rig) == FB_STATE_RUNNING && rig.now_us < 900 * SECOND) {
        const int64_t at_us = next < n_at ? (int64_t)(at_s[next] * SECOND) : INT64_MAX;
        if (rig.now_us + tick_us < at_us) {
            rig_tick(&rig, tick_us);
        } else {
            rig_tick(&rig, at_us - rig.now_us);
            rig_override(&rig, percents[next % 7], 100 - 10 * ((int)next % 3), 100);
            next++;
        }
    }
    guint i = 0;
    for (const SimBlock *block; (block = rig_next_block(&rig, &i)) != NULL;)
        g_array_append_val(ends, block->end_s);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
}

static void independent_of_ticks(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(4);
    g_autofree char *text = random_program(rand);
    const double at_s[] = {0.5, 0.501, 1.25, 3.7, 4.2, 6, 9.5, 9.51, 9.52, 12, 15.1};
    static const int64_t tick_us[] = {200000, 1000, 137};
    GArray *ends[3];
    for (size_t k = 0; k < 3; k++) {
        ends[k] = g_array_new(FALSE, FALSE, sizeof(double));
        run_with_overrides(text, 1, tick_us[k], at_s, G_N_ELEMENTS(at_s), ends[k]);
        g_assert_cmpuint(ends[k]->len, ==, ends[0]->len);
        for (guint i = 0; i < MIN(ends[k]->len, ends[0]->len); i++)
            test_near(g_array_index(ends[k], double, i), g_array_index(ends[0], double, i), 1e-8,
                      0);
    }
    for (size_t k = 0; k < 3; k++)
        g_array_unref(ends[k]);
}

/* Without a clock an override comes between two blocks; with one, at the very time of that. */
static void same_without_a_clock(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(9);
    g_autofree char *text = random_program(rand);
    Rig fast;
    rig_init(&fast, INFINITY, 20);
    rig_load(&fast, text, NULL, 0);
    rig_do(&fast, SIM_START);
    double at_s[3];
    static const int percents[] = {60, 200, 35};
    for (int k = 0; k < 3; k++) {
        rig_tick(&fast, 1);
        rig_tick(&fast, 1);
        at_s[k] = rig_last_block(&fast).end_s;
        rig_override(&fast, percents[k], 100, 100);
    }
    rig_run(&fast, 1, 1);
    Rig real;
    rig_start(&real, 1, text, NULL, 0);
    for (int k = 0; k < 3; k++) {
        rig_tick(&real, (int64_t)round(at_s[k] * SECOND) - real.now_us);
        rig_override(&real, percents[k], 100, 100);
    }
    rig_run(&real, 1000, 900);
    g_assert_cmpuint(rig_blocks(&real), ==, rig_blocks(&fast));
    /* The clock passed in is in whole microseconds, the time of a block's end is not: three
     * overrides, each at most half a microsecond off. */
    test_near(rig_last_block(&real).end_s, rig_last_block(&fast).end_s, 1e-5, 0);
    rig_clear(&fast);
    rig_clear(&real);
}

/* The plan may come late: the run goes on by the old one until then; out of rest it waits. */
static void plan_comes_late(void)
{
    Rig rig;
    rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, SECOND);
    SimEvent turn = {.kind = SIM_OVERRIDE, .override = {50, 100, 100}};
    sim_controller_step(rig.controller, &turn, rig.now_us, rig.actions);
    rig.now_us += SECOND / 2;
    sim_controller_step(rig.controller, &(SimEvent){.kind = SIM_TICK}, rig.now_us, rig.actions);
    test_near(rig_see(&rig).feed_mm_min, 3000, 1e-9, 0);
    rig_do(&rig, SIM_TICK); /* brings it */
    rig_tick(&rig, SECOND / 10);
    test_near(rig_see(&rig).feed_mm_min, 1500, 1e-9, 0);
    /* One for a percentage that is not in force any more is thrown away. */
    NcOverride wanted;
    turn.override.feed = 70;
    sim_controller_step(rig.controller, &turn, rig.now_us, rig.actions);
    SimProgram *program = sim_controller_unplanned(rig.controller, &wanted);
    g_assert_nonnull(program);
    if (program) {
        SimEvent old = {.kind = SIM_PLAN,
                        .program = program,
                        .plan = sim_plan_new(program, &rig.machine, (NcOverride){10, 10, 100})};
        sim_controller_step(rig.controller, &old, rig.now_us, rig.actions);
        g_assert_true(sim_controller_unplanned(rig.controller, &wanted) == program);
    }
    rig_do(&rig, SIM_HOLD);
    rig_run(&rig, 1000, 2);
    turn.override.feed = 20;
    sim_controller_step(rig.controller, &turn, rig.now_us, rig.actions);
    sim_controller_step(rig.controller, &(SimEvent){.kind = SIM_RESUME}, rig.now_us, rig.actions);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
    g_assert_false(sim_controller_moving(rig.controller));
    rig_do(&rig, SIM_TICK);
    g_assert_true(sim_controller_moving(rig.controller));
    rig_run(&rig, 1000, 60);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
}

/* A hold at the gate keeps to its gate while the feed is turned. */
static void gate_while_turning(void)
{
    const char *text = "G21 G90 G64 P0.01 F3000\nG53 G1 X10\nG53 G1 X20\nG53 G1 X30\nM30\n";
    const uint64_t gates[] = {(uint64_t)(strstr(text, "G53 G1 X30") - text), strlen(text)};
    static const int percents[] = {20, 200, 0, 70};
    for (size_t i = 0; i < G_N_ELEMENTS(percents); i++) {
        Rig rig;
        rig_start(&rig, 1, text, gates, G_N_ELEMENTS(gates));
        rig_tick(&rig, 100000);
        rig_do(&rig, SIM_HOLD_AT_GATE);
        rig_override(&rig, percents[i], 100, 100);
        rig_run(&rig, 1000, 10);
        if (percents[i] == 0) {
            g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
            rig_override(&rig, 100, 100, 100);
            rig_run(&rig, 1000, 10);
        }
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
        g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 20);
        rig_do(&rig, SIM_RESUME);
        rig_run(&rig, 1000, 10);
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
        rig_clear(&rig);
    }
}

static void add(void)
{
    g_test_add_func("/sim/override/feed", steps_of_feed);
    g_test_add_func("/sim/override/before-the-start", before_the_start);
    g_test_add_func("/sim/override/nought", nought);
    g_test_add_func("/sim/override/spindle", spindle);
    g_test_add_func("/sim/override/limits", limits_are_kept);
    g_test_add_func("/sim/override/corners", corners);
    g_test_add_func("/sim/override/ticks", independent_of_ticks);
    g_test_add_func("/sim/override/no-clock", same_without_a_clock);
    g_test_add_func("/sim/override/late-plan", plan_comes_late);
    g_test_add_func("/sim/override/gate", gate_while_turning);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
