/* SPDX-License-Identifier: Apache-2.0 */
/* A part from triangles: one face, SEG_SURFACE_MESH, each facet with three vertices of its own. */
#include "segcore/geom/part_form.h"
#include "segcore/geom/reader.h"

#include <string.h>

static GBytes *form_of(const GArray *corners, const char *sha256);
static void drop_degenerate(GArray *corners);

SegPart *seg_part_from_mesh(const void *bytes, size_t length, const char *name, GError **error)
{
    g_autoptr(GArray) corners = g_array_new(FALSE, FALSE, sizeof(SegVec3));
    bool good = seg_is_off(bytes, length) ? seg_read_off(bytes, length, name, corners, error)
                                          : seg_read_stl(bytes, length, name, corners, error);
    if (!good)
        return NULL;
    drop_degenerate(corners);
    if (corners->len == 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                    "%s: no triangle with an area in it; export the part again", name);
        return NULL;
    }
    g_autofree char *sha256 = g_compute_checksum_for_data(G_CHECKSUM_SHA256, bytes, length);
    g_autoptr(GBytes) form = form_of(corners, sha256);
    return seg_part_from_form(form, error);
}

static SegVec3 facet_cross(const SegVec3 *corner)
{
    return seg_cross(seg_sub(corner[1], corner[0]), seg_sub(corner[2], corner[0]));
}

/* Facets without an area have no normal, and bound nothing. */
static void drop_degenerate(GArray *corners)
{
    const double least = 1e-100; /* below, the normal would be lost to rounding */
    SegVec3 *all = (SegVec3 *)(void *)corners->data;
    guint kept = 0;
    for (guint i = 0; i < corners->len; i += 3)
        if (seg_norm(facet_cross(all + i)) > least) {
            memmove(all + kept, all + i, 3 * sizeof *all);
            kept += 3;
        }
    g_array_set_size(corners, kept);
}

static GBytes *form_of(const GArray *corners, const char *sha256)
{
    size_t n_vertices = corners->len, n_triangles = corners->len / 3;
    size_t length = sizeof(SegPartHeader) + sizeof(SegFace) + n_vertices * sizeof(SegVertex) +
                    n_triangles * sizeof(SegTriangle);
    uint8_t *block = g_malloc(length);

    SegPartHeader *header = (SegPartHeader *)(void *)block;
    *header = (SegPartHeader){.magic = SEG_FORM_MAGIC,
                              .version = SEG_FORM_VERSION,
                              .byte_order = SEG_FORM_BYTE_ORDER,
                              .unit_mm = 1,
                              .n_faces = 1,
                              .n_vertices = (int64_t)n_vertices,
                              .n_triangles = (int64_t)n_triangles};
    memcpy(header->sha256, sha256, sizeof header->sha256);
    SegFace *face = (SegFace *)(header + 1);
    *face = (SegFace){.type = SEG_SURFACE_MESH, .n_triangles = (int32_t)n_triangles};

    SegVertex *vertices = (SegVertex *)(face + 1);
    SegTriangle *triangles = (SegTriangle *)(vertices + n_vertices);
    const SegVec3 *corner = (const SegVec3 *)(void *)corners->data;
    for (size_t i = 0; i < n_triangles; i++) {
        SegVec3 normal = seg_unit(facet_cross(corner + 3 * i));
        triangles[i] = (SegTriangle){0};
        for (size_t k = 3 * i; k < 3 * i + 3; k++) {
            vertices[k] = (SegVertex){.position = corner[k], .normal = normal};
            triangles[i].vertex[k - 3 * i] = (int32_t)k;
        }
    }
    return g_bytes_new_take(block, length);
}
