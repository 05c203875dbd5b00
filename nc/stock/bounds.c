/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/bounds.h"

#include <string.h>

#include "nc/motion/path.h"

/* The results are the same with and without: none of these loops fuses or reorders. Static: clang
 * does not give a clone that others call the name they call. */
#define CLONES __attribute__((target_clones("avx512f", "avx2", "default")))

/* Far off all rays; its square is finite. */
#define NOWHERE 1e15F

static void clear(NcLanes *lanes, int from)
{
    for (int i = from; i % NC_LANES != 0; i++) {
        lanes->u[i] = lanes->v[i] = NOWHERE;
        lanes->w[i] = lanes->du[i] = lanes->dv[i] = lanes->dw[i] = 0;
        lanes->tu[i] = 1;
        lanes->tv[i] = lanes->level[i] = lanes->slope[i] = lanes->sine[i] = 0;
        lanes->chord[i] = -1;
    }
}

void nc_lanes_load(NcLanes *lanes, const NcGroup *group, const bool meets[NC_N_PARTS], int axis)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    double extent = 0;
    lanes->axis = axis;
    lanes->n = group->n;
    lanes->origin = seg_lerp(group->chords[0].a, group->chords[group->n - 1].b, 0.5);
    for (int i = 0; i < group->n; i++) {
        SegVec3 a = seg_sub(group->chords[i].a, lanes->origin);
        SegVec3 d = seg_sub(group->chords[i].b, group->chords[i].a);
        double du = nc_axis_value(d, u), dv = nc_axis_value(d, v), dw = nc_axis_value(d, axis);
        double level = hypot(du, dv), length = seg_norm(d);
        lanes->u[i] = (float)nc_axis_value(a, u);
        lanes->v[i] = (float)nc_axis_value(a, v);
        lanes->w[i] = (float)nc_axis_value(a, axis);
        lanes->du[i] = (float)du;
        lanes->dv[i] = (float)dv;
        lanes->dw[i] = (float)dw;
        /* So short a way across the rays is none; it is less than the margin. */
        bool across = level > 1e-7 * length && level > 1e-9;
        lanes->tu[i] = across ? (float)(du / level) : 1;
        lanes->tv[i] = across ? (float)(dv / level) : 0;
        lanes->level[i] = across ? (float)level : 0;
        lanes->slope[i] = across ? (float)(dw / level) : 0;
        lanes->sine[i] = length > 0 ? (float)(dw / length) : 0;
        lanes->chord[i] = i;
        extent = fmax(extent, seg_norm(a) + length);
    }
    double reach = 0;
    for (int k = 0; k < NC_N_PARTS; k++)
        if (meets[k])
            reach = fmax(reach, group->cutter->reach[k].radius + group->cutter->reach[k].top);
    lanes->margin = (float)(5e-7 * (extent + reach) + 1e-6);
    clear(lanes, group->n);
}

void nc_lanes_choose(NcLanes *lanes, const NcLanes *all, uint64_t chosen)
{
    int n = 0;
    lanes->axis = all->axis;
    lanes->origin = all->origin;
    lanes->margin = all->margin;
    for (; chosen; chosen &= chosen - 1, n++) {
        int i = __builtin_ctzll(chosen);
        lanes->u[n] = all->u[i];
        lanes->v[n] = all->v[i];
        lanes->w[n] = all->w[i];
        lanes->du[n] = all->du[i];
        lanes->dv[n] = all->dv[i];
        lanes->dw[n] = all->dw[i];
        lanes->tu[n] = all->tu[i];
        lanes->tv[n] = all->tv[i];
        lanes->level[n] = all->level[i];
        lanes->slope[n] = all->slope[i];
        lanes->sine[n] = all->sine[i];
        lanes->chord[n] = i;
    }
    lanes->n = n;
    clear(lanes, n);
}

static inline float least(float a, float b)
{
    return a < b ? a : b;
}

static inline float most(float a, float b)
{
    return a > b ? a : b;
}

static inline int padded(const NcLanes *lanes)
{
    return (lanes->n + NC_LANES - 1) / NC_LANES * NC_LANES;
}

/* A sphere on its way, exact but for rounding: along the ray its lowest place is where the capsule
 * touches, and that is where the way's slope is the sphere's. */
