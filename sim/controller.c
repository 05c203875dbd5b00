/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/controller.h"

#include <math.h>

#include "sim/ramp.h"

/* The machine stands where the program begins, but for rounding. */
#define SAME_PLACE_MM 1e-9

/* How the program's clock and the plan's are tied together. */
typedef enum {
    STAND,  /* the clock stands; stand_s of the move are done */
    FOLLOW, /* the plan at its own speed, offset_s later */
    RAMP,   /* between the two: along the pieces of `ramp` */
} Mode;

/* What a stop that is under way, or prepared, is for. */
typedef enum { NO_STOP, STOP_HELD, STOP_PROGRAM, STOP_ABORTED, STOP_ESTOP } Stop;

struct SimController {
    SimControllerOptions options;
    FbState state;
    int64_t now_us;
    uint64_t executed_blocks;
    SegVec3 position_mm; /* outside a run */
    int tool;
    double spindle_rpm;
    double time_s;    /* the program's clock */
    SimTotals totals; /* machine_s: of the runs that ended */

    SimProgram *program;
    SimProgram *approach; /* back to the program's beginning, before it; else NULL */
    bool in_run;
    Mode mode;
    size_t move; /* in execution, or next */
    double stand_s, offset_s;
    double budget_s; /* granted by the clock passed in, not yet used */
    double block_start_s;

    GArray *ramp; /* SimPiece; in RAMP, or prepared for stop_move; never NULL */
    guint piece;
    double piece_start_s;

    Stop stop;
    bool gate_wanted;   /* a hold at the next gate, once the plan's speed is reached */
    bool stop_prepared; /* FOLLOW until `ramp` begins; or, empty, to the end of stop_move */
    size_t stop_move;
};

static void advance(SimController *c, int64_t now_us, bool ticked, GArray *actions);
static double next_s(const SimController *c);
static void happen(SimController *c, GArray *actions);
static void finish_move(SimController *c, GArray *actions);
static void finish_piece(SimController *c, GArray *actions);
static void finish_block(SimController *c, const NcMove *last, GArray *actions);
static void start(SimController *c, GArray *actions);
static void begin_program(SimController *c, GArray *actions);
static SimProgram *approach_new(const SimController *c);
static void brake(SimController *c, Stop stop, GArray *actions);
static void prepare_gate_stop(SimController *c);
static void resume(SimController *c, GArray *actions);
static void follow(SimController *c, double move_s, GArray *actions);
static void stand(SimController *c, double move_s, GArray *actions);
static void stand_still(SimController *c);
static void end_run(SimController *c);
static void acknowledge(SimController *c, GArray *actions);
static void announce(SimController *c, GArray *actions);
static void note(SimController *c, FbState state, GArray *actions);
static void tell(SimController *c, FbState state, FbMachineEvent event, GArray *actions);
static const SimProgram *path(const SimController *c);
static SimPlace here(const SimController *c);
static double move_time_s(const SimController *c);
static SegVec3 position_mm(const SimController *c);

SimController *sim_controller_new(const SimControllerOptions *options)
{
    SimController *c = g_new0(SimController, 1);
    c->options = *options;
    c->state = FB_STATE_OFF;
    const double *at = options->machine->tool_change_mm;
    c->position_mm = seg_vec3(at[0], at[1], at[2]);
    c->ramp = g_array_new(FALSE, FALSE, sizeof(SimPiece));
    return c;
}

void sim_controller_free(SimController *c)
{
    if (!c)
        return;
    sim_program_free(c->program);
    sim_program_free(c->approach);
    g_array_unref(c->ramp);
    g_free(c);
}

