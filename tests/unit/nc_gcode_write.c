/* SPDX-License-Identifier: Apache-2.0 */
/* The writer: text, order, safety, limits, and that what is written reads back as planned. With
 * SEGMILL_GCODE_OUT the programs are left in that folder for LinuxCNC to read. */
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <math.h>
#include <string.h>

static void add_location(NcOperation *operation, double x, double y, double z, NcMotionClass motion)
{
    NcLocation location = {{x, y, z}, {0.0, 0.0, 1.0}, motion};
    g_array_append_val(operation->path.locations, location);
}

static NcOperation new_operation(int32_t region, int tool)
{
    return (NcOperation){
        .region = region,
        .kind = region % 2 ? SEG_REGION_CONVEX : SEG_REGION_CONCAVE,
        .tool = cfg_tools_find(gcode_tools(), tool),
        .feed_mm_min = 1000.0,
        .plunge_mm_min = 300.0,
        .spindle_rpm = 8000.0 + tool,
        .path.locations = g_array_new(FALSE, FALSE, sizeof(NcLocation)),
    };
}

/* Two short passes at depth z, out to the clearance height between them. */
static void add_passes(NcOperation *operation, double x, double z)
{
    add_location(operation, x, 0.0, 5.0, NC_RAPID);
    add_location(operation, x, 0.0, z + 1.0, NC_RAPID);
    add_location(operation, x, 0.0, z, NC_LEAD);
    add_location(operation, x + 10.12345, 0.0, z, NC_CUT);
    add_location(operation, x + 10.12345, 1.0, z, NC_LINK);
    add_location(operation, x, 1.0, z, NC_CUT);
    add_location(operation, x, 1.0, z + 1.0, NC_LEAD);
    add_location(operation, x, 1.0, 5.0, NC_RAPID);
    add_location(operation, x, 2.0, 5.0, NC_RAPID);
    add_location(operation, x, 2.0, z, NC_LEAD);
    add_location(operation, x + 10.0, 2.0, z, NC_CUT);
}

static NcPlan new_plan(NcOperation *operations, size_t n)
{
    return (NcPlan){.operations = operations,
                    .n_operations = n,
                    .budget = {.blend_mm = 0.00245, .rounding_mm = 0.00035},
                    .clearance_mm = 5.0};
}

static void clear_operations(NcOperation *operations, size_t n)
{
    for (size_t i = 0; i < n; i++)
        g_array_unref(operations[i].path.locations);
}

static const char *program_text(const NcProgram *program)
{
    return g_bytes_get_data(program->bytes, NULL);
}

static void keep(const NcProgram *program, const char *name)
{
    const char *folder = g_getenv("SEGMILL_GCODE_OUT");
    if (!folder)
        return;
    g_autofree char *path = g_build_filename(folder, name, NULL);
    gsize length;
    const char *text = g_bytes_get_data(program->bytes, &length);
    g_assert_true(g_file_set_contents(path, text, (gssize)length, NULL));
}

static const char expected_text[] = "(part.igs [sha256 12?])\n"
                                    "(x)\n"
                                    "G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.00245\n"
                                    "G55\n"
                                    "G53 G0 Z1000\n"
                                    "(REGION 3 convex tool=2 feed=1000)\n"
                                    "T2 M6\n"
                                    "G43 H2\n"
                                    "S8002 M3\n"
                                    "X-1 Y0\n"
                                    "Z5\n"
                                    "Z0.5\n"
                                    "G1 Z-0.5 F300\n"
                                    "X9.1235 F1000\n"
                                    "Y1\n"
                                    "X-1\n"
                                    "Z0.5 F300\n"
                                    "G0 Z5\n"
                                    "Y2\n"
                                    "G1 Z-0.5\n"
                                    "X9 F1000\n"
                                    "G0 Z5\n"
                                    "(REGION 4 concave tool=2 feed=1000)\n"
                                    "X20 Y0\n"
                                    "Z0\n"
                                    "G1 Z-1 F300\n"
                                    "X30.1235 F1000\n"
                                    "Y1\n"
                                    "X20\n"
                                    "Z0 F300\n"
                                    "G0 Z5\n"
                                    "Y2\n"
                                    "G1 Z-1\n"
                                    "X30 F1000\n"
                                    "G0 Z5\n"
                                    "(REGION 7 convex tool=1 feed=1000)\n"
                                    "M5\n"
                                    "G53 G0 Z1000\n"
                                    "T1 M6\n"
                                    "G43 H1\n"
                                    "S8001 M3\n"
                                    "X40 Y0\n"
                                    "Z5\n"
                                    "Z-1\n"
                                    "G1 Z-2 F300\n"
                                    "X50.1235 F1000\n"
                                    "Y1\n"
                                    "X40\n"
                                    "Z-1 F300\n"
                                    "G0 Z5\n"
                                    "Y2\n"
                                    "G1 Z-2\n"
                                    "X50 F1000\n"
                                    "G0 Z5\n"
                                    "M5\n"
                                    "M9\n"
                                    "G53 G0 Z1000\n"
                                    "M30\n";

