/* SPDX-License-Identifier: Apache-2.0 */
/* The panel's state machine: scripts of what happens, told in many ways; bounce; the lamp. */
#include "tests/lib/test.h"
#include "tests/unit/agent_panel_rig.h"

/* `starts` and the end hold however often ticks come; `holds` where they come in time. */
static const struct {
    const char *name, *script;
    int starts, holds;
    AgentLamp lamp;
    AgentFault fault;
} scripts[] = {
    /* every order of: READY comes, press, release */
    {"ready-press-release", "0 lines 100 ready 200 S 300 s 2000 end", 1, 0, AGENT_LAMP_OFF, 0},
    {"ready-release-press", "0 lines 90 S 95 s 100 ready 200 s 300 S 2000 end", 1, 0,
     AGENT_LAMP_OFF, 0},
    {"press-ready-release", "0 lines 100 S 200 ready 300 s 2000 end", 0, 0, AGENT_LAMP_SLOW, 0},
    {"press-release-ready", "0 lines 100 S 200 s 300 ready 2000 end", 0, 0, AGENT_LAMP_SLOW, 0},
    {"press-ready-release-press", "0 lines 100 S 200 ready 300 s 400 S 2000 end", 1, 0,
     AGENT_LAMP_OFF, 0},
    {"release-too-short", "0 lines 100 S 200 ready 300 s 319 S 2000 end", 0, 0, AGENT_LAMP_OFF, 0},
    {"ready-too-late", "0 lines 100 ready 119 S 2000 end", 0, 0, AGENT_LAMP_OFF, 0},
    {"ready-in-time", "0 lines 100 ready 120 S 2000 end", 1, 0, AGENT_LAMP_OFF, 0},
    {"touched", "0 lines 100 ready 200 S 219 s 2000 end", 0, 0, AGENT_LAMP_SLOW, 0},
    {"long-enough", "0 lines 100 ready 200 S 220 s 2000 end", 1, 0, AGENT_LAMP_OFF, 0},
    /* what is started */
    {"nothing-there", "0 lines 100 idle 200 S 300 s 2000 end", 0, 0, AGENT_LAMP_OFF, 0},
    {"ready-with-nothing", "0 lines 100 empty 200 S 300 s 2000 end", 0, 0, AGENT_LAMP_OFF, 0},
    {"complete", "0 lines 100 complete 200 S 300 s 2000 end", 0, 0, AGENT_LAMP_OFF, 0},
    {"not-acknowledged", "0 lines 100 needs-ack 200 S 300 s 2000 end", 0, 0, AGENT_LAMP_FAST, 0},
    {"acknowledged-while-pressed", "0 lines 100 needs-ack 200 S 300 ready 2000 end", 0, 0,
     AGENT_LAMP_OFF, 0},
    {"another-program", "0 lines 100 ready 200 other 210 S 300 s 2000 end", 0, 0, AGENT_LAMP_SLOW,
     0},
    {"another-program-under-the-finger", "0 lines 100 ready 200 S 210 other 2000 end", 0, 0,
     AGENT_LAMP_OFF, 0},
    {"running", "0 lines 100 running 200 S 300 s 2000 end", 0, 0, AGENT_LAMP_STEADY, 0},
    {"ready-left-under-the-finger", "0 lines 100 ready 200 S 210 running 2000 end", 0, 0,
     AGENT_LAMP_STEADY, 0},
    {"once-a-press", "0 lines 100 ready 200 S 1400 running 1800 ended 1900 ready 4000 end", 1, 0,
     AGENT_LAMP_OFF, 0},
    {"once-a-run", "0 lines 100 ready 200 S 300 s 400 S 500 s 600 S 2000 end", 1, 0, AGENT_LAMP_OFF,
     0},
    {"twice", "0 lines 100 ready 200 S 300 s 400 running 800 ready 801 ended 900 S 2000 end", 2, 0,
     AGENT_LAMP_OFF, 0},
    {"refused", "0 lines 100 ready 200 S 300 s 400 refused 2000 end", 1, 0, AGENT_LAMP_DOUBLE,
     AGENT_FAULT_REFUSED},
    {"refused-under-the-finger", "0 lines 100 ready 200 S 400 refused 5000 end", 1, 0,
     AGENT_LAMP_DOUBLE, AGENT_FAULT_REFUSED},
    {"refused-pressed-at-once", "0 lines 100 ready 200 S 300 s 400 refused 500 S 600 s 2500 end", 1,
     0, AGENT_LAMP_DOUBLE, AGENT_FAULT_REFUSED},
    {"refused-not-cleared-by-hold",
     "0 lines 100 ready 200 S 300 s 2400 refused 2500 H 2550 answered 2600 h 4000 end", 1, 1,
     AGENT_LAMP_DOUBLE, AGENT_FAULT_REFUSED},
    {"failed-later", "0 lines 100 ready 200 S 1300 s 1400 running 1500 refused 1600 idle 3000 end",
     1, 0, AGENT_LAMP_OFF, 0},
    {"refused-gone", "0 lines 100 ready 200 S 300 s 400 refused 3000 end", 1, 0, AGENT_LAMP_SLOW,
     0},
    {"refused-pressed-again", "0 lines 100 ready 200 S 300 s 400 refused 3000 S 3100 s 4500 end", 2,
     0, AGENT_LAMP_OFF, 0},
    /* the link */
    {"lost-before", "0 lines 100 ready 200 lost 300 S 400 ready 2000 end", 0, 0, AGENT_LAMP_OFF, 0},
    {"lost-under-the-finger", "0 lines 100 ready 200 S 210 lost 220 ready 2000 end", 0, 0,
     AGENT_LAMP_OFF, 0},
    {"lost-then-fresh", "0 lines 100 ready 200 lost 300 ready 400 S 2000 end", 1, 0, AGENT_LAMP_OFF,
     0},
    {"lost", "0 lines 100 ready 200 lost 2000 end", 0, 0, AGENT_LAMP_DOUBLE, 0},
    {"alarm", "0 lines 100 running 200 alarm 2000 end", 0, 0, AGENT_LAMP_DOUBLE, 0},
    /* first sight */
    {"pressed-at-power-up", "0 lines-start 100 ready 2000 end", 0, 0, AGENT_LAMP_DOUBLE,
     AGENT_FAULT_PRESSED},
    {"released-is-not-cleared", "0 lines-start 100 ready 200 s 5000 S 5100 s 9000 end", 0, 0,
     AGENT_LAMP_DOUBLE, AGENT_FAULT_PRESSED},
    {"cleared-too-early", "0 lines-start 100 ready 200 s 2199 H 2300 answered 2400 h 9000 end", 0,
     1, AGENT_LAMP_DOUBLE, AGENT_FAULT_PRESSED},
    {"cleared", "0 lines-start 100 ready 200 s 2200 H 2300 answered 2400 h 9000 end", 0, 1,
     AGENT_LAMP_SLOW, 0},
    {"cleared-and-started",
     "0 lines-start 100 ready 200 s 2200 H 2300 answered 2400 h 3000 S 5000 end", 1, 1,
     AGENT_LAMP_OFF, 0},
    {"cleared-under-a-finger", "0 lines-start 100 ready 200 s 900 S 3000 H 3100 answered 5000 end",
     0, 1, AGENT_LAMP_DOUBLE, AGENT_FAULT_PRESSED},
    {"hold-at-power-up", "0 lines-hold 100 running 200 answered 310 holding 5000 end", 0, 2,
     AGENT_LAMP_DOUBLE, AGENT_FAULT_PRESSED},
    {"hold-at-power-up-nothing-runs", "0 lines-hold 100 idle 500 end", 0, 1, AGENT_LAMP_DOUBLE,
     AGENT_FAULT_PRESSED},
    {"gone-and-pressed", "0 lines 100 ready 200 gone 300 S 400 H 2000 end", 0, 0, AGENT_LAMP_DOUBLE,
     AGENT_FAULT_NO_LINES},
    {"gone", "0 lines 100 ready 200 S 210 gone 2000 end", 0, 0, AGENT_LAMP_DOUBLE,
     AGENT_FAULT_NO_LINES},
    {"back-released", "0 lines 100 ready 200 gone 300 lines 400 S 2000 end", 1, 0, AGENT_LAMP_OFF,
     0},
    {"back-pressed", "0 lines 100 ready 200 gone 300 lines-start 400 s 2000 end", 0, 0,
     AGENT_LAMP_DOUBLE, AGENT_FAULT_PRESSED},
    {"gone-and-back-does-not-clear", "0 lines-start 100 ready 200 gone 300 lines 5000 end", 0, 0,
     AGENT_LAMP_DOUBLE, AGENT_FAULT_PRESSED},
    /* stuck */
    {"stuck", "0 lines 100 ready 200 S 1400 running 10200 end", 1, 0, AGENT_LAMP_DOUBLE,
     AGENT_FAULT_STUCK},
    {"not-stuck", "0 lines 100 ready 200 S 1400 running 10199 end", 1, 0, AGENT_LAMP_STEADY, 0},
    {"stuck-released", "0 lines 200 S 11000 s 12000 ready 12999 end", 0, 0, AGENT_LAMP_DOUBLE,
     AGENT_FAULT_STUCK},
    {"stuck-cleared", "0 lines 200 S 11000 s 12000 ready 13020 end", 0, 0, AGENT_LAMP_SLOW, 0},
    /* hold */
    {"hold", "0 lines 100 running 200 H 250 answered 260 holding 300 h 400 held 2000 end", 0, 1,
     AGENT_LAMP_FAST, 0},
    {"hold-bounces", "0 lines 100 running 200 H 203 h 206 H 300 h 310 H 330 h 2000 end", 0, 1,
     AGENT_LAMP_STEADY, 0},
    {"hold-bounces-late",
     "0 lines 100 running 200 H 201 answered 202 held 204 h 206 H 208 h 2000 end", 0, 1,
     AGENT_LAMP_FAST, 0},
    {"hold-at-a-tool-change",
     "0 lines 100 running 200 H 210 h 250 tool-change 300 answered 450 held 2000 end", 0, 2,
     AGENT_LAMP_FAST, 0},
    {"hold-kept-down-at-a-tool-change",
     "0 lines 100 running 200 H 250 held 260 answered 1000 tool-change 2000 end", 0, 2,
     AGENT_LAMP_STEADY, 0},
    {"hold-not-answered", "0 lines 100 ready 200 H 250 h 400 S 2000 end", 0, 1, AGENT_LAMP_OFF, 0},
    {"hold-insists",
     "0 lines 100 running 200 H 210 h 250 answered 300 running 500 answered "
     "650 answered 700 held 5000 end",
     0, 3, AGENT_LAMP_FAST, 0},
    {"hold-without-link",
     "0 lines 100 running 150 lost 200 H 210 h 250 answered 500 answered "
     "550 held 6000 end",
     0, 2, AGENT_LAMP_FAST, 0},
    {"hold-kept-down", "0 lines 100 running 200 H 250 held 260 answered 1000 running 2000 end", 0,
     2, AGENT_LAMP_STEADY, 0},
    {"hold-let-go", "0 lines 100 running 200 H 250 held 260 answered 300 h 1000 running 2000 end",
     0, 1, AGENT_LAMP_STEADY, 0},
    {"hold-pressed-twice",
     "0 lines 100 running 200 H 210 h 300 H 350 held 400 answered "
     "410 answered 2000 end",
     0, 2, AGENT_LAMP_FAST, 0},
    {"hold-overtakes-start",
     "0 lines 100 ready 200 S 1300 H 1310 h 1350 answered 1500 answered "
     "1510 running 1700 answered 1850 held 1860 answered 4000 end",
     1, 4, AGENT_LAMP_FAST, 0},
    {"hold-while-nothing-runs", "0 lines 100 idle 200 H 210 answered 300 h 2000 end", 0, 1,
     AGENT_LAMP_OFF, 0},
    /* both */
    {"hold-then-start", "0 lines 100 ready 200 H 210 answered 300 S 2000 end", 0, 1, AGENT_LAMP_OFF,
     0},
    {"start-then-hold", "0 lines 100 ready 200 S 219 H 225 answered 2000 end", 0, 1, AGENT_LAMP_OFF,
     0},
    {"at-once", "0 lines 100 ready 200 H 200 S 225 answered 400 h 2000 end", 0, 1, AGENT_LAMP_OFF,
     0},
    {"hold-released-start-kept", "0 lines 100 ready 200 H 210 S 225 answered 300 h 2000 end", 0, 1,
     AGENT_LAMP_OFF, 0},
    {"hold-before-start", "0 lines 100 ready 200 H 225 answered 300 h 400 S 2000 end", 1, 1,
     AGENT_LAMP_OFF, 0},
};

