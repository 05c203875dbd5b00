/* SPDX-License-Identifier: Apache-2.0 */
/* The shipped files: every key is there, and every default they show is the default in force. */
#include <string.h>

#include "config/config.h"
#include "tests/lib/test.h"

#define SHIPPED "config/etc"

static char *read_file(const char *folder, const char *name)
{
    g_autofree char *path = g_build_filename(folder, name, NULL);
    char *text = NULL;
    g_autoptr(GError) error = NULL;
    g_file_get_contents(path, &text, NULL, &error);
    g_assert_no_error(error);
    return text ? text : g_strdup("");
}

/* "#key = value" and "#[group]" made lines that count; words after "# " stay comments. */
static char *uncommented(const char *text)
{
    g_auto(GStrv) lines = g_strsplit(text, "\n", -1);
    for (char **line = lines; *line; line++)
        if ((*line)[0] == '#' && (*line)[1] && (*line)[1] != ' ')
            memmove(*line, *line + 1, strlen(*line));
    return g_strjoinv("\n", lines);
}

static char *written(const char *folder, const char *name, const char *text)
{
    char *path = g_build_filename(folder, name, NULL);
    g_assert_true(g_file_set_contents(path, text, -1, NULL));
    return path;
}

static void recipe(void)
{
    char *folder = test_folder();
    g_autofree char *example = cfg_recipe_example("p0-piece.igs");
    g_autofree char *all = uncommented(example);
    g_autofree char *a = written(folder, "as-is.ini", example);
    g_autofree char *b = written(folder, "all.ini", all);
    g_autoptr(GError) error = NULL;
    char *set[] = {"region.NAME.tool=0", NULL};
    g_autoptr(CfgRecipe) as_is = cfg_recipe_load(a, set, &error);
    g_assert_no_error(error);
    g_autoptr(CfgRecipe) explicit = cfg_recipe_load(b, NULL, &error);
    g_assert_no_error(error);
    if (as_is && explicit) {
        g_assert_cmpint(g_strv_length(explicit->settings), >, 30);
        g_assert_true(g_strv_equal((const char *const *)as_is->settings,
                                   (const char *const *)explicit->settings));
        g_assert_cmpfloat(as_is->tolerance_mm, ==, explicit->tolerance_mm);
        g_assert_cmpint(as_is->wcs, ==, 54);
        g_assert_cmpint((int)as_is->up, ==, CFG_UP_PLUS_Z);
        g_assert_cmpfloat(as_is->feature_size.tolerance, ==, 0.05);
        g_assert_null(as_is->tools_file);
    }
    test_folder_remove(folder);
}

/* The shipped demo recipe: every key of the table, and nothing but values on top. */
static void shipped_recipe(void)
{
    g_autofree char *example = cfg_recipe_example("p0-piece.igs");
    g_autofree char *shipped = read_file(SHIPPED, "recipe.ini");
    g_auto(GStrv) lines = g_strsplit(example, "\n", -1);
    for (char **line = lines; *line; line++)
        if (!strstr(shipped, *line))
            g_assert_cmpstr(*line, ==, "a line of config/etc/recipe.ini");
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgRecipe) loaded = cfg_recipe_load(SHIPPED "/recipe.ini", NULL, &error);
    g_assert_no_error(error);
    g_assert_nonnull(loaded);
}

static void machine(void)
{
    g_autofree char *example = cfg_machine_example();
    g_autofree char *shipped = read_file(SHIPPED, "machine.ini");
    g_assert_cmpstr(shipped, ==, example);
    char *folder = test_folder();
    g_autofree char *all = uncommented(example);
    g_autofree char *a = written(folder, "as-is.ini", example);
    g_autofree char *b = written(folder, "all.ini", all);
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgMachine) as_is = cfg_machine_load(a, &error);
    g_assert_no_error(error);
    g_autoptr(CfgMachine) explicit = cfg_machine_load(b, &error);
    g_assert_no_error(error);
    if (as_is && explicit) {
        g_assert_true(memcmp(as_is->axis, explicit->axis, sizeof as_is->axis) == 0);
        g_assert_true(memcmp(as_is->work_offset_mm, explicit->work_offset_mm,
                             sizeof as_is->work_offset_mm) == 0);
        g_assert_cmpstr(as_is->name, ==, explicit->name);
        g_assert_cmpstr(as_is->tools_file, ==, explicit->tools_file);
        g_assert_cmpfloat(as_is->spindle_max_rpm, ==, 24000);
        g_assert_cmpfloat(as_is->tool_change_s, ==, 8);
        g_assert_cmpfloat(as_is->axis[2].min_mm, ==, -508);
        g_assert_cmpint((int)as_is->on_agent_loss, ==, CFG_AGENT_LOSS_NEXT_GATE);
    }
    test_folder_remove(folder);
}

