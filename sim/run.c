/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/run.h"

#include <math.h>

/* The machine stands where the program begins, but for rounding; mm or degrees. */
#define SAME_PLACE 1e-9

static bool woken(SimController *c, GArray *actions);
static void happen(SimController *c, GArray *actions);
static bool finish_move(SimController *c, GArray *actions);
static void speak(const SimController *c, const NcMove *move, GArray *actions);
static void finish_block(SimController *c, SimActionKind kind, const NcMove *last, GArray *actions);
static void pass_gates(SimController *c);
static bool find_section(SimController *c, GArray *actions);
static void enter_program(SimController *c);
static bool enter_pass(SimController *c, GArray *actions);
static void begin_move(SimController *c, GArray *actions);
static void turn_spindle(SimController *c, double rpm);
static void wait_for_spindle(SimController *c);
static void prepare_gate_stop(SimController *c);
static void wait_for(SimController *c, SimWait wait);
static void stand(SimController *c, GArray *actions);
static void note_broken(const SimController *c);
static void end_run(SimController *c);
static void complete(SimController *c, GArray *actions);
static uint32_t next_line(const SimController *c);
static void show_override(const SimController *c, GArray *actions);

/* At speed INFINITY only a tick lets the clock run, so that a command acts before the next move,
 * not after it. */
void sim_run_advance(SimController *c, int64_t now_us, bool ticked, GArray *actions)
{
    c->woken = false;
    double elapsed_s = (double)(now_us - c->now_us) * 1e-6;
    c->now_us = now_us;
    if (c->drive.mode == SIM_STAND)
        return;
    bool bounded = isfinite(c->options.speed);
    if (!bounded && !ticked)
        return;
    c->budget_s += bounded ? elapsed_s * c->options.speed : 0;
    for (size_t i = 0; i < c->options.moves_per_step && c->drive.mode != SIM_STAND; i++) {
        if (woken(c, actions))
            return;
        double next = fmin(sim_drive_next_s(&c->drive), c->wake.time_s);
        if (bounded && next > c->time_s + c->budget_s) {
            c->time_s += c->budget_s;
            c->budget_s = 0;
            return;
        }
        if (bounded)
            c->budget_s -= next - c->time_s;
        c->time_s = fmax(c->time_s, next);
        if (c->time_s < c->wake.time_s)
            happen(c, actions);
    }
    if (c->drive.mode == SIM_STAND)
        c->budget_s = 0;
}

/* Whether the moment that was asked for is now. */
static bool woken(SimController *c, GArray *actions)
{
    const SimProgram *section = c->approaching ? NULL : c->drive.program;
    const uint32_t line = section ? section->moves[c->drive.move].line : 0;
    if (line < c->wake.line && c->time_s < c->wake.time_s)
        return false;
    SimAction action = {.kind = SIM_WOKEN, .line = line, .time_s = c->time_s};
    g_array_append_val(actions, action);
    c->wake = SIM_NEVER;
    c->woken = true;
    return true;
}

static void happen(SimController *c, GArray *actions)
{
    const bool off_plan = c->drive.mode == SIM_DETOUR;
    const unsigned what = sim_drive_happen(&c->drive, c->time_s);
    if (what & SIM_MOVE_DONE && !finish_move(c, actions))
        return;
    if (what & SIM_AT_REST) {
        stand(c, actions);
    } else if (c->drive.mode == SIM_STAND) {
        sim_run_set_off(c, actions);
    } else {
        if (what & SIM_MOVE_DONE)
            begin_move(c, actions);
        if (off_plan && c->gate_wanted && c->drive.mode == SIM_FOLLOW)
            prepare_gate_stop(c);
    }
}

