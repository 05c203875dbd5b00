/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/drive.h"

#include <math.h>

/* Places closer than this are one: far above rounding, far below what any machine resolves. */
#define SAME_MM 1e-9
/* Speeds that are tried on the way down to a slower plan. */
#define TRIALS 32
#define HALVINGS 45

static bool to_plan(SimDrive *d, NcAlong from, double time_s);
static bool follow(SimDrive *d, double time_s);
static bool follow_from(SimDrive *d, double at_mm, double time_s);
static void begin_detour(SimDrive *d, GArray *detour, double time_s);
static unsigned finish_move(SimDrive *d, double time_s);
static unsigned finish_phase(SimDrive *d, double time_s);
static unsigned finish_detour(SimDrive *d, double time_s);
static double detour_begins_s(const SimDrive *d);
static NcAlong along(const SimDrive *d, double time_s);
static bool on_path(const SimDrive *d);
static double begin_mm(const SimDrive *d);
static void set_law(SimDrive *d, SimPlan *law, guint phases);
static void take_newest_plan(SimDrive *d);

bool sim_drive_go(SimDrive *d, double time_s)
{
    d->stop_wanted = false;
    if (!on_path(d))
        return follow(d, time_s);
    if (d->mode == SIM_STAND && nc_motion_forbids(d->plan->motion, d->move))
        return false;
    bool was_detour = d->mode == SIM_DETOUR;
    if (to_plan(d, along(d, time_s), time_s))
        return d->mode != SIM_STAND;
    d->stopping = false; /* to rest first; then whoever drives sets off again */
    return was_detour;
}

static GArray *joined(GArray *first, const GArray *second)
{
    g_array_append_vals(first, second->data, second->len);
    return first;
}

static NcAlong end_of(const GArray *phases, NcAlong from)
{
    if (phases->len == 0)
        return from;
    const NcPhase *last = &g_array_index(phases, NcPhase, phases->len - 1);
    NcAlong end = nc_phase_at(last, last->duration_s);
    end.a_mm_s2 = 0;
    end.v_mm_s = end.v_mm_s > SAME_MM ? end.v_mm_s : 0;
    return end;
}

static const NcMotion *law_at(const SimDrive *d)
{
    bool other = d->mode == SIM_DETOUR && d->phase < d->law_phases;
    return (other ? d->law : d->plan)->motion;
}

/* Brakes to a speed and goes on to the plan from there; NULL where it would still be too fast. */
static GArray *by_way_of(SimDrive *d, const NcMotion *law, NcAlong from, double v, guint *braking,
                         double *met)
{
    g_autoptr(GArray) brake = nc_motion_brake(law, from, v);
    if (!brake)
        return NULL;
    g_autoptr(GArray) join = nc_motion_join(d->plan->motion, end_of(brake, from), met);
    *braking = brake->len;
    return join ? joined(g_steal_pointer(&brake), join) : NULL;
}

/* As fast as may be: between a speed that will do and one that will not, halves the rest. */
static GArray *down_to_plan(SimDrive *d, const NcMotion *law, NcAlong from, guint *braking,
                            double *met)
{
    GArray *best = NULL;
    double low = 0, high = from.v_mm_s;
    for (int i = TRIALS - 1; i >= 0 && !best; i--) {
        double v = from.v_mm_s * i / TRIALS;
        best = by_way_of(d, law, from, v, braking, met);
        *(best ? &low : &high) = v;
    }
    for (int i = 0; best && i < HALVINGS; i++) {
        double v = (low + high) / 2, there;
        guint n;
        GArray *other = by_way_of(d, law, from, v, &n, &there);
        *(other ? &low : &high) = v;
        if (!other)
            continue;
        g_array_unref(best);
        best = other;
        *braking = n;
        *met = there;
    }
    return best;
}

/* A detour from any place and speed to the plan, or to rest where there is none. False: not now. */
static bool to_plan(SimDrive *d, NcAlong from, double time_s)
{
    const NcMotion *law = law_at(d);
    NcPhase level;
    const bool levels = nc_motion_level(law, from, &level);
    GArray *detour = g_array_new(FALSE, FALSE, sizeof(NcPhase));
    guint braking = 0;
    double met = from.s_mm;
    bool forbidden = nc_motion_forbids(d->plan->motion, d->move), to_rest = false;
    if (levels && level.duration_s > 0)
        g_array_append_val(detour, level);
    GArray *join =
        forbidden || !levels ? NULL : nc_motion_join(d->plan->motion, end_of(detour, from), &met);
    if (join) {
        joined(detour, join);
        g_array_unref(join);
    } else {
        g_array_unref(detour);
        if (d->mode == SIM_DETOUR && d->stopping)
            return false;
        detour = forbidden ? NULL : down_to_plan(d, law, from, &braking, &met);
        to_rest = !detour;
        if (!detour)
            detour = nc_motion_brake(law, from, 0);
        if (!detour)
            return false;
        braking = to_rest ? detour->len : braking;
    }
    d->to_rest = to_rest;
    if (detour->len == 0) {
        g_array_unref(detour);
        return follow_from(d, met, time_s);
    }
    d->stopping = false;
    d->met_mm = met;
    begin_detour(d, detour, time_s);
    d->law_phases = braking;
    return true;
}

