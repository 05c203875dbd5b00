/* SPDX-License-Identifier: Apache-2.0 */
/* Parameters that the machine sets: #5400 to #5428, and names like #<_x> [LinuxCNC 2.9,
 * "Parameters": "Predefined Named Parameters" and "Numbered Parameters"]. */
#include "nc/gcode/interpreter.h"

#include <string.h>

typedef enum {
    OF_X,
    OF_Y,
    OF_Z,
    OF_A,
    OF_B,
    OF_C,
    OF_METRIC,
    OF_IMPERIAL,
    OF_ABSOLUTE,
    OF_INCREMENTAL,
    OF_FEED,
    OF_RPM,
    OF_TOOL,
    OF_SELECTED,
    OF_PLANE,
    OF_LINE,
    OF_MOTION,
    OF_WORK,
    OF_SPINDLE_ON,
    OF_CLOCKWISE,
    OF_MIST,
    OF_FLOOD,
    OF_IJK_ABSOLUTE,
    OF_LEVEL,
    OF_CUTTER,
    OF_INVERSE,
    OF_A_MINUTE,
    OF_A_TURN,
    OF_LENGTH,
    OF_RETRACT_R,
    OF_RETRACT_OLD,
    OF_CONSTANT_RPM,
    OF_CONSTANT_SURFACE,
    OF_SPEED_OVERRIDE,
    OF_FEED_OVERRIDE,
    OF_ADAPTIVE,
    OF_HOLD,
} Meaning;

static const struct {
    const char *name;
    Meaning meaning;
} names[] = {
    {"_X", OF_X},
    {"_Y", OF_Y},
    {"_Z", OF_Z},
    {"_A", OF_A},
    {"_B", OF_B},
    {"_C", OF_C},
    {"_METRIC", OF_METRIC},
    {"_IMPERIAL", OF_IMPERIAL},
    {"_ABSOLUTE", OF_ABSOLUTE},
    {"_INCREMENTAL", OF_INCREMENTAL},
    {"_FEED", OF_FEED},
    {"_RPM", OF_RPM},
    {"_CURRENT_TOOL", OF_TOOL},
    {"_SELECTED_TOOL", OF_SELECTED},
    {"_PLANE", OF_PLANE},
    {"_LINE", OF_LINE},
    {"_MOTION_MODE", OF_MOTION},
    {"_COORD_SYSTEM", OF_WORK},
    {"_SPINDLE_ON", OF_SPINDLE_ON},
    {"_SPINDLE_CW", OF_CLOCKWISE},
    {"_MIST", OF_MIST},
    {"_FLOOD", OF_FLOOD},
    {"_IJK_ABSOLUTE_MODE", OF_IJK_ABSOLUTE},
    {"_CALL_LEVEL", OF_LEVEL},
    {"_CCOMP", OF_CUTTER},
    {"_INVERSE_TIME", OF_INVERSE},
    {"_UNITS_PER_MINUTE", OF_A_MINUTE},
    {"_UNITS_PER_REV", OF_A_TURN},
    {"_TOOL_OFFSET", OF_LENGTH},
    {"_RETRACT_R_PLANE", OF_RETRACT_R},
    {"_RETRACT_OLD_Z", OF_RETRACT_OLD},
    {"_SPINDLE_RPM_MODE", OF_CONSTANT_RPM},
    {"_SPINDLE_CSS_MODE", OF_CONSTANT_SURFACE},
    {"_SPEED_OVERRIDE", OF_SPEED_OVERRIDE},
    {"_FEED_OVERRIDE", OF_FEED_OVERRIDE},
    {"_ADAPTIVE_FEED", OF_ADAPTIVE},
    {"_FEED_HOLD", OF_HOLD},
};

static double program_position(const NcExecution *x, int axis)
{
    NcPlace place = nc_program_place(x);
    return *nc_place_axis(&place, axis) / (axis < 3 ? x->modal.unit_mm : 1.0);
}

/* G54 … G59, G59.1 … G59.3, ten times. */
static double work_code(int wcs)
{
    return wcs < 6 ? (wcs + 54) * 10 : 585 + wcs;
}

