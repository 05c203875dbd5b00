/* SPDX-License-Identifier: Apache-2.0 */
/* Writing, reading and timing a program of a million short moves. */
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "tests/lib/gcode.h"

enum { MOVES = 1000000, RUNS = 3 };

/* Passes over a wavy surface, 0.1 mm a step, with a way up between them. */
static void fill(NcOperation *operation)
{
    GArray *locations = operation->path.locations;
    for (int i = 0; i < MOVES; i++) {
        double x = 0.1 * (i % 1000), y = 0.1 * (i / 1000);
        double z = 3.0 * sin(0.1 * x) * cos(0.1 * y) - 4.0;
        NcLocation location = {{x, y, z}, {0.0, 0.0, 1.0}, NC_CUT};
        if (i % 1000 == 0 || i % 1000 == 999) {
            location.tip.z = 5.0;
            location.motion = NC_RAPID;
        }
        g_array_append_val(locations, location);
    }
}

/* Of processor time: all three run on one core, whatever else the machine does. */
static double processor_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void report(const char *what, double figure, const char *unit, const char *wanted)
{
    printf("%-28s %8.2f %s%s\n", what, figure, unit, wanted);
}

int main(void)
{
    CfgMachine machine = gcode_machine();
    CfgRecipe recipe = {.wcs = 54};
    NcOperation operation = {.region = 1,
                             .kind = SEG_REGION_CONVEX,
                             .tool = cfg_tools_find(gcode_tools(), 1),
                             .feed_mm_min = 3000.0,
                             .plunge_mm_min = 500.0,
                             .spindle_rpm = 8000.0,
                             .path.locations = g_array_new(FALSE, FALSE, sizeof(NcLocation))};
    NcPlan plan = {.operations = &operation,
                   .n_operations = 1,
                   .budget = {.blend_mm = 0.00245, .rounding_mm = 0.00035},
                   .clearance_mm = 5.0};
    fill(&operation);
    double write_s = INFINITY, read_s = INFINITY, plan_s = INFINITY;
    gsize length = 0;
    guint n = 0;
    for (int run = 0; run < RUNS; run++) {
        double start = processor_s();
        g_autoptr(NcProgram) program = nc_program_write(&plan, &recipe, &machine, NULL, NULL);
        write_s = fmin(write_s, processor_s() - start);
        const char *text = g_bytes_get_data(program->bytes, &length);
        start = processor_s();
        g_autoptr(GArray) moves = nc_read_program(text, length, &machine, gcode_tools(), NULL);
        read_s = fmin(read_s, processor_s() - start);
        n = moves->len;
        start = processor_s();
        g_free(nc_motion_plan(&machine, (const NcMove *)(const void *)moves->data, n));
        plan_s = fmin(plan_s, processor_s() - start);
    }
    g_array_unref(operation.path.locations);
    printf("program of %u moves, %.1f MB, SHA-256 included in the writing\n", n,
           (double)length * 1e-6);
    report("writing G-code", (double)length * 1e-6 / write_s, "MB/s", "  (goal 100, must 10)");
    report("reading G-code", n / read_s * 1e-6, "million blocks/s", "");
    report("planning motion", n / plan_s * 1e-6, "million moves/s", "");
    return 0;
}