/* False after M0, M1 and at the program's end. */
static bool finish_move(SimController *c, GArray *actions)
{
    const SimProgram *section = c->drive.program;
    const NcMove *move = &section->moves[c->drive.move - 1];
    sim_course_add(c->options.course, c->drive.program, c->drive.move - 1, 1);
    if (move->kind == NC_MOVE_TOOL_CHANGE || move->kind == NC_MOVE_TOOL_NUMBER)
        c->tool = move->tool;
    if (c->approaching) {
        finish_block(c, SIM_WAY, move, actions);
        return true;
    }
    pass_gates(c);
    if (move->kind == NC_MOVE_MESSAGE)
        speak(c, move, actions);
    if (c->drive.move >= section->n || move[1].begins_block) {
        finish_block(c, SIM_BLOCK, move, actions);
        c->executed_blocks++;
    }
    if (move->kind == NC_MOVE_END) {
        complete(c, actions);
        return false;
    }
    if (move->kind == NC_MOVE_STOP || (move->kind == NC_MOVE_OPTIONAL_STOP && c->optional_stop)) {
        c->stop = SIM_STOP_PROGRAM;
        sim_drive_stand(&c->drive, c->time_s);
        stand(c, actions);
        return false;
    }
    return true;
}

static void speak(const SimController *c, const NcMove *move, GArray *actions)
{
    SimAction said = {.kind = SIM_MESSAGE,
                      .line = nc_move_block_line(move),
                      .text = g_strdup(c->drive.program->messages[move->message]),
                      .time_s = c->time_s};
    g_array_append_val(actions, said);
}

static void finish_block(SimController *c, SimActionKind kind, const NcMove *last, GArray *actions)
{
    const CfgRotary *rotary = c->options.machine->rotary;
    bool fed = last->kind == NC_MOVE_FEED || last->kind == NC_MOVE_ARC;
    SimAction done = {
        .kind = kind,
        .time_s = c->time_s,
        .block = {.line = last->line,
                  .block_line = last->block_line ? last->block_line : last->line,
                  .kind = last->kind,
                  .start_s = c->block_start_s,
                  .end_s = c->time_s,
                  .position_mm = last->to,
                  .turns = rotary[0].present || rotary[1].present || rotary[2].present,
                  .position_deg = {last->to_deg[0], last->to_deg[1], last->to_deg[2]},
                  .feed_mm_min = fed ? last->feed_mm_min : 0,
                  .tool = c->tool,
                  .spindle_rpm = sim_spindle_rpm(&c->spindle, c->time_s)}};
    g_array_append_val(actions, done);
    c->block_start_s = c->time_s;
}

/* A pass ends at its gate. */
static void pass_gates(SimController *c)
{
    if (c->drips) {
        c->gate += c->drive.move >= c->drive.program->n;
        return;
    }
    while (c->gate < c->program->n_gates && c->program->gates[c->gate] <= c->drive.move)
        c->gate++;
}

/* --------------------------------------------------------------------------- sections */

static bool same_place(SimPlace a, SimPlace b)
{
    return seg_distance(a.mm, b.mm) <= SAME_PLACE && seg_distance(a.deg, b.deg) <= SAME_PLACE;
}

void sim_run_start(SimController *c, size_t gate, GArray *actions)
{
    const CfgMachine *machine = c->options.machine;
    const double *home = machine->tool_change_mm;
    SimSituation to = {.place = {.mm = {home[0], home[1], home[2]}}, .work_offset = c->work_offset};
    c->in_run = true;
    c->totals.started++;
    c->time_s = c->block_start_s = 0;
    c->begin = c->gate = gate;
    c->stop_line = c->last_line = 0;
    c->starved = 0;
    c->starved_us = 0;
    sim_run_tell(c, FB_STATE_RUNNING, FB_MACHINE_RUNNING, actions);
    if (!sim_same_override(c->override, NC_NO_OVERRIDE))
        show_override(c, actions);
    if (gate > 0)
        to = sim_situation_at_gate(c->program, gate);
    if (gate > 0 || !same_place(c->place, to.place)) {
        g_autoptr(SimProgram) way = sim_approach_new(machine, c->place, c->tool, to, c->override);
        c->approaching = true;
        sim_drive_enter(&c->drive, way, 0);
    } else if (c->program) {
        enter_program(c);
    }
    sim_run_set_off(c, actions);
}

