/* SPDX-License-Identifier: Apache-2.0 */
/* Hold, resume, gates, stops, aborts and the emergency stop: where, when and how fast. */
#include "tests/unit/sim_trace.h"

#define SECOND 1000000

/* X to 100 mm at 50 mm/s, 800 mm/s²: braking takes 62.5 ms and 1.5625 mm. */
static const char *const straight = "G21 G90 G53 G1 X100 F3000\nM30\n";

static void mid_move(void)
{
    Rig rig;
    double planned_s = rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, SECOND);
    double x = rig_see(&rig).position_mm[0];
    rig_do(&rig, SIM_HOLD);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HOLDING);
    rig_tick(&rig, 62500 - 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HOLDING);
    rig_tick(&rig, 2);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    test_near(rig_see(&rig).position_mm[0], x + 1.5625, 1e-9, 0);
    g_assert_cmpfloat(rig_see(&rig).feed_mm_min, ==, 0);
    g_assert_cmpuint(rig_see(&rig).line, ==, 1);
    rig_tick(&rig, 60 * SECOND);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    rig_do(&rig, SIM_RESUME);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
    rig_tick(&rig, 62500);
    test_near(rig_see(&rig).position_mm[0], x + 3.125, 1e-6, 0);
    rig_run(&rig, 1000, 10);
    g_autofree char *states = rig_states(&rig);
    g_assert_cmpstr(states, ==, "IDLE READY RUNNING HOLDING HELD RUNNING COMPLETE");
    /* v/a lost: 2v/a of ramps in the place of 2·v²/2a at v. The minute held does not count. */
    test_near(rig_block(&rig, 0).end_s, planned_s + 0.0625, 1e-9, 0);
    rig_clear(&rig);
}

static void while_speeding_up_and_slowing_down(void)
{
    /* At 30 ms the machine has 24 mm/s: it stops as far again and needs as long. */
    Rig rig;
    double planned_s = rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, 30000);
    rig_do(&rig, SIM_HOLD);
    rig_run(&rig, 100, 1);
    test_near(rig_see(&rig).position_mm[0], 0.72, 1e-9, 0);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, 1000, 10);
    /* 0.72 mm done in 60 ms; from rest, the other 99.28 mm. */
    test_near(rig_block(&rig, 0).end_s, 0.06 + 99.28 / 50 + 0.0625, 1e-9, 0);
    rig_clear(&rig);
    /* In the last ramp the plan brakes as hard as it can: the hold ends at the move's end. */
    rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, (int64_t)((planned_s - 0.03) * SECOND));
    rig_do(&rig, SIM_HOLD);
    rig_run(&rig, 100, 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 100);
    g_assert_cmpuint(rig_blocks(&rig), ==, 1);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, 100, 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    test_near(rig_block(&rig, 1).end_s, planned_s, 1e-6, 0);
    rig_clear(&rig);
}

static void resumed_while_holding_and_held_while_resuming(void)
{
    Rig rig;
    double planned_s = rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, SECOND);
    double x = rig_see(&rig).position_mm[0];
    rig_do(&rig, SIM_HOLD);
    rig_tick(&rig, 31250);
    test_near(rig_see(&rig).feed_mm_min, 1500, 1e-6, 0);
    rig_do(&rig, SIM_RESUME);
    rig_tick(&rig, 15625);
    test_near(rig_see(&rig).feed_mm_min, 2250, 1e-6, 0);
    rig_do(&rig, SIM_HOLD);
    rig_run(&rig, 100, 1);
    /* 50 → 25 → 37.5 → 0 mm/s at 800 mm/s². */
    double to = (2500 - 625 + 1406.25 - 625 + 1406.25) / 1600;
    test_near(rig_see(&rig).position_mm[0], x + to, 1e-9, 0);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, 1000, 10);
    double ramps_s = (25 + 12.5 + 37.5 + 50) / 800.0;
    test_near(rig_block(&rig, 0).end_s, planned_s + ramps_s - (to + 1.5625) / 50, 1e-9, 0);
    rig_clear(&rig);
}

