/* SPDX-License-Identifier: Apache-2.0 */
/* What the machine cannot do, said before it is asked to. */
#include "nc/gcode/interpreter.h"

/* Coordinates are sums of decimal numbers: this much is rounding. */
#define ROUNDING_MM 1e-6

static uint32_t block_line(const NcMove *move)
{
    return move->block_line > 0 ? move->block_line : move->line;
}

static bool check_spindle(const CfgMachine *machine, const NcMove *move, GError **error)
{
    double rpm = fabs(move->spindle_rpm);
    if (rpm == 0.0 || (rpm >= machine->spindle_min_rpm && rpm <= machine->spindle_max_rpm))
        return true;
    g_set_error(error, NC_ERROR, NC_ERROR_LIMIT,
                "line %u: the spindle cannot turn at %.10g rev/min: %s runs from %.10g to %.10g; "
                "change the S word",
                block_line(move), rpm, machine->name ? machine->name : "the machine",
                machine->spindle_min_rpm, machine->spindle_max_rpm);
    return false;
}

bool nc_move_check_limits(const CfgMachine *machine, const NcMove *move, GError **error)
{
    if (move->kind == NC_MOVE_SPINDLE && !check_spindle(machine, move, error))
        return false;
    if (!nc_move_travels(move))
        return true;
    SegVec3 min, max;
    nc_move_bounds(move, &min, &max);
    for (int axis = 0; axis < 3; axis++) {
        const CfgAxis *travel = &machine->axis[axis];
        double low = nc_axis_value(min, axis), high = nc_axis_value(max, axis);
        bool below = low < travel->min_mm - ROUNDING_MM;
        if (below || high > travel->max_mm + ROUNDING_MM) {
            g_set_error(error, NC_ERROR, NC_ERROR_LIMIT,
                        "line %u: %c would go to %.4f mm in machine coordinates, beyond its limit "
                        "of %.10g mm: move the work offset, or place the part elsewhere",
                        block_line(move), 'X' + axis, below ? low : high,
                        below ? travel->min_mm : travel->max_mm);
            return false;
        }
    }
    return true;
}
