/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/fault.h"

#include <math.h>

#include "sim/alarm.h"

#define RANDOM_DELAY_S 2 /* the longest */

struct SimFaults {
    const SimFaultScript *script;
    bool *begun;  /* one a fault */
    GQueue armed; /* SimFault, of replies: each has the next reply that is free */
    uint64_t frames;
    double slow_s; /* of every reply */
    bool cut;      /* no power */
    GRand *dice;
    uint64_t rolled[SIM_FAULT_SLOW]; /* what happened at random */
};

static void begin_due(SimFaults *f, const SimFaultEvent *event, double time_s, GArray *actions);
static void begin(SimFaults *f, const SimFault *fault, GArray *actions);
static FbFate next_fate(SimFaults *f);

void sim_faults_step(SimFaults *f, const SimFaultEvent *event, double time_s, GArray *actions)
{
    f->frames += event->kind == SIM_FAULT_FRAME;
    f->cut = f->cut && event->kind != SIM_FAULT_BOOTED;
    begin_due(f, event, time_s, actions);
    if (event->kind != SIM_FAULT_FRAME)
        return;
    const SimFaultDo fate = {.kind = SIM_FAULT_DO_FATE, .fate = next_fate(f)};
    g_array_append_val(actions, fate);
}

static const SimFault *fault_of(const SimFaults *f, guint i)
{
    return &g_array_index(f->script->faults, SimFault, i);
}

/* In the order of the script. What a cut keeps from beginning may begin after it. */
static void begin_due(SimFaults *f, const SimFaultEvent *event, double time_s, GArray *actions)
{
    for (guint i = 0; i < f->script->faults->len && !f->cut; i++) {
        const SimFault *fault = fault_of(f, i);
        const bool due = fault->moment == SIM_AT_FRAME
                             ? event->kind == SIM_FAULT_FRAME && fault->number <= f->frames
                             : event->kind == SIM_FAULT_TICK &&
                                   (fault->moment == SIM_AT_LINE ? fault->number <= event->line
                                                                 : fault->time_s <= time_s);
        if (!due || f->begun[i])
            continue;
        f->begun[i] = true;
        begin(f, fault, actions);
    }
}

static SimFaultDo alarm_of(SimAlarm alarm)
{
    return (SimFaultDo){.kind = SIM_FAULT_DO_EVENT,
                        .event = SIM_FAIL,
                        .alarm = {.code = (uint16_t)alarm,
                                  .text = sim_alarm_text(alarm),
                                  .advice = sim_alarm_advice(alarm)}};
}

static void begin(SimFaults *f, const SimFault *fault, GArray *actions)
{
    const SimFaultDo note = {.kind = SIM_FAULT_DO_NOTE, .spec = fault->spec};
    SimFaultDo act = {.kind = SIM_FAULT_DO_EVENT};
    g_array_append_val(actions, note);
    switch (fault->kind) {
    case SIM_FAULT_ALARM:
        act.event = SIM_FAIL;
        act.alarm = (FbAlarm){.code = fault->code,
                              .text = fault->text ? fault->text : "an alarm on purpose",
                              .advice = "Acknowledge at the machine, start anew."};
        break;
    case SIM_FAULT_HOLD:
        act.event = SIM_HOLD;
        break;
    case SIM_FAULT_ESTOP:
        act.event = SIM_ESTOP;
        break;
    case SIM_FAULT_TOOL_MISSING:
        act = alarm_of(SIM_ALARM_TOOL);
        break;
    case SIM_FAULT_LIMIT_HIT:
        act = alarm_of(SIM_ALARM_SWITCH);
        break;
    case SIM_FAULT_REBOOT:
        f->cut = true;
        act.kind = SIM_FAULT_DO_CUT;
        break;
    case SIM_FAULT_SLOW:
        f->slow_s = fault->seconds;
        return;
    default:
        g_queue_push_tail(&f->armed, (gpointer)(uintptr_t)fault);
        return;
    }
    g_array_append_val(actions, act);
}

/* ----------------------------------------------------------------------------- replies */

