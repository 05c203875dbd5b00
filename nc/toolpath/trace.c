/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/trace.h"

#include <string.h>

#include "nc/toolpath/smooth.h"

/* Contact further than this from the facet's normal is a roll around an edge, not a touch; on what
 * lies beyond the region's border, further from the normal at the border. */
#define ROLL_COS 0.94
#define BORDER_COS 0.8
/* Refinement ends where a move is shorter than this share of the chord share. */
#define SHORTEST 0.5
#define ROUNDS 24

typedef enum {
    BLOCKED, /* nothing below, under the floor, or shank or holder collides */
    FREE,    /* on the part, outside of what is wanted */
    ROLL,    /* at a wanted facet, around its edge */
    TOUCH
} State;

typedef struct {
    double t;
    SegVec3 tip;
    State state;
    bool near; /* may become part of a piece */
    bool open; /* the interval that begins here is still to be refined */
} Point;

typedef struct {
    size_t pass, after; /* the new point follows this one */
    Point point;
} Middle;

static void lay(const NcTrace *trace, const NcPass *passes, NcLocate locate, const void *curves,
                Middle *middles, size_t n);
static void mark_near(const NcTrace *trace, GArray *points);
static bool refine(const NcTrace *trace, const NcPass *passes, NcLocate locate, const void *curves,
                   GArray **points, size_t n_passes);
static void cut_out(const NcTrace *trace, const NcPass *pass, GArray *points, size_t index,
                    GArray *pieces);

double nc_trace_pitch_mm(const NcTrace *trace)
{
    /* A ball sinks w²/8R into a slot of width w. */
    double r = fmax(trace->body.cutter.corner_radius_mm, trace->body.cutter.radius_mm / 4);
    return sqrt(8 * r * trace->chord_mm);
}

GArray *nc_trace(const NcTrace *trace, const NcPass *passes, size_t n_passes, NcLocate locate,
                 const void *curves)
{
    size_t n = 0;
    for (size_t p = 0; p < n_passes; p++)
        n += passes[p].n + 1;
    g_autofree Middle *first = g_new0(Middle, n + 1);
    n = 0;
    for (size_t p = 0; p < n_passes; p++)
        for (size_t i = 0; i <= passes[p].n; i++) {
            double s = (double)i / (double)passes[p].n;
            first[n].pass = p;
            first[n++].point.t = (1 - s) * passes[p].t0 + s * passes[p].t1;
        }
    lay(trace, passes, locate, curves, first, n);

    g_autofree GArray **points = g_new(GArray *, n_passes + 1);
    for (size_t p = 0, k = 0; p < n_passes; p++) {
        points[p] = g_array_new(FALSE, FALSE, sizeof(Point));
        for (size_t i = 0; i <= passes[p].n; i++)
            g_array_append_val(points[p], first[k++].point);
        mark_near(trace, points[p]);
    }
    for (int round = 0; round < ROUNDS; round++)
        if (!refine(trace, passes, locate, curves, points, n_passes))
            break;

    GArray *pieces = g_array_new(FALSE, FALSE, sizeof(NcPiece));
    for (size_t p = 0; p < n_passes; p++) {
        cut_out(trace, &passes[p], points[p], p, pieces);
        g_array_unref(points[p]);
    }
    nc_smooth(trace, pieces);
    return pieces;
}

void nc_pieces_free(GArray *pieces)
{
    if (!pieces)
        return;
    for (guint i = 0; i < pieces->len; i++)
        g_free(g_array_index(pieces, NcPiece, i).tips);
    g_array_unref(pieces);
}

/* ------------------------------------------------------------------ laying points */

/* What a drop found. */
typedef struct {
    double z;
    int32_t triangle;
    SegVec3 point;
} Contact;

/* Many of them. */
typedef struct {
    double *z;
    int32_t *triangle;
    SegVec3 *point;
} Drops;

static Drops drops_new(size_t n)
{
    return (Drops){g_new0(double, n + 1), g_new0(int32_t, n + 1), g_new0(SegVec3, n + 1)};
}

static void drops_clear(Drops *drops)
{
    g_free(drops->z);
    g_free(drops->triangle);
    g_free(drops->point);
}

/* Does the cutter with its tip there touch the point within this cosine of the normal? */
static bool touches(NcCutter cutter, SegVec3 tip, SegVec3 point, SegVec3 normal, double cosine)
{
    double r = cutter.corner_radius_mm, flat = cutter.radius_mm - r;
    double dx = point.x - tip.x, dy = point.y - tip.y, d = hypot(dx, dy);
    if (r <= 0)
        return true;
    if (d <= flat)
        return normal.z >= cosine;
    double out = (d - flat) / r, up = (tip.z + r - point.z) / r;
    SegVec3 to_centre = seg_unit(seg_vec3(-dx / d * out, -dy / d * out, up));
    return seg_dot(to_centre, normal) >= cosine;
}

