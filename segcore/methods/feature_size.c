/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Method "feature-size" (P0): faces are classed by the size of their boundaries, the local features
 * are taken out, and the rest is the remaining area.
 */
#include "segcore/methods/classes.h"
#include "segcore/methods/features.h"
#include "segcore/methods/parameters.h"
#include "segcore/methods/region.h"

static bool check_part(const SegPart *part, GError **error);
static bool check_params(const SegFeatureSizeParams *params, GError **error);
static bool choose_local(const SegPart *part, const SegFeatureSizeParams *params,
                         const SegClasses *classes, bool *is_local, GError **error);
static void make_regions(SegSegmentation *segmentation, const SegPart *part,
                         const SegFeatureSizeParams *params, const SegFaceMeasure *measures,
                         const SegClasses *classes, const bool *is_local);
static void list_dropped(SegSegmentation *segmentation, const SegFeatureSize *sizes,
                         const SegClasses *classes, int32_t n_faces, double min_size_mm);

SegSegmentation *seg_segment_feature_size(const SegPart *part, const SegFeatureSizeParams *params,
                                          GError **error)
{
    if (!check_part(part, error) || !check_params(params, error))
        return NULL;
    size_t n = (size_t)part->n_faces;
    SegFeatureSizeParams in_force = *params;
    in_force.datum_mm = seg_datum_mm(part, params);
    g_autofree SegFaceMeasure *measures = seg_measure_faces(part, &in_force);
    g_autofree SegFeatureSize *sizes = g_new(SegFeatureSize, n);
    for (size_t i = 0; i < n; i++)
        sizes[i] = seg_size_of_box(&measures[i].box);

    g_auto(SegClasses) classes = {0};
    g_autofree bool *is_local = g_new0(bool, n);
    if (!seg_classify(sizes, part->n_faces, &in_force, &classes, error) ||
        !choose_local(part, &in_force, &classes, is_local, error))
        return NULL;
    if (classes.n_tags == 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                    "min_size_mm %g drops every face of the part; make it smaller",
                    params->min_size_mm);
        return NULL;
    }
    SegSegmentation *segmentation = g_new0(SegSegmentation, 1);
    segmentation->method = g_strdup("feature-size");
    segmentation->parameters = seg_feature_size_parameters(&in_force);
    make_regions(segmentation, part, &in_force, measures, &classes, is_local);
    list_dropped(segmentation, sizes, &classes, part->n_faces, in_force.min_size_mm);
    return segmentation;
}

/* ------------------------------------------------------------------ what was asked for */

static bool check_part(const SegPart *part, GError **error)
{
    const char *path = part->path ? part->path : "part";
    if (part->n_faces == 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%s: the part has no face", path);
        return false;
    }
    if (part->faces[0].type != SEG_SURFACE_MESH)
        return true;
    g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                "%s: a mesh has no faces to tell apart by feature size; use the method none", path);
    return false;
}

static bool check_params(const SegFeatureSizeParams *params, GError **error)
{
    const struct {
        const char *key;
        double value, least, most;
    } ranges[] = {
        {"tolerance", params->tolerance, 0, 1},
        {"subset_tolerance", params->subset_tolerance, 0, 1},
        {"local_ratio", params->local_ratio, 0, 1},
        {"min_size_mm", params->min_size_mm, 0, G_MAXDOUBLE},
        {"datum_mm", params->datum_mm, 0, G_MAXDOUBLE},
        {"points", params->points, 0, 10000},
        {"repair", (int)params->repair, SEG_REPAIR_EXACT, SEG_REPAIR_POINTS},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(ranges); i++)
        if (!(ranges[i].value >= ranges[i].least && ranges[i].value <= ranges[i].most)) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT, "%s is %g, expected %g…%g",
                        ranges[i].key, ranges[i].value, ranges[i].least, ranges[i].most);
            return false;
        }
    return true;
}

/* ------------------------------------------------------------------ local or rest */

/* Tags whose class opens at `ratio` of the largest class, or below. */
static void choose_by_ratio(const SegClasses *classes, double ratio, bool *is_local_tag)
{
    double largest_mm = 0;
    for (int32_t t = 0; t < classes->n_tags; t++)
        largest_mm = fmax(largest_mm, classes->opening_mm[t]);
    for (int32_t t = 0; t < classes->n_tags; t++)
        is_local_tag[t] = classes->opening_mm[t] <= ratio * largest_mm;
}

/* Tags and faces that were named are what was meant; the ratio chooses where none were. */
static bool choose_local(const SegPart *part, const SegFeatureSizeParams *params,
                         const SegClasses *classes, bool *is_local, GError **error)
{
    g_autofree bool *is_local_tag = g_new0(bool, (size_t)classes->n_tags);
    for (size_t i = 0; i < params->n_local_tags; i++) {
        int32_t tag = params->local_tags[i];
        if (tag < 1 || tag > classes->n_tags) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                        "local_tags %d: the part has the tags 1…%d", tag, classes->n_tags);
            return false;
        }
        is_local_tag[tag - 1] = true;
    }
    if (params->n_local_tags == 0 && params->n_local_faces == 0 && params->local_ratio > 0)
        choose_by_ratio(classes, params->local_ratio, is_local_tag);
    for (int32_t f = 0; f < part->n_faces; f++)
        is_local[f] = classes->tag[f] > 0 && is_local_tag[classes->tag[f] - 1];
    for (size_t i = 0; i < params->n_local_faces; i++) {
        int32_t face = params->local_faces[i];
        if (face < 0 || face >= part->n_faces || classes->tag[face] == 0) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                        "local_faces %d: there is no such face (0…%d), or it was dropped as too "
                        "small",
                        face, part->n_faces - 1);
            return false;
        }
        is_local[face] = true;
    }
    return true;
}

