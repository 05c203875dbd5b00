/* SPDX-License-Identifier: Apache-2.0 */
/* One ray of the stock, while parts of tools are taken out of it. */
#ifndef NC_STOCK_RAY_H
#define NC_STOCK_RAY_H

#include "nc/stock/chords.h"

/* Material thinner than this between two cuts does not stand. */
#define NC_FILM_MM 1e-6

typedef struct {
    const NcStock *stock;
    int axis;
    NcDexelTile *tile;
    int ray;        /* in the tile */
    SegVec3 origin; /* on it, where its own coordinate is 0 */
} NcRay;

/* Takes what `body` sweeps along the chord out of the ray. Returns the length in mm of the longest
 * piece of material that it went through, 0 where none; `middle_mm` gets that piece's place. */
double nc_ray_subtract(const NcRay *ray, const NcToolBody *body, const NcChord *chord,
                       double *middle_mm);

/* The same length and place, and takes nothing. */
double nc_ray_measure(const NcRay *ray, const NcToolBody *body, const NcChord *chord,
                      double *middle_mm);

#endif
