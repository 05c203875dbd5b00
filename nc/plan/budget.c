/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/nc.h"

#define TESSELLATION_SHARE 0.3
#define TESSELLATION_MOST 0.8
#define CHORD_SHARE 0.60 /* of what the tessellation leaves, as the next two */
#define BLEND_SHARE 0.35
#define ROUNDING_SHARE 0.05

bool nc_budget_share(const CfgRecipe *recipe, NcBudget *budget, GError **error)
{
    double tolerance = recipe->tolerance_mm;
    double chord = recipe->chord_mm > 0 ? recipe->chord_mm : TESSELLATION_SHARE * tolerance;
    if (chord > TESSELLATION_MOST * tolerance) {
        g_set_error(
            error, NC_ERROR, NC_ERROR_PLAN,
            "part.chord_mm = %g takes more than %g %% of quality.tolerance_mm = %g: nothing "
            "is left for chords, corners and rounding; lower chord_mm or raise tolerance_mm",
            chord, 100 * TESSELLATION_MOST, tolerance);
        return false;
    }
    double left = tolerance - chord;
    *budget = (NcBudget){.tessellation_mm = chord,
                         .chord_mm = CHORD_SHARE * left,
                         .blend_mm = BLEND_SHARE * left,
                         .rounding_mm = ROUNDING_SHARE * left};
    return true;
}
