/* SPDX-License-Identifier: Apache-2.0 */
/* Drip feed: pass by pass the same blocks as stored; waiting for bytes; what goes wrong. */
#include "tests/unit/sim_cell.h"

#define SECOND 1000000

typedef struct {
    GString *text;
    GArray *gates; /* uint64_t */
} Dripped;

static void dripped_clear(Dripped *d)
{
    g_string_free(d->text, TRUE);
    g_array_unref(d->gates);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Dripped, dripped_clear)

static void add_pass(Dripped *d, const char *text)
{
    g_string_append(d->text, text);
    const uint64_t gate = d->text->len;
    g_array_append_val(d->gates, gate);
}

/* Passes that live on what those before them have set: units, distance mode, feed, speed, offset;
 * some without a move. */
static Dripped dripped_new(int n_passes, const char *bad)
{
    Dripped d = {g_string_new(NULL), g_array_new(FALSE, FALSE, sizeof(uint64_t))};
    add_pass(&d, "(first)\n");
    add_pass(&d, "G21 G90 G94 G64 P0.01\nT1 M6\nS3000 M3\nF2400\nG53 G0 Z-1\n");
    for (int i = 2; i < n_passes - 1; i++) {
        g_autofree char *pass = g_strdup_printf(
            "G53 G0 X%d.%d Y%d\nG91 G0 Z-2\nG1 X0.5%s\nG3 X0.25 Y0.25 J0.25\nG90 G53 G0 Z-1\n%s",
            i % 7, i % 10, i % 5, i % 20 == 3 ? " F3000" : "",
            i % 50 == 10   ? "S3100\n"
            : i % 50 == 11 ? "(nothing)\n\nG55\n"
                           : "");
        add_pass(&d, i == n_passes / 2 && bad ? bad : i % 40 == 7 ? "(no move)\n" : pass);
    }
    add_pass(&d, "M5\nM30\n");
    return d;
}

/* ------------------------------------------------------------------ a controller alone */

typedef struct {
    Rig rig;
    const Dripped *program;
    SimReader *reader;
    guint n_fed;
} Bench;

static void feed(Bench *b)
{
    const guint i = b->n_fed++;
    const uint64_t *gates = (const uint64_t *)(const void *)b->program->gates->data;
    const uint64_t from = i > 0 ? gates[i - 1] : 0, length = gates[i] - from;
    g_autoptr(GBytes) bytes = g_bytes_new(b->program->text->str + from, length);
    SimProgram *pass = sim_reader_read(b->reader, bytes, &length, 1,
                                       i + 1 == b->program->gates->len, NC_NO_OVERRIDE, NULL);
    rig_step(&b->rig, &(SimEvent){.kind = SIM_PASS, .program = pass});
}

static void bench_init(Bench *b, const Dripped *program, double speed, guint n_fed)
{
    *b = (Bench){.program = program};
    rig_init(&b->rig, speed, 1000);
    b->reader = sim_reader_new(&b->rig.machine, &b->rig.table);
    rig_do(&b->rig, SIM_ACKNOWLEDGE);
    rig_do(&b->rig, SIM_LOAD);
    while (b->n_fed < n_fed)
        feed(b);
    rig_do(&b->rig, SIM_START);
}

static void bench_clear(Bench *b)
{
    sim_reader_unref(b->reader);
    rig_clear(&b->rig);
}

/* Whenever the machine stands, `late_us` later, the next pass. */
static void run_fed(Bench *b, int64_t late_us)
{
    while (rig_state(&b->rig) == FB_STATE_RUNNING || rig_state(&b->rig) == FB_STATE_TOOL_CHANGE) {
        if (sim_controller_moving(b->rig.controller)) {
            rig_tick(&b->rig, 1000);
        } else {
            rig_tick(&b->rig, late_us);
            if (b->n_fed == b->program->gates->len)
                break;
            feed(b);
        }
    }
}