CLONES static void add_sphere(const NcLanes *lanes, float radius, float u, float v, float centre,
                              float *low, float *high)
{
    float r = radius + lanes->margin, square = r * r, margin = lanes->margin;
    int n = padded(lanes);
#pragma omp simd
    for (int i = 0; i < n; i++) {
        float eu = u - lanes->u[i], ev = v - lanes->v[i];
        float along = eu * lanes->tu[i] + ev * lanes->tv[i];
        float across = eu * lanes->tv[i] - ev * lanes->tu[i];
        float rest = square - across * across, reach = sqrtf(most(rest, 0));
        float lift = reach * lanes->sine[i];
        float at_low = least(most(along - lift, 0), lanes->level[i]);
        float at_high = least(most(along + lift, 0), lanes->level[i]);
        float low2 = rest - (at_low - along) * (at_low - along);
        float high2 = rest - (at_high - along) * (at_high - along);
        /* Straight along the ray: both ends count. */
        float stand = lanes->level[i] > 0 ? 0 : lanes->dw[i];
        float from = lanes->w[i] + centre + least(stand, 0) + at_low * lanes->slope[i];
        float to = lanes->w[i] + centre + most(stand, 0) + at_high * lanes->slope[i];
        bool meets = (rest >= 0) & ((low2 >= 0) | (high2 >= 0));
        float l = from - sqrtf(most(low2, 0)) - margin, h = to + sqrtf(most(high2, 0)) + margin;
        low[i] = least(low[i], meets ? l : INFINITY);
        high[i] = most(high[i], meets ? h : -INFINITY);
    }
}

/* Z rays: the profile's height at the least distance from the way, over its lowest point. */
CLONES static void add_upright(const NcLanes *lanes, const NcToolBody *body, float u, float v,
                               float half, float *low, float *high)
{
    const NcRoundedDisc *d = &body->rounded;
    bool whole = d->round > 0 && (d->disc > 0 || half > 0); /* else the sphere is dealt with */
    float round = whole ? (float)d->round : -1, disc = (float)d->disc;
    float centre = (float)d->centre, top = (float)body->top, margin = lanes->margin;
    float reach = margin + half * (float)G_SQRT2;
    float z0[2], r0[2], r1[2], steep[2];
    for (int k = 0; k < 2; k++) {
        const NcFrustum *f = &body->frustum[k];
        bool is = k < body->n_frusta;
        z0[k] = is ? (float)f->z0 : 0;
        r0[k] = is ? (float)f->r0 : 0;
        r1[k] = is ? (float)f->r1 + margin : -1;
        steep[k] = is && f->r1 > f->r0 ? (float)((f->z1 - f->z0) / (f->r1 - f->r0)) : 0;
    }
    int n = padded(lanes);
#pragma omp simd
    for (int i = 0; i < n; i++) {
        float eu = u - lanes->u[i], ev = v - lanes->v[i];
        float along = eu * lanes->tu[i] + ev * lanes->tv[i];
        float across = eu * lanes->tv[i] - ev * lanes->tu[i];
        float beyond = along - least(most(along, 0), lanes->level[i]);
        float distance = most(sqrtf(beyond * beyond + across * across) - reach, 0);
        float bottom = lanes->w[i] + least(lanes->dw[i], 0) - margin;
        float outside = most(distance - disc, 0);
        float arc = bottom + centre - sqrtf(most(round * round - outside * outside, 0));
        float l = outside <= round ? arc : INFINITY;
        float cone = bottom + z0[0] + steep[0] * most(distance - r0[0], 0);
        l = distance <= r1[0] ? least(l, cone) : l;
        cone = bottom + z0[1] + steep[1] * most(distance - r0[1], 0);
        l = distance <= r1[1] ? least(l, cone) : l;
        float h = lanes->w[i] + most(lanes->dw[i], 0) + top + margin;
        high[i] = most(high[i], l < INFINITY ? h : -INFINITY);
        low[i] = least(low[i], l);
    }
}

/* X and Y rays: the section of a piece at the ray's height, where the tip is lowest, all along the
 * way. A piece is a frustum (z0, z1, r0, widening) or an arc (disc, round, centre) between its
 * heights. `z` of the ray is u where `z_is_u`, else v. */
CLONES static void add_level(const NcLanes *lanes, const float piece[7], bool z_is_u, float z,
                             float other, float half, float *low, float *high)
{
    const float *zs = z_is_u ? lanes->u : lanes->v, *dzs = z_is_u ? lanes->du : lanes->dv;
    const float *os = z_is_u ? lanes->v : lanes->u, *dos = z_is_u ? lanes->dv : lanes->du;
    float from = piece[0], to = piece[1], base = piece[2], widening = piece[3];
    float disc = piece[4], round = piece[5], centre = piece[6];
    float slack = lanes->margin, margin = slack + half;
    int n = padded(lanes);
#pragma omp simd
    for (int i = 0; i < n; i++) {
        float lowest = zs[i] + least(dzs[i], 0), highest = zs[i] + most(dzs[i], 0);
        float height = z - lowest + margin;
        bool meets = (height >= from) & (z - highest - margin <= to);
        float below = most(centre - height, 0);
        float cone = base + widening * least(height - from, to - from);
        float arc = disc + sqrtf(most(round * round - below * below, 0));
        float r = most(cone, arc) + slack;
        float before = os[i] + least(dos[i], 0) - other, behind = other - os[i] - most(dos[i], 0);
        float off = most(most(before, behind) - margin, 0), square = r * r - off * off;
        float width = sqrtf(most(square, 0)) + slack;
        float l = lanes->w[i] + least(lanes->dw[i], 0) - width;
        float h = lanes->w[i] + most(lanes->dw[i], 0) + width;
        meets = meets & (off <= r);
        low[i] = least(low[i], meets ? l : INFINITY);
        high[i] = most(high[i], meets ? h : -INFINITY);
    }
}

