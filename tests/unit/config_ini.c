/* SPDX-License-Identifier: Apache-2.0 */
/* The scanner, the tables' messages, overrides, and text that is no configuration at all. */
#include <string.h>

#include "config/config.h"
#include "config/ini.h"
#include "tests/lib/test.h"

/* Loads `text` as the kind of file that `kind` says; frees it, and gives back the error. */
static GError *load(const char *kind, const char *text, gssize length)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "FILE", NULL);
    GError *error = NULL;
    g_assert_true(g_file_set_contents(path, text, length, NULL));
    if (strcmp(kind, "recipe") == 0)
        cfg_recipe_free(cfg_recipe_load(path, NULL, &error));
    else if (strcmp(kind, "machine") == 0)
        cfg_machine_free(cfg_machine_load(path, &error));
    else if (strcmp(kind, "tools") == 0)
        cfg_tools_free(cfg_tools_load(path, &error));
    else
        cfg_agent_free(cfg_agent_load(path, &error));
    test_folder_remove(folder);
    return error;
}

/* Text, and the message about it behind the path. */
typedef struct {
    const char *kind, *text, *message;
    int code;
} Case;

static const Case cases[] = {
    {"recipe", "[setup]\nclearence_mm = 3\n",
     ":2: [setup] clearence_mm: unknown key; did you mean clearance_mm?", CFG_ERROR_KEY},
    {"recipe", "[part]\nscallop_mm = 1\n",
     ":2: [part] scallop_mm: unknown key; it belongs in [quality]", CFG_ERROR_KEY},
    {"recipe", "[part]\nqqqqqqqqqqqq = 1\n", ":2: [part] qqqqqqqqqqqq: unknown key", CFG_ERROR_KEY},
    {"recipe", "\n[setp]\n", ":2: [setp]: unknown group; did you mean setup?", CFG_ERROR_KEY},
    {"recipe", "[region.]\n", ":1: [region.]: unknown group; did you mean region.*?",
     CFG_ERROR_KEY},
    {"recipe", "[setup]\n[part]\nfile = a\n[setup]\n",
     ":4: [setup] is here twice, first in line 1; join the two", CFG_ERROR_PARSE},
    {"recipe", "[setup]\nup = +z\n# no\nup = +x\n",
     ":4: [setup] up: given twice, first in line 2; keep one", CFG_ERROR_PARSE},
    {"recipe", "up = +z\n", ":1: a key before the first [group]: up", CFG_ERROR_PARSE},
    {"recipe", "[part]\nfile\n", ":2: neither [group] nor key = value: file", CFG_ERROR_PARSE},
    {"recipe", "[part\n", ":1: a group is written [name], not [part", CFG_ERROR_PARSE},
    {"recipe", "[pa rt]\n", ":1: a group's name has letters, digits, '_', '-', '.': pa rt",
     CFG_ERROR_PARSE},
    {"recipe", "[part]\nfi le = 1\n", ":2: a key has letters, digits, '_' and '-': fi le",
     CFG_ERROR_PARSE},
    {"recipe", "[part]\nfile = a\001b\n", ":2: a control character in the text", CFG_ERROR_PARSE},
    {"recipe", "[part]\nfile = \xff\n", ":2: not UTF-8 text; is this a configuration file?",
     CFG_ERROR_PARSE},
    {"recipe", "[part]\nfile = a\n[quality]\nscallop_mm = 40\n",
     ":4: [quality] scallop_mm: 40 is out of range: 0.0001 … 10 mm", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[quality]\nscallop_mm = 0x1\n",
     ":4: [quality] scallop_mm: '0x1' is not a number", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[quality]\nscallop_mm = nan\n",
     ":4: [quality] scallop_mm: 'nan' is not a number", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[quality]\nscallop_mm = 1 mm\n",
     ":4: [quality] scallop_mm: '1 mm' is not a number", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[segmentation]\npoints = 1.5\n",
     ":4: [segmentation] points: '1.5' is not a whole number", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[setup]\nup = up\n",
     ":4: [setup] up: 'up' is not one of +x, -x, +y, -y, +z, -z", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[setup]\nkeep_out = 9-3\n",
     ":4: [setup] keep_out: the range '9-3' runs backwards", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[setup]\nkeep_out = 0-900000000\n",
     ":4: [setup] keep_out: more than 1000000 numbers", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[setup]\nkeep_out = 1,,2\n",
     ":4: [setup] keep_out: '' is not a number", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[segmentation]\nreassign = 4\n",
     ":4: [segmentation] reassign: '4' is not face:tag", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[segmentation]\nreassign = 4:0\n",
     ":4: [segmentation] reassign: face 4: tags are counted from 1", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[region.boss]\nskip = yes\n",
     ":4: [region.boss] skip: 'yes' is neither true nor false", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile =\n",
     ":2: [part] file: missing; it must be given: The CAD file: IGES, STEP, STL or OFF. Files are "
     "found from this recipe's folder.",
     CFG_ERROR_VALUE},
    {"machine", "[axis.x]\nmin_mm = 1\n", ":2: [axis.x] min_mm: 1 is not below max_mm = 0",
     CFG_ERROR_VALUE},
    {"machine", "[axis.b]\npresent = true\nmin_deg = 1\nmax_deg = 0\n",
     ":3: [axis.b] min_deg: 1 is not below max_deg = 0", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[stock]\nkind = file\n",
     ":3: [stock] file: is missing, which kind = file needs", CFG_ERROR_VALUE},
    {"recipe", "[part]\nfile = a\n[stock]\nmin_mm = 1, 0, 0\n",
     ":4: [stock] min_mm: 1 is above max_mm = 0", CFG_ERROR_VALUE},
    {"machine", "[tools]\nchange_mm = 0, 0\n",
     ":2: [tools] change_mm: '0, 0' is not three numbers: x, y, z", CFG_ERROR_VALUE},
    {"machine", "[tools]\nchange_mm = 0, 0, 10\n",
     ":2: [tools] change_mm: 10 lies outside the travel -508 … 0 mm of axis.z", CFG_ERROR_VALUE},
    {"machine", "[machine]\ndialect = basic\n",
     ":2: [machine] dialect: 'basic' is not one of linuxcnc", CFG_ERROR_VALUE},
    {"tools", "", ": no [tool.NUMBER] group: no tools", CFG_ERROR_VALUE},
    {"tools", "[tool.x]\n", ":1: [tool.x]: number: 'x' is not a number", CFG_ERROR_VALUE},
    {"tools", "[tool.3]\n",
     ":1: [tool.3] kind: missing; it must be given: Shape of the tool's tip.", CFG_ERROR_VALUE},
    {"agent", "[machine.mill]\naddress = serial:1\n",
     ":2: [machine.mill] address: 'serial:1' is neither modbus://host:port nor mbaps://host:port "
     "nor can://interface",
     CFG_ERROR_VALUE},
    {"agent", "[machine.mill]\ncan_first = 5\n",
     ":2: [machine.mill] can_first: 5 is above can_last = 3", CFG_ERROR_VALUE},
    {"agent", "[panel]\nchip = gpiochip0\nstart = 3\n",
     ":1: [panel] hold: missing; chip = gpiochip0 wants start, hold and lamp", CFG_ERROR_VALUE},
};

