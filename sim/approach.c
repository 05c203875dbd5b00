/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/approach.h"

#include <string.h>

typedef struct {
    GArray *moves;
    NcMove last; /* where the way has led, and what is on there */
} Way;

static void add(Way *way, NcMoveKind kind);
static void go_to(Way *way, SegVec3 to);
static void go_across(Way *way, SegVec3 to, SegVec3 deg);

SimProgram *sim_approach_new(const CfgMachine *machine, SimPlace from, int tool, SimSituation to,
                             NcOverride override)
{
    const double top_mm = machine->axis[2].max_mm;
    const SegVec3 changer = {machine->tool_change_mm[0], machine->tool_change_mm[1],
                             machine->tool_change_mm[2]};
    Way way = {.moves = g_array_new(FALSE, FALSE, sizeof(NcMove)),
               .last = {.from = from.mm,
                        .to = from.mm,
                        .from_deg = {from.deg.x, from.deg.y, from.deg.z},
                        .to_deg = {from.deg.x, from.deg.y, from.deg.z},
                        .tool = tool,
                        .plane = 17,
                        .exact_stop = true,
                        .work_offset = to.work_offset}};
    go_to(&way, (SegVec3){from.mm.x, from.mm.y, top_mm});
    if (to.tool != 0 && to.tool != tool) {
        go_to(&way, (SegVec3){changer.x, changer.y, top_mm});
        go_to(&way, changer);
        way.last.tool = to.tool;
        add(&way, NC_MOVE_TOOL_CHANGE);
        go_to(&way, (SegVec3){changer.x, changer.y, top_mm});
    }
    go_across(&way, (SegVec3){to.place.mm.x, to.place.mm.y, top_mm}, to.place.deg);
    way.last.spindle_rpm = to.spindle_rpm;
    if (to.spindle_rpm != 0)
        add(&way, NC_MOVE_SPINDLE);
    way.last.coolant_mist = to.coolant_mist;
    way.last.coolant_flood = to.coolant_flood;
    if (to.coolant_mist || to.coolant_flood)
        add(&way, NC_MOVE_COOLANT);
    go_to(&way, to.place.mm);
    SimProgram *program = sim_program_from_moves(way.moves, machine, override);
    program->gates = g_memdup2(&program->n, sizeof program->n);
    program->n_gates = 1;
    return program;
}

SimSituation sim_situation_at_gate(const SimProgram *program, size_t gate)
{
    const size_t next = program->gates[gate - 1];
    if (next == 0)
        return (SimSituation){.place = {.mm = program->moves[0].from}, .work_offset = 54};
    const NcMove *before = &program->moves[next - 1];
    const NcMotion *motion = program->plan->motion;
    const NcAlong end = {.s_mm = nc_motion_end_mm(motion, next - 1)};
    const NcPoint at = nc_motion_point(motion, next - 1, end);
    const double *p = at.position;
    return (SimSituation){.place = {.mm = {p[0], p[1], p[2]}, .deg = {p[3], p[4], p[5]}},
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
    const double *deg = way->last.to_deg;
    go_across(way, to, (SegVec3){deg[0], deg[1], deg[2]});
}

static void go_across(Way *way, SegVec3 to, SegVec3 deg)
{
    NcMove *last = &way->last;
    const double to_deg[3] = {deg.x, deg.y, deg.z};
    last->from = last->to;
    last->to = to;
    memcpy(last->from_deg, last->to_deg, sizeof last->from_deg);
    memcpy(last->to_deg, to_deg, sizeof last->to_deg);
    if (seg_distance(last->from, to) > 0 || memcmp(last->from_deg, to_deg, sizeof to_deg) != 0)
        add(way, NC_MOVE_RAPID);
    last->from = to;
    memcpy(last->from_deg, to_deg, sizeof to_deg);
}
