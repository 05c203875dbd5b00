/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/strategy.h"

#include <string.h>

#include "nc/toolpath/stepover.h"

#define LEVELS 4
#define DIRECTIONS 12
/* A wall: the sine of the angle under which seen from above nothing of it is left. */
#define WALL_UP 0.02

typedef struct {
    double cosine, sine; /* of the planes' direction */
    double *across;      /* for each pass: distance of its plane from the origin */
} Planes;

static double *needed_steps(const NcJob *job, SegVec3 across);
static double cheapest_step(const NcJob *job, const double *needed);
static size_t lay_planes(const NcJob *job, const double *needed, double step, Planes *planes,
                         NcPass **passes);
static double estimate_s(const NcJob *job, double direction, double feed, double turn_s);

static double locate(const void *curves, size_t pass, double t, SegVec3 *tip)
{
    const Planes *planes = curves;
    double v = planes->across[pass];
    tip->x = planes->cosine * t - planes->sine * v;
    tip->y = planes->sine * t + planes->cosine * v;
    return 0;
}

NcCuts nc_iso_planar(const NcJob *job, double direction)
{
    Planes planes = {.cosine = cos(direction), .sine = sin(direction)};
    SegVec3 across = seg_vec3(-planes.sine, planes.cosine, 0);
    g_autofree double *needed = needed_steps(job, across);
    NcCuts cuts = {.stepover_mm = cheapest_step(job, needed)};
    g_autofree NcPass *passes = NULL;
    size_t n = lay_planes(job, needed, cuts.stepover_mm, &planes, &passes);
    cuts.pieces = nc_trace(&job->trace, passes, n, locate, &planes);
    g_free(planes.across);
    return cuts;
}

double nc_iso_planar_direction(const NcJob *job, double feed, double turn_s)
{
    double best = 0, best_s = INFINITY;
    for (int i = 0; i < DIRECTIONS; i++) {
        double direction = G_PI * i / DIRECTIONS;
        double s = estimate_s(job, direction, feed, turn_s);
        if (s < best_s * (1 - 1e-6)) {
            best = direction;
            best_s = s;
        }
    }
    return best;
}

/* The spacing each facet asks for; INFINITY on walls. */
static double *needed_steps(const NcJob *job, SegVec3 across)
{
    const NcRegion *region = job->region;
    double *needed = g_new(double, region->n_facets + 1);
    for (size_t f = 0; f < region->n_facets; f++) {
        const NcPatch *facet = &region->facets[f];
        needed[f] = facet->normal.z < WALL_UP
                        ? INFINITY
                        : nc_plane_step_mm(job->trace.body.tool, job->scallop_mm, facet->normal,
                                           &facet->bend, across);
    }
    return needed;
}

/* How many times the first spacing would be halved for ground that needs this step. */
static int level_of(double first, double needed)
{
    int level = 0;
    while (level < 2 * LEVELS && needed < first * (1 - 1e-9)) {
        first /= 2;
        level++;
    }
    return level;
}