static void agent(void)
{
    g_autofree char *example = cfg_agent_example();
    g_autofree char *shipped = read_file(SHIPPED, "agent.ini");
    g_assert_cmpstr(shipped, ==, example);
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgAgent) loaded = cfg_agent_load(SHIPPED "/agent.ini", &error);
    g_assert_no_error(error);
    g_autoptr(CfgAgent) built_in = cfg_agent_default(&error);
    g_assert_no_error(error);
    if (!loaded || !built_in)
        return;
    g_assert_cmpuint(loaded->n_machines, ==, 1);
    g_assert_cmpuint(built_in->n_machines, ==, 1);
    g_assert_cmpstr(built_in->machines[0].name, ==, "sim");
    g_assert_cmpstr(loaded->machines[0].name, ==, "sim");
    g_assert_cmpstr(built_in->machines[0].address, ==, "modbus://127.0.0.1:1502");
    g_assert_cmpstr(loaded->machines[0].address, ==, built_in->machines[0].address);
    g_assert_cmpfloat(loaded->give_up_s, ==, built_in->give_up_s);
    g_assert_cmpfloat(loaded->heartbeat_s, ==, built_in->heartbeat_s);
}

/* A table that a shop could start from: every shape from Ø1 to Ø20, for every material. */
static void shipped_tools(void)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgToolTable) table = cfg_tools_load(SHIPPED "/tools.ini", &error);
    g_assert_no_error(error);
    if (!table)
        return;
    double smallest[3] = {99, 99, 99}, largest[3] = {0, 0, 0};
    for (size_t i = 0; i < table->n_tools; i++) {
        const CfgTool *tool = &table->tools[i];
        g_assert_true(cfg_tools_find(table, tool->number) == tool);
        g_assert_cmpuint(tool->n_cutting, ==, 5);
        smallest[tool->kind] = MIN(smallest[tool->kind], tool->diameter_mm);
        largest[tool->kind] = MAX(largest[tool->kind], tool->diameter_mm);
        if (i > 0)
            g_assert_cmpint(tool->number, >, table->tools[i - 1].number);
    }
    g_assert_null(cfg_tools_find(table, 9999));
    g_assert_cmpfloat(smallest[CFG_TOOL_FLAT], ==, 1);
    g_assert_cmpfloat(smallest[CFG_TOOL_BALL], ==, 1);
    g_assert_cmpfloat(largest[CFG_TOOL_FLAT], ==, 20);
    g_assert_cmpfloat(largest[CFG_TOOL_BALL], ==, 20);
    g_assert_cmpfloat(largest[CFG_TOOL_BULL], ==, 20);
    const CfgTool *ball = cfg_tools_find(table, 16);
    g_assert_nonnull(ball);
    if (ball) {
        g_assert_cmpfloat(ball->corner_radius_mm, ==, ball->diameter_mm / 2);
        g_assert_cmpstr(ball->cutting[0].material, ==, "aluminium-6061");
        g_assert_cmpfloat(ball->cutting[0].cutting_speed_m_min, ==, 300);
    }
}

static void add(void)
{
    g_test_add_func("/config/files/recipe", recipe);
    g_test_add_func("/config/files/shipped-recipe", shipped_recipe);
    g_test_add_func("/config/files/machine", machine);
    g_test_add_func("/config/files/agent", agent);
    g_test_add_func("/config/files/shipped-tools", shipped_tools);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
