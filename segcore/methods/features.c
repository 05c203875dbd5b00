/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/methods/features.h"

#include <stdlib.h>

typedef struct {
    double area_mm2;
    int32_t first_face; /* lowest */
    int32_t kind;
    size_t first, n; /* its faces' areas, descending */
} Feature;

static void join_touching(const bool *is_local, int32_t n_faces, const GArray *adjacency,
                          int32_t *root);
static GArray *collect_features(const bool *is_local, int32_t n_faces,
                                const SegFaceMeasure *measures, int32_t *root, double *areas);
static int32_t number_kinds(Feature *features, size_t n, const double *areas, double tolerance);

int32_t seg_group_features(const bool *is_local, int32_t n_faces, const SegFaceMeasure *measures,
                           const GArray *adjacency, double tolerance, int32_t *kind)
{
    g_autofree int32_t *root = g_new(int32_t, (size_t)n_faces);
    g_autofree double *areas = g_new(double, (size_t)n_faces);
    join_touching(is_local, n_faces, adjacency, root);
    g_autoptr(GArray) features = collect_features(is_local, n_faces, measures, root, areas);
    Feature *all = (Feature *)(void *)features->data;
    int32_t n_kinds = number_kinds(all, features->len, areas, tolerance);

    /* A feature is known by its lowest face, which is the root of all. */
    g_autofree int32_t *kind_of = g_new0(int32_t, (size_t)n_faces);
    for (guint i = 0; i < features->len; i++)
        kind_of[all[i].first_face] = all[i].kind;
    for (int32_t f = 0; f < n_faces; f++)
        kind[f] = is_local[f] ? kind_of[root[f]] : 0;
    return n_kinds;
}

static int32_t find_root(int32_t *root, int32_t face)
{
    while (root[face] != face)
        face = root[face] = root[root[face]];
    return face;
}

/* Union of what touches; afterwards root[face] is the lowest face of its feature. */
static void join_touching(const bool *is_local, int32_t n_faces, const GArray *adjacency,
                          int32_t *root)
{
    for (int32_t f = 0; f < n_faces; f++)
        root[f] = f;
    for (guint i = 0; i < adjacency->len; i++) {
        const SegFacePair *pair = &g_array_index(adjacency, SegFacePair, i);
        if (!is_local[pair->a] || !is_local[pair->b])
            continue;
        int32_t a = find_root(root, pair->a), b = find_root(root, pair->b);
        root[MAX(a, b)] = MIN(a, b);
    }
    for (int32_t f = 0; f < n_faces; f++)
        root[f] = find_root(root, f);
}

static int compare_descending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x < y) - (x > y);
}

static int compare_features(const void *a, const void *b)
{
    const Feature *p = a, *q = b;
    if (p->area_mm2 != q->area_mm2)
        return (p->area_mm2 < q->area_mm2) - (p->area_mm2 > q->area_mm2);
    return (p->first_face > q->first_face) - (p->first_face < q->first_face);
}

/* Features by descending area; their faces' areas, sorted, in `areas`. */
static GArray *collect_features(const bool *is_local, int32_t n_faces,
                                const SegFaceMeasure *measures, int32_t *root, double *areas)
{
    GArray *features = g_array_new(FALSE, FALSE, sizeof(Feature));
    g_autofree int32_t *index = g_new(int32_t, (size_t)n_faces);
    for (int32_t f = 0; f < n_faces; f++) {
        if (!is_local[f])
            continue;
        if (root[f] == f) {
            Feature fresh = {.first_face = f};
            index[f] = (int32_t)features->len;
            g_array_append_val(features, fresh);
        }
        Feature *feature = &g_array_index(features, Feature, index[root[f]]);
        feature->n++;
        feature->area_mm2 += measures[f].area_mm2;
    }
    size_t next = 0;
    for (guint i = 0; i < features->len; i++) {
        Feature *feature = &g_array_index(features, Feature, i);
        feature->first = next;
        next += feature->n;
        feature->n = 0;
    }
    for (int32_t f = 0; f < n_faces; f++)
        if (is_local[f]) {
            Feature *feature = &g_array_index(features, Feature, index[root[f]]);
            areas[feature->first + feature->n++] = measures[f].area_mm2;
        }
    for (guint i = 0; i < features->len; i++) {
        const Feature *feature = &g_array_index(features, Feature, i);
        qsort(areas + feature->first, feature->n, sizeof *areas, compare_descending);
    }
    g_array_sort(features, compare_features);
    return features;
}

static bool is_alike(const Feature *a, const Feature *b, const double *areas, double tolerance)
{
    if (a->n != b->n)
        return false;
    for (size_t i = 0; i < a->n; i++) {
        double x = areas[a->first + i], y = areas[b->first + i];
        if (fabs(x - y) > tolerance * x)
            return false;
    }
    return true;
}

/* As classes of faces are: the largest opens a kind and takes those that are like itself. */
static int32_t number_kinds(Feature *features, size_t n, const double *areas, double tolerance)
{
    int32_t n_kinds = 0;
    for (size_t i = 0; i < n; i++) {
        if (features[i].kind != 0)
            continue;
        features[i].kind = ++n_kinds;
        for (size_t k = i + 1;
             k < n && features[k].area_mm2 >= (1 - tolerance) * features[i].area_mm2; k++)
            if (features[k].kind == 0 && is_alike(&features[i], &features[k], areas, tolerance))
                features[k].kind = n_kinds;
    }
    return n_kinds;
}
