/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The part's surface as places to measure at: points of the CAD faces themselves, not of their
 * tessellation, in workpiece coordinates.
 */
#ifndef NC_VERIFY_SURFACE_H
#define NC_VERIFY_SURFACE_H

#include "nc/nc.h"
#include "nc/toolpath/region.h"

typedef struct {
    SegVec3 point;
    SegVec3 normal; /* outward unit normal */
    double u, v;    /* on the face's surface; 0 on a mesh */
    int32_t triangle;
    bool downward; /* the normal looks down */
} NcPlace;

/* The outside of a face is where the part has it, unless one side is open to the sky and the other
 * is not: faces of IGES files may be inside out, and sheets have no outside. */
typedef struct NcSurface NcSurface;

/* `part`, `setup` and `terrain` (of the whole part) stay the caller's and outlive it. */
NcSurface *nc_surface_new(const SegPart *part, const NcSetup *setup, const NcTerrain *terrain);
void nc_surface_free(NcSurface *surface);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcSurface, nc_surface_free)

/* Area of the triangles that `zones` (one number for each triangle of the part) puts in `zone`. */
double nc_surface_area_mm2(const NcSurface *surface, const int32_t *zones, int32_t zone);

/*
 * Places spread evenly over the area of a zone, one for each square of `pitch_mm`, at least
 * `least`; what lies outside a face's trimming loops, by the chords of the tessellation, is left
 * out. The same at every run. Caller frees.
 */
NcPlace *nc_surface_spread(const NcSurface *surface, const int32_t *zones, int32_t zone,
                           double pitch_mm, size_t least, size_t *n);

/* The triangles of the whole part, their normals outward but where `downward` says that they were
 * turned upward. */
const NcPatch *nc_surface_facets(const NcSurface *surface, size_t *n);

/* The place that lies a short `step` (tangential, mm) from another on the same face; false where
 * the face ends before. On a mesh the triangle may be another, unless it is a wall. */
bool nc_surface_step(const NcSurface *surface, const NcPlace *from, SegVec3 step, NcPlace *to);

#endif