static void text(void)
{
    CfgMachine machine = gcode_machine();
    CfgRecipe recipe = {.wcs = 55};
    NcOperation operations[] = {new_operation(3, 2), new_operation(4, 2), new_operation(7, 1)};
    add_passes(&operations[0], -1.0, -0.5);
    add_passes(&operations[1], 20.0, -1.0);
    add_passes(&operations[2], 40.0, -2.0);
    NcPlan plan = new_plan(operations, G_N_ELEMENTS(operations));
    char *const header[] = {(char *)"part.igs (sha256 12\n)", (char *)"x", NULL};
    g_autoptr(GError) error = NULL;
    g_autoptr(NcProgram) program = nc_program_write(&plan, &recipe, &machine, header, &error);
    g_assert_no_error(error);
    if (program) {
        g_autofree char *copy = g_strndup(program_text(program), g_bytes_get_size(program->bytes));
        g_assert_cmpstr(copy, ==, expected_text);
        g_autofree char *hash = g_compute_checksum_for_string(G_CHECKSUM_SHA256, copy, -1);
        g_assert_cmpstr(program->sha256, ==, hash);
        keep(program, "regions.ngc");
    }
    clear_operations(operations, G_N_ELEMENTS(operations));
}

/* Behind the preamble, behind every way up to the clearance height, and at the end. */
static void gates(void)
{
    static const char *const behind[] = {
        "G55\nG53 G0 Z1000\n", "Z0.5 F300\nG0 Z5\n", "X9 F1000\nG0 Z5\n",  "Z0 F300\nG0 Z5\n",
        "X30 F1000\nG0 Z5\n",  "Z-1 F300\nG0 Z5\n",  "X50 F1000\nG0 Z5\n", "M30\n"};
    CfgMachine machine = gcode_machine();
    g_autoptr(GBytes) bytes = g_bytes_new_static(expected_text, sizeof expected_text - 1);
    g_autoptr(GError) error = NULL;
    g_autoptr(NcProgram) program = nc_program_from_bytes(bytes, &machine, gcode_tools(), &error);
    g_assert_no_error(error);
    if (!program)
        return;
    g_assert_cmpuint(program->n_gates, ==, G_N_ELEMENTS(behind));
    for (size_t i = 0; i < MIN(program->n_gates, G_N_ELEMENTS(behind)); i++) {
        const char *found = strstr(expected_text, behind[i]);
        uint64_t offset = (uint64_t)(found - expected_text) + strlen(behind[i]);
        g_assert_cmpuint(program->gates[i], ==, offset);
    }
}