void sim_drive_brake(SimDrive *d, double time_s)
{
    if (d->mode == SIM_STAND)
        return;
    if (!on_path(d)) {
        sim_drive_stand(d, time_s);
        return;
    }
    if (d->mode == SIM_DETOUR && d->stopping)
        return;
    const NcMotion *law = law_at(d);
    SimPlan *of = law == d->plan->motion ? d->plan : d->law;
    GArray *detour = nc_motion_brake(law, along(d, time_s), 0);
    if (!detour) {
        d->stop_wanted = true;
        return;
    }
    if (detour->len == 0) {
        g_array_unref(detour);
        sim_drive_stand(d, time_s);
        return;
    }
    set_law(d, of, detour->len);
    begin_detour(d, detour, time_s);
    d->stopping = true;
    d->to_rest = true;
}

static void take_newest_plan(SimDrive *d)
{
    sim_plan_unref(d->plan);
    d->plan = sim_plan_ref(d->program->plan);
}

void sim_drive_replan(SimDrive *d, double time_s)
{
    if (d->mode == SIM_STAND || !on_path(d)) {
        if (d->mode == SIM_FOLLOW)
            d->done_s = sim_drive_move_s(d, time_s);
        take_newest_plan(d);
        set_law(d, d->plan, 0);
        if (d->mode == SIM_FOLLOW)
            follow(d, time_s);
        return;
    }
    const NcAlong from = along(d, time_s);
    SimPlan *old = sim_plan_ref(d->plan);
    if (d->mode == SIM_FOLLOW) { /* until a detour is found the place is on the old plan */
        set_law(d, old, 1);
        d->mode = SIM_DETOUR;
        d->phase = 0;
        d->stopping = false;
        g_array_set_size(d->detour, 0);
    } else if (law_at(d) == old->motion) {
        set_law(d, old, d->detour->len);
    }
    take_newest_plan(d);
    if (!d->stopping && !to_plan(d, from, time_s)) {
        sim_plan_unref(d->plan); /* not before the detour is over */
        d->plan = sim_plan_ref(old);
        d->plan_wanted = true;
    }
    sim_plan_unref(old);
}

/* The plan's time at which a detour to the end of `stop_move` leaves it: not while it stands there
 * for moves before. */
static double leaves_s(const SimDrive *d, double at_mm)
{
    const NcMotion *motion = d->plan->motion;
    size_t move = d->stop_move;
    while (move > d->move && nc_motion_end_mm(motion, move - 1) > at_mm + SAME_MM)
        move--;
    return fmax(nc_motion_time_s(motion, at_mm), nc_motion_start_s(motion, move));
}

bool sim_drive_prepare_stop(SimDrive *d, size_t move, double time_s)
{
    const NcMotion *motion = d->plan->motion;
    GArray *detour = nc_motion_rest_at(motion, nc_motion_end_mm(motion, move));
    g_array_unref(d->detour);
    d->detour = detour;
    d->stop_move = move;
    d->prepared = true;
    if (detour->len > 0) {
        d->leaves_s = leaves_s(d, g_array_index(detour, NcPhase, 0).from.s_mm);
        d->prepared = d->leaves_s + d->offset_s >= time_s;
    }
    return d->prepared;
}

void sim_drive_cancel_stop(SimDrive *d)
{
    d->prepared = false;
    d->stop_wanted = false;
}

void sim_drive_delay(SimDrive *d, double delay_s)
{
    d->offset_s += delay_s;
}

static double start_s(const SimDrive *d, size_t move)
{
    return nc_motion_start_s(d->plan->motion, move);
}

/* On the plan, `done_s` of a move that is no path; false where that is forbidden. */
static bool follow(SimDrive *d, double time_s)
{
    set_law(d, d->plan, 0);
    d->mode = SIM_FOLLOW;
    /* A plan of another override may give a spindle's change less time than it has had. */
    double done_s = fmin(d->done_s, nc_motion_duration_s(d->plan->motion, d->move));
    d->offset_s = time_s - (start_s(d, d->move) + done_s);
    return true;
}

