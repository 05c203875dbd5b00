/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Trapezoidal motion with look-ahead.
 *
 * Every move gets a speed and an acceleration along its path from the axes' limits; every corner
 * a speed; then one pass backwards and one forwards make neighbours fit, v² = v₀² + 2as.
 *
 * Corner: the circle that touches both moves and stays within the tolerance P of the corner has
 * the radius R = P·cos β / (1 − cos β), β half the angle by which the direction turns; it touches
 * them at R·tan β, which may be no more than half of the shorter move. The corner is passed at
 * v² = a·R (the rule of LinuxCNC's blend arcs, and of S. Jeon, "Improving Grbl: cornering
 * algorithm", 2011). The positions of the model stay on the programmed path.
 *
 * Arcs, and corners as the arcs they are, use √3/2 of the acceleration across the path, so that at
 * least half is left along it: the two together never exceed the axes' limits on an arc.
 */
#include "nc/motion/path.h"

#define ACROSS 0.86602540378443865 /* √3/2 */
/* Below this a kink is what decimal places leave of a tangent: passed with G61 too. */
#define TANGENT_RAD 1e-3
#define STRAIGHT_RAD 1e-9

typedef struct {
    double v_mm_s[3], a_mm_s2[3];
    double feed, rapid; /* shares of what is programmed, of what the axes can */
} Limits;

static void limit_move(const Limits *limits, const NcMove *move, NcTimedMove *timed);
static double corner_speed(const Limits *limits, const NcMove *before, const NcTimedMove *in,
                           const NcMove *after, const NcTimedMove *out);
static void fit_backwards(const NcMove *moves, NcTimedMove *timed, size_t n);
static void fit_forwards(const NcMove *moves, NcTimedMove *timed, size_t n);
static void set_times(const CfgMachine *machine, NcOverride override, double rpm,
                      const NcMove *moves, NcTimedMove *timed, size_t n);

NcTimedMove *nc_motion_plan(const CfgMachine *machine, const NcMove *moves, size_t n)
{
    return nc_motion_plan_override(machine, NC_NO_OVERRIDE, 0.0, moves, n);
}

/* Until the times are set, v_in is the limit at a move's start and v_max the limit within. */
NcTimedMove *nc_motion_plan_override(const CfgMachine *machine, NcOverride override,
                                     double spindle_rpm, const NcMove *moves, size_t n)
{
    NcTimedMove *timed = g_new0(NcTimedMove, n);
    Limits limits = {.feed = override.feed / 100.0, .rapid = override.rapid / 100.0};
    for (int axis = 0; axis < 3; axis++) {
        limits.v_mm_s[axis] = machine->axis[axis].max_mm_min / 60.0;
        limits.a_mm_s2[axis] = machine->axis[axis].max_mm_s2;
    }
    size_t before = n; /* the move that leads into this one; n: the machine stands */
    for (size_t i = 0; i < n; i++) {
        if (!nc_move_travels(&moves[i])) {
            before = n;
            continue;
        }
        limit_move(&limits, &moves[i], &timed[i]);
        if (timed[i].length_mm > 0.0) {
            if (before < n) {
                timed[i].v_in_mm_s =
                    corner_speed(&limits, &moves[before], &timed[before], &moves[i], &timed[i]);
            }
            before = i;
        }
    }
    fit_backwards(moves, timed, n);
    fit_forwards(moves, timed, n);
    set_times(machine, override, spindle_rpm, moves, timed, n);
    return timed;
}

/* The largest s with s·|amplitude| <= limit on every axis. */
static double scale_within(const double limit[3], SegVec3 amplitude)
{
    double scale = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        double share = fabs(nc_axis_value(amplitude, axis));
        if (share > 0.0)
            scale = fmin(scale, limit[axis] / share);
    }
    return scale;
}

/* In the plane of an arc the direction turns through both axes: the slower one counts. */
static void limit_arc(const Limits *limits, const NcMove *move, NcTimedMove *timed)
{
    NcArc arc = nc_arc(move);
    NcPlaneAxes axes = arc.axes;
    timed->length_mm = arc.length_mm;
    if (!(arc.length_mm > 0.0))
        return;
    double rise = fabs(arc.rise_mm) / arc.length_mm, along = sqrt(1.0 - rise * rise);
    double radius = fmin(arc.radius_from_mm, arc.radius_to_mm);
    double v_plane = fmin(limits->v_mm_s[axes.first], limits->v_mm_s[axes.second]);
    double a_plane = fmin(limits->a_mm_s2[axes.first], limits->a_mm_s2[axes.second]);
    double v = fmin(limits->feed * move->feed_mm_min / 60.0, v_plane / along);
    v = fmin(v, sqrt(ACROSS * a_plane * radius) / along);
    v = rise > 0.0 ? fmin(v, limits->v_mm_s[axes.normal] / rise) : v;
    double across = v * v * along * along / radius;
    double a = sqrt(a_plane * a_plane - across * across) / along;
    a = rise > 0.0 ? fmin(a, limits->a_mm_s2[axes.normal] / rise) : a;
    timed->v_max_mm_s = v;
    timed->a_mm_s2 = a;
}

