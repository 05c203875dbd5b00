/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Limits along the path. With speed v, acceleration a and jerk j along s an axis has
 *
 *     velocity      p'·v
 *     acceleration  p''·v² + p'·a
 *     jerk          p'''·v³ + 3·p''·v·a + p'·j
 *
 * In a cell |p'|, |p''|, |p'''| of every axis are bounded; v is limited so that turning takes at
 * most √3/2 of the acceleration and half of the jerk, a so that the two accelerations together
 * stay within the axis', and the middle term within a quarter of the jerk; j gets what is left.
 * All three hold for lower speeds too: whoever stays below the cell's v, a and j keeps the limits.
 * On an arc the directions are known: √3/2 across and 1/2 along make one.
 *
 * The blends' shares change where one begins, has its corner, or ends; a walk over these places
 * carries the sums of them.
 */
#include "nc/motion/run.h"

#define JERK_CROSS 0.25
/* Cells are joined where their limits are this near. */
#define ALIKE 0.95
/* Beyond half its height the bend's blend overshoots by 1/16 (nc/motion/kernel.h). */
#define BEND_OVER (17.0 / 16.0)
#define BEND_STEEP 1.5

/* Bounds of an axis' derivatives. */
typedef struct {
    double d1[NC_AXES], d2[NC_AXES], d3[NC_AXES];
} Bounds;

typedef struct {
    NcRun *run;
    size_t leg, left, middle, right; /* next corner to begin, to be passed, to end */
    size_t open;                     /* blends */
    size_t barrier;                  /* open corner that is one; n_corners: none */
    double p1[NC_AXES], p2[NC_AXES], p3[NC_AXES];
    Bounds arc; /* of the leg or corner that is round */
    size_t arc_leg, arc_corner;
} Walk;

static void step(Walk *w, double length);
static void pass(Walk *w, double at);
static double next_place(const Walk *w);
static void add_cell(Walk *w, double length, const Bounds *b, const NcLeg *leg, bool pure_arc);

void nc_run_cells(NcRun *run)
{
    Walk w = {.run = run, .barrier = run->n_corners, .arc_leg = run->n_legs};
    w.arc_corner = run->n_corners;
    run->n_cells = 0;
    for (int i = 0; i < NC_AXES; i++)
        w.p1[i] = run->legs[0].slope[i];
    for (double at = 0.0; w.leg < run->n_legs;) {
        double next = next_place(&w);
        if (next > at)
            step(&w, next - at);
        pass(&w, next);
        at = fmax(at, next);
    }
}

static double next_place(const Walk *w)
{
    const NcRun *run = w->run;
    const NcLeg *leg = &run->legs[w->leg];
    double at = leg->start + leg->length;
    if (w->left < run->n_corners)
        at = fmin(at, run->corners[w->left].at - run->corners[w->left].half);
    if (w->middle < run->n_corners)
        at = fmin(at, run->corners[w->middle].at);
    if (w->right < run->n_corners)
        at = fmin(at, run->corners[w->right].at + run->corners[w->right].half);
    return at;
}

static void add_share(Walk *w, size_t corner, int what)
{
    const NcRun *run = w->run;
    const NcCorner *c = &run->corners[corner];
    double slope[NC_AXES], bend[NC_AXES];
    if (!(c->half > 0.0))
        return;
    nc_run_jump(run, c->leg, slope, bend);
    bool smooth = run->limits->smooth;
    double share = smooth ? what / (c->half * c->half) : what / (2.0 * c->half);
    double *sum = smooth ? w->p3 : w->p2;
    for (int i = 0; i < run->limits->axes; i++)
        sum[i] += share * slope[i];
}

static void begin_blend(Walk *w)
{
    add_share(w, w->left, 1);
    if (w->run->corners[w->left].barrier)
        w->barrier = w->left;
    w->left++;
    w->open++;
}

static void end_blend(Walk *w)
{
    add_share(w, w->right, w->run->limits->smooth ? 1 : -1);
    if (w->barrier == w->right)
        w->barrier = w->run->n_corners;
    w->right++;
    w->open--;
}

/* Sums are begun afresh wherever no blend is open: nothing of rounding adds up. */
static void begin_afresh(Walk *w)
{
    if (w->open > 0 || w->leg >= w->run->n_legs)
        return;
    for (int i = 0; i < NC_AXES; i++) {
        w->p1[i] = w->run->legs[w->leg].slope[i];
        w->p2[i] = w->p3[i] = 0.0;
    }
}