static void in_dwell(void)
{
    Rig rig;
    double planned_s = rig_start(&rig, 1, "G4 P2\nM30\n", NULL, 0);
    rig_tick(&rig, SECOND / 2);
    rig_do(&rig, SIM_HOLD);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    rig_tick(&rig, 30 * SECOND);
    g_assert_cmpuint(rig_blocks(&rig), ==, 0);
    rig_do(&rig, SIM_RESUME);
    rig_tick(&rig, 1499999);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
    rig_run(&rig, 1, 1);
    test_near(rig_block(&rig, 0).end_s, planned_s, 1e-12, 0);
    rig_clear(&rig);
}

static void in_tool_change(void)
{
    Rig rig;
    rig_start(&rig, 1, "T1 M6\nG21 G53 G0 X10\nM30\n", NULL, 0);
    rig_tick(&rig, SECOND);
    rig_do(&rig, SIM_HOLD);
    rig_tick(&rig, 2 * SECOND);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HOLDING);
    g_assert_cmpint(rig_see(&rig).tool, ==, 0);
    rig_tick(&rig, 2 * SECOND);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    g_assert_cmpint(rig_see(&rig).tool, ==, 1);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 0);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, 1000, 5);
    g_autofree char *states = rig_states(&rig);
    g_assert_cmpstr(states, ==, "IDLE READY RUNNING TOOL_CHANGE HOLDING HELD RUNNING COMPLETE");
    rig_clear(&rig);
}

/* Collinear moves of 10 mm at 50 mm/s: the plan passes each end at full speed. */
static const char *const row = "G21 G90 G94 G64 P0.01 F3000\n"
                               "G53 G1 X10\nG53 G1 X20\nG53 G1 X30\nG53 G1 X40\nM30\n";

static uint64_t after_line(const char *text, int line)
{
    const char *at = text;
    while (line-- > 0)
        at = strchr(at, '\n') + 1;
    return (uint64_t)(at - text);
}

static void at_gate(void)
{
    const uint64_t gates[] = {after_line(row, 3), after_line(row, 4), strlen(row)};
    /* The brake for the gate at 20 mm begins at 18.4375 mm, 0.4 s: asked before, it stops at 20,
     * asked after, at 30. */
    static const struct {
        int64_t at_us;
        double x_mm;
        unsigned blocks;
    } cases[] = {{0, 20, 2}, {390000, 20, 2}, {405000, 30, 3}, {590000, 30, 3}, {610000, 40, 5}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Rig rig;
        double planned_s = rig_start(&rig, 1, row, gates, G_N_ELEMENTS(gates));
        rig_tick(&rig, cases[i].at_us);
        rig_do(&rig, SIM_HOLD_AT_GATE);
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_RUNNING);
        rig_run(&rig, 1000, 10);
        g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, cases[i].x_mm);
        g_assert_cmpuint(rig_blocks(&rig), ==, cases[i].blocks);
        if (cases[i].x_mm < 40) {
            g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
            rig_do(&rig, SIM_RESUME);
            rig_run(&rig, 1000, 10);
            planned_s += 0.0625;
        }
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
        test_near(rig_last_block(&rig).end_s, planned_s, 1e-9, 0);
        rig_clear(&rig);
    }
}

/* Where the plan rests by itself the hold needs no ramp and is in time to the last moment. */
/* The ramp to the gate begins behind a dwell: not before that is over. */
static void at_gate_behind_a_dwell(void)
{
    const char *text = "G21 G90 G64 P0.01 F3000\nG53 G1 X10\nG4 P0.5\nM3 S1000\nG53 G1 X10.5\n"
                       "G53 G1 X40\nM30\n";
    const uint64_t gates[] = {after_line(text, 5), strlen(text)};
    Rig rig;
    rig_start(&rig, 1, text, gates, G_N_ELEMENTS(gates));
    rig_tick(&rig, 10000);
    rig_do(&rig, SIM_HOLD_AT_GATE);
    while (rig_see(&rig).position_mm[0] < 10 && rig.now_us < 10 * SECOND)
        rig_tick(&rig, 1000);
    const int64_t there_us = rig.now_us;
    while (rig_see(&rig).position_mm[0] <= 10 && rig.now_us < 10 * SECOND)
        rig_tick(&rig, 1000);
    test_near((double)(rig.now_us - there_us) * 1e-6, 0.7, 0.005, 0); /* 0.5 s and 1000 rev/min */
    rig_run(&rig, 1000, 10);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    test_near(rig_see(&rig).position_mm[0], 10.5, 1e-9, 0);
    g_assert_cmpuint(rig_blocks(&rig), ==, 4);
    rig_clear(&rig);
}

