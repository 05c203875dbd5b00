/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/job.h"

#include <stdio.h>
#include <string.h>

#include "agent/out/file.h"
#include "agent/out/mesh.h"
#include "agent/out/picture.h"
#include "agent/out/plan_json.h"
#include "agent/out/regions_json.h"
#include "agent/progress.h"

static char **overrides(const AgentOptions *options);
static bool load_part(AgentJob *job, GError **error);
static bool load_machine(AgentJob *job, GError **error);

AgentJob *agent_job_for_part(const AgentOptions *options, GError **error)
{
    g_autoptr(AgentJob) job = g_new0(AgentJob, 1);
    job->files = g_ptr_array_new_with_free_func(g_free);
    g_auto(GStrv) set = overrides(options);
    job->recipe = cfg_recipe_default(options->argument, set, error);
    if (!job->recipe || !load_part(job, error))
        return NULL;
    return g_steal_pointer(&job);
}

AgentJob *agent_job_for_recipe(const AgentOptions *options, GError **error)
{
    g_autoptr(AgentJob) job = g_new0(AgentJob, 1);
    job->files = g_ptr_array_new_with_free_func(g_free);
    g_auto(GStrv) set = overrides(options);
    const char *file = options->recipe ? options->recipe : options->argument;
    job->recipe = cfg_recipe_load(file, set, error);
    if (!job->recipe || !load_machine(job, error) || !load_part(job, error))
        return NULL;
    return g_steal_pointer(&job);
}

void agent_job_free(AgentJob *job)
{
    if (!job)
        return;
    g_clear_pointer(&job->program, nc_program_free);
    g_clear_pointer(&job->baseline, nc_plan_free);
    g_clear_pointer(&job->plan, nc_plan_free);
    g_clear_pointer(&job->segmentation, seg_segmentation_free);
    g_clear_pointer(&job->part, seg_part_unref);
    g_clear_pointer(&job->tools, cfg_tools_free);
    g_clear_pointer(&job->machine, cfg_machine_free);
    g_clear_pointer(&job->recipe, cfg_recipe_free);
    g_ptr_array_unref(job->files);
    g_free(job->no_baseline);
    g_free(job);
}

/* --method is one more override, the last. */
static char **overrides(const AgentOptions *options)
{
    GPtrArray *set = g_ptr_array_new();
    for (char **s = options->set; s && *s; s++)
        g_ptr_array_add(set, g_strdup(*s));
    if (options->method)
        g_ptr_array_add(set, g_strconcat("segmentation.method=", options->method, NULL));
    g_ptr_array_add(set, NULL);
    return (char **)g_ptr_array_free(set, false);
}

static bool load_machine(AgentJob *job, GError **error)
{
    job->machine = cfg_machine_load(job->recipe->machine_file, error);
    if (!job->machine)
        return false;
    job->tools = cfg_tools_load(agent_job_tools_file(job), error);
    return job->tools;
}

char *agent_job_tools_file(const AgentJob *job)
{
    return job->recipe->tools_file ? job->recipe->tools_file : job->machine->tools_file;
}

/* A step begins: its start on the monotonic clock. */
static int64_t begin(const char *what)
{
    agent_progress_step(what);
    return g_get_monotonic_time();
}

/* It ends: the seconds it took. */
static double end(int64_t start_us)
{
    agent_progress_end();
    return (double)(g_get_monotonic_time() - start_us) * 1e-6;
}

static bool load_part(AgentJob *job, GError **error)
{
    NcBudget budget;
    if (!nc_budget_share(job->recipe, &budget, error))
        return false;
    job->load = SEG_LOAD_DEFAULTS;
    job->load.chord_mm = budget.tessellation_mm;
    int64_t start_us = begin("reading the part");
    g_autoptr(GError) cause = NULL;
    job->part = seg_part_load(job->recipe->part_file, &job->load, &cause);
    job->read_s = end(start_us);
    if (job->part)
        return true;
    /* A part that cannot be read is bad input, whatever kept it from being read. */
    g_set_error_literal(error, AGENT_ERROR, AGENT_ERROR_INPUT, cause->message);
    return false;
}

static SegRepair repair_of(CfgRepair repair)
{
    switch (repair) {
    case CFG_REPAIR_RULE:
        return SEG_REPAIR_RULE;
    case CFG_REPAIR_POINTS:
        return SEG_REPAIR_POINTS;
    default:
        return SEG_REPAIR_EXACT;
    }
}

