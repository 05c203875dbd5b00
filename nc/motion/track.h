/* SPDX-License-Identifier: Apache-2.0 */
/* One move as a path in up to six axes, X, Y, Z, A, B, C, over its own length. */
#ifndef NC_MOTION_TRACK_H
#define NC_MOTION_TRACK_H

#include "nc/motion/path.h"

enum { NC_AXES = 6 };

typedef struct {
    const NcMove *move;
    double length; /* mm of X, Y, Z; degrees of A, B, C where those are more */
    bool round;    /* an arc or helix: */
    NcArc arc;
    double omega; /* rad over a unit of length */
    double widening;
} NcTrack;

NcTrack nc_track(const NcMove *move);

/* What nc_track(move).length is. */
double nc_track_length(const NcMove *move);

/* The programmed feed along it, a second: of X, Y, Z, if those move at all. */
double nc_track_feed(const NcMove *move, double length);

void nc_track_point(const NcTrack *track, double at, double point[NC_AXES]);

/* First and second derivative by the length. */
void nc_track_slope(const NcTrack *track, double at, double slope[NC_AXES]);
void nc_track_bend(const NcTrack *track, double at, double bend[NC_AXES]);

#endif