void sim_controller_step(SimController *c, const SimEvent *event, int64_t now_us, GArray *actions)
{
    advance(c, now_us, event->kind == SIM_TICK, actions);
    switch (event->kind) {
    case SIM_TICK:
        break;
    case SIM_LOAD:
        g_assert(!c->in_run);
        sim_program_free(c->program);
        c->program = event->program;
        tell(c, FB_STATE_READY, FB_MACHINE_VERIFIED, actions);
        break;
    case SIM_FORGET:
        if (!c->in_run) {
            g_clear_pointer(&c->program, sim_program_free);
            note(c, FB_STATE_IDLE, actions);
        }
        break;
    case SIM_START:
        if (c->state == FB_STATE_READY || c->state == FB_STATE_COMPLETE)
            start(c, actions);
        break;
    case SIM_HOLD:
        if (c->mode != STAND && c->stop <= STOP_HELD) {
            note(c, FB_STATE_HOLDING, actions);
            brake(c, STOP_HELD, actions);
        }
        break;
    case SIM_HOLD_AT_GATE:
        if (c->mode != STAND && c->stop == NO_STOP) {
            c->gate_wanted = true;
            if (c->mode == FOLLOW)
                prepare_gate_stop(c);
        }
        break;
    case SIM_RESUME:
        if (c->in_run && c->stop <= STOP_HELD)
            resume(c, actions);
        break;
    case SIM_ABORT:
        if (c->in_run && c->stop != STOP_ESTOP) {
            note(c, FB_STATE_ABORTING, actions);
            brake(c, STOP_ABORTED, actions);
        }
        break;
    case SIM_ESTOP:
        tell(c, FB_STATE_ESTOP, FB_MACHINE_ESTOP, actions);
        if (c->in_run)
            brake(c, STOP_ESTOP, actions);
        break;
    case SIM_ACKNOWLEDGE:
        acknowledge(c, actions);
        break;
    }
}

bool sim_controller_moving(const SimController *c)
{
    return c->mode != STAND;
}

FbState sim_controller_state(const SimController *c)
{
    return c->state;
}

FbProgress sim_controller_progress(const SimController *c)
{
    SegVec3 at = position_mm(c);
    return (FbProgress){
        .line = c->in_run ? path(c)->moves[c->move].line : 0,
        .executed_blocks = c->executed_blocks,
        .tool = c->tool,
        .position_mm = {at.x, at.y, at.z},
        .feed_mm_min = c->in_run ? here(c).speed_mm_s * 60 : 0,
        .spindle_rpm = c->spindle_rpm,
        .program_time_ms = (uint32_t)fmin(c->time_s * 1000, UINT32_MAX),
    };
}

SimTotals sim_controller_totals(const SimController *c)
{
    SimTotals totals = c->totals;
    totals.machine_s += c->in_run ? c->time_s : 0;
    return totals;
}

/* Lets the program's clock run as far as the clock passed in grants, event by event. At speed
 * INFINITY only a tick lets it run, so that a command acts before the next move, not after it. */
static void advance(SimController *c, int64_t now_us, bool ticked, GArray *actions)
{
    double elapsed_s = (double)(now_us - c->now_us) * 1e-6;
    c->now_us = now_us;
    if (c->mode == STAND)
        return;
    bool bounded = isfinite(c->options.speed);
    if (!bounded && !ticked)
        return;
    c->budget_s += bounded ? elapsed_s * c->options.speed : 0;
    for (size_t i = 0; i < c->options.moves_per_step && c->mode != STAND; i++) {
        double next = next_s(c);
        if (bounded && next > c->time_s + c->budget_s) {
            c->time_s += c->budget_s;
            c->budget_s = 0;
            return;
        }
        if (bounded)
            c->budget_s -= next - c->time_s;
        c->time_s = fmax(c->time_s, next);
        happen(c, actions);
    }
}

/* The plan's time at which a prepared ramp leaves it; INFINITY unless on the move in execution. */
static double ramp_begins_s(const SimController *c)
{
    if (!c->stop_prepared || c->ramp->len == 0)
        return INFINITY;
    const SimPiece *first = &g_array_index(c->ramp, SimPiece, 0);
    const NcTimedMove *timed = &path(c)->timed[first->move];
    return first->move == c->move ? timed->start_s + sim_plan_time_s(timed, first->from_mm)
                                  : INFINITY;
}