static void at_gate_at_rest(void)
{
    const char *text = "G21 G90 F3000\nG53 G1 X10\nG4 P1\nG53 G1 X20\nM30\n";
    const uint64_t gates[] = {after_line(text, 2), strlen(text)};
    Rig rig;
    rig_start(&rig, 1, text, gates, G_N_ELEMENTS(gates));
    rig_tick(&rig, 262499); /* of 262 500 µs */
    rig_do(&rig, SIM_HOLD_AT_GATE);
    rig_run(&rig, 1000, 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 10);
    test_near(rig_last_block(&rig).end_s, 0.2625, 1e-9, 0);
    rig_clear(&rig);
}

static void at_gate_while_resuming(void)
{
    const uint64_t gates[] = {after_line(row, 3), strlen(row)};
    Rig rig;
    rig_start(&rig, 1, row, gates, G_N_ELEMENTS(gates));
    rig_tick(&rig, 100000);
    rig_do(&rig, SIM_HOLD);
    rig_run(&rig, 1000, 1);
    rig_do(&rig, SIM_RESUME);
    rig_tick(&rig, 1000);
    rig_do(&rig, SIM_HOLD_AT_GATE);
    rig_run(&rig, 1000, 5);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 20);
    rig_clear(&rig);
    /* A resume takes a gate hold back that has not begun to brake. */
    rig_start(&rig, 1, row, gates, G_N_ELEMENTS(gates));
    rig_do(&rig, SIM_HOLD_AT_GATE);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, 1000, 5);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
}

static void stops_of_the_program(void)
{
    Rig rig;
    rig_start(&rig, 1, "G21 G90\nG53 G0 X10\nM0\nM1\nG53 G0 X20\nM2\n", NULL, 0);
    rig_run(&rig, 1000, 5);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_PROGRAM_STOP);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 10);
    rig_do(&rig, SIM_HOLD);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_PROGRAM_STOP);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, 1000, 5);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    rig_clear(&rig);
    rig_start(&rig, 1, "M0\nM2\n", NULL, 0);
    rig_run(&rig, 1000, 5);
    rig_do(&rig, SIM_ABORT);
    g_autofree char *states = rig_states(&rig);
    g_assert_cmpstr(states, ==, "IDLE READY RUNNING PROGRAM_STOP ABORTING READY");
    rig_clear(&rig);
}

static void aborted(void)
{
    Rig rig;
    rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, SECOND);
    double x = rig_see(&rig).position_mm[0];
    rig_do(&rig, SIM_ABORT);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_ABORTING);
    rig_do(&rig, SIM_RESUME);
    rig_do(&rig, SIM_HOLD);
    rig_run(&rig, 1000, 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_READY);
    test_near(rig_see(&rig).position_mm[0], x + 1.5625, 1e-9, 0);
    g_assert_cmpuint(rig_blocks(&rig), ==, 0);
    rig_do(&rig, SIM_RESUME);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_READY);
    rig_do(&rig, SIM_START);
    rig_run(&rig, 1000, 10);
    g_autofree char *states = rig_states(&rig);
    g_assert_cmpstr(states, ==, "IDLE READY RUNNING ABORTING READY RUNNING COMPLETE");
    g_assert_cmpuint(sim_controller_totals(rig.controller).aborted, ==, 1);
    rig_clear(&rig);
}

