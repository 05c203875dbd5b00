/* SPDX-License-Identifier: Apache-2.0 */
/*
 * nc: from regions to one G-code program, and from G-code to moves and time.
 *
 * Workpiece coordinates: the part turned so that the setup's `up` is +Z and moved so that the
 * setup's zero is the origin. Lengths in mm, areas mm², feeds mm/min, times s, angles rad.
 * A tool's position is its tip (the lowest point of its axis), as G43 programs it.
 */
#ifndef NC_NC_H
#define NC_NC_H

#include <glib.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/config.h"
#include "nc/gcode.h"
#include "nc/motion.h"
#include "nc/stock.h"
#include "segcore/segcore.h"

/* -------------------------------------------------------------------------- setup */

/* Part to workpiece: w = R·p + t. */
typedef struct {
    double rotation[3][3];
    SegVec3 translation;
} NcSetup;

NcSetup nc_setup_new(const SegPart *part, CfgUp up, CfgZero zero);
SegVec3 nc_setup_point(const NcSetup *setup, SegVec3 part_point);
SegVec3 nc_setup_direction(const NcSetup *setup, SegVec3 part_direction);

/* What is clamped on the machine before the first cut, as [stock] of the recipe says: the part with
 * the allowance on every face (rounded where the part is sharp), a box, a cylinder, or a file. A
 * part that is not closed gets the allowance on both sides of its faces. Errors: NC_ERROR_PLAN;
 * SEG_ERROR of the file. */
NcStock *nc_stock_from_recipe(const SegPart *part, const NcSetup *setup, const CfgRecipe *recipe,
                              const NcStockOptions *options, GError **error);

/* ------------------------------------------------------------------------ budget */

/* The shares of quality.tolerance_mm; their sum is at most the tolerance. */
typedef struct {
    double tessellation_mm; /* chord of the tessellation: what seg_part_load is asked for */
    double chord_mm;        /* straight moves against the true path of the cutter */
    double blend_mm;        /* corners: G64 P */
    double rounding_mm;     /* numbers in the program */
} NcBudget;

/* Shares out the recipe's tolerance: to the tessellation part.chord_mm where the recipe sets it,
 * else 0.3 of the tolerance; of what is left 60 % to the chord, 35 % to the blend and 5 % to
 * rounding. False, with NC_ERROR_PLAN, where the tessellation alone takes more than 0.8 of it. */
bool nc_budget_share(const CfgRecipe *recipe, NcBudget *budget, GError **error);

/* ------------------------------------------------------------------- drop-cutter */

/* The cutting envelope of a tool turned about +Z: a torus of corner radius r at radius R - r, flat
 * inside, cylinder of radius R above. flat: r = 0; ball: r = R. */
typedef struct {
    double radius_mm;
    double corner_radius_mm;
} NcCutter;

NcCutter nc_cutter(const CfgTool *tool);

/* Height of the cutter's profile above its tip at distance d from its axis; INFINITY for d > R. */
double nc_cutter_height_mm(NcCutter cutter, double distance_mm);

/* The whole part's triangles in workpiece coordinates, with a search structure. Immutable after
 * nc_terrain_new, so it may be read from many threads. */
typedef struct NcTerrain NcTerrain;

/* `triangles` index `vertices`, which are finite; both are copied. Which way a triangle faces is of
 * no account; needles, walls and triangles without area count with what they have. */
NcTerrain *nc_terrain_new(const SegVec3 *vertices, size_t n_vertices, const int32_t (*triangles)[3],
                          size_t n_triangles);
NcTerrain *nc_terrain_from_part(const SegPart *part, const NcSetup *setup);
void nc_terrain_free(NcTerrain *terrain);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcTerrain, nc_terrain_free)

/* Without triangles min is INFINITY and max -INFINITY. */
void nc_terrain_bounds(const NcTerrain *terrain, SegVec3 *min, SegVec3 *max);

/*
 * Drop-cutter: the lowest tip height at which the cutter, centred over (x,y), touches the terrain
 * without entering it. Exact against facets, edges and vertices of every triangle; -INFINITY where
 * nothing is under the cutter. `triangle` (may be NULL) gets the triangle touched, -1 if none;
 * `contact` (may be NULL) the point touched.
 */
double nc_drop(const NcTerrain *terrain, NcCutter cutter, double x_mm, double y_mm,
               int32_t *triangle, SegVec3 *contact);

/* nc_drop at n places, OpenMP over them; results do not depend on the number of threads.
 * `triangle` and `contact` may be NULL. */
void nc_drop_batch(const NcTerrain *terrain, NcCutter cutter, size_t n, const double *x_mm,
                   const double *y_mm, double *z_mm, int32_t *triangle, SegVec3 *contact);

/*
 * The deepest gouge of the straight move a → b: the greatest amount by which the cutter, moved
 * along it, goes below the terrain, measured along +Z; at most 0 where it never does (then minus
 * the smallest clearance found); -INFINITY where nothing is under the cutter. At most
 * `resolution_mm` below the true value, by proof and not by sampling: ridges narrower than any
 * step are found. The move may be of no length, vertical, or across the whole part.
 */
