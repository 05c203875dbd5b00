/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/drive.h"

#include <math.h>

static bool meet(SimDrive *d, SimPlace place, double time_s);
static bool follow(SimDrive *d, double done, double time_s);
static void begin_ramp(SimDrive *d, bool stopping, double time_s);
static unsigned finish_move(SimDrive *d, double time_s);
static unsigned finish_piece(SimDrive *d, double time_s);
static double ramp_begins_s(const SimDrive *d);
static double passing_speed(const SimDrive *d);
static const NcTimedMove *timed_here(const SimDrive *d);
static void set_law(SimDrive *d, SimPlan *law);
static void set_ramp(SimDrive *d, GArray *ramp);

bool sim_drive_go(SimDrive *d, double time_s)
{
    if (!sim_travels(d->program, d->move))
        return follow(d, d->mode == SIM_STAND ? d->done : sim_drive_move_s(d, time_s), time_s);
    return meet(d, sim_drive_place(d, time_s), time_s);
}

/* By a ramp to the plan, unless the place is on it. */
static bool meet(SimDrive *d, SimPlace place, double time_s)
{
    if (!sim_ramp_above(d->program, d->plan, place))
        set_law(d, d->plan);
    set_ramp(d, sim_ramp_meet(d->program, d->law, d->plan, place));
    if (d->ramp->len == 0)
        return follow(d, place.at_mm, time_s);
    begin_ramp(d, false, time_s);
    return true;
}

void sim_drive_brake(SimDrive *d, double time_s)
{
    if (d->mode == SIM_STAND)
        return;
    GArray *ramp = sim_ramp_stop(d->program, d->law, sim_drive_place(d, time_s));
    if (ramp->len == 0)
        sim_drive_stand(d, time_s);
    set_ramp(d, ramp);
    if (ramp->len > 0)
        begin_ramp(d, true, time_s);
}

void sim_drive_replan(SimDrive *d, double time_s)
{
    const bool stands = d->mode == SIM_STAND;
    const bool path = sim_travels(d->program, d->move);
    const SimPlace place = stands || !path ? (SimPlace){0} : sim_drive_place(d, time_s);
    const double done_s = stands || path ? 0 : sim_drive_move_s(d, time_s);
    sim_plan_unref(d->plan);
    d->plan = sim_plan_ref(d->program->plan);
    if (stands)
        set_law(d, d->plan);
    else if (!path)
        follow(d, done_s, time_s);
    else if (!(d->mode == SIM_RAMP && d->stopping))
        meet(d, place, time_s);
}

bool sim_drive_prepare_stop(SimDrive *d, size_t move, double time_s)
{
    set_ramp(d, sim_ramp_stop_at(d->program, d->plan, move));
    d->stop_move = move;
    d->prepared = true;
    if (d->ramp->len > 0) {
        const SimPiece *first = &g_array_index(d->ramp, SimPiece, 0);
        const NcTimedMove *timed = &d->plan->timed[first->move];
        d->prepared =
            timed->start_s + sim_plan_time_s(timed, first->from_mm) >= time_s - d->offset_s;
    }
    return d->prepared;
}

void sim_drive_cancel_stop(SimDrive *d)
{
    d->prepared = false;
}

void sim_drive_delay(SimDrive *d, double delay_s)
{
    d->offset_s += delay_s;
}

/* On the plan, with so much of the move done as STAND counts it; false where it stands there. */
static bool follow(SimDrive *d, double done, double time_s)
{
    const NcTimedMove *timed = timed_here(d);
    set_law(d, d->plan);
    if (sim_plan_forbids(timed)) {
        d->mode = SIM_STAND;
        d->done = done;
        d->prepared = false;
        return false;
    }
    d->mode = SIM_FOLLOW;
    /* A plan of another override may give a spindle's change less time than it has had. */
    const double done_s =
        sim_plan_moves(timed) ? sim_plan_time_s(timed, done) : fmin(done, timed->duration_s);
    d->offset_s = time_s - (timed->start_s + done_s);
    return true;
}

static void begin_ramp(SimDrive *d, bool stopping, double time_s)
{
    d->mode = SIM_RAMP;
    d->stopping = stopping;
    d->prepared = false;
    d->piece = 0;
    d->piece_start_s = time_s;
}

void sim_drive_stand(SimDrive *d, double time_s)
{
    if (d->mode != SIM_STAND)
        d->done = sim_travels(d->program, d->move) ? sim_drive_place(d, time_s).at_mm
                  : d->move < d->program->n        ? fmax(0, sim_drive_move_s(d, time_s))
                                                   : 0;
    d->mode = SIM_STAND;
    d->prepared = false;
    set_law(d, d->plan);
}

/* ------------------------------------------------------------------------- the clock */

double sim_drive_next_s(const SimDrive *d)
{
    if (d->mode == SIM_RAMP)
        return d->piece_start_s + g_array_index(d->ramp, SimPiece, d->piece).duration_s;
    const NcTimedMove *timed = timed_here(d);
    return fmin(timed->start_s + timed->duration_s, ramp_begins_s(d)) + d->offset_s;
}

unsigned sim_drive_happen(SimDrive *d, double time_s)
{
    if (d->mode == SIM_RAMP)
        return finish_piece(d, time_s);
    if (ramp_begins_s(d) + d->offset_s > time_s)
        return finish_move(d, time_s);
    begin_ramp(d, true, time_s);
    return 0;
}

