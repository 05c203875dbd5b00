/* SPDX-License-Identifier: Apache-2.0 */
/* Local features: what faces that were chosen as local form together. */
#ifndef SEGCORE_METHODS_FEATURES_H
#define SEGCORE_METHODS_FEATURES_H

#include "segcore/methods/region.h"

/*
 * Local faces that touch are one feature (the top, the fillet and the wall of a boss). Features of
 * one kind (as many faces, which agree in area one by one within `tolerance`, relative: the
 * blades of a wheel, however they are turned) share a region. Writes to kind[face] the number of
 * its kind from 1, largest area of a feature first; 0 where is_local is false. Returns their
 * number.
 */
int32_t seg_group_features(const bool *is_local, int32_t n_faces, const SegFaceMeasure *measures,
                           const GArray *adjacency, double tolerance, int32_t *kind);

#endif
