/* SPDX-License-Identifier: Apache-2.0 */
/* Programs judged: scallops against closed forms, programs that are wrong on purpose, stock to
 * leave, threads. The faces are exact surfaces; the programs are written here, not planned. */
#include <math.h>
#include <omp.h>
#include <string.h>

#include "nc/nc.h"
#include "tests/lib/form.h"
#include "tests/lib/plan_case.h"
#include "tests/lib/test.h"

/* Ball Ø6 of the shipped table, and its length. */
#define TOOL 15
#define RADIUS_MM 3.0

#define TOLERANCE_MM 0.01
#define SCALLOP_MM 0.01
#define ALLOWANCE_MM 0.5

static PlanCase *case_of(SegPart *part, const char *leave)
{
    char set[][40] = {"setup.zero=part",
                      "quality.tolerance_mm=0.01",
                      "quality.scallop_mm=0.01",
                      "stock.allowance_mm=0.5",
                      "tools.use=15",
                      "segmentation.method=none",
                      "quality.stock_to_leave_mm="};
    strcat(set[6], leave);
    char *all[] = {set[0], set[1], set[2], set[3], set[4], set[5], set[6], NULL};
    part->chord_mm = 0;
    g_autoptr(GError) error = NULL;
    PlanCase *c = plan_case_new(part, all, &error);
    g_assert_no_error(error);
    return c;
}

/* ---------------------------------------------------------------------- programs */

static GString *program_new(void)
{
    return g_string_new(
        "G17 G21 G40 G49 G80 G90 G94 G61 G54\nT15 M6\nS10000 M3\nG43 H15\nG0 Z40\n");
}

static NcVerdict *judge(const PlanCase *c, GString *program)
{
    g_string_append(program, "G0 Z40\nM30\n");
    g_autoptr(GError) error = NULL;
    g_autoptr(GArray) moves =
        nc_read_program(program->str, program->len, c->machine, c->tools, &error);
    g_assert_no_error(error);
    g_string_free(program, true);
    NcVerdict *verdict =
        moves ? nc_verify(&c->input, (const NcMove *)(const void *)moves->data, moves->len, &error)
              : NULL;
    g_assert_no_error(error);
    return verdict;
}

static uint32_t lines_of(const GString *program)
{
    uint32_t n = 1;
    for (const char *c = program->str; *c; c++)
        n += *c == '\n';
    return n;
}

/* Rows along X over a plane, 12 × 8 mm, from below to above it in Y; row `i` at z[i]. */
#define STEP_MM 0.4
#define ROWS 31
static const double cusp_mm = RADIUS_MM - 2.993325909419153; /* √(9 - 0.2²) */

static void add_rows(GString *program, const double z[ROWS], int skip_from, int skip_to,
                     uint32_t lines[ROWS])
{
    bool back = false;
    for (int i = 0; i < ROWS; i++) {
        if (i >= skip_from && i < skip_to)
            continue;
        double y = STEP_MM * (i - 5);
        g_string_append_printf(program, "G0 X%d Y%.6f\nG1 Z%.6f F1000\n", back ? 18 : -6, y, z[i]);
        lines[i] = lines_of(program);
        g_string_append_printf(program, "G1 X%d\nG0 Z5\n", back ? -6 : 18);
        back = !back;
    }
}

static SegPart *plane(void)
{
    g_autoptr(Form) form = form_new();
    const double unit[4] = {0, 0, 1, 1};
    const double poles[] = {0, 0, 0, 0, 8, 0, 12, 0, 0, 12, 8, 0};
    form_patch(form, SEG_SURFACE_PLANE, form_surface(form, 1, 2, 1, 2, unit, unit, poles, NULL));
    return form_part(form);
}

/* ---------------------------------------------------------------------- scallops */

