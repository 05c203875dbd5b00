/* SPDX-License-Identifier: Apache-2.0 */
/*
 * With the line held, an end of the interval is a function of s, where on the move the body stands:
 * concave for the upper end, convex for the lower. Its extreme over the whole line of the move has
 * a closed form; where that lies beyond an end of the move, the extreme is at that end, or the line
 * misses the body on all of the move.
 */
#include "nc/stock/sweep_axis.h"

/* What has been found so far of the union of the body's pieces. */
typedef struct {
    double t[2];
    SegVec3 normal[2];
} Ends;

static void take(Ends *ends, int side, double t, SegVec3 normal)
{
    if (side ? t > ends->t[1] : t < ends->t[0]) {
        ends->t[side] = t;
        ends->normal[side] = normal;
    }
}

/* Without the care for NaN that keeps fmin and fmax from being one instruction. */
static double greater(double a, double b)
{
    return a > b ? a : b;
}

static double clamp(double s, double from, double to)
{
    return s < from ? from : s > to ? to : s;
}

/* ----------------------------------------------------------------------- spheres */

/* e: the line seen from the centre at s = 0, without its own coordinate w; d: the way. */
typedef struct {
    double eu, ev;
    double du, dv, dw;
} Passing;

/* The end (side 0: lower) of the line in the moved sphere, from the centre at s = 0; the place on
 * the way that makes it. */
static bool sphere_end(const Passing *p, double radius, int side, double *w, double *s)
{
    double square = p->du * p->du + p->dv * p->dv;
    double sense = side ? 1 : -1;
    if (square == 0) {
        double rest = radius * radius - p->eu * p->eu - p->ev * p->ev;
        *s = p->dw * sense > 0;
        *w = *s * p->dw + sense * sqrt(greater(rest, 0));
        return rest >= 0;
    }
    double level = sqrt(square), across = (p->eu * p->dv - p->ev * p->du) / level;
    double along = (p->eu * p->du + p->ev * p->dv) / level;
    double rest = (radius - across) * (radius + across);
    if (rest < 0)
        return false;
    double lift = sqrt(rest) * p->dw / sqrt(square + p->dw * p->dw);
    double at = clamp(along + sense * lift, 0, level), off = at - along;
    if (rest < off * off)
        return false;
    *s = at / level;
    *w = *s * p->dw + sense * sqrt(rest - off * off);
    return true;
}

/* ------------------------------------------------------------------ X and Y rays */

/* A piece in the plane of the ray; p: along it, o: across, from the tip at s = 0. */
typedef struct {
    double o, z; /* of the ray */
    double dp, d_o, dz;
    int axis;
} Level;

/* A vector of the plane in space. */
static SegVec3 in_space(const Level *l, double p, double o, double z)
{
    return l->axis == 0 ? seg_vec3(p, o, z) : seg_vec3(o, p, z);
}

/* Where the ray leaves the disc at s; false where it misses it. */
static bool disc_end(const Level *l, double radius, double growth, double s, double sense,
                     double *p)
{
    double r = radius + s * growth, off = l->o - s * l->d_o;
    double half = (r - off) * (r + off);
    *p = s * l->dp + sense * sqrt(greater(half, 0));
    return half >= 0 && r >= 0;
}

/* The section is the hull of the discs at s0 and s1, whose radius and centre go evenly; its end
 * along the ray, and the s of the disc that makes it. */
