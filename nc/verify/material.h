/* SPDX-License-Identifier: Apache-2.0 */
/* The stock as judging needs it: for what was never cut, and for collisions. */
#ifndef NC_VERIFY_MATERIAL_H
#define NC_VERIFY_MATERIAL_H

#include "nc/nc.h"

/* The recipe's stock at the finest pitch, 0.1 mm or wider, for which a model of the part's size, or
 * of the larger box that the recipe names, needs about 512 MB; `pitch_mm` says which. Errors: as
 * nc_stock_from_recipe. */
NcStock *nc_material_new(const NcPlanInput *input, const NcSetup *setup, double *pitch_mm,
                         GError **error);

/*
 * How far the uncut stock goes on from a point of the part along the outward normal; negative:
 * by how much the stock lacks there. Of a near-net stock the allowance; of others read off the
 * nearest of its rays along the normal's main axis, where less than a pitch counts as flush.
 */
double nc_material_end_mm(const NcStock *stock, const CfgRecipe *recipe, SegVec3 point,
                          SegVec3 normal);

#endif
