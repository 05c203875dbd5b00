/* SPDX-License-Identifier: Apache-2.0 */
/* Restart at a gate: what is on there, how the machine comes there, and what is executed from it.
 */
#include "sim/run.h"
#include "tests/unit/sim_rig.h"

/* Several tools, offsets, units, planes, arcs, incremental words, coolant; gates behind the lines
 * that end in "(gate)". Clear of everything is Z0, the part lies below Z-20. */
static const char *const programs[] = {
    "G21 G90 G17 G94 G64 P0.01\n"
    "T1 M6\n"
    "S5000 M3\n"
    "M8\n"
    "G43 H1\n"
    "G0 Z-50 (gate)\n"
    "G0 X10 Y10\n"
    "G1 Z-80 F600\n"
    "G1 X30 F1500\n"
    "G0 Z-50 (gate)\n"
    "G91 G20\n"
    "G0 X1 Y0.5\n"
    "G1 Z-1 F20\n"
    "G2 X0.5 Y-0.5 I0.5\n"
    "G0 Z1 (gate)\n"
    "G90 G21\n"
    "G55\n"
    "G0 X5 Y5\n"
    "M9\n"
    "M5\n"
    "G53 G0 Z0 (gate)\n"
    "T2 M6\n"
    "S1000 M4\n"
    "G43 H2\n"
    "G53 G0 Z-10 (gate)\n"
    "G18 G2 X25 Z-60 R60 F800\n"
    "G53 G0 Z0\n"
    "M30\n",
    "(nothing is on yet) (gate)\n"
    "G21 G90 G53 G0 Z-5 (gate)\n"
    "M7\n"
    "T2\n"
    "G53 G1 X40 F3000 (gate)\n"
    "M6 (gate)\n"
    "S300 M3 (gate)\n"
    "G53 G1 X50 F3000 (gate)\n"
    "G4 P0.5 (gate)\n"
    "M0 (gate)\n"
    "G53 G0 X0\n"
    "M2\n",
};

/* Of G64 above: a gate may be on a rounding. */
#define P_MM (0.01 * 1.001)

static size_t find_gates(const char *text, uint64_t gates[16])
{
    size_t n = 0;
    for (const char *at = text; (at = strstr(at, "(gate)\n")) != NULL;)
        gates[n++] = (uint64_t)((at += strlen("(gate)\n")) - text);
    gates[n++] = strlen(text);
    return n;
}

static void rig_for_restarts(Rig *rig, double speed)
{
    rig_init(rig, speed, 1000);
    rig->machine.tool_change_mm[0] = -100;
    rig->machine.tool_change_mm[1] = 50;
    rig->machine.tool_change_mm[2] = 300;
    for (int axis = 0; axis < 3; axis++)
        rig->machine.axis[axis].min_mm = -400;
    rig->machine.work_offset_mm[1][0] = 3;
    rig->tools[1].length_mm = 61.5;
    sim_controller_free(rig->controller);
    SimControllerOptions options = {
        .machine = &rig->machine, .speed = speed, .moves_per_step = 1000};
    rig->controller = sim_controller_new(&options);
}

static void run_out(Rig *rig)
{
    rig_run(rig, 1000000, 900);
    while (rig_state(rig) == FB_STATE_PROGRAM_STOP) {
        rig_do(rig, SIM_RESUME);
        rig_run(rig, 1000000, 900);
    }
    g_assert_cmpint(rig_state(rig), ==, FB_STATE_COMPLETE);
}

