/* SPDX-License-Identifier: Apache-2.0 */
/* Running programs: states, blocks, times, positions; the same at every speed; refusals. */
#include <glib/gstdio.h>

#include "sim/log.h"
#include "tests/unit/sim_rig.h"

static const char *const whole = "G21 G90 G17 G94 G64 P0.01\n"
                                 "T1 M6\n"
                                 "S5000 M3\n"
                                 "G53 G0 X10 Y20 Z-30\n"
                                 "G53 G1 X110 F3000\n"
                                 "(a comment)\n"
                                 "G91 G2 X20 Y-20 J-20\n"
                                 "G90 G4 P0.5\n"
                                 "M8\n"
                                 "M1\n"
                                 "G53 G0 Z0\n"
                                 "M30\n";

static void run(void)
{
    Rig rig;
    double end_s = rig_start(&rig, 1, whole, NULL, 0);
    uint64_t blocks = 0;
    uint32_t ms = 0;
    bool fed = false;
    while (sim_controller_moving(rig.controller) && rig.now_us < 60000000) {
        rig_tick(&rig, 3000);
        FbProgress see = rig_see(&rig);
        g_assert_cmpuint(see.executed_blocks, >=, blocks);
        g_assert_cmpuint(see.program_time_ms, >=, ms);
        blocks = see.executed_blocks;
        ms = see.program_time_ms;
        if (see.line == 5 && see.feed_mm_min > 2999.999 && see.feed_mm_min < 3000.001)
            fed = see.spindle_rpm == 5000 && see.tool == 1;
    }
    g_assert_true(fed);
    g_autofree char *states = rig_states(&rig);
    g_assert_cmpstr(states, ==, "IDLE READY RUNNING TOOL_CHANGE RUNNING COMPLETE");
    static const uint32_t lines[] = {2, 3, 4, 5, 7, 8, 9, 10, 11, 12};
    g_assert_cmpuint(rig_blocks(&rig), ==, G_N_ELEMENTS(lines));
    g_assert_cmpuint(rig_see(&rig).executed_blocks, ==, G_N_ELEMENTS(lines));
    double time_s = 0;
    for (guint i = 0; i < MIN(rig_blocks(&rig), G_N_ELEMENTS(lines)); i++) {
        SimBlock block = rig_block(&rig, i);
        g_assert_cmpuint(block.line, ==, lines[i]);
        g_assert_cmpfloat(block.start_s, ==, time_s);
        time_s = block.end_s;
    }
    g_assert_cmpfloat(time_s, ==, end_s);
    /* Tool change 4 s, spindle 5000 at 5000/s 1 s. */
    g_assert_cmpfloat(rig_block(&rig, 0).end_s, ==, 4);
    g_assert_cmpfloat(rig_block(&rig, 1).end_s, ==, 5);
    test_near(rig_block(&rig, 5).end_s - rig_block(&rig, 5).start_s, 0.5, 1e-12, 0);
    FbProgress see = rig_see(&rig);
    g_assert_cmpfloat(see.position_mm[0], ==, 130);
    g_assert_cmpfloat(see.position_mm[1], ==, 0);
    g_assert_cmpfloat(see.position_mm[2], ==, 0);
    g_assert_cmpint(see.tool, ==, 1);
    g_assert_cmpfloat(see.spindle_rpm, ==, 0);
    g_assert_cmpuint(see.line, ==, 0);
    rig_clear(&rig);
}

/* 100 mm of X at 3000 mm/min with 800 mm/s²: v/a = 0.0625 s each way, 1.9375 s cruise. */
static void analytic_time(void)
{
    Rig rig;
    rig_start(&rig, 1, "G21 G90 G53 G1 X100 F3000\nM2\n", NULL, 0);
    rig_tick(&rig, 31250);
    test_near(rig_see(&rig).feed_mm_min, 1500, 1e-9, 0);
    test_near(rig_see(&rig).position_mm[0], 0.390625, 1e-12, 0);
    rig_run(&rig, 1000, 10);
    test_near(rig_block(&rig, 0).end_s, 2.0625, 1e-12, 0);
    rig_clear(&rig);
}

