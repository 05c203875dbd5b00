/* SPDX-License-Identifier: Apache-2.0 */
/* What groups of chords remove from the rays of one tile. */
#ifndef NC_STOCK_TILE_H
#define NC_STOCK_TILE_H

#include "nc/stock/bounds.h"

/* A touch no deeper than this does not count. */
#define NC_CONTACT_MM 1e-3

/* Something met what it must not: the longest piece of material on a ray of this axis that it went
 * through, for one block. */
typedef struct {
    uint32_t cut;
    int kind;  /* NcCollisionKind */
    bool rubs; /* a shank that only touches: length_mm is how far it is below the ray, axis is 0 */
    int axis;
    double length_mm;
    SegVec3 position; /* the piece's middle */
} NcContact;

/* A group, ready for the rays of each axis. */
typedef struct {
    const NcGroup *group;
    bool meets[NC_N_PARTS]; /* the part may meet material; a group with no such part is left out */
    NcLanes lanes[3];
} NcPrepared;

/*
 * Takes out of the tile's rays what the groups, in this order, sweep. Appends NcContacts to
 * `contacts`, one a block and kind. Where a group can only cut, its chords are taken in the order
 * that needs fewest looks: what is left is the same.
 */
void nc_tile_remove(NcStock *stock, int axis, size_t tile, const NcPrepared *const *groups,
                    size_t n, GArray *contacts);

#endif
