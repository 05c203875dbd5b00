/* SPDX-License-Identifier: Apache-2.0 */
/* Part forms made by hand, for tests of what reads and measures them. */
#ifndef TESTS_LIB_FORM_H
#define TESTS_LIB_FORM_H

#include "segcore/geom/part_form.h"

/* The tables while they grow. */
typedef struct {
    GArray *faces, *loops, *coedges, *edges, *iges_curves, *vertices, *triangles, *reals;
} Form;

Form *form_new(void);
void form_free(Form *form);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(Form, form_free)

/* From knots (n + degree + 1), poles (n · dim) and weights (n, or NULL). */
SegCurve form_curve(Form *form, int degree, int n, int dim, const double *knots,
                    const double *poles, const double *weights);

/* From knots in u and v, poles (v fastest) and weights (or NULL); both directions clamped. */
SegSurface form_surface(Form *form, int degree_u, int n_u, int degree_v, int n_v,
                        const double *knots_u, const double *knots_v, const double *poles,
                        const double *weights);

/* Adds the whole surface as a face: one loop of its four sides, with edges of its own, and two
 * triangles. */
void form_patch(Form *form, SegSurfaceType type, SegSurface surface);

/* The bytes, with a header; and the part behind them, which must be good. */
GBytes *form_bytes(const Form *form);
SegPart *form_part(const Form *form);

/* A parallelogram of 6 × 4 mm in z = 0, and a quarter of a cylinder of radius 5 mm and length 10 mm
 * about z, both with their normal outwards. */
Form *form_sample(void);

#endif
