/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/drop_contact.h"

#include <float.h>

/*
 * Over a triangle p.z - h(|p - c|) is concave. Its maximum over the facet's whole plane, at q, is
 * known in closed form. With q inside the triangle that is the contact. Otherwise the contact is on
 * an edge that has q on its outer side: from any other point the straight way to q stays inside and
 * leads up. Vertices are the ends of edges.
 */
static NcContact facet_contact(const NcFacet *f, NcCutter cutter, SegVec3 q, const double side[3]);
static NcContact edge_contact(SegVec3 p, SegVec3 q, NcCutter cutter, double x, double y);

static inline double min2(double a, double b)
{
    return a < b ? a : b;
}

static inline double max2(double a, double b)
{
    return a > b ? a : b;
}

/* Twice the area of a, b, q in (x,y): positive where q lies to the left of a → b. */
static inline double side_of(SegVec3 a, SegVec3 b, SegVec3 q)
{
    return (b.x - a.x) * (q.y - a.y) - (b.y - a.y) * (q.x - a.x);
}

static inline bool is_better(const NcContact *a, const NcContact *b)
{
    if (a->beyond_mm > 0 || b->beyond_mm > 0)
        return a->beyond_mm < b->beyond_mm;
    return a->tip_mm > b->tip_mm;
}

NcContact nc_contact(const NcFacet *f, NcCutter cutter, double x, double y)
{
    double flat_mm = cutter.radius_mm - cutter.corner_radius_mm;
    double reach = flat_mm + cutter.corner_radius_mm * f->slope_sin;
    SegVec3 q = {x + f->up_x * reach, y + f->up_y * reach, 0};
    double side[3] = {side_of(f->v[0], f->v[1], q), side_of(f->v[1], f->v[2], q),
                      side_of(f->v[2], f->v[0], q)};
    bool inside = f->slope_cos > 0 && side[0] >= 0 && side[1] >= 0 && side[2] >= 0;
    if (inside && !f->thin)
        return facet_contact(f, cutter, q, side);

    /* Where q cannot be trusted, facet and edges are all asked. */
    NcContact best = {.tip_mm = -INFINITY, .beyond_mm = INFINITY};
    if (inside)
        best = facet_contact(f, cutter, q, side);
    for (int i = 0; i < 3; i++) {
        if (side[i] >= 0 && !f->thin)
            continue;
        NcContact contact = edge_contact(f->v[i], f->v[(i + 1) % 3], cutter, x, y);
        if (is_better(&contact, &best))
            best = contact;
    }
    return best;
}

static NcContact facet_contact(const NcFacet *f, NcCutter cutter, SegVec3 q, const double side[3])
{
    double area = side[0] + side[1] + side[2], z0 = f->v[0].z, z1 = f->v[1].z, z2 = f->v[2].z;
    double z = z0 + ((z1 - z0) * side[2] + (z2 - z0) * side[0]) / area;
    q.z = max2(min2(z, max2(z0, max2(z1, z2))), min2(z0, min2(z1, z2)));
    double h = cutter.corner_radius_mm * (1 - f->slope_cos);
    return (NcContact){q.z - h, q, f->slope_sin / f->slope_cos, 0};
}

/* ------------------------------------------------------------------------ edges */

/*
 * An edge seen from the cutter's axis: points at distance t along its line from the foot of the
 * axis, t in [lo, hi], `aside` from the axis at t = 0; slope dz/dt.
 */
static double line_contact(NcCutter cutter, double aside, double slope, double lo, double hi);

