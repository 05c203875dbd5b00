/* SPDX-License-Identifier: Apache-2.0 */
/* STL, binary and ascii. */
#include "segcore/geom/part_form.h"
#include "segcore/geom/reader.h"

#include <string.h>

/* Binary: 80 bytes of anything, a count, and for each facet a normal, three points and two bytes.
 */
enum { HEADER_BYTES = 84, COUNT_AT = 80, FACET_BYTES = 50, POINT_AT = 12 };

static bool is_binary(const char *bytes, size_t length);
static bool has_count_that_lies(const char *bytes, size_t length);
static bool read_binary(const char *bytes, const char *name, GArray *corners, GError **error);
static bool read_ascii(const char *bytes, size_t length, const char *name, GArray *corners,
                       GError **error);

/* Binary files may begin with "solid" too: the size decides first. */
bool seg_is_stl(const char *bytes, size_t length)
{
    SegWords words = {.at = bytes, .end = bytes + length};
    return is_binary(bytes, length) || has_count_that_lies(bytes, length) ||
           (seg_next_word(&words) && strcmp(words.word, "solid") == 0);
}

bool seg_read_stl(const char *bytes, size_t length, const char *name, GArray *corners,
                  GError **error)
{
    if (is_binary(bytes, length))
        return read_binary(bytes, name, corners, error);
    if (!has_count_that_lies(bytes, length))
        return read_ascii(bytes, length, name, corners, error);
    uint32_t count;
    memcpy(&count, bytes + COUNT_AT, sizeof count);
    g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                "%s: the file says %u facets and has %zu bytes, which are %zu; it is cut off or "
                "damaged: export it again",
                name, count, length, (length - HEADER_BYTES) / FACET_BYTES);
    return false;
}

/* Less than a facet of trailing bytes is what some programs leave. */
static bool is_binary(const char *bytes, size_t length)
{
    if (length < HEADER_BYTES + FACET_BYTES)
        return false;
    uint32_t count;
    memcpy(&count, bytes + COUNT_AT, sizeof count);
    return count == (length - HEADER_BYTES) / FACET_BYTES;
}

/* The zero bytes of a binary header or of its facets, which text does not have. */
static bool has_count_that_lies(const char *bytes, size_t length)
{
    if (length < HEADER_BYTES || is_binary(bytes, length) || !memchr(bytes, '\0', length))
        return false;
    return (length - HEADER_BYTES) % FACET_BYTES == 0 ||
           g_ascii_strncasecmp(bytes, "solid", 5) == 0;
}

static bool too_many(size_t triangles, const char *name, GError **error)
{
    if (triangles <= SEG_MESH_MAX_TRIANGLES)
        return false;
    g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%s: more than %d triangles", name,
                SEG_MESH_MAX_TRIANGLES);
    return true;
}

static bool read_binary(const char *bytes, const char *name, GArray *corners, GError **error)
{
    uint32_t count;
    memcpy(&count, bytes + COUNT_AT, sizeof count);
    if (too_many(count, name, error))
        return false;
    const char *facet = bytes + HEADER_BYTES;
    for (uint32_t i = 0; i < count; i++, facet += FACET_BYTES) {
        float c[9];
        memcpy(c, facet + POINT_AT, sizeof c);
        for (int k = 0; k < 9; k++)
            if (!(fabs((double)c[k]) <= SEG_FORM_MAX_REAL)) {
                g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                            "%s: facet %u: %g is not a coordinate", name, i, (double)c[k]);
                return false;
            }
        SegVec3 points[3];
        for (int k = 0; k < 3; k++)
            points[k] = seg_vec3((double)c[3 * k], (double)c[3 * k + 1], (double)c[3 * k + 2]);
        g_array_append_vals(corners, points, 3);
    }
    return true;
}

/* ------------------------------------------------------------------ ascii */

static bool expect(SegWords *words, const char *keyword)
{
    return seg_next_word(words) && strcmp(words->word, keyword) == 0;
}

/* After "facet". Its normal is not looked at: it is often wrong, and the points say it better. */
static bool read_facet(SegWords *words, GArray *corners)
{
    SegVec3 points[3];
    if (!expect(words, "normal"))
        return false;
    for (int i = 0; i < 3; i++)
        if (!seg_next_word(words))
            return false;
    if (!expect(words, "outer") || !expect(words, "loop"))
        return false;
    for (int i = 0; i < 3; i++)
        if (!expect(words, "vertex") || !seg_next_point(words, &points[i]))
            return false;
    if (!expect(words, "endloop") || !expect(words, "endfacet"))
        return false;
    g_array_append_vals(corners, points, 3);
    return true;
}

static bool read_ascii(const char *bytes, size_t length, const char *name, GArray *corners,
                       GError **error)
{
    SegWords words = {.at = bytes, .end = bytes + length, .line = 1};
    bool open = false;
    bool good = true;
    while (good && seg_next_word(&words)) {
        bool begins = strcmp(words.word, "solid") == 0;
        if (begins || strcmp(words.word, "endsolid") == 0) {
            good = open != begins;
            open = begins;
            seg_skip_line(&words); /* the solid's name */
        } else {
            good = open && strcmp(words.word, "facet") == 0 && read_facet(&words, corners);
            if (too_many(corners->len / 3, name, error))
                return false;
        }
    }
    if (good && !open)
        return true;
    if (good || !*words.word)
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                    "%s:%d: the file ends before endsolid; it is cut off: export it again", name,
                    words.line);
    else
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%s:%d: unexpected \"%s\" in an ascii STL",
                    name, words.line, words.word);
    return false;
}