static void gates_of_others(void)
{
    static const struct {
        const char *program;
        const char *gates[4]; /* the text up to each */
    } cases[] = {
        {"G21 F100\nG0 Z5\nX1\nG1 Z-1\nX2\nG0 Z5\nM2\n",
         {"G21 F100\nG0 Z5\n", "G21 F100\nG0 Z5\nX1\nG1 Z-1\nX2\nG0 Z5\n",
          "G21 F100\nG0 Z5\nX1\nG1 Z-1\nX2\nG0 Z5\nM2\n"}},
        /* the height counts at the tip: 5 with tool 1 is where 5 with tool 4 is */
        {"F9 T1 M6 G43 G0 Z5\nG1 Z0\nT4 M6\nG43 Z5\nM2\n",
         {"F9 T1 M6 G43 G0 Z5\n", "F9 T1 M6 G43 G0 Z5\nG1 Z0\nT4 M6\nG43 Z5\n",
          "F9 T1 M6 G43 G0 Z5\nG1 Z0\nT4 M6\nG43 Z5\nM2\n"}},
        {"F9 G1 Z-3\nX2\nG28 Z-3\nM2\n",
         {"F9 G1 Z-3\nX2\nG28 Z-3\n", "F9 G1 Z-3\nX2\nG28 Z-3\nM2\n"}},
        {"F9\nG1 Z3\nZ-3\nG53 G0 Z1\nG53 Z-2\nM2\n",
         {"F9\nG1 Z3\nZ-3\nG53 G0 Z1\n", "F9\nG1 Z3\nZ-3\nG53 G0 Z1\nG53 Z-2\nM2\n"}},
        /* nothing but machine coordinates: only what raises the tool */
        {"G53 G0 Z-1\nG53 G1 Z-3 F9\nG53 X1\nG53 G0 Z-2\nG53 Z-9\nM2\n",
         {"G53 G0 Z-1\nG53 G1 Z-3 F9\nG53 X1\nG53 G0 Z-2\n",
          "G53 G0 Z-1\nG53 G1 Z-3 F9\nG53 X1\nG53 G0 Z-2\nG53 Z-9\nM2\n"}},
        /* A alone goes home: the tool is as deep as before */
        {"F9 G1 Z-3\nA9\nG28 A9\nG28\nM2\n",
         {"F9 G1 Z-3\nA9\nG28 A9\nG28\n", "F9 G1 Z-3\nA9\nG28 A9\nG28\nM2\n"}},
        {"M2", {"M2"}},
    };
    CfgMachine machine = gcode_machine();
    machine.rotary[0] = (CfgRotary){true, -360.0, 360.0, 3600.0, 1000.0, 0.0};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GBytes) bytes = g_bytes_new_static(cases[i].program, strlen(cases[i].program));
        g_autoptr(GError) error = NULL;
        g_autoptr(NcProgram) program =
            nc_program_from_bytes(bytes, &machine, gcode_tools(), &error);
        g_assert_no_error(error);
        size_t n = 0;
        while (n < G_N_ELEMENTS(cases[i].gates) && cases[i].gates[n])
            n++;
        g_test_message("%s", cases[i].program);
        g_assert_cmpuint(program ? program->n_gates : 0, ==, n);
        for (size_t k = 0; program && k < MIN(n, program->n_gates); k++)
            g_assert_cmpuint(program->gates[k], ==, strlen(cases[i].gates[k]));
    }
}

/* A wild plan, and what its paths must be in the machine, after rounding. */
static NcPlan random_plan(GRand *random, NcOperation *operations, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        NcOperation *operation = &operations[i];
        *operation = new_operation((int32_t)i + 1, g_rand_int_range(random, 1, 5));
        operation->feed_mm_min = g_rand_double_range(random, 1.0, 9000.0);
        for (int k = 0; k < 400; k++) {
            double x = g_rand_double_range(random, -300.0, 300.0);
            double y = g_rand_double_range(random, -0.0004, 0.0004);
            double z = g_rand_double_range(random, -50.0, 5.0);
            NcMotionClass motion = (NcMotionClass)g_rand_int_range(random, 0, 4);
            add_location(operation, x, y, k % 20 == 0 ? 5.0 : z, k % 20 == 0 ? NC_RAPID : motion);
        }
    }
    return new_plan(operations, n);
}

