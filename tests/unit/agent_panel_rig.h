/* SPDX-License-Identifier: Apache-2.0 */
/* A panel that is told a script of what happens, and what it did. */
#ifndef TESTS_UNIT_AGENT_PANEL_RIG_H
#define TESTS_UNIT_AGENT_PANEL_RIG_H

#include <string.h>

#include "agent/panel/panel.h"

enum { MS = 1000, DEBOUNCE = 20 * MS };

static inline FbStatus status_of(FbState state, uint32_t transfer, bool acknowledge)
{
    return (FbStatus){
        .state = state, .epoch = 7, .transfer = transfer, .needs_acknowledge = acknowledge};
}

typedef struct {
    AgentPanel panel;
    int64_t now_us, wake_us;
    int starts, holds, drops, ignored;
    int64_t start_us, hold_us; /* when it was the last time */
    bool lamp;
} Rig;

static inline void tell(Rig *r, const AgentPanelEvent *event, int64_t now_us)
{
    AgentPanelActions out;
    r->now_us = now_us;
    agent_panel_step(&r->panel, event, now_us, &out);
    r->starts += out.start;
    r->holds += out.hold;
    r->drops += out.drop;
    r->ignored += out.ignored != NULL;
    r->start_us = out.start ? now_us : r->start_us;
    r->hold_us = out.hold ? now_us : r->hold_us;
    r->wake_us = out.wake_us;
    r->lamp = out.lamp;
    g_assert_false(out.start && out.hold);
    g_assert_true(!r->panel.armed || (r->panel.ready && agent_panel_fault(&r->panel) == 0));
    g_assert_true(out.wake_us > now_us || event->kind == AGENT_PANEL_EDGE);
}

/* Lets time pass. step_us > 0: ticks that often; 0: exactly when they are asked for. */
static inline void pass(Rig *r, int64_t until_us, int64_t step_us)
{
    static const AgentPanelEvent tick = {.kind = AGENT_PANEL_TICK};
    for (;;) {
        const int64_t next_us = step_us > 0 ? r->now_us + step_us : r->wake_us;
        if (next_us >= until_us)
            return;
        tell(r, &tick, next_us);
    }
}

static const struct {
    const char *word;
    AgentPanelEvent event; /* at_us is filled in */
    FbState state;
    uint32_t transfer;
    bool acknowledge;
} words[] = {
    {"lines", {.kind = AGENT_PANEL_LINES}, 0, 0, 0},
    {"lines-start", {.kind = AGENT_PANEL_LINES, .pressed = {true, false}}, 0, 0, 0},
    {"lines-hold", {.kind = AGENT_PANEL_LINES, .pressed = {false, true}}, 0, 0, 0},
    {"gone", {.kind = AGENT_PANEL_NO_LINES}, 0, 0, 0},
    {"S", {.kind = AGENT_PANEL_EDGE, .key = AGENT_KEY_START, .pressed = {true, false}}, 0, 0, 0},
    {"s", {.kind = AGENT_PANEL_EDGE, .key = AGENT_KEY_START}, 0, 0, 0},
    {"H", {.kind = AGENT_PANEL_EDGE, .key = AGENT_KEY_HOLD, .pressed = {false, true}}, 0, 0, 0},
    {"h", {.kind = AGENT_PANEL_EDGE, .key = AGENT_KEY_HOLD}, 0, 0, 0},
    {"ready", {.kind = AGENT_PANEL_STATUS}, FB_STATE_READY, 1, false},
    {"other", {.kind = AGENT_PANEL_STATUS}, FB_STATE_READY, 2, false},
    {"needs-ack", {.kind = AGENT_PANEL_STATUS}, FB_STATE_READY, 1, true},
    {"empty", {.kind = AGENT_PANEL_STATUS}, FB_STATE_READY, 0, false},
    {"idle", {.kind = AGENT_PANEL_STATUS}, FB_STATE_IDLE, 0, false},
    {"running", {.kind = AGENT_PANEL_STATUS}, FB_STATE_RUNNING, 1, false},
    {"tool-change", {.kind = AGENT_PANEL_STATUS}, FB_STATE_TOOL_CHANGE, 1, false},
    {"holding", {.kind = AGENT_PANEL_STATUS}, FB_STATE_HOLDING, 1, false},
    {"held", {.kind = AGENT_PANEL_STATUS}, FB_STATE_HELD, 1, false},
    {"complete", {.kind = AGENT_PANEL_STATUS}, FB_STATE_COMPLETE, 1, false},
    {"alarm", {.kind = AGENT_PANEL_STATUS}, FB_STATE_ALARM, 1, true},
    {"lost", {.kind = AGENT_PANEL_STATUS}, FB_STATE_UNKNOWN, 1, false},
    {"ended", {.kind = AGENT_PANEL_RUN_ENDED}, 0, 0, 0},
    {"refused", {.kind = AGENT_PANEL_RUN_ENDED, .failed = true}, 0, 0, 0},
    {"answered", {.kind = AGENT_PANEL_HOLD_ANSWERED}, 0, 0, 0},
    {"end", {.kind = AGENT_PANEL_TICK}, 0, 0, 0},
};

/* "MS WORD MS WORD …" */
static inline void play(Rig *r, const char *script, int64_t step_us)
{
    g_auto(GStrv) parts = g_strsplit(script, " ", -1);
    for (size_t i = 0; parts[i] && parts[i + 1]; i += 2) {
        size_t w = 0;
        while (w < G_N_ELEMENTS(words) && strcmp(words[w].word, parts[i + 1]) != 0)
            w++;
        if (w == G_N_ELEMENTS(words))
            g_error("no word %s", parts[i + 1]);
        const FbStatus status = status_of(words[w].state, words[w].transfer, words[w].acknowledge);
        AgentPanelEvent event = words[w].event;
        event.at_us = g_ascii_strtoll(parts[i], NULL, 10) * MS;
        event.status = &status;
        pass(r, event.at_us, step_us);
        tell(r, &event, event.at_us);
    }
}

static inline Rig rig(void)
{
    return (Rig){.panel = agent_panel_new(DEBOUNCE, 0), .wake_us = INT64_MAX};
}

#endif
