/* SPDX-License-Identifier: Apache-2.0 */
/* The whole machine on loopback, commanded by an agent's session in the same main loop. */
#include "sim/setup.h"
#include "tests/unit/sim_cell.h"

static void run_twice(void)
{
    Cell cell;
    if (cell_init(&cell, INFINITY, 30)) {
        for (uint64_t i = 1; i <= 2; i++) {
            ready(&cell, "G21 G90\nT1 M6\nG53 G0 X10 F100\nG53 G1 X11\nG53 G0 X0\nM30\n", NULL, 0);
            fb_session_start(cell.session);
            wait_done(&cell, FB_TASK_RUN);
            g_assert_no_error(cell.error);
            FbStatus status = *fb_session_status(cell.session);
            g_assert_cmpint(status.state, ==, FB_STATE_COMPLETE);
            g_assert_cmpuint(status.executed_blocks, ==, 5 * i);
            g_assert_cmpint(status.tool, ==, 1);
            g_assert_cmpuint(status.epoch, ==, 7);
        }
        g_autofree char *summary = sim_machine_summary(cell.machine);
        g_assert_nonnull(strstr(summary, "2 started, 2 completed, 0 aborted"));
        g_assert_nonnull(strstr(summary, "blocks executed: 10\n"));
        g_assert_nonnull(strstr(summary, "Modbus exceptions: 0\n"));
        g_autofree char *log = read_log(&cell);
        g_auto(GStrv) lines = g_strsplit(log, "\n", -1);
        g_assert_true(g_str_has_prefix(lines[1], "{\"program\":\""));
        /* IDLE, the program and READY; then RUNNING to COMPLETE, twice. */
        g_assert_cmpuint(g_strv_length(lines), ==, 3 + 2 * (4 + 5) + 1);
        for (int i = 0; i < 9 && g_strv_length(lines) > 20; i++)
            g_assert_cmpstr(lines[3 + i], ==, lines[12 + i]);
    }
    cell_clear(&cell);
}

/* 70 tools: the 60 with the lowest numbers; another offset in force is another setup. */
static void setup(void)
{
    CfgTool tools[70];
    for (int i = 0; i < 70; i++)
        tools[i] = (CfgTool){.number = i + 1,
                             .kind = CFG_TOOL_BULL,
                             .diameter_mm = 6 + i,
                             .corner_radius_mm = 0.5,
                             .length_mm = 50.25 + i};
    CfgToolTable table = {.tools = tools, .n_tools = 70};
    Cell cell = {0};
    rig_init(&cell.rig, 1, 1);
    cell.rig.machine.work_offset_mm[1][2] = -123.4567;
    FbSetup setup = sim_setup(&cell.rig.machine, &table, 55);
    g_assert_cmpuint(setup.n_tools, ==, 60);
    g_assert_cmpint(setup.tools[59].number, ==, 60);
    g_assert_cmpint(setup.tools[59].kind, ==, CFG_TOOL_BULL);
    g_assert_cmpfloat(setup.tools[59].length_mm, ==, 50.25 + 59);
    rig_clear(&cell.rig);
    if (cell_init(&cell, INFINITY, 30) &&
        ready(&cell, "G21 G90 G55\nG53 G0 X1\nM0\nM30\n", NULL, 0)) {
        fb_session_read_setup(cell.session);
        wait_done(&cell, FB_TASK_SETUP);
        g_assert_no_error(cell.error);
        const FbSetup *read = fb_session_setup(cell.session);
        g_assert_nonnull(read);
        const uint16_t serial = read ? read->serial : 0;
        g_assert_cmpuint(read ? read->n_tools : 0, ==, 2);
        g_assert_cmpuint(read ? read->work_offset : 0, ==, 54);
        fb_session_start(cell.session);
        wait_state(&cell, FB_STATE_PROGRAM_STOP);
        g_assert_cmpuint(fb_session_status(cell.session)->work_offset, ==, 55);
        g_assert_cmpuint(fb_session_status(cell.session)->setup_serial, !=, serial);
        fb_session_command(cell.session, FB_COMMAND_RESUME, NULL);
        wait_done(&cell, FB_TASK_RUN);
        g_assert_no_error(cell.error);
        g_assert_cmpuint(fb_session_status(cell.session)->work_offset, ==, 54);
    }
    cell_clear(&cell);
}

