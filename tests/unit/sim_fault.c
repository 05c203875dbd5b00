/* SPDX-License-Identifier: Apache-2.0 */
/* Faults on purpose: the grammar, the state machine, and the moments of a run. */
#include "sim/fault.h"

#include <stdio.h>

#include "tests/unit/sim_rig.h"

/* -------------------------------------------------------------------------- the grammar */

static void one_each(void)
{
    static const struct {
        const char *spec;
        SimFault is;
    } good[] = {
        {"at line 12: hold", {.moment = SIM_AT_LINE, .number = 12, .kind = SIM_FAULT_HOLD}},
        {"at time 1.5:estop", {.moment = SIM_AT_TIME, .time_s = 1.5, .kind = SIM_FAULT_ESTOP}},
        {" at  frame\t7 : reboot ",
         {.moment = SIM_AT_FRAME, .number = 7, .kind = SIM_FAULT_REBOOT}},
        {"at line 1: alarm 65535", {.number = 1, .kind = SIM_FAULT_ALARM, .code = 65535}},
        {"at line 1: tool-missing", {.number = 1, .kind = SIM_FAULT_TOOL_MISSING}},
        {"at line 1: limit-hit", {.number = 1, .kind = SIM_FAULT_LIMIT_HIT}},
        {"at line 1: drop", {.number = 1, .kind = SIM_FAULT_DROP}},
        {"at line 1: duplicate", {.number = 1, .kind = SIM_FAULT_DUPLICATE}},
        {"at line 1: delay .25", {.number = 1, .kind = SIM_FAULT_DELAY, .seconds = 0.25}},
        {"at line 1: corrupt", {.number = 1, .kind = SIM_FAULT_CORRUPT, .bit = 100}},
        {"at line 1: corrupt 3", {.number = 1, .kind = SIM_FAULT_CORRUPT, .bit = 3}},
        {"at line 1: close", {.number = 1, .kind = SIM_FAULT_CLOSE}},
        {"at line 1: slow 0", {.number = 1, .kind = SIM_FAULT_SLOW}},
        {"at line 1000000000: slow 3600",
         {.number = 1000000000, .kind = SIM_FAULT_SLOW, .seconds = 3600}},
    };
    g_autoptr(SimFaultScript) script = sim_fault_script_new();
    for (size_t i = 0; i < G_N_ELEMENTS(good); i++) {
        g_autoptr(GError) error = NULL;
        g_assert_true(sim_fault_script_add(script, good[i].spec, &error));
        g_assert_no_error(error);
        g_assert_cmpuint(script->faults->len, ==, i + 1);
        if (script->faults->len != i + 1)
            return;
        const SimFault *is = &g_array_index(script->faults, SimFault, i);
        g_assert_cmpint(is->moment, ==, good[i].is.moment);
        g_assert_cmpuint(is->number, ==, good[i].is.number);
        g_assert_cmpfloat(is->time_s, ==, good[i].is.time_s);
        g_assert_cmpint(is->kind, ==, good[i].is.kind);
        g_assert_cmpuint(is->code, ==, good[i].is.code);
        g_assert_cmpfloat(is->seconds, ==, good[i].is.seconds);
        g_assert_cmpuint(is->bit, ==, good[i].is.bit);
        g_assert_null(is->text);
        g_assert_cmpstr(is->spec, ==, good[i].spec);
    }
    g_assert_cmpfloat(script->rate, ==, 0);
}

static void alarm_text(void)
{
    g_autoptr(SimFaultScript) script = sim_fault_script_new();
    g_assert_true(sim_fault_script_add(script, "at line 3: alarm 7  Öl: # low  ", NULL));
    g_assert_cmpuint(script->faults->len, ==, 1);
    if (script->faults->len == 1)
        g_assert_cmpstr(g_array_index(script->faults, SimFault, 0).text, ==, "Öl: # low");
}