/* All that is executed from the restart on is the tail of the whole run, block by block. */
static void compare_tail(const Rig *whole, const Rig *tail, guint from, size_t gate)
{
    const guint n = rig_blocks(tail);
    guint first = 0, i = 0;
    const SimBlock *expected = NULL, *done;
    while (first < rig_blocks(whole) - n)
        rig_next_block(whole, &i), first++;
    uint32_t expected_first = 0;
    for (guint k = 0; k < n; k++) {
        expected = rig_next_block(whole, &i);
        done = rig_next_block(tail, &from);
        if (k == 0)
            expected_first = expected ? expected->line : 0;
        if (!expected || !done || expected->line != done->line || expected->kind != done->kind ||
            seg_distance(expected->position_mm, done->position_mm) > 0 ||
            expected->feed_mm_min != done->feed_mm_min || expected->tool != done->tool ||
            expected->spindle_rpm != done->spindle_rpm) {
            g_test_message("gate %zu, block %u: line %u, not %u", gate, k, done ? done->line : 0,
                           expected ? expected->line : 0);
            g_test_fail();
        }
    }
    g_assert_cmpuint(expected_first, >, 0);
}

/* The way is up, for the tool, across, on, down: in this order, and what is on is on before down.
 */
static void check_way(const Rig *rig, const SimProgram *program, size_t gate)
{
    const size_t next = program->gates[gate - 1];
    const NcMove *before = next > 0 ? &program->moves[next - 1] : NULL;
    const double top = rig->machine.axis[2].max_mm;
    const SegVec3 place = program->moves[next].from;
    bool changed = false, turns = before == NULL || before->spindle_rpm == 0;
    double time_s = 0;
    const SimBlock *last = NULL;
    for (guint i = 0; i < rig->actions->len; i++) {
        const SimAction *action = &g_array_index(rig->actions, SimAction, i);
        if (action->kind != SIM_WAY)
            continue;
        const SimBlock *way = &action->block;
        g_assert_cmpfloat(way->start_s, ==, time_s);
        time_s = way->end_s;
        changed = changed || way->kind == NC_MOVE_TOOL_CHANGE;
        turns = turns || (way->kind == NC_MOVE_SPINDLE && way->spindle_rpm == before->spindle_rpm);
        const bool at_changer = way->position_mm.x == rig->machine.tool_change_mm[0] &&
                                way->position_mm.y == rig->machine.tool_change_mm[1];
        if (way->kind == NC_MOVE_RAPID && way->position_mm.z < top && !at_changer) {
            g_assert_true(turns);
            g_assert_cmpfloat(seg_distance(way->position_mm, place), <=, P_MM);
        }
        last = way;
    }
    g_assert_nonnull(last);
    g_assert_cmpint(changed, ==, before && before->tool != 0);
    if (last) {
        g_assert_cmpfloat(seg_distance(last->position_mm, place), <=, P_MM);
        g_assert_cmpint(last->tool, ==, before ? before->tool : 0);
        g_assert_cmpfloat(last->spindle_rpm, ==, before ? before->spindle_rpm : 0);
    }
}

static void at_every_gate(void)
{
    unsigned n_restarts = 0;
    for (size_t p = 0; p < G_N_ELEMENTS(programs); p++) {
        const char *text = programs[p];
        uint64_t gates[16];
        const size_t n = find_gates(text, gates);
        Rig whole;
        rig_for_restarts(&whole, 1);
        const SimProgram *program = rig_load(&whole, text, gates, n);
        rig_do(&whole, SIM_START);
        run_out(&whole);
        for (size_t gate = 1; program && gate < n; gate++, n_restarts++) {
            Rig rig;
            rig_for_restarts(&rig, gate % 2 ? 1 : INFINITY);
            const SimProgram *again = rig_load(&rig, text, gates, n);
            rig_restart(&rig, gate);
            g_assert_cmpuint(rig_see(&rig).gate, ==, gate);
            run_out(&rig);
            const size_t next = program->gates[gate - 1];
            guint expected = 0, i = 0;
            for (const SimBlock *block; (block = rig_next_block(&whole, &i)) != NULL;)
                expected += block->line >= program->moves[next].line;
            g_assert_cmpuint(rig_blocks(&rig), ==, expected);
            g_assert_cmpuint(rig_see(&rig).executed_blocks, ==, expected);
            compare_tail(&whole, &rig, 0, gate);
            if (again)
                check_way(&rig, again, gate);
            for (int axis = 0; axis < 3; axis++)
                g_assert_cmpfloat(rig_see(&rig).position_mm[axis], ==,
                                  rig_see(&whole).position_mm[axis]);
            g_assert_cmpuint(rig_see(&rig).gate, ==, n);
            rig_clear(&rig);
        }
        rig_clear(&whole);
    }
    g_test_message("%u restarts", n_restarts);
    g_assert_cmpuint(n_restarts, ==, 13);
}