static void limit_move(const Limits *limits, const NcMove *move, NcTimedMove *timed)
{
    if (move->kind == NC_MOVE_ARC) {
        limit_arc(limits, move, timed);
        return;
    }
    timed->length_mm = seg_distance(move->from, move->to);
    if (timed->length_mm > 0.0) {
        SegVec3 along = seg_scale(seg_sub(move->to, move->from), 1.0 / timed->length_mm);
        double v = scale_within(limits->v_mm_s, along);
        timed->v_max_mm_s = move->kind == NC_MOVE_RAPID
                                ? limits->rapid * v
                                : fmin(v, limits->feed * move->feed_mm_min / 60.0);
        timed->a_mm_s2 = scale_within(limits->a_mm_s2, along);
    }
}

static double corner_speed(const Limits *limits, const NcMove *before, const NcTimedMove *in,
                           const NcMove *after, const NcTimedMove *out)
{
    SegVec3 unused, u, w;
    nc_move_tangents(before, &unused, &u);
    nc_move_tangents(after, &w, &unused);
    SegVec3 sum = seg_add(u, w), difference = seg_sub(w, u);
    double sin_half = 0.5 * seg_norm(difference), cos_half = 0.5 * seg_norm(sum);
    double v = fmin(in->v_max_mm_s, out->v_max_mm_s);
    double tolerance = fmin(before->tolerance_mm, after->tolerance_mm);
    if (before->exact_stop || cos_half < STRAIGHT_RAD)
        return 0.0;
    if (2.0 * sin_half < (tolerance > 0.0 ? STRAIGHT_RAD : TANGENT_RAD))
        return v;
    double reach = 0.5 * fmin(in->length_mm, out->length_mm);
    double radius = fmin(tolerance * cos_half * (1.0 + cos_half) / (sin_half * sin_half),
                         reach * cos_half / sin_half);
    /* The acceleration turns in the plane of the two directions; `sum` and `difference` are
     * orthogonal and span it. */
    SegVec3 e = seg_scale(sum, 0.5 / cos_half), f = seg_scale(difference, 0.5 / sin_half);
    SegVec3 amplitude = {hypot(e.x, f.x), hypot(e.y, f.y), hypot(e.z, f.z)};
    double a = ACROSS * scale_within(limits->a_mm_s2, amplitude);
    return fmin(v, sqrt(a * radius));
}

static void fit_backwards(const NcMove *moves, NcTimedMove *timed, size_t n)
{
    double v_next = 0.0;
    for (size_t i = n; i-- > 0;) {
        NcTimedMove *t = &timed[i];
        if (!nc_move_travels(&moves[i])) {
            v_next = 0.0;
        } else if (t->length_mm > 0.0) {
            t->v_out_mm_s = v_next;
            double reachable = sqrt(v_next * v_next + 2.0 * t->a_mm_s2 * t->length_mm);
            t->v_in_mm_s = v_next = fmin(t->v_in_mm_s, reachable);
        }
    }
}

static void fit_forwards(const NcMove *moves, NcTimedMove *timed, size_t n)
{
    double v = 0.0;
    for (size_t i = 0; i < n; i++) {
        NcTimedMove *t = &timed[i];
        if (!nc_move_travels(&moves[i])) {
            v = 0.0;
        } else if (t->length_mm > 0.0) {
            t->v_in_mm_s = v;
            v = fmin(t->v_out_mm_s, sqrt(v * v + 2.0 * t->a_mm_s2 * t->length_mm));
            t->v_out_mm_s = v;
        }
    }
}

static double travel_time(NcTimedMove *t)
{
    double a = t->a_mm_s2, v_in = t->v_in_mm_s, v_out = t->v_out_mm_s;
    double peak = sqrt(a * t->length_mm + 0.5 * (v_in * v_in + v_out * v_out));
    peak = fmax(fmin(peak, t->v_max_mm_s), fmax(v_in, v_out));
    t->v_max_mm_s = peak;
    if (!(peak > 0.0))
        return 0.0;
    double ramps = (peak * peak - v_in * v_in + peak * peak - v_out * v_out) / (2.0 * a);
    return (2.0 * peak - v_in - v_out) / a + fmax(t->length_mm - ramps, 0.0) / peak;
}

double nc_override_rpm(const CfgMachine *machine, NcOverride override, double rpm)
{
    if (rpm == 0.0 || override.spindle == 100)
        return rpm;
    double least = fmin(machine->spindle_min_rpm, fabs(rpm));
    double most = fmax(machine->spindle_max_rpm, fabs(rpm));
    return copysign(fmax(least, fmin(most, fabs(rpm) * override.spindle / 100.0)), rpm);
}

static void set_times(const CfgMachine *machine, NcOverride override, double rpm,
                      const NcMove *moves, NcTimedMove *timed, size_t n)
{
    double now = 0.0, turns = nc_override_rpm(machine, override, rpm);
    for (size_t i = 0; i < n; i++) {
        NcTimedMove *t = &timed[i];
        t->start_s = now;
        if (t->length_mm > 0.0) {
            t->duration_s = travel_time(t);
        } else if (!nc_move_travels(&moves[i])) {
            double to = nc_override_rpm(machine, override, moves[i].spindle_rpm);
            if (to != turns)
                t->duration_s = fabs(to - turns) / machine->spindle_rpm_per_s;
            t->duration_s += moves[i].kind == NC_MOVE_DWELL         ? moves[i].dwell_s
                             : moves[i].kind == NC_MOVE_TOOL_CHANGE ? machine->tool_change_s
                                                                    : 0.0;
            turns = to;
        }
        now += t->duration_s;
    }
}
