/* SPDX-License-Identifier: Apache-2.0 */
/* Every sequence of a few events, against what a start and a hold may be. */
#include "tests/lib/test.h"
#include "tests/unit/agent_panel_rig.h"

typedef enum {
    PRESS,
    RELEASE,
    PRESS_HOLD,
    RELEASE_HOLD,
    READY,
    RUNNING,
    LOST,
    ENDED,
    ANSWERED,
    SHORT,
    LONG,
    N_LETTERS
} Letter;

enum { DEPTH = 7 };

/* What came in, as the rules speak of it. */
typedef struct {
    bool start, hold; /* down */
    bool ready, run;
    int64_t edge_us;  /* of start, */
    int64_t hold_us;  /* of hold */
    int64_t quiet_us; /* both up, READY, no run of ours: since; INT64_MAX: not so */
    bool seen;        /* the run of ours was */
    bool armed;       /* it has been so for the debounce time; READY and without hold since */
    bool chance;      /* and then start went down */
    bool presses;     /* hold goes down now, from where it has been up for a while, */
    bool held;        /* or ever went down */
    bool on_its_way;  /* a HOLD without an answer */
} Watch;

typedef struct {
    FbStatus ready, running, lost;
    int path[DEPTH];
    uint64_t sequences, starts, holds, wrong;
} Search;

/* Before the letter is taken: whether time alone has made a start of it. */
static bool is_due(const Watch *w, int64_t now_us)
{
    return w->chance && w->start && now_us - w->edge_us >= DEBOUNCE;
}

static void watch(Watch *w, Letter letter, int64_t now_us)
{
    w->armed |= w->quiet_us <= now_us - DEBOUNCE;
    switch (letter) {
    case PRESS:
    case RELEASE:
        w->start = letter == PRESS;
        w->edge_us = now_us;
        break;
    case PRESS_HOLD:
    case RELEASE_HOLD:
        w->presses = letter == PRESS_HOLD && !w->hold && now_us - w->hold_us >= DEBOUNCE;
        w->hold = letter == PRESS_HOLD;
        w->held |= w->hold;
        if (w->held)
            w->hold_us = now_us;
        break;
    case READY:
    case RUNNING:
    case LOST:
        w->seen |= letter == RUNNING;
        w->run &= letter != LOST || w->seen;
        w->ready = letter == READY;
        break;
    case ENDED:
        w->run = false;
        break;
    default:
        break;
    }
    w->armed = w->armed && w->ready && !w->hold;
    w->chance = w->armed && (w->chance || letter == PRESS);
    const bool quiet = !w->start && !w->hold && w->ready && !w->run;
    const bool again = letter == RELEASE || letter == RELEASE_HOLD || letter == ENDED;
    if (!quiet)
        w->quiet_us = INT64_MAX;
    else if (w->quiet_us == INT64_MAX || again)
        w->quiet_us = now_us;
}

static AgentPanelEvent event_of(const Search *s, Letter letter, int64_t now_us)
{
    switch (letter) {
    case PRESS:
    case RELEASE:
        return (AgentPanelEvent){.kind = AGENT_PANEL_EDGE,
                                 .at_us = now_us,
                                 .key = AGENT_KEY_START,
                                 .pressed = {letter == PRESS, false}};
    case PRESS_HOLD:
    case RELEASE_HOLD:
        return (AgentPanelEvent){.kind = AGENT_PANEL_EDGE,
                                 .at_us = now_us,
                                 .key = AGENT_KEY_HOLD,
                                 .pressed = {false, letter == PRESS_HOLD}};
    case READY:
        return (AgentPanelEvent){.kind = AGENT_PANEL_STATUS, .status = &s->ready};
    case RUNNING:
        return (AgentPanelEvent){.kind = AGENT_PANEL_STATUS, .status = &s->running};
    case LOST:
        return (AgentPanelEvent){.kind = AGENT_PANEL_STATUS, .status = &s->lost};
    case ENDED:
        return (AgentPanelEvent){.kind = AGENT_PANEL_RUN_ENDED};
    case ANSWERED:
        return (AgentPanelEvent){.kind = AGENT_PANEL_HOLD_ANSWERED};
    default:
        return (AgentPanelEvent){.kind = AGENT_PANEL_TICK};
    }
}

static void complain(Search *s, int depth, const char *what)
{
    if (s->wrong++ > 10)
        return;
    g_autoptr(GString) text = g_string_new(what);
    for (int i = 0; i <= depth; i++)
        g_string_append_printf(text, " %d", s->path[i]);
    g_test_message("%s", text->str);
}

/* Hold may always go before start, so where it was pressed a start may be less, never more. */
static void judge(Search *s, int depth, Watch *w, bool due, const AgentPanelActions *out)
{
    const Letter letter = (Letter)s->path[depth];
    if (out->start && !due)
        complain(s, depth, "a start that is none:");
    if (due && !out->start && !w->held && letter != LOST && letter != RUNNING)
        complain(s, depth, "no start:");
    if (out->start && letter == PRESS_HOLD)
        complain(s, depth, "start with hold:");
    if (letter == PRESS_HOLD && w->presses && !out->hold && !w->on_its_way)
        complain(s, depth, "no hold:");
    if (out->hold && !w->held)
        complain(s, depth, "a hold without a press:");
    if (out->start) {
        w->run = true;
        w->seen = false;
        w->quiet_us = INT64_MAX;
    }
    w->on_its_way |= out->hold;
    s->starts += out->start;
    s->holds += out->hold;
}

