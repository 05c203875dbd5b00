/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/gcode/compensation.h"

#include "nc/motion/path.h"

#include <string.h>

/* LinuxCNC: smaller corners are none: they are neither rounded nor cut short. */
#define NO_CORNER_RAD 0.05
/* Shorter moves in the plane have no direction. */
#define NO_LENGTH_MM 1e-9
#define SMALLEST_COSINE 1e-6

/* A move of the contour as programmed, and what the radius makes of it. */
typedef struct {
    NcPlanePoint from, to;       /* programmed */
    NcPlanePoint tangent;        /* unit, where it begins */
    NcPlanePoint arrival;        /* unit, where it ends */
    NcPlanePoint normal;         /* unit, where it begins, to the tool's side */
    NcPlanePoint end;            /* the tool's */
    NcPlanePoint centre;         /* of an arc */
    double radius_mm, offset_mm; /* of an arc: programmed, and the tool's */
    bool arc, inside;            /* the tool is on the side of its centre */
    int turn;                    /* 1 anticlockwise, -1 */
} Element;

static bool enter(NcCompensation *c, const NcMove *move, const char **why);
static bool follow(NcCompensation *c, const NcMove *move, GArray *out, const char **why);
static bool wait_for_next(NcCompensation *c, const NcWaitingMove *waiting, const char **why);
static bool settle(NcCompensation *c, NcPlanePoint end, const char **why);
static void flush(NcCompensation *c, GArray *out);
static void give(NcCompensation *c, NcMove move, GArray *out);

static bool fail(const char **why, const char *reason)
{
    *why = reason;
    return false;
}

static NcPlanePoint in_plane(const NcCompensation *c, SegVec3 point)
{
    NcPlaneAxes axes = nc_plane_axes(c->plane);
    return (NcPlanePoint){nc_axis_value(point, axes.first), nc_axis_value(point, axes.second)};
}

/* `point` moved within its plane. */
static SegVec3 with_plane(const NcCompensation *c, SegVec3 point, NcPlanePoint to)
{
    NcPlaneAxes axes = nc_plane_axes(c->plane);
    *nc_axis(&point, axes.first) = to.a;
    *nc_axis(&point, axes.second) = to.b;
    return point;
}

void nc_compensation_copy(NcCompensation *to, const NcCompensation *from)
{
    size_t used = (size_t)from->n_waiting * sizeof from->waiting[0];
    memcpy(to, from, offsetof(NcCompensation, waiting) + used);
}

void nc_compensation_begin(NcCompensation *c, int side, double radius_mm, double longer_rad,
                           int plane, SegVec3 position)
{
    if (!c->away)
        c->at = position;
    c->side = side;
    c->radius_mm = radius_mm;
    c->longer_rad = longer_rad;
    c->plane = plane;
    c->entered = c->stopped = false;
    c->programmed = c->offset = position;
    c->n_waiting = 0;
}

bool nc_compensation_end(NcCompensation *c, GArray *out, const char **why)
{
    if (!settle(c, in_plane(c, c->offset), why))
        return false;
    flush(c, out);
    c->away = c->away || c->entered;
    c->side = 0;
    c->entered = false;
    return true;
}

bool nc_compensation_move(NcCompensation *c, const NcMove *move, GArray *out, const char **why)
{
    bool travels = nc_move_travels(move);
    bool stops = move->kind == NC_MOVE_STOP || move->kind == NC_MOVE_OPTIONAL_STOP ||
                 move->kind == NC_MOVE_END;
    if (travels && c->away && move->kind == NC_MOVE_ARC)
        return fail(
            why, "cannot be an arc behind G40, where a straight move has to bring the tool back");
    if (travels && c->side != 0 && c->radius_mm > 0.0)
        return c->entered ? follow(c, move, out, why) : enter(c, move, why);
    if (!travels && !stops && c->n_waiting > 0)
        return wait_for_next(c, &(NcWaitingMove){.move = *move}, why);
    if (stops && c->n_waiting > 0) {
        if (!settle(c, in_plane(c, c->offset), why))
            return false;
        flush(c, out);
        c->stopped = true;
    }
    give(c, *move, out);
    c->away = c->away && !travels;
    return true;
}

/* -------------------------------------------------------------- plane geometry */

static NcPlanePoint difference(NcPlanePoint a, NcPlanePoint b)
{
    return (NcPlanePoint){a.a - b.a, a.b - b.b};
}