/* Watched every millisecond, from a place within the part: nothing goes across below the top, and
 * nothing goes down before the spindle turns as it has to. */
static void watched(void)
{
    const char *text = programs[0];
    uint64_t gates[16];
    const size_t n = find_gates(text, gates);
    Rig rig;
    rig_for_restarts(&rig, 1);
    rig_load(&rig, text, gates, n);
    rig_do(&rig, SIM_START);
    while (rig_see(&rig).line < 9 && rig.now_us < 60000000)
        rig_tick(&rig, 1000);
    rig_do(&rig, SIM_ABORT);
    rig_run(&rig, 1000, 10);
    const FbProgress from = rig_see(&rig);
    g_assert_cmpfloat(from.position_mm[2], <, 0);
    g_assert_cmpuint(from.stop_line, ==, 9);
    rig_restart(&rig, 3);
    const double top = rig.machine.axis[2].max_mm;
    FbProgress before = from;
    unsigned across = 0, down = 0, turning = 0;
    bool was_up = false;
    while (rig_see(&rig).line == 0 && rig.now_us < 120000000) {
        rig_tick(&rig, 1000);
        const FbProgress see = rig_see(&rig);
        if (see.line != 0)
            break;
        const bool moved_across = hypot(see.position_mm[0] - before.position_mm[0],
                                        see.position_mm[1] - before.position_mm[1]) > 0;
        was_up = was_up || see.position_mm[2] == top;
        across += moved_across;
        if (moved_across && (see.position_mm[2] < top || before.position_mm[2] < top))
            g_test_fail();
        turning += see.spindle_rpm > 0 && see.spindle_rpm < 5000;
        if (was_up && see.position_mm[2] < before.position_mm[2]) {
            down++;
            g_assert_cmpfloat(see.spindle_rpm, ==, 5000);
            g_assert_cmpint(see.tool, ==, 1);
        }
        before = see;
    }
    g_assert_cmpuint(across, >, 100);
    g_assert_cmpuint(down, >, 100);
    test_near(turning, 1000, 3, 0); /* 5000 rev/min at 5000/s */
    run_out(&rig);
    rig_clear(&rig);
}

