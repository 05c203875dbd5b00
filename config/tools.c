/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#include <math.h>
#include <stdlib.h>

#define AT(field) offsetof(CfgTool, field)

static const CfgChoice kinds[] = {{"flat", CFG_TOOL_FLAT},
                                  {"ball", CFG_TOOL_BALL},
                                  {"bull", CFG_TOOL_BULL},
                                  {"drill", CFG_TOOL_DRILL},
                                  {"chamfer", CFG_TOOL_CHAMFER},
                                  {"taper", CFG_TOOL_TAPER},
                                  {NULL, 0}};

static const CfgKey keys[] = {
    {"tool.*", "kind", CFG_CHOICE, "", NULL, 0, 0, AT(kind), .help = "Shape of the tool's tip.",
     .choices = kinds},
    {"tool.*", "diameter_mm", CFG_REAL, "mm", NULL, 0.05, 200, AT(diameter_mm),
     .help = "Cutting diameter."},
    {"tool.*", "corner_radius_mm", CFG_REAL, "mm", "0", 0, 100, AT(corner_radius_mm),
     .help = "Corner radius of a bull tool; that of a flat one is 0, of a ball half its diameter."},
    {"tool.*", "tip_angle_deg", CFG_REAL, "deg", "0", 0, 179, AT(tip_angle_deg),
     .help =
         "Angle between opposite sides of the tip of a drill, a chamfer mill or a tapered mill."},
    {"tool.*", "tip_diameter_mm", CFG_REAL, "mm", "0", 0, 200, AT(tip_diameter_mm),
     .help = "Diameter of the flat at a chamfer mill's tip, of the ball at a tapered mill's."},
    {"tool.*", "flutes", CFG_INT, "", "2", 1, 20, AT(flutes), .help = "Number of teeth."},
    {"tool.*", "flute_length_mm", CFG_REAL, "mm", NULL, 0.05, 500, AT(flute_length_mm),
     .help = "Length of the cutting edges."},
    {"tool.*", "stickout_mm", CFG_REAL, "mm", NULL, 0.05, 1000, AT(stickout_mm),
     .help = "From the tip to the holder's nose."},
    {"tool.*", "length_mm", CFG_REAL, "mm", NULL, 0.05, 1000, AT(length_mm),
     .help = "From the tip to the gauge line: the offset of G43."},
    {"tool.*", "shank_diameter_mm", CFG_REAL, "mm", "0", 0, 200, AT(shank_diameter_mm),
     .help = "Diameter between the cutting edges and the holder; 0: the cutting diameter."},
    {"tool.*", "counterclockwise", CFG_BOOL, "", "false", 0, 0, AT(counterclockwise),
     .help = "true: a left-hand tool, which cuts with M4."},
    {"tool.*", "holder_diameter_mm", CFG_REAL, "mm", "40", 1, 300, AT(holder_diameter_mm),
     .help = "Greatest diameter of the holder's nose."},
    {"tool.*", "max_depth_of_cut_mm", CFG_REAL, "mm", NULL, 0.001, 500, AT(max_depth_of_cut_mm),
     .help = "Deepest cut along the axis; a plan that wants more is refused."},
    {"tool.*", "cutting", CFG_CUTTING, "", NULL, 1e-5, 5000, AT(cutting),
     .help = "For each material its cutting speed in m/min and feed per tooth in mm, as "
             "steel: 120 0.04, titanium: 50 0.03.",
     .count_offset = AT(n_cutting)},
};

static const CfgSchema schema = {
    .what = "tool table",
    .help = "The tools of a machine, one group [tool.NUMBER] each.",
    .keys = keys,
    .n_keys = G_N_ELEMENTS(keys),
    .size = sizeof(CfgToolTable),
    .element_size = sizeof(CfgTool),
    .elements_offset = offsetof(CfgToolTable, tools),
    .n_elements_offset = offsetof(CfgToolTable, n_tools),
    .element_name = {"tool.*", "number", CFG_INT, "", NULL, 1, 9999, AT(number),
                     .help = "The T word."},
};

