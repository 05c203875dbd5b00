/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All points in the sweep are origin + t·direction = a + s·(b - a) + (a point of the body), with s
 * in [0, 1]. In the plane of (t, s) they form a convex set, bounded by the body's own surface and
 * by s = 0 and s = 1. The extremes of t on it are among few points that have closed forms: each is
 * computed, asked whether it belongs to the body, and the outermost taken.
 */
#include "nc/stock/sweep.h"

/* A candidate this far outside one of its bounds still belongs. */
#define SLACK_MM 1e-10

/* One line against one move; q: origin seen from a. */
typedef struct {
    SegVec3 q, w;
    SegVec3 d; /* b - a */
    double length;
    double t[2];
    SegVec3 normal[2];
} Query;

static void frustum_ends(Query *query, const NcFrustum *frustum);
static void capsule_ends(Query *query, SegVec3 q, double radius);
static void rounded_ends(Query *query, const NcRoundedDisc *rounded);

bool nc_swept_interval(const NcToolBody *body, SegVec3 a, SegVec3 b, SegVec3 origin,
                       SegVec3 direction, double *t0, double *t1, SegVec3 normals[2])
{
    Query query = {.w = direction, .t = {INFINITY, -INFINITY}};
    query.d = seg_sub(b, a);
    query.length = seg_norm(query.d);
    /* t is counted from the line's point nearest to the middle of the move: small numbers. */
    SegVec3 middle = seg_vec3(0, 0, (body->bottom + body->top) / 2);
    middle = seg_add(middle, seg_lerp(a, b, 0.5));
    double shift = seg_dot(seg_sub(middle, origin), direction);
    query.q = seg_sub(seg_along(origin, direction, shift), a);
    for (int i = 0; i < body->n_frusta; i++)
        frustum_ends(&query, &body->frustum[i]);
    if (body->rounded.round > 0)
        rounded_ends(&query, &body->rounded);
    *t0 = query.t[0] + shift;
    *t1 = query.t[1] + shift;
    if (normals) {
        normals[0] = query.normal[0];
        normals[1] = query.normal[1];
    }
    return query.t[0] <= query.t[1];
}

static void take(Query *query, double t, SegVec3 normal)
{
    if (t < query->t[0]) {
        query->t[0] = t;
        query->normal[0] = normal;
    }
    if (t > query->t[1]) {
        query->t[1] = t;
        query->normal[1] = normal;
    }
}

static bool on_move(const Query *query, double s)
{
    return s * query->length >= -SLACK_MM && (s - 1) * query->length <= SLACK_MM;
}

static SegVec3 place(const Query *query, double t, double s)
{
    return seg_along(seg_along(query->q, query->w, t), query->d, -s);
}

/* ------------------------------------------------------------------------- frustum */

static bool between(const NcFrustum *f, double z)
{
    return z >= f->z0 - SLACK_MM && z <= f->z1 + SLACK_MM;
}

static SegVec3 cone_normal(SegVec3 p, double slope)
{
    double radius = hypot(p.x, p.y);
    if (radius == 0)
        return seg_vec3(0, 0, -1);
    double scale = 1 / sqrt(1 + slope * slope);
    return seg_vec3(p.x / radius * scale, p.y / radius * scale, -slope * scale);
}

/* The two planes that touch the cone and hold the move's direction: m·(x,y) = radius at z. */
static void frustum_tangents(Query *query, const NcFrustum *f, double slope)
{
    SegVec3 q = query->q, w = query->w, d = query->d;
    double level = hypot(d.x, d.y), radius = f->r0 + slope * (q.z - f->z0);
    double c = slope * d.z / level;
    if (!(level > 0) || !(fabs(c) < 1))
        return;
    double ux = d.x / level, uy = d.y / level;
    for (int side = -1; side <= 1; side += 2) {
        double sn = side * sqrt((1 - c) * (1 + c));
        double mx = c * ux - sn * uy, my = c * uy + sn * ux;
        double t = (radius - mx * q.x - my * q.y) / (mx * w.x + my * w.y - slope * w.z);
        double s = (mx * (q.y + t * w.y) - my * (q.x + t * w.x)) / (mx * d.y - my * d.x);
        if (!isfinite(t) || !isfinite(s) || !on_move(query, s))
            continue;
        if (between(f, q.z + t * w.z - s * d.z))
            take(query, t, cone_normal(seg_vec3(mx, my, 0), slope));
    }
}

