/* SPDX-License-Identifier: Apache-2.0 */
/* Plans of whole parts, judged by dense points: no gouge, nothing left too high, clear links. */
#include <omp.h>
#include <string.h>

#include "tests/lib/cut_check.h"
#include "tests/lib/plan_case.h"
#include "tests/lib/test.h"

#define SIDE 30

/* 1 for ground, 2 for walls and the bottom. */
static int top_or_rest(const SegPart *part, int32_t t)
{
    const SegTriangle *triangle = &part->triangles[t];
    SegVec3 a = part->vertices[triangle->vertex[0]].position;
    SegVec3 b = part->vertices[triangle->vertex[1]].position;
    SegVec3 c = part->vertices[triangle->vertex[2]].position;
    return seg_unit(seg_cross(seg_sub(b, a), seg_sub(c, a))).z > 0.05 ? 1 : 2;
}

typedef double (*Height)(double, double);

static double plane(double x, double y)
{
    (void)x;
    (void)y;
    return 10;
}

static double slope(double x, double y)
{
    return 10 + 0.6 * x - 0.3 * y;
}

/* Convex about y, radius 40. */
static double barrel(double x, double y)
{
    (void)y;
    return 12 + sqrt(40 * 40 - (x - SIDE / 2.0) * (x - SIDE / 2.0)) - 40;
}

/* Concave about y, radius 30. */
static double trough(double x, double y)
{
    (void)y;
    return 12 + 30 - sqrt(30 * 30 - (x - SIDE / 2.0) * (x - SIDE / 2.0));
}

/* Concave about y, radius 6.5 in the middle third. */
static double tight_trough(double x, double y)
{
    (void)y;
    double d = fabs(x - SIDE / 2.0), in = fmin(d, 4);
    double z = 12 + 6.5 - sqrt(6.5 * 6.5 - in * in);
    return z + (d - in) * 4 / sqrt(6.5 * 6.5 - 16);
}

static double dome(double x, double y)
{
    double d2 = (x - SIDE / 2.0) * (x - SIDE / 2.0) + (y - SIDE / 2.0) * (y - SIDE / 2.0);
    return 10 + sqrt(fmax(45 * 45 - d2, 0)) - 30;
}

static double wave(double x, double y)
{
    return 12 + 2 * sin(x / 6) * cos(y / 7) + sin((x + 2 * y) / 13);
}

/* A sharp ridge and a sharp valley. */
static double roof(double x, double y)
{
    return 10 + 0.5 * fabs(fmod(x + 0.2 * y + 40, 20) - 10);
}

static PlanCase *top_of(Height height, int cells, char *const *set)
{
    g_autoptr(GError) error = NULL;
    PlanCase *c = plan_case_new(plan_case_height_field(SIDE, cells, 0, height), set, &error);
    g_assert_no_error(error);
    if (!c)
        return NULL;
    plan_case_split(c, 2, top_or_rest);
    c->segmentation->n_regions = 1; /* walls and bottom are not asked for */
    return c;
}

static void free_rest(PlanCase *c)
{
    c->segmentation->n_regions = 2;
}

static void check_no_gouge(const PlanCase *c, const NcPlan *plan)
{
    NcSetup setup = nc_setup_new(c->part, c->recipe->up, c->recipe->zero);
    g_autoptr(CutCheck) check = cut_check_new(c->part, &setup, 0.15);
    for (size_t i = 0; i < plan->n_operations; i++) {
        double gouge =
            cut_check_gouge_mm(check, &plan->operations[i], c->recipe->stock_to_leave_mm);
        g_test_message("%s: gouge %g mm", plan->operations[i].region_name, gouge);
        g_assert_cmpfloat(gouge, <=, plan->budget.chord_mm + 1e-9);
        double rapid =
            cut_check_rapid_gouge_mm(check, &plan->operations[i], c->recipe->allowance_mm);
        g_assert_cmpfloat(rapid, <=, 0);
    }
}