static bool discs_end(const Level *l, double radius, double growth, double s0, double s1, int side,
                      double *p, double *s)
{
    double square = l->dp * l->dp + l->d_o * l->d_o, sense = side ? 1 : -1;
    double root = sqrt(greater(square - growth * growth, 0));
    /* The two lines that touch all discs, m·(p, o) = radius; m·d = -growth. */
    for (int k = 0; k < 2 && root != 0; k++, root = -root) {
        double mp = (root * l->d_o - growth * l->dp) / square;
        double mo = (-root * l->dp - growth * l->d_o) / square;
        double at = (radius - mo * l->o) / mp;
        *s = (mp * l->o - mo * at) / (mp * l->d_o - mo * l->dp);
        if (mp * sense > 0 && radius + *s * growth >= 0) {
            *s = clamp(*s, s0, s1);
            return disc_end(l, radius, growth, *s, sense, p);
        }
    }
    /* Without such a line on this side the end goes one way, towards the greater discs. */
    double p1;
    bool first = disc_end(l, radius, growth, s0, sense, p);
    bool last = disc_end(l, radius, growth, s1, sense, &p1);
    *s = s0;
    if (last && (!first || p1 * sense > *p * sense)) {
        *p = p1;
        *s = s1;
    }
    return first || last;
}

/* Outward normal where the ray leaves the disc at s. */
static SegVec3 disc_normal(const Level *l, double p, double s, double slope)
{
    double np = p - s * l->dp, no = l->o - s * l->d_o, r = sqrt(np * np + no * no);
    if (r == 0)
        return seg_vec3(0, 0, -1);
    double scale = 1 / (r * sqrt(1 + slope * slope));
    return in_space(l, np * scale, no * scale, -slope * r * scale);
}

/* Where a rim goes through the ray's height the surface is square to the move. */
static SegVec3 rim_normal(const Level *l, SegVec3 cone, bool upper)
{
    SegVec3 d = in_space(l, l->dp, l->d_o, l->dz), face = {0, 0, upper ? 1 : -1};
    double of_cone = fabs(seg_dot(cone, d)), of_face = fabs(l->dz);
    return seg_unit(seg_along(seg_scale(cone, of_face), face, of_cone));
}

static void level_frustum(const Level *l, const NcFrustum *f, Ends *ends)
{
    double slope = (f->r1 - f->r0) / (f->z1 - f->z0), s0 = 0, s1 = 1;
    if (l->dz == 0) {
        if (l->z < f->z0 || l->z > f->z1)
            return;
    } else {
        double low = (l->z - f->z0) / l->dz, high = (l->z - f->z1) / l->dz;
        s0 = greater(low < high ? low : high, 0);
        s1 = clamp(greater(low, high), -1, 1);
        if (s0 > s1)
            return;
    }
    double radius = f->r0 + slope * (l->z - f->z0), growth = -slope * l->dz;
    for (int side = 0; side < 2; side++) {
        double p, s;
        if (!discs_end(l, radius, growth, s0, s1, side, &p, &s))
            continue;
        SegVec3 normal = disc_normal(l, p, s, slope);
        bool entered = s == s0 && s0 > 0, left = s == s1 && s1 < 1;
        if (entered || left) /* going down, the lower rim comes to the ray first */
            normal = rim_normal(l, normal, entered != (l->dz < 0));
        take(ends, side, p, normal);
    }
}

/* A torus on a level move: one disc, and its normal leans with the height. */
static void level_torus(const Level *l, const NcRoundedDisc *d, Ends *ends)
{
    double up = l->z - d->centre, out2 = (d->round - up) * (d->round + up);
    if (out2 < 0)
        return;
    double out = sqrt(out2);
    for (int side = 0; side < 2; side++) {
        double p, s;
        if (!discs_end(l, d->disc + out, 0, 0, 1, side, &p, &s))
            continue;
        SegVec3 n = disc_normal(l, p, s, 0);
        take(ends, side, p, seg_vec3(n.x * out / d->round, n.y * out / d->round, up / d->round));
    }
}

static void level_sphere(const Level *l, const NcRoundedDisc *d, Ends *ends)
{
    Passing passing = {l->o, l->z - d->centre, l->d_o, l->dz, l->dp};
    for (int side = 0; side < 2; side++) {
        double p, s;
        if (sphere_end(&passing, d->round, side, &p, &s))
            take(ends, side, p,
                 seg_scale(
                     in_space(l, p - s * l->dp, passing.eu - s * l->d_o, passing.ev - s * l->dz),
                     1 / d->round));
    }
}

