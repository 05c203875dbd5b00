/* SPDX-License-Identifier: Apache-2.0 */
/* A wavy B-spline surface of any degree and size, the same each time. */
#ifndef TESTS_LIB_WAVES_H
#define TESTS_LIB_WAVES_H

#include "segcore/segcore.h"

/* A part of one face of n × n poles over about 100 × 100 mm, clamped, its knots at uneven
 * distances within [0, 1] in u and [-2, 3] in v. */
SegPart *waves_part(int degree, int n, bool rational);

#endif
