/* SPDX-License-Identifier: Apache-2.0 */
/*
 * T-Splines for Rhino (.tsm, "#TS0200"), as far as it is one rectangle. A text of records, an empty
 * one keeping the number of something deleted: e LINK INTERVAL            edge: one of its links,
 * knot interval v LINK EAST|NORTH|…        vertex: a link that leaves it, and where to in the
 * vertex's own frame l PREVIOUS NEXT OPPOSITE VERTEX FACE EDGE TURN   link: leaves VERTEX; face -1
 * is the outside; the angle of its face at VERTEX is TURN + 1 quarters ec EDGE 0 edge of the border
 *   0m gvp VERTEX, 0m gv VERTEX   control point k is the vertex's own, or one more of it
 *   0m cg VERTEX 4 N W S E …   those: for each flagged direction the next one that way, and between
 *                              two flagged the one across
 *   0g X Y Z W                 control point k
 * Such a border has two lines: the vertices' own points lie on the outer, the others on the inner.
 */
#include <math.h>
#include <string.h>

#include "segcore/geom/part_form.h"
#include "segcore/geom/tspline_file.h"

enum { NORTH = 1, NONE = -1, MOST_RECORDS = 1 << 22 };
enum { PREVIOUS, NEXT, OPPOSITE, VERTEX, FACE, EDGE, TURN, N_LINK_FIELDS };

typedef struct {
    int32_t field[N_LINK_FIELDS];
    int direction; /* 0 east, 1 north, 2 west, 3 south, in the frame of all; NONE: not known yet */
    bool alive;
} Link;

typedef struct {
    int32_t link; /* NONE: deleted */
    int direction;
    double at[2];
    bool placed;
    int32_t line[2]; /* among the values of u and v */
    int32_t own;     /* its own control point */
    GArray *map;     /* int32_t: the record cg behind the vertex; NULL: none */
} Vertex;

typedef struct {
    const char *name;
    int line;
    GError **error;
    GArray *intervals;        /* double, by edge; negative: deleted */
    GArray *links, *vertices; /* Link, Vertex */
    GArray *owners;           /* int32_t, by control point */
    GArray *grips;            /* SegTpoint without place, by control point */
    double *values[2];        /* of lines, the border once */
    int32_t n[2];
    GArray *faces, *points; /* the result: SegTface, SegTpoint */
} Tsm;

static bool read_records(Tsm *m, const char *bytes, size_t length);
static bool check_links(Tsm *m);
static bool lay_out(Tsm *m);
static bool check_layout(Tsm *m);
static bool find_values(Tsm *m);
static bool add_faces(Tsm *m);
static bool add_points(Tsm *m);

G_GNUC_PRINTF(2, 3)
static bool refuse(Tsm *m, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_autofree char *what = g_strdup_vprintf(format, arguments);
    va_end(arguments);
    if (m->line > 0)
        g_set_error(m->error, SEG_ERROR, SEG_ERROR_INPUT, "%s:%d: %s", m->name, m->line, what);
    else
        g_set_error(m->error, SEG_ERROR, SEG_ERROR_INPUT, "%s: %s", m->name, what);
    return false;
}

static void clear_vertex(void *vertex)
{
    g_clear_pointer(&((Vertex *)vertex)->map, g_array_unref);
}

/* Every border line twice. */
static double *double_borders(const double *values, int32_t n)
{
    double *lines = g_new(double, n + 2);
    lines[0] = values[0];
    memcpy(lines + 1, values, (size_t)n * sizeof *values);
    lines[n + 1] = values[n - 1];
    return lines;
}

static SegTspline *build(Tsm *m)
{
    if (!check_links(m) || !lay_out(m) || !check_layout(m) || !find_values(m) || !add_faces(m) ||
        !add_points(m))
        return NULL;
    g_autofree double *u = double_borders(m->values[0], m->n[0]);
    g_autofree double *v = double_borders(m->values[1], m->n[1]);
    SegTspline *t =
        seg_tspline_new(u, m->n[0] + 2, v, m->n[1] + 2, (const SegTface *)(void *)m->faces->data,
                        (int32_t)m->faces->len, (const SegTpoint *)(void *)m->points->data,
                        (int32_t)m->points->len, m->error);
    if (!t)
        g_prefix_error(m->error, "%s: ", m->name);
    return t;
}

