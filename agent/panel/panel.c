/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/panel/panel.h"

#include <string.h>

static void advance(AgentPanel *p, int64_t at_us, int64_t now_us, AgentPanelActions *out);
static void take_lines(AgentPanel *p, const AgentPanelEvent *event);
static void take_edge(AgentPanel *p, const AgentPanelEvent *event);
static void take_status(AgentPanel *p, const FbStatus *status, AgentPanelActions *out);
static void take_run_ended(AgentPanel *p, bool failed);
static void ask_hold(AgentPanel *p, int64_t now_us, AgentPanelActions *out);
static void cancel_start(AgentPanel *p, AgentPanelActions *out);
static int64_t wake_us(const AgentPanel *p);

void agent_panel_step(AgentPanel *p, const AgentPanelEvent *event, int64_t now_us,
                      AgentPanelActions *out)
{
    *out = (AgentPanelActions){0};
    const int64_t at_us = event->kind == AGENT_PANEL_EDGE ? event->at_us : now_us;
    p->at_us = MAX(p->at_us, MIN(at_us, now_us));
    advance(p, p->at_us, now_us, out);
    switch (event->kind) {
    case AGENT_PANEL_LINES:
        take_lines(p, event);
        break;
    case AGENT_PANEL_NO_LINES:
        p->lines = p->armed = false;
        break;
    case AGENT_PANEL_EDGE:
        take_edge(p, event);
        break;
    case AGENT_PANEL_STATUS:
        take_status(p, event->status, out);
        break;
    case AGENT_PANEL_RUN_ENDED:
        take_run_ended(p, event->failed);
        break;
    case AGENT_PANEL_HOLD_ANSWERED:
        p->hold_asking = false;
        p->hold_again_us = now_us + AGENT_PANEL_AGAIN_US;
        break;
    case AGENT_PANEL_TICK:
        break;
    }
    ask_hold(p, now_us, out);
    if (out->hold)
        cancel_start(p, out);
    int64_t lamp_us;
    out->lamp = agent_lamp_lit(agent_panel_lamp(p), now_us, &lamp_us);
    out->wake_us = MIN(wake_us(p), lamp_us);
}

/* ------------------------------------------------------------------------ time */

static bool is_released_for(const AgentPanel *p, AgentKey key, int64_t us)
{
    const AgentKeyState *k = &p->keys[key];
    return !k->pressed && !k->settled && p->at_us - k->since_us >= us;
}

/* When the start button will be armed if nothing else happens; INT64_MAX: not. */
static int64_t arm_us(const AgentPanel *p)
{
    const AgentKeyState *start = &p->keys[AGENT_KEY_START], *hold = &p->keys[AGENT_KEY_HOLD];
    if (!p->lines || !p->ready || p->started || p->hold_wanted || p->fault != AGENT_FAULT_NONE ||
        start->pressed || hold->pressed)
        return INT64_MAX;
    return MAX(p->ready_us, MAX(start->since_us, hold->since_us)) + p->debounce_us;
}

/* When the fault will go by itself; INT64_MAX: not, or there is none. */
static int64_t clear_us(const AgentPanel *p)
{
    const AgentKeyState *start = &p->keys[AGENT_KEY_START];
    if (!p->lines || start->pressed ||
        (p->fault != AGENT_FAULT_STUCK && p->fault != AGENT_FAULT_REFUSED))
        return INT64_MAX;
    return MAX(p->fault_us, start->since_us) + AGENT_PANEL_CLEAR_US;
}

/* When a start button that stays as it is will be stuck. */
static int64_t stuck_us(const AgentPanel *p)
{
    const AgentKeyState *start = &p->keys[AGENT_KEY_START];
    return p->lines && p->fault == AGENT_FAULT_NONE && start->pressed
               ? start->since_us + AGENT_PANEL_STUCK_US
               : INT64_MAX;
}

static int64_t settle_us(const AgentPanel *p, AgentKey key)
{
    const AgentKeyState *k = &p->keys[key];
    return p->lines && k->pressed != k->settled ? k->since_us + p->debounce_us : INT64_MAX;
}

static int64_t wake_us(const AgentPanel *p)
{
    const int64_t settled_us = MIN(settle_us(p, AGENT_KEY_START), settle_us(p, AGENT_KEY_HOLD));
    const int64_t fault_us = MIN(stuck_us(p), clear_us(p));
    const int64_t armed_us = p->armed ? INT64_MAX : arm_us(p);
    const int64_t hold_us = p->hold_wanted && !p->hold_asking ? p->hold_again_us : INT64_MAX;
    return MIN(MIN(settled_us, fault_us), MIN(armed_us, hold_us));
}

static void set_fault(AgentPanel *p, AgentFault fault, int64_t at_us)
{
    p->fault = fault;
    p->fault_us = at_us;
    p->armed = false;
}

