/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The area element J = |Su × Sv| of a surface, integrated up its columns. A column is the surface
 * at one u; the poles are summed over u once, and what is left is a curve in v.
 */
#ifndef SEGCORE_GEOM_COLUMNS_H
#define SEGCORE_GEOM_COLUMNS_H

#include "segcore/geom/bspline.h"

typedef struct SegColumns SegColumns;

/* `enough`: the error that an integral over v may have. */
SegColumns *seg_columns_new(const double *reals, const SegSurface *surface, double enough);
void seg_columns_free(SegColumns *columns);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SegColumns, seg_columns_free)

/* The integral of J(u, s) over s from the knot below span_v to v. */
double seg_columns_above(SegColumns *columns, double u, int span_v, double v);

/* The integral of J over [u_a, u_b] and over v from the domain's lower end to the knot below
 * span_v; negative where u_b < u_a. What it takes is computed once a span of u, and kept. */
double seg_columns_below(SegColumns *columns, double u_a, double u_b, int span_v);

#endif
