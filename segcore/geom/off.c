/* SPDX-License-Identifier: Apache-2.0 */
/* OFF (Geomview's object file format), text only. */
#include "segcore/geom/reader.h"

#include <string.h>

static SegWords words_of(const char *bytes, size_t length)
{
    return (SegWords){.at = bytes, .end = bytes + length, .line = 1, .comment = '#'};
}

/* OFF, with what each vertex line carries beside its point: texture, colour, normal. */
static bool is_header(const char *word)
{
    if (g_str_has_prefix(word, "st"))
        word += 2;
    if (*word == 'c')
        word++;
    if (*word == 'n')
        word++;
    return strcmp(word, "off") == 0;
}

bool seg_is_off(const char *bytes, size_t length)
{
    SegWords words = words_of(bytes, length);
    return seg_next_word(&words) && is_header(words.word);
}

G_GNUC_PRINTF(4, 5)
static bool refuse(GError **error, const char *name, const SegWords *words, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_autofree char *what = g_strdup_vprintf(format, arguments);
    va_end(arguments);
    g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%s:%d: %s", name, words->line, what);
    return false;
}

/* A count or an index in [0, limit). */
static bool next_integer(SegWords *words, guint64 limit, guint64 *value)
{
    return seg_next_word(words) &&
           g_ascii_string_to_unsigned(words->word, 10, 0, limit ? limit - 1 : 0, value, NULL) &&
           limit > 0;
}

static bool read_points(SegWords *words, const char *name, bool plain, guint64 n, GArray *points,
                        GError **error)
{
    for (guint64 i = 0; i < n; i++) {
        SegVec3 point;
        if (!seg_next_point(words, &point))
            return refuse(error, name, words,
                          "\"%s\" is not a coordinate (vertex %" G_GUINT64_FORMAT ")", words->word,
                          i);
        if (!plain)
            seg_skip_line(words);
        g_array_append_val(points, point);
    }
    return true;
}

/* A polygon as a fan about its first point. */
static bool read_polygon(SegWords *words, const char *name, guint64 face, const GArray *points,
                         GArray *corners, GError **error)
{
    guint64 n, index;
    if (!next_integer(words, (guint64)points->len + 1, &n))
        return refuse(error, name, words,
                      "\"%s\" is not a number of corners (face %" G_GUINT64_FORMAT ")", words->word,
                      face);
    SegVec3 fan[3] = {0};
    for (guint64 k = 0; k < n; k++) {
        if (!next_integer(words, points->len, &index))
            return refuse(error, name, words,
                          "vertex \"%s\" of %u does not exist (face %" G_GUINT64_FORMAT ")",
                          words->word, points->len, face);
        fan[k == 0 ? 0 : 2] = g_array_index(points, SegVec3, index);
        if (k >= 2)
            g_array_append_vals(corners, fan, 3);
        fan[1] = fan[2];
    }
    seg_skip_line(words); /* its colour */
    if (corners->len / 3 > SEG_MESH_MAX_TRIANGLES)
        return refuse(error, name, words, "more than %d triangles", SEG_MESH_MAX_TRIANGLES);
    return true;
}

bool seg_read_off(const char *bytes, size_t length, const char *name, GArray *corners,
                  GError **error)
{
    SegWords words = words_of(bytes, length);
    seg_next_word(&words);
    bool plain = strcmp(words.word, "off") == 0;
    guint64 n_points, n_faces, n_edges;
    /* A vertex or a face takes two bytes at least: a larger count is not of this file. */
    guint64 limit = MIN(length / 2, 3 * (guint64)SEG_MESH_MAX_TRIANGLES) + 1;
    if (!next_integer(&words, limit, &n_points) || !next_integer(&words, limit, &n_faces) ||
        !next_integer(&words, G_MAXINT64, &n_edges))
        return refuse(error, name, &words, "\"%s\" is not a count that fits this OFF file",
                      words.word);
    g_autoptr(GArray) points = g_array_new(FALSE, FALSE, sizeof(SegVec3));
    if (!read_points(&words, name, plain, n_points, points, error))
        return false;
    for (guint64 i = 0; i < n_faces; i++)
        if (!read_polygon(&words, name, i, points, corners, error))
            return false;
    return true;
}
