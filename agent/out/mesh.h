/* SPDX-License-Identifier: Apache-2.0 */
/* regions.obj: the part's tessellation, a group a region, in mm and the part's coordinates. */
#ifndef AGENT_OUT_MESH_H
#define AGENT_OUT_MESH_H

#include "segcore/segcore.h"

/* Wavefront OBJ text; caller frees. */
char *agent_regions_obj(const SegPart *part, const SegSegmentation *segmentation);

#endif