void sim_run_set_off(SimController *c, GArray *actions)
{
    wait_for(c, SIM_NO_WAIT);
    c->halted = false;
    if (c->stop == SIM_STOP_HELD) {
        c->stop = SIM_NO_STOP;
        c->gate_wanted = true;
    }
    if (!find_section(c, actions))
        return;
    const NcOverride planned = c->drive.plan->override;
    if (c->drive.mode == SIM_STAND && !sim_same_override(planned, c->override)) {
        wait_for(c, SIM_WAIT_PLAN);
    } else if (!sim_drive_go(&c->drive, c->time_s)) {
        wait_for(c, SIM_WAIT_OVERRIDE);
    } else {
        begin_move(c, actions);
        if (c->gate_wanted && c->drive.mode == SIM_FOLLOW)
            prepare_gate_stop(c);
    }
}

/* At the end of a section: enters the next one that has moves. False where there is none. */
static bool find_section(SimController *c, GArray *actions)
{
    while (!c->drive.program || c->drive.move >= c->drive.program->n) {
        const bool was_program = !c->approaching && c->drive.program;
        if (c->drive.program) {
            c->place = sim_run_place(c);
            c->last_line = was_program ? c->drive.program->last_line : c->last_line;
            c->approaching = false;
            sim_drive_leave(&c->drive);
        }
        if (c->drips) {
            if (!enter_pass(c, actions))
                return false;
        } else if (was_program) {
            complete(c, actions);
            return false;
        } else {
            enter_program(c);
        }
    }
    return true;
}

static void enter_program(SimController *c)
{
    c->block_start_s = c->time_s;
    sim_drive_enter(&c->drive, c->program, c->begin > 0 ? c->program->gates[c->begin - 1] : 0);
    pass_gates(c);
}

/* False where it is not there yet, or never will be. */
static bool enter_pass(SimController *c, GArray *actions)
{
    g_autoptr(SimProgram) pass = g_queue_pop_head(&c->passes);
    if (pass) {
        c->block_start_s = c->time_s;
        sim_drive_enter(&c->drive, pass, 0);
        c->gate += pass->n == 0;
        return true;
    }
    if (c->fault) {
        end_run(c);
        c->totals.stopped++;
        sim_run_tell(c, FB_STATE_ALARM, FB_MACHINE_ALARM, actions);
    } else if (c->gate_wanted) {
        c->stop = SIM_STOP_HELD;
        stand(c, actions);
    } else {
        c->starved++;
        wait_for(c, SIM_WAIT_PASS);
    }
    return false;
}

void sim_run_feed(SimController *c, GArray *actions)
{
    if (c->wait == SIM_WAIT_PASS)
        sim_run_set_off(c, actions);
}

int64_t sim_run_starved_us(const SimController *c)
{
    return c->starved_us + (c->wait == SIM_WAIT_PASS ? c->now_us - c->wait_us : 0);
}

static void wait_for(SimController *c, SimWait wait)
{
    c->starved_us = sim_run_starved_us(c);
    c->wait = wait;
    c->wait_us = c->now_us;
}

void sim_run_drop_passes(SimController *c)
{
    g_queue_clear_full(&c->passes, (GDestroyNotify)(void (*)(void))sim_program_unref);
    c->drips = false;
    c->fault = false;
}

/* ----------------------------------------------------------------------------- moves */

/* RUNNING and TOOL_CHANGE, as the move in execution has it; and what is on with it. */
static void begin_move(SimController *c, GArray *actions)
{
    const NcMove *move = &c->drive.program->moves[c->drive.move];
    const bool change = move->kind == NC_MOVE_TOOL_CHANGE;
    c->work_offset = move->work_offset;
    c->spindle_override_off = move->spindle_override_off;
    turn_spindle(c, move->spindle_rpm);
    if (c->drive.mode != SIM_FOLLOW)
        return;
    if (change && c->state != FB_STATE_TOOL_CHANGE)
        sim_run_tell(c, FB_STATE_TOOL_CHANGE, FB_MACHINE_TOOL_CHANGE, actions);
    else if (!change && c->state != FB_STATE_RUNNING)
        sim_run_tell(c, FB_STATE_RUNNING, FB_MACHINE_RUNNING, actions);
    wait_for_spindle(c);
}

