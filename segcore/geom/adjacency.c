/* SPDX-License-Identifier: Apache-2.0 */
/* Which faces meet: by shared edges, and where they share none, by free edges in one place. */
#include "segcore/geom/bspline.h"
#include "segcore/geom/curve.h"

enum { SAMPLES = 7, SAMPLES_ON = 2 }; /* of a free edge; as many lie on the other where they meet */

typedef struct {
    int32_t face;
    SegBox box;
    SegVec3 samples[SAMPLES];
    guint first_point, n_points; /* of the polyline */
} FreeEdge;

static void add_shared(const SegPart *part, GArray *pairs, GArray *free_edges);
static void add_touching(const SegPart *part, double tolerance_mm, GArray *free_edges,
                         GArray *pairs);
static void sort_unique(GArray *pairs);

GArray *seg_part_adjacency(const SegPart *part, double tolerance_mm)
{
    GArray *pairs = g_array_new(FALSE, FALSE, sizeof(SegFacePair));
    g_autoptr(GArray) free_edges = g_array_new(FALSE, FALSE, sizeof(int32_t[2]));
    add_shared(part, pairs, free_edges);
    add_touching(part, tolerance_mm, free_edges, pairs);
    sort_unique(pairs);
    return pairs;
}

double seg_part_touch_mm(const SegPart *part)
{
    SegBox box = SEG_BOX_EMPTY;
    for (int32_t i = 0; i < part->n_edges; i++) {
        seg_box_add(&box, part->edges[i].ends[0]);
        seg_box_add(&box, part->edges[i].ends[1]);
    }
    return fmax(1e-3, 1e-4 * seg_box_diagonal(&box));
}

static int compare_pairs(const void *a, const void *b)
{
    const SegFacePair *x = a, *y = b;
    return x->a != y->a ? (x->a > y->a) - (x->a < y->a) : (x->b > y->b) - (x->b < y->b);
}

static void sort_unique(GArray *pairs)
{
    g_array_sort(pairs, compare_pairs);
    SegFacePair *all = (SegFacePair *)(void *)pairs->data;
    guint kept = 0;
    for (guint i = 0; i < pairs->len; i++)
        if (kept == 0 || compare_pairs(&all[kept - 1], &all[i]) != 0)
            all[kept++] = all[i];
    g_array_set_size(pairs, kept);
}

static void add_pair(GArray *pairs, int32_t a, int32_t b)
{
    SegFacePair pair = {MIN(a, b), MAX(a, b)};
    if (a != b)
        g_array_append_val(pairs, pair);
}

/* ------------------------------------------------------------------ by topology */

/* Who uses an edge: its first use, from which `next` leads on. */
typedef struct {
    int32_t face, next;
} Use;

/* `free_edges`: {edge, face} of the edges that are used once. */
static void add_shared(const SegPart *part, GArray *pairs, GArray *free_edges)
{
    g_autofree int32_t *first = g_new(int32_t, (size_t)part->n_edges);
    g_autofree Use *uses = g_new(Use, (size_t)part->n_coedges);
    for (int32_t i = 0; i < part->n_edges; i++)
        first[i] = -1;
    for (int32_t f = 0; f < part->n_faces; f++) {
        const SegFace *face = &part->faces[f];
        for (int32_t l = face->first_loop; l < face->first_loop + face->n_loops; l++)
            for (int32_t i = 0; i < part->loops[l].n_coedges; i++) {
                int32_t c = part->loops[l].first_coedge + i, e = part->coedges[c].edge;
                for (int32_t u = first[e]; u >= 0; u = uses[u].next)
                    add_pair(pairs, uses[u].face, f);
                uses[c] = (Use){f, first[e]};
                first[e] = c;
            }
    }
    for (int32_t i = 0; i < part->n_edges; i++)
        if (first[i] >= 0 && uses[first[i]].next < 0 && part->edges[i].curve.n_poles > 0) {
            int32_t entry[2] = {i, uses[first[i]].face};
            g_array_append_val(free_edges, entry);
        }
}

/* ------------------------------------------------------------------ by place */

typedef struct {
    const SegPart *part;
    const SegEdge *edge;
    double chord_mm;
    GArray *points;
} Polyline;

static SegVec3 point_of(const Polyline *line, double t)
{
    return seg_curve_evaluate(line->part, &line->edge->curve, t, NULL);
}

static double distance_to_segment(SegVec3 p, SegVec3 a, SegVec3 b)
{
    SegVec3 ab = seg_sub(b, a), ap = seg_sub(p, a);
    double length2 = seg_dot(ab, ab);
    double t = length2 > 0 ? fmin(fmax(seg_dot(ap, ab) / length2, 0), 1) : 0;
    return seg_norm(seg_along(ap, ab, -t));
}