static void messages(void)
{
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GError) error = load(cases[i].kind, cases[i].text, -1);
        g_assert_nonnull(error);
        if (!error)
            continue;
        g_assert_true(error->domain == CFG_ERROR);
        g_assert_cmpint(error->code, ==, cases[i].code);
        const char *behind = strstr(error->message, "FILE");
        g_assert_cmpstr(behind ? behind + 4 : error->message, ==, cases[i].message);
    }
}

#define TOOL_REST                                                                                  \
    "flute_length_mm = 10\nstickout_mm = 20\nlength_mm = 80\nmax_depth_of_cut_mm = 3\n"            \
    "cutting = steel: 100 0.05\n"

static void tool_checks(void)
{
    static const struct {
        const char *text, *message;
    } bad[] = {
        {"[tool.1]\nkind = bull\ndiameter_mm = 6\n" TOOL_REST,
         "[tool.1] corner_radius_mm: 0 is not between 0 and half the diameter"},
        {"[tool.1]\nkind = ball\ndiameter_mm = 6\ncorner_radius_mm = 2\n" TOOL_REST,
         "[tool.1] corner_radius_mm: 2 does not go with a ball tool, where it is 3"},
        {"[tool.1]\nkind = drill\ndiameter_mm = 6\n" TOOL_REST,
         "[tool.1] tip_angle_deg: 0: a drill tool needs the angle of its tip, above 0"},
        {"[tool.1]\nkind = flat\ndiameter_mm = 6\ntip_angle_deg = 90\n" TOOL_REST,
         "[tool.1] tip_angle_deg: 90 does not go with a flat tool; leave it out"},
        {"[tool.1]\nkind = taper\ndiameter_mm = 6\ntip_angle_deg = 9\ntip_diameter_mm = "
         "6\n" TOOL_REST,
         "[tool.1] tip_diameter_mm: 6 is not below the diameter of the taper tool"},
        {"[tool.1]\nkind = drill\ndiameter_mm = 6\ntip_angle_deg = 9\ntip_diameter_mm = "
         "1\n" TOOL_REST,
         "[tool.1] tip_diameter_mm: 1 does not go with a drill tool; leave it out"},
        {"[tool.1]\nkind = ball\ndiameter_mm = 6\n" TOOL_REST
         "[tool.01]\nkind = ball\ndiameter_mm = 6\n" TOOL_REST,
         "tool 1 is there twice"},
        {"[tool.07]\nkind = ball\ndiameter_mm = 6\n" TOOL_REST, "without leading zeros"},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(bad); i++) {
        g_autoptr(GError) error = load("tools", bad[i].text, -1);
        g_assert_nonnull(error);
        if (error && !strstr(error->message, bad[i].message))
            g_assert_cmpstr(error->message, ==, bad[i].message);
    }
    g_autoptr(GError) error =
        load("tools", "[tool.1]\nkind = ball\ndiameter_mm = 6\n" TOOL_REST, -1);
    g_assert_no_error(error);
}

