/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/stock_case.h"

#define COMMON .stickout_mm = 30, .length_mm = 80, .holder_diameter_mm = 40

static CfgTool tools[] = {
    {.number = 1, .kind = CFG_TOOL_FLAT, .diameter_mm = 6, .flute_length_mm = 20, COMMON},
    {.number = 2,
     .kind = CFG_TOOL_BALL,
     .diameter_mm = 6,
     .corner_radius_mm = 3,
     .flute_length_mm = 20,
     COMMON},
    {.number = 3,
     .kind = CFG_TOOL_BULL,
     .diameter_mm = 10,
     .corner_radius_mm = 1.5,
     .flute_length_mm = 20,
     COMMON},
    {.number = 4,
     .kind = CFG_TOOL_DRILL,
     .diameter_mm = 5,
     .tip_angle_deg = 118,
     .flute_length_mm = 25,
     COMMON},
    {.number = 5,
     .kind = CFG_TOOL_CHAMFER,
     .diameter_mm = 8,
     .tip_diameter_mm = 1,
     .tip_angle_deg = 90,
     .flute_length_mm = 6,
     COMMON},
    {.number = 6,
     .kind = CFG_TOOL_TAPER,
     .diameter_mm = 6,
     .corner_radius_mm = 0.5,
     .tip_diameter_mm = 1,
     .tip_angle_deg = 10,
     .flute_length_mm = 20,
     COMMON},
    {.number = 7,
     .kind = CFG_TOOL_FLAT,
     .diameter_mm = 6,
     .flute_length_mm = 5,
     .shank_diameter_mm = 8,
     COMMON},
    {.number = 8,
     .kind = CFG_TOOL_FLAT,
     .diameter_mm = 6,
     .flute_length_mm = 20,
     .counterclockwise = true,
     COMMON},
    {.number = 9, .kind = CFG_TOOL_FLAT, .diameter_mm = 6, .flute_length_mm = 3, COMMON},
    {.number = 10,
     .kind = CFG_TOOL_FLAT,
     .diameter_mm = 6,
     .flute_length_mm = 3,
     .shank_diameter_mm = 5.97,
     COMMON},
};

const CfgToolTable test_tools = {.tools = tools, .n_tools = G_N_ELEMENTS(tools)};

double test_drawn_radius(const CfgTool *tool, double z)
{
    double r = tool->diameter_mm / 2, corner = tool->corner_radius_mm;
    double half = tool->tip_angle_deg * G_PI / 360;
    if (z < 0 || z > tool->flute_length_mm)
        return -1;
    if (tool->kind == CFG_TOOL_TAPER) {
        double touch = corner * (1 - sin(half));
        if (z < touch)
            return sqrt(z * (2 * corner - z));
        return fmin(corner * cos(half) + (z - touch) * tan(half), r);
    }
    if (half > 0)
        return fmin(tool->tip_diameter_mm / 2 + z * tan(half), r);
    if (z < corner)
        return r - corner + sqrt(z * (2 * corner - z));
    return r;
}

const SegVec3 test_zero = {5, -3, 7};

static SegVec3 gauge(const TestProgram *program, SegVec3 tip)
{
    const CfgTool *tool = cfg_tools_find(&test_tools, program->next.tool);
    tip.z += tool ? tool->length_mm : 0;
    return seg_add(tip, test_zero);
}

void test_program_begin(TestProgram *program, int tool, SegVec3 from)
{
    *program = (TestProgram){.moves = g_array_new(FALSE, FALSE, sizeof(NcMove))};
    program->next = (NcMove){.spindle_rpm = 5000, .feed_mm_min = 500};
    test_program_tool(program, tool, from);
}

void test_program_tool(TestProgram *program, int tool, SegVec3 from)
{
    program->next.tool = tool;
    program->next.to = gauge(program, from);
}

void test_program_move(TestProgram *program, NcMoveKind kind, SegVec3 tip)
{
    NcMove *move = &program->next;
    move->kind = kind;
    move->line++;
    move->from = move->to;
    move->to = gauge(program, tip);
    g_array_append_val(program->moves, *move);
}

void test_program_arc(TestProgram *program, SegVec3 tip, SegVec3 centre, int plane, int turn)
{
    program->next.centre = gauge(program, centre);
    program->next.plane = plane;
    program->next.turn = turn;
    test_program_move(program, NC_MOVE_ARC, tip);
}

bool test_program_cut(const TestProgram *program, NcStock *stock, GArray *collisions,
                      GError **error)
{
    return nc_stock_cut(stock, (const NcMove *)(const void *)program->moves->data,
                        program->moves->len, test_zero, &test_tools, collisions, error);
}

void test_program_end(TestProgram *program)
{
    g_array_unref(program->moves);
}
