/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The experiments of paper P0, printed as they come out: boundary repair (figure 8), the arithmetic
 * of its three percentages, and our own figures on our own three parts. Nothing here is tuned to
 * the paper: its part, its feeds and its machine are not published.
 */
#include <stdio.h>

#include "nc/nc.h"
#include "tests/lib/test.h"

static void print_figure_8(void);
static void print_arithmetic(void);
static void print_parts(void);

int main(void)
{
    print_figure_8();
    print_arithmetic();
    print_parts();
    return 0;
}

static SegPart *load(const char *name, double chord_mm)
{
    g_autofree char *file = g_strconcat("parts/", name, ".igs", NULL);
    g_autofree char *path = test_program(file);
    g_autofree char *helper = test_program("segmill-cad");
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    options.chord_mm = chord_mm;
    g_autoptr(GError) error = NULL;
    SegPart *part = seg_part_load(path, &options, &error);
    if (!part)
        g_error("%s", error->message);
    return part;
}

/* ------------------------------------------------------------- figure 8 */

enum { EXACT_POINTS = 500, REPEATS = 20 };

static SegFeatureSizeParams with_points(int n)
{
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    params.repair = SEG_REPAIR_POINTS;
    params.points = n;
    return params;
}

typedef struct {
    double max_error, mean_error; /* of the diagonal, relative */
    double time_ms;               /* all faces of the part, once */
} Repair;

static Repair measure_repair(const SegPart *part, SegFeatureSizeParams params,
                             const double *exact_mm)
{
    Repair r = {0};
    gint64 start = g_get_monotonic_time();
    for (int i = 0; i < REPEATS; i++)
        for (int32_t f = 0; f < part->n_faces; f++)
            seg_feature_size(part, f, &params, NULL);
    r.time_ms = (double)(g_get_monotonic_time() - start) / 1000 / REPEATS;
    for (int32_t f = 0; f < part->n_faces; f++) {
        double size = seg_feature_size(part, f, &params, NULL).diagonal_mm;
        double error = fabs(size - exact_mm[f]) / exact_mm[f];
        r.max_error = fmax(r.max_error, error);
        r.mean_error += error / part->n_faces;
    }
    return r;
}

static void print_row(const char *label, Repair r)
{
    printf("| %s | %.3f | %.3f | %.3f |\n", label, 100 * r.mean_error, 100 * r.max_error,
           r.time_ms);
}

static void print_figure_8(void)
{
    g_autoptr(SegPart) part = load("impeller", SEG_LOAD_DEFAULTS.chord_mm);
    g_autofree double *exact_mm = g_new(double, (gsize)part->n_faces);
    SegFeatureSizeParams exact = with_points(EXACT_POINTS);
    for (int32_t f = 0; f < part->n_faces; f++)
        exact_mm[f] = seg_feature_size(part, f, &exact, NULL).diagonal_mm;

    printf("## P0, figure 8: boundary repair, impeller of %d faces, %d points an edge as exact\n\n"
           "The paper, its own impeller and machine: 7 points, error 1.37 %%, 812 ms.\n\n"
           "| points added an edge | mean error %% | largest error %% | time ms |\n"
           "|---|---|---|---|\n",
           part->n_faces, EXACT_POINTS);
    for (int n = 0; n <= 20; n++) {
        g_autofree char *label = g_strdup_printf("%d", n);
        print_row(label, measure_repair(part, with_points(n), exact_mm));
    }
    SegFeatureSizeParams rule = SEG_FEATURE_SIZE_DEFAULTS;
    rule.repair = SEG_REPAIR_RULE;
    print_row("8/6/4/2 rule", measure_repair(part, rule, exact_mm));
    SegFeatureSizeParams ours = SEG_FEATURE_SIZE_DEFAULTS;
    print_row("ours: rule and polished extrema", measure_repair(part, ours, exact_mm));
}

/* ------------------------------------------------------------- arithmetic */

static void print_arithmetic(void)
{
    const double area_mm2 = 1440.73, small_s = 10462, large_s = 8162;
    double small = small_s / area_mm2, large = large_s / area_mm2; /* s/mm² with Ø6 and Ø8 */

    printf("\n## P0, its percentages\n\n| case | the paper | by its formula | time saved |\n"
           "|---|---|---|---|\n");
    printf("| experiment: %g s / %g s | 28.18 %% | %.2f %% | %.2f %% |\n", small_s, large_s,
           100 * (small_s / large_s - 1), 100 * (1 - large_s / small_s));
    const struct {
        const char *name, *printed;
        double rest_mm2, local_mm2;
    } cases[] = {{"impeller", "20.14 %", 3391.81 + 5432.81, 2746.51},
                 {"blade", "12.33 %", 735.836, 737.478}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        double one = (cases[i].rest_mm2 + cases[i].local_mm2) * small;
        double two = cases[i].rest_mm2 * large + cases[i].local_mm2 * small;
        printf("| %s, by area | %s | %.2f %% | %.2f %% |\n", cases[i].name, cases[i].printed,
               100 * (one / two - 1), 100 * (1 - two / one));
    }
    printf("\nAt equal feed and scallop the step-over alone gives sqrt(8/6) - 1 = %.1f %%.\n",
           100 * (sqrt(8.0 / 6) - 1));
}