static void add_level_pieces(const NcLanes *lanes, const NcToolBody *body, float u, float v,
                             float half, float *low, float *high)
{
    bool z_is_u = lanes->axis == 1;
    float z = z_is_u ? u : v, other = z_is_u ? v : u;
    for (int k = 0; k < body->n_frusta; k++) {
        const NcFrustum *f = &body->frustum[k];
        double widening = (f->r1 - f->r0) / (f->z1 - f->z0);
        add_level(
            lanes,
            (float[7]){(float)f->z0, (float)f->z1, (float)f->r0, (float)widening, -NOWHERE, 0, 0},
            z_is_u, z, other, half, low, high);
    }
    const NcRoundedDisc *d = &body->rounded;
    if (d->round > 0 && (d->disc > 0 || half > 0))
        add_level(lanes,
                  (float[7]){(float)(d->centre - d->round), (float)(d->centre + d->round), -NOWHERE,
                             0, (float)d->disc, (float)d->round, (float)d->centre},
                  z_is_u, z, other, half, low, high);
}

void nc_lanes_bounds(const NcLanes *lanes, const NcToolBody *body, float u, float v, float half,
                     float *low, float *high)
{
    int n = padded(lanes);
    for (int i = 0; i < n; i++)
        low[i] = INFINITY;
    for (int i = 0; i < n; i++)
        high[i] = -INFINITY;
    const NcRoundedDisc *d = &body->rounded;
    float centre = (float)d->centre;
    if (d->round > 0 && d->disc == 0 && half == 0)
        add_sphere(lanes, (float)d->round, lanes->axis == 1 ? u - centre : u,
                   lanes->axis == 0 ? v - centre : v, lanes->axis == 2 ? centre : 0, low, high);
    if (lanes->axis == 2)
        add_upright(lanes, body, u, v, half, low, high);
    else
        add_level_pieces(lanes, body, u, v, half, low, high);
}

CLONES static void cover(const NcLanes *lanes, const float *low, const float *high, float in,
                         float out, float *overlap)
{
    int n = padded(lanes);
    in -= lanes->margin;
    out += lanes->margin;
#pragma omp simd
    for (int i = 0; i < n; i++)
        overlap[i] = most(overlap[i], least(high[i], out) - most(low[i], in));
}

typedef int32_t Keys __attribute__((vector_size(NC_LANES * sizeof(int32_t))));

/* Floats from 0 up are in the order of their bits, of which the last give way to the lane. */
CLONES static int32_t longest_of(const NcLanes *lanes, const float *low, const float *high,
                                 float in, float out)
{
    float lengths[NC_GROUP];
    int32_t longest = NC_GROUP - 1;
    int n = padded(lanes);
    Keys best = {0}, lane, all = {0};
    in -= lanes->margin;
    out += lanes->margin;
#pragma omp simd
    for (int k = 0; k < n; k++)
        lengths[k] = least(high[k], out) - most(low[k], in);
    for (int j = 0; j < NC_LANES; j++)
        lane[j] = NC_GROUP - 1 - j;
    for (int k = 0; k < n; k += NC_LANES, lane -= NC_LANES) {
        Keys key;
        memcpy(&key, &lengths[k], sizeof key);
        key = (key & (all - NC_GROUP)) | lane; /* of a length below 0 it is below 0 too */
        Keys greater = key > best;
        best = (key & greater) | (best & ~greater);
    }
    for (int j = 0; j < NC_LANES; j++)
        longest = best[j] > longest ? best[j] : longest;
    return longest < NC_GROUP ? 0 : longest;
}

void nc_lanes_overlap(const NcLanes *lanes, const float *low, const float *high, float in,
                      float out, float *overlap)
{
    cover(lanes, low, high, in, out, overlap);
}

int32_t nc_lanes_longest(const NcLanes *lanes, const float *low, const float *high, float in,
                         float out)
{
    return longest_of(lanes, low, high, in, out);
}
