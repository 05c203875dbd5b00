/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/picture.h"

#include <cairo.h>
#include <math.h>

#include "agent/agent.h"
#include "agent/out/raster.h"

#define VIEW 1000  /* width and height of the view, pixels */
#define LEGEND 420 /* width of the legend beside it */
#define MARGIN 40
#define SAMPLES 2 /* a pixel is the mean of SAMPLES × SAMPLES */
#define LEGEND_ROWS 24

typedef struct {
    double r, g, b;
} Colour;

static const Colour paper = {1, 1, 1};
static const Colour unassigned = {0.62, 0.62, 0.62};

static void draw_part(AgentRaster *raster, const SegPart *part);
static void paint(cairo_surface_t *surface, const AgentRaster *raster, const SegPart *part,
                  const int32_t *region_of);
static void draw_legend(cairo_t *cr, const SegSegmentation *segmentation);

/* Hues a golden angle apart never come close for the regions that a legend can list. */
static Colour colour_of(int32_t id)
{
    if (id <= 0)
        return unassigned;
    double hue = fmod(0.58 + 0.61803398874989 * (id - 1), 1.0);
    double channel[3];
    for (int i = 0; i < 3; i++) {
        double distance = fabs(fmod(hue * 6 + 6 - 2 * i, 6.0) - 3);
        channel[i] = 0.35 + 0.6 * fmin(1, fmax(0, distance - 1));
    }
    return (Colour){channel[0], channel[1], channel[2]};
}

/* The region's id for every triangle; 0 for none. */
static int32_t *regions_of_triangles(const SegPart *part, const SegSegmentation *segmentation)
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

