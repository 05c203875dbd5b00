/* SPDX-License-Identifier: Apache-2.0 */
/* T-splines made by hand, for the tests. */
#ifndef TESTS_LIB_TMESHES_H
#define TESTS_LIB_TMESHES_H

#include "segcore/segcore.h"

enum {
    TMESH_JUNCTIONS, /* T-junctions both ways, on 10 × 10 lines over [0, 9] × [0, 9] */
    TMESH_RATIONAL,  /* the same, with weights */
    TMESH_HOLED,     /* and a hole of [3, 6] × [3, 6] */
    TMESH_CORNERED,  /* not rectangular: [5, 9] × [6, 9] is missing, without its points */
    N_TMESHES
};

SegTspline *tmesh_example(int which, GError **error);

#endif