static void same_as_stored(void)
{
    g_auto(Dripped) program = dripped_new(120, NULL);
    Rig stored;
    rig_start(&stored, 1, program.text->str, (const uint64_t *)(const void *)program.gates->data,
              program.gates->len);
    rig_run(&stored, 1000, 600);
    double end_s[2] = {0};
    for (int late = 0; late < 2; late++) {
        Bench b;
        bench_init(&b, &program, late ? INFINITY : 1, late ? 0 : program.gates->len);
        run_fed(&b, 50000);
        g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_COMPLETE);
        g_assert_cmpuint(rig_see(&b.rig).gate, ==, program.gates->len);
        g_assert_cmpuint(rig_blocks(&b.rig), ==, rig_blocks(&stored));
        guint i = 0, k = 0;
        for (const SimBlock *block; (block = rig_next_block(&b.rig, &i)) != NULL;) {
            const SimBlock *whole = rig_next_block(&stored, &k);
            if (!whole || whole->line != block->line || whole->kind != block->kind ||
                seg_distance(whole->position_mm, block->position_mm) > 0 ||
                whole->feed_mm_min != block->feed_mm_min ||
                whole->spindle_rpm != block->spindle_rpm)
                g_test_fail();
            end_s[late] = block->end_s;
        }
        const FbProgress see = rig_see(&b.rig);
        /* Each pass that came late was waited for, the wait is not machine time. */
        g_assert_cmpuint(see.starved, ==, late ? program.gates->len : 0);
        g_assert_cmpuint(see.starved_ms, ==, late ? 50 * program.gates->len : 0);
        bench_clear(&b);
    }
    g_assert_cmpfloat(end_s[0], ==, end_s[1]);
    rig_clear(&stored);
}

static void while_starving(void)
{
    g_auto(Dripped) program = dripped_new(30, NULL);
    static const SimEventKind stops[] = {SIM_HOLD, SIM_HOLD_AT_GATE, SIM_ABORT, SIM_ESTOP};
    for (size_t i = 0; i < G_N_ELEMENTS(stops); i++) {
        Bench b;
        bench_init(&b, &program, 1, 5);
        rig_run(&b.rig, 1000, 60);
        FbProgress see = rig_see(&b.rig);
        g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_RUNNING);
        g_assert_true(see.starving);
        g_assert_cmpuint(see.gate, ==, 5);
        rig_tick(&b.rig, 3 * SECOND);
        g_assert_cmpuint(rig_see(&b.rig).starved_ms, ==, 3000);
        rig_do(&b.rig, stops[i]);
        see = rig_see(&b.rig);
        g_assert_false(see.starving);
        if (stops[i] == SIM_HOLD || stops[i] == SIM_HOLD_AT_GATE) {
            g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_HELD);
            rig_tick(&b.rig, SECOND);
            feed(&b);
            g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_HELD);
            g_assert_cmpuint(rig_see(&b.rig).starved_ms, ==, 3000);
            rig_do(&b.rig, SIM_RESUME);
            g_assert_true(sim_controller_moving(b.rig.controller));
            run_fed(&b, 1000);
            g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_COMPLETE);
        } else {
            const bool aborted = stops[i] == SIM_ABORT;
            g_assert_cmpint(rig_state(&b.rig), ==, aborted ? FB_STATE_IDLE : FB_STATE_ESTOP);
            g_assert_cmpuint(see.stop_line, ==, rig_last_block(&b.rig).line + 1);
            feed(&b); /* late: nobody wants it any more */
            rig_do(&b.rig, SIM_FORGET);
            rig_do(&b.rig, SIM_ACKNOWLEDGE);
            g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_IDLE);
            rig_do(&b.rig, SIM_START);
            g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_IDLE);
        }
        bench_clear(&b);
    }
}

