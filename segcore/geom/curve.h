/* SPDX-License-Identifier: Apache-2.0 */
/* Measuring curves: arc length and its inverse, boxes. */
#ifndef SEGCORE_GEOM_CURVE_H
#define SEGCORE_GEOM_CURVE_H

#include "segcore/segcore.h"

/*
 * The parameter at arc length `length_mm` from a, on a curve whose length over [a, b] is
 * `total_mm`. P0 eq. 3-7: Newton and Raphson from a + (length/total)·|b - a|; a step that leaves
 * the bracket is replaced by a halving.
 */
double seg_curve_at_length(const SegPart *part, const SegCurve *curve, double a, double b,
                           double length_mm, double total_mm);

typedef struct {
    SegVec3 min, max;
} SegBox;

extern const SegBox SEG_BOX_EMPTY;
void seg_box_add(SegBox *box, SegVec3 point);
void seg_box_join(SegBox *box, const SegBox *other);
bool seg_box_is_empty(const SegBox *box);
double seg_box_diagonal(const SegBox *box); /* 0 when empty */

/*
 * Grows `box` to hold the curve over [a, b], exactly: its extrema in x, y and z are closed in on by
 * halving Bézier pieces whose poles reach outside the box (a piece lies in the hull of its poles,
 * so none is missed) until they do so by less than 1e-10 of the curve's size. Returns the number of
 * points of the curve that were looked at, its ends not counted.
 */
size_t seg_curve_box(const SegPart *part, const SegCurve *curve, double a, double b, SegBox *box);

#endif