static NcPlanePoint along(NcPlanePoint from, NcPlanePoint direction, double distance)
{
    return (NcPlanePoint){from.a + distance * direction.a, from.b + distance * direction.b};
}

static double dot(NcPlanePoint a, NcPlanePoint b)
{
    return a.a * b.a + a.b * b.b;
}

static double cross(NcPlanePoint a, NcPlanePoint b)
{
    return a.a * b.b - a.b * b.a;
}

static double length(NcPlanePoint v)
{
    return hypot(v.a, v.b);
}

static NcPlanePoint unit(NcPlanePoint v)
{
    double l = length(v);
    return (NcPlanePoint){v.a / l, v.b / l};
}

/* A quarter turn; anticlockwise for 1, clockwise for -1. */
static NcPlanePoint quarter(NcPlanePoint v, int turn)
{
    return (NcPlanePoint){-turn * v.b, turn * v.a};
}

static NcPlanePoint opposite(NcPlanePoint v)
{
    return (NcPlanePoint){-v.a, -v.b};
}

static double sweep_of(const NcCompensation *c, NcMove arc, NcPlanePoint from, NcPlanePoint to)
{
    arc.from = with_plane(c, arc.from, from);
    arc.to = with_plane(c, arc.to, to);
    return nc_arc(&arc).sweep_rad;
}

/* -------------------------------------------------------------------- elements */

static bool offset_arc(const NcCompensation *c, const NcMove *move, Element *e, const char **why)
{
    e->centre = in_plane(c, move->centre);
    e->turn = move->turn > 0 ? 1 : -1;
    e->inside = c->side == e->turn;
    e->radius_mm = length(difference(e->to, e->centre));
    e->offset_mm = e->radius_mm + (e->inside ? -c->radius_mm : c->radius_mm);
    if (e->inside && e->offset_mm <= 0.0)
        return fail(why, "is an arc too small for the tool to go inside it");
    NcPlanePoint inward = unit(difference(e->centre, e->from));
    NcPlanePoint at_end = unit(difference(e->centre, e->to));
    e->tangent = quarter(inward, -e->turn);
    e->arrival = quarter(at_end, -e->turn);
    e->normal = e->inside ? inward : opposite(inward);
    e->end = along(e->to, e->inside ? at_end : opposite(at_end), c->radius_mm);
    return true;
}

static bool offset_element(const NcCompensation *c, const NcMove *move, Element *e,
                           const char **why)
{
    *e = (Element){.from = in_plane(c, c->programmed),
                   .to = in_plane(c, move->to),
                   .arc = move->kind == NC_MOVE_ARC};
    if (e->arc)
        return offset_arc(c, move, e, why);
    e->tangent = e->arrival = unit(difference(e->to, e->from));
    e->normal = quarter(e->tangent, c->side);
    e->end = along(e->to, e->normal, c->radius_mm);
    return true;
}

static void pass(NcCompensation *c, const NcMove *move, const Element *e)
{
    c->programmed = move->to;
    c->offset = with_plane(c, move->to, e->end);
    c->arrival = e->arrival;
}

/* The first move leads to beside its end. A line cannot turn back there, and an entry arc is
 * allowed to become longer: LinuxCNC looks at neither. */
static bool enter(NcCompensation *c, const NcMove *move, const char **why)
{
    Element e;
    NcWaitingMove waiting = {.move = *move};
    NcPlanePoint from = in_plane(c, c->programmed), to = in_plane(c, move->to);
    if (length(difference(to, from)) <= c->radius_mm)
        return fail(why, "leads to the contour and must be longer than the tool's radius");
    if (!offset_element(c, move, &e, why))
        return false;
    waiting.move.to = with_plane(c, move->to, e.end);
    if (e.arc) {
        /* Another arc: from where the tool is, and with the same tangent at its end. */
        NcPlanePoint chord = difference(from, e.end);
        NcPlanePoint inward = unit(difference(e.centre, e.to));
        double reach = dot(chord, inward);
        if (fabs(reach) < SMALLEST_COSINE * length(chord))
            return fail(why, "leads to the contour by an arc that the tool's radius makes a line");
        NcPlanePoint centre = along(e.end, inward, dot(chord, chord) / (2.0 * reach));
        waiting.move.centre = with_plane(c, move->centre, centre);
    }
    pass(c, move, &e);
    c->entered = true;
    return wait_for_next(c, &waiting, why);
}

/* --------------------------------------------------------------------- corners */

/* By how much the contour turns away from the tool where the element begins: from -π/2 to 3π/2,
 * a quarter turn to the tool's side being either. */