/* The log of what a rig did, read back. */
static char *log_of(const Rig *rig, const char *folder)
{
    g_autofree char *path = g_build_filename(folder, "log", NULL);
    g_autoptr(GError) error = NULL;
    SimLog *log = sim_log_open(path, &error);
    g_assert_no_error(error);
    for (guint i = 0; log && i < rig->actions->len; i++) {
        const SimAction *action = &g_array_index(rig->actions, SimAction, i);
        if (action->kind == SIM_STATE)
            sim_log_state(log, action->state, action->time_s);
        else if (action->kind == SIM_BLOCK)
            sim_log_block(log, &action->block);
    }
    if (log)
        sim_log_close(log, &error);
    char *text = NULL;
    g_file_get_contents(path, &text, NULL, &error);
    g_assert_no_error(error);
    return text;
}

static char *logged_run(const char *folder, double speed, int64_t tick_us, int64_t wait_us)
{
    Rig rig;
    rig_init(&rig, speed, 3);
    rig_load(&rig,
             "G21 G90 G94 G64 P0.05\nT2 M6\nS3000 M3\nG53 G0 X1 Y1\nF1234.5\n"
             "G53 G1 X10.1\nG53 G1 Y7.3 X11\nG53 G1 Y7.3 X11\nG53 G1 X30\nM0\n"
             "G91 G3 X-4 Y4 I-4\nG4 P0.123\nG90 G53 G0 Z-5\nM30\n",
             NULL, 0);
    rig_do(&rig, SIM_START);
    rig_run(&rig, tick_us, 60);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_PROGRAM_STOP);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 30);
    rig_tick(&rig, wait_us);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_PROGRAM_STOP);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, tick_us, 60);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    char *text = log_of(&rig, folder);
    rig_clear(&rig);
    return text;
}

/* A machine that has A, B or C says where they are; one that has none does not. */
static void log_of_rotary(void)
{
    g_autofree char *folder = g_dir_make_tmp("segmill-sim-XXXXXX", NULL);
    static const struct {
        const char *text, *logged, *unlogged;
    } cases[] = {
        {"G21 G90 G53 G1 X10 F3000\nM2\n", "\"position_mm\":[10,0,0],\"feed", "position_deg"},
        {"G21 G90 G53 G1 X10 B-30.5 F3000\nM2\n",
         "\"position_mm\":[10,0,0],\"position_deg\":[0,-30.5,0],\"feed", "]]"},
    };
    for (int turns = 0; folder && turns < 2; turns++) {
        Rig rig;
        rig_init(&rig, 1, 3);
        if (turns)
            rig.machine.rotary[1] = (CfgRotary){true, -360, 360, 3600, 1000, 0};
        rig_load(&rig, cases[turns].text, NULL, 0);
        rig_do(&rig, SIM_START);
        rig_run(&rig, 100000, 60);
        g_autofree char *text = log_of(&rig, folder);
        g_assert_nonnull(strstr(text ? text : "", cases[turns].logged));
        g_assert_null(strstr(text ? text : "", cases[turns].unlogged));
        rig_clear(&rig);
    }
    g_autofree char *path = folder ? g_build_filename(folder, "log", NULL) : NULL;
    g_assert_cmpint(path ? g_remove(path) : -1, ==, 0);
    g_assert_cmpint(folder ? g_rmdir(folder) : -1, ==, 0);
}

/* Said when the block comes, each time; the pass that they came with need not be there any more. */
static void messages(void)
{
    Rig rig;
    rig_init(&rig, 1, 3);
    rig_load(&rig,
             "(MSG,clamp it) G4 P1\n#1=2\no1 repeat [2]\n#1=[#1*2] (DEBUG,%d#1) G4 P1\n"
             "o1 endrepeat\nM2\n",
             NULL, 0);
    rig_do(&rig, SIM_START);
    rig_run(&rig, 100000, 60);
    static const struct {
        const char *text;
        uint32_t line;
        double time_s;
    } said[] = {{"clamp it", 1, 0.0}, {"4", 4, 1.0}, {"8", 4, 2.0}};
    size_t n = 0;
    for (guint i = 0; i < rig.actions->len; i++) {
        SimAction *action = &g_array_index(rig.actions, SimAction, i);
        if (action->kind != SIM_MESSAGE)
            continue;
        if (n < G_N_ELEMENTS(said)) {
            g_assert_cmpstr(action->text, ==, said[n].text);
            g_assert_cmpuint(action->line, ==, said[n].line);
            g_assert_cmpfloat(action->time_s, ==, said[n].time_s);
        }
        n++;
        g_clear_pointer(&action->text, g_free);
    }
    g_assert_cmpuint(n, ==, G_N_ELEMENTS(said));
    rig_clear(&rig);
}

