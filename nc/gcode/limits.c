/* SPDX-License-Identifier: Apache-2.0 */
/* What the machine cannot do, said before it is asked to. */
#include "nc/gcode/interpreter.h"

/* Coordinates are sums of decimal numbers: this much is rounding. */
#define ROUNDING 1e-6

static bool check_spindle(const CfgMachine *machine, const NcMove *move, GError **error)
{
    double rpm = fabs(move->spindle_rpm);
    if (rpm == 0.0 || (rpm >= machine->spindle_min_rpm && rpm <= machine->spindle_max_rpm))
        return true;
    g_set_error(error, NC_ERROR, NC_ERROR_LIMIT,
                "line %u: the spindle cannot turn at %.10g rev/min: %s runs from %.10g to %.10g; "
                "change the S word",
                nc_move_block_line(move), rpm, machine->name ? machine->name : "the machine",
                machine->spindle_min_rpm, machine->spindle_max_rpm);
    return false;
}

/* M19 Q: longer than that is an error of the machine. */
static bool check_orient(const CfgMachine *machine, const NcMove *move, GError **error)
{
    const double wait_s = move->orient.wait_s;
    if (!(wait_s > 0.0) || machine->orient_s <= wait_s)
        return true;
    g_set_error(error, NC_ERROR, NC_ERROR_LIMIT,
                "line %u: Q%.10g: M19 takes %.10g s on %s (orient_s), longer than the program "
                "waits; change the Q word",
                nc_move_block_line(move), wait_s, machine->orient_s,
                machine->name ? machine->name : "the machine");
    return false;
}

static bool beyond(const NcMove *move, char axis, double value, double limit, const char *unit,
                   GError **error)
{
    g_set_error(error, NC_ERROR, NC_ERROR_LIMIT,
                "line %u: %c would go to %.4f %s in machine coordinates, beyond its limit of "
                "%.10g %s: move the work offset, or place the part elsewhere",
                nc_move_block_line(move), axis, value, unit, limit, unit);
    return false;
}

static bool check_axis(const NcMove *move, char axis, double low, double high, double min,
                       double max, const char *unit, GError **error)
{
    if (low < min - ROUNDING)
        return beyond(move, axis, low, min, unit, error);
    return high <= max + ROUNDING || beyond(move, axis, high, max, unit, error);
}

static bool check_rotary(const CfgMachine *machine, const NcMove *move, GError **error)
{
    for (int i = 0; i < 3; i++) {
        const CfgRotary *travel = &machine->rotary[i];
        const double from = move->from_deg[i], to = move->to_deg[i];
        if (travel->present && !check_axis(move, (char)('A' + i), MIN(from, to), MAX(from, to),
                                           travel->min_deg, travel->max_deg, "degrees", error))
            return false;
    }
    return true;
}

bool nc_move_check_limits(const CfgMachine *machine, const NcMove *move, GError **error)
{
    if (move->kind == NC_MOVE_SPINDLE && !check_spindle(machine, move, error))
        return false;
    if (move->kind == NC_MOVE_ORIENT && !check_orient(machine, move, error))
        return false;
    if (!nc_move_travels(move))
        return true;
    SegVec3 min = {MIN(move->from.x, move->to.x), MIN(move->from.y, move->to.y),
                   MIN(move->from.z, move->to.z)};
    SegVec3 max = {MAX(move->from.x, move->to.x), MAX(move->from.y, move->to.y),
                   MAX(move->from.z, move->to.z)};
    if (move->kind == NC_MOVE_ARC)
        nc_move_bounds(move, &min, &max);
    const CfgAxis *axis = machine->axis;
    if (min.x >= axis[0].min_mm && min.y >= axis[1].min_mm && min.z >= axis[2].min_mm &&
        max.x <= axis[0].max_mm && max.y <= axis[1].max_mm && max.z <= axis[2].max_mm)
        return check_rotary(machine, move, error);
    return check_axis(move, 'X', min.x, max.x, axis[0].min_mm, axis[0].max_mm, "mm", error) &&
           check_axis(move, 'Y', min.y, max.y, axis[1].min_mm, axis[1].max_mm, "mm", error) &&
           check_axis(move, 'Z', min.z, max.z, axis[2].min_mm, axis[2].max_mm, "mm", error) &&
           check_rotary(machine, move, error);
}
