/* SPDX-License-Identifier: Apache-2.0 */
/* Plans of whole parts, judged by dense points: no gouge, nothing left too high, clear links. */
#include <omp.h>
#include <string.h>

#include "tests/lib/cut_check.h"
#include "tests/lib/plan_case.h"
#include "tests/lib/test.h"

#define SIDE 20

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
    g_autoptr(CutCheck) check = cut_check_new(c->part, &setup, 0.2);
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
    enum { N = 150 };
    NcSetup setup = nc_setup_new(c->part, c->recipe->up, c->recipe->zero);
    g_autofree double *x = g_new(double, N *N), *y = g_new(double, N *N);
    g_autofree double *z = g_new(double, N *N);
    for (size_t i = 0; i < N * N; i++) {
        x[i] = SIDE * ((double)(i / N) + 0.5) / N + setup.translation.x;
        y[i] = SIDE * ((double)(i % N) + 0.5) / N + setup.translation.y;
    }
    /* A sharp rim on a slope is as high as it is late. */
    double pitch = operation->tool->corner_radius_mm > 0 ? 0.04 : 0.01;
    cut_check_surface(operation, pitch, N * N, x, y, z);
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
    surface_case(barrel, 130, "14", 1e-4);
}

static void ball_in_trough(void)
{
    surface_case(trough, 130, "14", 1e-4);
}

static void ball_on_dome(void)
{
    surface_case(dome, 100, "14", 1e-3);
}

static void ball_on_wave(void)
{
    surface_case(wave, 80, "14", 2e-3);
}

static void bull_on_wave(void)
{
    surface_case(wave, 80, "21", 2e-3);
}

/* The valley is hardly wider than the ball. */
static void ball_in_tight_trough(void)
{
    surface_case(tight_trough, 130, "17", 5e-4);
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
    g_autoptr(PlanCase) c = top_of(roof, 60, set);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan)
        check_no_gouge(c, plan);
    if (c)
        free_rest(c);
}

/* Locations do not depend on the number of threads. */
static void same_for_threads(void)
{
    char *set[] = {"tools.use=15", NULL};
    g_autoptr(PlanCase) c = top_of(wave, 40, set);
    g_autoptr(GError) error = NULL;
    int threads = omp_get_max_threads();
    omp_set_num_threads(1);
    g_autoptr(NcPlan) one = c ? nc_plan_new(&c->input, &error) : NULL;
    omp_set_num_threads(3);
    g_autoptr(NcPlan) three = c ? nc_plan_new(&c->input, &error) : NULL;
    omp_set_num_threads(threads);
    g_assert_no_error(error);
    if (one && three && one->n_operations == 1 && three->n_operations == 1) {
        const GArray *a = one->operations[0].path.locations;
        const GArray *b = three->operations[0].path.locations;
        g_assert_cmpuint(a->len, >, 100);
        g_assert_cmpuint(a->len, ==, b->len);
        g_assert_true(a->len == b->len &&
                      memcmp(a->data, b->data, a->len * sizeof(NcLocation)) == 0);
    } else {
        g_test_fail();
    }
    if (c)
        free_rest(c);
}

static int left_or_right(const SegPart *part, int32_t t)
{
    if (top_or_rest(part, t) == 2)
        return 3;
    const int32_t *v = part->triangles[t].vertex;
    double x = (part->vertices[v[0]].position.x + part->vertices[v[1]].position.x +
                part->vertices[v[2]].position.x) /
               3;
    return x < SIDE / 2.0 ? 1 : 2;
}

/* Neighbouring regions run into each other by the overlap, against witness lines: in the strip on
 * the other side of the border each has cut as low as on its own. */
static void overlap(void)
{
    char *set[] = {"tools.use=15", "toolpath.overlap_mm=1", NULL};
    g_autoptr(PlanCase) c = top_of(wave, 40, set);
    g_autoptr(GError) error = NULL;
    if (c) {
        free_rest(c);
        plan_case_split(c, 3, left_or_right);
        c->segmentation->n_regions = 2;
    }
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    for (size_t i = 0; plan && i < plan->n_operations; i++) {
        const NcOperation *o = &plan->operations[i];
        double beyond = o->region == 1 ? 1 : -1, x[200], y[200], z[200];
        NcSetup setup = nc_setup_new(c->part, c->recipe->up, c->recipe->zero);
        for (int k = 0; k < 200; k++) {
            x[k] = SIDE / 2.0 + beyond * 0.9 * (k % 10) / 10 + setup.translation.x;
            y[k] = SIDE * (k / 10 + 0.5) / 20 + setup.translation.y;
        }
        cut_check_surface(o, 0.04, 200, x, y, z);
        double worst = 0;
        for (int k = 0; k < 200; k++) {
            double exact = wave(x[k] - setup.translation.x, y[k] - setup.translation.y);
            worst = fmax(worst, z[k] - exact - setup.translation.z);
        }
        g_assert_cmpfloat(worst, <=, 1.3 * (c->recipe->scallop_mm + plan->budget.chord_mm) + 3e-3);
    }
    g_assert_cmpuint(plan ? plan->n_operations : 0, ==, 2);
    if (c)
        c->segmentation->n_regions = 3;
}

