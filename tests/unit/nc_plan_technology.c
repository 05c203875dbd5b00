/* SPDX-License-Identifier: Apache-2.0 */
/* What tools reach, which one a region gets, and what is refused. */
#include <string.h>

#include "tests/lib/plan_case.h"
#include "tests/lib/test.h"

static SegVec3 normal_of(const SegPart *part, int32_t t)
{
    const int32_t *v = part->triangles[t].vertex;
    SegVec3 a = part->vertices[v[0]].position, b = part->vertices[v[1]].position;
    return seg_unit(seg_cross(seg_sub(b, a), seg_sub(part->vertices[v[2]].position, a)));
}

/* 1: ground at z = 0; 2: the rest. */
static int floor_only(const SegPart *part, int32_t t)
{
    double z = part->vertices[part->triangles[t].vertex[0]].position.z;
    return normal_of(part, t).z > 0.9 && fabs(z) < 1e-9 ? 1 : 2;
}

static int walls_first(const SegPart *part, int32_t t)
{
    return fabs(normal_of(part, t).z) < 0.1 ? 1 : 2;
}

static PlanCase *boxes_case(const double (*boxes)[6], int n, char *const *set,
                            int (*region_of)(const SegPart *, int32_t))
{
    g_autoptr(GError) error = NULL;
    PlanCase *c = plan_case_new(plan_case_boxes(boxes, n), set, &error);
    g_assert_no_error(error);
    if (c && region_of) {
        plan_case_split(c, 2, region_of);
        c->segmentation->n_regions = 1; /* only the first is asked for */
    }
    return c;
}

static void case_free(PlanCase *c)
{
    if (c && strcmp(c->segmentation->regions[0].name, "part") != 0)
        c->segmentation->n_regions = 2;
    plan_case_free(c);
}

static bool has_note(const NcPlan *plan, const char *text)
{
    for (guint i = 0; i < plan->notes->len; i++)
        if (strstr(plan->notes->pdata[i], text))
            return true;
    for (guint i = 0; i < plan->notes->len; i++)
        g_test_message("note: %s", (char *)plan->notes->pdata[i]);
    return false;
}

static const double one_box[1][6] = {{0, 0, 0, 20, 20, 10}};

/* A box: its bottom cannot be reached; of the walls a ball leaves a strip as high as its radius,
 * and planes touch no wall at all. */
static void box_unreachable(void)
{
    char *set[] = {"tools.use=15", NULL}; /* ball 6 mm */
    PlanCase *c = boxes_case(one_box, 1, set, NULL);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan && plan->n_operations == 1) {
        test_near(plan->operations[0].requested_area_mm2, 1600, 1e-6, 0);
        test_near(plan->operations[0].unreachable_area_mm2, 400 + 800, 0, 0.01);
        g_assert_true(has_note(plan, "of 1600 mm² reachable in three axes from +Z"));
        g_assert_true(has_note(plan, "400 facing down"));
        g_assert_true(has_note(plan, "mm² that the tool can reach are left by iso-planar"));
    } else {
        g_test_fail();
    }
    case_free(c);
}

/* A plate over a narrower block: its walls are covered. */
static void undercut(void)
{
    static const double boxes[2][6] = {{5, 5, 0, 15, 15, 10}, {0, 0, 10, 20, 20, 12}};
    PlanCase *c = boxes_case(boxes, 2, NULL, NULL);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    /* Block: walls 400, ends 2·100; plate: bottom 400, walls 160. */
    if (plan && plan->n_operations == 1)
        test_near(plan->operations[0].unreachable_area_mm2, 400 + 200 + 400 + 160, 0, 0.01);
    else
        g_test_fail();
    case_free(c);
}

static const double slot[3][6] = {
    {0, 0, -5, 45, 30, 0}, {0, 0, 0, 20, 30, 10}, {25, 0, 0, 45, 30, 10}};

static void narrow_slot(void)
{
    PlanCase *c = boxes_case(slot, 3, NULL, floor_only);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan && plan->n_operations == 1) {
        const CfgTool *tool = plan->operations[0].tool;
        g_assert_cmpint(tool->kind, ==, CFG_TOOL_FLAT);
        test_near(tool->diameter_mm, 4, 0, 0);
    } else {
        g_test_fail();
    }
    case_free(c);
}

