/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The fastest way through cells of limited speed, acceleration and jerk, in two passes.
 *
 * Backwards from rest: the unrounded ramp R gains speed with the least acceleration and jerk of
 * the cells behind it; rounded off to any speed it lies below R. So it may go on as long as R stays
 * below the cells' speeds, or as it is rounded off to what they allow (`top`). Where it has reached
 * that, a base is set, and another ramp begins. Where a cell's acceleration or jerk differs, the
 * base is set before it if that leads to more speed.
 *
 * Forwards over the bases: a ramp up goes on over bases that it cannot reach the speed of, and
 * stays below that; one whose speed can be had ends the stretch. Its peak lies between, as high as
 * the way allows: below both ramps, so within all cells.
 *
 * Without limits of jerk this is the trapezoidal look-ahead. Every cell and base is looked at a
 * bounded number of times: O(n).
 */
#include "nc/motion/profile.h"

static const NcRate unlimited = {INFINITY, 0.0};

static bool same(NcRate a, NcRate b)
{
    return a.a == b.a && a.ij == b.ij;
}

/* Whether a ramp from u over d, then over `more` with other limits, is better broken between. */
static bool better_apart(double u, double d, NcRate rate, double more, NcRate other)
{
    double apart = nc_ramp_reach(nc_ramp_reach(u, d, rate), more, other);
    return apart > nc_ramp_reach(u, d + more, nc_rate_least(rate, other));
}

size_t nc_profile_bases(const NcRun *run, NcBase *bases)
{
    const NcCell *cells = run->cells;
    double at = run->length, d = 0.0;
    NcBase *base = &bases[run->n_cells * 2];
    *base = (NcBase){at, 0.0, INFINITY, unlimited};
    size_t n = 1;
    for (size_t c = run->n_cells; c-- > 0;) {
        const NcCell *cell = &cells[c];
        double node = c > 0 ? fmin(cells[c - 1].v, cell->v) : 0.0;
        if (d > 0.0 && !same(base->rate, cell->rate) &&
            better_apart(base->v, d, base->rate, cell->length, cell->rate)) {
            double v = nc_ramp_reach(base->v, d, base->rate);
            *--base = (NcBase){at, v, INFINITY, unlimited};
            d = 0.0;
            n++;
        }
        base->rate = nc_rate_least(base->rate, cell->rate);
        d += cell->length;
        at = c > 0 ? at - cell->length : 0.0;
        if (nc_rise_mm(base->v, cell->v, base->rate) < d)
            base->top = fmin(base->top, cell->v);
        double to = fmin(base->top, node);
        if (to <= base->v || nc_ramp_mm(base->v, to, base->rate) <= d) {
            *--base = (NcBase){at, to, INFINITY, unlimited};
            d = 0.0;
            n++;
        } else if (nc_rise_mm(base->v, node, base->rate) < d) {
            base->top = fmin(base->top, node);
        }
    }
    for (size_t i = 0; i < n; i++)
        bases[i] = base[i];
    return n;
}

NcClimb nc_profile_climb(const NcBase *bases, size_t n)
{
    return (NcClimb){.bases = bases,
                     .n = n,
                     .next = 1,
                     .s = bases[0].s,
                     .v = bases[0].v,
                     .top = INFINITY,
                     .rate = unlimited,
                     .passed = 1};
}

static bool give(NcClimb *c, NcStretch *stretch, size_t *end, double *v, size_t base, double to,
                 NcRate rate)
{
    const NcBase *b = &c->bases[base];
    *stretch = (NcStretch){.s = c->s, .v = c->v, .rate = rate};
    stretch->top = nc_ramp_peak(c->v, to, b->s - c->s, fmin(c->top, b->top), rate);
    *end = base;
    *v = to;
    c->s = b->s;
    c->v = to;
    c->top = INFINITY;
    c->rate = unlimited;
    c->next = c->passed = base + 1;
    return true;
}

bool nc_profile_next(NcClimb *c, NcStretch *stretch, size_t *end, double *v)
{
    for (; c->next < c->n; c->next++) {
        const NcBase *b = &c->bases[c->next];
        NcRate rate = nc_rate_least(c->rate, b->rate);
        double d = b->s - c->s, to = fmin(b->v, c->top);
        bool reached = to <= c->v || nc_ramp_mm(c->v, to, rate) <= d;
        if (c->next > c->passed && !same(c->rate, b->rate)) {
            double before = b[-1].s - c->s;
            bool fits = to > c->v || nc_ramp_mm(c->v, to, rate) <= d;
            if (!fits || better_apart(c->v, before, c->rate, d - before, b->rate)) {
                double reach = fmin(nc_ramp_reach(c->v, before, c->rate), fmin(b[-1].v, c->top));
                return give(c, stretch, end, v, c->next - 1, reach, c->rate);
            }
        }
        if (reached)
            return give(c, stretch, end, v, c->next, to, rate);
        if (nc_rise_mm(c->v, b->v, rate) < d)
            c->top = fmin(c->top, b->v);
        c->rate = rate;
    }
    return false;
}

/* --------------------------------------------------------------------- stretches */

double nc_stretch_s(const NcStretch *p, double length, double v_end)
{
    double up = nc_ramp_mm(p->v, p->top, p->rate), down = nc_ramp_mm(p->top, v_end, p->rate);
    double level = fmax(length - up - down, 0.0);
    return nc_ramp_s(p->top - p->v, p->rate) + nc_ramp_s(p->top - v_end, p->rate) +
           (level > 0.0 ? level / p->top : 0.0);
}

static NcAlong add(NcPhase *phases, size_t *n, NcAlong from, double duration_s, double jerk)
{
    if (!(duration_s > 0.0))
        return from;
    phases[*n] = (NcPhase){duration_s, from, jerk};
    return nc_phase_at(&phases[(*n)++], duration_s);
}

/* The speed changes by dv, of either sign. */
static NcAlong add_ramp(NcPhase *phases, size_t *n, NcAlong from, double dv, NcRate r)
{
    double sign = dv < 0.0 ? -1.0 : 1.0, gain = fabs(dv), q = nc_rate_q(r);
    if (!(gain > 0.0))
        return from;
    double to = from.v_mm_s + dv;
    double build = r.ij > 0.0 ? (gain >= q ? r.a * r.ij : sqrt(gain * r.ij)) : 0.0;
    double hold = gain >= q ? gain / r.a - r.a * r.ij : 0.0;
    double jerk = r.ij > 0.0 ? sign / r.ij : 0.0;
    from = add(phases, n, from, build, jerk);
    from.a_mm_s2 = sign * fmin(r.a, build > 0.0 ? build / r.ij : r.a);
    from = add(phases, n, from, hold, 0.0);
    from = add(phases, n, from, build, -jerk);
    from.a_mm_s2 = 0.0;
    from.v_mm_s = to;
    return from;
}

size_t nc_stretch_phases(const NcStretch *p, double length, double v_end, NcPhase phases[7])
{
    size_t n = 0;
    double level = length - nc_ramp_mm(p->v, p->top, p->rate) - nc_ramp_mm(p->top, v_end, p->rate);
    NcAlong at = {0.0, p->v, 0.0};
    at = add_ramp(phases, &n, at, p->top - p->v, p->rate);
    at = add(phases, &n, at, p->top > 0.0 ? level / p->top : 0.0, 0.0);
    add_ramp(phases, &n, at, v_end - p->top, p->rate);
    return n;
}
