/* SPDX-License-Identifier: Apache-2.0 */
/* From contacts on single rays to collisions of blocks. */
#ifndef NC_STOCK_CONTACTS_H
#define NC_STOCK_CONTACTS_H

#include "nc/stock/tile.h"

/* Leaves the longest of each block, kind, axis and way, in their order, whatever order they came
 * in. */
void nc_contacts_merge(GArray *contacts);

/*
 * Appends merged contacts as NcCollisions, one a line and kind, ascending. How deep it went is the
 * least of what the axes say: a tool that passes 0.1 mm too low has met that much along Z, and its
 * whole way along X. A shank that only rubs counts where it took nothing in the same line.
 */
void nc_contacts_collisions(const GArray *contacts, const NcStock *stock, GArray *collisions);

#endif