static void emergency_stop(void)
{
    Rig rig;
    rig_start(&rig, 1, straight, NULL, 0);
    rig_tick(&rig, SECOND);
    const guint told = rig.actions->len;
    rig_do(&rig, SIM_ACKNOWLEDGE); /* of a machine that moves: nothing */
    g_assert_cmpuint(rig.actions->len, ==, told);
    rig_do(&rig, SIM_ESTOP);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_ESTOP);
    rig_do(&rig, SIM_ACKNOWLEDGE);
    rig_do(&rig, SIM_RESUME);
    rig_do(&rig, SIM_ABORT);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_ESTOP);
    rig_run(&rig, 1000, 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_ESTOP);
    rig_do(&rig, SIM_START);
    g_assert_false(sim_controller_moving(rig.controller));
    rig_do(&rig, SIM_ACKNOWLEDGE);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_READY);
    g_assert_false(sim_controller_moving(rig.controller));
    SimTotals totals = sim_controller_totals(rig.controller);
    g_assert_cmpuint(totals.stopped, ==, 1);
    test_near(totals.machine_s, 1.0625, 1e-9, 0);
    rig_clear(&rig);
}

/* However often the clock is looked at, a hold at the same moment gives the same times. */
static void independent_of_ticks(void)
{
    double end_s[3];
    static const int64_t tick_us[] = {1000000, 1000, 37};
    for (size_t i = 0; i < G_N_ELEMENTS(tick_us); i++) {
        Rig rig;
        rig_start(&rig, 1, row, NULL, 0);
        while (rig.now_us + tick_us[i] < 333333)
            rig_tick(&rig, tick_us[i]);
        rig_tick(&rig, 333333 - rig.now_us);
        rig_do(&rig, SIM_HOLD);
        rig_run(&rig, tick_us[i], 2);
        rig_do(&rig, SIM_RESUME);
        rig_run(&rig, tick_us[i], 3);
        end_s[i] = rig_last_block(&rig).end_s;
        rig_clear(&rig);
    }
    test_near(end_s[1], end_s[0], 1e-9, 0);
    test_near(end_s[2], end_s[0], 1e-9, 0);
}

/* ------------------------------------------------- long random programs, at random */

static SegVec3 random_point(GRand *rand, SegVec3 from, double reach)
{
    return seg_vec3(fmax(-400, fmin(400, from.x + g_rand_double_range(rand, -reach, reach))),
                    fmax(-400, fmin(400, from.y + g_rand_double_range(rand, -reach, reach))),
                    fmax(-400, fmin(400, from.z + g_rand_double_range(rand, -reach, reach))));
}

/* Smooth rows, zigzags, arcs, moves of no length, dwells; every line one move. */
static char *random_program(GRand *rand)
{
    GString *text = g_string_new("G21 G90 G94 G64 P0.02 F5000\n");
    SegVec3 at = {0, 0, 0};
    for (int i = 0; i < 300; i++) {
        int kind = g_rand_int_range(rand, 0, 12);
        if (kind == 0)
            g_string_append(text, "G4 P0.05\n");
        else if (kind == 1)
            g_string_append_printf(text, "G53 G1 X%.4f Y%.4f Z%.4f\n", at.x, at.y, at.z);
        else if (kind == 2)
            g_string_append_printf(text, "G91 G2 I%.4f J%.4f\nG90\n",
                                   g_rand_double_range(rand, 0.5, 9),
                                   g_rand_double_range(rand, -9, 9));
        else {
            at = random_point(rand, at, kind < 6 ? 40 : 0.5);
            g_string_append_printf(text, "G53 G%d X%.4f Y%.4f Z%.4f\n", kind > 3, at.x, at.y, at.z);
        }
    }
    g_string_append(text, "M30\n");
    return g_string_free(text, FALSE);
}

/* The least distance from the path of a line's move. */
static double off_path_mm(const SimProgram *program, uint32_t line, SegVec3 p)
{
    for (size_t i = 0; i < program->n; i++) {
        const NcMove *move = &program->moves[i];
        if (move->line != line)
            continue;
        if (move->kind == NC_MOVE_ARC)
            return fmax(fabs(hypot(p.x - move->centre.x, p.y - move->centre.y) -
                             hypot(move->from.x - move->centre.x, move->from.y - move->centre.y)),
                        fabs(p.z - move->from.z));
        double length = nc_move_length_mm(move), share = 0;
        SegVec3 along = seg_sub(move->to, move->from);
        if (length > 0)
            share = seg_dot(seg_sub(p, move->from), along) / (length * length);
        share = fmax(0, fmin(1, share));
        return seg_distance(p, seg_add(move->from, seg_scale(along, share)));
    }
    return INFINITY;
}