/* When, on the program's clock, the next thing happens: a move's, a piece's or a ramp's turn. */
static double next_s(const SimController *c)
{
    if (c->mode == RAMP)
        return c->piece_start_s + g_array_index(c->ramp, SimPiece, c->piece).duration_s;
    const NcTimedMove *timed = &path(c)->timed[c->move];
    return fmin(timed->start_s + timed->duration_s, ramp_begins_s(c)) + c->offset_s;
}

static void set_ramp(SimController *c, GArray *ramp)
{
    g_array_unref(c->ramp);
    c->ramp = ramp;
}

static void begin_ramp(SimController *c)
{
    c->mode = RAMP;
    c->stop_prepared = false;
    c->piece = 0;
    c->piece_start_s = c->time_s;
}

static void happen(SimController *c, GArray *actions)
{
    if (c->mode == RAMP) {
        finish_piece(c, actions);
        return;
    }
    if (ramp_begins_s(c) + c->offset_s <= c->time_s) {
        begin_ramp(c);
        return;
    }
    bool stop_here = c->stop_prepared && c->ramp->len == 0 && c->stop_move == c->move;
    finish_move(c, actions);
    if (c->mode == STAND)
        return;
    if (stop_here)
        stand(c, 0, actions);
    else
        announce(c, actions);
}

static void finish_piece(SimController *c, GArray *actions)
{
    SimPiece piece = g_array_index(c->ramp, SimPiece, c->piece);
    c->piece_start_s = c->time_s;
    c->piece++;
    if (piece.ends_move)
        finish_move(c, actions);
    if (c->piece < c->ramp->len)
        return;
    double move_s = piece.ends_move ? 0 : sim_plan_time_s(&path(c)->timed[piece.move], piece.to_mm);
    if (c->stop != NO_STOP)
        stand(c, move_s, actions);
    else
        follow(c, move_s, actions);
}

/* Ends in STAND after M0 and at the program's end. */
static void finish_move(SimController *c, GArray *actions)
{
    const NcMove *move = &path(c)->moves[c->move];
    bool end = move->kind == NC_MOVE_END;
    c->tool = move->kind == NC_MOVE_TOOL_CHANGE ? move->tool : c->tool;
    c->spindle_rpm = move->spindle_rpm;
    c->move++;
    if (c->approach) {
        if (end)
            begin_program(c, actions);
        return;
    }
    if (end || move[1].line != move->line)
        finish_block(c, move, actions);
    if (end) {
        c->move--;
        end_run(c);
        c->totals.completed++;
        tell(c, FB_STATE_COMPLETE, FB_MACHINE_COMPLETE, actions);
    } else if (move->kind == NC_MOVE_STOP) {
        c->stop = STOP_PROGRAM;
        stand(c, 0, actions);
    }
}

static void finish_block(SimController *c, const NcMove *last, GArray *actions)
{
    bool fed = last->kind == NC_MOVE_FEED || last->kind == NC_MOVE_ARC;
    SimAction done = {.kind = SIM_BLOCK,
                      .time_s = c->time_s,
                      .block = {.line = last->line,
                                .kind = last->kind,
                                .start_s = c->block_start_s,
                                .end_s = c->time_s,
                                .position_mm = last->to,
                                .feed_mm_min = fed ? last->feed_mm_min : 0}};
    g_array_append_val(actions, done);
    c->executed_blocks++;
    c->block_start_s = c->time_s;
}

static void start(SimController *c, GArray *actions)
{
    c->in_run = true;
    c->totals.started++;
    c->time_s = 0;
    tell(c, FB_STATE_RUNNING, FB_MACHINE_RUNNING, actions);
    if (seg_distance(c->position_mm, c->program->moves[0].from) <= SAME_PLACE_MM) {
        begin_program(c, actions);
        return;
    }
    c->approach = approach_new(c);
    c->move = 0;
    follow(c, 0, actions);
}

static void begin_program(SimController *c, GArray *actions)
{
    g_clear_pointer(&c->approach, sim_program_free);
    c->move = 0;
    c->block_start_s = c->time_s;
    follow(c, 0, actions);
}

