/* SPDX-License-Identifier: Apache-2.0 */
/* Points of B-spline surfaces on one core, beside Open CASCADE's GeomLProp_SLProps asked for the
 * same on the same surface and points. Goal 20 times, must 5 times. A map has positions, normals
 * and curvatures, as a segmentation takes them; all has derivatives and principal directions too,
 * 248 bytes a point. */
#include <stdio.h>
#include <time.h>

#include "tests/lib/surface_judge.h"
#include "tests/lib/test.h"
#include "tests/lib/waves.h"

static const double SECONDS = 0.5;

enum { MAP = SEG_POSITIONS | SEG_NORMALS | SEG_CURVATURES };

typedef enum { GRID, POINTS, TSPLINE } Kind;

typedef struct {
    const SegPart *part;
    const SegTspline *tspline; /* of the same surface; NULL: its degree is above 3 */
    Kind kind;
    size_t n_u, n_v;
    const double *u, *v;         /* of the grid's lines */
    const double *all_u, *all_v; /* of its points */
    SegSurfaceBatch *batch;
} Case;

/* Of this process: whoever else computes is not counted, here and in the judge. */
static double processor_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void evaluate(const Case *c)
{
    if (c->kind == GRID)
        seg_face_grid(c->part, 0, c->u, c->n_u, c->v, c->n_v, c->batch);
    else if (c->kind == TSPLINE)
        seg_tspline_grid(c->tspline, c->u, c->n_u, c->v, c->n_v, c->batch);
    else
        seg_face_points(c->part, 0, c->all_u, c->all_v, c->n_u * c->n_v, c->batch);
}

/* The best of three. */
static double points_per_s(const Case *c)
{
    double best = 0;
    for (int run = 0; run < 3; run++) {
        double start = processor_s(), taken, points = 0;
        do {
            evaluate(c);
            points += (double)(c->n_u * c->n_v);
            taken = processor_s() - start;
        } while (taken < SECONDS / 3);
        best = MAX(best, points / taken);
    }
    return best;
}

static void report(const char *what, double peer, double ours)
{
    printf("    %-16s SLProps %5.2f M/s   ours %6.2f M/s   %5.1f times\n", what, peer / 1e6,
           ours / 1e6, ours / peer);
}

static void measure(const char *name, const SegPart *part, size_t n)
{
    g_autofree double *u = g_new(double, n), *v = g_new(double, n);
    g_autofree double *all_u = g_new(double, n *n), *all_v = g_new(double, n *n);
    double u0, u1, v0, v1;
    seg_face_domain(part, 0, &u0, &u1, &v0, &v1);
    for (size_t i = 0; i < n; i++) {
        u[i] = u0 + (u1 - u0) * ((double)i + 0.5) / (double)n;
        v[i] = v0 + (v1 - v0) * ((double)i + 0.5) / (double)n;
    }
    for (size_t i = 0; i < n * n; i++) {
        all_u[i] = u[i / n];
        all_v[i] = v[i % n];
    }
    g_autoptr(SegSurfaceBatch) all = seg_surface_batch_new(n * n, SEG_ALL_FIELDS);
    g_autoptr(SegSurfaceBatch) map = seg_surface_batch_new(n * n, MAP);
    g_autoptr(GByteArray) question = g_byte_array_new();
    surface_judge_ask(question, part->reals, &part->faces[0].surface, all_u, all_v, n * n);
    g_autoptr(SegTspline) t = seg_tspline_from_face(part, 0, NULL);
    Case c = {part, t, GRID, n, n, u, v, all_u, all_v, map};
    printf("  %-34s %4zux%-4zu\n", name, n, n);
    double peer = surface_judge_speed(question, SECONDS, false);
    report("map, grid", peer, points_per_s(&c));
    c.kind = TSPLINE;
    if (t)
        report("map, as T-spline", peer, points_per_s(&c));
    peer = surface_judge_speed(question, SECONDS, true);
    c.kind = GRID;
    c.batch = all;
    report("all, grid", peer, points_per_s(&c));
    c.kind = POINTS;
    report("all, scattered", peer, points_per_s(&c));
}

int main(void)
{
    static const struct {
        const char *name;
        int degree, n;
        bool rational;
    } surfaces[] = {{"bicubic, 20x20 poles", 3, 20, false},
                    {"bicubic, 20x20 poles, rational", 3, 20, true},
                    {"bicubic, 100x100 poles", 3, 100, false},
                    {"biquadratic, 20x20 poles, rational", 2, 20, true},
                    {"biquintic, 20x20 poles", 5, 20, false},
                    {"bilinear, 20x20 poles", 1, 20, false}};
    puts("surface: points with curvatures (goal 20 times, must 5)");
    for (size_t i = 0; i < G_N_ELEMENTS(surfaces); i++) {
        g_autoptr(SegPart) part =
            waves_part(surfaces[i].degree, surfaces[i].n, surfaces[i].rational);
        for (size_t n = 50; n <= 500; n *= 10)
            measure(surfaces[i].name, part, n);
    }
    return 0;
}