/* The same floor without walls takes the widest flat tool. */
static void open_floor(void)
{
    static const double plate[1][6] = {{0, 0, -5, 60, 60, 0}};
    PlanCase *c = boxes_case(plate, 1, NULL, floor_only);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan && plan->n_operations == 1) {
        g_assert_cmpint(plan->operations[0].tool->kind, ==, CFG_TOOL_FLAT);
        test_near(plan->operations[0].tool->diameter_mm, 20, 0, 0);
        test_near(plan->operations[0].unreachable_area_mm2, 0, 1e-9, 0);
    } else {
        g_test_fail();
    }
    case_free(c);
}

/* Deeper than any tool that fits is long: no operation, and the note says whose fault it is. */
static void holder_stops(void)
{
    static const double deep[3][6] = {
        {0, 0, -5, 45, 30, 0}, {0, 0, 0, 20, 30, 40}, {25, 0, 0, 45, 30, 40}};
    PlanCase *c = boxes_case(deep, 3, NULL, floor_only);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan) {
        g_assert_cmpuint(plan->n_operations, ==, 0);
        g_assert_true(has_note(plan, "because of shank or holder"));
    } else {
        g_test_fail();
    }
    case_free(c);
}

static void check_refused(const double (*boxes)[6], int n, char *const *set,
                          int (*region_of)(const SegPart *, int32_t), const char *const *words)
{
    PlanCase *c = boxes_case(boxes, n, set, region_of);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    if (plan)
        g_test_message("not refused: %s", words[0]);
    g_assert_null(plan);
    g_assert_error(error, NC_ERROR, NC_ERROR_PLAN);
    for (; error && *words; words++) {
        if (!strstr(error->message, *words))
            g_test_message("'%s' is not in: %s", *words, error->message);
        g_assert_nonnull(strstr(error->message, *words));
    }
    case_free(c);
}

static void refusals(void)
{
    static const char *const depth[] = {"region 1 'part'", "tool 1 (flat Ø1)", "1.5 mm", NULL};
    char *deep[] = {"stock.allowance_mm=1.5", "tools.use=1", NULL};
    check_refused(one_box, 1, deep, NULL, depth);

    static const char *const material[] = {"tool 15 (ball Ø6)", "unobtainium", NULL};
    char *unknown[] = {"stock.material=unobtainium", "tools.use=15", NULL};
    check_refused(one_box, 1, unknown, NULL, material);

    static const char *const absent[] = {"tool 777", NULL};
    char *no_tool[] = {"tools.use=777", NULL};
    check_refused(one_box, 1, no_tool, NULL, absent);

    static const char *const triangles[] = {"region.part", "only triangles", NULL};
    char *parametric[] = {"region.part.strategy=iso-parametric", NULL};
    check_refused(one_box, 1, parametric, NULL, triangles);

    static const char *const budget[] = {"part.chord_mm", "quality.tolerance_mm", NULL};
    char *coarse[] = {"part.chord_mm=0.019", "quality.tolerance_mm=0.02", NULL};
    check_refused(one_box, 1, coarse, NULL, budget);

    static const char *const leave[] = {"stock_to_leave_mm", "allowance_mm", NULL};
    char *all[] = {"quality.stock_to_leave_mm=0.6", NULL};
    check_refused(one_box, 1, all, NULL, leave);

    /* Walls can be reached, but planes make no moves on them: said, not passed over. */
    static const char *const walls[] = {"region 1 'region-1'", "touch none of it", NULL};
    char *none[] = {NULL};
    check_refused(one_box, 1, none, walls_first, walls);
}

/* rpm = 1000 vc / (π D), feed = rpm z fz; and the recipe's own numbers instead. */
static void cutting_data(void)
{
    char *set[] = {"tools.use=16", "stock.material=steel-c45", NULL}; /* ball 8 mm */
    PlanCase *c = boxes_case(one_box, 1, set, NULL);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan && plan->n_operations == 1) {
        const NcOperation *o = &plan->operations[0];
        const CfgCutting *cutting = NULL;
        for (size_t i = 0; i < o->tool->n_cutting; i++)
            if (strcmp(o->tool->cutting[i].material, "steel-c45") == 0)
                cutting = &o->tool->cutting[i];
        double rpm = 1000 * cutting->cutting_speed_m_min / (G_PI * 8);
        test_near(o->spindle_rpm, rpm, 0.5, 0);
        test_near(o->feed_mm_min, rpm * o->tool->flutes * cutting->feed_per_tooth_mm, 1, 0);
    } else {
        g_test_fail();
    }
    case_free(c);

    char *own[] = {"region.part.tool=7", "region.part.feed=333", "region.part.spindle=4444", NULL};
    c = boxes_case(one_box, 1, own, NULL);
    g_autoptr(NcPlan) second = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (second && second->n_operations == 1) {
        g_assert_cmpint(second->operations[0].tool->number, ==, 7);
        test_near(second->operations[0].feed_mm_min, 333, 0, 0);
        test_near(second->operations[0].spindle_rpm, 4444, 0, 0);
    } else {
        g_test_fail();
    }
    case_free(c);
}

