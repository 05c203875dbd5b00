/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Off a plan's speed and back to it, on the same path.
 *
 * A stretch's acceleration and jerk hold for every lower speed in it (cells.c), so whoever stays
 * below the plan with the least of them, over the stretches passed, keeps all limits. Coming back
 * is the planner's own second pass over the plan's stretches, from another begin; it ends where
 * speed and place are the plan's. Coming to rest at a place is the same with time turned round.
 */
#include "nc/motion/motion.h"

/* Speeds nearer than this are one, as shares of themselves. */
#define SAME_SPEED 1e-12
/* Places closer than this are one where the machine rests; a ramp may end so far behind one. */
#define SAME_MM 1e-8
#define FITS_MM 1e-9
#define REST_MM_S 1e-6
/* How many stretches are looked at first when a ramp is to meet the plan. */
#define AHEAD 64

static GArray *new_phases(void)
{
    return g_array_new(FALSE, FALSE, sizeof(NcPhase));
}

static void add(GArray *phases, double duration_s, NcAlong from, double jerk)
{
    NcPhase phase = {duration_s, from, jerk};
    if (duration_s > 0.0)
        g_array_append_val(phases, phase);
}

/* The stretch that a place is in: of two that meet there the later, unless it stands. */
static size_t stretch_of(const NcMotion *motion, double s_mm)
{
    size_t k = nc_motion_stretch_at_mm(motion, s_mm);
    return k + 1 == motion->n_stretches && k > 0 ? k - 1 : k;
}

static NcAlong plan_at(const NcMotion *motion, size_t k, double s_mm)
{
    const NcStretch *p = &motion->stretches[k];
    NcPhase phases[7];
    if (!(p->top > 0.0))
        return (NcAlong){s_mm, 0.0, 0.0};
    size_t n = nc_motion_phases(motion, k, phases), i = 0;
    while (i + 1 < n && phases[i + 1].from.s_mm <= s_mm)
        i++;
    return nc_phase_at(&phases[i], nc_phase_time_s(&phases[i], s_mm));
}

/* ------------------------------------------------------------------------- to the plan */

/* Bases on the way: `backwards` from a place to where the run begins, distances growing. */
static NcBase *bases_from(const NcMotion *motion, size_t k, double s, bool backwards, size_t most,
                          size_t *n)
{
    const NcStretch *p = motion->stretches;
    NcBase *bases = g_new(NcBase, most + 1);
    *n = 1;
    for (size_t i = 0; i < most; i++) {
        size_t way = backwards ? k - i : k + i, to = backwards ? way : way + 1;
        if (!(p[way].top > 0.0))
            break;
        bases[(*n)++] = (NcBase){fabs(p[to].s - s), p[to].v, p[way].top, p[way].rate};
        if (backwards && way == 0)
            break;
    }
    return bases;
}

/* The last stretch of a ramp: where it runs at the plan's own speed it ends already. */
static double meets(const NcStretch *ramp, double length, double v_end, const NcStretch *plan,
                    double plan_length, double other_end_v)
{
    double up = ramp->s + nc_ramp_mm(ramp->v, ramp->top, ramp->rate);
    double down = ramp->s + length - nc_ramp_mm(ramp->top, v_end, ramp->rate);
    double end = ramp->s + length;
    double begin = end - plan_length + nc_ramp_mm(other_end_v, plan->top, plan->rate);
    bool alike =
        ramp->top == plan->top && ramp->rate.a == plan->rate.a && ramp->rate.ij == plan->rate.ij;
    return alike && fmax(up, begin) <= down ? fmax(up, begin) : end;
}

/* Phases of the way from bases[0] until the plan is met, in distances from there. NULL: more bases
 * are needed. */