static void script(gconstpointer data)
{
    static const int64_t steps_us[] = {0, 1 * MS, 7 * MS, 333 * MS, 900 * MS};
    const size_t i = GPOINTER_TO_SIZE(data);
    for (size_t k = 0; k < G_N_ELEMENTS(steps_us); k++) {
        Rig r = rig();
        play(&r, scripts[i].script, steps_us[k]);
        g_assert_cmpint(r.starts, ==, scripts[i].starts);
        if (steps_us[k] == 0)
            g_assert_cmpint(r.holds, ==, scripts[i].holds);
        else
            g_assert_cmpint(r.holds > 0, ==, scripts[i].holds > 0);
        g_assert_cmpint((int)agent_panel_lamp(&r.panel), ==, (int)scripts[i].lamp);
        g_assert_cmpint((int)agent_panel_fault(&r.panel), ==, (int)scripts[i].fault);
    }
}

/* A press that nobody looked at for long starts nothing, and none that something has overtaken. */
static void late(void)
{
    Rig r = rig();
    play(&r, "0 lines 100 ready 200 S 1220 end", INT64_MAX / 2);
    g_assert_cmpint(r.starts, ==, 1);
    r = rig();
    play(&r, "0 lines 100 ready 200 S 1221 end", INT64_MAX / 2);
    g_assert_cmpint(r.starts, ==, 0);
    g_assert_cmpint(r.ignored, ==, 1);
    static const char *const overtaken[] = {"H", "running", "lost", "other", "needs-ack"};
    for (size_t i = 0; i < G_N_ELEMENTS(overtaken); i++) {
        g_autofree char *script =
            g_strdup_printf("0 lines 100 ready 200 S 300 %s 400 end", overtaken[i]);
        r = rig();
        play(&r, script, INT64_MAX / 2);
        g_test_message("%s", overtaken[i]);
        g_assert_cmpint(r.starts, ==, 0);
        g_assert_cmpint(r.holds, ==, i == 0);
        g_assert_cmpint(r.drops, ==, 0);
        g_assert_cmpint(r.ignored, ==, 1);
    }
}