/* ------------------------------------------------------------- our parts */

enum { EQUAL_FEED_MM_MIN = 1000 };

/* The tool table with one feed for every tool, whatever its spindle speed. */
static void equalise_feeds(CfgToolTable *table, const CfgMachine *machine)
{
    for (size_t i = 0; i < table->n_tools; i++) {
        CfgTool *tool = &table->tools[i];
        for (size_t j = 0; j < tool->n_cutting; j++) {
            CfgCutting *c = &tool->cutting[j];
            double rpm = 1000 * c->cutting_speed_m_min / (G_PI * tool->diameter_mm);
            rpm = CLAMP(rpm, machine->spindle_min_rpm, machine->spindle_max_rpm);
            c->feed_per_tooth_mm = EQUAL_FEED_MM_MIN / (rpm * tool->flutes);
        }
    }
}

static void print_plan(const char *name, const char *feeds, const NcPlanInput *input)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(NcPlan) plan = nc_plan_new(input, &error);
    g_autoptr(NcPlan) baseline = plan ? nc_plan_baseline(input, &error) : NULL;
    if (!baseline) {
        printf("| %s | %s | %s ||||\n", name, feeds, error->message);
        return;
    }
    g_autoptr(GString) tools = g_string_new(NULL);
    double reached = 0;
    for (size_t i = 0; i < plan->n_operations; i++) {
        const NcOperation *o = &plan->operations[i];
        reached += o->requested_area_mm2 - o->unreachable_area_mm2;
        g_string_append_printf(tools, "%s%s %s Ø%g", i ? ", " : "", o->region_name,
                               cfg_tool_kind_name(o->tool->kind), o->tool->diameter_mm);
    }
    const CfgTool *one = baseline->operations[0].tool;
    printf("| %s | %s | %s | %s Ø%g | %.0f | %.0f | %.0f | %.2f | %.2f |\n", name, feeds,
           tools->str, cfg_tool_kind_name(one->kind), one->diameter_mm, reached, plan->estimated_s,
           baseline->estimated_s, 100 * (1 - plan->estimated_s / baseline->estimated_s),
           100 * (baseline->estimated_s / plan->estimated_s - 1));
}

static void print_part(const char *name, CfgRecipe *recipe, const CfgMachine *machine)
{
    g_autoptr(GError) error = NULL;
    NcBudget budget;
    if (!nc_budget_share(recipe, &budget, &error))
        g_error("%s", error->message);
    g_autoptr(SegPart) part = load(name, budget.tessellation_mm);
    SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
    params.local_ratio = recipe->feature_size.local_ratio;
    g_autoptr(SegSegmentation) segmentation = seg_segment_feature_size(part, &params, &error);
    g_autoptr(CfgToolTable) table = cfg_tools_load("config/etc/tools.ini", &error);
    g_autoptr(CfgToolTable) equal = cfg_tools_load("config/etc/tools.ini", &error);
    if (!segmentation || !table || !equal)
        g_error("%s", error->message);
    equalise_feeds(equal, machine);

    NcPlanInput input = {part, segmentation, recipe, machine, equal, NULL, NULL};
    print_plan(name, "equal, 1000 mm/min", &input);
    input.tools = table;
    print_plan(name, "our tool table", &input);
}

static void print_parts(void)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgMachine) machine = cfg_machine_load("config/etc/machine.ini", &error);
    if (!machine)
        g_error("%s", error->message);
    printf(
        "\n## P0, our parts: local features and the rest against one tool\n\n"
        "Scallop 0.004 mm as in the paper. Times are estimates with the accelerations of "
        "config/etc/machine.ini, tool changes and air included.\n\n"
        "| part | feeds | tools | one tool | reached mm² | ours s | one tool s | time saved %% | "
        "speed-up %% |\n|---|---|---|---|---|---|---|---|---|\n");
    /* The ratios take the bosses, the splitters with the slivers along the blades, the ends. */
    const struct {
        const char *name;
        const char *set[5];
    } parts[] = {
        {"p0_piece", {"quality.scallop_mm=0.004", "local_ratio=0.4", "keep_out=5,6,8,9,11"}},
        {"impeller", {"quality.scallop_mm=0.004", "local_ratio=0.3"}},
        {"blade", {"quality.scallop_mm=0.004", "local_ratio=0.85", "setup.up=+y"}}};
    for (size_t i = 0; i < G_N_ELEMENTS(parts); i++) {
        g_autofree char *file = g_strconcat("parts/", parts[i].name, ".igs", NULL);
        g_autofree char *path = test_program(file);
        g_autoptr(CfgRecipe) recipe = cfg_recipe_default(path, (char *const *)parts[i].set, &error);
        if (!recipe)
            g_error("%s", error->message);
        print_part(parts[i].name, recipe, machine);
    }
}
