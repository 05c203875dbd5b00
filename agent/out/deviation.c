/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/deviation.h"

#include <math.h>

#include "agent/out/view.h"

/* A spot colours the pixels this many pitches around it, unless a nearer one does. */
#define SPOT_PITCHES 2.5

#define SCALE_HEIGHT 300 /* of the scale in the legend, pixels */
#define SCALE_STEPS 100

/* The scale runs to this many times the limits. */
#define SCALE_MOST 1.5

static const AgentColour not_asked = {0.80, 0.80, 0.82};
static const AgentColour unreachable = {0.55, 0.55, 0.58};

typedef struct {
    const SegSegmentation *segmentation;
    const NcVerdict *verdict;
    size_t *spots; /* of each pixel of the raster, n_spots where there is none */
} Map;

static void map_spots(const AgentView *view, const NcVerdict *verdict, size_t *spots);
static AgentColour shade(const AgentView *view, size_t pixel, const void *data);
static void draw_legend(const AgentView *view, cairo_t *cr, const void *data);

GBytes *agent_deviation_png(const SegPart *part, const SegSegmentation *segmentation,
                            const NcSetup *setup, const NcVerdict *verdict, GError **error)
{
    g_autofree int32_t *regions = agent_view_regions(part, segmentation);
    AgentView view;
    agent_view_init(&view, part, setup, regions);
    size_t n = (size_t)view.raster.width * (size_t)view.raster.height;
    g_autofree size_t *spots = g_new(size_t, n);
    map_spots(&view, verdict, spots);
    Map map = {segmentation, verdict, spots};
    GBytes *png = agent_view_png(&view, shade, draw_legend, &map, "deviation.png", error);
    agent_view_clear(&view);
    return png;
}

/* --------------------------------------------------------------------------- map */

/* How far around a spot its colour goes, pixels of the raster. */
static double radius_of(const AgentView *view, const NcSpot *spot)
{
    return SPOT_PITCHES * sqrt(spot->area_mm2) * view->scale + 1;
}

static void map_spot(const AgentView *view, const NcVerdict *verdict, size_t index, float *nearest,
                     size_t *spots)
{
    const NcSpot *spot = &verdict->spots[index];
    const AgentRaster *raster = &view->raster;
    AgentRasterPoint at = agent_view_point(view, spot->point);
    int32_t face = view->part->triangles[spot->triangle].face;
    double radius = radius_of(view, spot);
    int x0 = (int)fmax(floor(at.x - radius), 0), y0 = (int)fmax(floor(at.y - radius), 0);
    int x1 = (int)fmin(ceil(at.x + radius), raster->width - 1);
    int y1 = (int)fmin(ceil(at.y + radius), raster->height - 1);
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            size_t pixel = (size_t)y * (size_t)raster->width + (size_t)x;
            const AgentPixel *seen = &raster->pixels[pixel];
            float dx = (float)(x + 0.5 - at.x), dy = (float)(y + 0.5 - at.y);
            float distance = dx * dx + dy * dy;
            if (seen->triangle < 0 || view->part->triangles[seen->triangle].face != face ||
                fabs(seen->z - at.z) > 2 * radius || distance >= nearest[pixel])
                continue;
            nearest[pixel] = distance;
            spots[pixel] = index;
        }
}

static void map_spots(const AgentView *view, const NcVerdict *verdict, size_t *spots)
{
    size_t n = (size_t)view->raster.width * (size_t)view->raster.height;
    g_autofree float *nearest = g_new(float, n);
    for (size_t i = 0; i < n; i++) {
        nearest[i] = INFINITY;
        spots[i] = verdict->n_spots;
    }
    for (size_t i = 0; i < verdict->n_spots; i++)
        map_spot(view, verdict, i, nearest, spots);
}

/* ------------------------------------------------------------------------ colour */

static AgentColour between(AgentColour a, AgentColour b, double t)
{
    return (AgentColour){a.r + t * (b.r - a.r), a.g + t * (b.g - a.g), a.b + t * (b.b - a.b)};
}

/* Within the limits from blue over green to yellow; red is too much left, violet too much gone. */
static AgentColour colour_of(const NcVerdict *verdict, double deviation_mm)
{
    static const AgentColour low = {0.15, 0.40, 0.85}, even = {0.55, 0.85, 0.55},
                             high = {0.98, 0.85, 0.25};
    static const AgentColour too_low = {0.50, 0.05, 0.60}, too_high = {0.80, 0.10, 0.10};
    if (deviation_mm < -verdict->gouge_limit_mm)
        return too_low;
    if (deviation_mm > verdict->excess_limit_mm)
        return too_high;
    return deviation_mm < 0 ? between(even, low, -deviation_mm / verdict->gouge_limit_mm)
                            : between(even, high, deviation_mm / verdict->excess_limit_mm);
}

static AgentColour shade(const AgentView *view, size_t pixel, const void *data)
{
    const Map *map = data;
    const NcVerdict *verdict = map->verdict;
    (void)view;
    if (map->spots[pixel] == verdict->n_spots)
        return not_asked;
    const NcSpot *spot = &verdict->spots[map->spots[pixel]];
    if (spot->deviation_mm >= -verdict->gouge_limit_mm) {
        if (spot->region == 0)
            return not_asked;
        if (!spot->reached && spot->deviation_mm > verdict->excess_limit_mm)
            return unreachable;
    }
    return colour_of(verdict, spot->deviation_mm);
}

