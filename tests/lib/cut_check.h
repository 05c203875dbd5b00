/* SPDX-License-Identifier: Apache-2.0 */
/* Toolpaths judged without the code that made them: points of the mesh against places of the
 * cutter, both dense. */
#ifndef TESTS_LIB_CUT_CHECK_H
#define TESTS_LIB_CUT_CHECK_H

#include "nc/nc.h"

/* The part as points in workpiece coordinates, no further apart than `pitch_mm`. */
typedef struct CutCheck CutCheck;
CutCheck *cut_check_new(const SegPart *part, const NcSetup *setup, double pitch_mm);
void cut_check_free(CutCheck *check);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(CutCheck, cut_check_free)

/* The deepest vertical gouge of all moves but rapids; the cutter grown by `grow_mm` on all sides.
 */
double cut_check_gouge_mm(const CutCheck *check, const NcOperation *operation, double grow_mm);

/* The same for rapids alone. */
double cut_check_rapid_gouge_mm(const CutCheck *check, const NcOperation *operation,
                                double grow_mm);

/* The cut surface: for each of n places the lowest that the moving cutter came there, INFINITY
 * where it never was. Moves are looked at every `pitch_mm`, cutting moves only. */
void cut_check_surface(const NcOperation *operation, double pitch_mm, size_t n, const double *x,
                       const double *y, double *z);

#endif