static double outward_turn(const NcCompensation *c, const Element *e)
{
    double turned = atan2(-c->side * cross(c->arrival, e->tangent), dot(c->arrival, e->tangent));
    return turned < -G_PI_2 ? turned + 2.0 * G_PI : turned;
}

/* The arc that is waiting to be left, or NULL. */
static const NcMove *waiting_arc(const NcCompensation *c)
{
    const NcMove *first = &c->waiting[0].move;
    return c->n_waiting > 0 && first->kind == NC_MOVE_ARC ? first : NULL;
}

static bool waiting_arc_inside(const NcCompensation *c)
{
    return (c->waiting[0].move.turn > 0) == (c->side > 0);
}

/* A way straight back is an inside corner where the tool comes from the outside of an arc, or goes
 * to the outside of one: two arches that meet, as in "m". */
static bool is_inside_corner(const NcCompensation *c, const Element *e, double turn)
{
    if (turn < -NO_CORNER_RAD || turn > G_PI + NO_CORNER_RAD)
        return true;
    if (turn <= G_PI - NO_CORNER_RAD)
        return false;
    return e->arc ? !e->inside : waiting_arc(c) && !waiting_arc_inside(c);
}

/* Where a line, at `height` over the centre in the direction of `normal`, meets the circle: on the
 * side of `direction`. */
static bool line_meets_circle(NcPlanePoint centre, double radius, NcPlanePoint normal,
                              double height, NcPlanePoint direction, NcPlanePoint *meet)
{
    double square = (radius - height) * (radius + height);
    if (square < 0.0)
        return false;
    *meet = along(along(centre, normal, height), direction, sqrt(square));
    return true;
}

static bool line_to_arc(const NcCompensation *c, const Element *e, NcPlanePoint *meet)
{
    NcPlanePoint normal = quarter(c->arrival, c->side);
    NcPlanePoint inward = unit(difference(e->centre, e->from));
    double height = c->radius_mm - e->radius_mm * dot(inward, normal);
    return line_meets_circle(e->centre, e->offset_mm, normal, height,
                             e->inside ? c->arrival : opposite(c->arrival), meet);
}

static bool arc_to_line(const NcCompensation *c, const Element *e, const NcMove *arc,
                        NcPlanePoint *meet)
{
    NcPlanePoint centre = in_plane(c, arc->centre);
    double radius = length(difference(in_plane(c, c->offset), centre));
    double programmed = radius + (waiting_arc_inside(c) ? c->radius_mm : -c->radius_mm);
    NcPlanePoint to_centre = difference(centre, e->from);
    if (!(length(to_centre) > 0.0))
        return false;
    NcPlanePoint inward = unit(to_centre);
    double height = c->radius_mm - programmed * dot(inward, e->normal);
    return line_meets_circle(centre, radius, e->normal, height,
                             waiting_arc_inside(c) ? opposite(e->tangent) : e->tangent, meet);
}

static bool arc_to_arc(const NcCompensation *c, const Element *e, const NcMove *arc,
                       NcPlanePoint *meet)
{
    NcPlanePoint centre = in_plane(c, arc->centre);
    NcPlanePoint between = difference(e->centre, centre);
    double radius = length(difference(in_plane(c, c->offset), centre));
    double distance = length(between);
    if (!(radius > 0.0) || !(distance > 0.0))
        return false;
    double foot =
        (radius * radius + distance * distance - e->offset_mm * e->offset_mm) / (2.0 * distance);
    double square = (radius - foot) * (radius + foot);
    if (square < 0.0)
        return false;
    NcPlanePoint direction = unit(between);
    NcPlanePoint aside = quarter(direction, waiting_arc_inside(c) ? e->turn : -e->turn);
    *meet = along(along(centre, direction, foot), aside, sqrt(square));
    return true;
}

/* Both moves end and begin where their paths, beside the contour, meet. */
static bool cut_short(NcCompensation *c, const Element *e, double turn, GArray *out,
                      const char **why)
{
    const NcMove *arc = waiting_arc(c);
    NcPlanePoint meet = in_plane(c, c->offset);
    bool found = true;
    if (c->stopped)
        return fail(why,
                    "leaves an inside corner in which the program stopped and the tool has gone "
                    "too far already");
    if (arc)
        found = e->arc ? arc_to_arc(c, e, arc, &meet) : arc_to_line(c, e, arc, &meet);
    else if (e->arc)
        found = line_to_arc(c, e, &meet);
    else
        meet = along(meet, c->arrival, c->radius_mm * tan(0.5 * turn));
    if (!found)
        return fail(why, "leaves an inside corner that the tool does not fit into");
    if (!settle(c, meet, why))
        return false;
    flush(c, out);
    return true;
}

