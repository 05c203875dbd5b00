/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How wide each blend is.
 *
 * Blends of near corners overlap: the sum of their shares is the path (nc/motion/kernel.h), so
 * chains of short moves are smoothed as a whole. The path leaves the programmed one by at most
 * Σ |Δd_j|·h_j·G(|s - s_j|/h_j), which is convex between corners, so greatest at a corner s_k.
 * Of the corners j that count there let J have the widest blend: all of them lie within 2·h_J of
 * it. So where every corner keeps
 *
 *     G(0)·h_j·Σ{|Δd_i| : |s_i - s_j| <= 2·h_j} <= P
 *
 * the path stays within P. The order of the blends' ends is that of the corners, so the slope
 * everywhere is a mean of slopes of the moves: no axis is faster than on one of them.
 */
#include "nc/motion/kernel.h"
#include "nc/motion/run.h"

/* G64 without P: corners may take half of the shorter move; where moves are shorter than a blend
 * this is the tolerance of their smoothing. */
#define LOOSE_MM 0.02
/* A hair less than half, so that two blends on one move never touch. */
#define HALF 0.4999995
/* Feed overrides should find the corners wide enough. */
#define SPARE 1.2

static void find_corner(NcRun *run, size_t leg);
static double widest(const NcRun *run, size_t corner);
static double within(const NcRun *run, size_t corner, double most, double tolerance);
static void keep_order(NcRun *run);

void nc_run_blend(NcRun *run)
{
    run->n_corners = 0;
    for (size_t k = 0; k + 1 < run->n_legs; k++)
        find_corner(run, k);
    run->turned[0] = 0.0;
    for (size_t k = 0; k < run->n_corners; k++)
        run->turned[k + 1] = run->turned[k] + run->corners[k].turned;
    for (size_t k = 0; k < run->n_corners; k++)
        run->corners[k].half = widest(run, k);
    keep_order(run);
}

void nc_run_jump(const NcRun *run, size_t leg, double slope[NC_AXES], double bend[NC_AXES])
{
    const NcLeg *a = &run->legs[leg], *b = a + 1;
    for (int i = 0; i < NC_AXES; i++)
        bend[i] = 0.0;
    if (!a->round && !b->round) {
        for (int i = 0; i < NC_AXES; i++)
            slope[i] = b->slope[i] - a->slope[i];
        return;
    }
    NcTrack from = nc_track(&run->moves[a->move]), to = nc_track(&run->moves[b->move]);
    double before[NC_AXES], bent[NC_AXES];
    nc_track_slope(&from, from.length, before);
    nc_track_slope(&to, 0.0, slope);
    nc_track_bend(&from, from.length, bent);
    nc_track_bend(&to, 0.0, bend);
    for (int i = 0; i < NC_AXES; i++) {
        slope[i] -= before[i];
        bend[i] -= bent[i];
    }
}

/* Lengths and degrees are no one length: the larger of the two counts. */
static double norm(const double v[NC_AXES])
{
    double mm = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    double deg = v[3] * v[3] + v[4] * v[4] + v[5] * v[5];
    return sqrt(fmax(mm, deg));
}

static void find_corner(NcRun *run, size_t leg)
{
    const NcLeg *a = &run->legs[leg], *b = a + 1;
    double slope[NC_AXES], bend[NC_AXES];
    nc_run_jump(run, leg, slope, bend);
    double turned = norm(slope);
    bool round = a->round || b->round;
    if (turned < NC_STRAIGHT_RAD && !round)
        return;
    run->corners[run->n_corners++] = (NcCorner){
        .leg = leg,
        .at = b->start,
        .turned = turned,
        .tolerance = fmax(fmin(a->tolerance, b->tolerance), NC_EXACT_MM),
        .barrier = round || a->programmed != b->programmed || a->tolerance != b->tolerance,
        .round = round};
}