SegTspline *seg_read_tspline_tsm(const char *bytes, size_t length, const char *name, GError **error)
{
    Tsm m = {.name = name, .error = error};
    m.intervals = g_array_new(FALSE, FALSE, sizeof(double));
    m.links = g_array_new(FALSE, TRUE, sizeof(Link));
    m.vertices = g_array_new(FALSE, TRUE, sizeof(Vertex));
    m.owners = g_array_new(FALSE, FALSE, sizeof(int32_t));
    m.grips = g_array_new(FALSE, FALSE, sizeof(SegTpoint));
    m.faces = g_array_new(FALSE, FALSE, sizeof(SegTface));
    m.points = g_array_new(FALSE, FALSE, sizeof(SegTpoint));
    g_array_set_clear_func(m.vertices, clear_vertex);
    SegTspline *t = read_records(&m, bytes, length) ? build(&m) : NULL;
    GArray *const all[] = {m.intervals, m.links, m.vertices, m.owners, m.grips, m.faces, m.points};
    for (size_t i = 0; i < G_N_ELEMENTS(all); i++)
        g_array_unref(all[i]);
    g_free(m.values[0]);
    g_free(m.values[1]);
    return t;
}

/* ------------------------------------------------------------------ records */

static bool to_integer(const char *word, int32_t *value)
{
    gint64 read = 0;
    if (!word || !g_ascii_string_to_signed(word, 10, NONE, MOST_RECORDS, &read, NULL))
        return false;
    *value = (int32_t)read;
    return true;
}

static bool to_number(const char *word, double *value)
{
    char *rest;
    if (!word)
        return false;
    *value = g_ascii_strtod(word, &rest);
    return rest != word && *rest == '\0' && fabs(*value) <= SEG_FORM_MAX_REAL;
}

static bool read_edge(Tsm *m, char **words)
{
    double interval = NONE;
    if (words[0] && (!words[1] || !to_number(words[1], &interval) || !(interval > 0)))
        return refuse(m, "an edge without a knot interval above 0 is not supported");
    g_array_append_val(m->intervals, interval);
    return true;
}

static bool read_vertex(Tsm *m, char **words)
{
    static const char *const names[] = {"EAST", "NORTH", "WEST", "SOUTH"};
    Vertex v = {.link = NONE, .own = NONE};
    if (words[0]) {
        for (; words[1] && v.direction < 4; v.direction++)
            if (strcmp(words[1], names[v.direction]) == 0)
                break;
        if (!to_integer(words[0], &v.link) || !words[1] || v.direction == 4)
            return refuse(m, "a vertex is a link and a direction");
    }
    g_array_append_val(m->vertices, v);
    return true;
}

static bool read_link(Tsm *m, char **words)
{
    Link l = {.direction = NONE, .alive = words[0] != NULL};
    for (int i = 0; l.alive && i < N_LINK_FIELDS; i++)
        if (!words[i] || !to_integer(words[i], &l.field[i]))
            return refuse(m, "a link is seven whole numbers");
    g_array_append_val(m->links, l);
    return true;
}

static bool read_grip(Tsm *m, char **words)
{
    SegTpoint p = {0};
    if (words[0]) {
        if (!to_number(words[0], &p.x) || !to_number(words[1], &p.y) || !words[1] || !words[2] ||
            !to_number(words[2], &p.z) || !to_number(words[3], &p.w))
            return refuse(m, "a control point is four numbers");
        if (p.w != 1)
            return refuse(m, "a weight of %g: weights other than 1 are not supported", p.w);
    }
    g_array_append_val(m->grips, p);
    return true;
}