static FbFate fate_of(const SimFault *fault, double slow_s)
{
    FbFate fate = {.copies = 1, .delay_us = (int64_t)(slow_s * 1e6)};
    switch (fault->kind) {
    case SIM_FAULT_DROP:
        fate.copies = 0;
        break;
    case SIM_FAULT_DUPLICATE:
        fate.copies = 2;
        break;
    case SIM_FAULT_DELAY:
        fate.delay_us += (int64_t)(fault->seconds * 1e6);
        break;
    case SIM_FAULT_CORRUPT:
        fate.corrupt = true;
        fate.bit = fault->bit;
        break;
    case SIM_FAULT_CLOSE:
        fate.close = true;
        break;
    default:
        break;
    }
    return fate;
}

/* One that is thrown; every kind as likely. */
static SimFault roll(SimFaults *f)
{
    static const SimFaultKind kinds[] = {SIM_FAULT_DROP, SIM_FAULT_DUPLICATE, SIM_FAULT_DELAY,
                                         SIM_FAULT_CORRUPT, SIM_FAULT_CLOSE};
    const SimFaultKind kind = kinds[g_rand_int_range(f->dice, 0, G_N_ELEMENTS(kinds))];
    f->rolled[kind]++;
    return (SimFault){.kind = kind,
                      .seconds = g_rand_double_range(f->dice, 0, RANDOM_DELAY_S),
                      .bit = g_rand_int(f->dice)};
}

static FbFate next_fate(SimFaults *f)
{
    const SimFault none = {.kind = SIM_FAULT_SLOW};
    if (f->cut)
        return (FbFate){.close = true};
    const bool unlucky = f->script->rate > 0 && g_rand_double(f->dice) < f->script->rate;
    const SimFault *armed = g_queue_pop_head(&f->armed);
    if (armed)
        return fate_of(armed, f->slow_s);
    if (!unlucky)
        return fate_of(&none, f->slow_s);
    const SimFault rolled = roll(f);
    return fate_of(&rolled, f->slow_s);
}

/* ------------------------------------------------------------------------ what is shown */

SimMoment sim_faults_next(const SimFaults *f)
{
    SimMoment next = {UINT32_MAX, INFINITY};
    for (guint i = 0; i < f->script->faults->len; i++) {
        const SimFault *fault = fault_of(f, i);
        if (!f->begun[i] && fault->moment == SIM_AT_LINE)
            next.line = MIN(next.line, fault->number);
        else if (!f->begun[i] && fault->moment == SIM_AT_TIME)
            next.time_s = MIN(next.time_s, fault->time_s);
    }
    return next;
}

char *sim_faults_summary(const SimFaults *f)
{
    GString *text = g_string_new(NULL);
    guint begun = 0;
    for (guint i = 0; i < f->script->faults->len; i++)
        begun += f->begun[i];
    g_string_append_printf(text, "faults begun: %u of %u\n", begun, f->script->faults->len);
    for (guint i = 0; i < f->script->faults->len; i++)
        if (!f->begun[i])
            g_string_append_printf(text, "fault not reached: %s\n", fault_of(f, i)->spec);
    if (f->script->rate <= 0)
        return g_string_free(text, FALSE);
    g_string_append_printf(text, "random faults, seed %u, of %" G_GUINT64_FORMAT " replies:",
                           f->script->seed, f->frames);
    for (SimFaultKind kind = SIM_FAULT_DROP; kind < SIM_FAULT_SLOW; kind++)
        g_string_append_printf(text, "%s %s %" G_GUINT64_FORMAT, kind > SIM_FAULT_DROP ? "," : "",
                               sim_fault_name(kind), f->rolled[kind]);
    g_string_append_c(text, '\n');
    return g_string_free(text, FALSE);
}

/* ----------------------------------------------------------------------------- ownership */

SimFaults *sim_faults_new(const SimFaultScript *script)
{
    SimFaults *f = g_new0(SimFaults, 1);
    f->script = script;
    f->begun = g_new0(bool, MAX(1, script->faults->len));
    f->dice = g_rand_new_with_seed(script->seed);
    g_queue_init(&f->armed);
    return f;
}

void sim_faults_free(SimFaults *f)
{
    if (!f)
        return;
    g_queue_clear(&f->armed);
    g_rand_free(f->dice);
    g_free(f->begun);
    g_free(f);
}