/* The locations come back in order; a rapid between heights has its corner before it. */
static void check_paths(const NcPlan *plan, const GArray *moves, const double shift[3],
                        double rounding_mm)
{
    guint at = 0;
    for (size_t i = 0; i < plan->n_operations; i++) {
        const NcOperation *operation = &plan->operations[i];
        const GArray *locations = operation->path.locations;
        double length = operation->tool->length_mm;
        for (guint k = 0; k < locations->len; k++) {
            const NcLocation *location = &g_array_index(locations, NcLocation, k);
            SegVec3 to = seg_add(location->tip, seg_vec3(shift[0], shift[1], shift[2] + length));
            const NcMove *move = NULL;
            for (; at < moves->len; at++) {
                move = &g_array_index(moves, NcMove, at);
                if (move->region == operation->region && seg_distance(move->to, to) <= rounding_mm)
                    break;
            }
            if (at == moves->len) {
                g_test_message("region %d, location %u is not in the program", operation->region,
                               k);
                g_test_fail();
                return;
            }
            NcMoveKind kind = location->motion == NC_RAPID ? NC_MOVE_RAPID : NC_MOVE_FEED;
            double feed =
                location->motion == NC_LEAD ? operation->plunge_mm_min : operation->feed_mm_min;
            if (k > 0)
                g_assert_cmpint(move->kind, ==, kind);
            if (kind == NC_MOVE_FEED) {
                test_near(move->feed_mm_min, feed, 0.0005, 0.0);
                test_near(move->spindle_rpm, operation->spindle_rpm, 0.0005, 0.0);
            }
            g_assert_cmpint(move->tool, ==, operation->tool->number);
        }
    }
}

/* No rapid goes across and up or down at once, none across below the clearance height but where
 * the plan says so; no cut without the spindle. */
static void check_safety(const GArray *moves)
{
    for (guint i = 0; i < moves->len; i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        bool across = move->from.x != move->to.x || move->from.y != move->to.y;
        if (move->kind == NC_MOVE_RAPID)
            g_assert_false(across && move->from.z != move->to.z);
        if (move->kind == NC_MOVE_FEED)
            g_assert_cmpfloat(move->spindle_rpm, >, 0.0);
        if (move->kind == NC_MOVE_TOOL_CHANGE) {
            g_assert_cmpfloat(move->from.z, ==, 1000.0);
            g_assert_true(i == 0 || g_array_index(moves, NcMove, i - 1).spindle_rpm == 0.0);
        }
    }
}

static void round_trip(void)
{
    CfgMachine machine = gcode_machine();
    CfgRecipe recipe = {.wcs = 55};
    NcOperation operations[12];
    g_autoptr(GRand) random = g_rand_new_with_seed(11);
    NcPlan plan = random_plan(random, operations, G_N_ELEMENTS(operations));
    g_autoptr(GError) error = NULL;
    g_autoptr(NcProgram) program = nc_program_write(&plan, &recipe, &machine, NULL, &error);
    g_assert_no_error(error);
    if (program) {
        keep(program, "random.ngc");
        g_autoptr(GArray) moves =
            nc_read_program(program_text(program), g_bytes_get_size(program->bytes), &machine,
                            gcode_tools(), &error);
        g_autoptr(NcProgram) again =
            nc_program_from_bytes(program->bytes, &machine, gcode_tools(), &error);
        g_assert_no_error(error);
        if (moves && again) {
            check_paths(&plan, moves, machine.work_offset_mm[1], plan.budget.rounding_mm);
            check_safety(moves);
            g_assert_cmpstr(again->sha256, ==, program->sha256);
            g_assert_cmpuint(again->n_gates, ==, program->n_gates);
            for (size_t i = 0; i < MIN(again->n_gates, program->n_gates); i++)
                g_assert_cmpuint(again->gates[i], ==, program->gates[i]);
            g_assert_cmpuint(program->n_gates, >, G_N_ELEMENTS(operations) * 10);
        }
    }
    clear_operations(operations, G_N_ELEMENTS(operations));
}

/* Decimals follow the share of the tolerance; nothing is longer than it must be. */
static void numbers(void)
{
    static const struct {
        double rounding_mm, x;
        const char *word;
    } cases[] = {
        {0.1, 1.23456789, "X1.235"},
        {0.00035, 1.23456789, "X1.2346"},
        {0.0000353, 1.23456789, "X1.23457"},
        {1e-9, 1.23456789, "X1.234568"},
        {0.00035, -0.00004, "X0"},
        {0.00035, 100.00004, "X100"},
        {0.00035, -0.5, "X-0.5"},
        {0.00035, -999.99996, "X-1000"},
        {0.00035, 0.00006, "X0.0001"},
    };
    CfgMachine machine = gcode_machine();
    CfgRecipe recipe = {.wcs = 54};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        NcOperation operation = new_operation(1, 1);
        add_location(&operation, cases[i].x, 0.0, 5.0, NC_RAPID);
        NcPlan plan = new_plan(&operation, 1);
        plan.budget.rounding_mm = cases[i].rounding_mm;
        g_autoptr(NcProgram) program = nc_program_write(&plan, &recipe, &machine, NULL, NULL);
        g_autofree char *block = g_strdup_printf("\n%s Y0\n", cases[i].word);
        g_assert_true(program && g_strstr_len(program_text(program),
                                              (gssize)g_bytes_get_size(program->bytes), block));
        clear_operations(&operation, 1);
    }
}

