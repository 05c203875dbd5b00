/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/motion/track.h"

#include <math.h>

/* Less of X, Y, Z than this does not count where a rotary axis moves. */
#define LEAST_MM 1e-6

static double degrees(const NcMove *move)
{
    const double *from = move->from_deg, *to = move->to_deg;
    return sqrt((to[0] - from[0]) * (to[0] - from[0]) + (to[1] - from[1]) * (to[1] - from[1]) +
                (to[2] - from[2]) * (to[2] - from[2]));
}

double nc_track_feed(const NcMove *move, double length)
{
    double mm = nc_move_length_mm(move);
    return mm > LEAST_MM ? move->feed_mm_min / 60.0 * (length / mm) : move->feed_mm_min / 60.0;
}

double nc_track_length(const NcMove *move)
{
    return nc_move_travels(move) ? fmax(nc_move_length_mm(move), degrees(move)) : 0.0;
}

NcTrack nc_track(const NcMove *move)
{
    NcTrack track = {.move = move};
    if (move->kind != NC_MOVE_ARC) {
        track.length = nc_track_length(move);
        return track;
    }
    track.round = true;
    track.arc = nc_arc(move);
    track.length = fmax(track.arc.length_mm, degrees(move));
    track.omega = track.arc.sweep_rad / track.length;
    track.widening = (track.arc.radius_to_mm - track.arc.radius_from_mm) / track.length;
    return track;
}

void nc_track_point(const NcTrack *track, double at, double point[NC_AXES])
{
    const NcMove *move = track->move;
    double f = track->length > 0.0 ? fmax(0.0, fmin(1.0, at / track->length)) : 1.0;
    SegVec3 p = nc_move_point(move, f);
    point[0] = p.x;
    point[1] = p.y;
    point[2] = p.z;
    for (int i = 0; i < 3; i++)
        point[3 + i] = f < 1.0 ? move->from_deg[i] + f * (move->to_deg[i] - move->from_deg[i])
                               : move->to_deg[i];
}

static double radius_at(const NcTrack *track, double at)
{
    return track->arc.radius_from_mm + track->widening * at;
}

void nc_track_slope(const NcTrack *track, double at, double slope[NC_AXES])
{
    const NcMove *move = track->move;
    double share = track->length > 0.0 ? 1.0 / track->length : 0.0;
    for (int i = 0; i < 3; i++)
        slope[3 + i] = (move->to_deg[i] - move->from_deg[i]) * share;
    if (!track->round) {
        slope[0] = (move->to.x - move->from.x) * share;
        slope[1] = (move->to.y - move->from.y) * share;
        slope[2] = (move->to.z - move->from.z) * share;
        return;
    }
    double angle = track->arc.start_rad + track->omega * at;
    double turn = radius_at(track, at) * track->omega, c = cos(angle), s = sin(angle);
    slope[track->arc.axes.first] = track->widening * c - turn * s;
    slope[track->arc.axes.second] = track->widening * s + turn * c;
    slope[track->arc.axes.normal] = track->arc.rise_mm * share;
}

void nc_track_bend(const NcTrack *track, double at, double bend[NC_AXES])
{
    for (int i = 0; i < NC_AXES; i++)
        bend[i] = 0.0;
    if (!track->round)
        return;
    double angle = track->arc.start_rad + track->omega * at;
    double in = -radius_at(track, at) * track->omega * track->omega;
    double around = 2.0 * track->widening * track->omega, c = cos(angle), s = sin(angle);
    bend[track->arc.axes.first] = in * c - around * s;
    bend[track->arc.axes.second] = in * s + around * c;
}