/* A hold at the next gate of a program that drips is at the end of the pass. */
static void held_at_gate(void)
{
    g_auto(Dripped) program = dripped_new(30, NULL);
    Bench b;
    bench_init(&b, &program, 1, 20);
    while (rig_see(&b.rig).gate < 4 && b.rig.now_us < 60 * SECOND)
        rig_tick(&b.rig, 1000);
    rig_tick(&b.rig, 5000);
    rig_do(&b.rig, SIM_HOLD_AT_GATE);
    rig_run(&b.rig, 1000, 10);
    g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_HELD);
    g_assert_cmpuint(rig_see(&b.rig).gate, ==, 5);
    g_assert_cmpfloat(rig_see(&b.rig).position_mm[2], ==, -1);
    rig_do(&b.rig, SIM_RESUME);
    run_fed(&b, 1000);
    g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_COMPLETE);
    bench_clear(&b);
}

static void bad_pass(void)
{
    static const char *const bad[] = {"G33 Z1 K1\n", "G53 G0 X900\n", "G0 X1\nM99\n"};
    for (size_t i = 0; i < G_N_ELEMENTS(bad); i++)
        for (guint prefill = 5; prefill <= 25; prefill += 20) {
            g_auto(Dripped) program = dripped_new(40, bad[i]);
            Bench b;
            bench_init(&b, &program, 1, prefill);
            run_fed(&b, 1000);
            g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_ALARM);
            g_assert_cmpuint(rig_see(&b.rig).gate, ==, 20);
            g_assert_cmpfloat(rig_see(&b.rig).position_mm[2], ==, -1);
            g_assert_cmpuint(rig_see(&b.rig).stop_line, ==, rig_last_block(&b.rig).line + 1);
            rig_do(&b.rig, SIM_ACKNOWLEDGE);
            g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_IDLE);
            bench_clear(&b);
        }
}

/* Nothing behind the end is a program; a last pass without the end is none. */
static void ends(void)
{
    g_auto(Dripped) early = dripped_new(20, "M30\n");
    Bench b;
    bench_init(&b, &early, 1, 5);
    run_fed(&b, 1000);
    g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_COMPLETE);
    g_assert_cmpuint(rig_see(&b.rig).gate, ==, 11);
    g_assert_cmpuint(rig_see(&b.rig).stop_line, ==, 0);
    bench_clear(&b);
    g_auto(Dripped) open = dripped_new(20, NULL);
    g_string_truncate(open.text, open.text->len - strlen("M30\n"));
    g_array_index(open.gates, uint64_t, open.gates->len - 1) = open.text->len;
    bench_init(&b, &open, 1, 5);
    run_fed(&b, 1000);
    g_assert_cmpint(rig_state(&b.rig), ==, FB_STATE_ALARM);
    g_assert_cmpuint(rig_see(&b.rig).gate, ==, open.gates->len - 1);
    bench_clear(&b);
}

/* ------------------------------------------------------------------- over the real link */

/* The log's blocks without their times: a pass begins and ends at rest. */
static char *logged_blocks(const Cell *cell)
{
    g_autofree char *log = read_log(cell);
    g_auto(GStrv) lines = g_strsplit(log, "\n", -1);
    GString *blocks = g_string_new(NULL);
    for (char **line = lines; *line; line++) {
        const char *course = strstr(*line, "\"start_s\""),
                   *where = strstr(*line, "\"position_mm\"");
        if (g_str_has_prefix(*line, "{\"line\"") && course && where)
            g_string_append_printf(blocks, "%.*s%s\n", (int)(course - *line), *line, where);
    }
    return g_string_free(blocks, FALSE);
}

static void start_dripping(Cell *cell, const Dripped *program)
{
    sim_machine_press(cell->machine, SIM_ACKNOWLEDGE);
    deliver(cell, program->text->str, (const uint64_t *)(const void *)program->gates->data,
            program->gates->len);
    g_assert_no_error(cell->error);
    fb_session_start(cell->session);
}

