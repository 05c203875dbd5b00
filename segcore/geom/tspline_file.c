/* SPDX-License-Identifier: Apache-2.0 */
/* T-splines in files: .tspl, ours (docs/tspl.md), read and written; which of the others a file is.
 */
#include "segcore/geom/tspline_file.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { VERSION = 1 };

typedef struct {
    SegWords words;
    const char *name;
    GError **error;
    GArray *knots[2], *faces, *points;
} Reader;

static SegTspline *read_tspl(const char *bytes, size_t length, const char *name, GError **error);
static void append_number(GString *to, double value);

SegTspline *seg_tspline_load(const char *path, GError **error)
{
    g_autofree char *bytes = NULL;
    gsize length;
    g_autoptr(GError) why = NULL;
    if (!g_file_get_contents(path, &bytes, &length, &why)) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_IO, "%s", why->message);
        return NULL;
    }
    return seg_tspline_from_bytes(bytes, length, path, error);
}

SegTspline *seg_tspline_from_bytes(const void *memory, size_t length, const char *name,
                                   GError **error)
{
    const char *bytes = memory;
    if (length >= 4 && memcmp(bytes, "tspl", 4) == 0)
        return read_tspl(bytes, length, name, error);
    if (length >= 3 && memcmp(bytes, "#TS", 3) == 0)
        return seg_read_tspline_tsm(bytes, length, name, error);
    if (memchr(bytes, '\0', MIN(length, 64)))
        return seg_read_tspline_tsp(bytes, length, name, error);
    if (length > 0 && g_ascii_isdigit(bytes[0]))
        return seg_read_tspline_cfg(bytes, length, name, error);
    g_set_error(
        error, SEG_ERROR, SEG_ERROR_INPUT,
        "%s: not a T-spline: a .tspl file begins with \"tspl\", a list of points with their "
        "number",
        name);
    return NULL;
}

bool seg_tspline_save(const SegTspline *t, const char *path, GError **error)
{
    g_autoptr(GString) text = g_string_new(NULL);
    const double *const knots[2] = {t->knots_u, t->knots_v};
    const int32_t n[2] = {t->n_u, t->n_v};
    g_string_append_printf(text, "tspl %d\n", VERSION);
    for (int d = 0; d < 2; d++) {
        g_string_append_printf(text, "%s %d", d == 0 ? "u" : "v", n[d]);
        for (int32_t i = 0; i < n[d]; i++)
            append_number(text, knots[d][i]);
        g_string_append_c(text, '\n');
    }
    for (int32_t f = 0; f < t->n_faces; f++) {
        const SegTface *q = &t->faces[f];
        g_string_append_printf(text, "%s %d %d %d %d\n", q->hole ? "hole" : "face", q->i0, q->i1,
                               q->j0, q->j1);
    }
    for (int32_t k = 0; k < t->n_points; k++) {
        const SegTpoint *p = &t->points[k];
        g_string_append_printf(text, "point %d %d", p->i, p->j);
        append_number(text, p->x);
        append_number(text, p->y);
        append_number(text, p->z);
        append_number(text, p->w);
        g_string_append_c(text, '\n');
    }
    g_string_append(text, "end\n");
    g_autoptr(GError) why = NULL;
    if (g_file_set_contents(path, text->str, (gssize)text->len, &why))
        return true;
    g_set_error(error, SEG_ERROR, SEG_ERROR_IO, "%s", why->message);
    return false;
}

/* The shortest decimal that reads back as the same double, behind a space. */
static void append_number(GString *to, double value)
{
    char text[G_ASCII_DTOSTR_BUF_SIZE];
    for (int digits = 15; digits <= 17; digits++) {
        char format[16];
        snprintf(format, sizeof format, "%%.%dg", digits);
        g_ascii_formatd(text, sizeof text, format, value);
        if (g_ascii_strtod(text, NULL) == value)
            break;
    }
    g_string_append_printf(to, " %s", text);
}

/* ------------------------------------------------------------------ reading .tspl */

G_GNUC_PRINTF(2, 3)
static bool refuse(Reader *r, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_autofree char *what = g_strdup_vprintf(format, arguments);
    va_end(arguments);
    g_set_error(r->error, SEG_ERROR, SEG_ERROR_INPUT, "%s:%d: %s", r->name, r->words.line, what);
    return false;
}

static bool next_integer(Reader *r, const char *what, int32_t most, int32_t *value)
{
    guint64 read = 0;
    if (!seg_next_word(&r->words) || r->words.cut ||
        !g_ascii_string_to_unsigned(r->words.word, 10, 0, (guint64)most, &read, NULL))
        return refuse(r, "\"%s\" is no %s: a whole number from 0 to %d is", r->words.word, what,
                      most);
    *value = (int32_t)read;
    return true;
}

