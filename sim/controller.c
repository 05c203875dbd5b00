/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/controller.h"

#include <math.h>

#include "sim/run.h"

/* M2 and M30 go back to G54, and a program begins with it. */
#define RESET_WORK_OFFSET 54

static void load(SimController *c, SimProgram *program, GArray *actions);
static void forget(SimController *c, GArray *actions);
static void take_pass(SimController *c, SimProgram *pass, GArray *actions);
static void take_plan(SimController *c, const SimEvent *event, GArray *actions);
static void acknowledge(SimController *c, GArray *actions);
static void fail(SimController *c, GArray *actions);

void sim_controller_step(SimController *c, const SimEvent *event, int64_t now_us, GArray *actions)
{
    if (!c->woken || event->kind == SIM_TICK)
        sim_run_advance(c, now_us, event->kind == SIM_TICK, actions);
    const bool ready = c->state == FB_STATE_READY || c->state == FB_STATE_COMPLETE;
    switch (event->kind) {
    case SIM_TICK:
        break;
    case SIM_LOAD:
        load(c, event->program, actions);
        break;
    case SIM_PASS:
        take_pass(c, event->program, actions);
        break;
    case SIM_FORGET:
        forget(c, actions);
        break;
    case SIM_START:
        if (ready && (c->program || c->drips))
            sim_run_start(c, 0, actions);
        break;
    case SIM_RESTART:
        if (ready && c->program && event->gate > 0 && event->gate <= c->program->n_gates)
            sim_run_start(c, event->gate, actions);
        break;
    case SIM_HOLD:
        if (c->in_run && !c->halted && c->stop <= SIM_STOP_HELD) {
            sim_run_note(c, FB_STATE_HOLDING, actions);
            sim_run_brake(c, SIM_STOP_HELD, actions);
        }
        break;
    case SIM_HOLD_AT_GATE:
        if (c->in_run && !c->halted && c->stop == SIM_NO_STOP)
            sim_run_hold_at_gate(c, actions);
        break;
    case SIM_RESUME:
        if (c->in_run && c->stop <= SIM_STOP_HELD)
            sim_run_resume(c, actions);
        break;
    case SIM_ABORT:
        if (c->in_run && c->stop != SIM_STOP_ESTOP) {
            sim_run_note(c, FB_STATE_ABORTING, actions);
            sim_run_brake(c, SIM_STOP_ABORTED, actions);
        }
        break;
    case SIM_ESTOP:
        sim_run_tell(c, FB_STATE_ESTOP, FB_MACHINE_ESTOP, actions);
        if (c->in_run)
            sim_run_brake(c, SIM_STOP_ESTOP, actions);
        break;
    case SIM_FAIL:
        fail(c, actions);
        break;
    case SIM_OVERRIDE:
        c->override = event->override;
        sim_run_override(c, actions);
        break;
    case SIM_PLAN:
        take_plan(c, event, actions);
        break;
    case SIM_OPTIONAL_STOP:
        c->optional_stop = event->on;
        break;
    case SIM_ACKNOWLEDGE:
        acknowledge(c, actions);
        break;
    }
}

static void load(SimController *c, SimProgram *program, GArray *actions)
{
    g_assert(!c->in_run);
    sim_run_drop_passes(c);
    sim_program_unref(c->program);
    c->program = program;
    c->drips = program == NULL;
    sim_run_tell(c, FB_STATE_READY, FB_MACHINE_VERIFIED, actions);
}

/* While a machine still brakes for an e-stop the run itself drops what drips, when it ends. */
static void forget(SimController *c, GArray *actions)
{
    if (c->in_run)
        return;
    g_clear_pointer(&c->program, sim_program_unref);
    sim_run_drop_passes(c);
    if (c->state == FB_STATE_READY || c->state == FB_STATE_COMPLETE)
        sim_run_note(c, FB_STATE_IDLE, actions);
}

static void take_pass(SimController *c, SimProgram *pass, GArray *actions)
{
    if (!c->drips || c->fault) {
        sim_program_unref(pass);
        return;
    }
    if (pass)
        g_queue_push_tail(&c->passes, pass);
    c->fault = pass == NULL;
    sim_run_feed(c, actions);
}

