/* SPDX-License-Identifier: Apache-2.0 */
/* Method "none": the whole part is one region. */
#include "segcore/methods/region.h"

SegSegmentation *seg_segment_none(const SegPart *part, GError **error)
{
    if (part->n_faces == 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%s: the part has no face",
                    part->path ? part->path : "part");
        return NULL;
    }
    SegFeatureSizeParams exact = SEG_FEATURE_SIZE_DEFAULTS;
    g_autofree SegFaceMeasure *measures = seg_measure_faces(part, &exact);
    g_autofree int32_t *faces = g_new(int32_t, (size_t)part->n_faces);
    for (int32_t i = 0; i < part->n_faces; i++)
        faces[i] = i;

    SegSegmentation *segmentation = g_new0(SegSegmentation, 1);
    segmentation->method = g_strdup("none");
    segmentation->parameters = g_new0(char *, 1);
    segmentation->regions = g_new0(SegRegion, 1);
    segmentation->n_regions = 1;
    SegRegion *region = &segmentation->regions[0];
    region->id = 1;
    region->name = g_strdup("part");
    region->kind = SEG_REGION_REST;
    seg_region_fill(region, part, measures, faces, NULL, (size_t)part->n_faces);
    return segmentation;
}