/* Which vertex a control point belongs to, and, behind a vertex, its others. */
static bool read_map(Tsm *m, char **words)
{
    int32_t vertex, value;
    if (!words[0] || strcmp(words[0], "odd-grip-map") == 0)
        return true;
    if (!to_integer(words[1], &vertex))
        return refuse(m, "\"%s\" names no vertex", words[0]);
    bool there = vertex >= 0 && (guint)vertex < m->vertices->len;
    if (strcmp(words[0], "gvp") == 0 || strcmp(words[0], "gv") == 0) {
        if (words[0][2] == 'p' && there)
            g_array_index(m->vertices, Vertex, vertex).own = (int32_t)m->owners->len;
        g_array_append_val(m->owners, vertex);
        return true;
    }
    if (strcmp(words[0], "cg") != 0 || !there)
        return refuse(m, "\"%s %s\" is not known", words[0], words[1]);
    Vertex *v = &g_array_index(m->vertices, Vertex, vertex);
    if (v->map)
        return refuse(m, "vertex %d has two maps", vertex);
    v->map = g_array_new(FALSE, FALSE, sizeof(int32_t));
    for (char **word = words + 2; *word; word++) {
        if (!to_integer(*word, &value))
            return refuse(m, "\"%s\" is no control point", *word);
        g_array_append_val(v->map, value);
    }
    return true;
}

static bool read_setting(Tsm *m, const char *key, char **words)
{
    const char *value = words[0] ? words[0] : "";
    if (strcmp(key, "degree") == 0 && strcmp(value, "3") != 0)
        return refuse(m, "degree %s: only 3 is supported", value);
    if (strcmp(key, "force-bezier-end-conditions") == 0 && strcmp(value, "1") != 0)
        return refuse(m, "end conditions other than Bézier are not supported");
    if (strcmp(key, "units") == 0 &&
        (!words[0] || !words[1] || strcmp(words[1], "millimeters") != 0))
        return refuse(m, "units other than millimeters are not supported");
    if (strcmp(key, "ec") == 0 && (!words[0] || !words[1] || strcmp(words[1], "0") != 0))
        return refuse(m, "creases are not supported");
    return true; /* the rest says nothing of the surface */
}

static bool read_record(Tsm *m, const char *key, char **words)
{
    if (strcmp(key, "e") == 0)
        return read_edge(m, words);
    if (strcmp(key, "v") == 0)
        return read_vertex(m, words);
    if (strcmp(key, "l") == 0)
        return read_link(m, words);
    if (strcmp(key, "0g") == 0)
        return read_grip(m, words);
    if (strcmp(key, "0m") == 0)
        return read_map(m, words);
    return read_setting(m, key, words);
}

/* The words of a line up to a comment, none of them empty. */
static GPtrArray *split_line(const char *from, const char *to)
{
    GPtrArray *words = g_ptr_array_new_with_free_func(g_free);
    while (from < to && *from != '#') {
        const char *end = from;
        while (end < to && *end != '#' && !g_ascii_isspace(*end))
            end++;
        if (end > from)
            g_ptr_array_add(words, g_strndup(from, (gsize)(end - from)));
        from = end < to && *end == '#' ? to : end + 1;
    }
    g_ptr_array_add(words, NULL);
    return words;
}

static bool read_records(Tsm *m, const char *bytes, size_t length)
{
    const char *end = bytes + length;
    for (m->line = 1; bytes < end; m->line++) {
        const char *stop = memchr(bytes, '\n', (size_t)(end - bytes));
        stop = stop ? stop : end;
        g_autoptr(GPtrArray) words = split_line(bytes, stop);
        char **first = (char **)words->pdata;
        if (first[0] && !read_record(m, first[0], first + 1))
            return false;
        bytes = stop < end ? stop + 1 : end;
    }
    m->line = 0;
    return true;
}

/* ------------------------------------------------------------------ topology */

