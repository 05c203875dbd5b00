/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/drop_contact.h"

NcCutter nc_cutter(const CfgTool *tool)
{
    return (NcCutter){tool->diameter_mm / 2, tool->corner_radius_mm};
}

double nc_cutter_height_mm(NcCutter cutter, double distance_mm)
{
    double r = cutter.corner_radius_mm;
    double w = fabs(distance_mm) - (cutter.radius_mm - r);
    if (w <= 0)
        return 0;
    return w <= r ? r - sqrt((r - w) * (r + w)) : INFINITY;
}

/* ------------------------------------------------------------------------- drop */

typedef struct {
    NcCutter cutter;
    double x, y;
    NcContact best;
    const NcFacet *facet; /* touched; NULL: none */
} Drop;

static bool drop_on(const NcFacet *facet, double *floor, void *data)
{
    Drop *drop = data;
    NcContact contact = nc_contact(facet, drop->cutter, drop->x, drop->y);
    if (contact.tip_mm > drop->best.tip_mm) {
        drop->best = contact;
        drop->facet = facet;
        *floor = fmax(*floor, contact.tip_mm);
    }
    return true;
}

/*
 * `hint` is a facet that is likely to be touched; NULL: none. It says how high the tip is at least,
 * less a margin for rounding, and is not itself a candidate: so it cannot change the result.
 */
static void drop_at(const NcTerrain *terrain, Drop *drop, const NcFacet *hint)
{
    double floor = -INFINITY;
    if (hint) {
        double tip_mm = nc_contact(hint, drop->cutter, drop->x, drop->y).tip_mm;
        floor = tip_mm - 1e-9 * (1 + fabs(tip_mm));
    }
    drop->best = (NcContact){.tip_mm = -INFINITY};
    drop->facet = NULL;
    NcMoveSpan span = {.middle = {drop->x, drop->y, 0}};
    nc_terrain_walk(terrain, drop->cutter, &span, floor, drop_on, drop);
}

double nc_drop(const NcTerrain *terrain, NcCutter cutter, double x_mm, double y_mm,
               int32_t *triangle, SegVec3 *contact)
{
    Drop drop = {.cutter = cutter, .x = x_mm, .y = y_mm};
    drop_at(terrain, &drop, NULL);
    if (triangle)
        *triangle = drop.facet ? drop.facet->id : -1;
    if (contact)
        *contact = drop.best.point;
    return drop.best.tip_mm;
}

void nc_drop_batch(const NcTerrain *terrain, NcCutter cutter, size_t n, const double *x_mm,
                   const double *y_mm, double *z_mm, int32_t *triangle, SegVec3 *contact)
{
    const size_t block = 256; /* places in a row: the last contact is a good hint for the next */
#pragma omp parallel for schedule(dynamic)
    for (size_t first = 0; first < n; first += block) {
        Drop drop = {.cutter = cutter};
        for (size_t i = first; i < MIN(first + block, n); i++) {
            drop.x = x_mm[i], drop.y = y_mm[i];
            drop_at(terrain, &drop, drop.facet);
            z_mm[i] = drop.best.tip_mm;
            if (triangle)
                triangle[i] = drop.facet ? drop.facet->id : -1;
            if (contact)
                contact[i] = drop.best.point;
        }
    }
}