static const char *why_not(const AgentPanel *p)
{
    if (p->fault != AGENT_FAULT_NONE)
        return "the panel's fault has not been cleared";
    if (p->keys[AGENT_KEY_HOLD].settled)
        return "hold is pressed too";
    if (p->state == FB_STATE_UNKNOWN)
        return "there is no connection to the machine";
    if (p->acknowledge)
        return "a person has to acknowledge at the machine first";
    if (p->started || !p->ready)
        return "the machine is not READY";
    return "it was pressed before the machine was READY: release it and press again";
}

/* What is known by the end of a step counts for a start that was due in it. */
static void cancel_start(AgentPanel *p, AgentPanelActions *out)
{
    if (!out->start)
        return;
    out->start = p->started = false;
    out->ignored = why_not(p);
}

/* A press of start that has settled at `at_us`. */
static void press_start(AgentPanel *p, int64_t at_us, int64_t now_us, AgentPanelActions *out)
{
    if (!p->armed) {
        out->ignored = why_not(p);
    } else if (now_us - at_us > AGENT_PANEL_LATE_US) {
        out->ignored = "it was seen too late: press again";
    } else {
        out->start = p->started = true;
        p->running = false;
    }
    p->armed = false;
}

/* All that time alone brings about up to `at_us`. Between two events either start settles as
 * pressed or it is armed, never both, so the order in here is no matter. */
static void advance(AgentPanel *p, int64_t at_us, int64_t now_us, AgentPanelActions *out)
{
    AgentKeyState *start = &p->keys[AGENT_KEY_START], *hold = &p->keys[AGENT_KEY_HOLD];
    if (at_us >= settle_us(p, AGENT_KEY_HOLD))
        hold->settled = hold->pressed;
    const int64_t settled_us = settle_us(p, AGENT_KEY_START);
    if (at_us >= settled_us) {
        start->settled = start->pressed;
        if (start->settled)
            press_start(p, settled_us, now_us, out);
    }
    if (at_us >= stuck_us(p))
        set_fault(p, AGENT_FAULT_STUCK, stuck_us(p));
    if (at_us >= clear_us(p))
        set_fault(p, AGENT_FAULT_NONE, clear_us(p));
    if (at_us >= arm_us(p))
        p->armed = true;
}

/* ---------------------------------------------------------------------- events */

static void press_hold(AgentPanel *p)
{
    p->armed = false;
    p->hold_wanted = p->hold_pressed = true;
    if (p->fault == AGENT_FAULT_PRESSED &&
        is_released_for(p, AGENT_KEY_START, AGENT_PANEL_CLEAR_US))
        set_fault(p, AGENT_FAULT_NONE, p->at_us);
}

static void take_lines(AgentPanel *p, const AgentPanelEvent *event)
{
    p->lines = true;
    p->armed = false;
    for (size_t i = 0; i < AGENT_N_KEYS; i++) {
        p->keys[i] = (AgentKeyState){event->pressed[i], event->pressed[i], p->at_us};
        if (event->pressed[i])
            set_fault(p, AGENT_FAULT_PRESSED, p->at_us);
    }
    if (event->pressed[AGENT_KEY_HOLD])
        press_hold(p);
}

/* Two edges to the same side mean that one between them was lost: the line was not quiet. */
static void take_edge(AgentPanel *p, const AgentPanelEvent *event)
{
    if (!p->lines)
        return;
    AgentKeyState *key = &p->keys[event->key];
    const bool pressed = event->pressed[event->key];
    const bool first = pressed && !key->settled;
    key->pressed = pressed;
    key->since_us = p->at_us;
    if (event->key == AGENT_KEY_HOLD && first) {
        key->settled = true;
        press_hold(p);
    }
}

/* A START whose link breaks is not made up for when the link is back: that takes a fresh press. */
static void watch_start(AgentPanel *p, AgentPanelActions *out)
{
    if (!p->started || p->running)
        return;
    p->running = p->state != FB_STATE_READY && p->state != FB_STATE_UNKNOWN;
    out->drop = p->state == FB_STATE_UNKNOWN;
    p->started = !out->drop;
}

static void take_status(AgentPanel *p, const FbStatus *status, AgentPanelActions *out)
{
    const bool verified = status->state == FB_STATE_READY && status->transfer != 0;
    const bool ready = verified && !status->needs_acknowledge;
    const bool same = ready && p->ready && p->epoch == status->epoch &&
                      p->transfer == status->transfer && p->run == status->run &&
                      memcmp(p->id, status->id, sizeof p->id) == 0;
    p->ready = ready;
    p->acknowledge = verified && status->needs_acknowledge;
    p->state = status->state;
    p->epoch = status->epoch;
    p->transfer = status->transfer;
    p->run = status->run;
    memcpy(p->id, status->id, sizeof p->id);
    if (!same) {
        p->armed = false;
        p->ready_us = p->at_us;
        cancel_start(p, out);
    }
    watch_start(p, out);
}