/* 400 passes: 16 kB of table, and 3 kB for what is not executed yet. */
static void through_small_memory(void)
{
    g_auto(Dripped) program = dripped_new(400, NULL);
    const uint64_t memory = 40 * program.gates->len + 3000;
    static const struct {
        CfgDrip drip;
        double speed;
    } runs[] = {{CFG_DRIP_NEVER, INFINITY}, {CFG_DRIP_ALWAYS, 16}, {CFG_DRIP_AUTO, INFINITY}};
    g_autofree char *stored = NULL;
    g_assert_cmpuint(program.text->len, >, 8 * 3000);
    for (size_t i = 0; i < G_N_ELEMENTS(runs); i++) {
        Cell cell;
        const bool drips = runs[i].drip != CFG_DRIP_NEVER;
        if (cell_init_dripping(&cell, runs[i].speed, 30, drips ? memory : 1 << 20, runs[i].drip)) {
            start_dripping(&cell, &program);
            wait_done(&cell, FB_TASK_RUN);
            g_assert_no_error(cell.error);
            const FbStatus status = *fb_session_status(cell.session);
            g_assert_cmpint(status.state, ==, FB_STATE_COMPLETE);
            g_assert_cmpint(status.drip, ==, drips);
            g_assert_cmpuint(status.gate, ==, program.gates->len);
            g_test_message("speed %g: starved %u times, %u ms", runs[i].speed, status.starved,
                           status.starved_ms);
            /* A machine without a clock outruns every sender. */
            if (drips && isinf(runs[i].speed))
                g_assert_cmpuint(status.starved, >, 0);
            else
                g_assert_cmpuint(status.starved, ==, 0);
            g_autofree char *blocks = logged_blocks(&cell);
            if (!drips)
                stored = g_steal_pointer(&blocks);
            else
                g_assert_true(g_strcmp0(blocks, stored) == 0);
        }
        cell_clear(&cell);
    }
    g_assert_cmpuint(stored ? strlen(stored) : 0, >, 50000);
}

static void bad_pass_of_a_sender(void)
{
    g_auto(Dripped) program = dripped_new(200, "G53 G1 X10\nG33 Z1 K1\n");
    Cell cell;
    if (cell_init_dripping(&cell, INFINITY, 30, 40 * 200 + 2000, CFG_DRIP_ALWAYS)) {
        start_dripping(&cell, &program);
        wait_done(&cell, FB_TASK_RUN);
        g_assert_error(cell.error, FB_ERROR, FB_ERROR_ALARM);
        const FbStatus status = *fb_session_status(cell.session);
        g_assert_cmpint(status.state, ==, FB_STATE_ALARM);
        g_assert_cmpuint(status.alarm_code, ==, SIM_ALARM_PROGRAM);
        g_assert_nonnull(strstr(status.alarm_text, "G33"));
        g_assert_cmpfloat(status.position_mm[2], ==, -1);
        sim_machine_press(cell.machine, SIM_ACKNOWLEDGE);
        wait_state(&cell, FB_STATE_IDLE);
        g_autofree char *log = read_log(&cell);
        g_assert_nonnull(strstr(log, "{\"refused\":101,"));
        g_assert_nonnull(strstr(log, "\"passes\":200}"));
    }
    cell_clear(&cell);
}

/* The bytes change behind the sender's back when it has announced the hashes: the pass is not
 * taken, the sender gives up, the machine is held at a gate before. */
