/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/nc.h"

NcTerrain *nc_terrain_from_part(const SegPart *part, const NcSetup *setup)
{
    size_t n_vertices = (size_t)part->n_vertices, n_triangles = (size_t)part->n_triangles;
    g_autofree SegVec3 *vertices = g_new(SegVec3, n_vertices);
    for (size_t i = 0; i < n_vertices; i++)
        vertices[i] = nc_setup_point(setup, part->vertices[i].position);
    g_autofree int32_t(*triangles)[3] = g_malloc_n(n_triangles, sizeof *triangles);
    for (size_t i = 0; i < n_triangles; i++)
        for (int k = 0; k < 3; k++)
            triangles[i][k] = part->triangles[i].vertex[k];
    return nc_terrain_new(vertices, n_vertices, triangles, n_triangles);
}