/* The shape of every toolpath: from clearance to clearance, down by a lead, rapids only in the air,
 * and figures that are those of the path. */
static void shape_of_path(void)
{
    char *set[] = {"tools.use=15", "toolpath.one_way=true", NULL};
    g_autoptr(PlanCase) c = top_of(wave, 40, set);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (!plan || plan->n_operations != 1) {
        g_test_fail();
        return;
    }
    const NcOperation *o = &plan->operations[0];
    const NcLocation *l = (const NcLocation *)(void *)o->path.locations->data;
    guint n = o->path.locations->len;
    g_assert_cmpint(l[0].motion, ==, NC_RAPID);
    test_near(l[0].tip.z, plan->clearance_mm, 1e-9, 0);
    g_assert_cmpint(l[n - 1].motion, ==, NC_RAPID);
    test_near(l[n - 1].tip.z, plan->clearance_mm, 1e-9, 0);
    double cut = 0, air = 0;
    int tangent = 0, pieces = 0;
    for (guint i = 1; i < n; i++) {
        /* A lead that ends in the direction of the first cut. */
        if (i + 1 < n && l[i].motion == NC_LEAD && l[i + 1].motion == NC_CUT) {
            SegVec3 in = seg_unit(seg_sub(l[i].tip, l[i - 1].tip));
            SegVec3 on = seg_unit(seg_sub(l[i + 1].tip, l[i].tip));
            tangent += seg_dot(in, on) > 0.9;
            pieces++;
        }
        *(l[i].motion == NC_CUT ? &cut : &air) += seg_distance(l[i - 1].tip, l[i].tip);
        /* Steel never follows a rapid at once. */
        if (l[i].motion == NC_CUT)
            g_assert_cmpint(l[i - 1].motion, !=, NC_RAPID);
        g_assert_cmpfloat(l[i].tip.z, <=, plan->clearance_mm + 1e-9);
    }
    g_assert_cmpint(pieces, >, 10);
    g_assert_cmpint(tangent, >, pieces * 3 / 4);
    test_near(o->length_mm, cut, 1e-6, 0);
    test_near(o->air_mm, air, 1e-6, 0);
    g_assert_cmpfloat(plan->clearance_mm, >=, c->recipe->allowance_mm + c->recipe->clearance_mm);
    free_rest(c);
}

/* The plan's time is that of the program that is written from it. */
static void time_of_program(void)
{
    char *set[] = {"tools.use=15", NULL};
    g_autoptr(PlanCase) c = top_of(wave, 40, set);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_autoptr(NcProgram) program =
        plan ? nc_program_write(plan, c->recipe, c->machine, NULL, &error) : NULL;
    g_assert_no_error(error);
    if (program) {
        size_t length;
        const char *text = g_bytes_get_data(program->bytes, &length);
        g_autoptr(GArray) moves = nc_read_program(text, length, c->machine, c->tools, &error);
        g_assert_no_error(error);
        if (moves && moves->len > 0) {
            g_autoptr(NcMotion) motion = nc_motion_new(c->machine, NC_NO_OVERRIDE, 0,
                                                       (NcMove *)(void *)moves->data, moves->len);
            double s = nc_motion_total_s(motion);
            g_test_message("program %g s, plan %g s", s, plan->estimated_s);
            test_near(plan->estimated_s, s, 2, 0.02);
        }
    }
    if (c)
        free_rest(c);
}

/* What is left for later is left everywhere, and no more is cut than allowed. */
static void stock_to_leave(void)
{
    char *set[] = {"tools.use=15", "quality.stock_to_leave_mm=0.2", NULL};
    g_autoptr(PlanCase) c = top_of(wave, 80, set);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan && plan->n_operations == 1) {
        check_no_gouge(c, plan);
        double worst;
        double area =
            excess_area_mm2(c, &plan->operations[0], wave,
                            0.2 + c->recipe->scallop_mm + plan->budget.chord_mm + 2e-3, &worst);
        g_test_message("%g mm2 above 0.2 and scallop, worst %g mm", area, worst);
        test_near(area, 0, 0, 0);
    } else {
        g_test_fail();
    }
    if (c)
        free_rest(c);
}

static void add(void)
{
    g_test_add_func("/nc/plan/paths/threads", same_for_threads);
    g_test_add_func("/nc/plan/paths/overlap", overlap);
    g_test_add_func("/nc/plan/paths/shape", shape_of_path);
    g_test_add_func("/nc/plan/paths/time", time_of_program);
    g_test_add_func("/nc/plan/paths/leave", stock_to_leave);
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
