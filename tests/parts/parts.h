/* SPDX-License-Identifier: Apache-2.0 */
/* The test parts, made from nothing but the numbers in these files. Lengths in mm. */
#ifndef TESTS_PARTS_PARTS_H
#define TESTS_PARTS_PARTS_H

#include <TopoDS_Shape.hxx>

/* P0, experiment: one model of 30 × 60 × 20 mm with two test pieces, each a big curved face with a
 * convex (a boss). The boss is filleted at its foot with less than 3 mm radius. */
TopoDS_Shape make_p0_piece();

/* A whole impeller: seven main blades and seven splitters on a revolved hub. */
TopoDS_Shape make_impeller();

/* A turbine blade; both sides are split by trimming curves into two ends and a middle. */
TopoDS_Shape make_blade();

/* Box, cylinder, cone frustum, sphere, torus and a plate with holes, none along the axes. */
TopoDS_Shape make_analytic();

#endif