/* Appends the points after a up to and with b; m lies at the middle. */
static void refine(const Polyline *line, double ta, SegVec3 a, SegVec3 m, double tb, SegVec3 b,
                   int depth)
{
    double tm = (ta + tb) / 2;
    SegVec3 q1 = point_of(line, (ta + tm) / 2), q3 = point_of(line, (tm + tb) / 2);
    double off = fmax(distance_to_segment(m, a, b),
                      fmax(distance_to_segment(q1, a, b), distance_to_segment(q3, a, b)));
    if (depth > 0 && off > line->chord_mm) {
        refine(line, ta, a, q1, tm, m, depth - 1);
        refine(line, tm, m, q3, tb, b, depth - 1);
    } else {
        g_array_append_val(line->points, b);
    }
}

static void append_polyline(Polyline *line)
{
    const int max_depth = 12;
    const SegEdge *e = line->edge;
    const double *knots = seg_curve_tables(line->part->reals, &e->curve).knots;
    double t = e->t_first;
    SegVec3 a = point_of(line, t);
    g_array_append_val(line->points, a);
    int n = e->curve.n_poles;
    for (int i = seg_knot_span(knots, e->curve.degree, n, t); i < n && t < e->t_last; i++) {
        double next = i == n - 1 ? e->t_last : fmin(knots[i + 1], e->t_last);
        if (!(next > t))
            continue;
        SegVec3 b = point_of(line, next);
        if (e->curve.degree == 1)
            g_array_append_val(line->points, b);
        else
            refine(line, t, a, point_of(line, (t + next) / 2), next, b, max_depth);
        a = b;
        t = next;
    }
}

static FreeEdge free_edge(const SegPart *part, const int32_t entry[2], double tolerance_mm,
                          GArray *points)
{
    Polyline line = {part, &part->edges[entry[0]], tolerance_mm / 4, points};
    FreeEdge e = {.face = entry[1], .box = SEG_BOX_EMPTY, .first_point = points->len};
    append_polyline(&line);
    e.n_points = points->len - e.first_point;
    for (guint i = e.first_point; i < points->len; i++)
        seg_box_add(&e.box, g_array_index(points, SegVec3, i));
    SegVec3 margin = seg_vec3(1.25 * tolerance_mm, 1.25 * tolerance_mm, 1.25 * tolerance_mm);
    e.box = (SegBox){seg_sub(e.box.min, margin), seg_add(e.box.max, margin)};
    double a = line.edge->t_first, b = line.edge->t_last;
    for (int i = 0; i < SAMPLES; i++)
        e.samples[i] = point_of(&line, a + (b - a) * (i + 1) / (SAMPLES + 1));
    return e;
}

static bool contains(const SegBox *box, SegVec3 p)
{
    return p.x >= box->min.x && p.x <= box->max.x && p.y >= box->min.y && p.y <= box->max.y &&
           p.z >= box->min.z && p.z <= box->max.z;
}

static bool overlap(const SegBox *a, const SegBox *b)
{
    return a->min.x <= b->max.x && b->min.x <= a->max.x && a->min.y <= b->max.y &&
           b->min.y <= a->max.y && a->min.z <= b->max.z && b->min.z <= a->max.z;
}

static bool is_near(SegVec3 p, const FreeEdge *e, const SegVec3 *points, double tolerance_mm)
{
    if (!contains(&e->box, p))
        return false;
    const SegVec3 *line = points + e->first_point;
    for (guint i = 0; i + 1 < e->n_points; i++)
        if (distance_to_segment(p, line[i], line[i + 1]) <= tolerance_mm)
            return true;
    return false;
}

/* Two edges that only cross or touch at their ends have at most one sample in common. */
static bool lies_on(const FreeEdge *a, const FreeEdge *b, const SegVec3 *points,
                    double tolerance_mm)
{
    int on = 0;
    for (int i = 0; i < SAMPLES && on < SAMPLES_ON; i++)
        on += is_near(a->samples[i], b, points, 1.25 * tolerance_mm); /* the polyline's quarter */
    return on >= SAMPLES_ON;
}

static int compare_by_x(const void *a, const void *b)
{
    const FreeEdge *p = a, *q = b;
    return (p->box.min.x > q->box.min.x) - (p->box.min.x < q->box.min.x);
}

static void add_touching(const SegPart *part, double tolerance_mm, GArray *free_edges,
                         GArray *pairs)
{
    guint n = free_edges->len;
    if (!(tolerance_mm > 0) || n == 0)
        return;
    g_autoptr(GArray) points = g_array_new(FALSE, FALSE, sizeof(SegVec3));
    g_autofree FreeEdge *edges = g_new(FreeEdge, n);
    for (guint i = 0; i < n; i++)
        edges[i] = free_edge(part, (const int32_t *)(void *)free_edges->data + 2 * i, tolerance_mm,
                             points);
    qsort(edges, n, sizeof *edges, compare_by_x);
    const SegVec3 *all = (const SegVec3 *)(void *)points->data;
    for (guint i = 0; i < n; i++)
        for (guint k = i + 1; k < n && edges[k].box.min.x <= edges[i].box.max.x; k++)
            if (edges[k].face != edges[i].face && overlap(&edges[i].box, &edges[k].box) &&
                (lies_on(&edges[i], &edges[k], all, tolerance_mm) ||
                 lies_on(&edges[k], &edges[i], all, tolerance_mm)))
                add_pair(pairs, edges[i].face, edges[k].face);
}