/* The cone itself where the move begins (s = 0) or ends (s = 1). */
static void frustum_side(Query *query, const NcFrustum *f, double slope, double s)
{
    SegVec3 p = place(query, 0, s), w = query->w;
    double e = f->r0 + slope * (p.z - f->z0), rise = slope * w.z;
    double square = w.x * w.x + w.y * w.y - rise * rise;
    double half = p.x * w.x + p.y * w.y - e * rise;
    double xe = p.x * rise - e * w.x, ye = p.y * rise - e * w.y, xy = p.x * w.y - p.y * w.x;
    double discriminant = xe * xe + ye * ye - xy * xy;
    if (discriminant < 0)
        return;
    double far = half >= 0 ? -half - sqrt(discriminant) : -half + sqrt(discriminant);
    double distance = hypot(p.x, p.y);
    double t[2] = {far / square, (distance - e) * (distance + e) / far};
    for (int i = 0; i < 2; i++) {
        if (!isfinite(t[i]))
            continue;
        SegVec3 at = seg_along(p, w, t[i]);
        if (e + t[i] * rise >= -SLACK_MM && between(f, at.z))
            take(query, t[i], cone_normal(at, slope));
    }
}

/* Normal of the surface that a rim sweeps: between the cone's and the face's, square to the move.
 */
static SegVec3 rim_normal(const Query *query, SegVec3 p, double slope, SegVec3 face)
{
    SegVec3 cone = cone_normal(p, slope);
    double of_cone = fabs(seg_dot(cone, query->d)), of_face = fabs(seg_dot(face, query->d));
    if (of_cone + of_face == 0)
        return face;
    return seg_unit(seg_along(seg_scale(cone, of_face), face, of_cone));
}

/* The rim at height z while it moves, and the face within it where the move begins and ends. */
static void frustum_rim(Query *query, const NcFrustum *f, double slope, bool upper)
{
    double z = upper ? f->z1 : f->z0, radius = upper ? f->r1 : f->r0;
    SegVec3 face = seg_vec3(0, 0, upper ? 1 : -1);
    SegVec3 q = query->q, w = query->w, d = query->d;
    for (int s = 0; s <= 1; s++) {
        double t = (z - q.z + s * d.z) / w.z;
        SegVec3 p = place(query, t, s);
        if (isfinite(t) && hypot(p.x, p.y) <= radius + SLACK_MM)
            take(query, t, face);
    }
    double n = hypot(w.z, d.z);
    if (!(n > 0) || !(query->length > 0))
        return;
    /* At height z: (t, s) = (t0, s0) + u·(d.z, w.z)/n. */
    double t0 = 0, s0 = 0;
    if (fabs(w.z) >= fabs(d.z))
        t0 = (z - q.z) / w.z;
    else
        s0 = (q.z - z) / d.z;
    double dt = d.z / n, ds = w.z / n;
    SegVec3 p = place(query, t0, s0);
    double vx = dt * w.x - ds * d.x, vy = dt * w.y - ds * d.y, v2 = vx * vx + vy * vy;
    double across = p.x * vy - p.y * vx, discriminant = v2 * radius * radius - across * across;
    if (discriminant < 0)
        return;
    for (int side = -1; side <= 1; side += 2) {
        double u = (side * sqrt(discriminant) - (p.x * vx + p.y * vy)) / v2;
        double t = t0 + u * dt, s = s0 + u * ds;
        if (isfinite(u) && on_move(query, s))
            take(query, t, rim_normal(query, place(query, t, s), slope, face));
    }
}

static void frustum_ends(Query *query, const NcFrustum *f)
{
    double slope = (f->r1 - f->r0) / (f->z1 - f->z0);
    frustum_tangents(query, f, slope);
    frustum_side(query, f, slope, 0);
    if (query->length > 0)
        frustum_side(query, f, slope, 1);
    frustum_rim(query, f, slope, false);
    frustum_rim(query, f, slope, true);
}

/* ------------------------------------------------------------------ sphere and torus */

