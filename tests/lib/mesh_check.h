/* SPDX-License-Identifier: Apache-2.0 */
/* What every in-process model must be. */
#ifndef TESTS_LIB_MESH_CHECK_H
#define TESTS_LIB_MESH_CHECK_H

#include "nc/nc.h"

/*
 * Fails where the mesh is not closed, manifold and outward: an edge that is not run exactly once in
 * each direction; a vertex whose triangles are not one fan; a vertex that nothing uses, or that
 * lies where another does; a triangle without area; a shell whose volume the wrong side encloses.
 */
void test_mesh_is_solid(const NcMesh *mesh);

/* Enclosed by all shells. */
double test_mesh_volume_mm3(const NcMesh *mesh);

/* Pieces that hang together. */
size_t test_mesh_shells(const NcMesh *mesh);

#endif
