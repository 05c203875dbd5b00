/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#include <string.h>

#define AT(field) offsetof(CfgRecipe, field)
#define REGION(field) offsetof(CfgRegion, field)
#define FACE_MAX 1e9

static const CfgChoice ups[] = {{"+x", CFG_UP_PLUS_X},
                                {"-x", CFG_UP_MINUS_X},
                                {"+y", CFG_UP_PLUS_Y},
                                {"-y", CFG_UP_MINUS_Y},
                                {"+z", CFG_UP_PLUS_Z},
                                {"-z", CFG_UP_MINUS_Z},
                                {NULL, 0}};
static const CfgChoice zeros[] = {{"part", CFG_ZERO_PART},
                                  {"top-centre", CFG_ZERO_TOP_CENTRE},
                                  {"top-corner", CFG_ZERO_TOP_CORNER},
                                  {"bottom-centre", CFG_ZERO_BOTTOM_CENTRE},
                                  {"bottom-corner", CFG_ZERO_BOTTOM_CORNER},
                                  {NULL, 0}};
static const CfgChoice work_offsets[] = {{"G54", 54},   {"G55", 55}, {"G56", 56},   {"G57", 57},
                                         {"G58", 58},   {"G59", 59}, {"G59.1", 60}, {"G59.2", 61},
                                         {"G59.3", 62}, {NULL, 0}};
static const CfgChoice stocks[] = {{"near-net", CFG_STOCK_NEAR_NET},
                                   {"box", CFG_STOCK_BOX},
                                   {"cylinder", CFG_STOCK_CYLINDER},
                                   {"file", CFG_STOCK_FILE},
                                   {NULL, 0}};
static const CfgChoice methods[] = {
    {"feature-size", CFG_METHOD_FEATURE_SIZE}, {"none", CFG_METHOD_NONE}, {NULL, 0}};
static const CfgChoice repairs[] = {{"exact", CFG_REPAIR_EXACT},
                                    {"rule", CFG_REPAIR_RULE},
                                    {"points", CFG_REPAIR_POINTS},
                                    {NULL, 0}};
static const CfgChoice strategies[] = {{"auto", CFG_STRATEGY_AUTO},
                                       {"iso-planar", CFG_STRATEGY_ISO_PLANAR},
                                       {"iso-parametric", CFG_STRATEGY_ISO_PARAMETRIC},
                                       {NULL, 0}};