bool nc_swept_level(const NcToolBody *body, SegVec3 a, SegVec3 b, int axis, SegVec3 origin,
                    double t[2], SegVec3 normals[2])
{
    Ends ends = {.t = {INFINITY, -INFINITY}};
    SegVec3 d = seg_sub(b, a), q = seg_sub(origin, a);
    const NcRoundedDisc *rounded = &body->rounded;
    if (rounded->disc > 0 && rounded->round > 0 && d.z != 0) {
        SegVec3 w = {axis == 0, axis == 1, 0};
        bool meets = nc_swept_interval(body, a, b, origin, w, &t[0], &t[1], normals);
        t[0] += axis == 0 ? origin.x : origin.y;
        t[1] += axis == 0 ? origin.x : origin.y;
        return meets;
    }
    Level l = axis == 0 ? (Level){q.y, q.z, d.x, d.y, d.z, 0} : (Level){q.x, q.z, d.y, d.x, d.z, 1};
    for (int i = 0; i < body->n_frusta; i++)
        level_frustum(&l, &body->frustum[i], &ends);
    if (rounded->round > 0)
        (rounded->disc > 0 ? level_torus : level_sphere)(&l, rounded, &ends);
    for (int i = 0; i < 2; i++) {
        t[i] = ends.t[i] + (axis == 0 ? a.x : a.y);
        normals[i] = ends.normal[i];
    }
    return ends.t[0] <= ends.t[1];
}

bool nc_swept_contains(const NcToolBody *body, SegVec3 a, SegVec3 b, SegVec3 point)
{
    double t[2];
    SegVec3 normals[2];
    return nc_swept_level(body, a, b, 0, point, t, normals) && t[0] <= point.x && point.x <= t[1];
}

/* ------------------------------------------------------------------------- Z rays */

/* The stretch of the way on which (x, y) is within `radius` of the axis. */
static bool within(const Passing *p, double radius, double s[2])
{
    double square = p->du * p->du + p->dv * p->dv;
    if (square == 0) {
        s[0] = 0;
        s[1] = 1;
        return p->eu * p->eu + p->ev * p->ev <= radius * radius;
    }
    double level = sqrt(square), across = (p->eu * p->dv - p->ev * p->du) / level;
    double rest = (radius - across) * (radius + across);
    if (rest < 0)
        return false;
    double middle = (p->eu * p->du + p->ev * p->dv) / level, half = sqrt(rest);
    s[0] = greater((middle - half) / level, 0);
    s[1] = clamp((middle + half) / level, -1, 1);
    return s[0] <= s[1];
}

static SegVec3 square_to(SegVec3 d, SegVec3 side, SegVec3 face)
{
    return seg_unit(
        seg_along(seg_scale(side, fabs(seg_dot(face, d))), face, fabs(seg_dot(side, d))));
}

/* The face within a rim, and what the rim sweeps; `slope` is that of the cone beside it. */
static void floor_disc(const Passing *p, double height, double radius, double slope, bool downwards,
                       Ends *ends)
{
    double s[2];
    if (!within(p, radius, s))
        return;
    double at = p->dw < 0 ? s[1] : s[0];
    SegVec3 normal = {0, 0, downwards ? -1 : 1}, d = {p->du, p->dv, p->dw};
    if (at > 0 && at < 1 && p->dw != 0) {
        double x = p->eu - at * p->du, y = p->ev - at * p->dv;
        SegVec3 side = seg_unit(seg_vec3(x, y, -slope * hypot(x, y)));
        normal = square_to(d, side, normal);
    }
    take(ends, 0, height + at * p->dw, normal);
}

/* The cone from r0 to r1: where the way is level enough it touches somewhere between, else only at
 * the ends of the way. */
