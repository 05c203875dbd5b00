/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/waves.h"

#include "tests/lib/form.h"

static void clamped_knots(double *knots, int degree, int n, double a, double b)
{
    int spans = n - degree;
    for (int i = 0; i <= n + degree; i++) {
        double t = (double)CLAMP(i - degree, 0, spans) / spans;
        knots[i] = a + (b - a) * (t + 0.3 * t * (1 - t));
    }
}

SegPart *waves_part(int degree, int n, bool rational)
{
    g_autoptr(Form) form = form_new();
    g_autofree double *knots_u = g_new(double, n + degree + 1);
    g_autofree double *knots_v = g_new(double, n + degree + 1);
    g_autofree double *poles = g_new(double, 3 * n * n), *weights = g_new(double, n *n);
    clamped_knots(knots_u, degree, n, 0, 1);
    clamped_knots(knots_v, degree, n, -2, 3);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            double *pole = poles + 3 * (i * n + j), x = 100.0 * i / (n - 1),
                   y = 100.0 * j / (n - 1);
            pole[0] = x + 0.1 * sin(y);
            pole[1] = y + 0.1 * cos(x);
            pole[2] = 8 * sin(x / 17) * cos(y / 13) + 0.001 * x * y;
            weights[i * n + j] = 1 + 0.3 * sin(x / 9 + y / 7);
        }
    form_patch(form, SEG_SURFACE_BSPLINE,
               form_surface(form, degree, n, degree, n, knots_u, knots_v, poles,
                            rational ? weights : NULL));
    return form_part(form);
}