/* The tool's edge stays at the corner. There is no rapid arc, so G0 takes the chord. The rotary
 * axes turn meanwhile. */
static void go_round(NcCompensation *c, NcMove *move, const Element *e, GArray *out)
{
    NcMove round = *move;
    round.to = with_plane(c, c->offset, along(e->from, e->normal, c->radius_mm));
    if (move->kind != NC_MOVE_RAPID) {
        round.kind = NC_MOVE_ARC;
        round.plane = c->plane;
        round.centre = with_plane(c, c->offset, e->from);
        round.turn = -c->side;
    }
    give(c, round, out);
    move->begins_block = false;
    memcpy(move->from_deg, move->to_deg, sizeof move->from_deg);
}

static bool turn_corner(NcCompensation *c, NcMove *move, const Element *e, GArray *out,
                        const char **why)
{
    double turn = outward_turn(c, e);
    if (is_inside_corner(c, e, turn))
        return cut_short(c, e, turn, out, why);
    bool outside = turn > NO_CORNER_RAD;
    /* LinuxCNC looks at what waits before a line alone. */
    if (outside && !e->arc && !settle(c, in_plane(c, c->offset), why))
        return false;
    flush(c, out);
    if (outside)
        go_round(c, move, e, out);
    return true;
}

static bool follow(NcCompensation *c, const NcMove *move, GArray *out, const char **why)
{
    Element e;
    NcWaitingMove waiting = {.move = *move};
    NcPlanePoint from = in_plane(c, c->programmed), to = in_plane(c, move->to);
    if (move->kind != NC_MOVE_ARC && length(difference(to, from)) < NO_LENGTH_MM) {
        e.end = in_plane(c, c->offset);
        e.arrival = c->arrival;
    } else {
        if (!offset_element(c, move, &e, why) || !turn_corner(c, &waiting.move, &e, out, why))
            return false;
        c->stopped = false;
        if (e.arc)
            waiting.sweep_rad = sweep_of(c, *move, e.from, e.to);
        else
            waiting.direction = difference(e.to, e.from);
    }
    waiting.move.to = with_plane(c, move->to, e.end);
    pass(c, move, &e);
    return wait_for_next(c, &waiting, why);
}

/* ------------------------------------------------------------------- what waits */

static bool wait_for_next(NcCompensation *c, const NcWaitingMove *waiting, const char **why)
{
    if (c->n_waiting == NC_MAX_WAITING)
        return fail(why, "is one move too many at one place of the contour: 128 can wait");
    c->waiting[c->n_waiting++] = *waiting;
    return true;
}

static bool turns_back(const NcCompensation *c, const NcWaitingMove *waiting, NcPlanePoint end)
{
    NcPlanePoint at = in_plane(c, c->at);
    if (waiting->move.kind != NC_MOVE_ARC)
        return dot(waiting->direction, difference(end, at)) < 0.0;
    return waiting->sweep_rad != 0.0 &&
           fabs(sweep_of(c, waiting->move, at, end)) > fabs(waiting->sweep_rad) + c->longer_rad;
}

/* The moves that wait end here: the first by its own way, the others on the spot. */
static bool settle(NcCompensation *c, NcPlanePoint end, const char **why)
{
    for (int i = 0; i < c->n_waiting; i++) {
        NcWaitingMove *waiting = &c->waiting[i];
        if (!nc_move_travels(&waiting->move))
            continue;
        if (turns_back(c, waiting, end))
            return fail(why, "leaves an inside corner that the tool cannot reach without gouging");
        waiting->move.to = with_plane(c, waiting->move.to, end);
    }
    return true;
}

static void flush(NcCompensation *c, GArray *out)
{
    for (int i = 0; i < c->n_waiting; i++)
        give(c, c->waiting[i].move, out);
    c->n_waiting = 0;
}

static void give(NcCompensation *c, NcMove move, GArray *out)
{
    move.from = c->at;
    if (!nc_move_travels(&move))
        move.to = c->at;
    if (move.kind == NC_MOVE_ARC) {
        int normal = nc_plane_axes(move.plane).normal;
        *nc_axis(&move.centre, normal) = nc_axis_value(move.from, normal);
    }
    c->at = move.to;
    g_array_append_val(out, move);
}