GBytes *agent_regions_png(const SegPart *part, const SegSegmentation *segmentation, GError **error)
{
    AgentRaster raster;
    agent_raster_init(&raster, VIEW * SAMPLES, VIEW * SAMPLES);
    draw_part(&raster, part);
    g_autofree int32_t *region_of = regions_of_triangles(part, segmentation);
    cairo_surface_t *surface = cairo_image_surface_create(CAIRO_FORMAT_RGB24, VIEW + LEGEND, VIEW);
    cairo_t *cr = cairo_create(surface);
    cairo_set_source_rgb(cr, paper.r, paper.g, paper.b);
    cairo_paint(cr);
    paint(surface, &raster, part, region_of);
    draw_legend(cr, segmentation);
    GByteArray *png = g_byte_array_new();
    cairo_status_t status = cairo_status(cr);
    if (status == CAIRO_STATUS_SUCCESS)
        status = cairo_surface_write_to_png_stream(surface, append, png);
    cairo_destroy(cr);
    cairo_surface_destroy(surface);
    agent_raster_clear(&raster);
    GBytes *bytes = g_byte_array_free_to_bytes(png);
    if (status == CAIRO_STATUS_SUCCESS)
        return bytes;
    g_bytes_unref(bytes);
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_OUTPUT, "regions.png: %s",
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

static void draw_part(AgentRaster *raster, const SegPart *part)
{
    double x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY;
    for (int32_t i = 0; i < part->n_vertices; i++) {
        SegVec3 p = seen(part->vertices[i].position);
        x0 = fmin(x0, p.x);
        x1 = fmax(x1, p.x);
        y0 = fmin(y0, p.y);
        y1 = fmax(y1, p.y);
    }
    double room = raster->width - 2 * MARGIN * SAMPLES;
    double scale = room / fmax(fmax(x1 - x0, y1 - y0), 1e-9);
    double dx = raster->width / 2.0 - scale * (x0 + x1) / 2;
    double dy = raster->height / 2.0 - scale * (y0 + y1) / 2;
    for (int32_t t = 0; t < part->n_triangles; t++) {
        AgentRasterPoint corner[3];
        for (int i = 0; i < 3; i++) {
            const SegVertex *vertex = &part->vertices[part->triangles[t].vertex[i]];
            SegVec3 p = seen(vertex->position);
            corner[i] = (AgentRasterPoint){dx + scale * p.x, dy + scale * p.y, scale * p.z,
                                           light_of(vertex->normal)};
        }
        agent_raster_triangle(raster, corner, t);
    }
}

/* ---------------------------------------------------------------------- colour */

/* A line is drawn where the region or the face changes towards the right or below. */
static double line_at(const AgentRaster *raster, const SegPart *part, const int32_t *region_of,
                      int x, int y)
{
    const AgentPixel *here = &raster->pixels[(size_t)y * (size_t)raster->width + (size_t)x];
    const AgentPixel *others[2] = {x + 1 < raster->width ? here + 1 : here,
                                   y + 1 < raster->height ? here + raster->width : here};
    double shade = 1;
    for (int i = 0; i < 2; i++) {
        int32_t a = here->triangle, b = others[i]->triangle;
        if (a == b)
            continue;
        if (a < 0 || b < 0 || region_of[a] != region_of[b])
            return 0.1;
        if (part->triangles[a].face != part->triangles[b].face)
            shade = 0.6;
    }
    return shade;
}

static Colour sample(const AgentRaster *raster, const SegPart *part, const int32_t *region_of,
                     int x, int y)
{
    const AgentPixel *pixel = &raster->pixels[(size_t)y * (size_t)raster->width + (size_t)x];
    Colour colour = paper;
    double light = line_at(raster, part, region_of, x, y);
    if (pixel->triangle >= 0) {
        colour = colour_of(region_of[pixel->triangle]);
        light *= pixel->light;
    }
    return (Colour){colour.r * light, colour.g * light, colour.b * light};
}

static uint32_t channel(double sum)
{
    return (uint32_t)(255 * sum / (SAMPLES * SAMPLES) + 0.5);
}

static void paint(cairo_surface_t *surface, const AgentRaster *raster, const SegPart *part,
                  const int32_t *region_of)
{
    cairo_surface_flush(surface);
    unsigned char *data = cairo_image_surface_get_data(surface);
    int stride = cairo_image_surface_get_stride(surface);
    for (int y = 0; data && y < VIEW; y++) {
        uint32_t *row = (uint32_t *)(void *)(data + (size_t)y * (size_t)stride);
        for (int x = 0; x < VIEW; x++) {
            Colour sum = {0, 0, 0};
            for (int i = 0; i < SAMPLES * SAMPLES; i++) {
                Colour c = sample(raster, part, region_of, x * SAMPLES + i % SAMPLES,
                                  y * SAMPLES + i / SAMPLES);
                sum = (Colour){sum.r + c.r, sum.g + c.g, sum.b + c.b};
            }
            row[x] = channel(sum.r) << 16 | channel(sum.g) << 8 | channel(sum.b);
        }
    }
    cairo_surface_mark_dirty(surface);
}

/* ---------------------------------------------------------------------- legend */

static void legend_row(cairo_t *cr, double y, Colour colour, const char *text)
{
    cairo_rectangle(cr, VIEW, y - 15, 22, 18);
    cairo_set_source_rgb(cr, colour.r, colour.g, colour.b);
    cairo_fill_preserve(cr);
    cairo_set_source_rgb(cr, 0.1, 0.1, 0.1);
    cairo_set_line_width(cr, 1);
    cairo_stroke(cr);
    cairo_move_to(cr, VIEW + 34, y);
    cairo_show_text(cr, text);
}

static void draw_legend(cairo_t *cr, const SegSegmentation *segmentation)
{
    cairo_select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cr, 17);
    cairo_set_source_rgb(cr, 0.1, 0.1, 0.1);
    double y = MARGIN + 20;
    g_autofree char *title =
        g_strdup_printf("%s: %zu region%s", segmentation->method, segmentation->n_regions,
                        segmentation->n_regions == 1 ? "" : "s");
    cairo_move_to(cr, VIEW, y);
    cairo_show_text(cr, title);
    size_t shown = MIN(segmentation->n_regions, LEGEND_ROWS);
    for (size_t i = 0; i < shown; i++) {
        const SegRegion *region = &segmentation->regions[i];
        g_autofree char *text =
            g_strdup_printf("%d  %s  %s  %.2f mm²", region->id, region->name,
                            seg_region_kind_name(region->kind), region->area_mm2);
        legend_row(cr, y += 34, colour_of(region->id), text);
    }
    if (segmentation->n_dropped > 0) {
        g_autofree char *text = g_strdup_printf("left out: %zu faces", segmentation->n_dropped);
        legend_row(cr, y += 34, unassigned, text);
    }
    if (shown < segmentation->n_regions) {
        g_autofree char *text = g_strdup_printf("and %zu more", segmentation->n_regions - shown);
        cairo_move_to(cr, VIEW + 34, y + 34);
        cairo_show_text(cr, text);
    }
}
