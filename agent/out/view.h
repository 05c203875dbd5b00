/* SPDX-License-Identifier: Apache-2.0 */
/* A part as pictures show it: from above and one corner, shaded, with room for a legend. */
#ifndef AGENT_OUT_VIEW_H
#define AGENT_OUT_VIEW_H

#include <cairo.h>

#include "agent/out/raster.h"
#include "nc/nc.h"

/* Of the picture, pixels: the view is a square, the legend stands right of it. */
enum { AGENT_VIEW = 1000, AGENT_LEGEND = 420, AGENT_VIEW_MARGIN = 40 };

typedef struct {
    double r, g, b;
} AgentColour;

typedef struct {
    AgentRaster raster;   /* finer than the picture */
    double scale, dx, dy; /* its pixels to mm */
    const SegPart *part;
    const int32_t *regions; /* of each triangle; lines are drawn where they change */
} AgentView;

/* Draws the part: in workpiece coordinates where there is a setup (may be NULL), else in its own.
 * `part` and `regions` (one id for each triangle, 0: none) stay the caller's. */
void agent_view_init(AgentView *view, const SegPart *part, const NcSetup *setup,
                     const int32_t *regions);
void agent_view_clear(AgentView *view);

/* The region's id for every triangle; 0 for none. Caller frees. */
int32_t *agent_view_regions(const SegPart *part, const SegSegmentation *segmentation);

/* Where a point is seen: pixels of the raster, z towards the eye. */
AgentRasterPoint agent_view_point(const AgentView *view, SegVec3 point);

/* Colour of a pixel of the raster that shows a triangle; light is added. */
typedef AgentColour (*AgentShade)(const AgentView *view, size_t pixel, const void *data);

/* Draws the legend from x = AGENT_VIEW on, and marks over the view. */
typedef void (*AgentLegend)(const AgentView *view, cairo_t *cr, const void *data);

/* PNG bytes. Errors: AGENT_ERROR_OUTPUT, naming the file. */
GBytes *agent_view_png(const AgentView *view, AgentShade shade, AgentLegend legend,
                       const void *data, const char *name, GError **error);

/* A row of the legend: a box of the colour and a text, its base line at y. */
void agent_legend_row(cairo_t *cr, double y, AgentColour colour, const char *text);

/* Text at the legend's left edge. */
void agent_legend_text(cairo_t *cr, double y, const char *text);

/* A place of the raster in the picture. */
double agent_view_pixel(double raster_pixel);

#endif
