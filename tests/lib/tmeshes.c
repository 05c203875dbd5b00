/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/tmeshes.h"

#include <math.h>

/* Lines 0 and 1, and the last two, have the same value: 0, 0, 1, … 9, 9. */
enum { LINES = 12 };

static bool is_hole(int which, int i0, int i1, int j0, int j1)
{
    if (which == TMESH_HOLED)
        return i0 >= 4 && i1 <= 7 && j0 >= 4 && j1 <= 7;
    return which == TMESH_CORNERED && i0 >= 6 && j0 >= 7;
}

/* Some cells are joined to one face of two: T-junctions where the next row is not. */
static int width_at(int i, int j)
{
    return i > 0 && i % 2 == 0 && j > 0 && j % 3 == 1 && i + 2 < LINES - 1 ? 2 : 1;
}

static int height_at(int i, int j)
{
    return i % 4 == 1 && j % 3 == 2 && j + 2 < LINES - 1 ? 2 : 1;
}

static void add_faces(int which, GArray *faces)
{
    bool taken[LINES][LINES] = {{false}};
    for (int i = 0; i < LINES - 1; i++)
        for (int j = 0; j < LINES - 1; j++) {
            if (taken[i][j])
                continue;
            int w = width_at(i, j), h = w == 1 ? height_at(i, j) : 1;
            bool whole = is_hole(which, i, i + w, j, j + h);
            if (is_hole(which, i, i + 1, j, j + 1) != whole ||
                is_hole(which, i + w - 1, i + w, j + h - 1, j + h) != whole ||
                taken[i + w - 1][j + h - 1])
                w = h = 1;
            for (int a = i; a < i + w; a++)
                for (int b = j; b < j + h; b++)
                    taken[a][b] = true;
            SegTface f = {i, i + w, j, j + h, is_hole(which, i, i + w, j, j + h)};
            g_array_append_val(faces, f);
        }
}

static bool is_inside(const GArray *faces, int i, int j)
{
    for (guint f = 0; f < faces->len; f++) {
        const SegTface *q = &g_array_index(faces, SegTface, f);
        if (q->i0 <= i && i <= q->i1 && q->j0 <= j && j <= q->j1)
            if (q->i0 < i && i < q->i1 && q->j0 < j && j < q->j1)
                return true;
    }
    return false;
}

static bool is_corner(const GArray *faces, int i, int j)
{
    for (guint f = 0; f < faces->len; f++) {
        const SegTface *q = &g_array_index(faces, SegTface, f);
        if ((q->i0 == i || q->i1 == i) && (q->j0 == j || q->j1 == j))
            return true;
    }
    return false;
}

SegTspline *tmesh_example(int which, GError **error)
{
    double knots[LINES];
    for (int i = 0; i < LINES; i++)
        knots[i] = i == 0 ? 0 : i == LINES - 1 ? LINES - 3 : i - 1;
    g_autoptr(GArray) faces = g_array_new(FALSE, FALSE, sizeof(SegTface));
    g_autoptr(GArray) points = g_array_new(FALSE, FALSE, sizeof(SegTpoint));
    add_faces(which, faces);
    for (int i = 0; i < LINES; i++)
        for (int j = 0; j < LINES; j++) {
            bool vertex = is_corner(faces, i, j) && !is_inside(faces, i, j);
            bool far = which == TMESH_CORNERED && i >= 10 && j >= 11; /* reaches no surface */
            if (!vertex || far)
                continue;
            double w = which == TMESH_RATIONAL ? 1 + 0.4 * sin(i + 2 * j) : 1;
            double x = 10 * knots[i], y = 10 * knots[j];
            SegTpoint p = {i, j, x + sin(y), y + cos(x), 8 * sin(x / 17) * cos(y / 13), w};
            g_array_append_val(points, p);
        }
    return seg_tspline_new(knots, LINES, knots, LINES, (const SegTface *)(void *)faces->data,
                           (int32_t)faces->len, (const SegTpoint *)(void *)points->data,
                           (int32_t)points->len, error);
}