static void check_scallops(const NcVerdict *verdict, double cusp)
{
    if (!verdict)
        return;
    const NcJudgement *whole = &verdict->whole;
    g_test_message("gouge %g, excess %g of %g, pitch share %g", whole->gouge_max.depth_mm,
                   whole->excess_max.depth_mm, cusp, whole->pitch_share);
    test_near(whole->excess_max.depth_mm, cusp, 0, 0.02);
    test_near(whole->gouge_max.depth_mm, 0, 2 * 1e-4, 0);
    g_assert_cmpfloat(whole->excess_p99_mm, <=, whole->excess_max.depth_mm);
    g_assert_cmpfloat(whole->excess_p99_mm, >, 0.9 * cusp);
    g_assert_cmpfloat(whole->coverage_percent, ==, 100);
    g_assert_cmpfloat(whole->within_tolerance_percent, ==, 100);
    g_assert_cmpfloat(whole->pitch_share, >, 0);
    g_assert_cmpfloat(whole->pitch_share, <=, 0.05 + 1e-9);
    g_assert_cmpuint(verdict->n_regions, ==, 1);
    g_assert_true(verdict->in_tolerance);
}

static void scallops_plane(void)
{
    PlanCase *c = case_of(plane(), "0");
    if (!c)
        return;
    GString *program = program_new();
    const double z[ROWS] = {0};
    uint32_t lines[ROWS];
    add_rows(program, z, 0, 0, lines);
    g_autoptr(NcVerdict) verdict = judge(c, program);
    check_scallops(verdict, cusp_mm);
    if (verdict) {
        test_near(verdict->whole.requested_area_mm2, 96, 1e-9, 0);
        test_near(verdict->regions[0].stepover_mm, STEP_MM, 1e-6, 0);
        double feeds_s = ROWS * 24 / (1000 / 60.0);
        g_assert_cmpfloat(verdict->cut_s, >, feeds_s);
    }
    plan_case_free(c);
}

/* Height over a circle of radius rho of the cusp between balls φ apart, from the triangle of the
 * circle's centre, a ball's centre and the cusp. */
static double cusp_on_circle(double rho, double apart)
{
    double centre = rho + RADIUS_MM, x = centre * sin(apart / 2);
    return centre * cos(apart / 2) - sqrt(RADIUS_MM * RADIUS_MM - x * x) - rho;
}

#define RHO_MM 20.0

/* 60° of a cylinder about X, its top at z = 0, 10 mm long. */
static void scallops_cylinder(void)
{
    const double half = G_PI / 6, s = RHO_MM * sin(half), z = RHO_MM * (cos(half) - 1);
    const double w = cos(half), top = RHO_MM / w - RHO_MM;
    const double arc[6] = {0, 0, 0, 1, 1, 1}, line[4] = {0, 0, 1, 1};
    const double poles[] = {0, -s, z, 10, -s, z, 0, 0, top, 10, 0, top, 0, s, z, 10, s, z};
    const double weights[] = {1, 1, w, w, 1, 1};
    g_autoptr(Form) form = form_new();
    form_patch(form, SEG_SURFACE_CYLINDER,
               form_surface(form, 2, 3, 1, 2, arc, line, poles, weights));
    PlanCase *c = case_of(form_part(form), "0");
    if (!c)
        return;
    GString *program = program_new();
    const double apart = G_PI / 180;
    for (int i = -36; i <= 36; i++) {
        double angle = (i + 0.3) * apart, centre = RHO_MM + RADIUS_MM;
        g_string_append_printf(program, "G0 X-5 Y%.6f\nG1 Z%.6f F1000\nG1 X15\nG0 Z5\n",
                               centre * sin(angle), centre * cos(angle) - RADIUS_MM - RHO_MM);
    }
    g_autoptr(NcVerdict) verdict = judge(c, program);
    check_scallops(verdict, cusp_on_circle(RHO_MM, apart));
    plan_case_free(c);
}