static void at_its_time(void)
{
    Rig r = rig();
    play(&r, "0 lines 100 ready 200 S 300 end", 0);
    g_assert_cmpint(r.start_us, ==, 220 * MS);
    play(&r, "300 running 400 H 500 end", 0);
    g_assert_cmpint(r.hold_us, ==, 400 * MS);
}

/* A START on its way must not be done when the link is back. */
static void dropped(void)
{
    static const struct {
        const char *script;
        int starts, drops;
    } cases[] = {
        {"0 lines 100 ready 200 S 300 lost 400 ready 500 s 2000 end", 1, 1},
        {"0 lines 100 ready 200 S 300 lost 400 ready 500 s 600 S 2000 end", 2, 1},
        {"0 lines 100 ready 200 S 300 running 400 lost 500 running 2000 end", 1, 0},
        {"0 lines 100 ready 200 S 300 ended 400 lost 2000 end", 1, 0},
        {"0 lines 100 ready 200 S 250 ready 300 lost 400 lost 2000 end", 1, 1},
        {"0 lines 100 ready 200 lost 2000 end", 0, 0},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Rig r = rig();
        play(&r, cases[i].script, 0);
        g_assert_cmpint(r.starts, ==, cases[i].starts);
        g_assert_cmpint(r.drops, ==, cases[i].drops);
    }
}