static void same_at_every_speed(void)
{
    char *folder = test_folder();
    g_autofree char *real = logged_run(folder, 1, 1000, 5000000);
    static const struct {
        double speed;
        int64_t tick_us, wait_us;
    } other[] = {{1, 7777, 1}, {1, 900000, 0}, {13.7, 5000, 60000000}, {INFINITY, 0, 77}};
    g_assert_nonnull(strstr(real, "\"COMPLETE\""));
    for (size_t i = 0; i < G_N_ELEMENTS(other); i++) {
        g_autofree char *text =
            logged_run(folder, other[i].speed, other[i].tick_us, other[i].wait_us);
        g_assert_cmpstr(text, ==, real);
    }
    test_folder_remove(folder);
}

static void bounded_steps(void)
{
    Rig rig;
    rig_init(&rig, INFINITY, 10);
    g_autoptr(GString) text = g_string_new("G21 G90 F6000\n");
    for (int i = 1; i <= 200; i++)
        g_string_append_printf(text, "G53 G1 X%d\n", i);
    g_string_append(text, "M30\n");
    rig_load(&rig, text->str, NULL, 0);
    rig_do(&rig, SIM_START);
    g_assert_cmpuint(rig_see(&rig).executed_blocks, ==, 0);
    for (guint i = 1; i <= 5; i++) {
        rig_tick(&rig, 1);
        g_assert_cmpuint(rig_see(&rig).executed_blocks, ==, 10 * i);
    }
    /* A command acts before anything else happens; the ramp is short against 10 blocks. */
    rig_do(&rig, SIM_HOLD);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HOLDING);
    g_assert_cmpuint(rig_see(&rig).executed_blocks, ==, 50);
    rig_run(&rig, 1, 1);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_HELD);
    /* 100 mm/s, 800 mm/s²: 6.25 mm. */
    test_near(rig_see(&rig).position_mm[0], 56.25, 1e-9, 0);
    rig_clear(&rig);
}

static void second_start_returns(void)
{
    Rig rig;
    double once_s = rig_start(&rig, INFINITY, "G21 G90\nG53 G0 X30 Y40 Z-10\nM30\n", NULL, 0);
    rig_run(&rig, 1, 1);
    rig_do(&rig, SIM_START);
    rig_run(&rig, 1, 1);
    g_assert_cmpuint(rig_blocks(&rig), ==, 4);
    SimBlock again = rig_block(&rig, 2);
    g_assert_cmpuint(again.line, ==, 2);
    /* Up to 500 mm and down again: 510 and 500 mm at 200 mm/s, 0.5 s more for the two ramps of
     * 400 mm/s². 50 mm across at 12000 mm/min per axis: Y limits acceleration to 600/0.8 and speed
     * to 250 mm/s, which are not reached; 2√(50/750) s. */
    test_near(again.start_s, (510 + 500) / 200.0 + 2 * 0.5 + 2 * sqrt(50.0 / 750), 1e-9, 0);
    test_near(again.end_s - again.start_s, once_s, 1e-9, 0);
    SimTotals totals = sim_controller_totals(rig.controller);
    g_assert_cmpuint(totals.started, ==, 2);
    g_assert_cmpuint(totals.completed, ==, 2);
    test_near(totals.machine_s, 2 * once_s + again.start_s, 1e-9, 0);
    rig_clear(&rig);
}