static GArray *climb(const NcMotion *motion, size_t k, bool backwards, const NcBase *bases,
                     size_t n, double *met)
{
    GArray *phases = new_phases();
    NcClimb climbing = nc_profile_climb(bases, n);
    NcStretch stretch;
    size_t end;
    double v_end;
    while (nc_profile_next(&climbing, &stretch, &end, &v_end)) {
        size_t way = backwards ? k - (end - 1) : k + (end - 1);
        const NcStretch *plan = &motion->stretches[way];
        double length = bases[end].s - stretch.s, stop = bases[end].s;
        bool back = v_end == bases[end].v;
        if (back)
            stop = meets(&stretch, length, v_end, plan, plan[1].s - plan->s,
                         backwards ? plan[1].v : plan->v);
        NcPhase parts[7];
        size_t m = nc_stretch_phases(&stretch, length, v_end, parts);
        for (size_t i = 0; i < m && stretch.s + parts[i].from.s_mm < stop; i++) {
            bool cut =
                stop < bases[end].s && (i + 1 == m || stretch.s + parts[i + 1].from.s_mm > stop);
            parts[i].from.s_mm += stretch.s;
            if (cut)
                parts[i].duration_s = nc_phase_time_s(&parts[i], stop);
            add(phases, parts[i].duration_s, parts[i].from, parts[i].jerk_mm_s3);
        }
        if (back) {
            *met = stop;
            return phases;
        }
    }
    g_array_unref(phases);
    return NULL;
}

static GArray *climb_from(const NcMotion *motion, size_t k, NcAlong from, bool backwards,
                          double *met)
{
    for (size_t most = AHEAD;; most *= 4) {
        size_t n;
        g_autofree NcBase *bases = bases_from(motion, k, from.s_mm, backwards, most, &n);
        bases[0] = (NcBase){.s = 0.0, .v = from.v_mm_s};
        if (n < 2)
            return NULL;
        if (bases[1].v < from.v_mm_s &&
            nc_ramp_mm(from.v_mm_s, bases[1].v, bases[1].rate) > bases[1].s)
            return NULL;
        GArray *phases = climb(motion, k, backwards, bases, n, met);
        if (phases || n <= most)
            return phases;
    }
}

/* Whether the plan rests there itself. */
static bool rests_near(const NcMotion *motion, size_t k, double s_mm, double *rest_mm)
{
    const NcStretch *p = motion->stretches;
    size_t next = k + 1 < motion->n_stretches ? k + 1 : k;
    for (size_t i = k > 0 ? k - 1 : 0; i <= next; i++)
        if (!(p[i].top > 0.0) && fabs(p[i].s - s_mm) <= SAME_MM) {
            *rest_mm = p[i].s;
            return true;
        }
    return false;
}

GArray *nc_motion_join(const NcMotion *motion, NcAlong from, double *met_mm)
{
    size_t k = stretch_of(motion, from.s_mm);
    NcAlong plan = plan_at(motion, k, from.s_mm);
    *met_mm = from.s_mm;
    if (rests_near(motion, k, from.s_mm, met_mm))
        return from.v_mm_s <= REST_MM_S ? new_phases() : NULL;
    if (from.v_mm_s > plan.v_mm_s * (1.0 + SAME_SPEED) ||
        (from.v_mm_s > 0.0 && !(motion->stretches[k].top > 0.0)))
        return NULL;
    bool there = from.v_mm_s >= plan.v_mm_s * (1.0 - SAME_SPEED);
    if (there && (!motion->smooth || plan.a_mm_s2 == 0.0))
        return new_phases();
    double met;
    GArray *phases = climb_from(motion, k, from, false, &met);
    for (guint i = 0; phases && i < phases->len; i++)
        g_array_index(phases, NcPhase, i).from.s_mm += from.s_mm;
    *met_mm += phases ? met : 0.0;
    return phases;
}

GArray *nc_motion_rest_at(const NcMotion *motion, double s_mm)
{
    size_t k = stretch_of(motion, s_mm);
    if (k > 0 && motion->stretches[k].s == s_mm)
        k--;
    double met;
    GArray *turned = NULL, *phases = new_phases();
    const NcStretch *p = &motion->stretches[k];
    if (p->top > 0.0 && !(p[1].s <= s_mm && p[1].v == 0.0))
        turned = climb_from(motion, k, (NcAlong){s_mm, 0.0, 0.0}, true, &met);
    for (guint i = turned ? turned->len : 0; i-- > 0;) {
        const NcPhase *phase = &g_array_index(turned, NcPhase, i);
        NcAlong end = nc_phase_at(phase, phase->duration_s);
        add(phases, phase->duration_s, (NcAlong){s_mm - end.s_mm, end.v_mm_s, -end.a_mm_s2},
            phase->jerk_mm_s3);
    }
    if (turned)
        g_array_unref(turned);
    return phases;
}

