/* SPDX-License-Identifier: Apache-2.0 */
#include <stdlib.h>
#include <string.h>

#include "nc/motion/path.h"
#include "nc/stock/contacts.h"

static size_t prepare(const NcStock *stock, const NcGroup *groups, size_t n, NcPrepared *prepared);
static uint64_t remove_axis(NcStock *stock, int axis, const NcPrepared *groups, size_t n,
                            GArray *contacts);

/* Material that is cut apart needs more ends than the stock was begun with. */
static bool check_memory(const NcStock *stock, GError **error)
{
    uint64_t bytes = nc_stock_memory_bytes(stock);
    if (bytes <= stock->memory_bytes)
        return true;
    g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                "line %u: what is left of the stock needs %.1f MB at a pitch of %.6g mm and may "
                "have %.1f MB: choose a coarser pitch",
                stock->cuts[stock->n_cuts - 1].line, (double)bytes / 1e6, stock->pitch_mm,
                (double)stock->memory_bytes / 1e6);
    return false;
}

bool nc_stock_cut(NcStock *stock, const NcMove *moves, size_t n, SegVec3 zero,
                  const CfgToolTable *tools, GArray *collisions, GError **error)
{
    if (!nc_chords_check(moves, n, tools, error))
        return false;
    g_autoptr(NcChordReader) reader = nc_chord_reader_new(moves, n, zero, tools);
    g_autoptr(GArray) contacts = g_array_new(FALSE, FALSE, sizeof(NcContact));
    g_autofree NcPrepared *prepared = NULL;
    const NcGroup *groups;
    size_t n_groups, room = 0;
    uint32_t cuts = stock->cuts_capacity;
    bool fits = true;
    while (fits && (n_groups = nc_chord_reader_next(reader, stock, &groups)) > 0) {
        if (n_groups > room) {
            g_free(prepared);
            prepared = g_new(NcPrepared, n_groups);
            room = n_groups;
        }
        size_t n_prepared = prepare(stock, groups, n_groups, prepared);
        uint64_t grown = 0;
        for (int axis = 0; axis < 3 && n_prepared > 0; axis++)
            grown += remove_axis(stock, axis, prepared, n_prepared, contacts);
        nc_contacts_merge(contacts);
        fits = (grown == 0 && stock->cuts_capacity == cuts) || check_memory(stock, error);
        cuts = stock->cuts_capacity;
    }
    if (collisions)
        nc_contacts_collisions(contacts, stock, collisions);
    return fits;
}

/* ---------------------------------------------------------------------- one batch */

/* The tiles of an axis whose rays a box meets: [first, last] along u and v, none where first is
 * greater; and the parts of the axis. */
typedef struct {
    int32_t first[2], last[2];
    uint64_t parts;
} Window;

static Window window_of(const NcStock *stock, int axis, SegVec3 min, SegVec3 max)
{
    Window window = {.parts = 0};
    for (int k = 0; k < 2; k++) {
        int along = (axis + 1 + k) % 3;
        int32_t from = nc_dexel_depth(stock, along, nc_axis_value(min, along)) >> stock->shift;
        int32_t to = nc_dexel_depth(stock, along, nc_axis_value(max, along)) >> stock->shift;
        window.first[k] = MAX(from, 0) / NC_TILE;
        window.last[k] = to < 0 ? -1 : MIN(to, stock->n_nodes[along] - 1) / NC_TILE;
    }
    int32_t from = nc_dexel_depth(stock, axis, nc_axis_value(min, axis));
    int32_t to = nc_dexel_depth(stock, axis, nc_axis_value(max, axis));
    if (from <= to)
        window.parts = (UINT64_MAX << nc_dexel_part(stock, axis, from)) &
                       (UINT64_MAX >> (63 - nc_dexel_part(stock, axis, to)));
    return window;
}

/* Calls for each tile of the window with material in its parts; until `visit` returns false. */
static bool visit_window(const NcStock *stock, int axis, const Window *window,
                         bool (*visit)(size_t tile, void *data), void *data)
{
    const NcDexelField *field = &stock->field[axis];
    for (int32_t v = window->first[1]; v <= window->last[1]; v++)
        for (int32_t u = window->first[0]; u <= window->last[0]; u++) {
            size_t tile = (size_t)v * (size_t)field->n_tiles[0] + (size_t)u;
            if ((field->tiles[tile].occupied & window->parts) && !visit(tile, data))
                return false;
        }
    return true;
}

static bool found_one(size_t tile, void *data)
{
    (void)tile;
    (void)data;
    return false;
}