/* In a blend the path is within P = 0.02 mm of this move or one near it. */
static bool off_tube(const SimProgram *program, uint32_t line, SegVec3 at)
{
    double off = INFINITY;
    for (uint32_t k = line > 40 ? line - 40 : 1; k <= line + 40; k++)
        off = fmin(off, off_path_mm(program, k, at));
    return off > 0.02 * 1.001;
}

static void hold_at_random(GRand *rand, double jerk)
{
    Rig rig;
    rig_init(&rig, 1, 100000);
    for (int axis = 0; axis < 3; axis++)
        rig.machine.axis[axis].max_mm_s3 = jerk * (1 + axis);
    g_autofree char *text = random_program(rand);
    const SimProgram *program = rig_load(&rig, text, NULL, 0);
    rig_do(&rig, SIM_START);
    uint64_t executed = 0;
    int wrong = 0, off = 0, held = 0;
    Trace trace = {.n = 0};
    while (program && rig_state(&rig) != FB_STATE_COMPLETE && rig.now_us < 900 * SECOND) {
        if (rig_state(&rig) == FB_STATE_HELD)
            held++, rig_do(&rig, SIM_RESUME);
        else if (g_rand_int_range(rand, 0, 100) == 0)
            rig_do(&rig, rig_state(&rig) == FB_STATE_HOLDING ? SIM_RESUME : SIM_HOLD);
        rig_tick(&rig, 1000);
        FbProgress see = rig_see(&rig);
        if (rig_state(&rig) == FB_STATE_COMPLETE)
            break;
        /* A hold may end within the millisecond: then the machine stands for the rest of it. */
        wrong += trace_excess(&trace, &rig.machine, see.position_mm) > 0;
        SegVec3 at = {see.position_mm[0], see.position_mm[1], see.position_mm[2]};
        off += off_tube(program, see.line, at) || see.executed_blocks < executed;
        executed = see.executed_blocks;
    }
    g_test_message("held %d times, %d excesses", held, wrong);
    g_assert_cmpint(wrong, ==, 0);
    g_assert_cmpint(off, ==, 0);
    g_assert_cmpint(held, >, 20);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    guint blocks = 0;
    for (size_t i = 0; program && i < program->n; i++)
        blocks += i + 1 == program->n || program->moves[i + 1].line != program->moves[i].line;
    g_assert_cmpuint(rig_blocks(&rig), ==, blocks);
    for (guint i = 1; i < rig_blocks(&rig); i++)
        if (rig_block(&rig, i).line <= rig_block(&rig, i - 1).line)
            g_test_fail();
    rig_clear(&rig);
}

static void random_holds(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(20);
    for (int trial = 0; trial < 4; trial++)
        hold_at_random(rand, 0);
}

static void random_holds_with_jerk(void)
{
    g_autoptr(GRand) rand = g_rand_new_with_seed(21);
    for (int trial = 0; trial < 4; trial++)
        hold_at_random(rand, 10000 * (1 + trial));
}

static void add(void)
{
    g_test_add_func("/sim/hold/mid-move", mid_move);
    g_test_add_func("/sim/hold/speeding-up-slowing-down", while_speeding_up_and_slowing_down);
    g_test_add_func("/sim/hold/resume-while-holding",
                    resumed_while_holding_and_held_while_resuming);
    g_test_add_func("/sim/hold/dwell", in_dwell);
    g_test_add_func("/sim/hold/tool-change", in_tool_change);
    g_test_add_func("/sim/hold/gate", at_gate);
    g_test_add_func("/sim/hold/gate-behind-a-dwell", at_gate_behind_a_dwell);
    g_test_add_func("/sim/hold/gate-at-rest", at_gate_at_rest);
    g_test_add_func("/sim/hold/gate-while-resuming", at_gate_while_resuming);
    g_test_add_func("/sim/hold/program-stop", stops_of_the_program);
    g_test_add_func("/sim/hold/abort", aborted);
    g_test_add_func("/sim/hold/estop", emergency_stop);
    g_test_add_func("/sim/hold/ticks", independent_of_ticks);
    g_test_add_func("/sim/hold/random", random_holds);
    g_test_add_func("/sim/hold/random-with-jerk", random_holds_with_jerk);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
