/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The material on the machine: what is clamped there, and what runs remove from it. That takes
 * longer than the machine's clock allows at --speed max, so it is done in a thread, run by run,
 * when a run has ended: neither the clock nor the result depends on it.
 */
#ifndef SIM_MATERIAL_H
#define SIM_MATERIAL_H

#include "sim/log.h"

typedef struct {
    const CfgMachine *machine;
    const CfgToolTable *tools;
    const char *stock; /* as --stock has it: a file, or box:X0,Y0,Z0,X1,Y1,Z1; coordinates of G54 */
    const char *model; /* file of the in-process model; NULL: none is written */
    double pitch_mm;
} SimMaterialOptions;

typedef struct SimMaterial SimMaterial;

/* Errors: G_OPTION_ERROR for a box that is none; NC_ERROR, SEG_ERROR as nc_stock_load. What the
 * options point to outlives it. */
SimMaterial *sim_material_new(const SimMaterialOptions *options, GError **error);
void sim_material_free(SimMaterial *material);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimMaterial, sim_material_free)

/* Where the controller puts what it executes; the material's. */
SimCourse *sim_material_course(SimMaterial *material);

/* All that one call has removed; GArray of NcCollision, by order of execution. */
typedef struct {
    const GArray *collisions;
    const GError *error; /* why not all of it has been removed, or the model not written; NULL */
} SimRemoval;

typedef void (*SimRemoved)(const SimRemoval *removal, void *data);

/* Removes what is in the course, writes the model and calls back in the default main context; after
 * what was given before. */
void sim_material_remove(SimMaterial *material, SimRemoved removed, void *data);

/*
 * For who reads a program while others run; from any thread. A copy of what is clamped, once
 * everything that was given to sim_material_remove is removed; and how moves cut such a copy, and
 * feel it, as nc_stock_cut and nc_stock_probe.
 */
NcStock *sim_material_copy(SimMaterial *material);
bool sim_material_cut(const SimMaterial *material, NcStock *stock, const NcMove *moves, size_t n,
                      GArray *collisions, GError **error);
bool sim_material_probe(const SimMaterial *material, const NcStock *stock, const NcMove *move,
                        bool away, SegVec3 *where);

/* Says on stderr and in the log (released; may be NULL) what happened. */
void sim_material_report(const SimRemoval *removal, SimLog *log);

/* Waits until everything that was given has been called back, and sees to it that there is a model.
 */
void sim_material_settle(SimMaterial *material);

/* What there was and is, a line or two; caller frees. */
char *sim_material_summary(const SimMaterial *material);

/* "line 12: rapid through material, 1.5 mm at X 1 Y 2 Z 3"; caller frees. */
char *sim_collision_text(const NcCollision *collision);

#endif
