/* SPDX-License-Identifier: Apache-2.0 */
/* Parameters that the machine sets: #5400 to #5428, and names like #<_x> [LinuxCNC 2.9,
 * "Parameters": "Predefined Named Parameters" and "Numbered Parameters"]. */
#include "nc/gcode/interpreter.h"

#include <string.h>

typedef enum {
    OF_X,
    OF_Y,
    OF_Z,
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
} Meaning;

static const struct {
    const char *name;
    Meaning meaning;
} names[] = {
    {"_X", OF_X},
    {"_Y", OF_Y},
    {"_Z", OF_Z},
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
};

static const CfgTool *current_tool(const NcExecution *x)
{
    return x->tools && x->modal.tool > 0 ? cfg_tools_find(x->tools, x->modal.tool) : NULL;
}

static double program_position(const NcExecution *x, int axis)
{
    SegVec3 from_zero = seg_sub(x->modal.position, nc_program_shift(x));
    return nc_axis_value(from_zero, axis) / x->modal.unit_mm;
}

static double meaning_of(const NcExecution *x, Meaning meaning)
{
    const NcModal *modal = &x->modal;
    switch (meaning) {
    case OF_X:
    case OF_Y:
    case OF_Z:
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
        return modal->feed_mm_min / modal->unit_mm;
    case OF_RPM:
        return modal->speed_rpm;
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
        return (modal->wcs + 54) * 10;
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
    }
    g_assert_not_reached();
}

/* Those between #5400 and #5428 that are not of the tool or the position are 0. */
static double read_only(const NcExecution *x, int index)
{
    const CfgTool *tool = current_tool(x);
    int axis = index - NC_PARAMETER_POSITION;
    if (axis >= 0 && axis < 3)
        return program_position(x, axis);
    if (index == NC_PARAMETER_WORK)
        return x->modal.wcs + 1;
    if (index == NC_PARAMETER_READ_ONLY)
        return x->modal.tool;
    if (index == NC_PARAMETER_READ_ONLY + 3)
        return tool ? tool->length_mm / x->modal.unit_mm : 0.0;
    if (index == NC_PARAMETER_READ_ONLY + 10)
        return tool ? tool->diameter_mm / x->modal.unit_mm : 0.0;
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

SegVec3 nc_parameters_point(const NcExecution *x, int index)
{
    return seg_vec3(with_settings(x, index), with_settings(x, index + 1),
                    with_settings(x, index + 2));
}

void nc_set_parameters_point(NcExecution *x, int index, SegVec3 point)
{
    for (int axis = 0; axis < 3; axis++)
        nc_set_parameter(x, index + axis, nc_axis_value(point, axis));
}

void nc_set_parameter(NcExecution *x, int index, double value)
{
    g_assert(x->block->n_settings < (int)G_N_ELEMENTS(x->block->settings));
    x->block->settings[x->block->n_settings++] = (NcSetting){{.index = index}, value};
}
