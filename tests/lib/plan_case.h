/* SPDX-License-Identifier: Apache-2.0 */
/* A part with the shipped machine, tools and recipe, ready to be planned. */
#ifndef TESTS_LIB_PLAN_CASE_H
#define TESTS_LIB_PLAN_CASE_H

#include "nc/nc.h"

typedef struct {
    SegPart *part;
    SegSegmentation *segmentation; /* at first the whole part as region 1, "part" */
    CfgRecipe *recipe;
    CfgMachine *machine;
    CfgToolTable *tools;
    NcPlanInput input; /* of these */
} PlanCase;

/* Takes `part` over. `set` are the recipe's settings that differ from its defaults. */
PlanCase *plan_case_new(SegPart *part, char *const *set, GError **error);

/* The same with the part read from a file, tessellated to its share of the tolerance; a CAD part is
 * segmented by feature size unless `set` says segmentation.method=none. */
PlanCase *plan_case_load(const char *path, char *const *set, GError **error);
void plan_case_free(PlanCase *plan_case);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(PlanCase, plan_case_free)

/* Replaces the segmentation: each region the triangles (and, where they are all of a face, the
 * face) that `region_of` puts in it; region numbers from 1, 0 for none. */
void plan_case_split(PlanCase *plan_case, int n_regions,
                     int (*region_of)(const SegPart *part, int32_t triangle));

/* A closed body over the square [0, side]² of `n` cells a side: z = height(x, y) on top, walls, and
 * a flat bottom at z = bottom. As a mesh. */
SegPart *plan_case_height_field(double side, int n, double bottom,
                                double (*height)(double, double));

/* Closed boxes {x0, y0, z0, x1, y1, z1}, beside or on each other, as a mesh. */
SegPart *plan_case_boxes(const double (*boxes)[6], int n);

#endif
