/* SPDX-License-Identifier: Apache-2.0 */
/* Parts: reading by content, and their lifetime. */
#include "segcore/geom/reader.h"

#include <string.h>

G_DEFINE_QUARK(seg_error, seg_error)

typedef enum { FORMAT_UNKNOWN, FORMAT_CAD, FORMAT_MESH } Format;
static Format format_of(const char *bytes, size_t length);
static void measure(SegPart *part);
static char *read_file(const char *path, size_t *length, GError **error);

SegPart *seg_part_load(const char *path, const SegLoadOptions *options, GError **error)
{
    size_t length;
    g_autofree char *bytes = read_file(path, &length, error);
    if (!bytes)
        return NULL;
    SegPart *part = NULL;
    switch (format_of(bytes, length)) {
    case FORMAT_CAD: {
        g_autofree char *sha256 =
            g_compute_checksum_for_data(G_CHECKSUM_SHA256, (const guchar *)bytes, length);
        part = seg_read_cad(path, sha256, options, error);
        break;
    }
    case FORMAT_MESH:
        part = seg_part_from_mesh(bytes, length, path, error);
        break;
    case FORMAT_UNKNOWN:
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                    length ? "%s: neither IGES, STEP, STL nor OFF by its content"
                           : "%s: the file is empty",
                    path);
        break;
    }
    if (part) {
        part->path = g_strdup(path);
        measure(part);
    }
    return part;
}

/* What every method asks for, and what does not depend on its parameters. */
static void measure(SegPart *part)
{
    double *areas_mm2 = g_new(double, (size_t)part->n_faces);
#pragma omp parallel for schedule(dynamic, 1)
    for (int32_t i = 0; i < part->n_faces; i++)
        areas_mm2[i] = seg_face_area_mm2(part, i);
    part->areas_mm2 = areas_mm2;
    part->adjacency = seg_part_adjacency(part, seg_part_touch_mm(part));
}

SegPart *seg_part_ref(SegPart *part)
{
    g_atomic_int_inc(&part->ref_count);
    return part;
}

void seg_part_unref(SegPart *part)
{
    if (!part || !g_atomic_int_dec_and_test(&part->ref_count))
        return;
    g_bytes_unref(part->memory);
    g_free(part->path);
    g_free(part->areas_mm2);
    if (part->adjacency)
        g_array_unref(part->adjacency);
    g_free(part);
}

const char *seg_surface_type_name(SegSurfaceType type)
{
    static const char *const names[SEG_N_SURFACE_TYPES] = {
        [SEG_SURFACE_OTHER] = "other",         [SEG_SURFACE_PLANE] = "plane",
        [SEG_SURFACE_CYLINDER] = "cylinder",   [SEG_SURFACE_CONE] = "cone",
        [SEG_SURFACE_SPHERE] = "sphere",       [SEG_SURFACE_TORUS] = "torus",
        [SEG_SURFACE_BSPLINE] = "bspline",     [SEG_SURFACE_REVOLUTION] = "revolution",
        [SEG_SURFACE_EXTRUSION] = "extrusion", [SEG_SURFACE_OFFSET] = "offset",
        [SEG_SURFACE_MESH] = "mesh",
    };
    return type >= 0 && type < SEG_N_SURFACE_TYPES ? names[type] : "other";
}

static char *read_file(const char *path, size_t *length, GError **error)
{
    char *bytes;
    g_autoptr(GError) why = NULL;
    if (g_file_get_contents(path, &bytes, length, &why))
        return bytes;
    g_set_error(error, SEG_ERROR, SEG_ERROR_IO, "%s: %s", path, why->message);
    return NULL;
}

/* IGES keeps the section letter of a line in column 73; the first line is of the start section. */
static bool is_iges(const char *bytes, size_t length)
{
    enum { SECTION_COLUMN = 72 };
    const char *end = memchr(bytes, '\n', length);
    size_t first_line = end ? (size_t)(end - bytes) : length;
    return first_line > SECTION_COLUMN && bytes[SECTION_COLUMN] == 'S' &&
           !memchr(bytes, '\0', first_line);
}

static bool is_step(const char *bytes, size_t length)
{
    size_t i = 0;
    if (length >= 3 && memcmp(bytes, "\xEF\xBB\xBF", 3) == 0)
        i = 3;
    while (i < length && g_ascii_isspace(bytes[i]))
        i++;
    static const char mark[] = "ISO-10303-21";
    return length - i >= strlen(mark) && memcmp(bytes + i, mark, strlen(mark)) == 0;
}

static Format format_of(const char *bytes, size_t length)
{
    if (is_step(bytes, length) || is_iges(bytes, length))
        return FORMAT_CAD;
    bool mesh = seg_is_off(bytes, length) || seg_is_stl(bytes, length);
    return mesh ? FORMAT_MESH : FORMAT_UNKNOWN;
}