SegFeatureSizeParams agent_feature_size_params(const CfgRecipe *recipe)
{
    return (SegFeatureSizeParams){
        .repair = repair_of(recipe->feature_size.repair),
        .points = recipe->feature_size.points,
        .datum_mm = recipe->feature_size.datum_mm,
        .tolerance = recipe->feature_size.tolerance,
        .subset_tolerance = recipe->feature_size.subset_tolerance,
        .min_size_mm = recipe->feature_size.min_size_mm,
        .local_ratio = recipe->feature_size.local_ratio,
        .local_tags = recipe->feature_size.local_tags,
        .n_local_tags = recipe->feature_size.n_local_tags,
        .local_faces = recipe->feature_size.local_faces,
        .n_local_faces = recipe->feature_size.n_local_faces,
        .reassign = (const int32_t(*)[2])recipe->feature_size.reassign,
        .n_reassign = recipe->feature_size.n_reassign,
        .split_rest = recipe->feature_size.split_rest,
    };
}

bool agent_job_segment(AgentJob *job, GError **error)
{
    int64_t start_us = begin("segmenting");
    SegFeatureSizeParams params = agent_feature_size_params(job->recipe);
    job->segmentation = job->recipe->method == CFG_METHOD_NONE
                            ? seg_segment_none(job->part, error)
                            : seg_segment_feature_size(job->part, &params, error);
    job->segment_s = end(start_us);
    return job->segmentation;
}

/* ------------------------------------------------------------------------ plan */

/* What decided the program, for its header: no paths, so that the same job gives the same bytes
 * wherever its files lie. */
static char **header_of(const AgentJob *job)
{
    GPtrArray *lines = g_ptr_array_new();
    g_ptr_array_add(lines, g_strdup("segmill"));
    g_ptr_array_add(lines, g_strdup_printf("part sha256 %s", job->part->sha256));
    g_ptr_array_add(lines, g_strdup_printf("machine %s", job->machine->name));
    for (char **setting = job->recipe->settings; *setting; setting++)
        if (!strstr(*setting, ".file="))
            g_ptr_array_add(lines, g_strdup(*setting));
    g_ptr_array_add(lines, NULL);
    /* A comment ends at the first ')', and controllers read ASCII. */
    for (guint i = 0; i + 1 < lines->len; i++)
        for (char *c = g_ptr_array_index(lines, i); *c; c++)
            *c = *c == '(' ? '[' : *c == ')' ? ']' : *c < ' ' || *c > '~' ? '?' : *c;
    return (char **)g_ptr_array_free(lines, false);
}

static void show_share(double done, void *what)
{
    agent_progress_share(what, done);
}

NcPlanInput agent_job_input(const AgentJob *job, char *step)
{
    return (NcPlanInput){.part = job->part,
                         .segmentation = job->segmentation,
                         .recipe = job->recipe,
                         .machine = job->machine,
                         .tools = job->tools,
                         .progress = show_share,
                         .progress_data = step};
}

bool agent_job_plan(AgentJob *job, GError **error)
{
    static char planning[] = "planning", comparing[] = "planning with one tool";
    int64_t start_us = begin(planning);
    NcPlanInput input = agent_job_input(job, planning);
    job->plan = nc_plan_new(&input, error);
    job->plan_s = end(start_us);
    if (!job->plan)
        return false;
    input.progress_data = comparing;
    start_us = begin(comparing);
    g_autoptr(GError) no_baseline = NULL;
    job->baseline = nc_plan_baseline(&input, &no_baseline);
    if (!job->baseline)
        job->no_baseline = g_strdup(no_baseline->message);
    g_auto(GStrv) header = header_of(job);
    job->program = nc_program_write(job->plan, job->recipe, job->machine, header, error);
    job->plan_s += end(start_us);
    return job->program;
}

/* ----------------------------------------------------------------------- files */

static bool write_file(AgentJob *job, const char *folder, const char *name, const void *bytes,
                       size_t length, GError **error)
{
    g_ptr_array_add(job->files, g_strdup(name));
    return agent_file_write(folder, name, bytes, length, error);
}

static bool write_text(AgentJob *job, const char *folder, const char *name, const char *text,
                       GError **error)
{
    return write_file(job, folder, name, text, strlen(text), error);
}

/* The faces of the local regions, or of all others, ascending. */
static GArray *faces_of(const SegSegmentation *segmentation, bool local)
{
    GArray *faces = g_array_new(false, false, sizeof(int32_t));
    for (size_t r = 0; r < segmentation->n_regions; r++) {
        const SegRegion *region = &segmentation->regions[r];
        for (size_t p = 0; (region->kind == SEG_REGION_LOCAL) == local && p < region->n_pieces; p++)
            g_array_append_val(faces, region->pieces[p].face);
    }
    return faces;
}