static void refused(void)
{
    Cell cell;
    if (cell_init(&cell, INFINITY, 30)) {
        sim_machine_press(cell.machine, SIM_ACKNOWLEDGE);
        deliver(&cell, "G21\nG33 Z1 K1\nM30\n", NULL, 0);
        g_assert_error(cell.error, FB_ERROR, FB_ERROR_REFUSED);
        if (cell.error)
            g_assert_nonnull(strstr(cell.error->message, "line 2, column 1: G33"));
        g_assert_cmpuint(fb_session_status(cell.session)->alarm_code, ==, SIM_ALARM_PROGRAM);
        /* A text too long for the wire is cut between characters, and says so. */
        deliver(&cell, "G21\nG53 G0 X501\nM30\n", NULL, 0);
        g_assert_error(cell.error, FB_ERROR, FB_ERROR_REFUSED);
        FbStatus status = *fb_session_status(cell.session);
        g_assert_cmpuint(status.alarm_code, ==, SIM_ALARM_LIMIT);
        g_assert_true(g_str_has_prefix(status.alarm_text, "line 2: X would go to 501"));
        g_assert_true(g_str_has_suffix(status.alarm_text, "…"));
        g_assert_cmpuint(strlen(status.alarm_text), >, FB_TEXT_BYTES - 6);
        deliver(&cell, "M30\n", NULL, 0);
        g_assert_no_error(cell.error);
        wait_state(&cell, FB_STATE_READY);
        g_autofree char *summary = sim_machine_summary(cell.machine);
        g_assert_nonnull(strstr(summary, "2 refused at VERIFY"));
        g_autofree char *log = read_log(&cell);
        g_assert_nonnull(strstr(log, "{\"refused\":101,\"text\":\"line 2, column 1: G33"));
    }
    cell_clear(&cell);
}

static void emergency_stop(void)
{
    Cell cell;
    if (cell_init(&cell, 1, 30) && ready(&cell, "G21 G90 G53 G1 X400 F600\nM30\n", NULL, 0)) {
        fb_session_start(cell.session);
        wait_state(&cell, FB_STATE_RUNNING);
        sim_machine_press(cell.machine, SIM_ESTOP);
        wait_done(&cell, FB_TASK_RUN);
        g_assert_error(cell.error, FB_ERROR, FB_ERROR_ALARM);
        g_assert_cmpint(fb_session_status(cell.session)->state, ==, FB_STATE_ESTOP);
        g_assert_cmpuint(fb_session_status(cell.session)->alarm_code, ==, SIM_ALARM_ESTOP);
        g_usleep(100000);
        sim_machine_press(cell.machine, SIM_ACKNOWLEDGE);
        wait_state(&cell, FB_STATE_READY);
    }
    cell_clear(&cell);
}

/* 10 mm in each line: the machine comes to rest behind one of them. */
static void agent_lost(void)
{
    g_autoptr(GString) text = g_string_new("G21 G90 G64 P0.01 F6000\n");
    uint64_t gates[40];
    for (int i = 0; i < 40; i++) {
        g_string_append_printf(text, "G53 G1 X%d\n", 10 * (i + 1));
        gates[i] = text->len;
    }
    g_string_append(text, "M30\n");
    gates[39] = text->len;
    Cell cell;
    if (cell_init(&cell, 1, 0.5) && ready(&cell, text->str, gates, 40)) {
        fb_session_start(cell.session);
        wait_state(&cell, FB_STATE_RUNNING);
        g_clear_pointer(&cell.session, fb_session_free);
        connect_agent(&cell);
        wait_state(&cell, FB_STATE_HELD);
        FbStatus status = *fb_session_status(cell.session);
        double rest = fabs(fmod(status.position_mm[0] + 5, 10) - 5);
        g_assert_cmpfloat(rest, <, 1e-6);
        g_assert_cmpfloat(status.position_mm[0], >, 30);
        g_assert_true(status.agent_lost || status.needs_acknowledge);
    }
    cell_clear(&cell);
}

