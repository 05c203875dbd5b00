/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The cut part measured along single lines: exact where a grid of dexels has a pitch. A line is cut
 * by what each move sweeps; what is left of it tells how far the part's surface lies from a point.
 */
#ifndef NC_STOCK_PROBE_H
#define NC_STOCK_PROBE_H

#include "nc/stock.h"

/* The moves of a program by place. Immutable: it may be asked from many threads. */
typedef struct NcProbing NcProbing;

/* `zero` is the work zero in machine coordinates of the gauge point. The moves (G0 to G3) are read
 * here and not kept; arcs are swept as the chords that nc_stock_cut takes, within 1e-4 mm. Errors:
 * as nc_stock_cut. */
NcProbing *nc_probing_new(const NcMove *moves, size_t n, SegVec3 zero, const CfgToolTable *tools,
                          GError **error);
void nc_probing_free(NcProbing *probing);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcProbing, nc_probing_free)

#define NC_PROBING_UNCUT SIZE_MAX

typedef struct {
    double deviation_mm;
    size_t move; /* that made the surface found; NC_PROBING_UNCUT: none, it is the stock's */
} NcProbed;

/*
 * Where the surface of the cut part lies on the line through `point` along the outward unit normal,
 * from the point: where material is left at the point, outward to the first place without
 * (deviation > 0); where it is gone, inward to the first that is left (deviation < 0). Without a
 * cut the material ends `stock_mm` outside of the point, inside of it where that is negative.
 * Nothing is looked for further than `most_mm` either way: a deviation that large is at least that.
 */
NcProbed nc_probing_measure(const NcProbing *probing, SegVec3 point, SegVec3 normal,
                            double stock_mm, double most_mm);

#endif
