/* SPDX-License-Identifier: Apache-2.0 */
/* Adaptive integration over an interval on which the function is smooth. */
#ifndef SEGCORE_GEOM_INTEGRATE_H
#define SEGCORE_GEOM_INTEGRATE_H

typedef double (*SegIntegrand)(void *context, double t);

/*
 * The integral of f over [a, b] by Gauss and Kronrod: 3 and 7 points, else 7 and 15, halved where
 * the error that their difference lets expect is above `relative` of the integral of |f| and above
 * `least`. At most 100 halvings, 24 deep: whatever f is, this ends.
 */
double seg_integrate(SegIntegrand f, void *context, double a, double b, double relative,
                     double least);

#endif
