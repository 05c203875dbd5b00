/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/cut_check.h"

#include <string.h>

/* Points sorted into squares. */
typedef struct {
    SegVec3 *points;
    size_t n, nx, ny;
    size_t *first;
    double *top; /* highest point of each square */
    double x0, y0, cell;
} Squares;

struct CutCheck {
    Squares squares;
    double pitch_mm;
};

static size_t square_of(const Squares *s, double x, double y)
{
    double i = fmin(fmax(floor((x - s->x0) / s->cell), 0), (double)(s->nx - 1));
    double j = fmin(fmax(floor((y - s->y0) / s->cell), 0), (double)(s->ny - 1));
    return (size_t)i * s->ny + (size_t)j;
}

static Squares squares_new(const SegVec3 *points, size_t n, double cell)
{
    Squares s = {.n = n, .x0 = INFINITY, .y0 = INFINITY, .cell = cell};
    double x1 = -INFINITY, y1 = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        s.x0 = fmin(s.x0, points[i].x);
        s.y0 = fmin(s.y0, points[i].y);
        x1 = fmax(x1, points[i].x);
        y1 = fmax(y1, points[i].y);
    }
    s.nx = (size_t)((x1 - s.x0) / cell) + 1;
    s.ny = (size_t)((y1 - s.y0) / cell) + 1;
    s.first = g_new0(size_t, s.nx * s.ny + 2);
    s.points = g_new(SegVec3, n + 1);
    for (size_t i = 0; i < n; i++)
        s.first[square_of(&s, points[i].x, points[i].y) + 2]++;
    for (size_t c = 2; c < s.nx * s.ny + 2; c++)
        s.first[c] += s.first[c - 1];
    for (size_t i = 0; i < n; i++)
        s.points[s.first[square_of(&s, points[i].x, points[i].y) + 1]++] = points[i];
    s.top = g_new(double, s.nx *s.ny);
    for (size_t c = 0; c < s.nx * s.ny; c++) {
        s.top[c] = -INFINITY;
        for (size_t i = s.first[c]; i < s.first[c + 1]; i++)
            s.top[c] = fmax(s.top[c], s.points[i].z);
    }
    return s;
}

static void squares_clear(Squares *s)
{
    g_free(s->points);
    g_free(s->first);
    g_free(s->top);
}

CutCheck *cut_check_new(const SegPart *part, const NcSetup *setup, double pitch_mm)
{
    g_autoptr(GArray) points = g_array_new(FALSE, FALSE, sizeof(SegVec3));
    for (int32_t t = 0; t < part->n_triangles; t++) {
        SegVec3 c[3];
        for (int k = 0; k < 3; k++)
            c[k] = nc_setup_point(setup, part->vertices[part->triangles[t].vertex[k]].position);
        double longest = fmax(seg_distance(c[0], c[1]),
                              fmax(seg_distance(c[1], c[2]), seg_distance(c[2], c[0])));
        int n = (int)fmax(ceil(longest / pitch_mm), 1);
        for (int i = 0; i <= n; i++)
            for (int j = 0; i + j <= n; j++) {
                SegVec3 p = seg_along(c[0], seg_sub(c[1], c[0]), (double)i / n);
                p = seg_along(p, seg_sub(c[2], c[0]), (double)j / n);
                g_array_append_val(points, p);
            }
    }
    CutCheck *check = g_new0(CutCheck, 1);
    check->pitch_mm = pitch_mm;
    check->squares = squares_new((SegVec3 *)(void *)points->data, points->len, 0.5);
    return check;
}

void cut_check_free(CutCheck *check)
{
    if (!check)
        return;
    squares_clear(&check->squares);
    g_free(check);
}

/* The envelope, from its definition. */
static double profile_mm(double radius, double corner, double d)
{
    double w = d - (radius - corner);
    if (d > radius)
        return INFINITY;
    return w <= 0 ? 0 : corner - sqrt(fmax(corner * corner - w * w, 0));
}

