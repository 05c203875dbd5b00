/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_MOTION_MOTION_H
#define NC_MOTION_MOTION_H

#include "nc/motion/profile.h"

struct NcMotion {
    const NcMove *moves;
    size_t n;
    bool smooth;       /* the kernel of the blends */
    double *end_mm;    /* of each move, on the path */
    double *half_mm;   /* of the blend at the end of each move, 0: none */
    double *start_s;   /* n + 1 */
    double widest_mm;  /* of the blends */
    guint8 *forbidden; /* by an override; NULL: none is */
    NcStretch *stretches;
    size_t n_stretches; /* the last one stands at the end of all */
};

/* The last stretch that begins at or before a time, a place. */
size_t nc_motion_stretch_at_s(const NcMotion *motion, double t_s);
size_t nc_motion_stretch_at_mm(const NcMotion *motion, double s_mm);

/* Its phases, in the plan's places and from its begin on; it is not one that stands. */
size_t nc_motion_phases(const NcMotion *motion, size_t stretch, NcPhase phases[7]);

#endif
