/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_TOOLPATH_MESH_NORMALS_H
#define NC_TOOLPATH_MESH_NORMALS_H

#include "segcore/segcore.h"

/*
 * Normals at the three corners of every triangle of a part, for its curvature: those of the surface
 * where there is one; on a mesh the mean of the facets around the corner, weighted by area, that
 * turn by no more than 30° from the triangle: sharper edges are edges. Caller frees.
 */
SegVec3 (*nc_corner_normals(const SegPart *part))[3];

#endif
