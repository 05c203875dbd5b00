/* SPDX-License-Identifier: Apache-2.0 */
/* The in-process model as files: docs/stock.md says what is in them. */
#include "nc/nc.h"

#include <errno.h>
#include <fcntl.h>
#include <glib/gstdio.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static bool write_off(const NcMesh *mesh, FILE *file);
static bool write_stl(const NcMesh *mesh, FILE *file);
static bool write_origins(const NcMesh *mesh, FILE *file);
static bool write_file(const NcMesh *mesh, const char *path,
                       bool (*write_mesh)(const NcMesh *mesh, FILE *file), GError **error);

bool nc_mesh_write(const NcMesh *mesh, const char *path, GError **error)
{
    if (g_str_has_suffix(path, ".off"))
        return write_file(mesh, path, write_off, error);
    g_autofree char *origins = g_strconcat(path, ".json", NULL);
    return write_file(mesh, path, write_stl, error) &&
           write_file(mesh, origins, write_origins, error);
}

static bool write_failed(const char *path, int cause, GError **error)
{
    g_set_error(error, G_FILE_ERROR, (int)g_file_error_from_errno(cause),
                "%s: the model cannot be written: %s", path, g_strerror(cause));
    return false;
}

/* Beside, then renamed: who opens the path finds a whole model or the one before. */
static bool write_file(const NcMesh *mesh, const char *path,
                       bool (*write_mesh)(const NcMesh *mesh, FILE *file), GError **error)
{
    g_autofree char *beside = g_strconcat(path, ".XXXXXX", NULL);
    const int fd = g_mkstemp_full(beside, O_WRONLY | O_CLOEXEC, 0666);
    FILE *file = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (!file)
        return write_failed(path, errno, error);
    errno = 0;
    bool good = write_mesh(mesh, file);
    good = fflush(file) == 0 && good && fsync(fd) == 0;
    int cause = errno;
    if (fclose(file) != 0 && good) {
        cause = errno;
        good = false;
    }
    if (good && g_rename(beside, path) != 0) {
        cause = errno;
        good = false;
    }
    if (good)
        return true;
    g_unlink(beside);
    return write_failed(path, cause, error);
}

static SegVec3 corner(const NcMesh *mesh, size_t triangle, int i)
{
    return mesh->vertices[mesh->triangles[triangle].vertex[i]];
}

static bool write_stl(const NcMesh *mesh, FILE *file)
{
    enum { HEADER_BYTES = 80, FACET_BYTES = 50 };
    char header[HEADER_BYTES] = "in-process model in mm; the attribute of a facet is its tool";
    const uint32_t n = (uint32_t)mesh->n_triangles;
    bool good = fwrite(header, sizeof header, 1, file) == 1 && fwrite(&n, sizeof n, 1, file) == 1;
    for (size_t t = 0; t < mesh->n_triangles && good; t++) {
        const SegVec3 a = corner(mesh, t, 0), b = corner(mesh, t, 1), c = corner(mesh, t, 2);
        const SegVec3 normal = seg_unit(seg_cross(seg_sub(b, a), seg_sub(c, a)));
        const SegVec3 vectors[4] = {normal, a, b, c};
        const uint16_t tool = (uint16_t)MIN(mesh->triangles[t].tool, UINT16_MAX);
        char facet[FACET_BYTES];
        for (int i = 0; i < 4; i++) {
            const float v[3] = {(float)vectors[i].x, (float)vectors[i].y, (float)vectors[i].z};
            memcpy(facet + 12 * i, v, sizeof v);
        }
        memcpy(facet + 48, &tool, sizeof tool);
        good = fwrite(facet, sizeof facet, 1, file) == 1;
    }
    return good;
}

/* Digits of a number; faster than printf by far, for millions of lines. */
static char *put_number(char *to, uint64_t value)
{
    char digits[20];
    int n = 0;
    do
        digits[n++] = (char)('0' + value % 10);
    while (value /= 10);
    while (n > 0)
        *to++ = digits[--n];
    return to;
}

static char *put_text(char *to, const char *text)
{
    return stpcpy(to, text);
}

/* Nine digits hold any number of single precision. */
static bool write_vertex(SegVec3 p, FILE *file)
{
    const double at[3] = {p.x, p.y, p.z};
    for (int i = 0; i < 3; i++) {
        char text[G_ASCII_DTOSTR_BUF_SIZE];
        g_ascii_formatd(text, sizeof text, "%.9g", at[i] + 0.0);
        if (fputs(text, file) < 0 || fputc(i < 2 ? ' ' : '\n', file) < 0)
            return false;
    }
    return true;
}

static bool write_off(const NcMesh *mesh, FILE *file)
{
    bool good = fprintf(file,
                        "OFF\n# in-process model in mm; behind each face: its tool, first and last "
                        "line\n%zu %zu 0\n",
                        mesh->n_vertices, mesh->n_triangles) > 0;
    for (size_t v = 0; v < mesh->n_vertices && good; v++)
        good = write_vertex(mesh->vertices[v], file);
    for (size_t t = 0; t < mesh->n_triangles && good; t++) {
        const NcMeshTriangle *triangle = &mesh->triangles[t];
        const uint64_t numbers[6] = {(uint64_t)triangle->vertex[0], (uint64_t)triangle->vertex[1],
                                     (uint64_t)triangle->vertex[2], (uint64_t)triangle->tool,
                                     triangle->first_line,          triangle->last_line};
        char line[160] = "3", *end = line + 1;
        for (int i = 0; i < 6; i++)
            end = put_number(put_text(end, i == 3 ? " # " : " "), numbers[i]);
        end = put_text(end, "\n");
        good = fwrite(line, (size_t)(end - line), 1, file) == 1;
    }
    return good;
}

static bool made_alike(const NcMeshTriangle *a, const NcMeshTriangle *b)
{
    return a->tool == b->tool && a->first_line == b->first_line && a->last_line == b->last_line;
}

/* Runs of facets that the same blocks made. */
static bool write_origins(const NcMesh *mesh, FILE *file)
{
    bool good = fprintf(file, "{\"triangles\":%zu,\"runs\":[", mesh->n_triangles) > 0;
    for (size_t t = 0, next; t < mesh->n_triangles && good; t = next) {
        const NcMeshTriangle *made = &mesh->triangles[t];
        for (next = t + 1; next < mesh->n_triangles && made_alike(made, made + (next - t));)
            next++;
        char text[120], *end = put_text(text, t == 0 ? "\n[" : ",\n[");
        end = put_text(put_number(end, next - t), ",");
        end = put_text(put_number(end, (uint64_t)made->tool), ",");
        end = put_text(put_number(end, made->first_line), ",");
        end = put_text(put_number(end, made->last_line), "]");
        good = fwrite(text, (size_t)(end - text), 1, file) == 1;
    }
    return good && fputs("\n]}\n", file) >= 0;
}
