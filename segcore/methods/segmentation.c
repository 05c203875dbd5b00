/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/segcore.h"

static void clear_region(SegRegion *region)
{
    for (size_t i = 0; i < region->n_pieces; i++) {
        SegPiece *piece = &region->pieces[i];
        for (size_t k = 0; k < piece->n_loops; k++)
            g_free(piece->loops[k].uv);
        g_free(piece->loops);
    }
    g_free(region->name);
    g_free(region->pieces);
    g_free(region->triangles);
    g_free(region->neighbours);
}

void seg_segmentation_free(SegSegmentation *segmentation)
{
    if (!segmentation)
        return;
    for (size_t i = 0; i < segmentation->n_regions; i++)
        clear_region(&segmentation->regions[i]);
    for (size_t i = 0; i < segmentation->n_dropped; i++)
        g_free(segmentation->dropped[i].reason);
    g_free(segmentation->method);
    g_strfreev(segmentation->parameters);
    g_free(segmentation->regions);
    g_free(segmentation->dropped);
    g_free(segmentation);
}

const char *seg_region_kind_name(SegRegionKind kind)
{
    static const char *const names[SEG_N_REGION_KINDS] = {
        [SEG_REGION_CONVEX] = "convex",   [SEG_REGION_CONCAVE] = "concave",
        [SEG_REGION_SADDLE] = "saddle",   [SEG_REGION_FLAT] = "flat",
        [SEG_REGION_LOCAL] = "local",     [SEG_REGION_REST] = "rest",
        [SEG_REGION_FEATURE] = "feature",
    };
    return kind >= 0 && kind < SEG_N_REGION_KINDS ? names[kind] : "rest";
}
