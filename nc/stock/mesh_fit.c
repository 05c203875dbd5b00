/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/mesh_fit.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

/* The sum of squares as a function of the distance x from the mean: xᵀ·a·x - 2·bᵀ·x. */
typedef struct {
    double a[3][3], b[3];
    double low[3], high[3];
} Bowl;

static double lowest(const Bowl *bowl, const bool fixed[3], double x[3]);
static void solve_free(const Bowl *bowl, const bool fixed[3], double x[3]);

void nc_plane_fit_add(NcPlaneFit *fit, const double point[3], const double normal[3])
{
    const double offset = normal[0] * point[0] + normal[1] * point[1] + normal[2] * point[2];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            fit->a[i][j] += normal[i] * normal[j];
        fit->b[i] += normal[i] * offset;
        fit->sum[i] += point[i];
    }
    fit->n++;
}

void nc_plane_fit_mean(const NcPlaneFit *fit, double point[3])
{
    for (int i = 0; i < 3; i++)
        point[i] = fit->sum[i] / fit->n;
}

void nc_plane_fit_best(const NcPlaneFit *fit, const double low[3], const double high[3],
                       double point[3])
{
    double mean[3], x[3] = {0};
    nc_plane_fit_mean(fit, mean);
    Bowl bowl;
    memcpy(bowl.a, fit->a, sizeof bowl.a);
    for (int i = 0; i < 3; i++) {
        bowl.b[i] = fit->b[i];
        for (int j = 0; j < 3; j++)
            bowl.b[i] -= fit->a[i][j] * mean[j];
        bowl.a[i][i] += NC_PLANE_FIT_PULL * fit->n;
        bowl.low[i] = low[i] - mean[i];
        bowl.high[i] = high[i] - mean[i];
    }
    lowest(&bowl, (const bool[3]){false, false, false}, x);
    for (int i = 0; i < 3; i++)
        point[i] = fmin(fmax(mean[i] + x[i], low[i]), high[i]);
}

/*
 * The lowest point of a convex bowl within a box: the bowl's own where that lies inside; else on a
 * side that it lies beyond, because the way from there to it only goes down. x holds the
 * coordinates that are fixed, and gets the others. Returns the value there.
 */
static double lowest(const Bowl *bowl, const bool fixed[3], double x[3])
{
    double best[3], value = DBL_MAX;
    solve_free(bowl, fixed, x);
    memcpy(best, x, sizeof best);
    for (int i = 0; i < 3; i++) {
        if (fixed[i] || (x[i] >= bowl->low[i] && x[i] <= bowl->high[i]))
            continue;
        bool also[3] = {fixed[0], fixed[1], fixed[2]};
        double on_side[3] = {x[0], x[1], x[2]};
        also[i] = true;
        on_side[i] = x[i] < bowl->low[i] ? bowl->low[i] : bowl->high[i];
        const double there = lowest(bowl, also, on_side);
        if (there < value) {
            value = there;
            memcpy(best, on_side, sizeof best);
        }
    }
    memcpy(x, best, sizeof best);
    if (value < DBL_MAX)
        return value;
    value = 0;
    for (int i = 0; i < 3; i++) {
        double row = -2 * bowl->b[i];
        for (int j = 0; j < 3; j++)
            row += bowl->a[i][j] * x[j];
        value += row * x[i];
    }
    return value;
}

/* Solves the equations of the free coordinates by elimination without pivoting: positive definite,
 * because of the pull. */
static void solve_free(const Bowl *bowl, const bool fixed[3], double x[3])
{
    int index[3], n = 0;
    double m[3][4];
    for (int i = 0; i < 3; i++)
        if (!fixed[i])
            index[n++] = i;
    for (int r = 0; r < n; r++) {
        m[r][n] = bowl->b[index[r]];
        for (int c = 0; c < 3; c++)
            if (fixed[c])
                m[r][n] -= bowl->a[index[r]][c] * x[c];
        for (int c = 0; c < n; c++)
            m[r][c] = bowl->a[index[r]][index[c]];
    }
    for (int p = 0; p < n; p++)
        for (int r = p + 1; r < n; r++) {
            const double factor = m[r][p] / m[p][p];
            for (int c = p; c <= n; c++)
                m[r][c] -= factor * m[p][c];
        }
    for (int r = n - 1; r >= 0; r--) {
        double value = m[r][n];
        for (int c = r + 1; c < n; c++)
            value -= m[r][c] * x[index[c]];
        x[index[r]] = value / m[r][r];
    }
}