static bool next_number(Reader *r, const char *what, double *value)
{
    return seg_next_coordinate(&r->words, value) ||
           refuse(r, "\"%s\" is no %s: a number up to 1e15 is", r->words.word, what);
}

static bool read_lines(Reader *r, GArray *knots)
{
    int32_t n;
    if (knots->len > 0)
        return refuse(r, "the lines are given twice");
    if (!next_integer(r, "number of lines", SEG_TSPLINE_MAX_LINES, &n))
        return false;
    for (int32_t i = 0; i < n; i++) {
        double knot;
        if (!next_number(r, "knot", &knot))
            return false;
        if (i > 0 && knot < g_array_index(knots, double, i - 1))
            return refuse(r, "knot %g of line %d is below the one before", knot, i);
        g_array_append_val(knots, knot);
    }
    return true;
}

static bool read_face(Reader *r, bool hole)
{
    SegTface f = {.hole = hole};
    if (!next_integer(r, "line", SEG_TSPLINE_MAX_LINES, &f.i0) ||
        !next_integer(r, "line", SEG_TSPLINE_MAX_LINES, &f.i1) ||
        !next_integer(r, "line", SEG_TSPLINE_MAX_LINES, &f.j0) ||
        !next_integer(r, "line", SEG_TSPLINE_MAX_LINES, &f.j1))
        return false;
    if (r->faces->len >= SEG_TSPLINE_MAX_CROSSINGS)
        return refuse(r, "more than %d faces", SEG_TSPLINE_MAX_CROSSINGS);
    g_array_append_val(r->faces, f);
    return true;
}

static bool read_point(Reader *r)
{
    SegTpoint p;
    if (!next_integer(r, "line", SEG_TSPLINE_MAX_LINES, &p.i) ||
        !next_integer(r, "line", SEG_TSPLINE_MAX_LINES, &p.j) ||
        !next_number(r, "coordinate", &p.x) || !next_number(r, "coordinate", &p.y) ||
        !next_number(r, "coordinate", &p.z) || !next_number(r, "weight", &p.w))
        return false;
    if (!(p.w > 0))
        return refuse(r, "weight %g is not positive", p.w);
    if (r->points->len >= SEG_TSPLINE_MAX_CROSSINGS)
        return refuse(r, "more than %d points", SEG_TSPLINE_MAX_CROSSINGS);
    g_array_append_val(r->points, p);
    return true;
}

/* Everything up to "end". */
static bool read_entries(Reader *r)
{
    while (seg_next_word(&r->words)) {
        const char *word = r->words.word;
        bool good;
        if (strcmp(word, "u") == 0)
            good = read_lines(r, r->knots[0]);
        else if (strcmp(word, "v") == 0)
            good = read_lines(r, r->knots[1]);
        else if (strcmp(word, "face") == 0 || strcmp(word, "hole") == 0)
            good = read_face(r, word[0] == 'h');
        else if (strcmp(word, "point") == 0)
            good = read_point(r);
        else if (strcmp(word, "end") == 0)
            return !seg_next_word(&r->words) || refuse(r, "\"%s\" comes after \"end\"", word);
        else
            good = refuse(r, "\"%s\" is none of u, v, face, hole, point, end", word);
        if (!good)
            return false;
    }
    return refuse(r, "\"end\" is missing: the file is cut off");
}

static bool read_header(Reader *r)
{
    int32_t version;
    seg_next_word(&r->words);
    if (strcmp(r->words.word, "tspl") != 0)
        return refuse(r, "\"%s\" stands where \"tspl\" must", r->words.word);
    if (!next_integer(r, "version", 1 << 20, &version))
        return false;
    return version == VERSION ||
           refuse(r, "version %d of .tspl; this program reads %d", version, VERSION);
}

static SegTspline *read_tspl(const char *bytes, size_t length, const char *name, GError **error)
{
    Reader r = {{.at = bytes, .end = bytes + length, .line = 1, .comment = '#'},
                name,
                error,
                {NULL},
                NULL,
                NULL};
    g_autoptr(GArray) u = r.knots[0] = g_array_new(FALSE, FALSE, sizeof(double));
    g_autoptr(GArray) v = r.knots[1] = g_array_new(FALSE, FALSE, sizeof(double));
    g_autoptr(GArray) faces = r.faces = g_array_new(FALSE, FALSE, sizeof(SegTface));
    g_autoptr(GArray) points = r.points = g_array_new(FALSE, FALSE, sizeof(SegTpoint));
    if (!read_header(&r) || !read_entries(&r))
        return NULL;
    SegTspline *t = seg_tspline_new(
        (const double *)(void *)u->data, (int32_t)u->len, (const double *)(void *)v->data,
        (int32_t)v->len, (const SegTface *)(void *)faces->data, (int32_t)faces->len,
        (const SegTpoint *)(void *)points->data, (int32_t)points->len, error);
    if (!t)
        g_prefix_error(error, "%s: ", name);
    return t;
}