/* A sphere moved from 0 to d; q: the line's point t = 0. */
static void capsule_ends(Query *query, SegVec3 q, double radius)
{
    SegVec3 w = query->w, d = seg_unit(query->d), moment = seg_cross(q, w);
    double t[2];
    if (query->length > 0) {
        double wd = seg_dot(w, d), across = seg_dot(moment, d);
        SegVec3 square = seg_along(w, d, -wd);
        double v2 = seg_dot(square, square), discriminant = v2 * radius * radius - across * across;
        double root = sqrt(fmax(discriminant, 0));
        t[0] = (-seg_dot(q, square) - root) / v2;
        t[1] = (-seg_dot(q, square) + root) / v2;
        for (int i = 0; i < 2 && discriminant >= 0; i++) {
            SegVec3 p = seg_along(q, w, t[i]);
            double s = seg_dot(p, d) / query->length;
            if (isfinite(s) && on_move(query, s))
                take(query, t[i], seg_unit(seg_along(p, query->d, -s)));
        }
    }
    for (int s = 0; s <= (query->length > 0); s++) {
        SegVec3 centre = seg_along(q, query->d, -s);
        moment = seg_cross(centre, w);
        double discriminant = radius * radius - seg_dot(moment, moment);
        if (discriminant < 0)
            continue;
        for (int side = -1; side <= 1; side += 2) {
            double root = side * sqrt(discriminant) - seg_dot(centre, w);
            take(query, root, seg_unit(seg_along(centre, w, root)));
        }
    }
}

/* How fast the squared distance from p to the disc falls as the disc moves on, halved; `slope` its
 * derivative. Falls with s, because that distance is convex. */
static double approach(SegVec3 p, SegVec3 d, double disc, double s, double *slope)
{
    double x = p.x - s * d.x, y = p.y - s * d.y, z = p.z - s * d.z, r = hypot(x, y);
    *slope = -d.z * d.z;
    if (r <= disc)
        return z * d.z;
    double along = (x * d.x + y * d.y) / r, level = d.x * d.x + d.y * d.y;
    *slope -= along * along + (1 - disc / r) * fmax(level - along * along, 0);
    return (r - disc) * along + z * d.z;
}

/* Where on the move the disc is nearest to p: Newton, kept in a bracket by halving. */
static double nearest_on_move(SegVec3 p, SegVec3 d, double disc)
{
    double slope, level = d.x * d.x + d.y * d.y;
    if (d.z == 0)
        return level > 0 ? fmin(fmax((p.x * d.x + p.y * d.y) / level, 0), 1) : 0;
    if (approach(p, d, disc, 0, &slope) <= 0)
        return 0;
    if (approach(p, d, disc, 1, &slope) >= 0)
        return 1;
    double low = 0, high = 1, s = 0.5;
    for (int i = 0; i < 100 && high - low > 1e-16; i++) {
        double value = approach(p, d, disc, s, &slope);
        *(value > 0 ? &low : &high) = s;
        double next = s - value / slope;
        if (!(next > low && next < high))
            next = (low + high) / 2;
        if (fabs(next - s) < 1e-16)
            break;
        s = next;
    }
    return s;
}

/* Distance of p from the moved disc, and its gradient. */
static double disc_distance(const Query *query, double disc, SegVec3 p, SegVec3 *gradient)
{
    SegVec3 x = seg_along(p, query->d, -nearest_on_move(p, query->d, disc));
    double r = hypot(x.x, x.y), beyond = fmax(r - disc, 0);
    *gradient =
        beyond > 0 ? seg_vec3(x.x / r * beyond, x.y / r * beyond, x.z) : seg_vec3(0, 0, x.z);
    double distance = seg_norm(*gradient);
    *gradient = seg_unit(*gradient);
    return distance;
}

/* From outside at t towards `sense`: the first t where the distance is the rounding's radius. */
static bool torus_end(const Query *query, const NcRoundedDisc *r, SegVec3 q, double t, double sense,
                      double *end, SegVec3 *normal)
{
    for (int i = 0; i < 200; i++) {
        double beyond = disc_distance(query, r->disc, seg_along(q, query->w, t), normal) - r->round;
        double rate = seg_dot(*normal, query->w);
        *end = t;
        if (beyond <= SLACK_MM / 100)
            return true;
        if (!(rate * sense < 0))
            return false;
        double next = t - beyond / rate;
        if (next == t)
            return true;
        t = next;
    }
    return true;
}

static void rounded_ends(Query *query, const NcRoundedDisc *r)
{
    SegVec3 q = seg_along(query->q, seg_vec3(0, 0, 1), -r->centre);
    if (r->disc == 0) {
        capsule_ends(query, q, r->round);
        return;
    }
    Query around = *query;
    around.t[0] = INFINITY;
    around.t[1] = -INFINITY;
    capsule_ends(&around, q, r->disc + r->round);
    double t;
    SegVec3 normal;
    if (around.t[0] > around.t[1] || !torus_end(query, r, q, around.t[0], 1, &t, &normal))
        return;
    take(query, t, normal);
    if (torus_end(query, r, q, around.t[1], -1, &t, &normal))
        take(query, t, normal);
}
