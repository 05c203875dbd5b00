/* SPDX-License-Identifier: Apache-2.0 */
/* STL, ascii and binary, and OFF. */
#include "segcore/segcore.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    g_autoptr(SegPart) part = seg_part_from_mesh(data, size, "mesh", NULL);
    if (part)
        seg_segmentation_free(seg_segment_none(part, NULL));
    return 0;
}