/* From 20° to 50° off the pole of a sphere and 90° around it, in circles of G3. */
static void scallops_sphere(void)
{
    const double a = 20 * G_PI / 180, b = 50 * G_PI / 180, m = (a + b) / 2, wa = cos((b - a) / 2);
    const double r[] = {sin(a), sin(m) / wa, sin(b)}, z[] = {cos(a), cos(m) / wa, cos(b)};
    const double x[] = {1, 1, 0}, y[] = {0, 1, 1}, wm[] = {1, wa, 1}, wt[] = {1, sqrt(0.5), 1};
    const double arc[6] = {0, 0, 0, 1, 1, 1};
    double poles[27], weights[9];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            poles[3 * (3 * i + k)] = RHO_MM * r[i] * x[k];
            poles[3 * (3 * i + k) + 1] = RHO_MM * r[i] * y[k];
            poles[3 * (3 * i + k) + 2] = RHO_MM * z[i] - RHO_MM;
            weights[3 * i + k] = wm[i] * wt[k];
        }
    g_autoptr(Form) form = form_new();
    form_patch(form, SEG_SURFACE_SPHERE, form_surface(form, 2, 3, 2, 3, arc, arc, poles, weights));
    PlanCase *c = case_of(form_part(form), "0");
    if (!c)
        return;
    GString *program = program_new();
    const double apart = G_PI / 180;
    for (int i = 14; i <= 56; i++) {
        double circle = (RHO_MM + RADIUS_MM) * sin(i * apart);
        double tip = (RHO_MM + RADIUS_MM) * cos(i * apart) - RADIUS_MM - RHO_MM;
        g_string_append_printf(
            program, "G0 X%.6f Y%.6f\nG1 Z%.6f F1000\nG3 X%.6f Y%.6f I%.6f J%.6f\nG0 Z5\n",
            circle * cos(-0.3), circle * sin(-0.3), tip, circle * cos(1.9), circle * sin(1.9),
            -circle * cos(-0.3), -circle * sin(-0.3));
    }
    g_autoptr(NcVerdict) verdict = judge(c, program);
    check_scallops(verdict, cusp_on_circle(RHO_MM, apart));
    plan_case_free(c);
}

/* ---------------------------------------------------------------- wrong programs */

/* One row is 0.02 mm too low: found there, in its line, 0.02 mm deep. */
static void gouge(void)
{
    PlanCase *c = case_of(plane(), "0");
    if (!c)
        return;
    GString *program = program_new();
    double z[ROWS] = {0};
    z[14] = -0.02;
    uint32_t lines[ROWS];
    add_rows(program, z, 0, 0, lines);
    g_autoptr(NcVerdict) verdict = judge(c, program);
    if (verdict) {
        test_near(verdict->whole.gouge_max.depth_mm, 0.02, 1e-6, 0);
        test_near(verdict->whole.gouge_max.point.y, STEP_MM * 9, 2e-3, 0);
        g_assert_cmpuint(verdict->whole.gouge_max.line, ==, lines[14]);
        test_near(verdict->whole.excess_max.depth_mm, cusp_mm, 0, 0.02);
        /* Deeper than the tolerance over this width: */
        double wide = 2 * sqrt(2 * RADIUS_MM * 0.01 - 0.01 * 0.01);
        test_near(verdict->whole.within_tolerance_percent, 100 * (1 - wide / 8), 0.1, 0);
        g_assert_cmpfloat(verdict->whole.coverage_percent, ==, 100);
        g_assert_false(verdict->in_tolerance);
    }
    plan_case_free(c);
}

