/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/picture.h"

#include <math.h>

#include "agent/out/view.h"

#define LEGEND_ROWS 24

static const AgentColour unassigned = {0.62, 0.62, 0.62};

static AgentColour shade(const AgentView *view, size_t pixel, const void *data);
static void draw_legend(const AgentView *view, cairo_t *cr, const void *data);

GBytes *agent_regions_png(const SegPart *part, const SegSegmentation *segmentation, GError **error)
{
    g_autofree int32_t *regions = agent_view_regions(part, segmentation);
    AgentView view;
    agent_view_init(&view, part, NULL, regions);
    GBytes *png = agent_view_png(&view, shade, draw_legend, segmentation, "regions.png", error);
    agent_view_clear(&view);
    return png;
}

/* Hues a golden angle apart never come close for the regions that a legend can list. */
static AgentColour colour_of(int32_t id)
{
    if (id <= 0)
        return unassigned;
    double hue = fmod(0.58 + 0.61803398874989 * (id - 1), 1.0);
    double channel[3];
    for (int i = 0; i < 3; i++) {
        double distance = fabs(fmod(hue * 6 + 6 - 2 * i, 6.0) - 3);
        channel[i] = 0.35 + 0.6 * fmin(1, fmax(0, distance - 1));
    }
    return (AgentColour){channel[0], channel[1], channel[2]};
}

static AgentColour shade(const AgentView *view, size_t pixel, const void *data)
{
    (void)data;
    return colour_of(view->regions[view->raster.pixels[pixel].triangle]);
}

static void draw_legend(const AgentView *view, cairo_t *cr, const void *data)
{
    (void)view;
    const SegSegmentation *segmentation = data;
    double y = AGENT_VIEW_MARGIN + 20;
    g_autofree char *title =
        g_strdup_printf("%s: %zu region%s", segmentation->method, segmentation->n_regions,
                        segmentation->n_regions == 1 ? "" : "s");
    agent_legend_text(cr, y, title);
    size_t shown = MIN(segmentation->n_regions, LEGEND_ROWS);
    for (size_t i = 0; i < shown; i++) {
        const SegRegion *region = &segmentation->regions[i];
        g_autofree char *text =
            g_strdup_printf("%d  %s  %s  %.2f mm²", region->id, region->name,
                            seg_region_kind_name(region->kind), region->area_mm2);
        agent_legend_row(cr, y += 34, colour_of(region->id), text);
    }
    if (segmentation->n_dropped > 0) {
        g_autofree char *text = g_strdup_printf("left out: %zu faces", segmentation->n_dropped);
        agent_legend_row(cr, y += 34, unassigned, text);
    }
    if (shown < segmentation->n_regions) {
        g_autofree char *text = g_strdup_printf("and %zu more", segmentation->n_regions - shown);
        cairo_move_to(cr, AGENT_VIEW + 34, y + 34);
        cairo_show_text(cr, text);
    }
}
