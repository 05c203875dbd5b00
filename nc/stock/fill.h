/* SPDX-License-Identifier: Apache-2.0 */
/* Material for the rays of one axis, ray by ray, in a stock that has none there. */
#ifndef NC_STOCK_FILL_H
#define NC_STOCK_FILL_H

#include "nc/stock/dexel.h"

typedef struct {
    NcStock *stock;
    int axis;
    int32_t u, v;                 /* of the ray */
    SegVec3 origin;               /* on it, where its own coordinate is 0 */
    NcDexelTile *tile;            /* it belongs to */
    int32_t tile_index, end_tile; /* internal, as is the next */
    int ray;
} NcFill;

/* for (nc_fill_begin(&fill, …); nc_fill_next(&fill);) is once for each ray. */
void nc_fill_begin(NcFill *fill, NcStock *stock, int axis);
bool nc_fill_next(NcFill *fill);

/* The same for the rays of one tile: tiles may be filled from several threads. */
void nc_fill_begin_tile(NcFill *fill, NcStock *stock, int axis, int32_t tile);

/* Appends a segment to the ray; ascending. One that is empty is left out. */
void nc_fill_segment(NcFill *fill, NcDexelEnd in, NcDexelEnd out);

/* The ray's point at this node. */
SegVec3 nc_fill_node(const NcFill *fill, int32_t node);

#endif
