/* SPDX-License-Identifier: Apache-2.0 */
/* The z-buffer against triangles whose pixels can be counted. */
#include <math.h>

#include "agent/out/raster.h"
#include "tests/lib/test.h"

#define SIZE 100

static AgentRasterPoint at(double x, double y, double z)
{
    return (AgentRasterPoint){x, y, z, 0.5};
}

static int count(const AgentRaster *raster, int32_t triangle)
{
    int n = 0;
    for (int i = 0; i < raster->width * raster->height; i++)
        n += raster->pixels[i].triangle == triangle;
    return n;
}

/* Two halves of a square, one turned the other way, cover it whole. */
static void square(void)
{
    AgentRaster raster;
    agent_raster_init(&raster, SIZE, SIZE);
    AgentRasterPoint a[3] = {at(10, 10, 0), at(60, 10, 0), at(60, 60, 0)};
    AgentRasterPoint b[3] = {at(10, 10, 0), at(60, 60, 0), at(10, 60, 0)};
    AgentRasterPoint turned[3] = {b[0], b[2], b[1]};
    agent_raster_triangle(&raster, a, 1);
    agent_raster_triangle(&raster, turned, 2);
    g_assert_cmpint(count(&raster, 1) + count(&raster, 2), ==, 50 * 50);
    /* The diagonal's pixels stay with the first. */
    g_assert_cmpint(count(&raster, 1), ==, 50 * 51 / 2);
    g_assert_cmpfloat(raster.pixels[15 * SIZE + 40].light, ==, 0.5f);
    agent_raster_clear(&raster);
}

/* Two triangles that cut through each other: each is seen where it is nearer to the eye. */
static void depth(void)
{
    AgentRaster raster;
    agent_raster_init(&raster, SIZE, SIZE);
    AgentRasterPoint flat[3] = {at(-100, 0, 0), at(300, 0, 0), at(0, 300, 0)};
    AgentRasterPoint tilted[3] = {at(-100, 0, -150), at(300, 0, 250), at(-100, 300, -150)};
    agent_raster_triangle(&raster, flat, 1);
    agent_raster_triangle(&raster, tilted, 2);
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            double z = x + 0.5 - 50;
            g_assert_cmpint(raster.pixels[y * SIZE + x].triangle, ==, z > 0 ? 2 : 1);
            test_near(raster.pixels[y * SIZE + x].z, fmax(z, 0), 1e-9, 0);
        }
    agent_raster_clear(&raster);
}

/* What lies outside, or has no area, draws nothing and touches nothing. */
static void outside(void)
{
    AgentRaster raster;
    agent_raster_init(&raster, SIZE, SIZE);
    AgentRasterPoint none[][3] = {
        {at(-50, -50, 0), at(-10, -50, 0), at(-10, -10, 0)},
        {at(200, 200, 0), at(300, 200, 0), at(300, 400, 0)},
        {at(10, 10, 0), at(50, 50, 0), at(90, 90, 0)},
        {at(NAN, 10, 0), at(50, 50, 0), at(90, 10, 0)},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(none); i++)
        agent_raster_triangle(&raster, none[i], 1);
    g_assert_cmpint(count(&raster, -1), ==, SIZE * SIZE);
    AgentRasterPoint huge[3] = {at(-1e9, -1e9, 0), at(1e9, -1e9, 0), at(0, 2e9, 0)};
    agent_raster_triangle(&raster, huge, 1);
    g_assert_cmpint(count(&raster, 1), ==, SIZE * SIZE);
    agent_raster_clear(&raster);
}

static void add(void)
{
    g_test_add_func("/agent/raster/square", square);
    g_test_add_func("/agent/raster/depth", depth);
    g_test_add_func("/agent/raster/outside", outside);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
