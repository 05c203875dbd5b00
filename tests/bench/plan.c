/* SPDX-License-Identifier: Apache-2.0 */
/* Time and result of planning a part with the shipped tools: plan FILE [key=value …]; without a
 * file, a wavy body of 60 × 60 mm and the piece of P0. */
#include <stdio.h>

#include "tests/lib/plan_case.h"
#include "tests/lib/test.h"

static double wave_mm(double x, double y)
{
    return 12 + 2 * sin(x / 8) * cos(y / 11) + sin((x + 2 * y) / 17);
}

static void print_plan(const char *name, const NcPlan *plan, double seconds)
{
    printf(
        "%-9s planned in %.2f s: %.0f s of machining, %.0f mm cutting, %.0f mm air, %d reversals, "
        "%d tool changes\n",
        name, seconds, plan->estimated_s, plan->length_mm, plan->air_mm, plan->reversals,
        plan->tool_changes);
    for (size_t i = 0; i < plan->n_operations; i++) {
        const NcOperation *o = &plan->operations[i];
        printf("  %d %s: %s at %.0f°, tool %d %s Ø%g, step %.4g mm, F%g S%g: %.0f s, %.0f mm, "
               "%u locations, %.5g of %.5g mm² not reached\n",
               o->region, o->region_name, nc_strategy_name(o->strategy),
               o->direction_rad * 180 / G_PI, o->tool->number, cfg_tool_kind_name(o->tool->kind),
               o->tool->diameter_mm, o->stepover_mm, o->feed_mm_min, o->spindle_rpm, o->estimated_s,
               o->length_mm, o->path.locations->len, o->unreachable_area_mm2,
               o->requested_area_mm2);
    }
    for (guint i = 0; i < plan->notes->len; i++)
        printf("  note: %s\n", (char *)plan->notes->pdata[i]);
}

/* Plan and baseline of one part, which may be NULL with the error set. */
static void measure(const char *name, PlanCase *c, GError **error)
{
    if (!c)
        return;
    printf("%s: %d faces, %d triangles\n", name, c->part->n_faces, c->part->n_triangles);
    for (int k = 0; k < 2 && !*error; k++) {
        gint64 start = g_get_monotonic_time();
        g_autoptr(NcPlan) plan =
            k == 0 ? nc_plan_new(&c->input, error) : nc_plan_baseline(&c->input, error);
        if (plan)
            print_plan(k == 0 ? "plan" : "baseline", plan,
                       (double)(g_get_monotonic_time() - start) / 1e6);
    }
    plan_case_free(c);
}

int main(int argc, char **argv)
{
    g_autoptr(GError) error = NULL;
    if (argc > 1) {
        measure(argv[1], plan_case_load(argv[1], argc > 2 ? argv + 2 : NULL, &error), &error);
    } else {
        g_autofree char *piece = test_program("parts/p0_piece.igs");
        measure("wave", plan_case_new(plan_case_height_field(60, 100, 0, wave_mm), NULL, &error),
                &error);
        if (!error && g_file_test(piece, G_FILE_TEST_EXISTS))
            measure(piece, plan_case_load(piece, NULL, &error), &error);
    }
    if (error)
        fprintf(stderr, "%s\n", error->message);
    return error ? 1 : 0;
}
