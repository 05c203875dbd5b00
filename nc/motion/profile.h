/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The speed along a path: stretches, each a ramp up, a part of constant speed, a ramp down, any of
 * them empty. Between two stretches the acceleration is 0 where jerk is limited.
 */
#ifndef NC_MOTION_PROFILE_H
#define NC_MOTION_PROFILE_H

#include "nc/motion/run.h"

/* It ends where the next one begins. `top` 0: the machine stands at the end of a run. */
typedef struct {
    double s, t;   /* where and when it begins, mm and s */
    double v, top; /* speed there, and its greatest */
    NcRate rate;
} NcStretch;

/* A place that is passed with acceleration 0, and the way that ends there. */
typedef struct {
    double s, v;
    double top; /* greatest speed on the way */
    NcRate rate;
} NcBase;

/* Places the machine can come to rest from within the cells' limits, from 0 to the run's length;
 * `bases` has room for n_cells + 1. Returns how many, from the start on. */
size_t nc_profile_bases(const NcRun *run, NcBase *bases);

/* Where the way with accelerations goes, one stretch at a time; false: that was the last. */
typedef struct {
    const NcBase *bases;
    size_t n, next; /* the next one to be reached */
    double s, v;    /* the last one that was */
    double top;     /* of those passed since */
    NcRate rate;
    size_t passed; /* the next one, when s and v were set */
} NcClimb;

/* From bases[0] with the speed it has. */
NcClimb nc_profile_climb(const NcBase *bases, size_t n);

/* The next stretch, without its time, and where it ends: at *end, one of the bases, at speed *v. */
bool nc_profile_next(NcClimb *climb, NcStretch *stretch, size_t *end, double *v);

double nc_stretch_s(const NcStretch *stretch, double length, double v_end);

/* The stretch's parts of constant jerk, at most 7; time and place begin at 0. */
size_t nc_stretch_phases(const NcStretch *stretch, double length, double v_end, NcPhase phases[7]);

#endif
