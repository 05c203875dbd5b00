/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/raster.h"

#include <math.h>

void agent_raster_init(AgentRaster *raster, int width, int height)
{
    raster->width = width;
    raster->height = height;
    raster->pixels = g_new(AgentPixel, (size_t)width * (size_t)height);
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++)
        raster->pixels[i] = (AgentPixel){.triangle = -1, .z = -INFINITY};
}

void agent_raster_clear(AgentRaster *raster)
{
    g_clear_pointer(&raster->pixels, g_free);
}

/* Twice the area of a, b, c; positive clockwise on a screen whose y runs down. */
static double area(const AgentRasterPoint *a, const AgentRasterPoint *b, double x, double y)
{
    return (b->x - a->x) * (y - a->y) - (b->y - a->y) * (x - a->x);
}

static int clamp(double value, int limit)
{
    return value < 0 ? 0 : value > limit ? limit : (int)value;
}

static void draw_row(AgentRaster *raster, const AgentRasterPoint c[3], double whole, int row,
                     int first, int last, int32_t triangle)
{
    double y = row + 0.5;
    for (int column = first; column < last; column++) {
        double x = column + 0.5;
        double w[3] = {area(&c[1], &c[2], x, y) / whole, area(&c[2], &c[0], x, y) / whole, 0};
        w[2] = 1 - w[0] - w[1];
        if (w[0] < 0 || w[1] < 0 || w[2] < 0)
            continue;
        double z = w[0] * c[0].z + w[1] * c[1].z + w[2] * c[2].z;
        AgentPixel *pixel = &raster->pixels[(size_t)row * (size_t)raster->width + (size_t)column];
        if (z <= pixel->z)
            continue;
        double light = w[0] * c[0].light + w[1] * c[1].light + w[2] * c[2].light;
        *pixel = (AgentPixel){.triangle = triangle, .light = (float)light, .z = z};
    }
}

void agent_raster_triangle(AgentRaster *raster, const AgentRasterPoint corner[3], int32_t triangle)
{
    double whole = area(&corner[0], &corner[1], corner[2].x, corner[2].y);
    if (whole == 0 || !isfinite(whole))
        return;
    double x0 = fmin(corner[0].x, fmin(corner[1].x, corner[2].x));
    double x1 = fmax(corner[0].x, fmax(corner[1].x, corner[2].x));
    double y0 = fmin(corner[0].y, fmin(corner[1].y, corner[2].y));
    double y1 = fmax(corner[0].y, fmax(corner[1].y, corner[2].y));
    int first = clamp(floor(x0), raster->width), last = clamp(ceil(x1), raster->width);
    int bottom = clamp(ceil(y1), raster->height);
    for (int row = clamp(floor(y0), raster->height); row < bottom; row++)
        draw_row(raster, corner, whole, row, first, last, triangle);
}
