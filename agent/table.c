/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/table.h"

#include <math.h>
#include <stdio.h>

#include "agent/out/plan_json.h"

void agent_table_regions(const SegSegmentation *segmentation)
{
    printf("%3s  %-20s %-8s %6s %14s %12s %12s\n", "id", "name", "kind", "faces", "area mm²",
           "size mm", "radius mm");
    for (size_t i = 0; i < segmentation->n_regions; i++) {
        const SegRegion *region = &segmentation->regions[i];
        printf("%3d  %-20s %-8s %6zu %14.3f %12.3f ", region->id, region->name,
               seg_region_kind_name(region->kind), region->n_pieces, region->area_mm2,
               region->feature_size_mm[0]);
        if (isfinite(region->min_concave_radius_mm))
            printf("%12.3f\n", region->min_concave_radius_mm);
        else
            printf("%12s\n", "-");
    }
    for (size_t i = 0; i < segmentation->n_dropped; i++)
        printf("left out: face %d: %s\n", segmentation->dropped[i].face,
               segmentation->dropped[i].reason);
}

static void operation_row(const NcOperation *operation)
{
    g_autofree char *tool =
        g_strdup_printf("T%d %s Ø%g", operation->tool->number,
                        cfg_tool_kind_name(operation->tool->kind), operation->tool->diameter_mm);
    printf("%3d  %-16s %-14s %-14s %7.0f %7.0f %8.3f %10.0f %9.1f\n", operation->region,
           operation->region_name, nc_strategy_name(operation->strategy), tool,
           operation->feed_mm_min, operation->spindle_rpm, operation->stepover_mm,
           operation->length_mm, operation->estimated_s);
}

void agent_table_plan(const NcPlan *plan, const NcPlan *baseline)
{
    printf("%3s  %-16s %-14s %-13s %7s %7s %8s %10s %9s\n", "id", "region", "strategy", "tool",
           "mm/min", "rev/min", "step mm", "length mm", "time s");
    for (size_t i = 0; i < plan->n_operations; i++)
        operation_row(&plan->operations[i]);
    printf("all  %.1f s, %.0f mm cutting, %.0f mm in the air, %d tool changes\n", plan->estimated_s,
           plan->length_mm, plan->air_mm, plan->tool_changes);
    if (!baseline || baseline->n_operations == 0)
        return;
    const CfgTool *tool = baseline->operations[0].tool;
    printf("one tool alone (T%d %s Ø%g): %.1f s; saving %.1f %%\n", tool->number,
           cfg_tool_kind_name(tool->kind), tool->diameter_mm, baseline->estimated_s,
           agent_saving_percent(plan, baseline));
}
