/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_TOOLPATH_SMOOTH_H
#define NC_TOOLPATH_SMOOTH_H

#include "nc/toolpath/trace.h"

/* Takes the points out of the pieces that the chord share does not need, then proves every move by
 * the swept cutter and puts points back, or lifts them, where it would gouge. */
void nc_smooth(const NcTrace *trace, GArray *pieces);

#endif