/* ------------------------------------------------------------------ regions */

/* Numbers the regions: the rest (one, or one a class), then the kinds of local features. */
typedef struct {
    int32_t *of_face; /* index of its region, -1: dropped */
    int32_t n, n_rest;
    int32_t *rest_tag; /* of the rest's regions, 0: all classes */
} Plan;

static Plan plan_regions(const SegPart *part, const SegFeatureSizeParams *params,
                         const SegFaceMeasure *measures, const SegClasses *classes,
                         const bool *is_local, const GArray *adjacency)
{
    size_t n_faces = (size_t)part->n_faces, n_tags = (size_t)classes->n_tags;
    Plan plan = {.of_face = g_new(int32_t, n_faces), .rest_tag = g_new0(int32_t, n_tags)};
    g_autofree int32_t *kind = g_new(int32_t, n_faces);
    int32_t n_kinds =
        seg_group_features(is_local, part->n_faces, measures, adjacency, params->tolerance, kind);
    g_autofree int32_t *rest_of_tag = g_new(int32_t, n_tags);
    for (size_t t = 0; t < n_tags; t++)
        rest_of_tag[t] = -1;
    for (int32_t f = 0; f < part->n_faces; f++)
        if (classes->tag[f] > 0 && !is_local[f])
            rest_of_tag[classes->tag[f] - 1] = 0;
    for (int32_t t = 0; t < classes->n_tags; t++)
        if (rest_of_tag[t] == 0 && (params->split_rest || plan.n_rest == 0)) {
            rest_of_tag[t] = plan.n_rest;
            plan.rest_tag[plan.n_rest++] = params->split_rest ? t + 1 : 0;
        }
    plan.n = plan.n_rest + n_kinds;
    for (int32_t f = 0; f < part->n_faces; f++) {
        int32_t tag = classes->tag[f];
        plan.of_face[f] = tag == 0      ? -1
                          : is_local[f] ? plan.n_rest + kind[f] - 1
                                        : rest_of_tag[tag - 1];
    }
    return plan;
}

static char *region_name(const Plan *plan, int32_t index)
{
    if (index >= plan->n_rest)
        return g_strdup_printf("local-%d", index - plan->n_rest + 1);
    if (plan->rest_tag[index] == 0)
        return g_strdup("rest");
    return g_strdup_printf("rest-%d", plan->rest_tag[index]);
}

static void make_regions(SegSegmentation *segmentation, const SegPart *part,
                         const SegFeatureSizeParams *params, const SegFaceMeasure *measures,
                         const SegClasses *classes, const bool *is_local)
{
    g_autoptr(GArray) adjacency = part->adjacency
                                      ? g_array_ref(part->adjacency)
                                      : seg_part_adjacency(part, seg_part_touch_mm(part));
    Plan plan = plan_regions(part, params, measures, classes, is_local, adjacency);
    segmentation->n_regions = (size_t)plan.n;
    segmentation->regions = g_new0(SegRegion, segmentation->n_regions);

    /* Faces by region, ascending: counted, then dealt out. */
    g_autofree size_t *end = g_new0(size_t, segmentation->n_regions + 1);
    g_autofree int32_t *faces = g_new(int32_t, (size_t)part->n_faces);
    g_autofree int32_t *tags = g_new(int32_t, (size_t)part->n_faces);
    for (int32_t f = 0; f < part->n_faces; f++)
        if (plan.of_face[f] >= 0)
            end[plan.of_face[f] + 1]++;
    for (int32_t r = 0; r < plan.n; r++)
        end[r + 1] += end[r];
    for (int32_t f = 0; f < part->n_faces; f++)
        if (plan.of_face[f] >= 0) {
            size_t at = end[plan.of_face[f]]++;
            faces[at] = f;
            tags[at] = classes->tag[f];
        }
    for (int32_t r = 0; r < plan.n; r++) {
        SegRegion *region = &segmentation->regions[r];
        size_t first = r > 0 ? end[r - 1] : 0;
        region->id = r + 1;
        region->name = region_name(&plan, r);
        region->kind = r < plan.n_rest ? SEG_REGION_REST : SEG_REGION_LOCAL;
        seg_region_fill(region, part, measures, faces + first, tags + first, end[r] - first);
    }
    seg_regions_connect(segmentation->regions, segmentation->n_regions, adjacency, plan.of_face);
    g_free(plan.of_face);
    g_free(plan.rest_tag);
}

static void list_dropped(SegSegmentation *segmentation, const SegFeatureSize *sizes,
                         const SegClasses *classes, int32_t n_faces, double min_size_mm)
{
    g_autoptr(GArray) dropped = g_array_new(FALSE, FALSE, sizeof(SegDropped));
    for (int32_t f = 0; f < n_faces; f++) {
        if (classes->tag[f] != 0)
            continue;
        SegDropped entry = {f, g_strdup_printf("its size %.6g mm is below min_size_mm %.6g",
                                               sizes[f].diagonal_mm, min_size_mm)};
        g_array_append_val(dropped, entry);
    }
    segmentation->n_dropped = dropped->len;
    segmentation->dropped = (SegDropped *)(void *)g_array_free(g_steal_pointer(&dropped), FALSE);
}
