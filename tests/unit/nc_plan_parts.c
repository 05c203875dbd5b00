/* SPDX-License-Identifier: Apache-2.0 */
/* Real parts, whole: every move of every operation against dense points of the part, rapids against
 * the stock, and what the passes leave of what the tools reach. */
#include "tests/lib/cut_check.h"
#include "tests/lib/plan_case.h"
#include "tests/lib/test.h"

/* `left` is the share of the area, reached by the tools, that the passes may leave: vertical walls
 * where there are only triangles. */
static void plan_part(const char *path, char *const *set, double left)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(PlanCase) c = plan_case_load(path, set, &error);
    g_assert_no_error(error);
    g_test_timer_start();
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    g_assert_cmpfloat(g_test_timer_elapsed(), <, 60); /* ten times what the piece of P0 takes */
    if (!plan) {
        g_test_fail();
        return;
    }
    g_assert_cmpuint(plan->n_operations, >, 0);
    NcSetup setup = nc_setup_new(c->part, c->recipe->up, c->recipe->zero);
    g_autoptr(CutCheck) check = cut_check_new(c->part, &setup, 0.25);
    double requested = 0, unreachable = 0;
    for (size_t i = 0; i < plan->n_operations; i++) {
        const NcOperation *o = &plan->operations[i];
        double gouge = cut_check_gouge_mm(check, o, c->recipe->stock_to_leave_mm);
        double rapid = cut_check_rapid_gouge_mm(check, o, c->recipe->allowance_mm);
        g_test_message(
            "%s: tool %d, %s, %g mm cut, gouge %g, rapids clear by %g, %g of %g mm2 left",
            o->region_name, o->tool->number, nc_strategy_name(o->strategy), o->length_mm, gouge,
            -rapid, o->unreachable_area_mm2, o->requested_area_mm2);
        g_assert_cmpfloat(gouge, <=, plan->budget.chord_mm + 1e-9);
        g_assert_cmpfloat(rapid, <=, 0);
        requested += o->requested_area_mm2;
        unreachable += o->unreachable_area_mm2;
    }
    for (guint i = 0; i < plan->notes->len; i++)
        g_test_message("%s", (char *)plan->notes->pdata[i]);
    g_assert_cmpfloat(unreachable, <=, left * requested);
    g_assert_cmpfloat(plan->estimated_s, >, 0);
}

static void outside_part(const char *name, char *const *set, double left)
{
    g_autofree char *path = test_data(name);
    if (path)
        plan_part(path, set, left);
}

/* The bottom is 30 % of the piece, strips beside fillets and above the table another few. */
static void p0_piece(void)
{
    char *set[] = {"quality.scallop_mm=0.05", "quality.tolerance_mm=0.04", NULL};
    g_autofree char *path = test_program("parts/p0_piece.igs");
    if (g_file_test(path, G_FILE_TEST_EXISTS))
        plan_part(path, set, 0.37);
    else
        g_test_skip("no test parts in the build");
}

static void pocket(void)
{
    char *set[] = {NULL};
    outside_part("mesh/pocket_test.stl", set, 0.75);
}

static void sphere_cutout(void)
{
    char *set[] = {"quality.scallop_mm=0.05", NULL};
    outside_part("mesh/sphere_cutout.stl", set, 0.85);
}

static void mould_cavity(void)
{
    char *set[] = {"tools.use=11, 12, 13", "stock.allowance_mm=0.1", NULL};
    outside_part("mesh/mould_cavity_ktoolcav.stl", set, 0.95);
}

static void wavy_cube(void)
{
    char *set[] = {"stock.allowance_mm=0.1", NULL};
    outside_part("freeform/wavy_cube.stp", set, 0.6);
}

static void propeller_blade(void)
{
    char *set[] = {"quality.scallop_mm=0.1", "quality.tolerance_mm=0.1", NULL};
    outside_part("freeform/propeller_blade_upper.iges", set, 0.6);
}

static void rounded_cube(void)
{
    char *set[] = {"quality.scallop_mm=0.05", "setup.up=-z", NULL};
    outside_part("freeform/rounded_cube.iges", set, 0.6);
}

static void add(void)
{
    g_test_add_func("/nc/plan/parts/p0-piece", p0_piece);
    g_test_add_func("/nc/plan/parts/pocket", pocket);
    g_test_add_func("/nc/plan/parts/sphere-cutout", sphere_cutout);
    g_test_add_func("/nc/plan/parts/mould-cavity", mould_cavity);
    g_test_add_func("/nc/plan/parts/wavy-cube", wavy_cube);
    g_test_add_func("/nc/plan/parts/propeller-blade", propeller_blade);
    g_test_add_func("/nc/plan/parts/rounded-cube", rounded_cube);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
