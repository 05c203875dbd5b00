/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/soup.h"

void soup_add(Soup *soup, SegVec3 a, SegVec3 b, SegVec3 c)
{
    if ((soup->n & (soup->n - 1)) == 0)
        soup->triangles =
            g_realloc_n(soup->triangles, soup->n ? 2 * soup->n : 1, sizeof *soup->triangles);
    soup->triangles[soup->n][0] = a;
    soup->triangles[soup->n][1] = b;
    soup->triangles[soup->n++][2] = c;
}

void soup_clear(Soup *soup)
{
    g_free(soup->triangles);
    *soup = (Soup){0};
}

NcTerrain *soup_terrain(const Soup *soup)
{
    g_autofree int32_t(*index)[3] = g_malloc_n(soup->n, sizeof *index);
    for (size_t i = 0; i < soup->n; i++)
        for (int k = 0; k < 3; k++)
            index[i][k] = (int32_t)(3 * i) + k;
    return nc_terrain_new(soup->triangles ? soup->triangles[0] : NULL, 3 * soup->n, index, soup->n);
}

NcTerrain *soup_terrain_of(const Soup *soup, size_t triangle)
{
    static const int32_t index[1][3] = {{0, 1, 2}};
    return nc_terrain_new(soup->triangles[triangle], 3, index, 1);
}

static SegVec3 random_point(GRand *rand, SegVec3 about, double size)
{
    return seg_vec3(about.x + g_rand_double_range(rand, -size, size),
                    about.y + g_rand_double_range(rand, -size, size),
                    about.z + g_rand_double_range(rand, -size, size));
}

void soup_add_random(Soup *soup, GRand *rand, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        double size = exp(g_rand_double_range(rand, log(0.05), log(5)));
        SegVec3 about = random_point(rand, seg_vec3(0, 0, 0), 10 - size);
        SegVec3 a = random_point(rand, about, size), b = random_point(rand, about, size);
        SegVec3 c = random_point(rand, about, size);
        switch (g_rand_int_range(rand, 0, 8)) {
        case 0: /* a wall */
            c.x = a.x, c.y = a.y;
            break;
        case 1: /* a wall whose vertices are not over each other */
            c.x = a.x + 0.25 * (b.x - a.x), c.y = a.y + 0.25 * (b.y - a.y);
            break;
        case 2: /* level */
            b.z = c.z = a.z;
            break;
        case 3: /* a needle */
            c = seg_along(seg_lerp(a, b, 0.3), c, 1e-10);
            break;
        case 4: /* no area */
            c = g_rand_boolean(rand) ? b : seg_lerp(a, b, 0.5);
            break;
        default:
            break;
        }
        soup_add(soup, a, b, c);
    }
}

static double wave_mm(double x, double y)
{
    return 3 * sin(x / 8) * cos(y / 11) + 1.5 * sin((x + 2 * y) / 17) + 0.4 * cos(x / 3 - y / 4);
}

void soup_add_waves(Soup *soup, GRand *rand, int side)
{
    size_t n = (size_t)side + 1;
    g_autofree SegVec3 *points = g_new(SegVec3, n * n);
    for (int i = 0; i <= side; i++) {
        for (int j = 0; j <= side; j++) {
            bool inner = i > 0 && j > 0 && i < side && j < side;
            double x = i + (inner ? g_rand_double_range(rand, -0.35, 0.35) : 0);
            double y = j + (inner ? g_rand_double_range(rand, -0.35, 0.35) : 0);
            x *= 100.0 / side, y *= 100.0 / side;
            points[(size_t)i * n + (size_t)j] = seg_vec3(x, y, wave_mm(x, y));
        }
    }
    for (size_t i = 0; i + 1 < n; i++) {
        for (size_t j = 0; j + 1 < n; j++) {
            const SegVec3 *p = points + i * n + j, *q = p + n;
            if (g_rand_boolean(rand)) {
                soup_add(soup, p[0], q[0], p[1]);
                soup_add(soup, q[0], q[1], p[1]);
            } else {
                soup_add(soup, p[0], q[0], q[1]);
                soup_add(soup, p[0], q[1], p[1]);
            }
        }
    }
}

void soup_add_sphere(Soup *soup, double radius_mm, int n)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < 2 * n; j++) {
            SegVec3 p[2][2];
            for (int k = 0; k < 4; k++) {
                double theta = G_PI * (i + k / 2) / n, phi = G_PI * (j + k % 2) / n;
                p[k / 2][k % 2] =
                    seg_vec3(radius_mm * sin(theta) * cos(phi), radius_mm * sin(theta) * sin(phi),
                             radius_mm * cos(theta));
            }
            soup_add(soup, p[0][0], p[1][0], p[1][1]);
            soup_add(soup, p[0][0], p[1][1], p[0][1]);
        }
    }
}
