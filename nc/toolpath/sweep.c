/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/drop_contact.h"

#include <float.h>

/*
 * Over one triangle the gouge at t along the move, tip(c(t)) - z(t), is a concave function of t: it
 * is the maximum over points p of a function concave in (p,t) together. So its tangents lie above
 * all of it, and the contact tells the tangent (envelope theorem). The maximum is enclosed between
 * what was found and where two tangents meet: nothing rests on sampling.
 */
typedef struct {
    NcCutter cutter;
    SegVec3 from, along;  /* the tip at t in [0, 1]: from + t·along */
    double resolution_mm; /* what may be missed */
    double ignored_mm;    /* gouges up to here are of no interest */
    double stop_mm;       /* the first above ends the search */
    double deepest_mm;
} Sweep;

/* One t. `height` is concave in t, `rate` its derivative: the gouge where the triangle is in reach,
 * else minus the distance by which it is not. */
typedef struct {
    double t, height, rate;
    bool reached;
} Moment;

static Moment moment_at(Sweep *sweep, const NcFacet *facet, double t)
{
    SegVec3 tip = seg_along(sweep->from, sweep->along, t);
    NcContact contact = nc_contact(facet, sweep->cutter, tip.x, tip.y);
    double dx = contact.point.x - tip.x, dy = contact.point.y - tip.y;
    double towards = dx * sweep->along.x + dy * sweep->along.y;
    if (towards != 0)
        towards /= sqrt(dx * dx + dy * dy);
    if (contact.beyond_mm > 0)
        return (Moment){t, -contact.beyond_mm, towards, false};
    double gouge = contact.tip_mm - tip.z;
    sweep->deepest_mm = fmax(sweep->deepest_mm, gouge);
    double lift = towards != 0 && contact.rate > 0 ? contact.rate * towards : 0;
    return (Moment){t, gouge, lift - sweep->along.z, true};
}

/* The tangents at a (rising) and b (falling): how high they leave the maximum between, and at which
 * t. Where the profile is vertical there is no tangent: INFINITY. */
static double tangents_meet(const Moment *a, const Moment *b, double *t)
{
    double width = b->t - a->t;
    *t = a->t + width / 2;
    if (a->reached != b->reached) {
        const Moment *m = a->reached ? a : b;
        return m->height + fabs(m->rate) * width;
    }
    if (isinf(a->rate) || isinf(b->rate))
        return fmin(a->height + a->rate * width, b->height - b->rate * width);
    double s = (b->height - b->rate * width - a->height) / (a->rate - b->rate);
    s = fmin(fmax(s, 0), width);
    *t = a->t + fmin(fmax(s, width / 16), width * 15 / 16);
    return a->height + a->rate * s;
}

static double enough(const Sweep *sweep)
{
    return fmax(sweep->deepest_mm + sweep->resolution_mm, sweep->ignored_mm);
}

static void sweep_facet(Sweep *sweep, const NcFacet *facet)
{
    const double shortest = 1e-12;
    Moment m = moment_at(sweep, facet, 0.5);
    double highest = m.height + fabs(m.rate) / 2;
    if (highest <= (m.reached ? enough(sweep) : 0))
        return;
    Moment end = moment_at(sweep, facet, m.rate > 0 ? 1 : 0);
    if (m.rate * end.rate >= 0) /* rising to the end, or level */
        return;
    Moment a = m.rate > 0 ? m : end, b = m.rate > 0 ? end : m;
    for (int i = 1; b.t - a.t > shortest && sweep->deepest_mm <= sweep->stop_mm; i++) {
        double t, height = tangents_meet(&a, &b, &t);
        if (height <= (a.reached || b.reached ? enough(sweep) : 0))
            return;
        /* Now and then by halves, so that the end is near whatever the function is. */
        m = moment_at(sweep, facet, i % 4 == 0 ? (a.t + b.t) / 2 : t);
        if (m.rate == 0)
            return;
        *(m.rate > 0 ? &a : &b) = m;
    }
}

static bool sweep_over(const NcFacet *facet, double *floor, void *data)
{
    Sweep *sweep = data;
    sweep_facet(sweep, facet);
    *floor = enough(sweep);
    return sweep->deepest_mm <= sweep->stop_mm;
}

/* In pieces no longer than half a radius in (x,y): there the bounds of the walk are tight. */
static void sweep_move(Sweep *sweep, const NcTerrain *terrain, SegVec3 a, SegVec3 b)
{
    const double most_pieces = 1 << 16;
    SegVec3 move = seg_sub(b, a);
    double length = sqrt(move.x * move.x + move.y * move.y);
    double pieces = fmin(ceil(2 * length / fmax(sweep->cutter.radius_mm, DBL_MIN)), most_pieces);
    int n = pieces >= 1 ? (int)pieces : 1;
    for (int i = 0; i < n && sweep->deepest_mm <= sweep->stop_mm; i++) {
        SegVec3 from = i == 0 ? a : seg_along(a, move, (double)i / n);
        SegVec3 to = i == n - 1 ? b : seg_along(a, move, (double)(i + 1) / n);
        sweep->from = from;
        sweep->along = seg_sub(to, from);
        NcMoveSpan span = {seg_along(from, sweep->along, 0.5), seg_scale(sweep->along, 0.5)};
        nc_terrain_walk(terrain, sweep->cutter, &span, enough(sweep), sweep_over, sweep);
    }
}

double nc_sweep_gouge_mm(const NcTerrain *terrain, NcCutter cutter, SegVec3 a, SegVec3 b,
                         double resolution_mm)
{
    Sweep sweep = {.cutter = cutter,
                   .resolution_mm = resolution_mm,
                   .ignored_mm = -INFINITY,
                   .stop_mm = INFINITY,
                   .deepest_mm = -INFINITY};
    sweep_move(&sweep, terrain, a, b);
    return sweep.deepest_mm;
}

bool nc_sweep_clear(const NcTerrain *terrain, NcCutter cutter, SegVec3 a, SegVec3 b,
                    double tolerance_mm)
{
    Sweep sweep = {.cutter = cutter,
                   .ignored_mm = tolerance_mm,
                   .stop_mm = tolerance_mm,
                   .deepest_mm = -INFINITY};
    sweep_move(&sweep, terrain, a, b);
    return sweep.deepest_mm <= tolerance_mm;
}

void nc_sweep_gouge_batch(const NcTerrain *terrain, NcCutter cutter, size_t n, const SegVec3 *tips,
                          double resolution_mm, double *gouge_mm)
{
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t i = 1; i < n; i++)
        gouge_mm[i - 1] = nc_sweep_gouge_mm(terrain, cutter, tips[i - 1], tips[i], resolution_mm);
}