/* To the top of the travel, across, down: rapids that stop exactly. Whatever is clamped on the
 * table, and wherever tools are changed, no higher way leads over it. */
static SimProgram *approach_new(const SimController *c)
{
    SegVec3 from = c->position_mm, to = c->program->moves[0].from;
    double up = c->options.machine->axis[2].max_mm;
    const SegVec3 corners[] = {from, {from.x, from.y, up}, {to.x, to.y, up}, to, to};
    GArray *moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    for (size_t i = 1; i < G_N_ELEMENTS(corners); i++) {
        NcMove move = {.kind = i + 1 < G_N_ELEMENTS(corners) ? NC_MOVE_RAPID : NC_MOVE_END,
                       .from = corners[i - 1],
                       .to = corners[i],
                       .plane = 17,
                       .exact_stop = true};
        g_array_append_val(moves, move);
    }
    return sim_program_from_moves(moves, c->options.machine);
}

/* A tool change is finished before a hold or abort: half a change is no place to stand. */
static void brake(SimController *c, Stop stop, GArray *actions)
{
    c->stop = stop;
    c->gate_wanted = false;
    if (c->mode == FOLLOW && stop != STOP_ESTOP &&
        path(c)->moves[c->move].kind == NC_MOVE_TOOL_CHANGE) {
        g_array_set_size(c->ramp, 0);
        c->stop_prepared = true;
        c->stop_move = c->move;
        return;
    }
    double move_s = move_time_s(c);
    set_ramp(c, sim_ramp_stop(path(c), here(c)));
    if (c->ramp->len == 0)
        stand(c, move_s, actions);
    else
        begin_ramp(c);
}

/* Looks for the first gate in front of which the plan can still be left in time; without one the
 * program runs to its end. */
static void prepare_gate_stop(SimController *c)
{
    const SimProgram *program = path(c);
    double now_s = c->time_s - c->offset_s;
    for (size_t g = 0; g < program->n_gates; g++) {
        if (program->gates[g] <= c->move || program->gates[g] >= program->n)
            continue;
        size_t last = program->gates[g] - 1;
        set_ramp(c, sim_ramp_stop_at(program, last));
        c->stop_move = last;
        c->stop_prepared = true;
        if (c->ramp->len == 0)
            break;
        const SimPiece *first = &g_array_index(c->ramp, SimPiece, 0);
        const NcTimedMove *timed = &program->timed[first->move];
        if (timed->start_s + sim_plan_time_s(timed, first->from_mm) >= now_s)
            break;
        c->stop_prepared = false;
    }
    c->stop = c->stop_prepared ? STOP_HELD : NO_STOP;
}

static void resume(SimController *c, GArray *actions)
{
    c->stop = NO_STOP;
    c->stop_prepared = false;
    c->gate_wanted = false;
    if (c->mode == FOLLOW) {
        announce(c, actions);
        return;
    }
    double move_s = move_time_s(c);
    set_ramp(c, sim_ramp_resume(path(c), here(c)));
    tell(c, FB_STATE_RUNNING, FB_MACHINE_RUNNING, actions);
    if (c->ramp->len == 0)
        follow(c, move_s, actions);
    else
        begin_ramp(c);
}

static void follow(SimController *c, double move_s, GArray *actions)
{
    c->mode = FOLLOW;
    c->offset_s = c->time_s - (path(c)->timed[c->move].start_s + move_s);
    announce(c, actions);
    if (c->gate_wanted)
        prepare_gate_stop(c);
}

/* The stop has come to rest; the e-stop was told when it was pressed. */
static void stand(SimController *c, double move_s, GArray *actions)
{
    Stop stop = c->stop;
    stand_still(c);
    c->stand_s = move_s;
    switch (stop) {
    case STOP_ABORTED:
        end_run(c);
        c->totals.aborted++;
        tell(c, FB_STATE_READY, FB_MACHINE_ABORTED, actions);
        break;
    case STOP_ESTOP:
        end_run(c);
        c->totals.stopped++;
        break;
    case STOP_PROGRAM:
        tell(c, FB_STATE_PROGRAM_STOP, FB_MACHINE_PROGRAM_STOP, actions);
        break;
    default:
        tell(c, FB_STATE_HELD, FB_MACHINE_HELD, actions);
    }
}

