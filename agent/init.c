/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "agent/job.h"
#include "agent/out/file.h"
#include "agent/progress.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_init = {
    .name = "init",
    .argument = "PART",
    .synopsis = "PART -o RECIPE",
    .summary = "write a commented recipe with the defaults for a part",
    .help =
        "Reads the part, and writes a recipe that names it: every key with its default as a\n"
        "comment, and a group for each region that the default segmentation finds. The recipe\n"
        "also names a machine.ini, which it expects beside it. A file that is there already is\n"
        "not overwritten.",
    .out_help = "The recipe to write",
    .takes = AGENT_TAKES_OUT,
    .needs = AGENT_TAKES_OUT,
    .run = run,
};

/* The part as the recipe names it: relative where it lies below the recipe's folder. */
static char *part_name(const char *part, const char *folder)
{
    g_autofree char *absolute = g_canonicalize_filename(part, NULL);
    g_autofree char *base = g_canonicalize_filename(folder, NULL);
    size_t n = strlen(base);
    if (g_str_has_prefix(absolute, base) && absolute[n] == '/')
        return g_strdup(absolute + n + 1);
    return g_steal_pointer(&absolute);
}

/* The regions as commented groups, so that a person finds their names. */
static char *region_groups(const SegSegmentation *segmentation)
{
    GString *text = g_string_new("\n# The regions of this part, by the defaults above:\n");
    for (size_t i = 0; i < segmentation->n_regions; i++) {
        const SegRegion *region = &segmentation->regions[i];
        g_string_append_printf(text, "# %s, %zu face%s, %.6g mm²:\n#[region.%s]\n",
                               seg_region_kind_name(region->kind), region->n_pieces,
                               region->n_pieces == 1 ? "" : "s", region->area_mm2, region->name);
    }
    return g_string_free(text, false);
}

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    if (g_file_test(options->out, G_FILE_TEST_EXISTS)) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_OUTPUT,
                    "%s is there already; remove it or choose another name", options->out);
        return false;
    }
    g_autoptr(AgentJob) job = agent_job_for_part(options, error);
    if (!job || !agent_job_segment(job, error))
        return false;
    g_autofree char *folder = g_path_get_dirname(options->out);
    g_autofree char *name = g_path_get_basename(options->out);
    g_autofree char *part = part_name(options->argument, folder);
    g_autofree char *example = cfg_recipe_example(part);
    g_autofree char *groups = region_groups(job->segmentation);
    g_autofree char *text = g_strconcat(example, groups, NULL);
    if (!agent_file_folder(folder, error) ||
        !agent_file_write(folder, name, text, strlen(text), error))
        return false;
    agent_json_string(result, "recipe", options->out);
    agent_json_integer(result, "regions", (int64_t)job->segmentation->n_regions);
    g_autofree char *machine = g_build_filename(folder, "machine.ini", NULL);
    if (!g_file_test(machine, G_FILE_TEST_EXISTS))
        agent_progress_note("the recipe expects %s; examples of it and of tools.ini come with "
                            "segmill, or set [machine] file",
                            machine);
    if (!options->json)
        printf("%s: %zu regions\n", options->out, job->segmentation->n_regions);
    return true;
}
