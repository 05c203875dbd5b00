/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A motion plan: the moves are cut into runs from rest to rest; each run's corners are rounded
 * (blend.c), its limits found (cells.c), and its speed (profile.c).
 */
#include "nc/motion/motion.h"

/* Window of the blends where no jerk is limited: a few cycles of a controller. */
#define WINDOW_S 0.004

typedef struct {
    NcMotion *motion;
    const CfgMachine *machine;
    NcOverride override;
    NcLimits limits;
    NcRun run;
    size_t room; /* legs */
    NcBase *bases;
    size_t first; /* move of the run */
    double at_mm, now_s;
    double spindle_rpm; /* that turns */
    size_t stretch_room;
} Maker;

static void set_limits(Maker *m, const NcMove *moves, size_t n);
static void take(Maker *m, size_t i);
static bool stops_before(const Maker *m, const NcLeg *leg);
static void finish_run(Maker *m, size_t end);
static void stand(Maker *m, size_t i);
static void add_stretch(Maker *m, NcStretch stretch);

NcMotion *nc_motion_new(const CfgMachine *machine, NcOverride override, double spindle_rpm,
                        const NcMove *moves, size_t n)
{
    NcMotion *motion = g_new0(NcMotion, 1);
    *motion = (NcMotion){.moves = moves,
                         .n = n,
                         .end_mm = g_new0(double, n),
                         .half_mm = g_new0(double, n),
                         .start_s = g_new0(double, n + 1)};
    Maker m = {.motion = motion, .machine = machine, .override = override};
    set_limits(&m, moves, n);
    m.run = (NcRun){.limits = &m.limits, .moves = moves};
    m.spindle_rpm = nc_override_rpm(machine, override, spindle_rpm);
    add_stretch(&m, (NcStretch){0});
    for (size_t i = 0; i < n; i++)
        take(&m, i);
    finish_run(&m, n);
    motion->start_s[n] = m.now_s;
    motion->stretches = g_renew(NcStretch, motion->stretches, motion->n_stretches);
    g_free(m.run.legs);
    g_free(m.run.corners);
    g_free(m.run.turned);
    g_free(m.run.cells);
    g_free(m.bases);
    return motion;
}

void nc_motion_free(NcMotion *motion)
{
    if (!motion)
        return;
    g_free(motion->end_mm);
    g_free(motion->half_mm);
    g_free(motion->start_s);
    g_free(motion->forbidden);
    g_free(motion->stretches);
    g_free(motion);
}

static double inverse(double limit)
{
    return limit > 0.0 ? 1.0 / limit : 0.0;
}

static void set_limits(Maker *m, const NcMove *moves, size_t n)
{
    NcLimits *l = &m->limits;
    double window = 0.0;
    l->axes = 3;
    for (size_t i = 0; i < n && l->axes == 3; i++)
        for (int axis = 0; axis < 3; axis++)
            if (moves[i].from_deg[axis] != moves[i].to_deg[axis])
                l->axes = NC_AXES;
    for (int i = 0; i < 3; i++) {
        const CfgAxis *linear = &m->machine->axis[i];
        const CfgRotary *rotary = &m->machine->rotary[i];
        l->per_v[i] = inverse(linear->max_mm_min / 60.0);
        l->per_a[i] = inverse(linear->max_mm_s2);
        l->per_j[i] = inverse(linear->max_mm_s3);
        l->per_v[3 + i] = inverse(rotary->max_deg_min / 60.0);
        l->per_a[3 + i] = inverse(rotary->max_deg_s2);
        l->per_j[3 + i] = inverse(rotary->max_deg_s3);
    }
    for (int i = 0; i < l->axes; i++)
        if (l->per_j[i] > 0.0 && l->per_a[i] > 0.0) {
            l->smooth = true;
            window = fmax(window, l->per_j[i] / l->per_a[i]);
        }
    l->window_s = l->smooth ? window : WINDOW_S;
    m->motion->smooth = l->smooth;
    l->feed = m->override.feed / 100.0;
    l->rapid = m->override.rapid / 100.0;
}

/* -------------------------------------------------------------------------- legs */

static double spindle_rpm(const Maker *m, const NcMove *move)
{
    NcOverride override = move->spindle_override_off ? NC_NO_OVERRIDE : m->override;
    return nc_override_rpm(m->machine, override, move->spindle_rpm);
}

static double feed_share(const Maker *m, const NcMove *move)
{
    double share = move->feed_override_off ? 1.0 : m->limits.feed;
    if (move->feed_per_turn && move->spindle_rpm != 0.0)
        share *= spindle_rpm(m, move) / move->spindle_rpm;
    return share;
}