/* The deepest gouge known, or that of one place of the cutter where it is deeper. */
static double gouge_at(const Squares *s, double radius, double corner, SegVec3 tip, double deepest)
{
    double i0 = fmax(floor((tip.x - radius - s->x0) / s->cell), 0);
    double i1 = fmin(floor((tip.x + radius - s->x0) / s->cell), (double)s->nx - 1);
    double j0 = fmax(floor((tip.y - radius - s->y0) / s->cell), 0);
    double j1 = fmin(floor((tip.y + radius - s->y0) / s->cell), (double)s->ny - 1);
    for (double u = i0; u <= i1; u++)
        for (double v = j0; v <= j1; v++) {
            size_t c = (size_t)u * s->ny + (size_t)v;
            double x = s->x0 + u * s->cell, y = s->y0 + v * s->cell;
            double near = hypot(fmax(fmax(x - tip.x, tip.x - x - s->cell), 0),
                                fmax(fmax(y - tip.y, tip.y - y - s->cell), 0));
            if (s->top[c] - tip.z - profile_mm(radius, corner, near) <= deepest)
                continue;
            for (size_t i = s->first[c]; i < s->first[c + 1]; i++) {
                SegVec3 p = s->points[i];
                double d = hypot(p.x - tip.x, p.y - tip.y);
                deepest = fmax(deepest, p.z - tip.z - profile_mm(radius, corner, d));
            }
        }
    return deepest;
}

static double gouge_of(const CutCheck *check, const NcOperation *operation, double grow,
                       bool rapids)
{
    double radius = operation->tool->diameter_mm / 2 + grow;
    double corner = operation->tool->corner_radius_mm + grow;
    const GArray *locations = operation->path.locations;
    double deepest = -INFINITY;
#pragma omp parallel for schedule(dynamic, 16) reduction(max : deepest)
    for (guint i = 1; i < locations->len; i++) {
        const NcLocation *a = &g_array_index(locations, NcLocation, i - 1), *b = a + 1;
        if ((b->motion == NC_RAPID) != rapids)
            continue;
        int n = (int)ceil(seg_distance(a->tip, b->tip) / check->pitch_mm) + 1;
        for (int k = 0; k <= n; k++) {
            SegVec3 tip = seg_lerp(a->tip, b->tip, (double)k / n);
            tip.z -= grow;
            deepest = gouge_at(&check->squares, radius, corner, tip, deepest);
        }
    }
    return deepest;
}

double cut_check_gouge_mm(const CutCheck *check, const NcOperation *operation, double grow_mm)
{
    return gouge_of(check, operation, grow_mm, false);
}

double cut_check_rapid_gouge_mm(const CutCheck *check, const NcOperation *operation, double grow_mm)
{
    return gouge_of(check, operation, grow_mm, true);
}

void cut_check_surface(const NcOperation *operation, double pitch_mm, size_t n, const double *x,
                       const double *y, double *z)
{
    double radius = operation->tool->diameter_mm / 2;
    double corner = operation->tool->corner_radius_mm;
    const GArray *locations = operation->path.locations;
    g_autoptr(GArray) tips = g_array_new(FALSE, FALSE, sizeof(SegVec3));
    for (guint i = 1; i < locations->len; i++) {
        const NcLocation *a = &g_array_index(locations, NcLocation, i - 1), *b = a + 1;
        int steps = (int)ceil(seg_distance(a->tip, b->tip) / pitch_mm) + 1;
        for (int k = 0; b->motion == NC_CUT && k <= steps; k++) {
            SegVec3 tip = seg_lerp(a->tip, b->tip, (double)k / steps);
            g_array_append_val(tips, tip);
        }
    }
    Squares s = squares_new((SegVec3 *)(void *)tips->data, tips->len, fmax(radius / 4, 0.1));
#pragma omp parallel for schedule(dynamic, 16)
    for (size_t i = 0; i < n; i++) {
        z[i] = INFINITY;
        double i0 = floor((x[i] - radius - s.x0) / s.cell);
        double i1 = floor((x[i] + radius - s.x0) / s.cell);
        double j0 = floor((y[i] - radius - s.y0) / s.cell);
        double j1 = floor((y[i] + radius - s.y0) / s.cell);
        for (double u = fmax(i0, 0); u <= fmin(i1, (double)s.nx - 1); u++)
            for (double v = fmax(j0, 0); v <= fmin(j1, (double)s.ny - 1); v++) {
                size_t c = (size_t)u * s.ny + (size_t)v;
                for (size_t k = s.first[c]; k < s.first[c + 1]; k++) {
                    SegVec3 tip = s.points[k];
                    double d = hypot(x[i] - tip.x, y[i] - tip.y);
                    if (d <= radius)
                        z[i] = fmin(z[i], tip.z + profile_mm(radius, corner, d));
                }
            }
    }
    squares_clear(&s);
}
