/* SPDX-License-Identifier: Apache-2.0 */
/*
 * T-splines of others.
 * .cfg (aijm/TSpline), text: the number of points; then of each five knots of u, five of v, the
 * numbers (from 1; 0: none) of its neighbours below, right, above and left, x y z.
 * .tsp (OpenTspline), binary, little-endian, counts of 8 bytes: the points (place in a plane 2
 * doubles, x y z w, two lists of integers that link patches, 2 integers, parameter 2 doubles, knots
 * of u and v as lists of doubles, 1 byte); the edges (2 integers, a double); degree, 1 byte, the
 * domain 4 doubles.
 */
#include <string.h>

#include "segcore/geom/part_form.h"
#include "segcore/geom/tspline_file.h"

enum { MOST_POINTS = 1 << 20 };

static SegTspline *build(const SegPointList *list, const char *name, GError **error)
{
    SegTspline *t = seg_tspline_from_list(list, error);
    if (!t)
        g_prefix_error(error, "%s: ", name);
    return t;
}

/* ------------------------------------------------------------------ .cfg */

static bool next_integer(SegWords *words, guint64 most, int32_t *value)
{
    guint64 read;
    if (!seg_next_word(words) || words->cut ||
        !g_ascii_string_to_unsigned(words->word, 10, 0, most, &read, NULL))
        return false;
    *value = (int32_t)read;
    return true;
}

static bool next_knots(SegWords *words, double knots[5])
{
    for (int i = 0; i < 5; i++)
        if (!seg_next_coordinate(words, &knots[i]))
            return false;
    return true;
}

/* Point k; its edges to the right and above, as the others have them from the other end. */
static bool read_cfg_point(SegWords *words, int32_t k, int32_t n, int32_t (*neighbours)[4],
                           SegPointList *list)
{
    SegListedPoint p = {.w = 1};
    SegVec3 at;
    if (!next_knots(words, p.knots_u) || !next_knots(words, p.knots_v))
        return false;
    for (int i = 0; i < 4; i++)
        if (!next_integer(words, (guint64)n, &neighbours[k][i]))
            return false;
    if (!seg_next_point(words, &at))
        return false;
    p.x = at.x, p.y = at.y, p.z = at.z;
    p.line = words->line;
    g_array_append_val(list->points, p);
    return true;
}

static bool join_neighbours(int32_t (*neighbours)[4], int32_t n, SegPointList *list, int32_t *wrong)
{
    for (int32_t k = 0; k < n; k++)
        for (int side = 0; side < 4; side++) {
            int32_t other = neighbours[k][side];
            if (other == 0)
                continue;
            *wrong = k + 1;
            if (neighbours[other - 1][(side + 2) % 4] != k + 1)
                return false;
            if (side == 1 || side == 2)
                g_array_append_vals(list->edges, (const int32_t[]){k, other - 1}, 1);
        }
    return true;
}

SegTspline *seg_read_tspline_cfg(const char *bytes, size_t length, const char *name, GError **error)
{
    SegWords words = {.at = bytes, .end = bytes + length, .line = 1};
    g_autoptr(SegPointList) list = seg_point_list_new();
    int32_t n, wrong = 0;
    if (!next_integer(&words, MOST_POINTS, &n)) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                    "%s:1: \"%s\" is no number of points up to %d", name, words.word, MOST_POINTS);
        return NULL;
    }
    /* A point takes 34 bytes or more: a wrong number does not cost memory. */
    n = MIN(n, (int32_t)(length / 34 + 1));
    g_autofree int32_t(*neighbours)[4] = g_malloc0_n((gsize)n, sizeof *neighbours);
    for (int32_t k = 0; k < n; k++)
        if (!read_cfg_point(&words, k, n, neighbours, list)) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                        "%s:%d: \"%s\" in point %d is no number that may stand there", name,
                        words.line, words.word, k + 1);
            return NULL;
        }
    if (seg_next_word(&words)) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%s:%d: \"%s\" comes after the last point",
                    name, words.line, words.word);
        return NULL;
    }
    if (!join_neighbours(neighbours, n, list, &wrong)) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                    "%s:%d: a neighbour of point %d does not have it as its own", name, wrong + 1,
                    wrong);
        return NULL;
    }
    return build(list, name, error);
}