static Link *link_at(const Tsm *m, int32_t link)
{
    return &g_array_index(m->links, Link, link);
}

static Vertex *vertex_at(const Tsm *m, int32_t vertex)
{
    return &g_array_index(m->vertices, Vertex, vertex);
}

static bool is_link(const Tsm *m, int32_t link)
{
    return link >= 0 && (guint)link < m->links->len && link_at(m, link)->alive;
}

static bool is_vertex(const Tsm *m, int32_t vertex)
{
    return vertex >= 0 && (guint)vertex < m->vertices->len && vertex_at(m, vertex)->link != NONE;
}

static int32_t end_of(const Tsm *m, const Link *l)
{
    return link_at(m, l->field[OPPOSITE])->field[VERTEX];
}

static bool check_link(Tsm *m, int32_t k)
{
    const int32_t *f = link_at(m, k)->field;
    if (!is_link(m, f[PREVIOUS]) || !is_link(m, f[NEXT]) || !is_link(m, f[OPPOSITE]) ||
        !is_vertex(m, f[VERTEX]))
        return refuse(m, "link %d leads to something that is not there", k);
    const Link *next = link_at(m, f[NEXT]), *opposite = link_at(m, f[OPPOSITE]);
    if (next->field[PREVIOUS] != k || opposite->field[OPPOSITE] != k || f[OPPOSITE] == k ||
        next->field[VERTEX] != opposite->field[VERTEX] || next->field[FACE] != f[FACE])
        return refuse(m, "link %d and its neighbours do not agree: the T-mesh is not closed", k);
    if (f[EDGE] < 0 || (guint)f[EDGE] >= m->intervals->len || opposite->field[EDGE] != f[EDGE] ||
        g_array_index(m->intervals, double, f[EDGE]) < 0)
        return refuse(m, "link %d has no edge", k);
    if (f[TURN] < 0 || f[TURN] > 2)
        return refuse(m, "link %d turns by %d quarters: extraordinary points are not supported", k,
                      f[TURN] + 1);
    if (f[FACE] == NONE && f[TURN] == 0)
        return refuse(m,
                      "the border turns inwards at vertex %d: surfaces that are not rectangular "
                      "are not supported",
                      f[VERTEX]);
    return true;
}

static bool check_links(Tsm *m)
{
    int32_t corners = 0, alive = 0;
    for (int32_t k = 0; k < (int32_t)m->links->len; k++) {
        if (!link_at(m, k)->alive)
            continue;
        if (!check_link(m, k))
            return false;
        alive++;
        corners += link_at(m, k)->field[FACE] == NONE && link_at(m, k)->field[TURN] == 2;
    }
    for (int32_t k = 0; k < (int32_t)m->vertices->len; k++) {
        int32_t first = vertex_at(m, k)->link;
        if (first != NONE && (!is_link(m, first) || link_at(m, first)->field[VERTEX] != k))
            return refuse(m, "vertex %d names a link that does not leave it", k);
    }
    if (alive == 0 || corners != 4)
        return refuse(m,
                      "the surface has %d corners: closed surfaces, and such that are not "
                      "rectangular, are not supported",
                      corners);
    return true;
}