static void pass(Walk *w, double at)
{
    const NcRun *run = w->run;
    const NcCorner *c = run->corners;
    size_t n = run->n_corners;
    while (w->right < w->middle && c[w->right].at + c[w->right].half <= at)
        end_blend(w);
    while (w->leg < run->n_legs && run->legs[w->leg].start + run->legs[w->leg].length <= at)
        w->leg++;
    while (w->middle < w->left && c[w->middle].at <= at) {
        if (run->limits->smooth)
            add_share(w, w->middle, -2);
        w->middle++;
    }
    begin_afresh(w);
    while (w->left < n && c[w->left].at - c[w->left].half <= at)
        begin_blend(w);
}

static void move_on(Walk *w, double length)
{
    for (int i = 0; i < w->run->limits->axes; i++) {
        w->p1[i] += length * (w->p2[i] + 0.5 * length * w->p3[i]);
        w->p2[i] += length * w->p3[i];
    }
}

/* What an arc turns by itself. */
static void arc_bounds(const NcRun *run, size_t leg, Bounds *b)
{
    const NcLeg *l = &run->legs[leg];
    *b = (Bounds){0};
    if (!l->round) {
        for (int i = 0; i < NC_AXES; i++)
            b->d1[i] = fabs(l->slope[i]);
        return;
    }
    NcTrack t = nc_track(&run->moves[l->move]);
    double w = fabs(t.omega), r = fmax(t.arc.radius_from_mm, t.arc.radius_to_mm);
    double out = fabs(t.widening);
    nc_track_slope(&t, 0.0, b->d1);
    for (int i = 0; i < NC_AXES; i++)
        b->d1[i] = fabs(b->d1[i]);
    const int plane[2] = {t.arc.axes.first, t.arc.axes.second};
    for (int k = 0; k < 2; k++) {
        b->d1[plane[k]] = hypot(r * w, out);
        b->d2[plane[k]] = w * hypot(r * w, 2.0 * out);
        b->d3[plane[k]] = w * w * hypot(r * w, 3.0 * out);
    }
}

/* In the blend of a corner whose legs are not both straight: both legs', and the bend's. */
static void corner_bounds(const NcRun *run, size_t corner, Bounds *b)
{
    const NcCorner *c = &run->corners[corner];
    double slope[NC_AXES], bend[NC_AXES];
    Bounds after;
    arc_bounds(run, c->leg, b);
    arc_bounds(run, c->leg + 1, &after);
    nc_run_jump(run, c->leg, slope, bend);
    bool smooth = run->limits->smooth;
    for (int i = 0; i < NC_AXES; i++) {
        b->d1[i] = fmax(b->d1[i], after.d1[i]) + (smooth ? c->half * fabs(bend[i]) / 12.0 : 0.0);
        b->d3[i] = fmax(b->d3[i], after.d3[i]);
        b->d2[i] = fmax(b->d2[i], after.d2[i]);
        if (smooth) {
            b->d2[i] = b->d2[i] * BEND_OVER + c->half * b->d3[i];
            b->d3[i] += BEND_STEEP * fabs(bend[i]) / c->half;
        }
    }
}

/* The bounds that the sums give, over the length that is to come. */
static void sum_bounds(const Walk *w, double length, Bounds *b)
{
    for (int i = 0; i < w->run->limits->axes; i++) {
        double bend = w->p2[i] + length * w->p3[i];
        double slope = w->p1[i] + 0.5 * length * (w->p2[i] + bend);
        b->d1[i] = fmax(fabs(w->p1[i]), fabs(slope));
        if (w->p2[i] * bend < 0.0)
            b->d1[i] += length * fabs(bend - w->p2[i]) / 8.0;
        b->d2[i] = fmax(fabs(w->p2[i]), fabs(bend));
        b->d3[i] = fabs(w->p3[i]);
    }
}