/* Edges are read in bursts: their own times count. */
static void burst(void)
{
    Rig r = rig();
    play(&r, "0 lines 100 ready 150 end", 0);
    static const int at_ms[] = {200, 203, 207, 260, 263};
    for (size_t i = 0; i < G_N_ELEMENTS(at_ms); i++)
        tell(&r,
             &(AgentPanelEvent){
                 .kind = AGENT_PANEL_EDGE, .at_us = at_ms[i] * MS, .pressed = {i % 2 == 0, false}},
             300 * MS);
    g_assert_cmpint(r.starts, ==, 1);
}

/* ----------------------------------------------------------------------- bounce */

/* A train of `n` edges, closer than the debounce time, that ends with `pressed`. Where n is of the
 * wrong parity one edge is lost, as a kernel's queue may lose it. Returns the time of the last. */
static int64_t train(Rig *r, GRand *random, int n, bool pressed, int64_t at_us)
{
    const bool odd = n % 2 == 1;
    const int lost = odd || n < 2 ? -1 : g_rand_int_range(random, 1, n);
    bool level = pressed;
    for (int i = 0; i < n; i++) {
        at_us += i > 0 ? g_rand_int_range(random, 1, DEBOUNCE) : 0;
        if (i > 0 && i != lost)
            level = !level;
        pass(r, at_us, 0);
        tell(
            r,
            &(AgentPanelEvent){.kind = AGENT_PANEL_EDGE, .at_us = at_us, .pressed = {level, false}},
            at_us);
    }
    g_assert_true(level == pressed);
    return at_us;
}