static void random_mode(void)
{
    static const struct {
        const char *spec;
        uint32_t seed;
        double rate;
    } good[] = {{"random", 99, 0.01},
                {"random:4294967295:0.5", 4294967295u, 0.5},
                {"random:7", 7, 0.01},
                {" random : 7\t: 0.25 ", 7, 0.25}};
    for (size_t i = 0; i < G_N_ELEMENTS(good); i++) {
        g_autoptr(SimFaultScript) script = sim_fault_script_new();
        g_autoptr(GError) error = NULL;
        script->seed = 99;
        g_assert_true(sim_fault_script_add(script, good[i].spec, NULL));
        g_assert_false(sim_fault_script_add(script, " random:5:1", &error));
        g_assert_error(error, SIM_FAULT_ERROR, SIM_FAULT_ERROR_SYNTAX);
        g_assert_nonnull(error ? strstr(error->message, "column 2: a second \"random\"") : NULL);
        g_assert_cmpuint(script->seed, ==, good[i].seed);
        g_assert_cmpfloat(script->rate, ==, good[i].rate);
        g_assert_cmpuint(script->faults->len, ==, 0);
    }
}

/* A wrong one is refused at its place, and adds nothing. */
static void wrong(void)
{
    static const struct {
        const char *spec;
        int column;
        const char *word;
    } bad[] = {
        {"", 1, "at line N"},
        {"line 12: hold", 1, "at line N"},
        {"attention", 1, "at line N"},
        {"at noon: hold", 4, "line, time or frame"},
        {"at line: hold", 8, "a whole number"},
        {"at line 0: hold", 9, "a whole number"},
        {"at line -1: hold", 9, "a whole number"},
        {"at line 1.5: hold", 9, "a whole number"},
        {"at line 1000000001: hold", 9, "a whole number"},
        {"at line 12 hold", 12, "\":\""},
        {"at line 12", 11, "\":\""},
        {"at time inf: hold", 9, "seconds"},
        {"at time 1e3: hold", 9, "seconds"},
        {"at time 1.2.3: hold", 9, "seconds"},
        {"at time .: hold", 9, "seconds"},
        {"at time 0x10: hold", 9, "seconds"},
        {"at line 1:", 11, "one of alarm, hold"},
        {"at line 1: explode", 12, "tool-missing"},
        {"at line 1: holding", 12, "tool-missing"},
        {"at line 1: hold now", 17, "the end"},
        {"at line 1: alarm", 17, "a code"},
        {"at line 1: alarm 0", 18, "a code"},
        {"at line 1: alarm 65536", 18, "a code"},
        {"at line 1: alarm low", 18, "a code"},
        {"at line 1: delay", 17, "seconds"},
        {"at line 1: delay 3601", 18, "seconds"},
        {"at line 1: slow fast", 17, "seconds"},
        {"at line 1: corrupt all", 20, "a bit"},
        {"random:", 8, "a seed"},
        {"random:x", 8, "a seed"},
        {"random:4294967296", 8, "a seed"},
        {"random:1:", 10, "a rate"},
        {"random:1:1.5", 10, "a rate"},
        {"random:1:0.1:2", 13, "the end"},
        {"randomly", 1, "random"},
        {"at line 1: alarm 1 \xff", 20, "UTF-8"},
    };
    g_autoptr(SimFaultScript) script = sim_fault_script_new();
    for (size_t i = 0; i < G_N_ELEMENTS(bad); i++) {
        g_autoptr(GError) error = NULL;
        g_autofree char *place = g_strdup_printf("column %d: ", bad[i].column);
        g_assert_false(sim_fault_script_add(script, bad[i].spec, &error));
        g_assert_error(error, SIM_FAULT_ERROR, SIM_FAULT_ERROR_SYNTAX);
        if (!error || !g_str_has_prefix(error->message, place) ||
            !strstr(error->message, bad[i].word))
            g_test_message("\"%s\": %s", bad[i].spec, error ? error->message : "no error");
        g_assert_true(error && g_str_has_prefix(error->message, place));
        g_assert_true(error && strstr(error->message, bad[i].word));
    }
    g_assert_cmpuint(script->faults->len, ==, 0);
    g_assert_cmpfloat(script->rate, ==, 0);
}