static const CfgKey keys[] = {
    {"part", "file", CFG_FILE, "", NULL, 0, 0, AT(part_file),
     .help = "The CAD file: IGES, STEP, STL or OFF. Files are found from this recipe's folder."},
    {"part", "chord_mm", CFG_REAL, "mm", "0", 0, 10, AT(chord_mm),
     .help = "Chord tolerance of its tessellation; 0: a share of quality.tolerance_mm."},
    {"setup", "up", CFG_CHOICE, "", "+z", 0, 0, AT(up),
     .help = "The part's direction that points up to the spindle.", .choices = ups},
    {"setup", "zero", CFG_CHOICE, "", "top-centre", 0, 0, AT(zero),
     .help = "Where the work zero lies on the part's bounding box, turned up; part: the file's own "
             "origin.",
     .choices = zeros},
    {"setup", "wcs", CFG_CHOICE, "", "G54", 0, 0, AT(wcs),
     .help = "The machine's work offset that holds the zero.", .choices = work_offsets},
    {"setup", "clearance_mm", CFG_REAL, "mm", "5", 0.1, 1000, AT(clearance_mm),
     .help = "Safe height of rapid moves above the stock."},
    {"setup", "keep_out", CFG_NUMBERS, "", "", 0, FACE_MAX, AT(keep_out),
     .help = "Faces that are not machined, counted from 0, as 0, 4, 7-9.",
     .count_offset = AT(n_keep_out)},
    {"stock", "kind", CFG_CHOICE, "", "near-net", 0, 0, AT(stock_kind),
     .help = "near-net: the part plus the allowance; box, cylinder (upright); file: a mesh or a "
             "CAD file.",
     .choices = stocks},
    {"stock", "allowance_mm", CFG_REAL, "mm", "0.5", 0, 100, AT(allowance_mm),
     .help = "What the stock has on every face."},
    {"stock", "min_mm", CFG_VECTOR, "mm", "0, 0, 0", -1e5, 1e5, AT(stock_min_mm),
     .help = "Lowest corner of a box or of the box around a cylinder, from the work zero; equal to "
             "max_mm: the part's own box with the allowance around it."},
    {"stock", "max_mm", CFG_VECTOR, "mm", "0, 0, 0", -1e5, 1e5, AT(stock_max_mm),
     .help = "Highest corner of it."},
    {"stock", "file", CFG_FILE, "", "", 0, 0, AT(stock_file),
     .help = "The stock's file, with kind = file; its origin is the work zero."},
    {"stock", "material", CFG_STRING, "", "aluminium-6061", 0, 0, AT(material),
     .help = "As the tool table's cutting data name it."},
    {"machine", "file", CFG_FILE, "", "machine.ini", 0, 0, AT(machine_file),
     .help = "The machine that the program is for."},
    {"tools", "file", CFG_FILE, "", "", 0, 0, AT(tools_file),
     .help = "The tool table; empty: the machine's own."},
    {"tools", "use", CFG_NUMBERS, "", "", 1, 9999, AT(use_tools),
     .help = "Numbers of the tools that may be used, as 1, 4, 7-9; empty: all.",
     .count_offset = AT(n_use_tools)},
    {"quality", "scallop_mm", CFG_REAL, "mm", "0.01", 1e-4, 10, AT(scallop_mm),
     .help = "Height of the cusps between neighbouring passes."},
    {"quality", "tolerance_mm", CFG_REAL, "mm", "0.02", 1e-4, 10, AT(tolerance_mm),
     .help = "The one budget that tessellation, chords, corner blending and rounding share."},
    {"quality", "stock_to_leave_mm", CFG_REAL, "mm", "0", 0, 100, AT(stock_to_leave_mm),
     .help = "What is left on the part for a later pass."},
    {"toolpath", "overlap_mm", CFG_REAL, "mm", "0.5", 0, 100, AT(overlap_mm),
     .help = "How far neighbouring regions run into each other, against witness lines."},
    {"toolpath", "one_way", CFG_BOOL, "", "false", 0, 0, AT(one_way),
     .help = "true: every pass in the same direction; false: zigzag."},
    {"segmentation", "method", CFG_CHOICE, "", "feature-size", 0, 0, AT(method),
     .help = "How faces become regions; none: the whole part is one.", .choices = methods},
    {"segmentation", "repair", CFG_CHOICE, "", "exact", 0, 0, AT(feature_size.repair),
     .help = "How the boundary of a face is enriched before its size is taken: exact: every "
             "extremum is found; rule: 8, 6, 4 or 2 divisions by length; points: a fixed number.",
     .choices = repairs},
    {"segmentation", "points", CFG_INT, "", "8", 1, 100000, AT(feature_size.points),
     .help = "Points an edge, with repair = points."},
    {"segmentation", "datum_mm", CFG_REAL, "mm", "0", 0, 1e6, AT(feature_size.datum_mm),
     .help = "Length that edges are compared with, with repair = rule; 0: the part's diagonal."},
    {"segmentation", "tolerance", CFG_REAL, "", "0.05", 0, 1, AT(feature_size.tolerance),
     .help = "Sizes are alike within this part of the largest one of their class."},
    {"segmentation", "subset_tolerance", CFG_REAL, "", "0", 0, 1, AT(feature_size.subset_tolerance),
     .help = "The same for length, width and height, which subdivide a class; 0: do not."},
    {"segmentation", "min_size_mm", CFG_REAL, "mm", "0", 0, 1e6, AT(feature_size.min_size_mm),
     .help = "Smaller faces are dropped; 0: none."},
    {"segmentation", "local_ratio", CFG_REAL, "", "0.5", 0, 1, AT(feature_size.local_ratio),
     .help = "Classes at most this part of the largest one are local features; 0: off."},
    {"segmentation", "local_tags", CFG_NUMBERS, "", "", 1, FACE_MAX, AT(feature_size.local_tags),
     .help = "Classes that are local features, counted from 1.",
     .count_offset = AT(feature_size.n_local_tags)},
    {"segmentation", "local_faces", CFG_NUMBERS, "", "", 0, FACE_MAX, AT(feature_size.local_faces),
     .help = "Faces that are local features, counted from 0.",
     .count_offset = AT(feature_size.n_local_faces)},
    {"segmentation", "reassign", CFG_PAIRS, "", "", 0, FACE_MAX, AT(feature_size.reassign),
     .help = "Faces moved to another class by hand, as face:tag, face:tag.",
     .count_offset = AT(feature_size.n_reassign)},
    {"segmentation", "split_rest", CFG_BOOL, "", "false", 0, 0, AT(feature_size.split_rest),
     .help = "true: a region for each class of the rest; false: one for all."},
    {"region.*", "tool", CFG_INT, "", "0", 0, 9999, REGION(tool),
     .help = "Tool number; 0: the planner chooses."},
    {"region.*", "feed", CFG_REAL, "mm/min", "0", 0, 1e6, REGION(feed_mm_min),
     .help = "Cutting feed; 0: from the tool table."},
    {"region.*", "spindle", CFG_REAL, "rev/min", "0", 0, 1e6, REGION(spindle_rpm),
     .help = "Spindle speed; 0: from the tool table."},
    {"region.*", "strategy", CFG_CHOICE, "", "auto", 0, 0, REGION(strategy),
     .help = "Shape of the passes.", .choices = strategies},
    {"region.*", "skip", CFG_BOOL, "", "false", 0, 0, REGION(skip),
     .help = "true: leave the region as it is."},
};

