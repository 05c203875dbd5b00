/* SPDX-License-Identifier: Apache-2.0 */
/* Asking Open CASCADE (tests/judges/occ_surface) about points of B-spline surfaces. */
#ifndef TESTS_LIB_SURFACE_JUDGE_H
#define TESTS_LIB_SURFACE_JUDGE_H

#include "segcore/segcore.h"

/* What is said of a point: NaN where there is no normal, no direction of its own. */
typedef struct {
    SegVec3 p, du, dv, duu, duv, dvv, normal;
    double gauss, mean, k_min, k_max;
    SegVec3 direction_min, direction_max;
} JudgedPoint;

/* Appends the question about n points of a surface. */
void surface_judge_ask(GByteArray *question, const double *reals, const SegSurface *surface,
                       const double *u, const double *v, size_t n);

/* One JudgedPoint for each point asked, in the order of the question; NULL where it refuses. The
 * caller unrefs. */
GBytes *surface_judge_answer(const GByteArray *question);

/* Points/s over the points of the question, with principal directions or without; 0 where it
 * refuses. */
double surface_judge_speed(const GByteArray *question, double seconds, bool directions);

#endif