static bool follow_from(SimDrive *d, double at_mm, double time_s)
{
    set_law(d, d->plan, 0);
    if (nc_motion_forbids(d->plan->motion, d->move)) {
        d->mode = SIM_STAND;
        d->at_mm = at_mm;
        d->prepared = false;
        return false;
    }
    d->mode = SIM_FOLLOW;
    double at_s = nc_motion_time_s(d->plan->motion, at_mm);
    at_s = fmax(start_s(d, d->move), fmin(at_s, start_s(d, d->move + 1)));
    d->offset_s = time_s - at_s;
    return true;
}

static void begin_detour(SimDrive *d, GArray *detour, double time_s)
{
    g_array_unref(d->detour);
    d->detour = detour;
    d->mode = SIM_DETOUR;
    d->prepared = d->stop_wanted = d->plan_wanted = false;
    d->phase = 0;
    d->phase_start_s = time_s;
}

void sim_drive_stand(SimDrive *d, double time_s)
{
    if (d->mode != SIM_STAND && d->move < d->program->n) {
        if (on_path(d))
            d->at_mm = along(d, time_s).s_mm;
        else
            d->done_s = fmax(0, sim_drive_move_s(d, time_s));
    }
    d->mode = SIM_STAND;
    d->prepared = d->stop_wanted = d->plan_wanted = false;
    set_law(d, d->plan, 0);
}

/* ------------------------------------------------------------------------- the clock */

static const NcPhase *phase_here(const SimDrive *d)
{
    return &g_array_index(d->detour, NcPhase, d->phase);
}

/* Whether the move in execution ends within the phase; then after how long of it. */
static bool ends_in_phase(const SimDrive *d, double *after_s)
{
    if (d->move >= d->program->n || !on_path(d))
        return false;
    const NcPhase *phase = phase_here(d);
    double end = nc_motion_end_mm(d->plan->motion, d->move);
    if (end > nc_phase_at(phase, phase->duration_s).s_mm + SAME_MM)
        return false;
    *after_s = fmin(nc_phase_time_s(phase, end), phase->duration_s);
    return true;
}

double sim_drive_next_s(const SimDrive *d)
{
    if (d->mode == SIM_DETOUR) {
        double after_s = phase_here(d)->duration_s;
        ends_in_phase(d, &after_s);
        return d->phase_start_s + after_s;
    }
    return fmin(start_s(d, d->move + 1), detour_begins_s(d)) + d->offset_s;
}

unsigned sim_drive_happen(SimDrive *d, double time_s)
{
    if (d->mode == SIM_DETOUR)
        return finish_phase(d, time_s);
    if (start_s(d, d->move + 1) <= detour_begins_s(d))
        return finish_move(d, time_s);
    GArray *detour = g_array_ref(d->detour);
    set_law(d, d->plan, 0);
    begin_detour(d, detour, time_s);
    d->stopping = d->to_rest = true;
    return 0;
}

/* The plan's time at which a prepared detour leaves it. */
static double detour_begins_s(const SimDrive *d)
{
    return d->prepared && d->detour->len > 0 ? d->leaves_s : INFINITY;
}

/* The move is over; the next one's time begins. */
static void next_move(SimDrive *d)
{
    d->at_mm = nc_motion_end_mm(d->plan->motion, d->move);
    d->done_s = 0;
    d->move++;
}

/* Along the plan. What it forbids, and its end, it rests before. */
static unsigned finish_move(SimDrive *d, double time_s)
{
    const bool stop = d->prepared && d->detour->len == 0 && d->stop_move == d->move;
    next_move(d);
    if (stop || d->move >= d->program->n || nc_motion_forbids(d->plan->motion, d->move)) {
        d->mode = SIM_STAND;
        sim_drive_stand(d, time_s);
    }
    return SIM_MOVE_DONE | (stop ? SIM_AT_REST : 0);
}

static unsigned finish_phase(SimDrive *d, double time_s)
{
    double after_s;
    if (ends_in_phase(d, &after_s) && d->phase_start_s + after_s <= time_s) {
        bool last = d->phase + 1 == d->detour->len && d->to_rest;
        next_move(d);
        if (last && (d->move >= d->program->n || !on_path(d)))
            return SIM_MOVE_DONE | finish_detour(d, time_s);
        return SIM_MOVE_DONE;
    }
    d->phase_start_s += phase_here(d)->duration_s;
    d->phase++;
    return d->phase < d->detour->len ? 0 : finish_detour(d, time_s);
}

