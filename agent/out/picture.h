/* SPDX-License-Identifier: Apache-2.0 */
/* regions.png: the part seen from above and one corner, a colour a region, with a legend. */
#ifndef AGENT_OUT_PICTURE_H
#define AGENT_OUT_PICTURE_H

#include "segcore/segcore.h"

/* PNG bytes. Errors: AGENT_ERROR_OUTPUT. */
GBytes *agent_regions_png(const SegPart *part, const SegSegmentation *segmentation, GError **error);

#endif