static bool write_iges(AgentJob *job, const char *folder, const char *name, bool local,
                       GError **error)
{
    g_autoptr(GArray) faces = faces_of(job->segmentation, local);
    g_autofree char *path = g_build_filename(folder, name, NULL);
    if (faces->len == 0) {
        /* What an earlier run left there would be taken for ours. */
        remove(path);
        return true;
    }
    g_ptr_array_add(job->files, g_strdup(name));
    return seg_part_write_iges(job->part, (const int32_t *)(void *)faces->data, faces->len, path,
                               &job->load, error);
}

bool agent_job_write_regions(AgentJob *job, const char *folder, GError **error)
{
    int64_t start_us = begin("writing the regions");
    if (!agent_file_folder(folder, error))
        return false;
    g_autofree char *json = agent_regions_json(job->part, job->segmentation);
    g_autofree char *obj = agent_regions_obj(job->part, job->segmentation);
    g_autoptr(GBytes) png = agent_regions_png(job->part, job->segmentation, error);
    bool ok = png && write_text(job, folder, "regions.json", json, error) &&
              write_text(job, folder, "regions.obj", obj, error) &&
              write_file(job, folder, "regions.png", g_bytes_get_data(png, NULL),
                         g_bytes_get_size(png), error);
    if (ok && job->recipe->method == CFG_METHOD_FEATURE_SIZE)
        ok = write_iges(job, folder, "local.igs", true, error) &&
             write_iges(job, folder, "rest.igs", false, error);
    job->write_s += end(start_us);
    return ok;
}

bool agent_job_write_plan(AgentJob *job, const char *folder, GError **error)
{
    int64_t start_us = begin("writing the program");
    g_autofree char *json = agent_plan_json(job->plan, job->baseline, job->program);
    bool ok = agent_file_folder(folder, error) &&
              write_file(job, folder, "program.ngc", g_bytes_get_data(job->program->bytes, NULL),
                         g_bytes_get_size(job->program->bytes), error) &&
              write_text(job, folder, "plan.json", json, error);
    job->write_s += end(start_us);
    return ok;
}

void agent_job_describe(const AgentJob *job, AgentJson *result)
{
    agent_json_string(result, "part_sha256", job->part->sha256);
    agent_json_integer(result, "faces", job->part->n_faces);
    agent_json_integer(result, "triangles", job->part->n_triangles);
    agent_json_integer(result, "regions", (int64_t)job->segmentation->n_regions);
    agent_json_row(result, "files");
    for (guint i = 0; i < job->files->len; i++)
        agent_json_string(result, NULL, g_ptr_array_index(job->files, i));
    agent_json_end(result);
    agent_json_object(result, "seconds");
    agent_json_number(result, "read", job->read_s);
    agent_json_number(result, "segment", job->segment_s);
    if (job->plan)
        agent_json_number(result, "plan", job->plan_s);
    agent_json_number(result, "write", job->write_s);
    agent_json_end(result);
}

void agent_job_describe_plan(const AgentJob *job, AgentJson *result)
{
    agent_json_string(result, "program_sha256", job->program->sha256);
    agent_json_integer(result, "program_bytes", (int64_t)g_bytes_get_size(job->program->bytes));
    agent_json_integer(result, "gates", (int64_t)job->program->n_gates);
    agent_json_number(result, "estimated_s", job->plan->estimated_s);
    agent_json_number(result, "saving_percent", agent_saving_percent(job->plan, job->baseline));
    agent_json_number(result, "speedup_percent", agent_speedup_percent(job->plan, job->baseline));
    agent_json_array(result, "notes");
    for (guint i = 0; job->plan->notes && i < job->plan->notes->len; i++)
        agent_json_string(result, NULL, g_ptr_array_index(job->plan->notes, i));
    if (job->no_baseline)
        agent_json_string(result, NULL, job->no_baseline);
    agent_json_end(result);
}

void agent_job_show_notes(const AgentJob *job)
{
    for (guint i = 0; job->plan->notes && i < job->plan->notes->len; i++)
        agent_progress_note("%s", (const char *)g_ptr_array_index(job->plan->notes, i));
    if (job->no_baseline)
        agent_progress_note("no comparison with one tool: %s", job->no_baseline);
}