static void wrong_running_hash(void)
{
    g_auto(Dripped) program = dripped_new(300, NULL);
    const uint64_t *gates = (const uint64_t *)(const void *)program.gates->data;
    Cell cell;
    if (cell_init_dripping(&cell, 20, 30, 40 * 300 + 2000, CFG_DRIP_ALWAYS)) {
        sim_machine_press(cell.machine, SIM_ACKNOWLEDGE);
        g_autoptr(GBytes) bytes = g_bytes_new_static(program.text->str, program.text->len);
        fb_session_deliver(cell.session, bytes, gates, program.gates->len);
        wait_done(&cell, FB_TASK_DELIVER);
        g_assert_no_error(cell.error);
        program.text->str[gates[149] + 7]++;
        fb_session_start(cell.session);
        wait_done(&cell, FB_TASK_RUN);
        g_assert_error(cell.error, FB_ERROR, FB_ERROR_REFUSED);
        wait_state(&cell, FB_STATE_HELD);
        const FbStatus status = *fb_session_status(cell.session);
        g_assert_cmpuint(status.gate, <=, 150);
        g_assert_cmpuint(status.gate, >, 0);
        g_assert_cmpfloat(status.position_mm[2], ==, -1);
        fb_session_command(cell.session, FB_COMMAND_ABORT, NULL);
        wait_state(&cell, FB_STATE_IDLE);
    }
    cell_clear(&cell);
}

/* Nobody sends, nobody beats: held where it starves, and the rest never comes. */
static void agent_lost_while_starving(void)
{
    g_auto(Dripped) program = dripped_new(200, NULL);
    Cell cell;
    if (cell_init_dripping(&cell, 20, 0.5, 40 * 200 + 1000, CFG_DRIP_ALWAYS)) {
        start_dripping(&cell, &program);
        wait_state(&cell, FB_STATE_RUNNING);
        g_clear_pointer(&cell.session, fb_session_free);
        connect_agent(&cell);
        wait_state(&cell, FB_STATE_HELD);
        const FbStatus status = *fb_session_status(cell.session);
        g_assert_true(status.agent_lost);
        g_assert_cmpuint(status.gate, <, 200);
        g_assert_cmpfloat(status.position_mm[2], ==, status.gate == 1 ? 0 : -1);
        g_assert_false(status.starving);
        fb_session_command(cell.session, FB_COMMAND_ABORT, NULL);
        wait_state(&cell, FB_STATE_IDLE);
        g_assert_cmpuint(fb_session_status(cell.session)->transfer, ==, 0);
    }
    cell_clear(&cell);
}

static void estop_of_a_dripped_run(void)
{
    g_auto(Dripped) program = dripped_new(200, NULL);
    Cell cell;
    if (cell_init_dripping(&cell, 1, 30, 40 * 200 + 1000, CFG_DRIP_ALWAYS)) {
        start_dripping(&cell, &program);
        wait_state(&cell, FB_STATE_TOOL_CHANGE);
        sim_machine_press(cell.machine, SIM_ESTOP);
        wait_done(&cell, FB_TASK_RUN);
        g_assert_error(cell.error, FB_ERROR, FB_ERROR_ALARM);
        sim_machine_press(cell.machine, SIM_ACKNOWLEDGE);
        wait_state(&cell, FB_STATE_IDLE);
        /* And the machine takes another one. */
        deliver(&cell, "M30\n", NULL, 0);
        g_assert_no_error(cell.error);
        wait_state(&cell, FB_STATE_READY);
    }
    cell_clear(&cell);
}

static void add(void)
{
    g_test_add_func("/sim/drip/same-as-stored", same_as_stored);
    g_test_add_func("/sim/drip/while-starving", while_starving);
    g_test_add_func("/sim/drip/held-at-gate", held_at_gate);
    g_test_add_func("/sim/drip/bad-pass", bad_pass);
    g_test_add_func("/sim/drip/ends", ends);
    g_test_add_func("/sim/drip/small-memory", through_small_memory);
    g_test_add_func("/sim/drip/bad-pass-of-a-sender", bad_pass_of_a_sender);
    g_test_add_func("/sim/drip/wrong-running-hash", wrong_running_hash);
    g_test_add_func("/sim/drip/agent-lost", agent_lost_while_starving);
    g_test_add_func("/sim/drip/estop", estop_of_a_dripped_run);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