/* The plan's time at which a prepared ramp leaves it; INFINITY unless on the move in execution. */
static double ramp_begins_s(const SimDrive *d)
{
    if (!d->prepared || d->ramp->len == 0)
        return INFINITY;
    const SimPiece *first = &g_array_index(d->ramp, SimPiece, 0);
    const NcTimedMove *timed = &d->plan->timed[first->move];
    return first->move == d->move ? timed->start_s + sim_plan_time_s(timed, first->from_mm)
                                  : INFINITY;
}

/* Along the plan. What it forbids, and its end, it rests before. */
static unsigned finish_move(SimDrive *d, double time_s)
{
    const bool stop = d->prepared && d->ramp->len == 0 && d->stop_move == d->move;
    d->move++;
    if (stop || d->move >= d->program->n || sim_plan_forbids(timed_here(d)))
        sim_drive_stand(d, time_s);
    return SIM_MOVE_DONE | (stop ? SIM_AT_REST : 0);
}

static unsigned finish_piece(SimDrive *d, double time_s)
{
    const SimPiece piece = g_array_index(d->ramp, SimPiece, d->piece);
    const unsigned done = piece.ends_move ? SIM_MOVE_DONE : 0;
    d->piece_start_s = time_s;
    d->piece++;
    d->move += piece.ends_move;
    if (d->piece < d->ramp->len)
        return done;
    const double at_mm = piece.ends_move ? 0 : piece.to_mm;
    if (!d->stopping && d->move < d->program->n) {
        follow(d, at_mm, time_s);
        return done;
    }
    d->mode = SIM_STAND;
    d->done = at_mm;
    set_law(d, d->plan);
    return done | (d->stopping ? SIM_AT_REST : 0);
}

/* -------------------------------------------------------------------------- the place */

double sim_drive_move_s(const SimDrive *d, double time_s)
{
    const NcTimedMove *timed = timed_here(d);
    return fmin(time_s - d->offset_s - timed->start_s, timed->duration_s);
}

SimPlace sim_drive_place(const SimDrive *d, double time_s)
{
    const NcTimedMove *timed = timed_here(d);
    if (d->mode == SIM_STAND)
        return (SimPlace){d->move, sim_plan_moves(timed) ? d->done : 0, 0};
    if (d->mode == SIM_FOLLOW && !sim_plan_moves(timed))
        return (SimPlace){d->move, 0, passing_speed(d)};
    if (d->mode == SIM_FOLLOW) {
        const double t = sim_drive_move_s(d, time_s);
        return (SimPlace){d->move, sim_plan_distance_mm(timed, t), nc_motion_speed_mm_s(timed, t)};
    }
    const SimPiece *piece = &g_array_index(d->ramp, SimPiece, d->piece);
    const double t = time_s - d->piece_start_s;
    const double share = piece->duration_s > 0 ? fmin(1, t / piece->duration_s) : 1;
    const double speed = piece->from_mm_s + (piece->to_mm_s - piece->from_mm_s) * share;
    const double at = piece->from_mm + (piece->from_mm_s + speed) / 2 * t;
    return (SimPlace){piece->move, fmin(at, piece->to_mm), speed};
}

/* The speed at which the plan passes a place where no path is left: not 0 between two moves. */
static double passing_speed(const SimDrive *d)
{
    size_t i = d->move;
    while (sim_travels(d->program, i) && !sim_plan_moves(&d->plan->timed[i]))
        i++;
    return sim_travels(d->program, i) ? d->plan->timed[i].v_in_mm_s : 0;
}

SegVec3 sim_drive_position_mm(const SimDrive *d, double time_s)
{
    const NcMove *move = &d->program->moves[d->move];
    if (d->mode == SIM_FOLLOW)
        return nc_motion_position(move, timed_here(d), sim_drive_move_s(d, time_s));
    if (!sim_plan_moves(timed_here(d)))
        return move->from;
    return nc_move_point(move, sim_drive_place(d, time_s).at_mm / timed_here(d)->length_mm);
}

static const NcTimedMove *timed_here(const SimDrive *d)
{
    return &d->plan->timed[d->move];
}

/* ------------------------------------------------------------------------- ownership */

void sim_drive_init(SimDrive *d)
{
    *d = (SimDrive){.ramp = g_array_new(FALSE, FALSE, sizeof(SimPiece))};
}

void sim_drive_clear(SimDrive *d)
{
    sim_drive_leave(d);
    g_array_unref(d->ramp);
}

void sim_drive_enter(SimDrive *d, SimProgram *program, size_t move)
{
    sim_program_ref(program);
    sim_program_unref(d->program);
    d->program = program;
    sim_plan_ref(program->plan);
    sim_plan_unref(d->plan);
    d->plan = program->plan;
    set_law(d, d->plan);
    d->mode = SIM_STAND;
    d->move = move;
    d->done = 0;
    d->prepared = false;
}

void sim_drive_leave(SimDrive *d)
{
    g_clear_pointer(&d->program, sim_program_unref);
    g_clear_pointer(&d->plan, sim_plan_unref);
    g_clear_pointer(&d->law, sim_plan_unref);
    d->mode = SIM_STAND;
    d->prepared = false;
}

static void set_law(SimDrive *d, SimPlan *law)
{
    sim_plan_ref(law);
    sim_plan_unref(d->law);
    d->law = law;
}

static void set_ramp(SimDrive *d, GArray *ramp)
{
    g_array_unref(d->ramp);
    d->ramp = ramp;
}
