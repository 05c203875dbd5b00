/* SPDX-License-Identifier: Apache-2.0 */
/* Exact boxes of B-spline curves. */
#include "segcore/geom/bspline.h"
#include "segcore/geom/curve.h"

const SegBox SEG_BOX_EMPTY = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

void seg_box_add(SegBox *box, SegVec3 p)
{
    box->min = seg_vec3(fmin(box->min.x, p.x), fmin(box->min.y, p.y), fmin(box->min.z, p.z));
    box->max = seg_vec3(fmax(box->max.x, p.x), fmax(box->max.y, p.y), fmax(box->max.z, p.z));
}

bool seg_box_is_empty(const SegBox *box)
{
    return !(box->min.x <= box->max.x);
}

void seg_box_join(SegBox *box, const SegBox *other)
{
    if (seg_box_is_empty(other))
        return;
    seg_box_add(box, other->min);
    seg_box_add(box, other->max);
}

double seg_box_diagonal(const SegBox *box)
{
    return seg_box_is_empty(box) ? 0 : seg_distance(box->min, box->max);
}

static bool is_inside(const SegBox *box, SegVec3 p, double tolerance)
{
    return p.x >= box->min.x - tolerance && p.x <= box->max.x + tolerance &&
           p.y >= box->min.y - tolerance && p.y <= box->max.y + tolerance &&
           p.z >= box->min.z - tolerance && p.z <= box->max.z + tolerance;
}

/* ------------------------------------------------------------------ Bézier pieces */

typedef struct {
    double x, y, z, w; /* (w·x, w·y, w·z, w) */
} Pole;

typedef struct {
    int degree;
    Pole poles[SEG_MAX_DEGREE + 1];
} Bezier;

static Pole mix(Pole a, Pole b, double t)
{
    double s = 1 - t;
    return (Pole){s * a.x + t * b.x, s * a.y + t * b.y, s * a.z + t * b.z, s * a.w + t * b.w};
}

static SegVec3 project(Pole p)
{
    return seg_vec3(p.x / p.w, p.y / p.w, p.z / p.w);
}

/* Pole k of the curve's piece over [a, b] within a span is its blossom at a (p - k times) and b (k
 * times): de Boor's algorithm with an argument of its own in every round. */
static Pole blossom(const double *knots, int degree, int span, const Pole *local, double a,
                    double b, int k)
{
    Pole d[SEG_MAX_DEGREE + 1];
    for (int j = 0; j <= degree; j++)
        d[j] = local[j];
    for (int r = 1; r <= degree; r++) {
        double t = r <= degree - k ? a : b;
        for (int j = degree; j >= r; j--) {
            double left = knots[span - degree + j], right = knots[span + 1 + j - r];
            d[j] = mix(d[j - 1], d[j], (t - left) / (right - left));
        }
    }
    return d[degree];
}

static void local_poles(const SegCurve *curve, const SegCurveTables *c, int span, Pole *local)
{
    for (int j = 0; j <= curve->degree; j++) {
        int i = span - curve->degree + j;
        const double *p = c->poles + (ptrdiff_t)i * curve->dim;
        double w = c->weights ? c->weights[i] : 1;
        local[j] = (Pole){w * p[0], w * p[1], curve->dim == 3 ? w * p[2] : 0, w};
    }
}

static bool all_inside(const SegBox *box, const Pole *poles, int n, double tolerance)
{
    for (int i = 0; i < n; i++)
        if (!is_inside(box, project(poles[i]), tolerance))
            return false;
    return true;
}

/* De Casteljau at the middle: `piece` becomes its left half. */
static void halve(Bezier *piece, Bezier *right)
{
    int p = piece->degree;
    right->degree = p;
    right->poles[p] = piece->poles[p];
    for (int r = 1; r <= p; r++) {
        for (int j = p; j >= r; j--)
            piece->poles[j] = mix(piece->poles[j - 1], piece->poles[j], 0.5);
        right->poles[p - r] = piece->poles[p];
    }
}

typedef struct {
    SegBox *box;
    double tolerance;
    int halvings_left; /* far more than a sound curve takes; whatever it is, this ends */
} Search;

/* The piece's ends are in the box. */
static size_t add_piece(Search *search, Bezier *piece)
{
    if (search->halvings_left == 0 ||
        all_inside(search->box, piece->poles, piece->degree + 1, search->tolerance))
        return 0;
    search->halvings_left--;
    Bezier right;
    halve(piece, &right);
    seg_box_add(search->box, project(right.poles[0]));
    return 1 + add_piece(search, piece) + add_piece(search, &right);
}

/* 1e-10 of the curve's size, but not less than what rounding leaves of its coordinates. */
static double box_tolerance(const SegCurve *curve, const SegCurveTables *c)
{
    SegBox hull = SEG_BOX_EMPTY;
    for (int i = 0; i < curve->n_poles; i++) {
        const double *p = c->poles + (ptrdiff_t)i * curve->dim;
        seg_box_add(&hull, seg_vec3(p[0], p[1], curve->dim == 3 ? p[2] : 0));
    }
    return 1e-10 * seg_box_diagonal(&hull) + 1e-14 * (seg_norm(hull.min) + seg_norm(hull.max));
}

size_t seg_curve_box(const SegPart *part, const SegCurve *curve, double a, double b, SegBox *box)
{
    const int most_halvings = 1000;
    seg_box_add(box, seg_curve_evaluate(part, curve, a, NULL));
    seg_box_add(box, seg_curve_evaluate(part, curve, b, NULL));
    SegCurveTables c = seg_curve_tables(part->reals, curve);
    Search search = {box, box_tolerance(curve, &c), 0};
    int p = curve->degree, n = curve->n_poles;
    size_t n_points = 0;
    for (int i = seg_knot_span(c.knots, p, n, a); i < n && c.knots[i] < b; i++) {
        double from = fmax(a, c.knots[i]), to = fmin(b, c.knots[i + 1]);
        if (!(from < to))
            continue;
        Pole local[SEG_MAX_DEGREE + 1];
        local_poles(curve, &c, i, local);
        if (all_inside(box, local, p + 1, search.tolerance))
            continue;
        Bezier piece = {.degree = p};
        for (int k = 0; k <= p; k++)
            piece.poles[k] = blossom(c.knots, p, i, local, from, to, k);
        seg_box_add(box, project(piece.poles[0]));
        seg_box_add(box, project(piece.poles[p]));
        search.halvings_left = most_halvings;
        n_points += (i > p) + add_piece(&search, &piece);
    }
    return n_points;
}