static bool check_tip(CfgTool *tool, const char *group, const CfgIni *ini, GError **error)
{
    double radius = tool->diameter_mm / 2, corner = tool->corner_radius_mm;
    bool pointed = tool->kind >= CFG_TOOL_DRILL;
    bool given = cfg_ini_entry(ini, group, "corner_radius_mm");
    if (tool->kind == CFG_TOOL_BULL && (corner <= 0 || corner >= radius))
        return cfg_refuse(ini, group, "corner_radius_mm", error,
                          "%g is not between 0 and half the diameter, as a bull tool wants",
                          corner);
    double implied = tool->kind == CFG_TOOL_BALL    ? radius
                     : tool->kind == CFG_TOOL_TAPER ? tool->tip_diameter_mm / 2
                                                    : 0;
    if (tool->kind != CFG_TOOL_BULL && given && fabs(corner - implied) > 1e-9)
        return cfg_refuse(ini, group, "corner_radius_mm", error,
                          "%g does not go with a %s tool, where it is %g; leave it out", corner,
                          cfg_tool_kind_name(tool->kind), implied);
    if (tool->kind != CFG_TOOL_BULL)
        tool->corner_radius_mm = implied;
    if (pointed != (tool->tip_angle_deg > 0))
        return cfg_refuse(ini, group, "tip_angle_deg", error,
                          pointed ? "%g: a %s tool needs the angle of its tip, above 0"
                                  : "%g does not go with a %s tool; leave it out",
                          tool->tip_angle_deg, cfg_tool_kind_name(tool->kind));
    bool tipped = tool->kind == CFG_TOOL_CHAMFER || tool->kind == CFG_TOOL_TAPER;
    if (tool->tip_diameter_mm >= tool->diameter_mm || (!tipped && tool->tip_diameter_mm > 0))
        return cfg_refuse(ini, group, "tip_diameter_mm", error,
                          tipped ? "%g is not below the diameter of the %s tool"
                                 : "%g does not go with a %s tool; leave it out",
                          tool->tip_diameter_mm, cfg_tool_kind_name(tool->kind));
    return true;
}

static bool check_tool(CfgTool *tool, const char *group, const CfgIni *ini, GError **error)
{
    if (!check_tip(tool, group, ini, error))
        return false;
    if (tool->shank_diameter_mm == 0)
        tool->shank_diameter_mm = tool->diameter_mm;
    if (tool->flute_length_mm > tool->stickout_mm)
        return cfg_refuse(ini, group, "flute_length_mm", error, "%g is more than stickout_mm = %g",
                          tool->flute_length_mm, tool->stickout_mm);
    if (tool->max_depth_of_cut_mm > tool->flute_length_mm)
        return cfg_refuse(ini, group, "max_depth_of_cut_mm", error,
                          "%g is more than flute_length_mm = %g", tool->max_depth_of_cut_mm,
                          tool->flute_length_mm);
    if (tool->stickout_mm > tool->length_mm)
        return cfg_refuse(ini, group, "stickout_mm", error, "%g is more than length_mm = %g",
                          tool->stickout_mm, tool->length_mm);
    return tool->n_cutting > 0 || cfg_refuse(ini, group, "cutting", error, "names no material");
}

static int compare_numbers(const void *a, const void *b)
{
    const CfgTool *x = a, *y = b;
    return (x->number > y->number) - (x->number < y->number);
}

static bool check(CfgToolTable *table, const CfgIni *ini, GError **error)
{
    for (size_t i = 0; i < table->n_tools; i++) {
        g_autofree char *group = g_strdup_printf("tool.%d", table->tools[i].number);
        g_autofree char *header = g_strdup_printf("[%s]", group);
        if (!g_hash_table_contains(ini->by_name, header)) {
            g_set_error(error, CFG_ERROR, CFG_ERROR_VALUE,
                        "%s: tool %d must be written [%s], without leading zeros", ini->name,
                        table->tools[i].number, group);
            return false;
        }
        if (!check_tool(&table->tools[i], group, ini, error))
            return false;
    }
    if (table->n_tools == 0) {
        g_set_error(error, CFG_ERROR, CFG_ERROR_VALUE, "%s: no [tool.NUMBER] group: no tools",
                    ini->name);
        return false;
    }
    qsort(table->tools, table->n_tools, sizeof(CfgTool), compare_numbers);
    for (size_t i = 1; i < table->n_tools; i++)
        if (table->tools[i].number == table->tools[i - 1].number) {
            g_set_error(error, CFG_ERROR, CFG_ERROR_VALUE, "%s: tool %d is there twice", ini->name,
                        table->tools[i].number);
            return false;
        }
    return true;
}

CfgToolTable *cfg_tools_load(const char *path, GError **error)
{
    g_autoptr(CfgIni) ini = cfg_ini_load(path, error);
    g_autoptr(CfgToolTable) table = ini ? cfg_schema_read(&schema, ini, error) : NULL;
    return table && check(table, ini, error) ? g_steal_pointer(&table) : NULL;
}

void cfg_tools_free(CfgToolTable *table)
{
    cfg_schema_free(&schema, table);
}

const CfgTool *cfg_tools_find(const CfgToolTable *table, int number)
{
    CfgTool wanted = {.number = number};
    return bsearch(&wanted, table->tools, table->n_tools, sizeof(CfgTool), compare_numbers);
}

const char *cfg_tool_kind_name(CfgToolKind kind)
{
    return kinds[kind].name;
}
