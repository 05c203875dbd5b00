/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/gcode.h"

#include <math.h>
#include <string.h>

CfgMachine gcode_machine(void)
{
    CfgMachine machine = {
        .name = (char *)"test",
        .dialect = (char *)"linuxcnc",
        .spindle_min_rpm = 10.0,
        .spindle_max_rpm = 50000.0,
        .spindle_rpm_per_s = 1000.0,
        .tool_change_s = 5.0,
        .work_offset_mm = {{0.0, 0.0, 0.0}, {10.0, 20.0, -30.0}},
    };
    for (int axis = 0; axis < 3; axis++)
        machine.axis[axis] = (CfgAxis){-1000.0, 1000.0, 6000.0, 500.0, 0.0};
    return machine;
}

const CfgToolTable *gcode_tools(void)
{
    static CfgTool tools[] = {{.number = 1, .length_mm = 50.8, .diameter_mm = 6.35},
                              {.number = 2, .length_mm = 60.0, .diameter_mm = 6.35},
                              {.number = 3, .length_mm = 70.0, .diameter_mm = 6.35},
                              {.number = 4, .length_mm = 80.0, .diameter_mm = 6.35}};
    static const CfgToolTable table = {tools, G_N_ELEMENTS(tools)};
    return &table;
}

/* To 1e-9: what is left of rounding does not show. */
static void put_numbers(GString *text, const double *numbers, int n)
{
    for (int i = 0; i < n; i++)
        g_string_append_printf(text, " %.9g", round(numbers[i] * 1e9) / 1e9 + 0.0);
}

static void put_path(GString *text, const NcMove *move)
{
    const double to[] = {move->to.x, move->to.y, move->to.z};
    const double centre[] = {move->centre.x, move->centre.y, move->centre.z};
    put_numbers(text, to, 3);
    for (int i = 0; i < 3; i++)
        if (move->from_deg[i] != 0.0 || move->to_deg[i] != 0.0)
            g_string_append_printf(text, " %c%.9g", 'a' + i, round(move->to_deg[i] * 1e9) / 1e9);
    if (move->kind == NC_MOVE_ARC) {
        g_string_append(text, " centre");
        put_numbers(text, centre, 3);
        g_string_append_printf(text, " g%d turn %d", move->plane, move->turn);
    }
    if (move->kind != NC_MOVE_RAPID)
        g_string_append_printf(text, " f%.9g", move->feed_mm_min);
}

char *gcode_text(const GArray *moves)
{
    static const char *const names[] = {
        "rapid", "feed",          "arc", "dwell", "tool",   "spindle",     "coolant",
        "stop",  "optional stop", "end", "probe", "orient", "tool number", "message"};
    GString *text = g_string_new(NULL);
    for (guint i = 0; i < moves->len; i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        g_string_append(text, names[move->kind]);
        if (move->kind <= NC_MOVE_ARC || move->kind == NC_MOVE_PROBE)
            put_path(text, move);
        else if (move->kind == NC_MOVE_DWELL)
            put_numbers(text, &move->dwell_s, 1);
        else if (move->kind == NC_MOVE_SPINDLE)
            put_numbers(text, &move->spindle_rpm, 1);
        else if (move->kind == NC_MOVE_TOOL_CHANGE || move->kind == NC_MOVE_TOOL_NUMBER)
            g_string_append_printf(text, " %d", move->tool);
        else if (move->kind == NC_MOVE_ORIENT)
            put_numbers(text, &move->orient.angle_deg, 1);
        else if (move->kind == NC_MOVE_COOLANT)
            g_string_append_printf(text, "%s%s", move->coolant_mist ? " mist" : "",
                                   move->coolant_flood ? " flood" : "");
        g_string_append_c(text, '\n');
    }
    return g_string_free(text, FALSE);
}

GArray *gcode_read(const char *program, const CfgMachine *machine)
{
    g_autoptr(GError) error = NULL;
    GArray *moves = nc_read_program(program, strlen(program), machine, gcode_tools(), &error);
    if (!moves)
        g_test_message("%s", error->message);
    return moves;
}