static void take_plan(SimController *c, const SimEvent *event, GArray *actions)
{
    if (!sim_same_override(event->plan->override, c->override)) {
        sim_plan_unref(event->plan);
        return;
    }
    sim_program_set_plan(event->program, event->plan);
    if (c->in_run && c->drive.program == event->program)
        sim_run_replan(c, actions);
}

static void fail(SimController *c, GArray *actions)
{
    if (c->state == FB_STATE_OFF || c->state == FB_STATE_ALARM || c->state == FB_STATE_ESTOP)
        return;
    sim_run_tell(c, FB_STATE_ALARM, FB_MACHINE_ALARM, actions);
    if (c->in_run)
        sim_run_brake(c, SIM_STOP_ESTOP, actions);
}

/* Nobody can have seen to a machine that moves. */
static void acknowledge(SimController *c, GArray *actions)
{
    if (c->drive.mode != SIM_STAND)
        return;
    FbState state = c->state;
    if (state == FB_STATE_OFF || state == FB_STATE_ESTOP || state == FB_STATE_ALARM)
        state = c->program || c->drips ? FB_STATE_READY : FB_STATE_IDLE;
    sim_run_tell(c, state, FB_MACHINE_ACKNOWLEDGED, actions);
}

/* ------------------------------------------------------------------------- what is shown */

void sim_controller_wake(SimController *c, SimMoment moment)
{
    c->wake = moment;
}

bool sim_controller_moving(const SimController *c)
{
    return c->drive.mode != SIM_STAND;
}

SimProgram *sim_controller_unplanned(const SimController *c, NcOverride *override)
{
    SimProgram *const programs[] = {c->in_run ? c->drive.program : NULL, c->program,
                                    g_queue_peek_head((GQueue *)(uintptr_t)&c->passes)};
    *override = c->override;
    for (size_t i = 0; i < G_N_ELEMENTS(programs); i++)
        if (programs[i] && !sim_same_override(programs[i]->plan->override, c->override))
            return programs[i];
    return NULL;
}

FbState sim_controller_state(const SimController *c)
{
    return c->state;
}

FbProgress sim_controller_progress(const SimController *c)
{
    const SimDrive *drive = &c->drive;
    const SegVec3 at = sim_run_place(c).mm;
    const bool on_move = c->in_run && drive->program && drive->move < drive->program->n;
    const double rpm = sim_spindle_rpm(&c->spindle, c->time_s);
    return (FbProgress){
        .line = on_move ? drive->program->moves[drive->move].line : 0,
        .executed_blocks = c->executed_blocks,
        .tool = c->tool,
        .position_mm = {at.x, at.y, at.z},
        .feed_mm_min = on_move ? sim_run_speed_mm_s(c) * 60 : 0,
        .spindle_rpm = rpm,
        .program_time_ms = (uint32_t)fmin(c->time_s * 1000, UINT32_MAX),
        .gate = (uint32_t)c->gate,
        .stop_line = c->stop_line,
        .starving = c->wait == SIM_WAIT_PASS,
        .starved = c->starved,
        .starved_ms = (uint32_t)MIN(sim_run_starved_us(c) / 1000, UINT32_MAX),
        .work_offset = (uint16_t)(c->in_run ? c->work_offset : RESET_WORK_OFFSET),
    };
}

SimTotals sim_controller_totals(const SimController *c)
{
    SimTotals totals = c->totals;
    totals.machine_s += c->in_run ? c->time_s : 0;
    return totals;
}

/* ---------------------------------------------------------------------------- ownership */

SimController *sim_controller_new(const SimControllerOptions *options)
{
    SimController *c = g_new0(SimController, 1);
    c->options = *options;
    c->state = FB_STATE_OFF;
    const double *at = options->machine->tool_change_mm;
    c->place.mm = seg_vec3(at[0], at[1], at[2]);
    c->work_offset = RESET_WORK_OFFSET;
    c->override = NC_NO_OVERRIDE;
    c->wake = SIM_NEVER;
    c->spindle.rpm_per_s = options->machine->spindle_rpm_per_s;
    g_queue_init(&c->passes);
    sim_drive_init(&c->drive);
    return c;
}

void sim_controller_free(SimController *c)
{
    if (!c)
        return;
    sim_run_drop_passes(c);
    sim_program_unref(c->program);
    sim_drive_clear(&c->drive);
    g_free(c);
}
