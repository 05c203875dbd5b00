/* SPDX-License-Identifier: Apache-2.0 */
/* A judge of what the machine shows: differences of its positions against the axes' limits. */
#ifndef TESTS_UNIT_SIM_TRACE_H
#define TESTS_UNIT_SIM_TRACE_H

#include "tests/unit/sim_rig.h"

/* Positions every millisecond. */
typedef struct {
    double p[4][3];
    int n;
} Trace;

/* How often a limit of the axes is exceeded by the newest four positions. */
static inline int trace_excess(Trace *trace, const CfgMachine *machine, const double position_mm[3])
{
    int wrong = 0;
    memmove(trace->p[1], trace->p[0], 3 * sizeof trace->p[0]);
    memcpy(trace->p[0], position_mm, sizeof trace->p[0]);
    trace->n++;
    for (int i = 0; i < 3; i++) {
        const CfgAxis *axis = &machine->axis[i];
        double a = trace->p[0][i], b = trace->p[1][i], c = trace->p[2][i], d = trace->p[3][i];
        if (trace->n >= 2)
            wrong += fabs(a - b) / 1e-3 > axis->max_mm_min / 60 * 1.001;
        if (trace->n >= 3)
            wrong += fabs(a - 2 * b + c) / 1e-6 > axis->max_mm_s2 * 1.001;
        if (trace->n >= 4 && axis->max_mm_s3 > 0)
            wrong += fabs(a - 3 * b + 3 * c - d) / 1e-9 > axis->max_mm_s3 * 1.001 + 1;
    }
    return wrong;
}

#endif
