/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Passes over the part: a strategy gives curves in the plane, this file lays the cutter on the part
 * along them, keeps what touches the region, and refines the moves until they hold the budget on
 * both sides.
 */
#ifndef NC_TOOLPATH_TRACE_H
#define NC_TOOLPATH_TRACE_H

#include "nc/toolpath/reach.h"

typedef struct {
    const NcTerrain *terrain;
    const NcRegion *region; /* NULL: the whole part is wanted */
    NcBody body;
    double floor_mm;   /* lowest tip of the grown cutter */
    double chord_mm;   /* share of the budget, gouge and excess alike */
    double touch_mm;   /* on ground, a contact lifted by no more still counts as touched */
    double overlap_mm; /* beyond the region's border, where the surface goes on */
    double bridge_mm;  /* gaps in a pass that are cut through rather than left */
} NcTrace;

/* One curve, over t0 … t1 in n equal steps to begin with. */
typedef struct {
    double t0, t1;
    size_t n;
    const double *needed; /* for each facet of the region, may be NULL: the pass keeps only */
    double below;         /*   contacts on facets that need a step below this */
} NcPass;

/*
 * The place on a curve: the axis of the tool, and the height its grown tip should have; -INFINITY
 * where the drop alone decides. Returns by how much the part may lift the tip above that height and
 * the place still counts as touched; negative where the curve does not want to be cut (beyond a
 * trimming loop) though the tool may pass there.
 */
typedef double (*NcLocate)(const void *curves, size_t pass, double t, SegVec3 *tip);

/* A run of cutting: tips of the grown cutter. */
typedef struct {
    SegVec3 *tips;
    size_t n;
    size_t pass;
} NcPiece;

/* GArray of NcPiece, in order of passes; free with nc_pieces_free. */
GArray *nc_trace(const NcTrace *trace, const NcPass *passes, size_t n_passes, NcLocate locate,
                 const void *curves);
void nc_pieces_free(GArray *pieces);

/* The spacing of first samples that lets no dip deeper than the chord share hide between them. */
double nc_trace_pitch_mm(const NcTrace *trace);

#endif