static void step(Walk *w, double length)
{
    NcRun *run = w->run;
    const NcLeg *leg = &run->legs[w->leg];
    const NcCorner *barrier = w->barrier < run->n_corners ? &run->corners[w->barrier] : NULL;
    NcLeg slower = *leg;
    Bounds b;
    sum_bounds(w, length, &b);
    if (barrier) {
        const NcLeg *a = &run->legs[barrier->leg], *z = a + 1;
        if (!a->forbidden && !z->forbidden) {
            slower.feed = fmin(a->feed, z->feed);
            slower.share = fmin(a->share, z->share);
        }
    }
    bool in_corner = barrier && barrier->round;
    if (in_corner || leg->round) {
        if (in_corner && w->arc_corner != w->barrier)
            corner_bounds(run, w->barrier, &w->arc);
        else if (!in_corner && w->arc_leg != w->leg)
            arc_bounds(run, w->leg, &w->arc);
        w->arc_corner = in_corner ? w->barrier : run->n_corners;
        w->arc_leg = in_corner ? run->n_legs : w->leg;
        for (int i = 0; i < NC_AXES; i++) {
            b.d1[i] = w->arc.d1[i];
            b.d2[i] = w->arc.d2[i] + (i < run->limits->axes ? b.d2[i] : 0.0);
            b.d3[i] = w->arc.d3[i] + (i < run->limits->axes ? b.d3[i] : 0.0);
        }
    }
    add_cell(w, length, &b, &slower, leg->round && !in_corner);
    move_on(w, length);
}

/* ------------------------------------------------------------------------ limits */

static double speed_within(const NcLimits *l, const Bounds *b, const NcLeg *leg)
{
    double for_v = 0.0, for_a = 0.0, for_j = 0.0;
    for (int i = 0; i < l->axes; i++) {
        for_v = fmax(for_v, b->d1[i] * l->per_v[i]);
        for_a = fmax(for_a, b->d2[i] * l->per_a[i]);
        for_j = fmax(for_j, b->d3[i] * l->per_j[i]);
    }
    double v = fmin(leg->feed, leg->share / for_v);
    if (v * v * for_a > NC_ACROSS)
        v = sqrt(NC_ACROSS / for_a);
    if (v * v * v * for_j > NC_JERK_ACROSS)
        v = cbrt(NC_JERK_ACROSS / for_j);
    return v;
}

static NcRate rate_within(const NcLimits *l, const Bounds *b, double v, bool pure_arc)
{
    double per_a = 0.0, cross = 0.0, across = 0.0;
    NcRate rate = {0.0, 0.0};
    for (int i = 0; i < l->axes; i++)
        across = fmax(across, b->d2[i] * l->per_a[i] * v * v);
    for (int i = 0; i < l->axes; i++) {
        bool in_plane = pure_arc && b->d2[i] > 0.0;
        double left = in_plane ? sqrt(1.0 - across * across) : 1.0 - b->d2[i] * l->per_a[i] * v * v;
        per_a = fmax(per_a, b->d1[i] * l->per_a[i] / left);
        cross = fmax(cross, b->d2[i] * l->per_j[i]);
    }
    rate.a = 1.0 / per_a;
    if (3.0 * cross * v * rate.a > JERK_CROSS)
        rate.a = JERK_CROSS / (3.0 * cross * v);
    for (int i = 0; i < l->axes; i++) {
        double left = 1.0 - l->per_j[i] * (b->d3[i] * v * v * v + 3.0 * b->d2[i] * v * rate.a);
        rate.ij = fmax(rate.ij, b->d1[i] * l->per_j[i] / left);
    }
    return rate;
}

static bool alike(double a, double b)
{
    return a >= ALIKE * b && b >= ALIKE * a;
}

static void add_cell(Walk *w, double length, const Bounds *b, const NcLeg *leg, bool pure_arc)
{
    NcRun *run = w->run;
    NcCell cell = {.length = length};
    if (!leg->forbidden) {
        cell.v = speed_within(run->limits, b, leg);
        cell.rate = rate_within(run->limits, b, cell.v, pure_arc);
    }
    NcCell *last = run->n_cells > 0 ? &run->cells[run->n_cells - 1] : NULL;
    if (last && alike(last->v, cell.v) && alike(last->rate.a, cell.rate.a) &&
        alike(last->rate.ij, cell.rate.ij)) {
        last->length += length;
        last->v = fmin(last->v, cell.v);
        last->rate = nc_rate_least(last->rate, cell.rate);
        return;
    }
    run->cells[run->n_cells++] = cell;
}
