/* SPDX-License-Identifier: Apache-2.0 */
/* Every error has the exit status that the contract gives it; the recipe becomes parameters. */
#include "agent/agent.h"
#include "agent/job.h"
#include "fieldbus/fieldbus.h"
#include "tests/lib/test.h"

static void exit_statuses(void)
{
    const struct {
        GQuark domain;
        int code;
        AgentExit status;
        const char *name;
    } cases[] = {
        {AGENT_ERROR, AGENT_ERROR_INTERRUPTED, AGENT_EXIT_ABORTED, "agent"},
        {AGENT_ERROR, AGENT_ERROR_USAGE, AGENT_EXIT_USAGE, "agent"},
        {AGENT_ERROR, AGENT_ERROR_TARGET, AGENT_EXIT_USAGE, "agent"},
        {AGENT_ERROR, AGENT_ERROR_INPUT, AGENT_EXIT_INPUT, "agent"},
        {AGENT_ERROR, AGENT_ERROR_OUTPUT, AGENT_EXIT_FAILED, "agent"},
        {CFG_ERROR, CFG_ERROR_SET, AGENT_EXIT_USAGE, "config"},
        {CFG_ERROR, CFG_ERROR_KEY, AGENT_EXIT_INPUT, "config"},
        {CFG_ERROR, CFG_ERROR_IO, AGENT_EXIT_INPUT, "config"},
        {SEG_ERROR, SEG_ERROR_INPUT, AGENT_EXIT_INPUT, "segcore"},
        {SEG_ERROR, SEG_ERROR_ARGUMENT, AGENT_EXIT_INPUT, "segcore"},
        {SEG_ERROR, SEG_ERROR_IO, AGENT_EXIT_FAILED, "segcore"},
        {NC_ERROR, NC_ERROR_PLAN, AGENT_EXIT_INPUT, "nc"},
        {NC_ERROR, NC_ERROR_LIMIT, AGENT_EXIT_INPUT, "nc"},
        {FB_ERROR, FB_ERROR_UNREACHABLE, AGENT_EXIT_REFUSED, "fieldbus"},
        {FB_ERROR, FB_ERROR_PROTOCOL, AGENT_EXIT_REFUSED, "fieldbus"},
        {FB_ERROR, FB_ERROR_REFUSED, AGENT_EXIT_REFUSED, "fieldbus"},
        {FB_ERROR, FB_ERROR_ALARM, AGENT_EXIT_ALARM, "fieldbus"},
        {FB_ERROR, FB_ERROR_ABORTED, AGENT_EXIT_ABORTED, "fieldbus"},
        {FB_ERROR, FB_ERROR_LINK_LOST, AGENT_EXIT_LINK_LOST, "fieldbus"},
        {G_FILE_ERROR, G_FILE_ERROR_NOENT, AGENT_EXIT_FAILED, "g-file-error-quark"},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GError) error = g_error_new_literal(cases[i].domain, cases[i].code, "");
        g_assert_cmpint((int)agent_exit_of(error), ==, (int)cases[i].status);
        g_assert_cmpstr(agent_domain_name(error->domain), ==, cases[i].name);
    }
}

/* The numbers are an interface: programs compare them. */
static void numbers(void)
{
    g_assert_cmpint(AGENT_EXIT_DONE, ==, 0);
    g_assert_cmpint(AGENT_EXIT_REFUSED, ==, 4);
    g_assert_cmpint(AGENT_EXIT_CAUTION, ==, 8);
}

static void feature_size_params(void)
{
    char *set[] = {"repair=points",        "points=11",     "datum_mm=7",       "tolerance=0.1",
                   "local_tags=2-3",       "local_faces=5", "reassign=4:2,9:1", "split_rest=true",
                   "subset_tolerance=0.2", "min_size_mm=1", "local_ratio=0.25", NULL};
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgRecipe) recipe = cfg_recipe_default("part.igs", set, &error);
    g_assert_no_error(error);
    if (!recipe)
        return;
    SegFeatureSizeParams params = agent_feature_size_params(recipe);
    g_assert_cmpint((int)params.repair, ==, SEG_REPAIR_POINTS);
    g_assert_cmpint(params.points, ==, 11);
    g_assert_cmpfloat(params.datum_mm, ==, 7);
    g_assert_cmpfloat(params.tolerance, ==, 0.1);
    g_assert_cmpfloat(params.subset_tolerance, ==, 0.2);
    g_assert_cmpfloat(params.min_size_mm, ==, 1);
    g_assert_cmpfloat(params.local_ratio, ==, 0.25);
    g_assert_true(params.split_rest);
    g_assert_true(params.n_local_tags == 2 && params.local_tags[1] == 3);
    g_assert_true(params.n_local_faces == 1 && params.local_faces[0] == 5);
    g_assert_true(params.n_reassign == 2 && params.reassign[1][0] == 9 &&
                  params.reassign[1][1] == 1);
}

/* The recipe's defaults are the method's. */
static void default_params(void)
{
    g_autoptr(CfgRecipe) recipe = cfg_recipe_default("part.igs", NULL, NULL);
    g_assert_nonnull(recipe);
    if (!recipe)
        return;
    SegFeatureSizeParams ours = agent_feature_size_params(recipe);
    SegFeatureSizeParams theirs = SEG_FEATURE_SIZE_DEFAULTS;
    g_assert_cmpint((int)ours.repair, ==, (int)theirs.repair);
    g_assert_cmpfloat(ours.tolerance, ==, theirs.tolerance);
    g_assert_cmpfloat(ours.local_ratio, ==, theirs.local_ratio);
    g_assert_cmpfloat(ours.subset_tolerance, ==, theirs.subset_tolerance);
    g_assert_cmpfloat(ours.min_size_mm, ==, theirs.min_size_mm);
    g_assert_cmpint(ours.split_rest, ==, theirs.split_rest);
}

static void add(void)
{
    g_test_add_func("/agent/errors/exit-statuses", exit_statuses);
    g_test_add_func("/agent/errors/numbers", numbers);
    g_test_add_func("/agent/errors/feature-size-params", feature_size_params);
    g_test_add_func("/agent/errors/default-params", default_params);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
