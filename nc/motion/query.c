/* SPDX-License-Identifier: Apache-2.0 */
/* Where a motion is, and how fast, at a moment of it. */
#include "nc/motion/kernel.h"
#include "nc/motion/motion.h"

double nc_motion_start_s(const NcMotion *motion, size_t move)
{
    return motion->start_s[move];
}

double nc_motion_duration_s(const NcMotion *motion, size_t move)
{
    return motion->start_s[move + 1] - motion->start_s[move];
}

double nc_motion_total_s(const NcMotion *motion)
{
    return motion->start_s[motion->n];
}

double nc_motion_end_mm(const NcMotion *motion, size_t move)
{
    return motion->end_mm[move];
}

bool nc_motion_forbids(const NcMotion *motion, size_t move)
{
    return motion->forbidden && motion->forbidden[move];
}

/* The last stretch that begins at no more than `value`, in time or in place. */
static size_t last_from(const NcMotion *motion, bool in_time, double value)
{
    size_t low = 0, high = motion->n_stretches;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        const NcStretch *stretch = &motion->stretches[middle];
        if ((in_time ? stretch->t : stretch->s) <= value)
            low = middle;
        else
            high = middle;
    }
    return low;
}

size_t nc_motion_stretch_at_s(const NcMotion *motion, double t_s)
{
    return last_from(motion, true, t_s);
}

size_t nc_motion_stretch_at_mm(const NcMotion *motion, double s_mm)
{
    return last_from(motion, false, s_mm);
}

size_t nc_motion_phases(const NcMotion *motion, size_t stretch, NcPhase phases[7])
{
    const NcStretch *p = &motion->stretches[stretch];
    size_t n = nc_stretch_phases(p, p[1].s - p->s, p[1].v, phases);
    for (size_t i = 0; i < n; i++)
        phases[i].from.s_mm += p->s;
    return n;
}

/* ------------------------------------------------------------------------ phases */

NcAlong nc_phase_at(const NcPhase *phase, double t)
{
    NcAlong f = phase->from;
    double j = phase->jerk_mm_s3;
    return (NcAlong){f.s_mm + t * (f.v_mm_s + t * (f.a_mm_s2 / 2.0 + t * j / 6.0)),
                     f.v_mm_s + t * (f.a_mm_s2 + t * j / 2.0), f.a_mm_s2 + t * j};
}

double nc_phase_time_s(const NcPhase *phase, double s_mm)
{
    double d = s_mm - phase->from.s_mm, v = phase->from.v_mm_s, a = phase->from.a_mm_s2;
    if (d <= 0.0)
        return 0.0;
    if (phase->jerk_mm_s3 == 0.0)
        return fmin(2.0 * d / (v + sqrt(fmax(v * v + 2.0 * a * d, 0.0))), phase->duration_s);
    double low = 0.0, high = phase->duration_s;
    double t = fmin(v > 0.0 ? d / v : high, high);
    for (int i = 0; i < 100 && high - low > 1e-16 * high; i++) {
        NcAlong at = nc_phase_at(phase, t);
        double over = at.s_mm - s_mm;
        if (over > 0.0)
            high = t;
        else
            low = t;
        double next = t - over / at.v_mm_s;
        if (!(next > low && next < high))
            next = 0.5 * (low + high);
        if (fabs(next - t) <= 1e-15 * high)
            return next;
        t = next;
    }
    return t;
}

NcAlong nc_motion_along(const NcMotion *motion, double t_s)
{
    size_t k = nc_motion_stretch_at_s(motion, t_s);
    const NcStretch *p = &motion->stretches[k];
    double t = t_s - p->t;
    if (!(p->top > 0.0) || t <= 0.0)
        return (NcAlong){p->s, p->top > 0.0 ? p->v : 0.0, 0.0};
    NcPhase phases[7];
    size_t n = nc_motion_phases(motion, k, phases), i = 0;
    for (; i + 1 < n && t >= phases[i].duration_s; i++)
        t -= phases[i].duration_s;
    NcAlong along = nc_phase_at(&phases[i], fmin(t, phases[i].duration_s));
    along.s_mm = fmin(along.s_mm, p[1].s);
    return along;
}