/* ------------------------------------------------------------------------ legend */

static void draw_scale(cairo_t *cr, double top, const NcVerdict *verdict)
{
    double high = SCALE_MOST * verdict->excess_limit_mm,
           low = -SCALE_MOST * verdict->gouge_limit_mm;
    for (int i = 0; i < SCALE_STEPS; i++) {
        double y = top + SCALE_HEIGHT * (double)i / SCALE_STEPS;
        AgentColour c = colour_of(verdict, high + (low - high) * (i + 0.5) / SCALE_STEPS);
        cairo_set_source_rgb(cr, c.r, c.g, c.b);
        cairo_rectangle(cr, AGENT_VIEW, y, 34, (double)SCALE_HEIGHT / SCALE_STEPS + 0.5);
        cairo_fill(cr);
    }
    cairo_set_source_rgb(cr, 0.1, 0.1, 0.1);
    const struct {
        double mm;
        const char *what;
    } marks[] = {{verdict->excess_limit_mm, "excess: scallop + tolerance"},
                 {0, "as the CAD face wants it"},
                 {-verdict->gouge_limit_mm, "gouge: tolerance"}};
    for (size_t i = 0; i < G_N_ELEMENTS(marks); i++) {
        double y = top + SCALE_HEIGHT * (high - marks[i].mm) / (high - low);
        g_autofree char *text = g_strdup_printf("%.4g mm  %s", marks[i].mm, marks[i].what);
        cairo_move_to(cr, AGENT_VIEW, y);
        cairo_line_to(cr, AGENT_VIEW + 40, y);
        cairo_stroke(cr);
        cairo_move_to(cr, AGENT_VIEW + 46, y + 6);
        cairo_show_text(cr, text);
    }
}

/* A ring around the worst place, where it is seen. */
static void mark(const AgentView *view, cairo_t *cr, const NcWorst *worst, const char *what)
{
    if (worst->depth_mm <= 0)
        return;
    AgentRasterPoint at = agent_view_point(view, worst->point);
    double x = agent_view_pixel(at.x), y = agent_view_pixel(at.y);
    size_t pixel = (size_t)fmax(at.y, 0) * (size_t)view->raster.width + (size_t)fmax(at.x, 0);
    bool seen = pixel < (size_t)view->raster.width * (size_t)view->raster.height &&
                at.z > view->raster.pixels[pixel].z - view->scale;
    cairo_set_line_width(cr, 2);
    if (!seen)
        cairo_set_dash(cr, (const double[]){3, 3}, 2, 0);
    cairo_new_path(cr);
    cairo_arc(cr, x, y, 9, 0, 2 * G_PI);
    cairo_stroke(cr);
    cairo_set_dash(cr, NULL, 0, 0);
    cairo_move_to(cr, x + 12, y - 8);
    cairo_show_text(cr, what);
}

static double draw_judgement(cairo_t *cr, double y, const char *name, const NcJudgement *judgement)
{
    g_autofree char *depths = g_strdup_printf(
        "   gouge %.4f  excess %.4f  (99 %%: %.4f) mm", judgement->gouge_max.depth_mm,
        judgement->excess_max.depth_mm, judgement->excess_p99_mm);
    g_autofree char *areas =
        g_strdup_printf("   within tolerance %.3f %%, covered %.2f %%",
                        judgement->within_tolerance_percent, judgement->coverage_percent);
    agent_legend_text(cr, y, name);
    cairo_set_font_size(cr, 15);
    agent_legend_text(cr, y + 21, depths);
    agent_legend_text(cr, y + 41, areas);
    cairo_set_font_size(cr, 17);
    return y + 70;
}

static void draw_legend(const AgentView *view, cairo_t *cr, const void *data)
{
    const Map *map = data;
    const NcVerdict *verdict = map->verdict;
    double y = AGENT_VIEW_MARGIN + 20;
    agent_legend_text(cr, y, verdict->in_tolerance ? "in tolerance" : "OUT OF TOLERANCE");
    draw_scale(cr, y + 20, verdict);
    y += SCALE_HEIGHT + 60;
    agent_legend_row(cr, y, unreachable, "out of the tools' reach");
    agent_legend_row(cr, y += 30, not_asked, "not asked for");
    y = draw_judgement(cr, y + 45, "the whole part", &verdict->whole);
    for (size_t i = 0; i < verdict->n_regions && y < AGENT_VIEW - 100; i++) {
        const NcJudgement *judgement = &verdict->regions[i];
        g_autofree char *name = NULL;
        for (size_t r = 0; r < map->segmentation->n_regions; r++)
            if (map->segmentation->regions[r].id == judgement->region)
                name = g_strdup_printf("region %d '%s'", judgement->region,
                                       map->segmentation->regions[r].name);
        y = draw_judgement(cr, y, name, judgement);
    }
    if (verdict->collisions->len > 0) {
        g_autofree char *text = g_strdup_printf("%u collisions", verdict->collisions->len);
        agent_legend_text(cr, y, text);
    }
    mark(view, cr, &verdict->whole.excess_max, "excess");
    mark(view, cr, &verdict->whole.gouge_max, "gouge");
}