/* Length of cutting per step over the region, for one first spacing. */
static double length_of(const NcRegion *region, const double *needed, double step)
{
    double length = 0;
    for (size_t i = 0; i < region->n_samples; i++) {
        size_t f = region->samples[i].facet;
        if (isfinite(needed[f]))
            length += region->samples[i].area_mm2 * region->facets[f].normal.z *
                      ldexp(1 / step, level_of(step, needed[f]));
    }
    return length;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Of the spacings that the samples ask for, the one with the least cutting in all. */
static double cheapest_step(const NcJob *job, const double *needed)
{
    const NcRegion *region = job->region;
    g_autofree double *steps = g_new(double, region->n_samples + 1);
    size_t n = 0;
    for (size_t i = 0; i < region->n_samples; i++) {
        double step = needed[region->samples[i].facet];
        if (isfinite(step))
            steps[n++] = step;
    }
    if (n == 0)
        return job->trace.body.tool.radius_mm;
    qsort(steps, n, sizeof *steps, ascending);
    double best = steps[0], least = INFINITY;
    for (size_t k = 0; k <= 24; k++) {
        double step = steps[k * (n - 1) / 24];
        double length = step > 0 ? length_of(region, needed, step) : INFINITY;
        if (length < least) {
            least = length;
            best = step;
        }
    }
    return best;
}

/* The facet seen along the planes. */
typedef struct {
    double u0, u1, v0, v1;
} Extent;

static Extent extent_of(const NcPatch *facet, const Planes *planes)
{
    const SegVec3 corner[3] = {facet->a, facet->b, facet->c};
    Extent e = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    for (int k = 0; k < 3; k++) {
        double u = planes->cosine * corner[k].x + planes->sine * corner[k].y;
        double v = planes->cosine * corner[k].y - planes->sine * corner[k].x;
        e = (Extent){fmin(e.u0, u), fmax(e.u1, u), fmin(e.v0, v), fmax(e.v1, v)};
    }
    return e;
}

/* A pass of level k serves what the planes of level k - 1 leave too high. */
static double below_of(size_t i, int levels, double step)
{
    double below = INFINITY;
    for (int level = 0; i % ((size_t)1 << (levels - level)) != 0; level++)
        below = ldexp(step, -level) * (1 - 1e-9);
    return below;
}

/* Each pass as long as the facets that need it, and the cutter beyond. */
static void stretch(const NcJob *job, const double *needed, const Planes *planes, double fine,
                    size_t n, NcPass *passes)
{
    double beyond = job->trace.body.cutter.radius_mm + job->trace.overlap_mm;
    for (size_t f = 0; f < job->region->n_facets; f++) {
        if (!isfinite(needed[f]))
            continue;
        Extent e = extent_of(&job->region->facets[f], planes);
        double from = ceil((e.v0 - beyond - planes->across[0]) / fine);
        double to = floor((e.v1 + beyond - planes->across[0]) / fine);
        for (double i = fmax(from, 0); i <= fmin(to, (double)n - 1); i++) {
            NcPass *pass = &passes[(size_t)i];
            if (!(needed[f] < pass->below))
                continue;
            pass->t0 = fmin(pass->t0, e.u0 - beyond);
            pass->t1 = fmax(pass->t1, e.u1 + beyond);
        }
    }
}

/* Planes over the region's bounds and the cutter beyond them; finer ones in between, level by
 * level, where something needs them. Sorted by place, so that neighbours follow each other. */
static size_t lay_planes(const NcJob *job, const double *needed, double step, Planes *planes,
                         NcPass **passes)
{
    const NcRegion *region = job->region;
    double beyond = job->trace.body.cutter.radius_mm + job->trace.overlap_mm;
    double v0 = INFINITY, v1 = -INFINITY;
    int levels = 0;
    for (size_t f = 0; f < region->n_facets; f++) {
        Extent e = extent_of(&region->facets[f], planes);
        v0 = fmin(v0, e.v0 - beyond);
        v1 = fmax(v1, e.v1 + beyond);
        levels = MAX(levels, MIN(level_of(step, needed[f]), LEVELS));
    }
    double fine = ldexp(step, -levels);
    size_t n = (size_t)ceil((v1 - v0) / fine) + 1;
    planes->across = g_new(double, n);
    *passes = g_new(NcPass, n);
    double first = (v0 + v1) / 2 - fine * (double)(n - 1) / 2;
    for (size_t i = 0; i < n; i++) {
        planes->across[i] = first + fine * (double)i;
        (*passes)[i] = (NcPass){
            .t0 = INFINITY, .t1 = -INFINITY, .needed = needed, .below = below_of(i, levels, step)};
    }
    stretch(job, needed, planes, fine, n, *passes);
    size_t used = 0;
    for (size_t i = 0; i < n; i++) {
        NcPass pass = (*passes)[i];
        if (pass.t0 > pass.t1)
            continue;
        pass.n = (size_t)fmax(ceil((pass.t1 - pass.t0) / nc_trace_pitch_mm(&job->trace)), 1);
        planes->across[used] = planes->across[i];
        (*passes)[used++] = pass;
    }
    return used;
}

/* Cutting at the feed, and a turn at the end of every plane. */
static double estimate_s(const NcJob *job, double direction, double feed, double turn_s)
{
    const NcRegion *region = job->region;
    SegVec3 along = seg_vec3(cos(direction), sin(direction), 0);
    SegVec3 across = seg_vec3(-along.y, along.x, 0);
    g_autofree double *needed = needed_steps(job, across);
    double step = cheapest_step(job, needed), length = 0, v0 = INFINITY, v1 = -INFINITY;
    for (size_t i = 0; i < region->n_samples; i++) {
        const NcPatch *facet = &region->facets[region->samples[i].facet];
        double need = needed[region->samples[i].facet];
        if (!isfinite(need))
            continue;
        double slope = seg_dot(facet->normal, along) / facet->normal.z;
        length += region->samples[i].area_mm2 * facet->normal.z * hypot(1, slope) *
                  ldexp(1 / step, level_of(step, need));
        v0 = fmin(v0, seg_dot(region->samples[i].point, across));
        v1 = fmax(v1, seg_dot(region->samples[i].point, across));
    }
    double turns = v1 > v0 ? (v1 - v0) / step : 0;
    return 60 * length / feed + turns * turn_s;
}