/* Does the cutter touch the part beyond the region's border, but within the overlap of it, and as
 * the region goes on there? */
static bool is_overlap(const NcTrace *trace, SegVec3 tip, SegVec3 point)
{
    double o = trace->overlap_mm;
    NcCutter ball = {o, o};
    int32_t facet;
    double centre = nc_drop(trace->region->terrain, ball, point.x, point.y, &facet, NULL) + o;
    if (o <= 0 || facet < 0 || centre < point.z || centre > point.z + 2 * o)
        return false;
    SegVec3 normal = trace->region->facets[facet].normal;
    return touches(trace->body.cutter, tip, point, normal, BORDER_COS);
}

static State state_of(const NcTrace *trace, const NcPass *pass, SegVec3 tip, double wish,
                      double lift, const Contact *part, const Contact *region)
{
    if (!isfinite(tip.z) || tip.z < trace->floor_mm ||
        !nc_body_clear(trace->terrain, &trace->body, tip))
        return BLOCKED;
    if (!trace->region || (lift >= 0 && isfinite(wish) && tip.z - wish <= lift))
        return TOUCH;
    if (region->triangle >= 0 && tip.z - region->z <= trace->chord_mm) {
        if (lift < 0 || (pass->needed && !(pass->needed[region->triangle] < pass->below)))
            return FREE; /* other passes cut that */
        SegVec3 normal = trace->region->facets[region->triangle].normal;
        return touches(trace->body.cutter, tip, region->point, normal, ROLL_COS) ? TOUCH : ROLL;
    }
    bool coarse = !pass->needed || isinf(pass->below);
    return coarse && part->triangle >= 0 && is_overlap(trace, tip, part->point) ? TOUCH : FREE;
}

/*
 * Fills in tips and states of points whose pass and t are given: the cutter laid on the whole part;
 * what lies on the region alone no lower touches the region, whatever else it touches.
 */
static void lay(const NcTrace *trace, const NcPass *passes, NcLocate locate, const void *curves,
                Middle *middles, size_t n)
{
    g_autofree double *x = g_new(double, n + 1), *y = g_new(double, n + 1);
    g_autofree double *wish = g_new(double, n + 1), *lift = g_new(double, n + 1);
    Drops part = drops_new(n), region = drops_new(n);
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < n; i++) {
        SegVec3 tip = {0, 0, -INFINITY};
        lift[i] = locate(curves, middles[i].pass, middles[i].point.t, &tip);
        x[i] = tip.x;
        y[i] = tip.y;
        wish[i] = tip.z;
    }
    NcCutter cutter = trace->body.cutter;
    nc_drop_batch(trace->terrain, cutter, n, x, y, part.z, part.triangle, part.point);
    if (trace->region)
        nc_drop_batch(trace->region->terrain, cutter, n, x, y, region.z, region.triangle,
                      region.point);
#pragma omp parallel for schedule(dynamic, 64)
    for (size_t i = 0; i < n; i++) {
        Point *p = &middles[i].point;
        Contact on_part = {part.z[i], part.triangle[i], part.point[i]};
        Contact on_region = {region.z[i], region.triangle[i], region.point[i]};
        p->tip = seg_vec3(x[i], y[i], fmax(part.z[i], wish[i]));
        p->state = state_of(trace, &passes[middles[i].pass], p->tip, wish[i], lift[i], &on_part,
                            &on_region);
        p->open = true;
    }
    drops_clear(&part);
    drops_clear(&region);
}

/* ---------------------------------------------------------------------- refining */

/* Points that a piece may use: those that touch, and as far as the overlap beyond them. */
static void mark_near(const NcTrace *trace, GArray *points)
{
    Point *p = (Point *)points->data;
    for (int way = 0; way < 2; way++) {
        double left = -1;
        for (guint k = 0; k < points->len; k++) {
            guint i = way ? points->len - 1 - k : k;
            if (p[i].state >= ROLL)
                left = trace->overlap_mm + trace->bridge_mm;
            else if (p[i].state == BLOCKED)
                left = -1;
            if (left >= 0)
                p[i].near = true;
            guint next = way ? i - 1 : i + 1;
            if (k + 1 < points->len && p[i].state != BLOCKED && p[next].state != BLOCKED)
                left -= seg_distance(p[i].tip, p[next].tip);
        }
    }
}

static double off_chord(SegVec3 a, SegVec3 b, SegVec3 p)
{
    SegVec3 ab = seg_sub(b, a);
    double length2 = seg_dot(ab, ab);
    double s = length2 > 0 ? seg_dot(seg_sub(p, a), ab) / length2 : 0;
    return seg_distance(p, seg_along(a, ab, fmin(fmax(s, 0), 1)));
}

