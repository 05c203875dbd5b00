/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/cutter_body.h"

static void add_frustum(NcToolBody *body, double z0, double r0, double z1, double r1)
{
    if (z1 > z0)
        body->frustum[body->n_frusta++] = (NcFrustum){z0, z1, r0, r1};
}

/* The cone up to the tool's radius, then the cylinder, and neither above the top. */
static void add_sides(NcToolBody *body, double z, double r, double half_angle_rad)
{
    double straight = z, widest = body->radius;
    if (half_angle_rad > 0 && r < widest) {
        double slope = tan(half_angle_rad);
        straight = z + (widest - r) / slope;
        if (straight > body->top) {
            straight = body->top;
            widest = r + (body->top - z) * slope;
        }
        add_frustum(body, z, r, straight, widest);
    }
    add_frustum(body, straight, widest, body->top, widest);
    body->radius = widest;
}

NcToolBody nc_body_cutting(const CfgTool *tool)
{
    double radius = tool->diameter_mm / 2, corner = tool->corner_radius_mm;
    double disc = radius - corner, half_angle = 0;
    switch (tool->kind) {
    case CFG_TOOL_FLAT:
        corner = 0;
        disc = radius;
        break;
    case CFG_TOOL_BALL:
        corner = radius;
        disc = 0;
        break;
    case CFG_TOOL_DRILL:
    case CFG_TOOL_CHAMFER:
        corner = 0;
        disc = tool->tip_diameter_mm / 2;
        half_angle = tool->tip_angle_deg * G_PI / 360;
        break;
    case CFG_TOOL_TAPER:
        disc = fmax(0, tool->tip_diameter_mm / 2 - corner);
        half_angle = tool->tip_angle_deg * G_PI / 360;
        break;
    default:
        break;
    }
    NcToolBody body = {.top = fmax(tool->flute_length_mm, 2 * corner), .radius = radius};
    body.rounded = (NcRoundedDisc){corner, disc, corner};
    add_sides(&body, corner * (1 - sin(half_angle)), disc + corner * cos(half_angle), half_angle);
    return body;
}

NcToolBody nc_body_cylinder(double bottom, double top, double diameter_mm)
{
    NcToolBody body = {.bottom = bottom, .top = top, .radius = diameter_mm / 2};
    if (diameter_mm > 0)
        add_frustum(&body, bottom, body.radius, top, body.radius);
    return body;
}

NcToolBody nc_body_shank(const CfgTool *tool)
{
    double diameter = tool->shank_diameter_mm > 0 ? tool->shank_diameter_mm : tool->diameter_mm;
    return nc_body_cylinder(tool->flute_length_mm, tool->stickout_mm, diameter);
}

NcToolBody nc_body_holder(const CfgTool *tool)
{
    return nc_body_cylinder(tool->stickout_mm, tool->length_mm, tool->holder_diameter_mm);
}

bool nc_body_is_empty(const NcToolBody *body)
{
    return body->n_frusta == 0 && body->rounded.round <= 0;
}

static double frustum_height(const NcFrustum *f, double distance)
{
    if (distance > f->r1)
        return INFINITY;
    return distance <= f->r0 ? f->z0
                             : f->z0 + (f->z1 - f->z0) * (distance - f->r0) / (f->r1 - f->r0);
}

double nc_body_height_mm(const NcToolBody *body, double distance_mm)
{
    double height = INFINITY;
    for (int i = 0; i < body->n_frusta; i++)
        height = fmin(height, frustum_height(&body->frustum[i], distance_mm));
    const NcRoundedDisc *r = &body->rounded;
    double beyond = fmax(distance_mm - r->disc, 0);
    if (r->round > 0 && beyond <= r->round)
        height = fmin(height, r->centre - sqrt((r->round - beyond) * (r->round + beyond)));
    return height;
}

double nc_body_radius_mm(const NcToolBody *body, double height_mm)
{
    double radius = -1;
    for (int i = 0; i < body->n_frusta; i++) {
        const NcFrustum *f = &body->frustum[i];
        if (height_mm >= f->z0) {
            double share = fmin((height_mm - f->z0) / (f->z1 - f->z0), 1);
            radius = fmax(radius, f->r0 + share * (f->r1 - f->r0));
        }
    }
    const NcRoundedDisc *r = &body->rounded;
    double below = fmax(r->centre - height_mm, 0);
    if (r->round > 0 && below <= r->round)
        radius = fmax(radius, r->disc + sqrt((r->round - below) * (r->round + below)));
    return radius;
}