static void take_run_ended(AgentPanel *p, bool failed)
{
    p->started = false;
    p->ready_us = p->at_us;
    if (failed && !p->running && p->fault == AGENT_FAULT_NONE)
        set_fault(p, AGENT_FAULT_REFUSED, p->at_us);
}

/* ------------------------------------------------------------------------ hold */

/* READY with a START on its way is not at rest: a HOLD may have overtaken it. */
static bool stands(const AgentPanel *p)
{
    switch (p->state) {
    case FB_STATE_RUNNING:
    case FB_STATE_TOOL_CHANGE:
    case FB_STATE_UNKNOWN:
        return false;
    case FB_STATE_READY:
        return !p->started;
    default:
        return true;
    }
}

/* Every press is asked for once; and then again, as long as the machine does not stand. While the
 * button is down it is not let go on. */
static void ask_hold(AgentPanel *p, int64_t now_us, AgentPanelActions *out)
{
    if (p->keys[AGENT_KEY_HOLD].settled && p->lines &&
        (p->state == FB_STATE_RUNNING || p->state == FB_STATE_TOOL_CHANGE))
        p->hold_wanted = true;
    if (p->hold_asking)
        return;
    if (!p->hold_pressed && stands(p))
        p->hold_wanted = false;
    if (!p->hold_wanted || (!p->hold_pressed && now_us < p->hold_again_us))
        return;
    p->hold_pressed = false;
    out->hold = p->hold_asking = true;
}

/* ------------------------------------------------------------------------ lamp */

/* Lit, dark, lit, dark … for so many ms, over and over. */
static const int patterns[AGENT_N_LAMPS][4] = {
    [AGENT_LAMP_SLOW] = {500, 500, 500, 500},
    [AGENT_LAMP_FAST] = {125, 125, 125, 125},
    [AGENT_LAMP_DOUBLE] = {125, 125, 125, 875},
};

bool agent_lamp_lit(AgentLamp lamp, int64_t now_us, int64_t *until_us)
{
    const int *pattern = patterns[lamp];
    const int64_t period_us = 1000 * (pattern[0] + pattern[1] + pattern[2] + pattern[3]);
    *until_us = INT64_MAX;
    if (period_us == 0)
        return lamp == AGENT_LAMP_STEADY;
    int64_t left_us = now_us % period_us;
    size_t i = 0;
    while (left_us >= 1000 * pattern[i])
        left_us -= 1000 * pattern[i++];
    *until_us = now_us + 1000 * pattern[i] - left_us;
    return i % 2 == 0;
}

AgentFault agent_panel_fault(const AgentPanel *p)
{
    return p->lines ? p->fault : AGENT_FAULT_NO_LINES;
}

AgentLamp agent_panel_lamp(const AgentPanel *p)
{
    if (agent_panel_fault(p) != AGENT_FAULT_NONE)
        return AGENT_LAMP_DOUBLE;
    switch (p->state) {
    case FB_STATE_RUNNING:
    case FB_STATE_TOOL_CHANGE:
    case FB_STATE_ABORTING:
        return AGENT_LAMP_STEADY;
    case FB_STATE_HOLDING:
    case FB_STATE_HELD:
    case FB_STATE_PROGRAM_STOP:
        return AGENT_LAMP_FAST;
    case FB_STATE_ALARM:
    case FB_STATE_ESTOP:
    case FB_STATE_UNKNOWN:
        return AGENT_LAMP_DOUBLE;
    default:
        return p->acknowledge ? AGENT_LAMP_FAST : p->armed ? AGENT_LAMP_SLOW : AGENT_LAMP_OFF;
    }
}

const char *agent_fault_text(AgentFault fault)
{
    switch (fault) {
    case AGENT_FAULT_NONE:
        return "no fault";
    case AGENT_FAULT_NO_LINES:
        return "the lines are not there: nothing starts, and hold is not seen";
    case AGENT_FAULT_PRESSED:
        return "a button was pressed when it was first seen: release it, wait 2 s, then press hold";
    case AGENT_FAULT_STUCK:
        return "the start button has been down for 10 s: release it for 2 s, or mend it";
    case AGENT_FAULT_REFUSED:
        return "the machine did not take the start: mend the cause and press again after 2 s";
    }
    return "";
}

AgentPanel agent_panel_new(int64_t debounce_us, int64_t now_us)
{
    return (AgentPanel){
        .debounce_us = debounce_us, .at_us = now_us, .ready_us = now_us, .state = FB_STATE_UNKNOWN};
}