static void skipped(void)
{
    char *set[] = {"region.part.skip=true", NULL};
    PlanCase *c = boxes_case(one_box, 1, set, NULL);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = c ? nc_plan_new(&c->input, &error) : NULL;
    g_assert_no_error(error);
    if (plan) {
        g_assert_cmpuint(plan->n_operations, ==, 0);
        g_assert_true(has_note(plan, "skipped by the recipe"));
    } else {
        g_test_fail();
    }
    case_free(c);
}

static void setup_transform(void)
{
    g_autoptr(SegPart) part = plan_case_boxes(one_box, 1);
    static const struct {
        CfgUp up;
        SegVec3 direction;
        double height;
    } cases[] = {{CFG_UP_PLUS_X, {1, 0, 0}, 20}, {CFG_UP_MINUS_X, {-1, 0, 0}, 20},
                 {CFG_UP_PLUS_Y, {0, 1, 0}, 20}, {CFG_UP_MINUS_Y, {0, -1, 0}, 20},
                 {CFG_UP_PLUS_Z, {0, 0, 1}, 10}, {CFG_UP_MINUS_Z, {0, 0, -1}, 10}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        NcSetup setup = nc_setup_new(part, cases[i].up, CFG_ZERO_TOP_CENTRE);
        SegVec3 up = nc_setup_direction(&setup, cases[i].direction);
        test_near(up.z, 1, 0, 0);
        SegVec3 x = nc_setup_direction(&setup, seg_vec3(1, 0, 0));
        SegVec3 y = nc_setup_direction(&setup, seg_vec3(0, 1, 0));
        SegVec3 z = nc_setup_direction(&setup, seg_vec3(0, 0, 1));
        test_near(seg_dot(seg_cross(x, y), z), 1, 0, 0); /* no mirror */
        SegVec3 middle = nc_setup_point(&setup, seg_vec3(10, 10, 5));
        test_near(middle.x, 0, 1e-12, 0);
        test_near(middle.y, 0, 1e-12, 0);
        test_near(middle.z, -cases[i].height / 2, 1e-12, 0);
        NcSetup corner = nc_setup_new(part, cases[i].up, CFG_ZERO_BOTTOM_CORNER);
        test_near(nc_setup_point(&corner, seg_vec3(10, 10, 5)).z, cases[i].height / 2, 1e-12, 0);
    }
    NcSetup own = nc_setup_new(part, CFG_UP_PLUS_Z, CFG_ZERO_PART);
    test_near(seg_distance(nc_setup_point(&own, seg_vec3(1, 2, 3)), seg_vec3(1, 2, 3)), 0, 0, 0);
}

static void budget(void)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgRecipe) recipe = cfg_recipe_default("part", NULL, &error);
    NcBudget share;
    g_assert_true(recipe && nc_budget_share(recipe, &share, &error));
    g_assert_no_error(error);
    double sum = share.tessellation_mm + share.chord_mm + share.blend_mm + share.rounding_mm;
    test_near(sum, recipe ? recipe->tolerance_mm : 0, 0, 1e-12);
}

static void add(void)
{
    g_test_add_func("/nc/plan/technology/setup", setup_transform);
    g_test_add_func("/nc/plan/technology/budget", budget);
    g_test_add_func("/nc/plan/technology/box", box_unreachable);
    g_test_add_func("/nc/plan/technology/undercut", undercut);
    g_test_add_func("/nc/plan/technology/narrow-slot", narrow_slot);
    g_test_add_func("/nc/plan/technology/open-floor", open_floor);
    g_test_add_func("/nc/plan/technology/holder", holder_stops);
    g_test_add_func("/nc/plan/technology/refusals", refusals);
    g_test_add_func("/nc/plan/technology/cutting-data", cutting_data);
    g_test_add_func("/nc/plan/technology/skip", skipped);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
