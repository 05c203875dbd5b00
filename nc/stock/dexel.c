/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/dexel.h"

#include "nc/stock/sweep.h"

/* Node 0 lies this part of the pitch inside the stock: irrational, so that faces and cuts at round
 * coordinates do not fall on nodes. */
static const double phase[3] = {G_SQRT2 - 1, 1.7320508075688772 - 1, 2.23606797749979 - 2};

static bool lay_grid(NcStock *stock, GError **error)
{
    const double min[3] = {stock->min.x, stock->min.y, stock->min.z};
    const double max[3] = {stock->max.x, stock->max.y, stock->max.z};
    const double most = 1 << 20;
    int32_t largest = 1;
    for (int d = 0; d < 3; d++) {
        double n = ceil((max[d] - min[d]) / stock->pitch_mm - phase[d]);
        if (!(n >= 1) || n > most) {
            g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                        "the stock is %.6g mm along %c, which a pitch of %.6g mm does not fit: %s",
                        max[d] - min[d], "XYZ"[d], stock -> pitch_mm,
                        n > most ? "choose a coarser one" : "choose a finer one");
            return false;
        }
        stock->node_mm[d] = min[d] + phase[d] * stock->pitch_mm;
        stock->n_nodes[d] = (int32_t)n;
        largest = MAX(largest, stock->n_nodes[d]);
    }
    while ((int64_t)(largest + 2) << (stock->shift + 1) < (int64_t)1 << NC_DEXEL_DEPTH_BITS)
        stock->shift++;
    stock->unit_mm = ldexp(stock->pitch_mm, -stock->shift);
    return true;
}

static size_t n_tiles(const NcDexelField *field)
{
    return (size_t)field->n_tiles[0] * (size_t)field->n_tiles[1];
}

/* One segment for each ray, with its share of a tile. */
static uint64_t least_bytes(const NcStock *stock)
{
    uint64_t bytes = sizeof(NcStock);
    for (int d = 0; d < 3; d++)
        bytes += (uint64_t)n_tiles(&stock->field[d]) *
                 (sizeof(NcDexelTile) + 2 * NC_TILE_RAYS * sizeof(NcDexelEnd));
    return bytes;
}

NcStock *nc_stock_alloc(SegVec3 min, SegVec3 max, const NcStockOptions *options, GError **error)
{
    g_autoptr(NcStock) stock = g_new0(NcStock, 1);
    stock->pitch_mm = options->pitch_mm;
    stock->memory_bytes = options->memory_bytes;
    stock->min = min;
    stock->max = max;
    if (!(stock->pitch_mm > 0) || !isfinite(stock->pitch_mm)) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN, "the stock's pitch of %.6g mm is not above 0",
                    stock->pitch_mm);
        return NULL;
    }
    if (!lay_grid(stock, error))
        return NULL;
    for (int d = 0; d < 3; d++)
        for (int k = 0; k < 2; k++) {
            stock->field[d].n_rays[k] = stock->n_nodes[(d + 1 + k) % 3];
            stock->field[d].n_tiles[k] = (stock->field[d].n_rays[k] + NC_TILE - 1) / NC_TILE;
        }
    if (least_bytes(stock) > stock->memory_bytes) {
        g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                    "a stock of %.6g x %.6g x %.6g mm at a pitch of %.6g mm needs %.1f MB and may "
                    "have %.1f MB: choose a coarser pitch",
                    max.x - min.x, max.y - min.y, max.z - min.z, stock->pitch_mm,
                    (double)least_bytes(stock) / 1e6, (double)stock->memory_bytes / 1e6);
        return NULL;
    }
    for (int d = 0; d < 3; d++)
        stock->field[d].tiles = g_new0(NcDexelTile, n_tiles(&stock->field[d]));
    stock->cuts = g_new0(NcCut, 1);
    stock->n_cuts = stock->cuts_capacity = 1;
    return g_steal_pointer(&stock);
}

