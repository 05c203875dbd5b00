/* SPDX-License-Identifier: Apache-2.0 */
/* A controller on a test bench: a machine made by hand, programs as text, a clock of our own. */
#ifndef TESTS_UNIT_SIM_RIG_H
#define TESTS_UNIT_SIM_RIG_H

#include <math.h>
#include <string.h>

#include "sim/alarm.h"
#include "sim/controller.h"
#include "tests/lib/test.h"

typedef struct {
    CfgMachine machine;
    CfgTool tools[2];
    CfgToolTable table;
    SimController *controller;
    int64_t now_us;
    GArray *actions; /* SimAction, all so far */
} Rig;

static inline void rig_init(Rig *rig, double speed, size_t moves_per_step)
{
    *rig = (Rig){0};
    rig->machine = (CfgMachine){.name = (char *)(uintptr_t) "test",
                                .dialect = (char *)(uintptr_t) "linuxcnc",
                                .spindle_min_rpm = 100,
                                .spindle_max_rpm = 20000,
                                .spindle_rpm_per_s = 5000,
                                .tool_change_s = 4,
                                .program_memory_bytes = 1 << 20,
                                .agent_timeout_s = 5};
    const double a[3] = {800, 600, 400};
    for (int i = 0; i < 3; i++)
        rig->machine.axis[i] =
            (CfgAxis){.min_mm = -500, .max_mm = 500, .max_mm_min = 12000, .max_mm_s2 = a[i]};
    for (int i = 0; i < 2; i++)
        rig->tools[i] =
            (CfgTool){.number = i + 1, .kind = CFG_TOOL_FLAT, .diameter_mm = 6, .length_mm = 50};
    rig->table = (CfgToolTable){.tools = rig->tools, .n_tools = 2};
    rig->actions = g_array_new(FALSE, FALSE, sizeof(SimAction));
    SimControllerOptions options = {
        .machine = &rig->machine, .speed = speed, .moves_per_step = moves_per_step};
    rig->controller = sim_controller_new(&options);
}

static inline void rig_clear(Rig *rig)
{
    sim_controller_free(rig->controller);
    g_array_unref(rig->actions);
}

/* Steps, and plans anew at once where the controller wants that. */
static inline void rig_step(Rig *rig, const SimEvent *event)
{
    sim_controller_step(rig->controller, event, rig->now_us, rig->actions);
    NcOverride override;
    for (SimProgram *p; (p = sim_controller_unplanned(rig->controller, &override)) != NULL;) {
        SimEvent planned = {
            .kind = SIM_PLAN, .program = p, .plan = sim_plan_new(p, &rig->machine, override)};
        sim_controller_step(rig->controller, &planned, rig->now_us, rig->actions);
    }
}

static inline void rig_do(Rig *rig, SimEventKind kind)
{
    rig_step(rig, &(SimEvent){.kind = kind});
}

static inline void rig_optional_stop(Rig *rig, bool on)
{
    rig_step(rig, &(SimEvent){.kind = SIM_OPTIONAL_STOP, .on = on});
}

static inline void rig_restart(Rig *rig, size_t gate)
{
    rig_step(rig, &(SimEvent){.kind = SIM_RESTART, .gate = gate});
}

static inline void rig_override(Rig *rig, int feed, int rapid, int spindle)
{
    rig_step(rig, &(SimEvent){.kind = SIM_OVERRIDE, .override = {feed, rapid, spindle}});
}

static inline void rig_tick(Rig *rig, int64_t us)
{
    rig->now_us += us;
    rig_do(rig, SIM_TICK);
}

static inline SimProgram *rig_program(Rig *rig, const char *text, const uint64_t *gates, size_t n,
                                      GError **error)
{
    g_autoptr(GBytes) bytes = g_bytes_new(text, strlen(text));
    g_autoptr(SimReader) reader = sim_reader_new(&rig->machine, &rig->table);
    return sim_reader_read(reader, bytes, gates, n, true, NC_NO_OVERRIDE, error);
}

/* Loads a program that must be good; NULL after a failed assertion. The controller owns it. */
static inline const SimProgram *rig_load(Rig *rig, const char *text, const uint64_t *gates,
                                         size_t n)
{
    g_autoptr(GError) error = NULL;
    SimProgram *program = rig_program(rig, text, gates, n, &error);
    g_assert_no_error(error);
    if (!program)
        return NULL;
    rig_do(rig, SIM_ACKNOWLEDGE);
    rig_step(rig, &(SimEvent){.kind = SIM_LOAD, .program = program});
    g_assert_cmpint(sim_controller_state(rig->controller), ==, FB_STATE_READY);
    return program;
}

/* A fresh rig that has just started a program. Its planned time; 0 after a failed assertion. */
static inline double rig_start(Rig *rig, double speed, const char *text, const uint64_t *gates,
                               size_t n)
{
    rig_init(rig, speed, 1000);
    const SimProgram *program = rig_load(rig, text, gates, n);
    rig_do(rig, SIM_START);
    return program ? sim_program_duration_s(program) : 0;
}

static inline FbState rig_state(const Rig *rig)
{
    return sim_controller_state(rig->controller);
}

static inline FbProgress rig_see(const Rig *rig)
{
    return sim_controller_progress(rig->controller);
}

/* Ticks until the clock stands, at most limit_s on the clock passed in. */
static inline void rig_run(Rig *rig, int64_t tick_us, double limit_s)
{
    int64_t end_us = rig->now_us + (int64_t)(limit_s * 1e6);
    while (sim_controller_moving(rig->controller) && rig->now_us < end_us)
        rig_tick(rig, tick_us);
    g_assert_false(sim_controller_moving(rig->controller));
}

/* The states in order, as "READY RUNNING …"; caller frees. */
static inline char *rig_states(const Rig *rig)
{
    GString *text = g_string_new(NULL);
    for (guint i = 0; i < rig->actions->len; i++) {
        const SimAction *action = &g_array_index(rig->actions, SimAction, i);
        if (action->kind == SIM_STATE)
            g_string_append_printf(text, "%s%s", text->len ? " " : "",
                                   fb_state_name(action->state));
    }
    return g_string_free(text, FALSE);
}

/* The first executed block from action `*i` on, behind which `*i` is moved; NULL: none. */
static inline const SimBlock *rig_next_block(const Rig *rig, guint *i)
{
    while (*i < rig->actions->len) {
        const SimAction *action = &g_array_index(rig->actions, SimAction, (*i)++);
        if (action->kind == SIM_BLOCK)
            return &action->block;
    }
    return NULL;
}

/* The n-th executed block; a zero one after a failed assertion. */
static inline SimBlock rig_block(const Rig *rig, guint n)
{
    for (guint i = 0; i < rig->actions->len; i++) {
        const SimAction *action = &g_array_index(rig->actions, SimAction, i);
        if (action->kind == SIM_BLOCK && n-- == 0)
            return action->block;
    }
    g_assert_not_reached();
    return (SimBlock){0};
}

static inline guint rig_blocks(const Rig *rig)
{
    guint n = 0;
    for (guint i = 0; i < rig->actions->len; i++)
        n += g_array_index(rig->actions, SimAction, i).kind == SIM_BLOCK;
    return n;
}

static inline SimBlock rig_last_block(const Rig *rig)
{
    return rig_block(rig, rig_blocks(rig) - 1);
}

#endif