double nc_motion_time_s(const NcMotion *motion, double s_mm)
{
    size_t k = nc_motion_stretch_at_mm(motion, s_mm);
    while (k > 0 && motion->stretches[k].s == s_mm && motion->stretches[k - 1].s == s_mm)
        k--;
    const NcStretch *p = &motion->stretches[k];
    if (!(p->top > 0.0) || s_mm <= p->s)
        return p->t;
    NcPhase phases[7];
    size_t n = nc_motion_phases(motion, k, phases), i = 0;
    double t = p->t;
    for (; i + 1 < n && phases[i + 1].from.s_mm <= s_mm; i++)
        t += phases[i].duration_s;
    return t + nc_phase_time_s(&phases[i], s_mm);
}

/* ------------------------------------------------------------------------- points */

static double start_mm(const NcMotion *motion, size_t move)
{
    return move > 0 ? motion->end_mm[move - 1] : 0.0;
}

static bool has_length(const NcMotion *motion, size_t move)
{
    return motion->end_mm[move] > start_mm(motion, move);
}

/* Adds what the blend at the end of `move` does to the path at s. */
static void add_blend(const NcMotion *motion, size_t move, double s, NcPoint *d)
{
    double h = motion->half_mm[move], x = (s - motion->end_mm[move]) / h;
    size_t next = move + 1;
    while (next < motion->n && !has_length(motion, next))
        next++;
    if (next >= motion->n || !(fabs(x) < 1.0))
        return;
    NcTrack a = nc_track(&motion->moves[move]), b = nc_track(&motion->moves[next]);
    NcKernel corner = nc_kernel_corner(motion->smooth, x), bend = nc_kernel_bend(x);
    double slope[NC_AXES], before[NC_AXES], bent[NC_AXES], after[NC_AXES];
    nc_track_slope(&a, a.length, before);
    nc_track_slope(&b, 0.0, slope);
    nc_track_bend(&a, a.length, bent);
    nc_track_bend(&b, 0.0, after);
    for (int i = 0; i < NC_AXES; i++) {
        double jump = slope[i] - before[i], turn = motion->smooth ? after[i] - bent[i] : 0.0;
        d->position[i] += h * (corner.value * jump + h * bend.value * turn);
        d->velocity[i] += corner.slope * jump + h * bend.slope * turn;
        d->acceleration[i] += corner.bend * jump / h + bend.bend * turn;
    }
}

NcPoint nc_motion_point(const NcMotion *motion, size_t move, NcAlong along)
{
    NcPoint p = {0}; /* first by s, then by time */
    if (motion->n == 0)
        return p;
    double s = along.s_mm;
    size_t i = MIN(move, motion->n - 1);
    while (i + 1 < motion->n && s > motion->end_mm[i])
        i++;
    while (i > 0 && (s < start_mm(motion, i)))
        i--;
    NcTrack track = nc_track(&motion->moves[i]);
    double at = s - start_mm(motion, i);
    nc_track_point(&track, at, p.position);
    if (has_length(motion, i)) {
        nc_track_slope(&track, at, p.velocity);
        nc_track_bend(&track, at, p.acceleration);
    }
    for (size_t k = i; k < motion->n && motion->end_mm[k] - s < motion->widest_mm; k++) {
        double h = motion->half_mm[k];
        if (h > 0.0 && motion->end_mm[k] - s >= h)
            break;
        if (h > 0.0 && has_length(motion, k))
            add_blend(motion, k, s, &p);
    }
    for (size_t k = i; k-- > 0 && s - motion->end_mm[k] < motion->widest_mm;) {
        double h = motion->half_mm[k];
        if (h > 0.0 && s - motion->end_mm[k] >= h)
            break;
        if (h > 0.0 && has_length(motion, k))
            add_blend(motion, k, s, &p);
    }
    double v = along.v_mm_s;
    for (int axis = 0; axis < NC_AXES; axis++) {
        p.acceleration[axis] = p.acceleration[axis] * v * v + p.velocity[axis] * along.a_mm_s2;
        p.velocity[axis] *= v;
    }
    return p;
}

NcPoint nc_motion_at(const NcMotion *motion, double t_s)
{
    NcAlong along = nc_motion_along(motion, t_s);
    size_t low = 0, high = motion->n;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (motion->start_s[middle] <= t_s)
            low = middle;
        else
            high = middle;
    }
    return nc_motion_point(motion, low, along);
}