/* ------------------------------------------------------------------ .tsp */

typedef struct {
    const char *start, *at, *end;
    const char *name;
    GError **error;
} Binary;

static bool refuse(Binary *b, const char *why)
{
    g_set_error(b->error, SEG_ERROR, SEG_ERROR_INPUT, "%s: byte %td: %s", b->name, b->at - b->start,
                why);
    return false;
}

static bool take(Binary *b, void *to, size_t n)
{
    if ((size_t)(b->end - b->at) < n)
        return refuse(b, "the file ends within an entry");
    if (to)
        memcpy(to, b->at, n);
    b->at += n;
    return true;
}

/* The number of entries of `size` bytes or more that follow. */
static bool take_count(Binary *b, size_t size, guint64 *n)
{
    if (!take(b, n, sizeof *n))
        return false;
    return *n <= (size_t)(b->end - b->at) / size ||
           refuse(b, "more entries than the file has room for");
}

static bool take_number(Binary *b, double *value)
{
    if (!take(b, value, sizeof *value))
        return false;
    return fabs(*value) <= SEG_FORM_MAX_REAL || refuse(b, "a number is not finite or too large");
}

static bool take_knots(Binary *b, double knots[5])
{
    guint64 n;
    if (!take_count(b, sizeof(double), &n))
        return false;
    if (n != 5)
        return refuse(b, "a knot vector that is not of five knots: only degree 3 is supported");
    for (int i = 0; i < 5; i++)
        if (!take_number(b, &knots[i]))
            return false;
    return true;
}

/* Lists of other patches: with any entry the point is shared with them. */
static bool take_no_links(Binary *b)
{
    guint64 n;
    for (int i = 0; i < 2; i++) {
        if (!take_count(b, sizeof(int32_t), &n))
            return false;
        if (n > 0)
            return refuse(b, "a point linked to other patches: they are not supported");
    }
    return true;
}

static bool take_tsp_point(Binary *b, SegPointList *list, int32_t *id)
{
    SegListedPoint p = {.line = (int)(b->at - b->start)};
    return take(b, NULL, 16) && take_number(b, &p.x) && take_number(b, &p.y) &&
           take_number(b, &p.z) && take_number(b, &p.w) && take_no_links(b) &&
           take(b, id, sizeof *id) && take(b, NULL, 4 + 16) && take_knots(b, p.knots_u) &&
           take_knots(b, p.knots_v) && take(b, NULL, 1) &&
           (g_array_append_val(list->points, p), true);
}

static bool take_tsp_edges(Binary *b, SegPointList *list)
{
    guint64 n;
    int32_t ends[2];
    if (!take_count(b, 16, &n))
        return false;
    for (guint64 e = 0; e < n; e++) {
        if (!take(b, ends, sizeof ends) || !take(b, NULL, 8))
            return false;
        for (int i = 0; i < 2; i++)
            if (ends[i] < 0 || (guint)ends[i] >= list->points->len)
                return refuse(b, "an edge to a point that is not there");
        g_array_append_vals(list->edges, ends, 1);
    }
    return true;
}

static bool take_tsp(Binary *b, SegPointList *list)
{
    guint64 n;
    uint32_t degree;
    if (!take_count(b, 169, &n))
        return false;
    for (guint64 k = 0; k < n; k++) {
        int32_t id;
        if (!take_tsp_point(b, list, &id))
            return false;
        if ((guint64)id != k)
            return refuse(b, "points are not numbered in order");
    }
    if (!take_tsp_edges(b, list) || !take(b, &degree, sizeof degree))
        return false;
    if (degree != 3)
        return refuse(b, "a degree other than 3 is not supported");
    if (!take(b, NULL, 1 + 32))
        return false;
    return b->at == b->end || refuse(b, "more than one patch, or a later form, is not supported");
}

SegTspline *seg_read_tspline_tsp(const char *bytes, size_t length, const char *name, GError **error)
{
    Binary b = {bytes, bytes, bytes + length, name, error};
    g_autoptr(SegPointList) list = seg_point_list_new();
    return take_tsp(&b, list) ? build(list, name, error) : NULL;
}