static void turn_spindle(SimController *c, double rpm)
{
    c->programmed_rpm = rpm;
    const NcOverride override = c->spindle_override_off ? NC_NO_OVERRIDE : c->override;
    sim_spindle_turn(&c->spindle, nc_override_rpm(c->options.machine, override, rpm), c->time_s);
}

/* The plan gives a change of speed the time from one programmed speed to the other. After an
 * override the spindle may have further to go. */
static void wait_for_spindle(SimController *c)
{
    const SimDrive *drive = &c->drive;
    const NcMoveKind kind = drive->program->moves[drive->move].kind;
    if (drive->mode != SIM_FOLLOW || (kind != NC_MOVE_SPINDLE && kind != NC_MOVE_TOOL_CHANGE))
        return;
    const double left_s =
        nc_motion_duration_s(drive->plan->motion, drive->move) - sim_drive_move_s(drive, c->time_s);
    const double late_s = sim_spindle_settled_s(&c->spindle) - (c->time_s + left_s);
    if (late_s > SIM_SPINDLE_ROUNDING_S)
        sim_drive_delay(&c->drive, late_s);
}

void sim_run_override(SimController *c, GArray *actions)
{
    if (!c->in_run)
        return;
    turn_spindle(c, c->programmed_rpm);
    if (c->wait == SIM_WAIT_PLAN)
        sim_run_set_off(c, actions);
}

void sim_run_replan(SimController *c, GArray *actions)
{
    const SimDrive *drive = &c->drive;
    if (c->stop == SIM_STOP_HELD && drive->prepared &&
        drive->program->moves[drive->stop_move].kind != NC_MOVE_TOOL_CHANGE) {
        sim_drive_cancel_stop(&c->drive);
        c->stop = SIM_NO_STOP;
        c->gate_wanted = true;
    }
    sim_drive_replan(&c->drive, c->time_s);
    show_override(c, actions);
    if (c->halted)
        return;
    if (drive->mode == SIM_STAND) {
        sim_run_set_off(c, actions);
        return;
    }
    wait_for_spindle(c);
    if (c->gate_wanted && drive->mode == SIM_FOLLOW)
        prepare_gate_stop(c);
}

static void show_override(const SimController *c, GArray *actions)
{
    SimAction action = {.kind = SIM_OVERRIDES, .override = c->override, .time_s = c->time_s};
    g_array_append_val(actions, action);
}

/* ----------------------------------------------------------------------------- stops */

void sim_run_brake(SimController *c, SimStop stop, GArray *actions)
{
    SimDrive *drive = &c->drive;
    c->stop = stop;
    c->gate_wanted = false;
    if (drive->mode == SIM_FOLLOW && stop != SIM_STOP_ESTOP &&
        drive->program->moves[drive->move].kind == NC_MOVE_TOOL_CHANGE) {
        sim_drive_prepare_stop(drive, drive->move, c->time_s);
        return;
    }
    sim_drive_brake(drive, c->time_s);
    if (drive->mode == SIM_STAND)
        stand(c, actions);
}

void sim_run_hold_at_gate(SimController *c, GArray *actions)
{
    c->gate_wanted = true;
    if (c->wait == SIM_WAIT_PASS) {
        c->stop = SIM_STOP_HELD;
        stand(c, actions);
    } else if (c->drive.mode == SIM_FOLLOW) {
        prepare_gate_stop(c);
    }
}

static void prepare_gate_stop(SimController *c)
{
    const SimProgram *section = c->drive.program;
    bool prepared = false;
    for (size_t g = 0; g < section->n_gates && !prepared; g++) {
        const size_t gate = section->gates[g];
        if (gate > c->drive.move && section->moves[gate - 1].kind != NC_MOVE_END)
            prepared = sim_drive_prepare_stop(&c->drive, gate - 1, c->time_s);
    }
    c->stop = prepared ? SIM_STOP_HELD : SIM_NO_STOP;
}

void sim_run_resume(SimController *c, GArray *actions)
{
    c->gate_wanted = false;
    if (c->wait != SIM_NO_WAIT)
        return;
    c->stop = SIM_NO_STOP;
    sim_drive_cancel_stop(&c->drive);
    if (c->drive.mode == SIM_FOLLOW) {
        begin_move(c, actions);
        return;
    }
    sim_run_tell(c, FB_STATE_RUNNING, FB_MACHINE_RUNNING, actions);
    sim_run_set_off(c, actions);
}

