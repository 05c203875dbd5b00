/* SPDX-License-Identifier: Apache-2.0 */
/*
 * B-spline curves and surfaces over plain arrays. Names and algorithms after Piegl and Tiller, The
 * NURBS Book, 2nd edition: span search A2.1, basis functions and derivatives A2.2 and A2.3,
 * rational derivatives A4.2 and A4.4. Nothing here allocates; a parameter outside the domain is
 * moved to its nearest end.
 */
#ifndef SEGCORE_GEOM_BSPLINE_H
#define SEGCORE_GEOM_BSPLINE_H

#include "segcore/segcore.h"

enum { SEG_MAX_DEGREE = 25 };

/* The span i with knots[i] <= t < knots[i+1] among the non-empty ones of [degree, n); the last of
 * them at the domain's end. */
int seg_knot_span(const double *knots, int degree, int n, double t);

/* The degree + 1 basis functions that do not vanish on `span`, and their derivatives up to `order`
 * (0, 1 or 2): basis[k][j] is the k-th derivative of N_{span-degree+j}. */
void seg_basis(const double *knots, int degree, int span, double t, int order,
               double basis[3][SEG_MAX_DEGREE + 1]);

/* Position and derivatives up to `order` (0, 1 or 2) of a curve of either dimension (z = 0). */
void seg_curve_derivatives(const double *reals, const SegCurve *curve, double t, int order,
                           SegVec3 out[3]);

/* The same of a surface; second derivatives are left at zero below order 2. */
SegSurfacePoint seg_surface_evaluate(const double *reals, const SegSurface *surface, double u,
                                     double v, int order);

/* Where a curve's tables lie. `weights` is NULL for a polynomial one. */
typedef struct {
    const double *knots, *poles, *weights;
} SegCurveTables;

static inline SegCurveTables seg_curve_tables(const double *reals, const SegCurve *c)
{
    const double *knots = reals + c->data;
    const double *poles = knots + c->n_poles + c->degree + 1;
    return (SegCurveTables){knots, poles, c->rational ? poles + c->n_poles * c->dim : NULL};
}

/* Where a surface's tables lie; pole (i, j) is the (i·n_v + j)-th. */
typedef struct {
    const double *knots_u, *knots_v, *poles, *weights;
} SegSurfaceTables;

static inline SegSurfaceTables seg_surface_tables(const double *reals, const SegSurface *s)
{
    const double *knots_u = reals + s->data;
    const double *knots_v = knots_u + s->n_u + s->degree_u + 1;
    const double *poles = knots_v + s->n_v + s->degree_v + 1;
    size_t n = (size_t)s->n_u * (size_t)s->n_v;
    return (SegSurfaceTables){knots_u, knots_v, poles, s->rational ? poles + 3 * n : NULL};
}

#endif
