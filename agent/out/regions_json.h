/* SPDX-License-Identifier: Apache-2.0 */
/* regions.json: docs/schema/regions.json. */
#ifndef AGENT_OUT_REGIONS_JSON_H
#define AGENT_OUT_REGIONS_JSON_H

#include "segcore/segcore.h"

/* The text; caller frees. */
char *agent_regions_json(const SegPart *part, const SegSegmentation *segmentation);

#endif