/* Hold, hold at gate, abort and e-stop work on the way as they do anywhere else. */
static void stopped_on_the_way(void)
{
    const char *text = programs[0];
    uint64_t gates[16];
    const size_t n = find_gates(text, gates);
    static const int64_t at_us[] = {100000, 1500000, 5000000, 9000000, 10000000, 12000000};
    unsigned held_turning = 0;
    for (size_t i = 0; i < G_N_ELEMENTS(at_us); i++) {
        Rig rig;
        rig_for_restarts(&rig, 1);
        rig_load(&rig, text, gates, n);
        rig_restart(&rig, 3);
        rig_tick(&rig, at_us[i]);
        g_assert_cmpuint(rig_see(&rig).line, ==, 0);
        rig_do(&rig, SIM_HOLD);
        rig_run(&rig, 1000, 10);
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
        g_assert_cmpuint(rig_blocks(&rig), ==, 0);
        held_turning += rig_see(&rig).spindle_rpm > 0;
        rig_do(&rig, SIM_RESUME);
        rig_do(&rig, SIM_HOLD_AT_GATE);
        rig_run(&rig, 1000, 60);
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
        g_assert_cmpuint(rig_blocks(&rig), ==, 0);
        g_assert_cmpuint(rig_see(&rig).gate, ==, 3);
        g_assert_cmpfloat(rig_see(&rig).spindle_rpm, ==, 5000);
        rig_do(&rig, SIM_RESUME);
        run_out(&rig);
        rig_restart(&rig, 2);
        rig_tick(&rig, at_us[i]);
        rig_do(&rig, i % 2 ? SIM_ABORT : SIM_ESTOP);
        rig_run(&rig, 1000, 10);
        g_assert_cmpint(rig_state(&rig), ==, i % 2 ? FB_STATE_READY : FB_STATE_ESTOP);
        g_assert_cmpuint(rig_see(&rig).stop_line, ==, 12);
        g_assert_cmpuint(rig_see(&rig).gate, ==, 2);
        g_assert_cmpfloat(rig_see(&rig).spindle_rpm, ==, 0);
        rig_do(&rig, SIM_ACKNOWLEDGE);
        rig_restart(&rig, 2);
        run_out(&rig);
        rig_clear(&rig);
    }
    g_assert_cmpuint(held_turning, >, 0);
}

/* No jump at the end of the way: the gate is on the rounding of a corner, with A turned; and a
 * second START turns A back. */
static void no_jump(void)
{
    const char *text = "G21 G90 G64 P1 F3000\nG53 G0 X10 A90\nG53 G0 Y10 (gate)\nG53 G0 X40\nM30\n";
    uint64_t gates[16];
    const size_t n = find_gates(text, gates);
    Rig rig;
    rig_for_restarts(&rig, 1);
    rig.machine.rotary[0] = (CfgRotary){
        .present = true, .min_deg = -360, .max_deg = 360, .max_deg_min = 6000, .max_deg_s2 = 500};
    rig_load(&rig, text, gates, n);
    for (int run = 0; run < 3; run++) {
        const double before_deg = sim_run_place(rig.controller).deg.x;
        if (run == 1)
            rig_do(&rig, SIM_START);
        else
            rig_restart(&rig, 1);
        SimPlace last = sim_run_place(rig.controller);
        g_assert_cmpfloat(last.deg.x, ==, before_deg);
        while (rig_state(&rig) == FB_STATE_RUNNING && rig.now_us < 60000000) {
            rig_tick(&rig, 1000);
            const SimPlace now = sim_run_place(rig.controller);
            g_assert_cmpfloat(seg_distance(now.mm, last.mm), <, 0.2 * sqrt(3.0) + 1e-9);
            g_assert_cmpfloat(fabs(now.deg.x - last.deg.x), <, 0.1 + 1e-9);
            last = now;
        }
        g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
        g_assert_cmpfloat(last.deg.x, ==, 90);
    }
    rig_clear(&rig);
}

static void not_a_gate(void)
{
    const char *text = programs[0];
    uint64_t gates[16];
    const size_t n = find_gates(text, gates);
    Rig rig;
    rig_for_restarts(&rig, 1);
    rig_restart(&rig, 1);
    rig_load(&rig, text, gates, n);
    rig_restart(&rig, 0);
    rig_restart(&rig, n + 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_READY);
    rig_do(&rig, SIM_START);
    rig_tick(&rig, 1000);
    rig_restart(&rig, 1);
    g_assert_cmpuint(sim_controller_totals(rig.controller).started, ==, 1);
    rig_clear(&rig);
}

static void add(void)
{
    g_test_add_func("/sim/restart/every-gate", at_every_gate);
    g_test_add_func("/sim/restart/watched", watched);
    g_test_add_func("/sim/restart/stopped-on-the-way", stopped_on_the_way);
    g_test_add_func("/sim/restart/no-jump", no_jump);
    g_test_add_func("/sim/restart/not-a-gate", not_a_gate);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