static void files(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "faults", NULL);
    g_autoptr(SimFaultScript) script = sim_fault_script_new();
    g_autoptr(GError) error = NULL;
    g_file_set_contents(path, "# what goes wrong\n\n at line 2: hold\r\n  # later\nrandom:5", -1,
                        NULL);
    g_assert_true(sim_fault_script_read(script, path, &error));
    g_assert_no_error(error);
    g_assert_cmpuint(script->faults->len, ==, 1);
    g_assert_cmpuint(script->seed, ==, 5);

    g_file_set_contents(path, "at line 2: hold\n\nat line 3: fly\n", -1, NULL);
    g_autofree char *place = g_strconcat(path, ":3: column 12: ", NULL);
    g_assert_false(sim_fault_script_read(script, path, &error));
    g_assert_true(error && g_str_has_prefix(error->message, place));
    g_clear_error(&error);
    g_file_set_contents(path, "at line 2: hold\n\0at line 3: fly\n", 33, NULL);
    g_assert_false(sim_fault_script_read(script, path, &error));
    g_assert_error(error, SIM_FAULT_ERROR, SIM_FAULT_ERROR_SYNTAX);
    g_clear_error(&error);
    g_assert_false(sim_fault_script_read(script, folder, &error));
    g_assert_error(error, G_FILE_ERROR, G_FILE_ERROR_ISDIR);
    test_folder_remove(folder);
}

/* ------------------------------------------------------------------ the state machine */

typedef struct {
    SimFaultScript *script;
    SimFaults *faults;
    GArray *actions; /* of the last step */
} Bench;

static Bench bench(const char *const *specs)
{
    Bench b = {.script = sim_fault_script_new(),
               .actions = g_array_new(FALSE, FALSE, sizeof(SimFaultDo))};
    for (size_t i = 0; specs[i]; i++)
        g_assert_true(sim_fault_script_add(b.script, specs[i], NULL));
    b.faults = sim_faults_new(b.script);
    return b;
}

static void bench_clear(Bench *b)
{
    sim_faults_free(b->faults);
    sim_fault_script_free(b->script);
    g_array_unref(b->actions);
}

static void bench_step(Bench *b, SimFaultEventKind kind, uint32_t line, double time_s)
{
    g_array_set_size(b->actions, 0);
    sim_faults_step(b->faults, &(SimFaultEvent){.kind = kind, .line = line}, time_s, b->actions);
}

/* What the last step did, as text; the fate only where it is not the usual one. */
static char *done(const Bench *b)
{
    GString *text = g_string_new(NULL);
    for (guint i = 0; i < b->actions->len; i++) {
        const SimFaultDo *a = &g_array_index(b->actions, SimFaultDo, i);
        if (a->kind == SIM_FAULT_DO_NOTE)
            g_string_append_printf(text, "[%s]", a->spec);
        else if (a->kind == SIM_FAULT_DO_CUT)
            g_string_append(text, "cut ");
        else if (a->kind == SIM_FAULT_DO_EVENT && a->event == SIM_FAIL)
            g_string_append_printf(text, "fail %u %s ", a->alarm.code, a->alarm.text);
        else if (a->kind == SIM_FAULT_DO_EVENT)
            g_string_append(text, a->event == SIM_HOLD    ? "hold "
                                  : a->event == SIM_ESTOP ? "estop "
                                                          : "? ");
        else if (a->fate.close)
            g_string_append(text, "close ");
        else if (a->fate.copies != 1 || a->fate.delay_us != 0 || a->fate.corrupt)
            g_string_append_printf(text, "%u copies, %d ms, bit %d ", a->fate.copies,
                                   (int)(a->fate.delay_us / 1000),
                                   a->fate.corrupt ? (int)a->fate.bit : -1);
    }
    return g_strchomp(g_string_free(text, FALSE));
}

static void expect(Bench *b, SimFaultEventKind kind, uint32_t line, double time_s, const char *what)
{
    bench_step(b, kind, line, time_s);
    g_autofree char *text = done(b);
    g_assert_cmpstr(text, ==, what);
}

