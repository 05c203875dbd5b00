/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What an operation has to cut: triangles of the part in workpiece coordinates, each with its
 * normal turned upwards and its curvature, and area-weighted samples of them. Immutable.
 *
 * Normals point up whatever the part says: a face that looks down has material above it, so the
 * cutter cannot come to it and the access test finds that out; an open sheet has no outside.
 */
#ifndef NC_TOOLPATH_REGION_H
#define NC_TOOLPATH_REGION_H

#include "nc/nc.h"

/* Steeper than this (sine of the angle to the vertical) is a wall: "up" does not tell its outside.
 */
#define NC_WALL_UP 1e-3

/* Curvature of a surface as a symmetric tensor: q·W·q is the normal curvature along the unit
 * tangent q, in 1/mm, positive where the surface is concave (bends towards the normal). */
typedef struct {
    double xx, yy, zz, xy, yz, zx;
} NcBend;

typedef struct {
    SegVec3 a, b, c;
    SegVec3 normal;
    NcBend bend;
    double area_mm2;
    int32_t triangle; /* of the part */
    bool downward;    /* the part's own normal looks down */
} NcPatch;

typedef struct {
    SegVec3 point;
    SegVec3 normal;
    size_t facet;
    double area_mm2; /* that it stands for */
} NcSample;

typedef struct {
    NcPatch *facets;
    size_t n_facets;
    NcSample *samples;
    size_t n_samples;
    NcTerrain *terrain; /* the facets alone, but for walls, which a drop can only touch at their
                         * upper edge; its triangles are their indices */
    const SegPiece **pieces; /* of the segmentation */
    size_t n_pieces;
    double area_mm2;
    SegVec3 min, max;
    double min_concave_radius_mm;
} NcRegion;

/* The union of `regions` without the faces of `keep_out`; `terrain` is the whole part. */
NcRegion *nc_region_new(const SegPart *part, const NcSetup *setup, const NcTerrain *terrain,
                        const SegRegion *const *regions, size_t n_regions, const int32_t *keep_out,
                        size_t n_keep_out);

/* The facets marked in `apart` (a byte each), or those that are not: `marked` says which. The
 * marked ones are no whole faces any more, so they have no pieces. */
NcRegion *nc_region_split(const NcRegion *region, const uint8_t *apart, bool marked);
void nc_region_free(NcRegion *region);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcRegion, nc_region_free)

/* Is the point just off a wall, on the side of `normal`, open to the sky while the other side is
 * not? Faces that share no edges do not know their outside: 1 yes, -1 the other way, 0 no telling.
 */
int nc_wall_side(const NcTerrain *terrain, SegVec3 point, SegVec3 normal);

double nc_bend_along(const NcBend *bend, SegVec3 direction);

#endif
