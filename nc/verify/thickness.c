/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/verify/thickness.h"

#include <stdlib.h>

#include "nc/motion/path.h"

#define LEAF 4
#define DEPTH_MOST 64

/* A box with its facets: leaves have them in order[first … first + n), branches two children, the
 * next node and `second`. */
typedef struct {
    double low[3], high[3];
    size_t first, n, second;
} Node;

struct NcThickness {
    const NcPatch *facets;
    const SegPart *part;
    size_t *order;
    GArray *nodes;
};

static size_t build(NcThickness *thickness, size_t first, size_t n);

NcThickness *nc_thickness_new(const NcPatch *facets, size_t n, const SegPart *part)
{
    NcThickness *thickness = g_new0(NcThickness, 1);
    thickness->facets = facets;
    thickness->part = part;
    thickness->order = g_new(size_t, n + 1);
    thickness->nodes = g_array_new(FALSE, FALSE, sizeof(Node));
    for (size_t i = 0; i < n; i++)
        thickness->order[i] = i;
    if (n > 0)
        build(thickness, 0, n);
    return thickness;
}

void nc_thickness_free(NcThickness *thickness)
{
    if (!thickness)
        return;
    g_free(thickness->order);
    g_array_unref(thickness->nodes);
    g_free(thickness);
}

/* -------------------------------------------------------------------------- tree */

static double middle(const NcPatch *f, int axis)
{
    return nc_axis_value(f->a, axis) + nc_axis_value(f->b, axis) + nc_axis_value(f->c, axis);
}

typedef struct {
    const NcPatch *facets;
    int axis;
} Order;

static gint by_middle(gconstpointer a, gconstpointer b, gpointer data)
{
    const Order *order = data;
    size_t i = *(const size_t *)a, k = *(const size_t *)b;
    double x = middle(&order->facets[i], order->axis), y = middle(&order->facets[k], order->axis);
    return x != y ? (x > y) - (x < y) : (i > k) - (i < k);
}

static size_t build(NcThickness *thickness, size_t first, size_t n)
{
    Node node = {.low = {INFINITY, INFINITY, INFINITY},
                 .high = {-INFINITY, -INFINITY, -INFINITY},
                 .first = first,
                 .n = n};
    for (size_t i = first; i < first + n; i++) {
        const NcPatch *f = &thickness->facets[thickness->order[i]];
        for (int d = 0; d < 3; d++) {
            double a = nc_axis_value(f->a, d), b = nc_axis_value(f->b, d),
                   c = nc_axis_value(f->c, d);
            node.low[d] = fmin(node.low[d], fmin(a, fmin(b, c)));
            node.high[d] = fmax(node.high[d], fmax(a, fmax(b, c)));
        }
    }
    size_t index = thickness->nodes->len;
    g_array_append_val(thickness->nodes, node);
    if (n <= LEAF)
        return index;
    Order order = {thickness->facets, 0};
    for (int d = 1; d < 3; d++)
        if (node.high[d] - node.low[d] > node.high[order.axis] - node.low[order.axis])
            order.axis = d;
    g_qsort_with_data(thickness->order + first, (gint)n, sizeof(size_t), by_middle, &order);
    build(thickness, first, n / 2);
    size_t second = build(thickness, first + n / 2, n - n / 2);
    Node *stored = &g_array_index(thickness->nodes, Node, index);
    stored->n = 0;
    stored->second = second;
    return index;
}

/* --------------------------------------------------------------------------- ray */

typedef struct {
    SegVec3 from, along;
    double least, most;
} Ray;

static bool meets(const Node *node, const Ray *ray)
{
    double from = ray->least, to = ray->most;
    for (int d = 0; d < 3; d++) {
        double p = nc_axis_value(ray->from, d), v = nc_axis_value(ray->along, d);
        if (v == 0) {
            if (p < node->low[d] || p > node->high[d])
                return false;
            continue;
        }
        double a = (node->low[d] - p) / v, b = (node->high[d] - p) / v;
        from = fmax(from, fmin(a, b));
        to = fmin(to, fmax(a, b));
    }
    return from <= to;
}

/* Möller and Trumbore 1997. */
static bool crosses(const NcPatch *facet, const Ray *ray, double *at)
{
    SegVec3 ab = seg_sub(facet->b, facet->a), ac = seg_sub(facet->c, facet->a);
    SegVec3 p = seg_cross(ray->along, ac);
    double det = seg_dot(ab, p);
    if (det == 0)
        return false;
    SegVec3 t = seg_sub(ray->from, facet->a);
    double u = seg_dot(t, p) / det;
    SegVec3 q = seg_cross(t, ab);
    double v = seg_dot(ray->along, q) / det;
    *at = seg_dot(ac, q) / det;
    return u >= 0 && v >= 0 && u + v <= 1;
}

double nc_thickness_mm(const NcThickness *thickness, SegVec3 point, SegVec3 normal, int32_t face,
                       double most_mm)
{
    double near_mm = 2 * thickness->part->chord_mm + 1e-6;
    Ray ray = {point, seg_scale(normal, -1), -near_mm, most_mm};
    const Node *nodes = (const Node *)(const void *)thickness->nodes->data;
    size_t stack[DEPTH_MOST], depth = 0;
    if (thickness->nodes->len > 0)
        stack[depth++] = 0;
    while (depth > 0) {
        size_t index = stack[--depth];
        const Node *node = &nodes[index];
        if (!meets(node, &ray))
            continue;
        if (node->n == 0) {
            stack[depth++] = node->second;
            stack[depth++] = index + 1;
        }
        for (size_t i = node->first; i < node->first + node->n; i++) {
            const NcPatch *facet = &thickness->facets[thickness->order[i]];
            double at, out = seg_dot(facet->normal, ray.along) * (facet->downward ? -1 : 1);
            bool own = thickness->part->triangles[facet->triangle].face == face;
            if (out > 0 && crosses(facet, &ray, &at) && at < ray.most &&
                at > (own ? near_mm : -near_mm))
                ray.most = at;
        }
    }
    return fmax(ray.most, 0);
}
