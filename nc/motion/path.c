/* SPDX-License-Identifier: Apache-2.0 */
/* Lines, arcs and helices: length, points, tangents, bounds. */
#include "nc/motion/path.h"

/* Closer ends than this make a full turn; programs have no such fine coordinates. */
#define SAME_POINT_MM 1e-9
#define SAME_ANGLE_RAD 1e-12

NcPlaneAxes nc_plane_axes(int plane)
{
    switch (plane) {
    case 18:
        return (NcPlaneAxes){2, 0, 1};
    case 19:
        return (NcPlaneAxes){1, 2, 0};
    default:
        return (NcPlaneAxes){0, 1, 2};
    }
}

static double arc_sweep(double start, double end, bool closed, int turn)
{
    double sweep = turn > 0 ? end - start : start - end;
    if (closed || sweep < SAME_ANGLE_RAD)
        sweep = closed ? 2.0 * G_PI : sweep + 2.0 * G_PI;
    if (sweep < SAME_ANGLE_RAD)
        sweep += 2.0 * G_PI;
    sweep += 2.0 * G_PI * (abs(turn) - 1);
    return turn > 0 ? sweep : -sweep;
}

NcArc nc_arc(const NcMove *move)
{
    NcArc arc = {.axes = nc_plane_axes(move->plane)};
    SegVec3 from = seg_sub(move->from, move->centre), to = seg_sub(move->to, move->centre);
    double from_a = nc_axis_value(from, arc.axes.first);
    double from_b = nc_axis_value(from, arc.axes.second);
    double to_a = nc_axis_value(to, arc.axes.first), to_b = nc_axis_value(to, arc.axes.second);
    bool closed = hypot(to_a - from_a, to_b - from_b) < SAME_POINT_MM;
    arc.start_rad = atan2(from_b, from_a);
    arc.sweep_rad = arc_sweep(arc.start_rad, atan2(to_b, to_a), closed, move->turn);
    arc.radius_from_mm = hypot(from_a, from_b);
    arc.radius_to_mm = hypot(to_a, to_b);
    arc.rise_mm = nc_axis_value(to, arc.axes.normal) - nc_axis_value(from, arc.axes.normal);
    double mean = 0.5 * (arc.radius_from_mm + arc.radius_to_mm);
    double widening = arc.radius_to_mm - arc.radius_from_mm;
    arc.length_mm = hypot(hypot(mean * arc.sweep_rad, widening), arc.rise_mm);
    return arc;
}

double nc_move_length_mm(const NcMove *move)
{
    if (!nc_move_travels(move))
        return 0.0;
    return move->kind == NC_MOVE_ARC ? nc_arc(move).length_mm : seg_distance(move->from, move->to);
}

static SegVec3 arc_point(const NcMove *move, const NcArc *arc, double fraction)
{
    double angle = arc->start_rad + fraction * arc->sweep_rad;
    double radius = arc->radius_from_mm + fraction * (arc->radius_to_mm - arc->radius_from_mm);
    SegVec3 point = move->centre;
    *nc_axis(&point, arc->axes.first) += radius * cos(angle);
    *nc_axis(&point, arc->axes.second) += radius * sin(angle);
    *nc_axis(&point, arc->axes.normal) =
        nc_axis_value(move->from, arc->axes.normal) + fraction * arc->rise_mm;
    return point;
}

SegVec3 nc_move_point(const NcMove *move, double fraction)
{
    if (fraction <= 0.0 || fraction >= 1.0 || !nc_move_travels(move))
        return fraction >= 1.0 ? move->to : move->from;
    if (move->kind != NC_MOVE_ARC)
        return seg_lerp(move->from, move->to, fraction);
    NcArc arc = nc_arc(move);
    return arc_point(move, &arc, fraction);
}

static void grow(SegVec3 *min, SegVec3 *max, SegVec3 p)
{
    for (int axis = 0; axis < 3; axis++) {
        double value = nc_axis_value(p, axis);
        *nc_axis(min, axis) = fmin(*nc_axis(min, axis), value);
        *nc_axis(max, axis) = fmax(*nc_axis(max, axis), value);
    }
}

void nc_move_bounds(const NcMove *move, SegVec3 *min, SegVec3 *max)
{
    *min = *max = move->from;
    grow(min, max, move->to);
    if (move->kind != NC_MOVE_ARC)
        return;
    /* The extremes lie where the angle passes a quarter turn; four in a row reach every side, but
     * a spiral is widest at one end: its first and last turn are looked at. */
    NcArc arc = nc_arc(move);
    double quarter = 0.5 * G_PI;
    double low = fmin(arc.start_rad, arc.start_rad + arc.sweep_rad);
    double high = fmax(arc.start_rad, arc.start_rad + arc.sweep_rad);
    double first = ceil(low / quarter), last = floor(high / quarter);
    for (int i = 0; i < 4; i++) {
        double near_low = fmin(first + i, last), near_high = fmax(last - i, first);
        if (first <= last) {
            grow(min, max,
                 arc_point(move, &arc, (near_low * quarter - arc.start_rad) / arc.sweep_rad));
            grow(min, max,
                 arc_point(move, &arc, (near_high * quarter - arc.start_rad) / arc.sweep_rad));
        }
    }
}