/* Neither examining nor executing a long program keeps the link waiting. */
static void link_is_served(void)
{
    enum { LINES = 150000 };
    g_autoptr(GString) text = g_string_new("G21 G90 G64 P0.01 F6000 G53 G1 X0.01\n");
    for (int i = 0; i < LINES; i++)
        g_string_append_printf(text, "G53 X%d.%d\n", i % 7, i % 9);
    g_string_append(text, "M30\n");
    Cell cell;
    if (cell_init(&cell, INFINITY, 30) && ready(&cell, text->str, NULL, 0)) {
        fb_session_start(cell.session);
        wait_state(&cell, FB_STATE_RUNNING);
        fb_session_command(cell.session, FB_COMMAND_HOLD, NULL);
        wait_state(&cell, FB_STATE_HELD);
        uint64_t blocks = fb_session_status(cell.session)->executed_blocks;
        g_assert_cmpuint(blocks, <, LINES);
        fb_session_command(cell.session, FB_COMMAND_RESUME, NULL);
        wait_done(&cell, FB_TASK_RUN);
        g_assert_no_error(cell.error);
        g_assert_cmpuint(fb_session_status(cell.session)->executed_blocks, ==, LINES + 2);
        g_test_message("longest silence %.0f ms", (double)cell.longest_us / 1000);
        g_assert_cmpint(cell.longest_us, <, 3000000);
    }
    cell_clear(&cell);
}

/* RESTART over the link: at a gate it is done, elsewhere the receiver refuses. */
static void restarted(void)
{
    const char *text = "G21 G90 G61\nT1 M6\nS3000 M3\nG53 G0 X10\nG53 G1 Z-20 F600\n"
                       "G53 G0 Z0\nG53 G1 X30 Z-5\nG53 G0 Z0\nM30\n";
    const uint64_t gates[] = {(uint64_t)(strstr(text, "G53 G1 X30") - text), strlen(text)};
    static const struct {
        uint32_t gate;
        int64_t off;
        const char *answer;
    } wrong[] = {{1, 1, "GATE"}, {2, 0, "GATE"}, {3, 0, "GATE"}};
    Cell cell;
    if (cell_init(&cell, INFINITY, 30) && ready(&cell, text, gates, 2)) {
        for (size_t i = 0; i < G_N_ELEMENTS(wrong); i++) {
            FbStored stored = {.gate = wrong[i].gate,
                               .gate_offset =
                                   gates[MIN(wrong[i].gate, 2) - 1] + (uint64_t)wrong[i].off};
            fb_session_start_stored(cell.session, &stored);
            wait_done(&cell, FB_TASK_RUN);
            g_assert_error(cell.error, FB_ERROR, FB_ERROR_REFUSED);
            if (cell.error)
                g_assert_nonnull(strstr(cell.error->message, wrong[i].answer));
            g_assert_cmpuint(fb_session_status(cell.session)->run, ==, 0);
        }
        fb_session_start_stored(cell.session, &(FbStored){.gate = 1, .gate_offset = gates[0]});
        wait_done(&cell, FB_TASK_RUN);
        g_assert_no_error(cell.error);
        const FbStatus status = *fb_session_status(cell.session);
        g_assert_cmpint(status.state, ==, FB_STATE_COMPLETE);
        g_assert_cmpuint(status.executed_blocks, ==, 3);
        g_assert_cmpuint(status.gate, ==, 2);
        g_assert_cmpint(status.tool, ==, 1);
        g_autofree char *log = read_log(&cell);
        static const char *const order[] = {
            "{\"way\":\"spindle\"", "\"position_mm\":[10,0,0],\"tool\":1,\"spindle_rpm\":3000}",
            "{\"line\":7,"};
        const char *at = log;
        for (size_t i = 0; at && i < G_N_ELEMENTS(order); i++)
            at = strstr(at, order[i]);
        g_assert_nonnull(at);
        g_assert_null(strstr(log, "{\"line\":6,"));
    }
    cell_clear(&cell);
}

