/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/view.h"

#include "agent/agent.h"

#define SAMPLES 2 /* a pixel is the mean of SAMPLES × SAMPLES of the raster */

static const AgentColour paper = {1, 1, 1};

static SegVec3 seen(SegVec3 p);
static double light_of(SegVec3 normal);
static void draw_part(AgentView *view, const NcSetup *setup);
static void paint(cairo_surface_t *surface, const AgentView *view, AgentShade shade,
                  const void *data);

void agent_view_init(AgentView *view, const SegPart *part, const NcSetup *setup,
                     const int32_t *regions)
{
    *view = (AgentView){.part = part, .regions = regions};
    agent_raster_init(&view->raster, AGENT_VIEW * SAMPLES, AGENT_VIEW * SAMPLES);
    draw_part(view, setup);
}

void agent_view_clear(AgentView *view)
{
    agent_raster_clear(&view->raster);
}

int32_t *agent_view_regions(const SegPart *part, const SegSegmentation *segmentation)
{
    int32_t *ids = g_new0(int32_t, (size_t)part->n_triangles);
    for (size_t r = 0; r < segmentation->n_regions; r++) {
        const SegRegion *region = &segmentation->regions[r];
        for (size_t i = 0; i < region->n_triangles; i++)
            ids[region->triangles[i]] = region->id;
    }
    return ids;
}

static cairo_status_t append(void *bytes, const unsigned char *data, unsigned length)
{
    g_byte_array_append(bytes, data, length);
    return CAIRO_STATUS_SUCCESS;
}

GBytes *agent_view_png(const AgentView *view, AgentShade shade, AgentLegend legend,
                       const void *data, const char *name, GError **error)
{
    cairo_surface_t *surface =
        cairo_image_surface_create(CAIRO_FORMAT_RGB24, AGENT_VIEW + AGENT_LEGEND, AGENT_VIEW);
    cairo_t *cr = cairo_create(surface);
    cairo_set_source_rgb(cr, paper.r, paper.g, paper.b);
    cairo_paint(cr);
    paint(surface, view, shade, data);
    cairo_select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cr, 17);
    cairo_set_source_rgb(cr, 0.1, 0.1, 0.1);
    legend(view, cr, data);
    GByteArray *png = g_byte_array_new();
    cairo_status_t status = cairo_status(cr);
    if (status == CAIRO_STATUS_SUCCESS)
        status = cairo_surface_write_to_png_stream(surface, append, png);
    cairo_destroy(cr);
    cairo_surface_destroy(surface);
    GBytes *bytes = g_byte_array_free_to_bytes(png);
    if (status == CAIRO_STATUS_SUCCESS)
        return bytes;
    g_bytes_unref(bytes);
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_OUTPUT, "%s: %s", name,
                cairo_status_to_string(status));
    return NULL;
}

/* ------------------------------------------------------------------------ view */

/* Isometric: the eye looks along -(1, -1, 1), Z is up (ISO 5456-3). */
static SegVec3 seen(SegVec3 p)
{
    const double s2 = 1 / sqrt(2), s3 = 1 / sqrt(3), s6 = 1 / sqrt(6);
    return seg_vec3((p.x + p.y) * s2, (p.x - p.y) * s6 - 2 * p.z * s6, (p.x - p.y + p.z) * s3);
}

/* Over, left of and behind the eye, so that no two faces of a box look alike. */
static double light_of(SegVec3 normal)
{
    SegVec3 lamp = seg_unit(seg_vec3(0.25, -0.55, 0.8));
    return 0.45 + 0.55 * fmax(0, seg_dot(normal, lamp));
}

AgentRasterPoint agent_view_point(const AgentView *view, SegVec3 point)
{
    SegVec3 p = seen(point);
    return (AgentRasterPoint){.x = view->dx + view->scale * p.x,
                              .y = view->dy + view->scale * p.y,
                              .z = view->scale * p.z};
}

double agent_view_pixel(double raster_pixel)
{
    return raster_pixel / SAMPLES;
}

