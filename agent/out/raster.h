/* SPDX-License-Identifier: Apache-2.0 */
/* A z-buffer: triangles in, the nearest one a pixel out. */
#ifndef AGENT_OUT_RASTER_H
#define AGENT_OUT_RASTER_H

#include "segcore/segcore.h"

/* A point as seen: x to the right, y down, in pixels; z towards the eye. */
typedef struct {
    double x, y, z;
    double light; /* 0 … 1, interpolated over the triangle */
} AgentRasterPoint;

typedef struct {
    int32_t triangle; /* -1: background */
    float light;
    double z;
} AgentPixel;

typedef struct {
    int width, height;
    AgentPixel *pixels; /* row by row from the top */
} AgentRaster;

void agent_raster_init(AgentRaster *raster, int width, int height);
void agent_raster_clear(AgentRaster *raster);

/* Draws a triangle, clipped to the raster. Of two at the same depth the first drawn stays. */
void agent_raster_triangle(AgentRaster *raster, const AgentRasterPoint corner[3], int32_t triangle);

#endif