/* From within the part, tools being changed deeper still: nothing moves across but at the top. */
static void returns_over_the_top(void)
{
    Rig rig;
    rig_init(&rig, 1, 1000);
    sim_controller_free(rig.controller);
    rig.machine.tool_change_mm[2] = -300;
    SimControllerOptions options = {.machine = &rig.machine, .speed = 1, .moves_per_step = 1000};
    rig.controller = sim_controller_new(&options);
    rig_load(&rig, "G21 G90\nG53 G0 X30 Y40 Z-200\nM30\n", NULL, 0);
    rig_do(&rig, SIM_START);
    rig_run(&rig, 1000, 60);
    rig_do(&rig, SIM_START);
    double top = -INFINITY;
    unsigned across = 0;
    while (rig_see(&rig).line == 0 && rig.now_us < 60000000) {
        rig_tick(&rig, 1000);
        FbProgress see = rig_see(&rig);
        top = fmax(top, see.position_mm[2]);
        if (see.line == 0 && see.position_mm[0] > 1e-6 && see.position_mm[0] < 30 - 1e-6) {
            across++;
            g_assert_cmpfloat(see.position_mm[2], ==, 500);
        }
    }
    g_assert_cmpuint(across, >, 10);
    g_assert_cmpfloat(top, ==, 500);
    rig_clear(&rig);
}

static void optional_stops(void)
{
    const char *text = "G21 G90\nG53 G0 X10\nM1\nG53 G0 X20\nM1\nG53 G0 X30\nM2\n";
    Rig rig;
    rig_start(&rig, 1, text, NULL, 0);
    rig_optional_stop(&rig, true);
    rig_run(&rig, 1000, 5);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_PROGRAM_STOP);
    g_assert_cmpfloat(rig_see(&rig).position_mm[0], ==, 10);
    g_assert_cmpuint(rig_blocks(&rig), ==, 2);
    rig_optional_stop(&rig, false);
    rig_do(&rig, SIM_RESUME);
    rig_run(&rig, 1000, 5);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    g_autofree char *states = rig_states(&rig);
    g_assert_cmpstr(states, ==, "IDLE READY RUNNING PROGRAM_STOP RUNNING COMPLETE");
    rig_clear(&rig);
}

/* The last gate passed, the offset in force, and where a run that was cut off has to go on. */
static void shown(void)
{
    const char *text = "(head)\nG21 G90\nG55 G53 G0 X10\nG53 G1 X20 F600\nG54 G53 G0 X0\nM2\n";
    const uint64_t gates[] = {7, (uint64_t)(strstr(text, "G53 G1") - text),
                              (uint64_t)(strstr(text, "G54") - text), strlen(text)};
    Rig rig;
    rig_start(&rig, 1, text, gates, G_N_ELEMENTS(gates));
    g_assert_cmpuint(rig_see(&rig).gate, ==, 1);
    g_assert_cmpuint(rig_see(&rig).stop_line, ==, 0);
    rig_tick(&rig, 1000);
    g_assert_cmpuint(rig_see(&rig).work_offset, ==, 55);
    while (rig_see(&rig).line < 4 && rig.now_us < 5000000)
        rig_tick(&rig, 1000);
    g_assert_cmpuint(rig_see(&rig).gate, ==, 2);
    rig_do(&rig, SIM_ABORT);
    rig_run(&rig, 1000, 5);
    g_assert_cmpuint(rig_see(&rig).gate, ==, 2);
    g_assert_cmpuint(rig_see(&rig).stop_line, ==, 4);
    g_assert_cmpuint(rig_see(&rig).work_offset, ==, 54);
    rig_do(&rig, SIM_START);
    g_assert_cmpuint(rig_see(&rig).stop_line, ==, 0);
    g_assert_cmpuint(rig_see(&rig).gate, ==, 0);
    rig_run(&rig, 1000, 60);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_COMPLETE);
    g_assert_cmpuint(rig_see(&rig).gate, ==, 4);
    g_assert_cmpuint(rig_see(&rig).stop_line, ==, 0);
    rig_clear(&rig);
}