/* Four rows are left out: the strip between the rows beside it is measured in height and width. */
static void uncut_strip(void)
{
    PlanCase *c = case_of(plane(), "0");
    if (!c)
        return;
    GString *program = program_new();
    const double z[ROWS] = {0};
    uint32_t lines[ROWS];
    add_rows(program, z, 12, 16, lines);
    g_autoptr(NcVerdict) verdict = judge(c, program);
    if (verdict) {
        double half = 5 * STEP_MM / 2, limit = SCALLOP_MM + TOLERANCE_MM;
        double height = RADIUS_MM - sqrt(RADIUS_MM * RADIUS_MM - half * half);
        test_near(verdict->whole.excess_max.depth_mm, height, 0, 1e-3);
        test_near(verdict->whole.excess_max.point.y, STEP_MM * (13.5 - 5), 2e-3, 0);
        double strip = 2 * (half - sqrt(limit * (2 * RADIUS_MM - limit)));
        test_near(verdict->whole.coverage_percent, 100 * (1 - strip / 8), 0.1, 0);
        test_near(verdict->whole.within_tolerance_percent, 100 * (1 - strip / 8), 0.1, 0);
        test_near(verdict->whole.gouge_max.depth_mm, 0, 1e-6, 0);
        g_assert_cmpuint(verdict->collisions->len, ==, 0);
        g_assert_false(verdict->in_tolerance);
    }
    plan_case_free(c);
}

/* Nothing is cut: all of the stock is left, and no line is to blame. */
static void uncut(void)
{
    PlanCase *c = case_of(plane(), "0");
    if (!c)
        return;
    g_autoptr(NcVerdict) verdict = judge(c, program_new());
    if (verdict) {
        g_assert_cmpfloat(verdict->whole.excess_max.depth_mm, ==, ALLOWANCE_MM);
        g_assert_cmpuint(verdict->whole.excess_max.line, ==, 0);
        g_assert_cmpfloat(verdict->whole.coverage_percent, ==, 0);
        g_assert_cmpfloat(verdict->whole.within_tolerance_percent, ==, 0);
        g_assert_cmpfloat(verdict->cut_s, ==, 0);
    }
    plan_case_free(c);
}

/* One rapid goes through the stock where rows will come anyway: only the collision tells. */
static void rapid_through_stock(void)
{
    PlanCase *c = case_of(plane(), "0");
    if (!c)
        return;
    GString *program = program_new();
    g_string_append(program, "G0 X-6 Y4\nG0 Z0.1\n");
    uint32_t line = lines_of(program);
    g_string_append(program, "G0 X18\nG0 Z5\n");
    const double z[ROWS] = {0};
    uint32_t lines[ROWS];
    add_rows(program, z, 0, 0, lines);
    g_autoptr(NcVerdict) verdict = judge(c, program);
    if (verdict) {
        g_assert_cmpuint(verdict->collisions->len, ==, 1);
        g_assert_true(verdict->whole.gouge_max.depth_mm <= TOLERANCE_MM);
        g_assert_true(verdict->whole.excess_max.depth_mm <= SCALLOP_MM + TOLERANCE_MM);
        g_assert_false(verdict->in_tolerance);
    }
    for (guint i = 0; verdict && i < verdict->collisions->len; i++) {
        const NcCollision *hit = &g_array_index(verdict->collisions, NcCollision, i);
        g_assert_cmpint(hit->kind, ==, NC_COLLISION_RAPID);
        g_assert_cmpuint(hit->line, ==, line);
        test_near(hit->depth_mm, ALLOWANCE_MM - 0.1, 0.05, 0);
        test_near(hit->position.y, 4, 2, 0);
    }
    plan_case_free(c);
}

/* With 0.1 mm to be left the limits move up with it. */
static void leave(void)
{
    PlanCase *c = case_of(plane(), "0.1");
    if (!c)
        return;
    for (int i = 0; i < 2; i++) {
        GString *program = program_new();
        double z[ROWS];
        for (int k = 0; k < ROWS; k++)
            z[k] = i == 0 ? 0.1 : 0.08;
        uint32_t lines[ROWS];
        add_rows(program, z, 0, 0, lines);
        g_autoptr(NcVerdict) verdict = judge(c, program);
        if (!verdict)
            continue;
        test_near(verdict->whole.gouge_max.depth_mm, i == 0 ? 0 : 0.02, 1e-6, 0);
        test_near(verdict->whole.excess_max.depth_mm, i == 0 ? cusp_mm : 0, 1e-6, 0.02);
        g_assert_true(verdict->in_tolerance == (i == 0));
    }
    plan_case_free(c);
}

