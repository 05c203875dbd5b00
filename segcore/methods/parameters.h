/* SPDX-License-Identifier: Apache-2.0 */
/* What was in force, as a segmentation records it. */
#ifndef SEGCORE_METHODS_PARAMETERS_H
#define SEGCORE_METHODS_PARAMETERS_H

#include "segcore/segcore.h"

/* "key=value", sorted by key, NULL-terminated; caller frees with g_strfreev. */
char **seg_feature_size_parameters(const SegFeatureSizeParams *params);

#endif