/* --------------------------------------------------------------------------- braking */

/* Without a limit of jerk: each stretch with its own acceleration. */
static GArray *brake_at_once(const NcMotion *motion, size_t k, NcAlong from, double v_to)
{
    GArray *phases = new_phases();
    double v = from.v_mm_s, s = from.s_mm;
    for (const NcStretch *p = &motion->stretches[k]; v > v_to && p->top > 0.0; p++) {
        double left = p[1].s - s, a = p->rate.a, d = (v * v - v_to * v_to) / (2.0 * a);
        bool ends = p[1].v == 0.0 && !(p[1].top > 0.0);
        double to = d <= left ? v_to : sqrt(fmax(v * v - 2.0 * a * left, 0.0));
        if (d > left && ends)
            to = 0.0;
        double way = fmin(d, left), duration = 2.0 * way / (v + to);
        if (way > 0.0)
            add(phases, duration, (NcAlong){s, v, (to - v) / duration}, 0.0);
        v = to;
        s = p[1].s;
        if (d <= left)
            break;
    }
    return phases;
}

/* Down from v to v_to, the acceleration being a at first; the distance and the speed at the end. */
static GArray *ramp_down(NcAlong from, double v_to, double ij, NcRate rate, double *length)
{
    GArray *phases = new_phases();
    NcAlong at = from;
    if (at.a_mm_s2 > 0.0) { /* with the jerk of where it is: the plan gains as much */
        add(phases, at.a_mm_s2 * ij, at, ij > 0.0 ? -1.0 / ij : 0.0);
        if (phases->len > 0)
            at = nc_phase_at(&g_array_index(phases, NcPhase, 0), at.a_mm_s2 * ij);
        at.a_mm_s2 = 0.0;
    }
    double a = -at.a_mm_s2, least = fmax(at.v_mm_s - 0.5 * a * a * rate.ij, 0.0);
    double to = fmin(v_to, least), dv = at.v_mm_s + 0.5 * a * a * rate.ij - to;
    double most = rate.ij > 0.0 ? fmin(rate.a, sqrt(dv / rate.ij)) : rate.a;
    double jerk = rate.ij > 0.0 ? 1.0 / rate.ij : 0.0;
    double hold = fmax(dv / most - most * rate.ij, 0.0);
    const double durations[3] = {(most - a) * rate.ij, hold, most * rate.ij};
    const double jerks[3] = {-jerk, 0.0, jerk};
    for (int i = 0; i < 3; i++) {
        at.a_mm_s2 = i == 0 ? -a : -most;
        if (!(durations[i] > 0.0))
            continue;
        add(phases, durations[i], at, jerks[i]);
        at = nc_phase_at(&g_array_index(phases, NcPhase, phases->len - 1), durations[i]);
    }
    *length = at.s_mm - from.s_mm;
    return phases;
}

static double speed_at(const GArray *phases, double s)
{
    for (guint i = 0; i < phases->len; i++) {
        const NcPhase *phase = &g_array_index(phases, NcPhase, i);
        if (i + 1 == phases->len || g_array_index(phases, NcPhase, i + 1).from.s_mm >= s)
            return nc_phase_at(phase, nc_phase_time_s(phase, s)).v_mm_s;
    }
    return 0.0;
}