/* Each once, when its line or a later one, its time or its frame has come. */
static void machine_faults(void)
{
    static const char *const specs[] = {"at line 10: hold",
                                        "at time 2: estop",
                                        "at line 20: alarm 9 mist",
                                        "at line 21: tool-missing",
                                        "at frame 2: limit-hit",
                                        "at line 22: alarm 8",
                                        NULL};
    Bench b = bench(specs);
    SimMoment next = sim_faults_next(b.faults);
    g_assert_cmpuint(next.line, ==, 10);
    g_assert_cmpfloat(next.time_s, ==, 2);
    expect(&b, SIM_FAULT_TICK, 9, 1.9, "");
    expect(&b, SIM_FAULT_FRAME, 0, 1.9, "");
    expect(&b, SIM_FAULT_TICK, 12, 1.9, "[at line 10: hold]hold");
    expect(&b, SIM_FAULT_TICK, 12, 1.9, "");
    expect(&b, SIM_FAULT_FRAME, 30, 9,
           "[at frame 2: limit-hit]fail 203 an axis has hit its limit switch");
    expect(&b, SIM_FAULT_TICK, 0, 2, "[at time 2: estop]estop");
    next = sim_faults_next(b.faults);
    g_assert_cmpuint(next.line, ==, 20);
    g_assert_cmpfloat(next.time_s, ==, INFINITY);
    expect(&b, SIM_FAULT_TICK, 21, 3,
           "[at line 20: alarm 9 mist]fail 9 mist "
           "[at line 21: tool-missing]fail 202 the tool is not in the magazine");
    expect(&b, SIM_FAULT_FRAME, 0, 3, "");
    g_autofree char *summary = sim_faults_summary(b.faults);
    g_assert_cmpstr(summary, ==, "faults begun: 5 of 6\nfault not reached: at line 22: alarm 8\n");
    expect(&b, SIM_FAULT_TICK, 22, 4, "[at line 22: alarm 8]fail 8 an alarm on purpose");
    g_assert_cmpuint(sim_faults_next(b.faults).line, ==, UINT32_MAX);
    bench_clear(&b);
}

/* One fault a reply, in the order in which they came; a slow link is slow for ever. */
static void link_faults(void)
{
    static const char *const specs[] = {"at line 5: drop",      "at line 5: duplicate",
                                        "at line 5: delay 1.5", "at line 5: corrupt 17",
                                        "at line 5: close",     "at frame 8: slow 0.1",
                                        "at frame 9: delay 1",  "at frame 10: drop",
                                        "at frame 11: slow 0",  NULL};
    Bench b = bench(specs);
    expect(&b, SIM_FAULT_FRAME, 0, 0, "");
    bench_step(&b, SIM_FAULT_TICK, 5, 0);
    static const char *const fates[] = {
        "0 copies, 0 ms, bit -1",
        "2 copies, 0 ms, bit -1",
        "1 copies, 1500 ms, bit -1",
        "1 copies, 0 ms, bit 17",
        "close",
        "",
        "[at frame 8: slow 0.1]1 copies, 100 ms, bit -1",
        "[at frame 9: delay 1]1 copies, 1100 ms, bit -1",
        "[at frame 10: drop]0 copies, 100 ms, bit -1",
        "[at frame 11: slow 0]",
    };
    for (size_t i = 0; i < G_N_ELEMENTS(fates); i++)
        expect(&b, SIM_FAULT_FRAME, 0, 0, fates[i]);
    bench_clear(&b);
}

/* Without power nothing is answered and nothing begins; what was due then begins later. */
static void power_cut(void)
{
    static const char *const specs[] = {"at line 5: reboot", "at line 5: hold", "at frame 1: drop",
                                        NULL};
    Bench b = bench(specs);
    expect(&b, SIM_FAULT_TICK, 5, 1, "[at line 5: reboot]cut");
    expect(&b, SIM_FAULT_FRAME, 0, 1, "close");
    expect(&b, SIM_FAULT_FRAME, 0, 1, "close");
    expect(&b, SIM_FAULT_BOOTED, 0, 0, "");
    expect(&b, SIM_FAULT_FRAME, 0, 0, "[at frame 1: drop]0 copies, 0 ms, bit -1");
    expect(&b, SIM_FAULT_FRAME, 0, 0, "");
    expect(&b, SIM_FAULT_TICK, 7, 1, "[at line 5: hold]hold");
    bench_clear(&b);
}