static void draw_part(AgentView *view, const NcSetup *setup)
{
    const SegPart *part = view->part;
    size_t n = (size_t)part->n_vertices;
    g_autofree SegVec3 *points = g_new(SegVec3, n + 1);
    g_autofree double *light = g_new(double, n + 1);
    double x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        const SegVertex *vertex = &part->vertices[i];
        points[i] = setup ? nc_setup_point(setup, vertex->position) : vertex->position;
        light[i] = light_of(setup ? nc_setup_direction(setup, vertex->normal) : vertex->normal);
        SegVec3 p = seen(points[i]);
        x0 = fmin(x0, p.x);
        x1 = fmax(x1, p.x);
        y0 = fmin(y0, p.y);
        y1 = fmax(y1, p.y);
    }
    double room = view->raster.width - 2 * AGENT_VIEW_MARGIN * SAMPLES;
    view->scale = room / fmax(fmax(x1 - x0, y1 - y0), 1e-9);
    view->dx = view->raster.width / 2.0 - view->scale * (x0 + x1) / 2;
    view->dy = view->raster.height / 2.0 - view->scale * (y0 + y1) / 2;
    for (int32_t t = 0; t < part->n_triangles; t++) {
        AgentRasterPoint corner[3];
        for (int i = 0; i < 3; i++) {
            int32_t vertex = part->triangles[t].vertex[i];
            corner[i] = agent_view_point(view, points[vertex]);
            corner[i].light = light[vertex];
        }
        agent_raster_triangle(&view->raster, corner, t);
    }
}

/* ---------------------------------------------------------------------- colour */

/* A line is drawn where the region or the face changes towards the right or below. */
static double line_at(const AgentView *view, size_t pixel)
{
    const AgentRaster *raster = &view->raster;
    size_t width = (size_t)raster->width, height = (size_t)raster->height;
    const AgentPixel *here = &raster->pixels[pixel];
    const AgentPixel *others[2] = {pixel % width + 1 < width ? here + 1 : here,
                                   pixel / width + 1 < height ? here + width : here};
    double shade = 1;
    for (int i = 0; i < 2; i++) {
        int32_t a = here->triangle, b = others[i]->triangle;
        if (a == b)
            continue;
        if (a < 0 || b < 0 || view->regions[a] != view->regions[b])
            return 0.1;
        if (view->part->triangles[a].face != view->part->triangles[b].face)
            shade = 0.6;
    }
    return shade;
}

static AgentColour sample(const AgentView *view, size_t pixel, AgentShade shade, const void *data)
{
    const AgentPixel *at = &view->raster.pixels[pixel];
    AgentColour colour = paper;
    double light = line_at(view, pixel);
    if (at->triangle >= 0) {
        colour = shade(view, pixel, data);
        light *= at->light;
    }
    return (AgentColour){colour.r * light, colour.g * light, colour.b * light};
}

static uint32_t channel(double sum)
{
    return (uint32_t)(255 * sum / (SAMPLES * SAMPLES) + 0.5);
}

static void paint(cairo_surface_t *surface, const AgentView *view, AgentShade shade,
                  const void *data)
{
    cairo_surface_flush(surface);
    unsigned char *bytes = cairo_image_surface_get_data(surface);
    int stride = cairo_image_surface_get_stride(surface);
    for (int y = 0; bytes && y < AGENT_VIEW; y++) {
        uint32_t *row = (uint32_t *)(void *)(bytes + (size_t)y * (size_t)stride);
        for (int x = 0; x < AGENT_VIEW; x++) {
            AgentColour sum = {0, 0, 0};
            for (int i = 0; i < SAMPLES * SAMPLES; i++) {
                size_t column = (size_t)(x * SAMPLES + i % SAMPLES);
                size_t line = (size_t)(y * SAMPLES + i / SAMPLES);
                AgentColour c =
                    sample(view, line * (size_t)view->raster.width + column, shade, data);
                sum = (AgentColour){sum.r + c.r, sum.g + c.g, sum.b + c.b};
            }
            row[x] = channel(sum.r) << 16 | channel(sum.g) << 8 | channel(sum.b);
        }
    }
    cairo_surface_mark_dirty(surface);
}

/* ---------------------------------------------------------------------- legend */

void agent_legend_text(cairo_t *cr, double y, const char *text)
{
    cairo_move_to(cr, AGENT_VIEW, y);
    cairo_show_text(cr, text);
}

void agent_legend_row(cairo_t *cr, double y, AgentColour colour, const char *text)
{
    cairo_rectangle(cr, AGENT_VIEW, y - 15, 22, 18);
    cairo_set_source_rgb(cr, colour.r, colour.g, colour.b);
    cairo_fill_preserve(cr);
    cairo_set_source_rgb(cr, 0.1, 0.1, 0.1);
    cairo_set_line_width(cr, 1);
    cairo_stroke(cr);
    cairo_move_to(cr, AGENT_VIEW + 34, y);
    cairo_show_text(cr, text);
}
