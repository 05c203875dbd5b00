/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/dexel.h"

NcStock *nc_stock_copy(const NcStock *stock)
{
    NcStock *copy = g_memdup2(stock, sizeof *stock);
    copy->cuts = g_memdup2(stock->cuts, stock->n_cuts * sizeof *stock->cuts);
    copy->cuts_capacity = stock->n_cuts;
    for (int axis = 0; axis < 3; axis++) {
        NcDexelField *field = &copy->field[axis];
        const size_t n_tiles = (size_t)field->n_tiles[0] * (size_t)field->n_tiles[1];
        field->tiles = g_memdup2(field->tiles, n_tiles * sizeof *field->tiles);
        for (size_t t = 0; t < n_tiles; t++) {
            NcDexelTile *tile = &field->tiles[t];
            tile->capacity = tile->first[NC_TILE_RAYS];
            tile->ends = g_memdup2(tile->ends, tile->capacity * sizeof *tile->ends);
        }
    }
    return copy;
}
