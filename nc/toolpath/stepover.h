/* SPDX-License-Identifier: Apache-2.0 */
/* How far apart passes may lie for the scallop between them to stay under a height. */
#ifndef NC_TOOLPATH_STEPOVER_H
#define NC_TOOLPATH_STEPOVER_H

#include "nc/toolpath/region.h"

/* Share of the flat's diameter that passes lie apart on level ground. */
#define NC_FLAT_STEP 0.6

/*
 * A ball of `radius_mm` over a circle of curvature k (1/mm, positive concave) leaves scallops of
 * `scallop_mm` where its contacts lie φ/k apart along the circle and its centres φ·(1/k ∓ R); on a
 * plane both are 2√(2Rh - h²). Exact, from the triangle of circle's centre, ball's centre and
 * scallop: sin²(φ/4) = h(2R - h) / (4(ρ ± R)(ρ ± h)). For small h it is the √(8hRρ/(ρ ± R)) of Lin
 * and Koren 1996. Where 1/k is not larger than the ball, one pass fills the groove: R is returned.
 */
double nc_ball_contact_step_mm(double radius_mm, double scallop_mm, double curvature);
double nc_ball_centre_step_mm(double radius_mm, double scallop_mm, double curvature);

/*
 * Distance of vertical planes with the unit normal `across` (horizontal) in which the cutter's axis
 * runs over ground of this normal and curvature. Ball: the step of the centres seen along `across`.
 * Flat and bull: the largest of what the corner alone allows (a ball of the corner radius is a
 * lower bound for the torus) and, on ground so little inclined that steps of the flat stay under
 * the scallop, h/sin of the slope across and the ellipse of the flat seen along the slope.
 */
double nc_plane_step_mm(NcCutter tool, double scallop_mm, SegVec3 normal, const NcBend *bend,
                        SegVec3 across);

/*
 * The same for contacts: the distance along the surface in the tangent direction `across`. On walls
 * the side of the tool cuts above its corner: steps down a wall leaning back by δ leave cusps of
 * step·sin δ, and may not be deeper than the tool's depth of cut, `depth_mm`.
 */
double nc_contact_step_mm(NcCutter tool, double scallop_mm, double depth_mm, SegVec3 normal,
                          double curvature, SegVec3 across);

#endif