static const int STEP[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

/* Where the link ends, going from where it begins. */
static void follow(const Tsm *m, const Link *l, double at[2])
{
    const Vertex *from = vertex_at(m, l->field[VERTEX]);
    double interval = g_array_index(m->intervals, double, l->field[EDGE]);
    for (int d = 0; d < 2; d++)
        at[d] = from->at[d] + interval * STEP[l->direction][d];
}

/* Directions in the frame of the first vertex, and parameters from it: from link to link, round
 * faces and across edges. Both of the next links leave where the link ends. */
static bool lay_out(Tsm *m)
{
    g_autoptr(GArray) waiting = g_array_new(FALSE, FALSE, sizeof(int32_t));
    int32_t first = 0;
    while (vertex_at(m, first)->link == NONE)
        first++;
    int32_t from = vertex_at(m, first)->link;
    link_at(m, from)->direction = vertex_at(m, first)->direction;
    vertex_at(m, first)->placed = true;
    g_array_append_val(waiting, from);
    for (guint k = 0; k < waiting->len; k++) {
        const Link *l = link_at(m, g_array_index(waiting, int32_t, k));
        int32_t to[2] = {l->field[NEXT], l->field[OPPOSITE]};
        int direction[2] = {(l->direction + 5 - link_at(m, to[0])->field[TURN]) % 4,
                            (l->direction + 2) % 4};
        Vertex *end = vertex_at(m, end_of(m, l));
        if (!end->placed)
            follow(m, l, end->at);
        end->placed = true;
        for (int i = 0; i < 2; i++) {
            Link *other = link_at(m, to[i]);
            if (other->direction != NONE && other->direction != direction[i])
                return refuse(m, "there is an extraordinary point near vertex %d: not supported",
                              other->field[VERTEX]);
            if (other->direction != NONE)
                continue;
            other->direction = direction[i];
            g_array_append_val(waiting, to[i]);
        }
    }
    return true;
}

static bool check_layout(Tsm *m)
{
    double width = 0, at[2];
    for (guint e = 0; e < m->intervals->len; e++)
        width += fmax(g_array_index(m->intervals, double, e), 0);
    for (int32_t k = 0; k < (int32_t)m->links->len; k++) {
        const Link *l = link_at(m, k);
        if (!l->alive)
            continue;
        if (l->direction == NONE)
            return refuse(m, "more than one surface in a file is not supported");
        const Vertex *end = vertex_at(m, end_of(m, l));
        follow(m, l, at);
        if (fabs(end->at[0] - at[0]) + fabs(end->at[1] - at[1]) > 1e-9 * width)
            return refuse(m, "the knot intervals around vertex %d do not add up", l->field[VERTEX]);
    }
    return true;
}

/* ------------------------------------------------------------------ lines, faces, points */

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The last line of those up to `at`, or the first. */
static int32_t find_line(const double *values, int32_t n, double at)
{
    int32_t low = 0, high = n;
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        if (values[middle] <= at)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Sums along different ways differ by rounding: within 1e-9 of the width they are one line. */
static bool find_values(Tsm *m)
{
    for (int d = 0; d < 2; d++) {
        double *values = m->values[d] = g_new(double, m->vertices->len);
        int32_t count = 0, kept = 0;
        for (int32_t k = 0; k < (int32_t)m->vertices->len; k++)
            if (vertex_at(m, k)->placed)
                values[count++] = vertex_at(m, k)->at[d];
        qsort(values, (size_t)count, sizeof *values, compare_doubles);
        double near = 1e-9 * (values[count - 1] - values[0]);
        for (int32_t k = 0; k < count; k++)
            if (k == 0 || values[k] > values[kept - 1] + near)
                values[kept++] = values[k];
        m->n[d] = kept;
        for (int32_t k = 0; k < (int32_t)m->vertices->len; k++)
            vertex_at(m, k)->line[d] = find_line(values, kept, vertex_at(m, k)->at[d] + 0.5 * near);
        if (kept < 2)
            return refuse(m, "the surface has no area");
    }
    return true;
}

static void add_face(Tsm *m, int32_t i0, int32_t i1, int32_t j0, int32_t j1)
{
    g_array_append_vals(m->faces, &(SegTface){i0, i1, j0, j1, 0}, 1);
}

/* The strip between the two lines of the border, along the link. */
static void add_strip(Tsm *m, const int32_t a[2], const int32_t b[2])
{
    int32_t last[2] = {m->n[0] + 1, m->n[1] + 1};
    int across = a[0] == b[0] ? 0 : 1;
    int32_t low = MIN(a[!across], b[!across]) + 1, high = MAX(a[!across], b[!across]) + 1;
    int32_t outer = a[across] == 0 ? 0 : last[across] - 1;
    if (across == 0)
        add_face(m, outer, outer + 1, low, high);
    else
        add_face(m, low, high, outer, outer + 1);
}

static bool add_faces(Tsm *m)
{
    g_autofree uint8_t *done = g_new0(uint8_t, m->links->len);
    for (int32_t k = 0; k < (int32_t)m->links->len; k++) {
        const Link *l = link_at(m, k);
        if (!l->alive || done[k])
            continue;
        if (l->field[FACE] == NONE) {
            add_strip(m, vertex_at(m, l->field[VERTEX])->line, vertex_at(m, end_of(m, l))->line);
            continue;
        }
        int32_t low[2] = {INT32_MAX, INT32_MAX}, high[2] = {0, 0};
        for (int32_t at = k; !done[at]; at = link_at(m, at)->field[NEXT]) {
            done[at] = 1;
            const Vertex *v = vertex_at(m, link_at(m, at)->field[VERTEX]);
            for (int d = 0; d < 2; d++) {
                low[d] = MIN(low[d], v->line[d]);
                high[d] = MAX(high[d], v->line[d]);
            }
        }
        add_face(m, low[0] + 1, high[0] + 1, low[1] + 1, high[1] + 1);
    }
    int32_t n = m->n[0], o = m->n[1];
    add_face(m, 0, 1, 0, 1);
    add_face(m, n, n + 1, 0, 1);
    add_face(m, 0, 1, o, o + 1);
    add_face(m, n, n + 1, o, o + 1);
    return true;
}

static bool add_point(Tsm *m, int32_t vertex, int32_t grip, int32_t i, int32_t j)
{
    if (grip < 0 || (guint)grip >= m->grips->len || (guint)grip >= m->owners->len ||
        g_array_index(m->owners, int32_t, grip) != vertex)
        return refuse(m, "vertex %d names control point %d, which is not one of its", vertex, grip);
    SegTpoint p = g_array_index(m->grips, SegTpoint, grip);
    if (p.w == 0)
        return refuse(m, "vertex %d names control point %d, which is deleted", vertex, grip);
    p.i = i, p.j = j;
    g_array_append_val(m->points, p);
    return true;
}

/* The other points of a vertex, from its own at lines i, j. */
static bool add_others(Tsm *m, int32_t vertex, int32_t i, int32_t j)
{
    const Vertex *v = vertex_at(m, vertex);
    const int32_t *map = (const int32_t *)(void *)v->map->data;
    guint next = 5; /* behind the number of flags, and the flags */
    int turned = link_at(m, v->link)->direction - v->direction + 4;
    if (v->map->len < next || map[0] != 4)
        return refuse(m, "vertex %d: extraordinary points are not supported", vertex);
    for (int d = 0; d < 4; d++) {
        const int *one = STEP[(NORTH + d + turned) % 4], *two = STEP[(NORTH + d + 1 + turned) % 4];
        bool flagged = map[1 + d] == 1, across = flagged && map[1 + (d + 1) % 4] == 1;
        if (v->map->len < next + flagged + across)
            return refuse(m, "vertex %d has fewer control points than its map says", vertex);
        if (flagged && !add_point(m, vertex, map[next++], i + one[0], j + one[1]))
            return false;
        if (across && !add_point(m, vertex, map[next++], i + one[0] + two[0], j + one[1] + two[1]))
            return false;
    }
    return true;
}

static bool add_points(Tsm *m)
{
    for (int32_t k = 0; k < (int32_t)m->vertices->len; k++) {
        const Vertex *v = vertex_at(m, k);
        if (v->link == NONE)
            continue;
        int32_t line[2];
        for (int d = 0; d < 2; d++)
            line[d] = v->line[d] == 0             ? 0
                      : v->line[d] == m->n[d] - 1 ? m->n[d] + 1
                                                  : v->line[d] + 1;
        if (!add_point(m, k, v->own, line[0], line[1]) ||
            (v->map && !add_others(m, k, line[0], line[1])))
            return false;
    }
    return true;
}
