/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/approach.h"

typedef struct {
    GArray *moves;
    NcMove last; /* where the way has led, and what is on there */
} Way;

static void add(Way *way, NcMoveKind kind);
static void go_to(Way *way, SegVec3 to);

SimProgram *sim_approach_new(const CfgMachine *machine, SegVec3 from_mm, int tool, SimSituation to,
                             NcOverride override)
{
    const double top_mm = machine->axis[2].max_mm;
    const SegVec3 changer = {machine->tool_change_mm[0], machine->tool_change_mm[1],
                             machine->tool_change_mm[2]};
    Way way = {.moves = g_array_new(FALSE, FALSE, sizeof(NcMove)),
               .last = {.from = from_mm,
                        .to = from_mm,
                        .tool = tool,
                        .plane = 17,
                        .exact_stop = true,
                        .work_offset = to.work_offset}};
    go_to(&way, (SegVec3){from_mm.x, from_mm.y, top_mm});
    if (to.tool != 0 && to.tool != tool) {
        go_to(&way, (SegVec3){changer.x, changer.y, top_mm});
        go_to(&way, changer);
        way.last.tool = to.tool;
        add(&way, NC_MOVE_TOOL_CHANGE);
        go_to(&way, (SegVec3){changer.x, changer.y, top_mm});
    }
    go_to(&way, (SegVec3){to.position_mm.x, to.position_mm.y, top_mm});
    way.last.spindle_rpm = to.spindle_rpm;
    if (to.spindle_rpm != 0)
        add(&way, NC_MOVE_SPINDLE);
    way.last.coolant_mist = to.coolant_mist;
    way.last.coolant_flood = to.coolant_flood;
    if (to.coolant_mist || to.coolant_flood)
        add(&way, NC_MOVE_COOLANT);
    go_to(&way, to.position_mm);
    SimProgram *program = sim_program_from_moves(way.moves, machine, override);
    program->gates = g_memdup2(&program->n, sizeof program->n);
    program->n_gates = 1;
    return program;
}

SimSituation sim_situation_at_gate(const SimProgram *program, size_t gate)
{
    const size_t next = program->gates[gate - 1];
    if (next == 0)
        return (SimSituation){.position_mm = program->moves[0].from, .work_offset = 54};
    const NcMove *before = &program->moves[next - 1];
    return (SimSituation){.position_mm = before->to,
                          .tool = before->tool,
                          .spindle_rpm = before->spindle_rpm,
                          .coolant_mist = before->coolant_mist,
                          .coolant_flood = before->coolant_flood,
                          .work_offset = before->work_offset};
}

static void add(Way *way, NcMoveKind kind)
{
    way->last.kind = kind;
    g_array_append_val(way->moves, way->last);
}

static void go_to(Way *way, SegVec3 to)
{
    way->last.from = way->last.to;
    way->last.to = to;
    if (seg_distance(way->last.from, to) > 0)
        add(way, NC_MOVE_RAPID);
    way->last.from = to;
}