static void floor_cone(const Passing *p, const NcFrustum *f, Ends *ends)
{
    double slope = (f->r1 - f->r0) / (f->z1 - f->z0);
    double square = p->du * p->du + p->dv * p->dv, level = sqrt(square);
    double tries[3] = {0, 1};
    int n = square > 0 || p->dw != 0 ? 2 : 1;
    if (fabs(slope * p->dw) < level) {
        double across = fabs(p->eu * p->dv - p->ev * p->du) / level;
        double along = (p->eu * p->du + p->ev * p->dv) / level;
        /* Distance grows along the way as the tip falls: (at - along)/distance = -slope·dw/level.
         */
        double c = -slope * p->dw / level;
        double at = (along + across * c / sqrt((1 - c) * (1 + c))) / level;
        if (at > 0 && at < 1)
            tries[n++] = at;
    }
    for (int i = 0; i < n; i++) {
        double x = p->eu - tries[i] * p->du, y = p->ev - tries[i] * p->dv, r = sqrt(x * x + y * y);
        if (r < f->r0 || r > f->r1 || r == 0)
            continue;
        double scale = 1 / sqrt(1 + slope * slope);
        take(ends, 0, f->z0 + (r - f->r0) / slope + tries[i] * p->dw,
             seg_vec3(x / r * scale, y / r * scale, -slope * scale));
    }
}

static void floor_frustum(const Passing *p, const NcFrustum *f, Ends *ends)
{
    double slope = (f->r1 - f->r0) / (f->z1 - f->z0);
    floor_disc(p, f->z0, f->r0, slope, true, ends);
    if (slope > 0) {
        floor_cone(p, f, ends);
        floor_disc(p, f->z1, f->r1, slope, false, ends);
    }
}

static void floor_torus(const Passing *p, const NcRoundedDisc *d, Ends *ends)
{
    double square = p->du * p->du + p->dv * p->dv;
    double s = square > 0 ? clamp((p->eu * p->du + p->ev * p->dv) / square, 0, 1) : 0;
    double x = p->eu - s * p->du, y = p->ev - s * p->dv, r = sqrt(x * x + y * y);
    double out = greater(r - d->disc, 0), rest = (d->round - out) * (d->round + out);
    if (rest < 0)
        return;
    double down = sqrt(rest), lean = r > 0 ? out / (r * d->round) : 0;
    take(ends, 0, d->centre - down, seg_vec3(x * lean, y * lean, -down / d->round));
}

bool nc_swept_floor(const NcToolBody *body, SegVec3 a, SegVec3 b, double x, double y, double *z,
                    SegVec3 *normal)
{
    Ends ends = {.t = {INFINITY, -INFINITY}};
    Passing p = {x - a.x, y - a.y, b.x - a.x, b.y - a.y, b.z - a.z};
    const NcRoundedDisc *rounded = &body->rounded;
    if (rounded->disc > 0 && rounded->round > 0 && p.dw != 0) {
        double t[2];
        SegVec3 normals[2];
        bool meets = nc_swept_interval(body, a, b, seg_vec3(x, y, 0), seg_vec3(0, 0, 1), &t[0],
                                       &t[1], normals);
        *z = t[0];
        *normal = normals[0];
        return meets;
    }
    double w, s;
    if (rounded->round > 0 && rounded->disc > 0) {
        floor_torus(&p, rounded, &ends);
    } else if (rounded->round > 0 && sphere_end(&p, rounded->round, 0, &w, &s)) {
        SegVec3 n = {p.eu - s * p.du, p.ev - s * p.dv, w - s * p.dw};
        take(&ends, 0, rounded->centre + w, seg_scale(n, 1 / rounded->round));
    }
    /* Over a sphere's middle nothing lies lower than the sphere. */
    double enough = isfinite(ends.t[0]) && rounded->disc == 0 ? rounded->centre : INFINITY;
    for (int i = 0; i < body->n_frusta; i++)
        if (body->frustum[i].z0 < enough)
            floor_frustum(&p, &body->frustum[i], &ends);
    *z = ends.t[0] + a.z;
    *normal = ends.normal[0];
    return isfinite(ends.t[0]);
}
