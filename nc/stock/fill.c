/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/fill.h"

void nc_fill_begin(NcFill *fill, NcStock *stock, int axis)
{
    const NcDexelField *field = &stock->field[axis];
    nc_fill_begin_tile(fill, stock, axis, 0);
    fill->end_tile = field->n_tiles[0] * field->n_tiles[1];
}

void nc_fill_begin_tile(NcFill *fill, NcStock *stock, int axis, int32_t tile)
{
    *fill = (NcFill){.stock = stock,
                     .axis = axis,
                     .tile_index = tile - 1,
                     .end_tile = tile + 1,
                     .ray = NC_TILE_RAYS - 1};
}

bool nc_fill_next(NcFill *fill)
{
    const NcDexelField *field = &fill->stock->field[fill->axis];
    do {
        if (++fill->ray == NC_TILE_RAYS) {
            if (fill->tile)
                nc_dexel_tile_occupy(fill->stock, fill->axis, fill->tile);
            if (++fill->tile_index == fill->end_tile)
                return false;
            fill->ray = 0;
            fill->tile = &field->tiles[fill->tile_index];
        }
        fill->tile->first[fill->ray + 1] = fill->tile->first[fill->ray];
        fill->u = fill->tile_index % field->n_tiles[0] * NC_TILE + fill->ray % NC_TILE;
        fill->v = fill->tile_index / field->n_tiles[0] * NC_TILE + fill->ray / NC_TILE;
    } while (fill->u >= field->n_rays[0] || fill->v >= field->n_rays[1]);
    fill->origin = nc_dexel_origin(fill->stock, fill->axis, fill->u, fill->v);
    return true;
}

void nc_fill_segment(NcFill *fill, NcDexelEnd in, NcDexelEnd out)
{
    if (in.depth >= out.depth)
        return;
    uint32_t at = fill->tile->first[fill->ray + 1];
    nc_dexel_reserve(fill->tile, MAX(at + 2, 2 * NC_TILE_RAYS));
    fill->tile->ends[at] = in;
    fill->tile->ends[at + 1] = out;
    fill->tile->first[fill->ray + 1] = at + 2;
}

SegVec3 nc_fill_node(const NcFill *fill, int32_t node)
{
    return nc_dexel_point(fill->axis, fill->origin,
                          nc_dexel_node_mm(fill->stock, fill->axis, node));
}