static void check_refused(const NcPlan *plan, const CfgMachine *machine, int code,
                          const char *message)
{
    CfgRecipe recipe = {.wcs = 55};
    g_autoptr(GError) error = NULL;
    g_autoptr(NcProgram) program = nc_program_write(plan, &recipe, machine, NULL, &error);
    g_assert_null(program);
    g_assert_error(error, NC_ERROR, code);
    if (error && !strstr(error->message, message)) {
        g_test_message("got: %s\nwant: %s", error->message, message);
        g_test_fail();
    }
}

static void refusals(void)
{
    CfgMachine machine = gcode_machine();
    NcOperation operation = new_operation(6, 2);
    NcPlan plan = new_plan(&operation, 1);
    GArray *locations = operation.path.locations;
    check_refused(&plan, &machine, NC_ERROR_PLAN, "region 6 has no moves");
    add_location(&operation, 0.0, 0.0, 5.0, NC_RAPID);
    add_location(&operation, 990.0001, 0.0, 5.0, NC_CUT);
    check_refused(&plan, &machine, NC_ERROR_LIMIT,
                  "region 6: X would go to 1000.0001 mm in machine coordinates with tool 2");
    g_array_index(locations, NcLocation, 1).tip = seg_vec3(990.0, -1020.5, 0.0);
    check_refused(&plan, &machine, NC_ERROR_LIMIT, "region 6: Y would go to -1000.5000 mm");
    g_array_index(locations, NcLocation, 1).tip = seg_vec3(NAN, 0.0, 0.0);
    check_refused(&plan, &machine, NC_ERROR_LIMIT, "region 6: X");
    g_array_index(locations, NcLocation, 1).tip = seg_vec3(990.0, -1020.0, -1000.0);
    plan.clearance_mm = 971.0;
    check_refused(&plan, &machine, NC_ERROR_LIMIT, "region 6: Z would go to 1001.0000 mm");
    plan.clearance_mm = 970.0;
    operation.spindle_rpm = 60000.0;
    check_refused(&plan, &machine, NC_ERROR_LIMIT, "region 6: the spindle cannot turn at 60000");
    operation.spindle_rpm = 6000.0;
    operation.plunge_mm_min = 0.0;
    check_refused(&plan, &machine, NC_ERROR_PLAN, "region 6: feeds of 1000 and 0 mm/min");
    operation.plunge_mm_min = 10.0;
    g_array_index(locations, NcLocation, 1).axis = seg_vec3(0.6, 0.0, 0.8);
    check_refused(&plan, &machine, NC_ERROR_PLAN, "region 6: a tilted tool axis");
    g_array_index(locations, NcLocation, 1).axis = seg_vec3(0.0, 0.0, 1.0);
    plan.budget.blend_mm = 1e-7;
    check_refused(&plan, &machine, NC_ERROR_PLAN, "raise quality.tolerance_mm");
    plan.budget.blend_mm = 1e-3;
    machine.dialect = (char *)"fanuc";
    check_refused(&plan, &machine, NC_ERROR_PLAN, "machine.dialect = fanuc is not known");
    machine.dialect = (char *)"linuxcnc";
    CfgRecipe recipe = {.wcs = 55};
    g_autoptr(NcProgram) program = nc_program_write(&plan, &recipe, &machine, NULL, NULL);
    g_assert_nonnull(program);
    clear_operations(&operation, 1);
}

static void add(void)
{
    g_test_add_func("/nc/gcode/write/text", text);
    g_test_add_func("/nc/gcode/write/gates", gates);
    g_test_add_func("/nc/gcode/write/gates-of-others", gates_of_others);
    g_test_add_func("/nc/gcode/write/round-trip", round_trip);
    g_test_add_func("/nc/gcode/write/numbers", numbers);
    g_test_add_func("/nc/gcode/write/refusals", refusals);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