/* May a part of a tool meet material anywhere on its way? */
static bool may_meet(const NcStock *stock, SegVec3 min, SegVec3 max)
{
    if (min.x > max.x || min.x > stock->max.x || max.x < stock->min.x || min.y > stock->max.y ||
        max.y < stock->min.y || min.z > stock->max.z || max.z < stock->min.z)
        return false;
    for (int axis = 0; axis < 3; axis++) {
        Window window = window_of(stock, axis, min, max);
        if (!visit_window(stock, axis, &window, found_one, NULL))
            return true;
    }
    return false;
}

/* The groups that may meet material; material only goes, so this holds for the whole batch. */
static size_t prepare(const NcStock *stock, const NcGroup *groups, size_t n, NcPrepared *prepared)
{
    size_t kept = 0;
    for (size_t i = 0; i < n; i++) {
        NcPrepared *p = &prepared[kept];
        bool any = false;
        p->group = &groups[i];
        for (int k = 0; k < NC_N_PARTS; k++) {
            p->meets[k] = may_meet(stock, groups[i].min[k], groups[i].max[k]);
            any |= p->meets[k];
        }
        for (int axis = 0; axis < 3 && any; axis++)
            nc_lanes_load(&p->lanes[axis], &groups[i], p->meets, axis);
        kept += any;
    }
    return kept;
}

/* ------------------------------------------------------------------- tiles of an axis */

/* Which groups go over which tile: `first[tile]` of `list`. */
typedef struct {
    size_t *first;
    const NcPrepared **list;
    const NcPrepared *group; /* the one being entered */
    const NcPrepared **last; /* of each tile while counting: counted already for this one */
} Bins;

static bool count_tile(size_t tile, void *data)
{
    Bins *bins = data;
    if (bins->last[tile] != bins->group) {
        bins->last[tile] = bins->group;
        bins->first[tile + 1]++;
    }
    return true;
}

static bool enter_tile(size_t tile, void *data)
{
    Bins *bins = data;
    if (bins->last[tile] != bins->group) {
        bins->last[tile] = bins->group;
        bins->list[bins->first[tile]++] = bins->group;
    }
    return true;
}

static void visit_group(const NcStock *stock, int axis, Bins *bins, const NcPrepared *group,
                        bool (*visit)(size_t tile, void *data))
{
    bins->group = group;
    for (int k = 0; k < NC_N_PARTS; k++)
        if (group->meets[k]) {
            Window window = window_of(stock, axis, group->group->min[k], group->group->max[k]);
            visit_window(stock, axis, &window, visit, bins);
        }
}

/* Returns how many ends its tiles have room for more than before. */
static uint64_t remove_axis(NcStock *stock, int axis, const NcPrepared *groups, size_t n,
                            GArray *contacts)
{
    uint64_t grown = 0;
    const NcDexelField *field = &stock->field[axis];
    size_t n_tiles = (size_t)field->n_tiles[0] * (size_t)field->n_tiles[1];
    g_autofree size_t *first = g_new0(size_t, n_tiles + 1);
    g_autofree const NcPrepared **last = g_new0(const NcPrepared *, n_tiles);
    Bins bins = {.first = first, .last = last};
    for (size_t i = 0; i < n; i++)
        visit_group(stock, axis, &bins, &groups[i], count_tile);
    for (size_t i = 0; i < n_tiles; i++)
        first[i + 1] += first[i];
    g_autofree const NcPrepared **list = g_new(const NcPrepared *, MAX(first[n_tiles], 1));
    bins.list = list;
    memset(last, 0, n_tiles * sizeof *last);
    for (size_t i = 0; i < n; i++)
        visit_group(stock, axis, &bins, &groups[i], enter_tile);
        /* Entering moved each first on to the next tile's. */
#pragma omp parallel reduction(+ : grown)
    {
        g_autoptr(GArray) met = g_array_new(FALSE, FALSE, sizeof(NcContact));
#pragma omp for schedule(dynamic, 4)
        for (size_t tile = 0; tile < n_tiles; tile++) {
            size_t from = tile > 0 ? first[tile - 1] : 0;
            uint32_t capacity = field->tiles[tile].capacity;
            if (first[tile] > from)
                nc_tile_remove(stock, axis, tile, list + from, first[tile] - from, met);
            grown += field->tiles[tile].capacity - capacity;
        }
#pragma omp critical
        g_array_append_vals(contacts, met->data, met->len);
    }
    return grown;
}
