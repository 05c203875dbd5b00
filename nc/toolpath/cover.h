/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_TOOLPATH_COVER_H
#define NC_TOOLPATH_COVER_H

#include "nc/toolpath/trace.h"

/*
 * Area of the reached samples over which more than `height_mm` of stock stands after the pieces
 * have been cut: the point that high above the sample was never inside the moving cutter.
 */
double nc_cover_left_mm2(const NcTrace *trace, const GArray *pieces, double height_mm,
                         const uint8_t *reached);

#endif