static char *dice(const char *spec, int frames)
{
    const char *const specs[] = {spec, NULL};
    Bench b = bench(specs);
    GString *all = g_string_new(NULL);
    for (int i = 0; i < frames; i++) {
        bench_step(&b, SIM_FAULT_FRAME, 0, 0);
        g_autofree char *text = done(&b);
        g_string_append_printf(all, "%s\n", text);
    }
    g_autofree char *summary = sim_faults_summary(b.faults);
    g_string_append(all, summary);
    bench_clear(&b);
    return g_string_free(all, FALSE);
}

/* The same seed, the same faults; about as many as asked for, of every kind. */
static void seeded(void)
{
    g_autofree char *a = dice("random:1:0.1", 2000), *b = dice("random:1:0.1", 2000);
    g_autofree char *other = dice("random:2:0.1", 2000), *none = dice("random:1:0", 100);
    g_assert_cmpstr(a, ==, b);
    g_assert_cmpstr(a, !=, other);
    g_assert_cmpuint(strspn(none, "\n"), ==, 100);
    const char *summary = strstr(a, "random faults, seed 1, of 2000 replies:");
    unsigned n[5] = {0}, sum = 0;
    g_assert_nonnull(summary);
    g_assert_cmpint(summary ? sscanf(summary,
                                     "random faults, seed 1, of 2000 replies: drop %u, duplicate "
                                     "%u, delay %u, corrupt %u, close %u",
                                     &n[0], &n[1], &n[2], &n[3], &n[4])
                            : 0,
                    ==, 5);
    for (int i = 0; i < 5; i++) {
        sum += n[i];
        g_assert_cmpuint(n[i], >, 20);
    }
    g_assert_cmpuint(sum, >, 140);
    g_assert_cmpuint(sum, <, 260);
}

/* --------------------------------------------------------------- the moments of a run */

#define WALK                                                                                       \
    "G21 G90 G64 P0.01 F6000\n"                                                                    \
    "T1 M6\n"                                                                                      \
    "\n"                                                                                           \
    "G53 G1 X10\n"                                                                                 \
    "G53 G1 X20 Y5\n"                                                                              \
    "G4 P1\n"                                                                                      \
    "G53 G1 X0\n"                                                                                  \
    "M30\n"

/* The time and the line at which a run is woken; the event is done there, and the run goes to its
 * end or rest. `time_s` is -1 where it is not woken. */
static SimAction woken(double speed, SimMoment moment, SimEventKind event, char **states,
                       double *rest_s)
{
    Rig rig;
    SimAction at = {.time_s = -1};
    rig_start(&rig, speed, WALK, NULL, 0);
    sim_controller_wake(rig.controller, moment);
    guint seen = 0;
    for (int i = 0; i < 2000000 && sim_controller_moving(rig.controller); i++) {
        rig_tick(&rig, 997);
        for (; seen < rig.actions->len; seen++) {
            const SimAction *action = &g_array_index(rig.actions, SimAction, seen);
            if (action->kind != SIM_WOKEN)
                continue;
            g_assert_cmpfloat(at.time_s, ==, -1);
            g_assert_cmpuint(seen + 1, ==, rig.actions->len);
            at = *action;
            rig.now_us += 12345; /* what a busy host takes does not count */
            rig_do(&rig, event);
        }
    }
    *states = rig_states(&rig);
    *rest_s = sim_controller_totals(rig.controller).machine_s;
    rig_clear(&rig);
    return at;
}