void nc_stock_free(NcStock *stock)
{
    if (!stock)
        return;
    for (int d = 0; d < 3; d++) {
        for (size_t i = 0; stock->field[d].tiles && i < n_tiles(&stock->field[d]); i++)
            g_free(stock->field[d].tiles[i].ends);
        g_free(stock->field[d].tiles);
    }
    g_free(stock->cuts);
    g_free(stock);
}

uint64_t nc_stock_memory_bytes(const NcStock *stock)
{
    uint64_t bytes = sizeof(NcStock) + stock->cuts_capacity * sizeof(NcCut);
    for (int d = 0; d < 3; d++)
        for (size_t i = 0; i < n_tiles(&stock->field[d]); i++)
            bytes += sizeof(NcDexelTile) + stock->field[d].tiles[i].capacity * sizeof(NcDexelEnd);
    return bytes;
}

void nc_dexel_reserve(NcDexelTile *tile, uint32_t n)
{
    if (n <= tile->capacity)
        return;
    tile->capacity = MAX(n, tile->capacity + tile->capacity / 4);
    tile->ends = g_renew(NcDexelEnd, tile->ends, tile->capacity);
}

bool nc_dexel_near_node(const NcStock *stock, int axis, int32_t depth, SegVec3 normal,
                        int32_t *node)
{
    const double across[3] = {normal.x, normal.y, normal.z};
    double error_mm = stock->unit_mm + 2 * NC_SWEEP_ERROR_MM / fmax(fabs(across[axis]), 1e-6);
    int32_t half = 1 << (stock->shift - 1);
    *node = (depth + half) >> stock->shift;
    return abs(depth - nc_dexel_node_depth(stock, *node)) * stock->unit_mm <= error_mm;
}

void nc_dexel_tile_occupy(const NcStock *stock, int axis, NcDexelTile *tile)
{
    tile->occupied = 0;
    for (uint32_t i = 0; i < tile->first[NC_TILE_RAYS]; i += 2) {
        int from = nc_dexel_part(stock, axis, tile->ends[i].depth);
        int to = nc_dexel_part(stock, axis, tile->ends[i + 1].depth);
        tile->occupied |= (UINT64_MAX << from) & (UINT64_MAX >> (63 - to));
    }
}

/* The mean of what the rays of X, of Y and of Z see; whole numbers, so the order is no matter. */
double nc_stock_volume_mm3(const NcStock *stock)
{
    double sum = 0;
    for (int d = 0; d < 3; d++) {
        int64_t length = 0;
        for (size_t i = 0; i < n_tiles(&stock->field[d]); i++) {
            const NcDexelTile *tile = &stock->field[d].tiles[i];
            for (uint32_t k = 0; k < tile->first[NC_TILE_RAYS]; k += 2)
                length += tile->ends[k + 1].depth - (int64_t)tile->ends[k].depth;
        }
        sum += (double)length * stock->unit_mm;
    }
    return sum / 3 * stock->pitch_mm * stock->pitch_mm;
}

/* --------------------------------------------------------------------------- normals */

#define NORMAL_ONE 32767.0

/* Octahedral: Meyer et al., "On floating-point normal vectors", 2010. */
void nc_dexel_set_normal(NcDexelEnd *end, SegVec3 n)
{
    double sum = fabs(n.x) + fabs(n.y) + fabs(n.z);
    double x = sum > 0 ? n.x / sum : 0, y = sum > 0 ? n.y / sum : 0;
    if (n.z < 0) {
        double folded = copysign(1 - fabs(y), x);
        y = copysign(1 - fabs(x), y);
        x = folded;
    }
    end->normal[0] = (int16_t)lrint(x * NORMAL_ONE);
    end->normal[1] = (int16_t)lrint(y * NORMAL_ONE);
}

SegVec3 nc_dexel_normal(const NcDexelEnd *end)
{
    double x = end->normal[0] / NORMAL_ONE, y = end->normal[1] / NORMAL_ONE;
    double z = 1 - fabs(x) - fabs(y);
    if (z < 0) {
        double folded = copysign(1 - fabs(y), x);
        y = copysign(1 - fabs(x), y);
        x = folded;
    }
    return seg_unit(seg_vec3(x, y, z));
}