static void stand_still(SimController *c)
{
    c->mode = STAND;
    c->stop = NO_STOP;
    c->stop_prepared = false;
    c->gate_wanted = false;
    c->budget_s = 0;
}

static void end_run(SimController *c)
{
    c->position_mm = position_mm(c);
    c->totals.machine_s += c->time_s;
    c->in_run = false;
    c->spindle_rpm = 0;
    stand_still(c);
    g_clear_pointer(&c->approach, sim_program_free);
}

/* Nobody can have seen to a machine that still brakes. */
static void acknowledge(SimController *c, GArray *actions)
{
    if (c->mode != STAND)
        return;
    FbState state = c->state;
    if (state == FB_STATE_OFF || state == FB_STATE_ESTOP)
        state = c->program ? FB_STATE_READY : FB_STATE_IDLE;
    tell(c, state, FB_MACHINE_ACKNOWLEDGED, actions);
}

/* RUNNING and TOOL_CHANGE, as the move in execution has it. */
static void announce(SimController *c, GArray *actions)
{
    bool change = path(c)->moves[c->move].kind == NC_MOVE_TOOL_CHANGE;
    if (change && c->state != FB_STATE_TOOL_CHANGE)
        tell(c, FB_STATE_TOOL_CHANGE, FB_MACHINE_TOOL_CHANGE, actions);
    else if (!change && c->state != FB_STATE_RUNNING)
        tell(c, FB_STATE_RUNNING, FB_MACHINE_RUNNING, actions);
}

static void note(SimController *c, FbState state, GArray *actions)
{
    if (c->state == state)
        return;
    c->state = state;
    SimAction action = {.kind = SIM_STATE, .state = state, .time_s = c->time_s};
    g_array_append_val(actions, action);
}

static void tell(SimController *c, FbState state, FbMachineEvent event, GArray *actions)
{
    note(c, state, actions);
    SimAction action = {.kind = SIM_TELL, .event = event, .time_s = c->time_s};
    g_array_append_val(actions, action);
}

static const SimProgram *path(const SimController *c)
{
    return c->approach ? c->approach : c->program;
}

static SimPlace here(const SimController *c)
{
    const NcTimedMove *timed = &path(c)->timed[c->move];
    if (c->mode == RAMP) {
        const SimPiece *piece = &g_array_index(c->ramp, SimPiece, c->piece);
        double t = c->time_s - c->piece_start_s, share = t / piece->duration_s;
        double speed = piece->from_mm_s + (piece->to_mm_s - piece->from_mm_s) * fmin(1, share);
        double at = piece->from_mm + (piece->from_mm_s + speed) / 2 * t;
        return (SimPlace){piece->move, fmin(at, piece->to_mm), speed};
    }
    double t = move_time_s(c);
    bool moves = c->mode == FOLLOW && sim_plan_moves(timed);
    return (SimPlace){c->move, sim_plan_distance_mm(timed, t),
                      moves ? nc_motion_speed_mm_s(timed, t) : 0};
}

/* Seconds of the plan done of the move in execution. */
static double move_time_s(const SimController *c)
{
    const NcTimedMove *timed = &path(c)->timed[c->move];
    switch (c->mode) {
    case STAND:
        return c->stand_s;
    case FOLLOW:
        return fmin(c->time_s - c->offset_s - timed->start_s, timed->duration_s);
    case RAMP:
        break;
    }
    return sim_plan_time_s(timed, here(c).at_mm);
}

static SegVec3 position_mm(const SimController *c)
{
    if (!c->in_run)
        return c->position_mm;
    return nc_motion_position(&path(c)->moves[c->move], &path(c)->timed[c->move], move_time_s(c));
}
