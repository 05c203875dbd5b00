/* SPDX-License-Identifier: Apache-2.0 */
/* Drop-cutter and sweep on a wavy surface of 100 × 100 mm, irregular triangles. */
#include <omp.h>
#include <stdio.h>

#include "tests/lib/soup.h"

enum { PLACES = 1000 }; /* a side: a raster of parallel passes, 0.1 mm apart */

static double drops_per_s(const NcTerrain *terrain, NcCutter cutter, int threads)
{
    size_t n = PLACES * PLACES;
    g_autofree double *x = g_new(double, n), *y = g_new(double, n), *z = g_new(double, n);
    for (size_t i = 0; i < n; i++) {
        x[i] = 100.0 * (double)(i % PLACES) / PLACES;
        y[i] = 100.0 * (double)(i / PLACES) / PLACES;
    }
    omp_set_num_threads(threads);
    double best = 0;
    for (int run = 0; run < 3; run++) {
        double start = omp_get_wtime();
        nc_drop_batch(terrain, cutter, n, x, y, z, NULL, NULL);
        best = fmax(best, (double)n / (omp_get_wtime() - start));
    }
    return best;
}

/* Moves along the passes, tips on the surface as the drop-cutter finds them. */
static double sweeps_per_s(const NcTerrain *terrain, NcCutter cutter, double step_mm)
{
    size_t n = 100000;
    g_autofree SegVec3 *tips = g_new(SegVec3, n);
    g_autofree double *gouge = g_new(double, n);
    size_t pass = (size_t)(100 / step_mm);
    for (size_t i = 0; i < n; i++) {
        tips[i] = seg_vec3((double)(i % pass) * step_mm, (double)(i / pass) * 0.1, 0);
        tips[i].z = nc_drop(terrain, cutter, tips[i].x, tips[i].y, NULL, NULL);
    }
    omp_set_num_threads(1);
    double start = omp_get_wtime();
    nc_sweep_gouge_batch(terrain, cutter, n, tips, 1e-4, gouge);
    return (double)n / (omp_get_wtime() - start);
}

static double checks_per_s(const NcTerrain *terrain, NcCutter cutter, double step_mm)
{
    int n = 100000, clear = 0;
    int pass = (int)(100 / step_mm);
    g_autofree SegVec3 *tips = g_new(SegVec3, (size_t)n);
    for (int i = 0; i < n; i++) {
        tips[i] = seg_vec3(i % pass * step_mm, i / pass * 0.1, 0);
        tips[i].z = nc_drop(terrain, cutter, tips[i].x, tips[i].y, NULL, NULL);
    }
    double start = omp_get_wtime();
    for (int i = 1; i < n; i++)
        clear += nc_sweep_clear(terrain, cutter, tips[i - 1], tips[i], 0.005);
    double seconds = omp_get_wtime() - start;
    printf("    (%.1f %% of the moves are clear within 0.005 mm)\n", 100.0 * clear / n);
    return n / seconds;
}

int main(void)
{
    static const struct {
        const char *name;
        NcCutter cutter;
    } cutters[] = {{"ball 6", {3, 3}},
                   {"flat 6", {3, 0}},
                   {"bull 6 r1", {3, 1}},
                   {"ball 20", {10, 10}},
                   {"flat 40 (holder)", {20, 0}}};
    static const int sides[] = {200, 50};
    for (size_t s = 0; s < G_N_ELEMENTS(sides); s++) {
        g_autoptr(GRand) rand = g_rand_new_with_seed(1);
        Soup soup = {0};
        soup_add_waves(&soup, rand, sides[s]);
        double start = omp_get_wtime();
        g_autoptr(NcTerrain) terrain = soup_terrain(&soup);
        printf("wavy surface, %d triangles (built in %.0f ms)\n", 2 * sides[s] * sides[s],
               1e3 * (omp_get_wtime() - start));
        for (size_t c = 0; c < G_N_ELEMENTS(cutters); c++) {
            double one = drops_per_s(terrain, cutters[c].cutter, 1);
            double two = drops_per_s(terrain, cutters[c].cutter, 2);
            printf("  %-17s %9.0f locations/s, two threads %9.0f (%.2f times)\n", cutters[c].name,
                   one, two, two / one);
        }
        for (double step = 0.1; step < 2; step *= 3) {
            double sweeps = sweeps_per_s(terrain, cutters[0].cutter, step);
            double checks = checks_per_s(terrain, cutters[0].cutter, step);
            printf("  moves of %.1f mm   %9.0f gouges/s, %9.0f checks/s\n", step, sweeps, checks);
        }
        soup_clear(&soup);
    }
    printf("goal: ball 6, 80000 triangles: 500000 on one thread, 1.8 times that on two; a\n"
           "well-known open library does 1300 there and 15000 at 5000 triangles\n");
    return 0;
}