static void search(Search *s, int depth, const AgentPanel *panel, const Watch *before,
                   int64_t now_us)
{
    if (depth == DEPTH) {
        s->sequences++;
        return;
    }
    for (int letter = 0; letter < N_LETTERS; letter++) {
        const int64_t at_us = now_us + (letter == SHORT ? 10 : letter == LONG ? 30 : 3) * MS;
        const AgentPanelEvent event = event_of(s, (Letter)letter, at_us);
        AgentPanel p = *panel;
        Watch w = *before;
        AgentPanelActions out;
        s->path[depth] = letter;
        const bool due = is_due(&w, at_us);
        if (due)
            w.armed = w.chance = false; /* what comes now is another press */
        if (letter == ANSWERED)
            w.on_its_way = false;
        watch(&w, (Letter)letter, at_us);
        agent_panel_step(&p, &event, at_us, &out);
        judge(s, depth, &w, due, &out);
        search(s, depth + 1, &p, &w, at_us);
    }
}

static void enumeration(void)
{
    static const AgentPanelEvent lines = {.kind = AGENT_PANEL_LINES};
    Search s = {.ready = status_of(FB_STATE_READY, 1, false),
                .running = status_of(FB_STATE_RUNNING, 1, false),
                .lost = status_of(FB_STATE_UNKNOWN, 1, false)};
    AgentPanel panel = agent_panel_new(DEBOUNCE, 0);
    AgentPanelActions out;
    agent_panel_step(&panel, &lines, 0, &out);
    search(&s, 0, &panel, &(Watch){.quiet_us = INT64_MAX, .hold_us = -DEBOUNCE}, 0);
    g_test_message("%" G_GUINT64_FORMAT " sequences of %d events: %" G_GUINT64_FORMAT
                   " starts, %" G_GUINT64_FORMAT " holds",
                   s.sequences, DEPTH, s.starts, s.holds);
    g_assert_cmpuint(s.wrong, ==, 0);
    g_assert_cmpuint(s.starts, >, 1000);
    g_assert_cmpuint(s.holds, >, 1000);
}

/* After a button was pressed at first sight: every sequence, and a start only behind a press of
 * hold that came when start had been up for the stated time. */
static void search_fault(int depth, Search *s, const AgentPanel *panel, bool up, bool cleared,
                         int64_t up_us, int64_t now_us)
{
    static const Letter letters[] = {PRESS, RELEASE, PRESS_HOLD, RELEASE_HOLD, ANSWERED,
                                     READY, LOST,    SHORT,      LONG};
    if (depth == DEPTH) {
        s->sequences++;
        return;
    }
    for (size_t i = 0; i < G_N_ELEMENTS(letters); i++) {
        const Letter letter = letters[i];
        const int64_t at_us = now_us + (letter == LONG ? 800 : 25) * MS;
        const AgentPanelEvent event = event_of(s, letter, at_us);
        AgentPanel p = *panel;
        AgentPanelActions out;
        s->path[depth] = (int)letter;
        agent_panel_step(&p, &event, at_us, &out);
        const bool now_cleared =
            cleared || (letter == PRESS_HOLD && up && at_us - up_us >= AGENT_PANEL_CLEAR_US);
        if (out.start && !cleared)
            complain(s, depth, "a start in spite of the fault:");
        s->starts += out.start;
        search_fault(depth + 1, s, &p, letter == RELEASE || (up && letter != PRESS), now_cleared,
                     letter == RELEASE ? at_us : up_us, at_us);
    }
}

static void fault_enumeration(void)
{
    static const AgentPanelEvent lines = {.kind = AGENT_PANEL_LINES, .pressed = {true, false}};
    static const char *const before[] = {"", "25 s 2000 ready 2024 end", "25 s 2000 ready 2100 end",
                                         "25 s 2000 ready 2100 H 2130 answered 2160 h"};
    for (size_t i = 0; i < G_N_ELEMENTS(before); i++) {
        Search s = {.ready = status_of(FB_STATE_READY, 1, false),
                    .lost = status_of(FB_STATE_UNKNOWN, 1, false)};
        Rig r = rig();
        tell(&r, &lines, 0);
        play(&r, before[i], 0);
        const bool up = r.now_us > 0;
        search_fault(0, &s, &r.panel, up, i == 3, 25 * MS, r.now_us);
        g_test_message("%" G_GUINT64_FORMAT " sequences: %" G_GUINT64_FORMAT " starts", s.sequences,
                       s.starts);
        g_assert_cmpuint(s.wrong, ==, 0);
        if (i > 0)
            g_assert_cmpuint(s.starts, >, 0);
    }
}

static void add(void)
{
    g_test_add_func("/agent/panel/every-sequence", enumeration);
    g_test_add_func("/agent/panel/every-sequence-after-a-fault", fault_enumeration);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