/* ----------------------------------------------------------------------- the rest */

static double wave(double x, double y)
{
    return 0.5 * sin(x / 2) * cos(y / 2);
}

static int on_top(const SegPart *part, int32_t triangle)
{
    const int32_t *v = part->triangles[triangle].vertex;
    SegVec3 a = part->vertices[v[0]].position, b = part->vertices[v[1]].position;
    SegVec3 c = part->vertices[v[2]].position;
    return seg_unit(seg_cross(seg_sub(b, a), seg_sub(c, a))).z > 0.1;
}

/* A mesh: its triangles are what is wanted. Planned, it is in tolerance. */
static void mesh(void)
{
    char *set[] = {(char *)"segmentation.method=none", (char *)"tools.use=15",
                   (char *)"quality.scallop_mm=0.02",  (char *)"quality.tolerance_mm=0.02",
                   (char *)"setup.zero=part",          NULL};
    g_autoptr(GError) error = NULL;
    PlanCase *c = plan_case_new(plan_case_height_field(12, 60, -5, wave), set, &error);
    g_assert_no_error(error);
    if (c)
        plan_case_split(c, 1, on_top);
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_autoptr(NcProgram) program =
        plan ? nc_program_write(plan, c->recipe, c->machine, NULL, &error) : NULL;
    g_assert_no_error(error);
    if (!program)
        return;
    size_t length;
    const char *text = g_bytes_get_data(program->bytes, &length);
    g_autoptr(GArray) moves = nc_read_program(text, length, c->machine, c->tools, &error);
    g_assert_no_error(error);
    g_autoptr(NcVerdict) verdict =
        moves ? nc_verify(&c->input, (const NcMove *)(const void *)moves->data, moves->len, &error)
              : NULL;
    g_assert_no_error(error);
    if (verdict) {
        g_test_message("gouge %g, excess %g, within %g %%", verdict->whole.gouge_max.depth_mm,
                       verdict->whole.excess_max.depth_mm, verdict->whole.within_tolerance_percent);
        g_assert_cmpfloat(verdict->whole.gouge_max.depth_mm, <=, 0.02);
        g_assert_cmpfloat(verdict->whole.within_tolerance_percent, >, 99.9);
        g_assert_cmpuint(verdict->collisions->len, ==, 0);
    }
    plan_case_free(c);
}

/* A cubic metre around a small part: a wider pitch, not an error that nobody could act on. */
static void large_box(void)
{
    char *set[] = {(char *)"segmentation.method=none",
                   (char *)"tools.use=15",
                   (char *)"setup.zero=part",
                   (char *)"stock.kind=box",
                   (char *)"stock.min_mm=-500,-500,-999",
                   (char *)"stock.max_mm=500,500,1",
                   NULL};
    SegPart *part = plane();
    part->chord_mm = 0;
    g_autoptr(GError) error = NULL;
    PlanCase *c = plan_case_new(part, set, &error);
    g_assert_no_error(error);
    g_autoptr(NcVerdict) verdict = c ? judge(c, program_new()) : NULL;
    if (verdict) {
        g_assert_cmpfloat(verdict->collision_pitch_mm, >, 0.3);
        test_near(verdict->whole.excess_max.depth_mm, 1, verdict->collision_pitch_mm, 0);
    } else {
        g_test_fail_printf("no verdict");
    }
    plan_case_free(c);
}

/* Everything is gone, and everything is left of a high box: told as at least so much, in no time.
 */