static const CfgSchema schema = {
    .what = "recipe",
    .help = "A segmill recipe. A commented key shows its default. Lengths are in mm.",
    .keys = keys,
    .n_keys = G_N_ELEMENTS(keys),
    .size = sizeof(CfgRecipe),
    .element_size = sizeof(CfgRegion),
    .elements_offset = offsetof(CfgRecipe, regions),
    .n_elements_offset = offsetof(CfgRecipe, n_regions),
    .element_name = {"region.*", "name", CFG_STRING, "", NULL, 0, 0, REGION(name),
                     .help = "As regions.json names it."},
};

static bool check(const CfgRecipe *recipe, const CfgIni *ini, GError **error)
{
    if (!recipe->material)
        return cfg_refuse(ini, "stock", "material", error, "must not be empty");
    if (!recipe->machine_file)
        return cfg_refuse(ini, "machine", "file", error, "must not be empty");
    if ((recipe->stock_kind == CFG_STOCK_FILE) != (recipe->stock_file != NULL))
        return cfg_refuse(ini, "stock", "file", error,
                          recipe->stock_file ? "goes with kind = file only"
                                             : "is missing, which kind = file needs");
    for (int i = 0; i < 3; i++)
        if (recipe->stock_min_mm[i] > recipe->stock_max_mm[i])
            return cfg_refuse(ini, "stock", "min_mm", error, "%g is above max_mm = %g",
                              recipe->stock_min_mm[i], recipe->stock_max_mm[i]);
    for (size_t i = 0; i < recipe->feature_size.n_reassign; i++)
        if (recipe->feature_size.reassign[i][1] < 1)
            return cfg_refuse(ini, "segmentation", "reassign", error,
                              "face %d: tags are counted from 1",
                              recipe->feature_size.reassign[i][0]);
    return true;
}

static CfgRecipe *read_recipe(CfgIni *ini, char *const *set, GError **error)
{
    for (; set && *set; set++)
        if (!cfg_schema_set(&schema, ini, *set, error))
            return NULL;
    g_autoptr(CfgRecipe) recipe = cfg_schema_read(&schema, ini, error);
    if (!recipe || !check(recipe, ini, error))
        return NULL;
    recipe->settings = cfg_schema_settings(&schema, ini);
    return g_steal_pointer(&recipe);
}

CfgRecipe *cfg_recipe_load(const char *path, char *const *set, GError **error)
{
    g_autoptr(CfgIni) ini = cfg_ini_load(path, error);
    CfgRecipe *recipe = ini ? read_recipe(ini, set, error) : NULL;
    if (recipe)
        recipe->path = g_strdup(path);
    return recipe;
}

CfgRecipe *cfg_recipe_default(const char *part_file, char *const *set, GError **error)
{
    g_autoptr(CfgIni) ini = cfg_ini_parse("", 0, "defaults", error);
    if (!ini || !cfg_ini_override(ini, "part", "file", part_file, error))
        return NULL;
    return read_recipe(ini, set, error);
}

void cfg_recipe_free(CfgRecipe *recipe)
{
    if (!recipe)
        return;
    g_free(recipe->path);
    g_strfreev(recipe->settings);
    cfg_schema_free(&schema, recipe);
}

char *cfg_recipe_example(const char *part_file)
{
    return cfg_schema_example(&schema, NULL, part_file);
}

const CfgRegion *cfg_recipe_region(const CfgRecipe *recipe, const char *name)
{
    for (size_t i = 0; i < recipe->n_regions; i++)
        if (strcmp(recipe->regions[i].name, name) == 0)
            return &recipe->regions[i];
    return NULL;
}