static void moments(void)
{
    static const struct {
        SimMoment moment;
        double least_s, most_s;
        uint32_t line;
    } cases[] = {
        {{1, INFINITY}, 0, 0, 2},           /* no block is in line 1: before that of line 2, */
        {{2, INFINITY}, 0, 0, 2},           /* and there */
        {{3, INFINITY}, 4, 4, 4},           /* the tool change takes 4 s */
        {{5, INFINITY}, 4.05, 4.3, 5},      /* on the way */
        {{6, INFINITY}, 4.1, 4.6, 6},       /* before a dwell */
        {{UINT32_MAX, 3}, 3, 3, 2},         /* in the tool change */
        {{7, 4.5}, 4.5, 4.5, 6},            /* what comes first */
        {{9, INFINITY}, -1, -1, 0},         /* there is no line 9 */
        {{UINT32_MAX, 1000}, -1, -1, 0},    /* nor so much time */
        {{UINT32_MAX, INFINITY}, -1, -1, 0} /* nothing asked for */
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autofree char *slow_states = NULL, *fast_states = NULL;
        double slow_s, fast_s;
        const SimAction slow = woken(3, cases[i].moment, SIM_HOLD, &slow_states, &slow_s);
        const SimAction fast = woken(INFINITY, cases[i].moment, SIM_HOLD, &fast_states, &fast_s);
        g_assert_cmpfloat(fast.time_s, >=, cases[i].least_s);
        g_assert_cmpfloat(fast.time_s, <=, cases[i].most_s);
        g_assert_cmpuint(fast.line, ==, cases[i].line);
        /* The same at every speed, to the last digit. */
        g_assert_cmpfloat(slow.time_s, ==, fast.time_s);
        g_assert_cmpuint(slow.line, ==, fast.line);
        g_assert_cmpfloat(slow_s, ==, fast_s);
        g_assert_cmpstr(slow_states, ==, fast_states);
        g_assert_true(!strstr(fast_states, "HELD") == (cases[i].least_s < 0));
    }
}

/* An alarm brakes and ends the run, as an e-stop does. */
static void failing(void)
{
    g_autofree char *states = NULL;
    double rest_s;
    const SimAction at = woken(INFINITY, (SimMoment){5, INFINITY}, SIM_FAIL, &states, &rest_s);
    g_assert_cmpstr(states, ==, "IDLE READY RUNNING TOOL_CHANGE RUNNING ALARM");
    g_assert_cmpfloat(rest_s, >, at.time_s);
    g_assert_cmpfloat(rest_s, <, at.time_s + 0.5);
    Rig rig;
    rig_init(&rig, 1, 1000);
    rig_do(&rig, SIM_FAIL);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_OFF);
    rig_do(&rig, SIM_ACKNOWLEDGE);
    rig_do(&rig, SIM_FAIL);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_ALARM);
    rig_do(&rig, SIM_ESTOP);
    rig_do(&rig, SIM_FAIL);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_ESTOP);
    rig_do(&rig, SIM_ACKNOWLEDGE);
    g_assert_cmpint(rig_state(&rig), ==, FB_STATE_IDLE);
    rig_clear(&rig);
}

/* Each turn of a loop has its own blocks, each with its own line. */
static void loops(void)
{
    Rig rig;
    rig_start(&rig, INFINITY, "G21 G91 F6000\nO1 repeat [3]\nG1 X1\nO1 endrepeat\nG1 X1\nM30\n",
              NULL, 0);
    rig_run(&rig, 1000, 60);
    static const uint32_t own[] = {3, 3, 3, 5, 6};
    g_assert_cmpuint(rig_blocks(&rig), ==, 5);
    for (guint i = 0; i < 5 && rig_blocks(&rig) == 5; i++) {
        const SimBlock block = rig_block(&rig, i);
        g_assert_cmpuint(block.block_line, ==, own[i]);
        g_assert_cmpuint(block.line, ==, own[i] == 3 ? 4 : own[i]);
        test_near(block.position_mm.x, MIN(i + 1, 4), 1e-9, 0);
    }
    rig_clear(&rig);
}

static void add(void)
{
    g_test_add_func("/sim/fault/grammar", one_each);
    g_test_add_func("/sim/fault/alarm-text", alarm_text);
    g_test_add_func("/sim/fault/random-mode", random_mode);
    g_test_add_func("/sim/fault/wrong", wrong);
    g_test_add_func("/sim/fault/files", files);
    g_test_add_func("/sim/fault/machine", machine_faults);
    g_test_add_func("/sim/fault/link", link_faults);
    g_test_add_func("/sim/fault/power-cut", power_cut);
    g_test_add_func("/sim/fault/seeded", seeded);
    g_test_add_func("/sim/fault/moments", moments);
    g_test_add_func("/sim/fault/failing", failing);
    g_test_add_func("/sim/fault/loops", loops);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