double nc_sweep_gouge_mm(const NcTerrain *terrain, NcCutter cutter, SegVec3 a, SegVec3 b,
                         double resolution_mm);

/* nc_sweep_gouge_mm of the n - 1 moves tips[0] → tips[1] → …, OpenMP over them; the results are
 * the same. */
void nc_sweep_gouge_batch(const NcTerrain *terrain, NcCutter cutter, size_t n, const SegVec3 *tips,
                          double resolution_mm, double *gouge_mm);

/* True if the move a → b nowhere goes more than `tolerance_mm` below the terrain; cheaper than the
 * exact value. A negative tolerance asks for clearance. */
bool nc_sweep_clear(const NcTerrain *terrain, NcCutter cutter, SegVec3 a, SegVec3 b,
                    double tolerance_mm);

/* ------------------------------------------------------------------- toolpaths */

typedef enum { NC_RAPID, NC_LEAD, NC_CUT, NC_LINK } NcMotionClass;

typedef struct {
    SegVec3 tip;
    SegVec3 axis;         /* unit vector from tip to holder; (0,0,1) in three axes */
    NcMotionClass motion; /* of the move that ENDS here */
} NcLocation;

/* Locations in order; GArray of NcLocation. */
typedef struct {
    GArray *locations;
} NcToolpath;

/* One region cut with one tool. */
typedef struct {
    int32_t region; /* id in the segmentation */
    char *region_name;
    SegRegionKind kind;
    CfgStrategy strategy;
    const CfgTool *tool; /* owned by the tool table the plan was made with */
    double feed_mm_min;
    double plunge_mm_min;
    double spindle_rpm;
    double stepover_mm;
    double direction_rad; /* of the planes, iso-planar */
    NcToolpath path;
    double length_mm; /* while cutting */
    double air_mm;    /* rapids, leads and links */
    int reversals;    /* turns sharper than 90° while cutting */
    double estimated_s;
    double requested_area_mm2;
    double unreachable_area_mm2;
} NcOperation;

typedef struct {
    CfgMethod method;        /* of the segmentation it came from; CFG_METHOD_NONE in a baseline */
    NcOperation *operations; /* in machining order */
    size_t n_operations;
    NcBudget budget;     /* it was made with; the program's G64 P is budget.blend_mm */
    double clearance_mm; /* Z of rapid moves, workpiece coordinates */
    double estimated_s;  /* whole program: tool changes and air too */
    double length_mm, air_mm;
    int reversals, tool_changes;
    GPtrArray *notes; /* char *: what was left or skipped, and why */
} NcPlan;

typedef struct {
    const SegPart *part;
    const SegSegmentation *segmentation;
    const CfgRecipe *recipe;
    const CfgMachine *machine;
    const CfgToolTable *tools;
    void (*progress)(double done, void *data); /* 0 … 1; may be NULL */
    void *progress_data;
} NcPlanInput;

/* Toolpaths for every region, ordered, linked and timed. */
NcPlan *nc_plan_new(const NcPlanInput *input, GError **error);

/* The baseline: the whole part as one region with the one tool that reaches everything. */
NcPlan *nc_plan_baseline(const NcPlanInput *input, GError **error);
void nc_plan_free(NcPlan *plan);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcPlan, nc_plan_free)

const char *nc_strategy_name(CfgStrategy strategy); /* "iso-planar", … */

/* --------------------------------------------------------------------- program */

/* A program as delivered: bytes, their SHA-256, and the gates: ascending byte offsets, each just
 * behind a block's newline where the tool is clear of the part. The last gate is the length. */
typedef struct {
    GBytes *bytes;
    char sha256[65];
    uint64_t *gates;
    size_t n_gates;
} NcProgram;

/* Writes the plan in the machine's dialect. `header` lines become comments at the top (may be
 * NULL). Errors: NC_ERROR_LIMIT, naming region, axis and value, where a move leaves the machine's
 * travel; NC_ERROR_PLAN for what cannot be written (dialect, feed, tilted axis, no moves). */
NcProgram *nc_program_write(const NcPlan *plan, const CfgRecipe *recipe, const CfgMachine *machine,
                            char *const *header, GError **error);

/* Finds the gates of a program that segmill, or anyone, wrote: the blocks that bring the tip to the
 * program's highest Z, where that is reached by G0, or raise it by G28 or G53. Reads the whole
 * program: errors as nc_read_program. */
NcProgram *nc_program_from_bytes(GBytes *bytes, const CfgMachine *machine,
                                 const CfgToolTable *tools, GError **error);
/* A program of these bytes (a reference is taken) and gates (copied), with its hash. */
NcProgram *nc_program_new(GBytes *bytes, const uint64_t *gates, size_t n_gates);
void nc_program_free(NcProgram *program);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcProgram, nc_program_free)

/* ------------------------------------------------------------------ verifying */

#include "nc/verify.h"

#endif