static void bounce(void)
{
    const guint32 seed = (guint32)g_test_rand_int();
    g_test_message("seed %u", seed);
    g_autoptr(GRand) random = g_rand_new_with_seed(seed);
    const FbStatus running = status_of(FB_STATE_RUNNING, 1, false);
    int trains = 0;
    for (int n = 1; n <= 50; n++)
        for (int k = 0; k < 100; k++) {
            Rig r = rig();
            play(&r, "0 lines 100 ready 200 end", 0);
            int64_t at_us = train(&r, random, n, true, 200 * MS);
            g_assert_cmpint(r.starts, ==, 0);
            pass(&r, at_us + DEBOUNCE + 1, 0);
            g_assert_cmpint(r.starts, ==, 1);
            if (k % 2)
                tell(&r, &(AgentPanelEvent){.kind = AGENT_PANEL_STATUS, .status = &running},
                     at_us + DEBOUNCE + 1);
            at_us = train(&r, random, n, false, at_us + 2 * DEBOUNCE);
            pass(&r, at_us + 3000 * MS, 0);
            g_assert_cmpint(r.starts, ==, 1);
            trains += 2;
        }
    g_test_message("%d trains", trains);
}

/* One that never gets quiet as pressed starts nothing. */
static void touches(void)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(20);
    for (int n = 2; n <= 50; n += 2)
        for (int k = 0; k < 100; k++) {
            Rig r = rig();
            int64_t at_us = 200 * MS;
            play(&r, "0 lines 100 ready 200 end", 0);
            for (int i = 0; i < n; i++) {
                tell(&r,
                     &(AgentPanelEvent){
                         .kind = AGENT_PANEL_EDGE, .at_us = at_us, .pressed = {i % 2 == 0, false}},
                     at_us);
                at_us += g_rand_int_range(random, 1, DEBOUNCE);
            }
            pass(&r, at_us + 3000 * MS, 0);
            g_assert_cmpint(r.starts, ==, 0);
            g_assert_cmpint((int)agent_panel_lamp(&r.panel), ==, AGENT_LAMP_SLOW);
        }
}