static double meaning_of(const NcExecution *x, Meaning meaning)
{
    const NcModal *modal = &x->modal;
    switch (meaning) {
    case OF_X:
    case OF_Y:
    case OF_Z:
    case OF_A:
    case OF_B:
    case OF_C:
        return program_position(x, (int)meaning);
    case OF_METRIC:
        return modal->unit_mm == 1.0;
    case OF_IMPERIAL:
        return modal->unit_mm != 1.0;
    case OF_ABSOLUTE:
        return !modal->incremental;
    case OF_INCREMENTAL:
        return modal->incremental;
    case OF_FEED:
        return modal->feed_mm / modal->unit_mm;
    case OF_RPM:
        return modal->speed;
    case OF_TOOL:
        return modal->tool;
    case OF_SELECTED:
        return modal->selected_tool;
    case OF_PLANE:
        return modal->plane * 10;
    case OF_LINE:
        return modal->line;
    case OF_MOTION:
        return modal->motion;
    case OF_WORK:
        return work_code(modal->wcs);
    case OF_SPINDLE_ON:
        return modal->spindle != 0;
    case OF_CLOCKWISE:
        return modal->spindle > 0;
    case OF_MIST:
        return modal->mist;
    case OF_FLOOD:
        return modal->flood;
    case OF_IJK_ABSOLUTE:
        return modal->arc_absolute;
    case OF_LEVEL:
        return (double)x->parameters->frames->len - 1.0;
    case OF_CUTTER:
        return x->compensation->side == 0 ? 400 : x->compensation->side > 0 ? 410 : 420;
    case OF_INVERSE:
        return modal->feed_mode == NC_FEED_INVERSE;
    case OF_A_MINUTE:
        return modal->feed_mode == NC_FEED_A_MINUTE;
    case OF_A_TURN:
        return modal->feed_mode == NC_FEED_A_TURN;
    case OF_LENGTH:
        return modal->tool_length_mm != 0.0;
    case OF_RETRACT_R:
        return modal->retract_r;
    case OF_RETRACT_OLD:
        return !modal->retract_r;
    case OF_CONSTANT_RPM:
        return !modal->surface_speed;
    case OF_CONSTANT_SURFACE:
        return modal->surface_speed;
    case OF_SPEED_OVERRIDE:
        return !modal->spindle_override_off;
    case OF_FEED_OVERRIDE:
        return !modal->feed_override_off;
    case OF_ADAPTIVE:
        return modal->adaptive_feed;
    case OF_HOLD:
        return 1;
    }
    g_assert_not_reached();
}

/* Those between #5400 and #5428 that are not of the tool or the position are 0. */
static double read_only(const NcExecution *x, int index)
{
    NcToolOffset tool = {0, 0.0, 0.0};
    (void)nc_find_tool(x, x->modal.tool, &tool);
    int axis = index - NC_PARAMETER_POSITION;
    if (axis >= 0 && axis < 6)
        return program_position(x, axis);
    if (index == NC_PARAMETER_WORK)
        return x->modal.wcs + 1;
    if (index == NC_PARAMETER_READ_ONLY)
        return x->modal.tool;
    if (index == NC_PARAMETER_READ_ONLY + 3)
        return tool.length_mm / x->modal.unit_mm;
    if (index == NC_PARAMETER_READ_ONLY + 10)
        return tool.diameter_mm / x->modal.unit_mm;
    return 0.0;
}

static bool is_read_only(int index)
{
    return index == NC_PARAMETER_WORK ||
           (index >= NC_PARAMETER_READ_ONLY && index <= NC_PARAMETER_LAST_READ_ONLY);
}

static int predefined(const NcExecution *x, NcParameter parameter)
{
    const char *name = parameter.global ? nc_parameter_name(x->parameters, parameter) : "";
    for (int i = 0; *name && i < (int)G_N_ELEMENTS(names); i++)
        if (strcmp(names[i].name, name) == 0)
            return i;
    return -1;
}

bool nc_parameter_writable(const NcExecution *x, NcParameter parameter)
{
    return parameter.named ? predefined(x, parameter) < 0 : !is_read_only(parameter.index);
}

bool nc_parameter_hidden(const NcExecution *x, NcParameter parameter)
{
    return !parameter.named && parameter.index >= NC_PARAMETER_POSITION &&
           parameter.index <= NC_PARAMETER_LAST_READ_ONLY && x->compensation->side != 0;
}

bool nc_parameter_value(const NcExecution *x, NcParameter parameter, double *value)
{
    if (!parameter.named && is_read_only(parameter.index)) {
        *value = read_only(x, parameter.index);
        return true;
    }
    int known = predefined(x, parameter);
    *value = known >= 0 ? meaning_of(x, names[known].meaning)
                        : nc_parameter_get(x->parameters, parameter);
    return !isnan(*value);
}

static double with_settings(const NcExecution *x, int index)
{
    for (int i = x->block->n_settings - 1; i >= 0; i--) {
        const NcSetting *setting = &x->block->settings[i];
        if (!setting->parameter.named && setting->parameter.index == index)
            return setting->value;
    }
    return x->parameters->numbered[index];
}

NcPlace nc_parameters_place(const NcExecution *x, int index)
{
    NcPlace place;
    for (int axis = 0; axis < 6; axis++)
        *nc_place_axis(&place, axis) = with_settings(x, index + axis);
    return place;
}

void nc_set_parameters_place(NcExecution *x, int index, NcPlace place)
{
    for (int axis = 0; axis < 6; axis++)
        nc_set_parameter(x, index + axis, *nc_place_axis(&place, axis));
}

void nc_set_parameter(NcExecution *x, int index, double value)
{
    g_assert(x->block->n_settings < (int)G_N_ELEMENTS(x->block->settings));
    x->block->settings[x->block->n_settings++] = (NcSetting){{.index = index}, value};
}
