/* SPDX-License-Identifier: Apache-2.0 */
/* The part form as it comes from a child process, and what is done with a part that is taken. */
#include "segcore/segcore.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    g_autoptr(GBytes) bytes = g_bytes_new(data, size);
    g_autoptr(SegPart) part = seg_part_from_form(bytes, NULL);
    if (!part)
        return 0;
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    seg_segmentation_free(seg_segment_feature_size(part, &params, NULL));
    seg_segmentation_free(seg_segment_none(part, NULL));
    for (int32_t i = 0; i < part->n_loops; i++)
        g_free(seg_loop_polygon(part, i, 0.5).uv);
    return 0;
}