static NcLeg new_leg(const Maker *m, size_t i, double length)
{
    const NcMove *move = &m->motion->moves[i];
    NcLeg leg = {.move = i,
                 .length = length,
                 .programmed = INFINITY,
                 .share = 1.0,
                 .tolerance = move->tolerance_mm,
                 .round = move->kind == NC_MOVE_ARC};
    if (move->kind == NC_MOVE_RAPID)
        leg.share = m->limits.rapid;
    else
        leg.programmed = nc_track_feed(move, length);
    leg.feed = leg.programmed;
    if (move->kind != NC_MOVE_RAPID)
        leg.feed *= feed_share(m, move);
    leg.forbidden = !(leg.feed > 0.0 && leg.share > 0.0);
    leg.speed = leg.programmed;
    if (!leg.round) {
        NcTrack track = {.move = move, .length = length};
        nc_track_slope(&track, 0.0, leg.slope);
        for (int k = 0; k < m->limits.axes; k++)
            leg.speed = fmin(leg.speed, 1.0 / (fabs(leg.slope[k]) * m->limits.per_v[k]));
    }
    return leg;
}

static void make_room(Maker *m)
{
    NcRun *run = &m->run;
    if (run->n_legs < m->room)
        return;
    m->room = MAX(64, 2 * m->room);
    run->legs = g_renew(NcLeg, run->legs, m->room);
    run->corners = g_renew(NcCorner, run->corners, m->room);
    run->turned = g_renew(double, run->turned, m->room + 1);
    run->cells = g_renew(NcCell, run->cells, 4 * m->room);
    m->bases = g_renew(NcBase, m->bases, 8 * m->room + 1);
}

static void take(Maker *m, size_t i)
{
    NcMotion *motion = m->motion;
    const NcMove *move = &motion->moves[i];
    double length = nc_track_length(move);
    if (!nc_move_passes(move)) {
        finish_run(m, i);
        stand(m, i);
        return;
    }
    m->spindle_rpm = spindle_rpm(m, move); /* G96: it turns faster, or slower, on the way */
    if (!(length > 0.0)) {
        motion->end_mm[i] = m->at_mm + m->run.length;
        return;
    }
    NcLeg leg = new_leg(m, i, length);
    if (m->run.n_legs > 0 && stops_before(m, &leg))
        finish_run(m, i);
    if (leg.forbidden && !motion->forbidden)
        motion->forbidden = g_new0(guint8, motion->n);
    if (leg.forbidden)
        motion->forbidden[i] = 1;
    make_room(m);
    leg.start = m->run.length;
    m->run.legs[m->run.n_legs++] = leg;
    m->run.length += length;
    motion->end_mm[i] = m->at_mm + m->run.length;
}

static bool stops_before(const Maker *m, const NcLeg *leg)
{
    const NcLeg *last = &m->run.legs[m->run.n_legs - 1];
    const NcMove *a = &m->motion->moves[last->move], *b = &m->motion->moves[leg->move];
    if (a->exact_stop || a->kind == NC_MOVE_PROBE || b->kind == NC_MOVE_PROBE)
        return true;
    double out[NC_AXES], in[NC_AXES];
    NcTrack from = {.move = a, .length = last->length}, to = {.move = b, .length = leg->length};
    if (last->round)
        from = nc_track(a);
    if (leg->round)
        to = nc_track(b);
    nc_track_slope(&from, from.length, out);
    nc_track_slope(&to, 0.0, in);
    double sum = 0.0, difference = 0.0;
    for (int k = 0; k < m->limits.axes; k++) {
        sum += (out[k] + in[k]) * (out[k] + in[k]);
        difference += (out[k] - in[k]) * (out[k] - in[k]);
    }
    bool exact = fmin(last->tolerance, leg->tolerance) < NC_EXACT_MM;
    bool back = sum < NC_TANGENT_RAD * NC_TANGENT_RAD;
    return back || (exact && difference >= NC_TANGENT_RAD * NC_TANGENT_RAD);
}

/* -------------------------------------------------------------------------- runs */

/* From rest to rest over some of the run's cells. */
static void drive_cells(Maker *m, size_t first, size_t n_cells, double at, double length)
{
    NcRun part = m->run;
    part.cells += first;
    part.n_cells = n_cells;
    part.length = length;
    size_t n = nc_profile_bases(&part, m->bases), end;
    NcClimb climb = nc_profile_climb(m->bases, n);
    NcStretch stretch;
    double v_end;
    while (nc_profile_next(&climb, &stretch, &end, &v_end)) {
        double way = m->bases[end].s - stretch.s;
        stretch.s += m->at_mm + at;
        stretch.t = m->now_s;
        m->now_s += nc_stretch_s(&stretch, way, v_end);
        if (way > 0.0)
            add_stretch(m, stretch);
    }
    add_stretch(m, (NcStretch){.s = m->at_mm + at + length, .t = m->now_s});
}