static NcContact edge_contact(SegVec3 p, SegVec3 q, NcCutter cutter, double x, double y)
{
    const double vertical_mm = 1e-12; /* nearer in (x,y): one point, the upper */
    SegVec3 e = seg_sub(q, p);
    double length = sqrt(e.x * e.x + e.y * e.y);
    if (length <= vertical_mm) {
        p = e.z > 0 ? q : p;
        e = seg_vec3(1, 0, 0);
        length = 0;
    } else {
        e = seg_scale(e, 1 / length);
    }
    double aside = e.x * (p.y - y) - e.y * (p.x - x);
    double from = e.x * (p.x - x) + e.y * (p.y - y), to = from + length;
    double chord2 = (cutter.radius_mm - fabs(aside)) * (cutter.radius_mm + fabs(aside));
    double chord = chord2 > 0 ? sqrt(chord2) : 0;
    double lo = max2(from, -chord), hi = min2(to, chord);
    bool reached = chord2 >= 0 && lo <= hi;
    double t = reached ? line_contact(cutter, fabs(aside), e.z, lo, hi) : max2(min2(0, to), from);

    double d = sqrt(aside * aside + t * t);
    NcContact contact = {.tip_mm = -INFINITY};
    contact.point = t >= to && length > 0 ? q : seg_along(p, e, t - from);
    contact.point.z = min2(contact.point.z, max2(p.z, q.z)); /* the tree's bounds rely on it */
    if (!reached) {
        contact.beyond_mm = max2(d - cutter.radius_mm, DBL_TRUE_MIN);
        return contact;
    }
    double r = cutter.corner_radius_mm;
    double w = max2(min2(d - (cutter.radius_mm - r), r), 0);
    double root = sqrt((r - w) * (r + w));
    contact.tip_mm = contact.point.z - (r - root);
    /* A flat cutter's rim takes up whatever slope the edge has (the limit of h' as r → 0). */
    if (w > 0)
        contact.rate = w / root;
    else if (r == 0 && e.z != 0 && t > from && t < to)
        contact.rate = fabs(e.z) * d / fabs(t);
    return contact;
}

/* h'(d)·t/d: how steeply the profile rises along the line at t >= 0. */
static double profile_slope(NcCutter cutter, double aside, double t)
{
    double r = cutter.corner_radius_mm;
    double d = sqrt(aside * aside + t * t);
    double w = min2(d - (cutter.radius_mm - r), r);
    return w > 0 ? w / sqrt((r - w) * (r + w)) * (t / d) : 0;
}

/*
 * A bull-nosed cutter on an endless line of slope > 0. With θ the angle in (x,y) between the line
 * and the direction to the contact, the profile rises along the line as the line does at distance
 *     d(θ) = (R - r) + r·slope / √(slope² + cos²θ)
 * and that point is on the line where d(θ)·sinθ = aside. The left side rises with θ, from 0 to R.
 * Newton, kept by bisection between a θ too small and one too large; θ is held as (cos, sin), so
 * that only correctly rounded operations are used and every machine finds the same digits.
 */
static double bull_contact(NcCutter cutter, double aside, double slope)
{
    double r = cutter.corner_radius_mm, a = cutter.radius_mm - r;
    double s = min2(aside / cutter.radius_mm, 1), c = sqrt((1 - s) * (1 + s));
    double low_c = c, low_s = s, high_c = 0, high_s = 1, d = cutter.radius_mm;
    for (int i = 0; i < 100 && c > 0; i++) {
        double n = sqrt(slope * slope + c * c);
        d = a + r * slope / n;
        double miss = d * s - aside;
        if (miss < 0)
            low_c = c, low_s = s;
        else
            high_c = c, high_s = s;
        double step = -miss / (c * (d + r * slope * s * s / (n * n * n)));
        double next_c = c - s * step, next_s = s + c * step;
        if (low_c * next_s - low_s * next_c < 0 || high_s * next_c - high_c * next_s < 0 ||
            fabs(step) > 1) {
            next_c = low_c + high_c, next_s = low_s + high_s;
            step = 1;
        }
        double norm = sqrt(next_c * next_c + next_s * next_s);
        c = next_c / norm, s = next_s / norm;
        if (fabs(step) < 1e-7) /* the error is of the order of its square */
            break;
    }
    return d * c;
}

static double line_contact(NcCutter cutter, double aside, double slope, double lo, double hi)
{
    if (slope == 0)
        return max2(min2(0, hi), lo);
    if (slope < 0)
        return -line_contact(cutter, aside, -slope, -hi, -lo);
    if (cutter.corner_radius_mm == 0)
        return hi;
    double t;
    if (cutter.corner_radius_mm == cutter.radius_mm) {
        double chord = sqrt((cutter.radius_mm - aside) * (cutter.radius_mm + aside));
        t = chord * slope / sqrt(1 + slope * slope);
    } else {
        if (hi <= 0 || profile_slope(cutter, aside, hi) <= slope)
            return hi;
        if (lo > 0 && profile_slope(cutter, aside, lo) >= slope)
            return lo;
        t = bull_contact(cutter, aside, slope);
    }
    return max2(min2(t, hi), lo);
}