static void far_off(void)
{
    char *set[] = {(char *)"segmentation.method=none",
                   (char *)"tools.use=15",
                   (char *)"setup.zero=part",
                   (char *)"stock.kind=box",
                   (char *)"stock.min_mm=-20,-20,-20",
                   (char *)"stock.max_mm=20,20,30",
                   NULL};
    for (int i = 0; i < 2; i++) {
        SegPart *part = plane();
        part->chord_mm = 0;
        g_autoptr(GError) error = NULL;
        PlanCase *c = plan_case_new(part, set, &error);
        g_assert_no_error(error);
        if (!c)
            return;
        GString *program = program_new();
        double z[ROWS];
        for (int k = 0; k < ROWS; k++)
            z[k] = -11;
        uint32_t lines[ROWS];
        if (i == 0)
            add_rows(program, z, 0, 0, lines);
        g_autoptr(NcVerdict) verdict = judge(c, program);
        if (verdict) {
            g_assert_cmpfloat(verdict->whole.gouge_max.depth_mm, ==,
                              i == 0 ? NC_VERIFY_MOST_MM : 0);
            g_assert_cmpfloat(verdict->whole.excess_max.depth_mm, ==,
                              i == 0 ? 0 : NC_VERIFY_MOST_MM);
        }
        plan_case_free(c);
    }
}

static void threads(void)
{
    PlanCase *c = case_of(plane(), "0");
    if (!c)
        return;
    double z[ROWS] = {0};
    z[10] = -0.015;
    NcVerdict *verdicts[2];
    for (int i = 0; i < 2; i++) {
        GString *program = program_new();
        uint32_t lines[ROWS];
        add_rows(program, z, 20, 22, lines);
        omp_set_num_threads(i == 0 ? 1 : 3);
        verdicts[i] = judge(c, program);
    }
    omp_set_num_threads(omp_get_num_procs());
    if (verdicts[0] && verdicts[1]) {
        const NcJudgement *a = &verdicts[0]->whole, *b = &verdicts[1]->whole;
        g_assert_cmpfloat(a->gouge_max.depth_mm, ==, b->gouge_max.depth_mm);
        g_assert_cmpfloat(a->gouge_max.point.x, ==, b->gouge_max.point.x);
        g_assert_cmpfloat(a->excess_max.depth_mm, ==, b->excess_max.depth_mm);
        g_assert_cmpfloat(a->excess_p99_mm, ==, b->excess_p99_mm);
        g_assert_cmpfloat(a->coverage_percent, ==, b->coverage_percent);
        g_assert_cmpfloat(a->profile_pitch_mm, ==, b->profile_pitch_mm);
        g_assert_cmpuint(verdicts[0]->n_spots, ==, verdicts[1]->n_spots);
        size_t n = MIN(verdicts[0]->n_spots, verdicts[1]->n_spots), other = 0;
        for (size_t i = 0; i < n; i++)
            other += verdicts[0]->spots[i].deviation_mm != verdicts[1]->spots[i].deviation_mm;
        g_assert_cmpuint(other, ==, 0);
    }
    for (int i = 0; i < 2; i++)
        nc_verdict_free(verdicts[i]);
    plan_case_free(c);
}

static void add(void)
{
    g_test_add_func("/nc/verify/scallops-plane", scallops_plane);
    g_test_add_func("/nc/verify/scallops-cylinder", scallops_cylinder);
    g_test_add_func("/nc/verify/scallops-sphere", scallops_sphere);
    g_test_add_func("/nc/verify/gouge", gouge);
    g_test_add_func("/nc/verify/uncut-strip", uncut_strip);
    g_test_add_func("/nc/verify/uncut", uncut);
    g_test_add_func("/nc/verify/rapid-through-stock", rapid_through_stock);
    g_test_add_func("/nc/verify/stock-to-leave", leave);
    g_test_add_func("/nc/verify/mesh", mesh);
    g_test_add_func("/nc/verify/large-box", large_box);
    g_test_add_func("/nc/verify/far-off", far_off);
    g_test_add_func("/nc/verify/threads", threads);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
