/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/methods/classes.h"

#include <stdlib.h>

/* Lengths that rounding alone makes differ: as a part of the diagonal. */
static const double ROUNDING = 1e-9;

typedef struct {
    int32_t face;
    const SegFeatureSize *size;
} Patch;

static size_t sort_patches(const SegFeatureSize *sizes, int32_t n_faces, double least_mm,
                           Patch *patches);
static void open_classes(const Patch *patches, size_t n, const SegFeatureSizeParams *params,
                         SegClasses *classes);
static bool reassign(const SegFeatureSize *sizes, int32_t n_faces,
                     const SegFeatureSizeParams *params, SegClasses *classes, GError **error);

bool seg_classify(const SegFeatureSize *sizes, int32_t n_faces, const SegFeatureSizeParams *params,
                  SegClasses *classes, GError **error)
{
    g_autofree Patch *patches = g_new(Patch, (size_t)n_faces);
    size_t n = sort_patches(sizes, n_faces, params->min_size_mm, patches);
    classes->tag = g_new0(int32_t, (size_t)n_faces);
    classes->opening_mm = g_new0(double, (size_t)n_faces + params->n_reassign);
    classes->n_tags = 0;
    open_classes(patches, n, params, classes);
    return reassign(sizes, n_faces, params, classes, error);
}

void seg_classes_clear(SegClasses *classes)
{
    g_clear_pointer(&classes->tag, g_free);
    g_clear_pointer(&classes->opening_mm, g_free);
}

static int compare_patches(const void *a, const void *b)
{
    const Patch *p = a, *q = b;
    double x = p->size->diagonal_mm, y = q->size->diagonal_mm;
    return x != y ? (x < y) - (x > y) : (p->face > q->face) - (p->face < q->face);
}

static size_t sort_patches(const SegFeatureSize *sizes, int32_t n_faces, double least_mm,
                           Patch *patches)
{
    size_t n = 0;
    for (int32_t i = 0; i < n_faces; i++)
        if (sizes[i].diagonal_mm >= least_mm)
            patches[n++] = (Patch){i, &sizes[i]};
    qsort(patches, n, sizeof *patches, compare_patches);
    return n;
}

/* Does `b` belong to the class that `a`, not smaller, has opened? */
static bool is_similar(const SegFeatureSize *a, const SegFeatureSize *b, double tolerance)
{
    return a->diagonal_mm - b->diagonal_mm <= (tolerance + ROUNDING) * a->diagonal_mm;
}

static bool is_near(double a, double b, double tolerance, double rounding)
{
    return fabs(a - b) <= tolerance * a + rounding;
}

static bool is_similar_in_subsets(const SegFeatureSize *a, const SegFeatureSize *b,
                                  double tolerance)
{
    double rounding = ROUNDING * a->diagonal_mm;
    return is_near(a->length_mm, b->length_mm, tolerance, rounding) &&
           is_near(a->width_mm, b->width_mm, tolerance, rounding) &&
           is_near(a->height_mm, b->height_mm, tolerance, rounding);
}

static void put_into(SegClasses *classes, const Patch *patch, int32_t tag)
{
    classes->tag[patch->face] = tag;
    double *opening_mm = &classes->opening_mm[tag - 1];
    *opening_mm = fmax(*opening_mm, patch->size->diagonal_mm);
}

/* Divides one class, sorted, until each member is near the one that opened its part. */
static void subdivide(const Patch *patches, size_t n, double tolerance, SegClasses *classes)
{
    for (size_t i = 0; i < n; i++) {
        if (classes->tag[patches[i].face] != 0)
            continue;
        int32_t tag = ++classes->n_tags;
        for (size_t k = i; k < n; k++)
            if (classes->tag[patches[k].face] == 0 &&
                (tolerance <= 0 ||
                 is_similar_in_subsets(patches[i].size, patches[k].size, tolerance)))
                put_into(classes, &patches[k], tag);
    }
}

static void open_classes(const Patch *patches, size_t n, const SegFeatureSizeParams *params,
                         SegClasses *classes)
{
    size_t end;
    for (size_t i = 0; i < n; i = end) {
        for (end = i + 1; end < n; end++)
            if (!is_similar(patches[i].size, patches[end].size, params->tolerance))
                break;
        subdivide(patches + i, end - i, params->subset_tolerance, classes);
    }
}

/* By hand: a tag one above the largest opens a class. */
static bool reassign(const SegFeatureSize *sizes, int32_t n_faces,
                     const SegFeatureSizeParams *params, SegClasses *classes, GError **error)
{
    for (size_t i = 0; i < params->n_reassign; i++) {
        int32_t face = params->reassign[i][0], tag = params->reassign[i][1];
        if (face < 0 || face >= n_faces || classes->tag[face] == 0) {
            g_set_error(
                error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                "reassign %d:%d: there is no face %d (0…%d), or it was dropped as too small", face,
                tag, face, n_faces - 1);
            return false;
        }
        if (tag < 1 || tag > classes->n_tags + 1) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                        "reassign %d:%d: tags are 1…%d; %d opens a new class", face, tag,
                        classes->n_tags, classes->n_tags + 1);
            return false;
        }
        bool opens = tag > classes->n_tags;
        classes->n_tags = MAX(classes->n_tags, tag);
        classes->tag[face] = tag;
        if (opens)
            classes->opening_mm[tag - 1] = sizes[face].diagonal_mm;
    }
    return true;
}