static unsigned finish_detour(SimDrive *d, double time_s)
{
    const bool stopping = d->stopping, stop = d->stop_wanted, plan = d->plan_wanted;
    d->stop_wanted = d->plan_wanted = false;
    if (d->to_rest) {
        if (d->move < d->program->n && on_path(d) && d->phase >= d->detour->len)
            d->at_mm = end_of(d->detour, (NcAlong){0}).s_mm;
        d->mode = SIM_STAND;
        if (plan)
            take_newest_plan(d);
        sim_drive_stand(d, time_s);
        return stopping || stop ? SIM_AT_REST : 0;
    }
    if (d->move >= d->program->n) {
        d->mode = SIM_STAND;
    } else if (on_path(d)) {
        follow_from(d, d->met_mm, time_s);
    } else {
        follow(d, time_s);
    }
    if (plan && d->move < d->program->n)
        sim_drive_replan(d, time_s);
    if (stop && d->mode != SIM_STAND)
        sim_drive_brake(d, time_s);
    return stop && d->mode == SIM_STAND ? SIM_AT_REST : 0;
}

/* -------------------------------------------------------------------------- the place */

double sim_drive_move_s(const SimDrive *d, double time_s)
{
    return fmin(time_s - d->offset_s - start_s(d, d->move),
                nc_motion_duration_s(d->plan->motion, d->move));
}

static double begin_mm(const SimDrive *d)
{
    return d->move > 0 ? nc_motion_end_mm(d->plan->motion, d->move - 1) : 0;
}

static NcAlong along(const SimDrive *d, double time_s)
{
    if (d->mode == SIM_STAND)
        return (NcAlong){d->at_mm, 0, 0};
    if (d->mode == SIM_FOLLOW) {
        /* Another move may begin at the same time, and elsewhere where one between is forbidden. */
        NcAlong at = nc_motion_along(d->plan->motion, time_s - d->offset_s);
        const double end = nc_motion_end_mm(d->plan->motion, d->move), begin = begin_mm(d);
        if (!on_path(d) || at.s_mm > end + SAME_MM || at.s_mm < begin - SAME_MM)
            return (NcAlong){at.s_mm < begin ? begin : end, 0, 0};
        return at;
    }
    const NcPhase *phase = phase_here(d);
    return nc_phase_at(phase, fmax(0, fmin(time_s - d->phase_start_s, phase->duration_s)));
}

NcPoint sim_drive_point(const SimDrive *d, double time_s)
{
    NcAlong at = along(d, time_s);
    if (d->mode == SIM_STAND && !on_path(d))
        at.s_mm = nc_motion_end_mm(d->plan->motion, d->move);
    return nc_motion_point(d->plan->motion, d->move, at);
}

double sim_drive_part(const SimDrive *d)
{
    if (!d->program || d->mode != SIM_STAND || !on_path(d))
        return 0;
    double start = begin_mm(d), length = nc_motion_end_mm(d->plan->motion, d->move) - start;
    return length > 0 ? fmax(0, fmin(1, (d->at_mm - start) / length)) : 0;
}

static bool on_path(const SimDrive *d)
{
    return d->move < d->program->n && nc_move_passes(&d->program->moves[d->move]);
}

/* ------------------------------------------------------------------------- ownership */

void sim_drive_init(SimDrive *d)
{
    *d = (SimDrive){.detour = g_array_new(FALSE, FALSE, sizeof(NcPhase))};
}

void sim_drive_clear(SimDrive *d)
{
    sim_drive_leave(d);
    g_array_unref(d->detour);
}

void sim_drive_enter(SimDrive *d, SimProgram *program, size_t move)
{
    sim_program_ref(program);
    sim_program_unref(d->program);
    d->program = program;
    sim_plan_ref(program->plan);
    sim_plan_unref(d->plan);
    d->plan = program->plan;
    set_law(d, d->plan, 0);
    d->mode = SIM_STAND;
    d->move = move;
    d->done_s = 0;
    d->at_mm = begin_mm(d);
    d->prepared = d->stop_wanted = d->plan_wanted = false;
}

void sim_drive_leave(SimDrive *d)
{
    g_clear_pointer(&d->program, sim_program_unref);
    g_clear_pointer(&d->plan, sim_plan_unref);
    g_clear_pointer(&d->law, sim_plan_unref);
    d->mode = SIM_STAND;
    d->prepared = d->stop_wanted = d->plan_wanted = false;
}

static void set_law(SimDrive *d, SimPlan *law, guint phases)
{
    sim_plan_ref(law);
    sim_plan_unref(d->law);
    d->law = law;
    d->law_phases = phases;
}
