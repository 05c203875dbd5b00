/* SPDX-License-Identifier: Apache-2.0 */
/* Writing, reading and timing a program of a million short moves; reading beside LinuxCNC's
 * stand-alone interpreter, where Debian's package can be had. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include <glib/gstdio.h>

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

/* Block by block, as a machine does, which keeps no more than it has to; limits included. */
static guint read_lines(const char *text, gsize length, const CfgMachine *machine)
{
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    guint n = 0;
    for (const char *at = text, *end = text + length; at < end; n++) {
        const char *newline = memchr(at, '\n', (size_t)(end - at)),
                   *next = newline ? newline + 1 : end;
        if (!nc_interpreter_block(interpreter, at, (size_t)(next - at), moves, NULL))
            return 0;
        for (guint i = 0; i < moves->len; i++)
            if (!nc_move_check_limits(machine, &g_array_index(moves, NcMove, i), NULL))
                return 0;
        g_array_set_size(moves, 0);
        at = next;
    }
    return n;
}

/* Seconds of LinuxCNC's rs274, which prints its calls to nowhere; 0: not to be had. */
static double judge_s(const char *text, gsize length)
{
    g_autofree char *path = g_build_filename(g_get_tmp_dir(), "segmill-bench.ngc", NULL);
    g_autofree char *command = g_strdup_printf("bash tests/ci/rs274.sh --time %s", path);
    g_autofree char *answer = NULL;
    double seconds = 0.0;
    if (g_file_set_contents(path, text, (gssize)length, NULL) &&
        g_spawn_command_line_sync(command, &answer, NULL, NULL, NULL))
        seconds = g_ascii_strtod(answer, NULL);
    g_unlink(path);
    return seconds;
}

static void compare(const char *text, gsize length, const CfgMachine *machine)
{
    double ours_s = INFINITY;
    guint n = 0;
    for (int run = 0; run < RUNS; run++) {
        const double start = processor_s();
        n = read_lines(text, length, machine);
        ours_s = fmin(ours_s, processor_s() - start);
    }
    report("reading, keeping nothing", n / ours_s * 1e-6, "million lines/s", "");
    const double theirs_s = judge_s(text, length);
    if (theirs_s > 0.0) {
        report("LinuxCNC's rs274", n / theirs_s * 1e-6, "million lines/s", "");
        report("reading against rs274", theirs_s / ours_s, "times", "  (goal 20, must 4)");
    } else {
        printf("LinuxCNC's rs274 cannot be had here\n");
    }
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
    double write_s = INFINITY, read_s = INFINITY, plan_s[2] = {INFINITY, INFINITY};
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
        for (int jerk = 0; jerk < 2; jerk++) {
            for (int axis = 0; axis < 3; axis++)
                machine.axis[axis].max_mm_s3 = jerk * 10000.0;
            start = processor_s();
            nc_motion_free(nc_motion_new(&machine, NC_NO_OVERRIDE, 0,
                                         (const NcMove *)(const void *)moves->data, n));
            plan_s[jerk] = fmin(plan_s[jerk], processor_s() - start);
        }
    }
    g_autoptr(NcProgram) program = nc_program_write(&plan, &recipe, &machine, NULL, NULL);
    g_array_unref(operation.path.locations);
    printf("program of %u moves, %.1f MB, SHA-256 included in the writing\n", n,
           (double)length * 1e-6);
    report("writing G-code", (double)length * 1e-6 / write_s, "MB/s", "  (goal 100, must 10)");
    report("reading, keeping the moves", n / read_s * 1e-6, "million blocks/s", "");
    report("planning motion", n / plan_s[0] * 1e-6, "million moves/s", "  (goal 0.5, must 0.1)");
    report("with limited jerk", n / plan_s[1] * 1e-6, "million moves/s",
           "  (goal 0.15, must 0.03)");
    compare(g_bytes_get_data(program->bytes, NULL), length, &machine);
    return 0;
}