/* ------------------------------------------------------------------------- lamp */

static void lamp(void)
{
    static const struct {
        AgentLamp lamp;
        const char *lit; /* one letter each 125 ms of two seconds */
    } cases[] = {
        {AGENT_LAMP_OFF, "----------------"},    {AGENT_LAMP_STEADY, "################"},
        {AGENT_LAMP_SLOW, "####----####----"},   {AGENT_LAMP_FAST, "#-#-#-#-#-#-#-#-"},
        {AGENT_LAMP_DOUBLE, "#-#-------#-#---"},
    };
    G_STATIC_ASSERT(G_N_ELEMENTS(cases) == AGENT_N_LAMPS);
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        const AgentLamp kind = cases[i].lamp;
        int64_t until_us;
        for (int64_t k = 0; k < 16; k++) {
            const bool lit = agent_lamp_lit(kind, k * 125 * MS, &until_us);
            g_assert_cmpint(lit, ==, cases[i].lit[k] == '#');
            g_assert_cmpint(agent_lamp_lit(kind, k * 125 * MS + 124999, &until_us), ==, lit);
        }
        /* From change to change, and each is one. */
        for (int64_t now_us = 0; now_us < 5000 * MS; now_us = until_us) {
            const bool lit = agent_lamp_lit(kind, now_us, &until_us);
            int64_t unused_us;
            g_assert_cmpint(until_us, >, now_us);
            if (until_us != INT64_MAX)
                g_assert_cmpint(agent_lamp_lit(kind, until_us, &unused_us), ==, !lit);
        }
    }
}

/* The lamp of every state, and never that of a program to start where there is none. */
static void lamp_of_state(void)
{
    static const AgentLamp expected[FB_N_STATES] = {
        [FB_STATE_RUNNING] = AGENT_LAMP_STEADY,     [FB_STATE_HOLDING] = AGENT_LAMP_FAST,
        [FB_STATE_HELD] = AGENT_LAMP_FAST,          [FB_STATE_PROGRAM_STOP] = AGENT_LAMP_FAST,
        [FB_STATE_TOOL_CHANGE] = AGENT_LAMP_STEADY, [FB_STATE_ABORTING] = AGENT_LAMP_STEADY,
        [FB_STATE_READY] = AGENT_LAMP_SLOW,         [FB_STATE_ALARM] = AGENT_LAMP_DOUBLE,
        [FB_STATE_ESTOP] = AGENT_LAMP_DOUBLE,       [FB_STATE_UNKNOWN] = AGENT_LAMP_DOUBLE,
    };
    for (FbState state = 0; state < FB_N_STATES; state++) {
        Rig r = rig();
        const FbStatus status = status_of(state, 1, false);
        play(&r, "0 lines", 0);
        tell(&r, &(AgentPanelEvent){.kind = AGENT_PANEL_STATUS, .status = &status}, 100 * MS);
        pass(&r, 1000 * MS, 0);
        g_test_message("%s", fb_state_name(state));
        g_assert_cmpint((int)agent_panel_lamp(&r.panel), ==, (int)expected[state]);
    }
}

static void add(void)
{
    for (size_t i = 0; i < G_N_ELEMENTS(scripts); i++) {
        g_autofree char *name = g_strdup_printf("/agent/panel/%s", scripts[i].name);
        g_test_add_data_func(name, GSIZE_TO_POINTER(i), script);
    }
    g_test_add_func("/agent/panel/late", late);
    g_test_add_func("/agent/panel/at-its-time", at_its_time);
    g_test_add_func("/agent/panel/dropped", dropped);
    g_test_add_func("/agent/panel/burst", burst);
    g_test_add_func("/agent/panel/bounce", bounce);
    g_test_add_func("/agent/panel/touches", touches);
    g_test_add_func("/agent/panel/lamp", lamp);
    g_test_add_func("/agent/panel/lamp-of-state", lamp_of_state);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