/* The machine stands before a forbidden leg, and behind it; the path is the same. */
static void drive_run(Maker *m)
{
    NcRun *run = &m->run;
    nc_run_blend(run);
    nc_run_cells(run);
    double at = 0.0;
    for (size_t c = 0; c < run->n_cells;) {
        size_t first = c;
        double length = 0.0;
        bool forbidden = !(run->cells[c].v > 0.0);
        for (; c < run->n_cells && forbidden == !(run->cells[c].v > 0.0); c++)
            length += run->cells[c].length;
        if (c == run->n_cells)
            length = run->length - at;
        if (!forbidden)
            drive_cells(m, first, c - first, at, length);
        at += length;
    }
    for (size_t k = 0; k < run->n_corners; k++) {
        m->motion->half_mm[run->legs[run->corners[k].leg].move] = run->corners[k].half;
        m->motion->widest_mm = fmax(m->motion->widest_mm, run->corners[k].half);
    }
}

/* When the plan passes a place of a stretch. */
static double passed_s(const NcMotion *motion, size_t stretch, double s, const NcPhase *phases,
                       size_t n)
{
    double t = motion->stretches[stretch].t;
    size_t i = 0;
    for (; i + 1 < n && phases[i + 1].from.s_mm <= s; i++)
        t += phases[i].duration_s;
    return t + nc_phase_time_s(&phases[i], s);
}

/* Times of the moves from the run's first on; `end` is the first behind it. */
static void set_starts(Maker *m, size_t stretch, size_t end)
{
    NcMotion *motion = m->motion;
    const NcStretch *p = motion->stretches;
    NcPhase phases[7];
    size_t n = 0, of = motion->n_stretches;
    for (size_t i = m->first; i < end; i++) {
        double from = i > 0 ? motion->end_mm[i - 1] : 0.0, t;
        while (stretch + 1 < motion->n_stretches && p[stretch + 1].s <= from)
            stretch++;
        bool inside = p[stretch].top > 0.0 && from > p[stretch].s;
        if (inside && of != stretch) {
            n = nc_motion_phases(motion, stretch, phases);
            of = stretch;
        }
        t = inside ? passed_s(motion, stretch, from, phases, n) : p[stretch].t;
        motion->start_s[i] = i > 0 ? fmax(t, motion->start_s[i - 1]) : t;
    }
}

static void finish_run(Maker *m, size_t end)
{
    size_t stretch = m->motion->n_stretches;
    if (m->run.n_legs > 0) {
        drive_run(m);
        m->at_mm += m->run.length;
        set_starts(m, stretch > 0 ? stretch - 1 : 0, end);
    }
    for (size_t i = m->first; i < end && m->run.n_legs == 0; i++)
        m->motion->start_s[i] = m->now_s;
    m->first = end;
    m->run.n_legs = 0;
    m->run.length = 0.0;
}

static void add_stretch(Maker *m, NcStretch stretch)
{
    NcMotion *motion = m->motion;
    if (motion->n_stretches == m->stretch_room) {
        m->stretch_room = MAX(64, 2 * m->stretch_room);
        motion->stretches = g_renew(NcStretch, motion->stretches, m->stretch_room);
    }
    motion->stretches[motion->n_stretches++] = stretch;
}

static void stand(Maker *m, size_t i)
{
    NcMotion *motion = m->motion;
    const NcMove *move = &motion->moves[i];
    double turns = spindle_rpm(m, move);
    motion->end_mm[i] = m->at_mm;
    motion->start_s[i] = m->now_s;
    if (turns != m->spindle_rpm)
        m->now_s += fabs(turns - m->spindle_rpm) / m->machine->spindle_rpm_per_s;
    m->spindle_rpm = turns;
    if (move->kind == NC_MOVE_DWELL)
        m->now_s += move->dwell_s;
    else if (move->kind == NC_MOVE_TOOL_CHANGE)
        m->now_s += m->machine->tool_change_s;
    else if (move->kind == NC_MOVE_COOLANT)
        m->now_s += m->machine->coolant_s;
    else if (move->kind == NC_MOVE_ORIENT)
        m->now_s += m->machine->orient_s;
    m->first = i + 1;
}

double nc_override_rpm(const CfgMachine *machine, NcOverride override, double rpm)
{
    if (rpm == 0.0 || override.spindle == 100)
        return rpm;
    double least = fmin(machine->spindle_min_rpm, fabs(rpm));
    double most = fmax(machine->spindle_max_rpm, fabs(rpm));
    return copysign(fmax(least, fmin(most, fabs(rpm) * override.spindle / 100.0)), rpm);
}