/* One ramp down from here, if it stays below the plan. */
static GArray *brake_now(const NcMotion *motion, size_t k, NcAlong from, double v_to)
{
    const NcStretch *p = motion->stretches;
    NcRate rate = p[k].rate;
    double peak = from.v_mm_s + 0.5 * from.a_mm_s2 * fmax(from.a_mm_s2, 0.0) * rate.ij, length;
    for (size_t last = k; p[last].top > 0.0; last++) {
        rate = nc_rate_least(rate, p[last].rate);
        double release = fmin(from.a_mm_s2, 0.0);
        if (-from.a_mm_s2 > rate.a * (1.0 + 1e-9) ||
            0.5 * release * release * rate.ij > from.v_mm_s + SAME_MM ||
            (last > k && (from.a_mm_s2 < 0.0 || peak > p[k + 1].v)))
            return NULL;
        GArray *phases = ramp_down(from, v_to, p[k].rate.ij, rate, &length);
        bool fits = from.s_mm + length <= p[last + 1].s + FITS_MM, below = true;
        for (size_t i = k + 1; i <= last && below; i++)
            below =
                speed_at(phases, p[i].s) <= fmin(p[i].v, p[i + 1].v) || p[i].s > from.s_mm + length;
        if (fits && below)
            return phases;
        g_array_unref(phases);
        if (fits || !below)
            return NULL;
    }
    return NULL;
}

/* The plan from a place to the end of its stretch. */
static void follow(const NcMotion *motion, size_t k, NcAlong from, GArray *to)
{
    NcPhase phases[7];
    size_t n = nc_motion_phases(motion, k, phases);
    for (size_t i = 0; i < n; i++) {
        double end = i + 1 < n ? phases[i + 1].from.s_mm : motion->stretches[k + 1].s;
        if (end <= from.s_mm)
            continue;
        double skip = nc_phase_time_s(&phases[i], from.s_mm);
        add(to, phases[i].duration_s - skip, nc_phase_at(&phases[i], skip), phases[i].jerk_mm_s3);
    }
}

GArray *nc_motion_brake(const NcMotion *motion, NcAlong from, double v_to)
{
    size_t k = stretch_of(motion, from.s_mm);
    if (!motion->smooth)
        return brake_at_once(motion, k, from, v_to);
    NcAlong plan = plan_at(motion, k, from.s_mm);
    bool on_plan = fabs(plan.v_mm_s - from.v_mm_s) <= 1e-9 * plan.v_mm_s &&
                   fabs(plan.a_mm_s2 - from.a_mm_s2) <= 1e-6 * motion->stretches[k].rate.a;
    GArray *phases = new_phases();
    while (from.v_mm_s > v_to && motion->stretches[k].top > 0.0) {
        GArray *ramp = brake_now(motion, k, from, v_to);
        if (ramp) {
            g_array_append_vals(phases, ramp->data, ramp->len);
            g_array_unref(ramp);
            return phases;
        }
        if (!on_plan) {
            g_array_unref(phases);
            return NULL;
        }
        follow(motion, k, from, phases);
        k++;
        from = (NcAlong){motion->stretches[k].s, motion->stretches[k].v, 0.0};
    }
    return phases;
}

/* ---------------------------------------------------------------------------- level */

bool nc_motion_level(const NcMotion *motion, NcAlong from, NcPhase *phase)
{
    size_t k = stretch_of(motion, from.s_mm);
    double ij = 0.0, a = fabs(from.a_mm_s2);
    *phase = (NcPhase){0.0, from, 0.0};
    for (; motion->stretches[k].top > 0.0; k++) {
        ij = fmax(ij, motion->stretches[k].rate.ij);
        phase->duration_s = a * ij;
        phase->jerk_mm_s3 = ij > 0.0 ? copysign(1.0 / ij, -from.a_mm_s2) : 0.0;
        NcAlong end = nc_phase_at(phase, phase->duration_s);
        if (end.v_mm_s < 0.0)
            return false;
        const NcStretch *next = &motion->stretches[k + 1];
        if (end.s_mm <= next->s)
            return true;
        NcAlong border = nc_phase_at(phase, nc_phase_time_s(phase, next->s));
        if (border.v_mm_s > next->v * (1.0 + SAME_SPEED) || fabs(border.a_mm_s2) > next->rate.a)
            return false;
    }
    return from.v_mm_s == 0.0;
}