/* In the plane; along a line straight up a wall, in height. */
static double apart(SegVec3 a, SegVec3 b)
{
    double level = hypot(b.x - a.x, b.y - a.y), rise = fabs(b.z - a.z);
    return level > 0 || !isfinite(rise) ? level : rise;
}

/* Is the interval worth halving again? */
static bool is_open(const NcTrace *trace, const Point *a, const Point *b)
{
    if (!a->open || !(a->near || b->near))
        return false;
    if (a->state == BLOCKED || b->state == BLOCKED)
        return (a->state == TOUCH || b->state == TOUCH) &&
               apart(a->tip, b->tip) > nc_trace_pitch_mm(trace) / 8;
    return apart(a->tip, b->tip) > SHORTEST * trace->chord_mm;
}

/* Lays the middles of all open intervals; those that are off the chord stay open on both sides. */
static bool refine(const NcTrace *trace, const NcPass *passes, NcLocate locate, const void *curves,
                   GArray **points, size_t n_passes)
{
    g_autoptr(GArray) middles = g_array_new(FALSE, TRUE, sizeof(Middle));
    for (size_t p = 0; p < n_passes; p++)
        for (guint i = 0; i + 1 < points[p]->len; i++) {
            Point *a = &g_array_index(points[p], Point, i), *b = a + 1;
            if (!is_open(trace, a, b))
                continue;
            Middle middle = {.pass = p, .after = i, .point.t = (a->t + b->t) / 2};
            g_array_append_val(middles, middle);
        }
    if (middles->len == 0)
        return false;
    Middle *m = (Middle *)middles->data;
    lay(trace, passes, locate, curves, m, middles->len);
    for (size_t p = 0, k = 0; p < n_passes; p++) {
        GArray *old = points[p];
        points[p] = g_array_sized_new(FALSE, FALSE, sizeof(Point), old->len + 16);
        for (guint i = 0; i < old->len; i++) {
            Point *a = &g_array_index(old, Point, i);
            bool halved = k < middles->len && m[k].pass == p && m[k].after == i;
            if (!halved) {
                a->open = false;
                g_array_append_val(points[p], *a);
                continue;
            }
            Point *b = a + 1, *c = &m[k++].point;
            c->near = a->near || b->near;
            bool usable = a->state != BLOCKED && b->state != BLOCKED && c->state != BLOCKED;
            a->open = c->open = !usable || off_chord(a->tip, b->tip, c->tip) > trace->chord_mm / 2;
            g_array_append_val(points[p], *a);
            g_array_append_val(points[p], *c);
        }
        g_array_unref(old);
    }
    return true;
}

/* ------------------------------------------------------------------ cutting out */

/* Finer passes end among coarser ones: they run on by the overlap. */
static void add_piece(const NcTrace *trace, const NcPass *pass, const Point *p, guint n, guint from,
                      guint to, size_t index, GArray *pieces)
{
    double more = pass->needed && isfinite(pass->below) ? trace->overlap_mm : 0;
    for (double left = more; from > 0 && left > 0 && p[from - 1].state != BLOCKED; from--)
        left -= seg_distance(p[from].tip, p[from - 1].tip);
    for (double left = more; to + 1 < n && left > 0 && p[to + 1].state != BLOCKED; to++)
        left -= seg_distance(p[to].tip, p[to + 1].tip);
    NcPiece piece = {.n = to - from + 1, .pass = index};
    piece.tips = g_new(SegVec3, piece.n);
    for (guint i = from; i <= to; i++)
        piece.tips[i - from] = p[i].tip;
    g_array_append_val(pieces, piece);
}

/* Runs of touching points; rolls around edges between two of them, and short gaps, are cut
 * through. */
static void cut_out(const NcTrace *trace, const NcPass *pass, GArray *points, size_t index,
                    GArray *pieces)
{
    const Point *p = (const Point *)points->data;
    guint n = points->len;
    for (guint i = 0; i < n; i++) {
        if (p[i].state != TOUCH)
            continue;
        guint last = i;
        double gap = 0;
        bool rolls = true;
        for (guint j = i + 1; j < n && p[j].state != BLOCKED; j++) {
            gap += seg_distance(p[j - 1].tip, p[j].tip);
            rolls = rolls && p[j].state >= ROLL;
            if (!rolls && gap > trace->bridge_mm)
                break;
            if (p[j].state == TOUCH) {
                last = j;
                gap = 0;
                rolls = true;
            }
        }
        add_piece(trace, pass, p, n, i, last, index, pieces);
        i = last;
    }
}
