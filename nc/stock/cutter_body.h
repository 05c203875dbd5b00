/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A tool as convex bodies of revolution about +Z, for the sweep: what cuts, the shank above it, and
 * the holder. Heights are above the tip, mm.
 */
#ifndef NC_STOCK_CUTTER_BODY_H
#define NC_STOCK_CUTTER_BODY_H

#include "nc/nc.h"

/* Radius r0 at height z0, growing evenly to r1 >= r0 at z1 > z0; a cylinder where they are equal.
 */
typedef struct {
    double z0, z1;
    double r0, r1;
} NcFrustum;

/* All points within `round` of a level disc: a sphere where disc is 0. */
typedef struct {
    double centre;
    double disc;
    double round; /* 0: there is none */
} NcRoundedDisc;

/* The union of its pieces, which is convex. Without pieces it is empty. */
typedef struct {
    NcRoundedDisc rounded;
    NcFrustum frustum[2];
    int n_frusta;
    double bottom, top; /* heights it lies between */
    double radius;      /* greatest */
} NcToolBody;

/*
 * From the tip to the top of the flutes. The shape is that of APT's seven-parameter tool: a flat
 * disc, a corner arc tangent to it, a cone tangent to the arc, a cylinder. A ball or a corner is
 * never cut short by the flutes: the body reaches at least twice the corner's radius up.
 */
NcToolBody nc_body_cutting(const CfgTool *tool);

/* From the flutes to the holder; empty where the flutes reach it. */
NcToolBody nc_body_shank(const CfgTool *tool);

/* From the holder's nose to the gauge line; empty where the tool has no such part. */
NcToolBody nc_body_holder(const CfgTool *tool);

NcToolBody nc_body_cylinder(double bottom, double top, double diameter_mm);

bool nc_body_is_empty(const NcToolBody *body);

/* Height of the body's lower face at this distance from the axis; INFINITY beyond its radius. */
double nc_body_height_mm(const NcToolBody *body, double distance_mm);

/* Greatest radius of the body at or below this height above the tip; -1 where it has nothing. */
double nc_body_radius_mm(const NcToolBody *body, double height_mm);

#endif