/* The stop has come to rest; the e-stop was told when it was pressed. */
static void stand(SimController *c, GArray *actions)
{
    const SimStop stop = c->stop;
    c->stop = SIM_NO_STOP;
    c->gate_wanted = false;
    wait_for(c, SIM_NO_WAIT);
    c->halted = true;
    switch (stop) {
    case SIM_STOP_ABORTED: {
        const bool drips = c->drips;
        end_run(c);
        c->totals.aborted++;
        sim_run_tell(c, drips ? FB_STATE_IDLE : FB_STATE_READY, FB_MACHINE_ABORTED, actions);
        break;
    }
    case SIM_STOP_ESTOP:
        end_run(c);
        c->totals.stopped++;
        break;
    case SIM_STOP_PROGRAM:
        sim_run_tell(c, FB_STATE_PROGRAM_STOP, FB_MACHINE_PROGRAM_STOP, actions);
        break;
    default:
        sim_run_tell(c, FB_STATE_HELD, FB_MACHINE_HELD, actions);
    }
}

static void complete(SimController *c, GArray *actions)
{
    end_run(c);
    c->stop_line = 0;
    c->totals.completed++;
    sim_run_tell(c, FB_STATE_COMPLETE, FB_MACHINE_COMPLETE, actions);
}

/* The move that a run ended in. */
static void note_broken(const SimController *c)
{
    const SimDrive *d = &c->drive;
    const double part = sim_drive_part(d);
    if (part > 0)
        sim_course_add(c->options.course, d->program, d->move, part);
}

/* What drips was for one run. */
static void end_run(SimController *c)
{
    c->place = sim_run_place(c);
    c->stop_line = next_line(c);
    note_broken(c);
    c->totals.machine_s += c->time_s;
    c->in_run = c->halted = c->approaching = c->gate_wanted = false;
    c->stop = SIM_NO_STOP;
    c->budget_s = 0;
    wait_for(c, SIM_NO_WAIT);
    c->programmed_rpm = 0;
    sim_spindle_stop(&c->spindle);
    sim_drive_leave(&c->drive);
    sim_run_drop_passes(c);
}

static uint32_t next_line(const SimController *c)
{
    const SimProgram *section = c->drive.program;
    const size_t begin = c->program && c->begin > 0 ? c->program->gates[c->begin - 1] : 0;
    if (section && !c->approaching)
        return c->drive.move < section->n ? section->moves[c->drive.move].line
                                          : section->last_line + 1;
    if (c->program)
        return c->program->moves[MIN(begin, c->program->n - 1)].line;
    return c->last_line + 1;
}

SimPlace sim_run_place(const SimController *c)
{
    const SimProgram *section = c->in_run ? c->drive.program : NULL;
    if (!section || section->n == 0)
        return c->place;
    if (c->drive.move >= section->n) {
        const NcMove *last = &section->moves[section->n - 1];
        return (SimPlace){last->to, {last->to_deg[0], last->to_deg[1], last->to_deg[2]}};
    }
    const NcPoint point = sim_drive_point(&c->drive, c->time_s);
    const double *p = point.position;
    return (SimPlace){{p[0], p[1], p[2]}, {p[3], p[4], p[5]}};
}

double sim_run_speed_mm_s(const SimController *c)
{
    const NcPoint point = sim_drive_point(&c->drive, c->time_s);
    return seg_norm(seg_vec3(point.velocity[0], point.velocity[1], point.velocity[2]));
}

void sim_run_note(SimController *c, FbState state, GArray *actions)
{
    if (c->state == state)
        return;
    c->state = state;
    SimAction action = {.kind = SIM_STATE, .state = state, .time_s = c->time_s};
    g_array_append_val(actions, action);
}

void sim_run_tell(SimController *c, FbState state, FbMachineEvent event, GArray *actions)
{
    sim_run_note(c, state, actions);
    SimAction action = {.kind = SIM_TELL, .event = event, .time_s = c->time_s};
    g_array_append_val(actions, action);
}