static void overrides(void)
{
    char *good[] = {"scallop_mm=0.5", "setup.keep_out = 1, 4, 7-9", "region.boss.tool=3",
                    "scallop_mm=0.25", NULL};
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgRecipe) recipe = cfg_recipe_default("part.igs", good, &error);
    g_assert_no_error(error);
    if (recipe) {
        static const int32_t faces[] = {1, 4, 7, 8, 9};
        g_assert_cmpfloat(recipe->scallop_mm, ==, 0.25);
        g_assert_cmpuint(recipe->n_keep_out, ==, G_N_ELEMENTS(faces));
        g_assert_true(recipe->n_keep_out == G_N_ELEMENTS(faces) &&
                      memcmp(recipe->keep_out, faces, sizeof faces) == 0);
        const CfgRegion *region = cfg_recipe_region(recipe, "boss");
        g_assert_nonnull(region);
        g_assert_cmpint(region ? region->tool : -1, ==, 3);
        g_assert_null(cfg_recipe_region(recipe, "other"));
        g_assert_true(g_strv_contains((const char *const *)recipe->settings, "region.boss.tool=3"));
        g_assert_true(
            g_strv_contains((const char *const *)recipe->settings, "quality.scallop_mm=0.25"));
    }
    static const struct {
        char *set;
        const char *message;
    } bad[] = {
        {"file=x", "--set file: say which: part.file or stock.file or machine.file or tools.file"},
        {"clearence_mm=1", "--set clearence_mm: unknown key; did you mean clearance_mm?"},
        {"setup.clearence_mm=1",
         "--set setup.clearence_mm: unknown key; did you mean clearance_mm?"},
        {"setup.clearance_mm=x", "--set setup.clearance_mm: 'x' is not a number"},
        {"tool=1", "--set tool: say which: region.*.tool"},
        {"nothing", "--set nothing: not group.key=value"},
        {"a\n.b=c", "--set wants group.key=value, in text that could stand in a file"},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(bad); i++) {
        char *set[] = {bad[i].set, NULL};
        g_autoptr(GError) refused = NULL;
        g_autoptr(CfgRecipe) none = cfg_recipe_default("part.igs", set, &refused);
        g_assert_null(none);
        g_assert_error(refused, CFG_ERROR, CFG_ERROR_SET);
        g_assert_cmpstr(refused ? refused->message : "", ==, bad[i].message);
    }
}