/* Area over which more stands over the exact surface, at right angles to it, than may. */
static double excess_area_mm2(const PlanCase *c, const NcOperation *operation, Height height,
                              double most, double *worst)
{
    enum { N = 240 };
    NcSetup setup = nc_setup_new(c->part, c->recipe->up, c->recipe->zero);
    g_autofree double *x = g_new(double, N *N), *y = g_new(double, N *N);
    g_autofree double *z = g_new(double, N *N);
    for (int i = 0; i < N * N; i++) {
        x[i] = SIDE * (i / N + 0.5) / N + setup.translation.x;
        y[i] = SIDE * (i % N + 0.5) / N + setup.translation.y;
    }
    cut_check_surface(operation, 0.02, N * N, x, y, z);
    double area = 0;
    *worst = -INFINITY;
    for (int i = 0; i < N * N; i++) {
        double u = x[i] - setup.translation.x, v = y[i] - setup.translation.y, e = 1e-4;
        double gx = (height(u + e, v) - height(u - e, v)) / (2 * e);
        double gy = (height(u, v + e) - height(u, v - e)) / (2 * e);
        double lean = sqrt(1 + gx * gx + gy * gy);
        double excess = (z[i] - height(u, v) - setup.translation.z) / lean;
        *worst = fmax(*worst, excess);
        area += excess > most ? lean * SIDE * SIDE / (N * N) : 0;
    }
    return area;
}

/* Plans the top with one tool: no gouge; and nowhere more than scallop and tolerance is left, but
 * on what the plan says it cannot reach. */
static void surface_case(Height height, int cells, const char *tool, double mesh_error)
{
    g_autofree char *use = g_strdup_printf("tools.use=%s", tool);
    char *set[] = {use, NULL};
    g_autoptr(PlanCase) c = top_of(height, cells, set);
    if (!c)
        return;
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = nc_plan_new(&c->input, &error);
    g_assert_no_error(error);
    if (plan && plan->n_operations == 1) {
        const NcOperation *o = &plan->operations[0];
        check_no_gouge(c, plan);
        double worst;
        double area = excess_area_mm2(
            c, o, height, c->recipe->scallop_mm + plan->budget.chord_mm + mesh_error, &worst);
        g_test_message(
            "tool %s: step %g at %g deg, %g mm; unreachable %g of %g mm2, %g mm2 too high, "
            "worst %g mm",
            tool, o->stepover_mm, o->direction_rad * 180 / G_PI, o->length_mm,
            o->unreachable_area_mm2, o->requested_area_mm2, area, worst);
        g_assert_cmpfloat(area, <=, 1.2 * o->unreachable_area_mm2);
    } else {
        g_test_fail();
    }
    free_rest(c);
}

static void ball_on_plane(void)
{
    surface_case(plane, 1, "14", 0);
}

static void ball_on_slope(void)
{
    surface_case(slope, 1, "14", 0);
}

static void ball_on_barrel(void)
{
    surface_case(barrel, 200, "14", 1e-4);
}

static void ball_in_trough(void)
{
    surface_case(trough, 200, "14", 1e-4);
}

static void ball_on_dome(void)
{
    surface_case(dome, 150, "14", 1e-3);
}

static void ball_on_wave(void)
{
    surface_case(wave, 120, "14", 2e-3);
}

static void bull_on_wave(void)
{
    surface_case(wave, 120, "21", 2e-3);
}

/* The valley is hardly wider than the ball. */
static void ball_in_tight_trough(void)
{
    surface_case(tight_trough, 200, "17", 5e-4);
}

static void flat_on_plane(void)
{
    surface_case(plane, 1, "5", 0);
}

static void flat_on_slope(void)
{
    surface_case(slope, 1, "5", 0);
}

static void ball_on_roof(void)
{
    char *set[] = {"tools.use=14", NULL};
    g_autoptr(PlanCase) c = top_of(roof, 90, set);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan)
        check_no_gouge(c, plan);
    if (c)
        free_rest(c);
}

static void add(void)
{
    g_test_add_func("/nc/plan/paths/ball-plane", ball_on_plane);
    g_test_add_func("/nc/plan/paths/ball-slope", ball_on_slope);
    g_test_add_func("/nc/plan/paths/ball-barrel", ball_on_barrel);
    g_test_add_func("/nc/plan/paths/ball-trough", ball_in_trough);
    g_test_add_func("/nc/plan/paths/ball-dome", ball_on_dome);
    g_test_add_func("/nc/plan/paths/ball-wave", ball_on_wave);
    g_test_add_func("/nc/plan/paths/bull-wave", bull_on_wave);
    g_test_add_func("/nc/plan/paths/ball-tight-trough", ball_in_tight_trough);
    g_test_add_func("/nc/plan/paths/flat-plane", flat_on_plane);
    g_test_add_func("/nc/plan/paths/flat-slope", flat_on_slope);
    g_test_add_func("/nc/plan/paths/ball-roof", ball_on_roof);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