/* The width at which the corner no longer slows the machine down. */
static double needed(const NcRun *run, const NcCorner *corner, const double slope[NC_AXES])
{
    const NcLimits *limits = run->limits;
    const NcLeg *a = &run->legs[corner->leg], *b = a + 1;
    double v = SPARE * fmin(a->speed, b->speed), for_a = 0.0, for_j = 0.0;
    for (int i = 0; i < limits->axes; i++) {
        for_a = fmax(for_a, fabs(slope[i]) * limits->per_a[i]);
        for_j = fmax(for_j, fabs(slope[i]) * limits->per_j[i]);
    }
    double h = v * v * for_a / NC_ACROSS;
    h = limits->smooth ? fmax(h, sqrt(v * v * v * for_j / NC_JERK_ACROSS)) : 0.5 * h;
    return fmax(h, v * limits->window_s);
}

static double widest(const NcRun *run, size_t k)
{
    const NcCorner *corner = &run->corners[k];
    const NcLeg *a = &run->legs[corner->leg], *b = a + 1;
    double slope[NC_AXES], bend[NC_AXES];
    nc_run_jump(run, corner->leg, slope, bend);
    bool bends = corner->round && run->limits->smooth && norm(bend) > 0.0;
    if (corner->turned < NC_STRAIGHT_RAD && !bends)
        return 0.0;
    double near = HALF * fmin(a->length, b->length), tolerance = corner->tolerance;
    double most = needed(run, corner, slope);
    if (bends) {
        tolerance *= 0.5;
        most = fmin(near, sqrt(fmin(tolerance, LOOSE_MM) / (NC_BEND_REACH * norm(bend))));
    }
    if (corner->barrier)
        most = fmin(most, near);
    most = fmin(most, fmin(corner->at, run->length - corner->at));
    if (isfinite(tolerance))
        return within(run, k, most, tolerance);
    return fmax(within(run, k, most, LOOSE_MM), fmin(most, near));
}

/* The turning at corners no further than `reach` from this one. */
static double turning(const NcRun *run, size_t k, double reach)
{
    const NcCorner *corners = run->corners;
    double first = corners[k].at - reach, last = corners[k].at + reach;
    size_t low = k, high = k + 1, step;
    for (step = 1; low >= step && corners[low - step].at >= first; step *= 2)
        low -= step;
    for (; step > 0; step /= 2)
        while (low >= step && corners[low - step].at >= first)
            low -= step;
    for (step = 1; high + step <= run->n_corners && corners[high + step - 1].at <= last; step *= 2)
        high += step;
    for (; step > 0; step /= 2)
        while (high + step <= run->n_corners && corners[high + step - 1].at <= last)
            high += step;
    return run->turned[high] - run->turned[low];
}

/* At least half of the widest blend that keeps the tolerance; all of it where corners are apart. */
static double within(const NcRun *run, size_t k, double most, double tolerance)
{
    double reach = run->limits->smooth ? NC_TRIANGLE_REACH : NC_BOX_REACH, sure = 0.0;
    for (double half = most; half > sure; half *= 0.5) {
        double turned = fmax(turning(run, k, 2.0 * half), run->corners[k].turned);
        if (reach * half * turned <= tolerance)
            return half;
        sure = fmax(sure, tolerance / (reach * turned));
    }
    return sure;
}

/* Blends may overlap, but not pass each other at either end, and none reaches into a barrier. */
static void keep_order(NcRun *run)
{
    NcCorner *c = run->corners;
    for (size_t k = 1; k < run->n_corners; k++) {
        double apart = c[k].at - c[k - 1].at;
        if (c[k].barrier)
            continue;
        c[k].half =
            fmin(c[k].half, c[k - 1].barrier ? apart - c[k - 1].half : apart + c[k - 1].half);
    }
    for (size_t k = run->n_corners; k-- > 1;) {
        double apart = c[k].at - c[k - 1].at;
        if (c[k - 1].barrier)
            continue;
        c[k - 1].half = fmin(c[k - 1].half, c[k].barrier ? apart - c[k].half : apart + c[k].half);
    }
}
