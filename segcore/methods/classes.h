/* SPDX-License-Identifier: Apache-2.0 */
/* Classes of faces by feature size (P0 §2.3). */
#ifndef SEGCORE_METHODS_CLASSES_H
#define SEGCORE_METHODS_CLASSES_H

#include "segcore/segcore.h"

typedef struct {
    int32_t *tag;       /* a face: from 1; 0: dropped as too small */
    double *opening_mm; /* a tag, at [tag - 1]: first size of the class's largest member */
    int32_t n_tags;     /* 0 where a class is empty after reassignment: opening_mm 0 */
} SegClasses;

/*
 * Drops the faces below the limit size, sorts the rest by first size, descending, and opens a class
 * with the largest that has none, which takes those within `tolerance` of itself; then within
 * each class the same by length, width and height, where `subset_tolerance` is given; then moves
 * faces by hand. Tags follow the order of opening: 1 is the largest.
 * Errors: SEG_ERROR_ARGUMENT for a face or tag that does not exist.
 */
bool seg_classify(const SegFeatureSize *sizes, int32_t n_faces, const SegFeatureSizeParams *params,
                  SegClasses *classes, GError **error);

void seg_classes_clear(SegClasses *classes);
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(SegClasses, seg_classes_clear)

#endif
