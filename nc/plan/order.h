/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_PLAN_ORDER_H
#define NC_PLAN_ORDER_H

#include "nc/toolpath/trace.h"

/*
 * Puts the pieces in the order in which the tool spends least on the way between them: nearest
 * neighbour from the first piece, then 2-opt (Croes 1958) within a window. Unless `one_way`, pieces
 * may be turned round. A way longer than `reach_mm` costs `lift_mm` more.
 */
void nc_order_pieces(GArray *pieces, bool one_way, double reach_mm, double lift_mm);

#endif