static void commands_in_wrong_states(void)
{
    static const SimEventKind kinds[] = {SIM_START,  SIM_HOLD,  SIM_HOLD_AT_GATE,
                                         SIM_RESUME, SIM_ABORT, SIM_FORGET};
    Rig rig;
    rig_init(&rig, 1, 1000);
    rig_do(&rig, SIM_ACKNOWLEDGE);
    for (size_t i = 0; i < G_N_ELEMENTS(kinds); i++)
        rig_do(&rig, kinds[i]);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_IDLE);
    g_assert_cmpuint(rig.actions->len, ==, 2); /* IDLE, and that it was told */
    rig_load(&rig, whole, NULL, 0);
    for (size_t i = 1; i < G_N_ELEMENTS(kinds) - 1; i++)
        rig_do(&rig, kinds[i]);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_READY);
    rig_do(&rig, SIM_ESTOP);
    rig_do(&rig, SIM_START);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_ESTOP);
    g_assert_false(sim_controller_moving(rig.controller));
    rig_clear(&rig);
}

static void refused(void)
{
    static const struct {
        const char *text;
        SimAlarm alarm;
        const char *names[2];
    } programs[] = {
        {"G21\nG33 Z1 K1\nM30\n", SIM_ALARM_PROGRAM, {"line 2", "G33"}},
        {"G21\nT9 M6\nM30\n", SIM_ALARM_PROGRAM, {"line 2", "T9"}},
        {"G21 G0 X1\n", SIM_ALARM_PROGRAM, {"M30", "M2"}},
        {"", SIM_ALARM_PROGRAM, {"M30", "M2"}},
        {"\x01\xff\xfe\n", SIM_ALARM_PROGRAM, {"line 1", "line"}},
        {"G21\nG53 G0 X501\nM30\n", SIM_ALARM_LIMIT, {"line 2", "501"}},
        {"S30000 M3\nM30\n", SIM_ALARM_LIMIT, {"line 1", "30000"}},
    };
    Rig rig;
    rig_init(&rig, 1, 1000);
    for (size_t i = 0; i < G_N_ELEMENTS(programs); i++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(SimProgram) program = rig_program(&rig, programs[i].text, NULL, 0, &error);
        g_assert_null(program);
        g_assert_error(error, SIM_ALARM, (int)programs[i].alarm);
        for (int k = 0; error && k < 2; k++)
            if (!strstr(error->message, programs[i].names[k])) {
                g_test_message("\"%s\" does not name %s", error->message, programs[i].names[k]);
                g_test_fail();
            }
        g_assert_nonnull(sim_alarm_text(programs[i].alarm));
        g_assert_nonnull(sim_alarm_advice(programs[i].alarm));
    }
    rig_clear(&rig);
}

static void gates_found(void)
{
    Rig rig;
    rig_init(&rig, 1, 1000);
    const char *text = "G21\n\nG53 G0 X1\n(c)\nG53 G0 X2\r\nM30";
    const uint64_t gates[] = {0, 4, 15, 19, 30, 33};
    g_autoptr(SimProgram) program = rig_program(&rig, text, gates, G_N_ELEMENTS(gates), NULL);
    static const size_t moves[] = {0, 0, 1, 1, 2, 3}; /* the end is behind M30, too */
    g_assert_nonnull(program);
    for (size_t i = 0; program && i < G_N_ELEMENTS(moves); i++)
        g_assert_cmpuint(program->gates[i], ==, moves[i]);
    rig_clear(&rig);
}

static void add(void)
{
    g_test_add_func("/sim/controller/run", run);
    g_test_add_func("/sim/controller/analytic-time", analytic_time);
    g_test_add_func("/sim/controller/same-at-every-speed", same_at_every_speed);
    g_test_add_func("/sim/controller/log-of-rotary", log_of_rotary);
    g_test_add_func("/sim/controller/messages", messages);
    g_test_add_func("/sim/controller/bounded-steps", bounded_steps);
    g_test_add_func("/sim/controller/second-start-returns", second_start_returns);
    g_test_add_func("/sim/controller/returns-over-the-top", returns_over_the_top);
    g_test_add_func("/sim/controller/optional-stops", optional_stops);
    g_test_add_func("/sim/controller/shown", shown);
    g_test_add_func("/sim/controller/commands-in-wrong-states", commands_in_wrong_states);
    g_test_add_func("/sim/controller/refused", refused);
    g_test_add_func("/sim/controller/gates-found", gates_found);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