/* The overrides of the link reach a run, and one that begins later. */
static void overridden(void)
{
    Cell cell;
    if (cell_init(&cell, 1, 30) &&
        ready(&cell, "G21 G90 S3000 M3\nG53 G1 X400 F1200\nM30\n", NULL, 0)) {
        FbArguments turn = {.feed_percent = 50, .rapid_percent = 100, .spindle_percent = 120};
        fb_session_command(cell.session, FB_COMMAND_OVERRIDE, &turn);
        wait_done(&cell, FB_TASK_COMMAND);
        g_assert_no_error(cell.error);
        fb_session_start(cell.session);
        wait_feed(&cell, 2, 600);
        g_assert_cmpfloat(fb_session_status(cell.session)->feed_mm_min, ==, 600);
        g_assert_cmpfloat(fb_session_status(cell.session)->spindle_rpm, ==, 3600);
        turn.feed_percent = 200;
        fb_session_command(cell.session, FB_COMMAND_OVERRIDE, &turn);
        wait_feed(&cell, 2, 2400);
        g_assert_cmpfloat(fb_session_status(cell.session)->feed_mm_min, ==, 2400);
        turn.feed_percent = 0;
        fb_session_command(cell.session, FB_COMMAND_OVERRIDE, &turn);
        wait_feed(&cell, 2, 0);
        g_assert_cmpint(fb_session_status(cell.session)->state, ==, FB_STATE_RUNNING);
        fb_session_command(cell.session, FB_COMMAND_ABORT, NULL);
        wait_state(&cell, FB_STATE_READY);
        g_autofree char *log = read_log(&cell);
        g_assert_nonnull(strstr(log, "{\"override\":{\"feed\":50,\"rapid\":100,\"spindle\":120},"
                                     "\"time_s\":0}"));
        g_assert_nonnull(strstr(log, "{\"override\":{\"feed\":200,"));
    }
    cell_clear(&cell);
}

/* The worst case for planning anew: a program of 300 000 moves that runs. */
static void overridden_and_long(void)
{
    enum { LINES = 300000 };
    g_autoptr(GString) text = g_string_new("G21 G90 G64 P0.01 F600 G53 G1 X0.01\n");
    for (int i = 0; i < LINES; i++)
        g_string_append_printf(text, "G53 X%d.%d\n", i % 7, i % 9);
    g_string_append(text, "M30\n");
    Cell cell;
    if (cell_init(&cell, 1, 30) && ready(&cell, text->str, NULL, 0)) {
        fb_session_start(cell.session);
        wait_feed(&cell, 3, 600);
        const int64_t from_us = g_get_monotonic_time();
        cell.longest_us = 0;
        FbArguments turn = {.feed_percent = 10, .rapid_percent = 100, .spindle_percent = 100};
        fb_session_command(cell.session, FB_COMMAND_OVERRIDE, &turn);
        wait_feed(&cell, 3, 60);
        g_test_message("in force after %.0f ms, longest silence %.0f ms",
                       (double)(g_get_monotonic_time() - from_us) / 1000,
                       (double)cell.longest_us / 1000);
        g_assert_cmpfloat(fb_session_status(cell.session)->feed_mm_min, ==, 60);
        g_assert_cmpint(cell.longest_us, <, 1000000);
        fb_session_command(cell.session, FB_COMMAND_ABORT, NULL);
        wait_state(&cell, FB_STATE_READY);
    }
    cell_clear(&cell);
}

static void closed_while_examining(void)
{
    g_autoptr(GString) text = g_string_new("G21 G90 F600 G53 G1 X1\n");
    for (int i = 0; i < 100000; i++)
        g_string_append_printf(text, "G53 X%d\n", i % 7);
    g_string_append(text, "M30\n");
    Cell cell;
    if (cell_init(&cell, INFINITY, 30)) {
        sim_machine_press(cell.machine, SIM_ACKNOWLEDGE);
        g_autoptr(GBytes) program = g_bytes_new(text->str, text->len);
        const uint64_t end = text->len;
        fb_session_deliver(cell.session, program, &end, 1);
        wait_state(&cell, FB_STATE_VERIFYING);
        sim_machine_press(cell.machine, SIM_ESTOP);
        wait_state(&cell, FB_STATE_ESTOP);
        sim_machine_press(cell.machine, SIM_ACKNOWLEDGE);
        g_assert_cmpint(fb_session_status(cell.session)->state, !=, FB_STATE_READY);
    }
    cell_clear(&cell); /* with the examination still under way */
}

static void add(void)
{
    g_test_add_func("/sim/machine/run-twice", run_twice);
    g_test_add_func("/sim/machine/setup", setup);
    g_test_add_func("/sim/machine/refused", refused);
    g_test_add_func("/sim/machine/estop", emergency_stop);
    g_test_add_func("/sim/machine/agent-lost", agent_lost);
    g_test_add_func("/sim/machine/link-is-served", link_is_served);
    g_test_add_func("/sim/machine/restarted", restarted);
    g_test_add_func("/sim/machine/overridden", overridden);
    g_test_add_func("/sim/machine/overridden-and-long", overridden_and_long);
    g_test_add_func("/sim/machine/closed-while-examining", closed_while_examining);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
