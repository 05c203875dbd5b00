/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Cutter radius compensation: programmed moves in, the moves of the tool's centre out, as LinuxCNC
 * 2.9 makes them ["Cutter Compensation"; its rules are those of NIST, appendix B, with inside
 * corners].
 *
 * A move's end is known only with the move behind it: an inside corner shortens it. So the last
 * move of the contour waits, with all that follows it at the same place (moves along the normal of
 * the plane, dwells, spindle and coolant), until the next one, or the end of the compensation.
 * Outside corners are rounded by an arc about the corner.
 *
 * Pure: nothing but the state and the moves counts. All zero is "off".
 */
#ifndef NC_GCODE_COMPENSATION_H
#define NC_GCODE_COMPENSATION_H

#include "nc/nc.h"

/* What may wait for the next move of the contour. */
enum { NC_MAX_WAITING = 128 };

/* First and second coordinate of the plane. */
typedef struct {
    double a, b;
} NcPlanePoint;

typedef struct {
    NcMove move;            /* its end in the plane may still change */
    NcPlanePoint direction; /* as programmed, of any length; 0: a line that cannot turn back */
    double sweep_rad;       /* as programmed; 0: an arc that cannot become longer */
} NcWaitingMove;

typedef struct {
    int side; /* the tool is 1: left, -1: right of the contour; 0: off */
    double radius_mm;
    double longer_rad; /* as much may an arc become longer than programmed before it gouges */
    int plane;         /* 17, 18 */
    bool entered;      /* a move has led to the contour */
    bool away;    /* the tool is not where the program left it: a straight move has to follow */
    bool stopped; /* what waited was given out before a stop, not for the next move */
    SegVec3 programmed;   /* end of the last move, as programmed */
    SegVec3 offset;       /* the same of the tool, before the next move changes it */
    SegVec3 at;           /* end of the last move that was given out */
    NcPlanePoint arrival; /* direction of the contour at its end so far, unit */
    int n_waiting;
    NcWaitingMove waiting[NC_MAX_WAITING];
} NcCompensation;

/* Whether moves have to go by way of nc_compensation_move. */
static inline bool nc_compensation_busy(const NcCompensation *c)
{
    return c->side != 0 || c->away;
}

/* Off, and what waits is forgotten. */
static inline void nc_compensation_reset(NcCompensation *c)
{
    c->side = c->n_waiting = 0;
    c->entered = c->away = false;
}

/* Copies what counts of it. */
void nc_compensation_copy(NcCompensation *to, const NcCompensation *from);

/* From here on the tool keeps to the side of what is programmed; `position` is its end so far. A
 * radius of 0 gives the moves out as they are. */
void nc_compensation_begin(NcCompensation *c, int side, double radius_mm, double longer_rad,
                           int plane, SegVec3 position);

/* Takes a programmed move and appends to `out` (GArray of NcMove) what can be said now; M0, M1 and
 * the program's end let nothing wait. False, with the reason, where the tool does not fit. */
bool nc_compensation_move(NcCompensation *c, const NcMove *move, GArray *out, const char **why);

/* Off: what waits is given out. The tool stays beside the contour until the next straight move. */
bool nc_compensation_end(NcCompensation *c, GArray *out, const char **why);

#endif