static void files_from_folder(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "r.ini", NULL);
    g_autofree char *part = g_build_filename(folder, "parts", "a.igs", NULL);
    g_autofree char *machine = g_build_filename(folder, "machine.ini", NULL);
    g_assert_true(
        g_file_set_contents(path, "[part]\nfile = parts/a.igs\n[tools]\nfile = /t\n", -1, NULL));
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgRecipe) recipe = cfg_recipe_load(path, NULL, &error);
    g_assert_no_error(error);
    if (recipe) {
        g_assert_cmpstr(recipe->part_file, ==, part);
        g_assert_cmpstr(recipe->machine_file, ==, machine);
        g_assert_cmpstr(recipe->tools_file, ==, "/t");
    }
    test_folder_remove(folder);
}

static void missing_file(void)
{
    g_autoptr(GError) error = NULL;
    g_assert_null(cfg_recipe_load("/nonexistent/recipe.ini", NULL, &error));
    g_assert_error(error, CFG_ERROR, CFG_ERROR_IO);
    g_assert_nonnull(error ? strstr(error->message, "/nonexistent/recipe.ini") : NULL);
}

/* Bytes that look like a configuration, mostly. */
static void random_bytes(void)
{
    static const char letters[] = "[]=#;\n\n \t.,:-_0159eaxyz+part.setupregiontoolkind\"'\xc3\xa9";
    static const char *const kinds[] = {"recipe", "machine", "tools", "agent"};
    g_autoptr(GRand) random = g_rand_new_with_seed(42);
    for (int i = 0; i < 2000; i++) {
        char text[400];
        int n = g_rand_int_range(random, 0, sizeof text);
        for (int k = 0; k < n; k++)
            text[k] = g_rand_int_range(random, 0, 50) == 0
                          ? (char)g_rand_int_range(random, 0, 256)
                          : letters[g_rand_int_range(random, 0, sizeof letters - 1)];
        g_autoptr(GError) error = NULL;
        g_autoptr(CfgIni) ini = cfg_ini_parse(text, (size_t)n, "random", &error);
        g_assert_true((ini == NULL) == (error != NULL));
        g_clear_error(&error);
        if (i % 20 == 0)
            error = load(kinds[i / 20 % 4], text, n);
    }
}

static void large_file(void)
{
    g_autoptr(GString) text = g_string_new("[part]\n");
    while (text->len < (3u << 20))
        g_string_append_printf(text, "k%zu = 1\n", text->len);
    gint64 start_us = g_get_monotonic_time();
    g_autoptr(GError) error = load("recipe", text->str, (gssize)text->len);
    g_assert_error(error, CFG_ERROR, CFG_ERROR_KEY);
    g_assert_cmpfloat((double)(g_get_monotonic_time() - start_us), <, 10e6);
}

static void add(void)
{
    g_test_add_func("/config/ini/messages", messages);
    g_test_add_func("/config/ini/tool-checks", tool_checks);
    g_test_add_func("/config/ini/overrides", overrides);
    g_test_add_func("/config/ini/files-from-folder", files_from_folder);
    g_test_add_func("/config/ini/missing-file", missing_file);
    g_test_add_func("/config/ini/random-bytes", random_bytes);
    g_test_add_func("/config/ini/large-file", large_file);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
