/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "agent/job.h"
#include "agent/out/deviation.h"
#include "agent/out/file.h"
#include "agent/out/verify_json.h"
#include "agent/program.h"
#include "agent/progress.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_verify = {
    .name = "verify",
    .argument = "PROGRAM",
    .synopsis = "PROGRAM --recipe RECIPE [--set KEY=VALUE …] -o DIR",
    .summary = "cut a program into the recipe's stock and compare with the CAD faces",
    .help =
        "Removes what the tools of the program sweep, exactly, along lines through points of the\n"
        "CAD faces, and tells how far the surface that is left lies from them: above (excess) by "
        "no\n"
        "more than quality.scallop_mm + quality.tolerance_mm where the plan's tools can come to,\n"
        "below (gouge) nowhere by more than quality.tolerance_mm; quality.stock_to_leave_mm is\n"
        "taken off. Rapids through stock, shank and holder in it, and a spindle that does not "
        "turn\n"
        "the right way are collisions. The program may be anyone's; it is placed by the recipe's\n"
        "setup and work offset.\n\n"
        "Writes into DIR: verify.json and deviation.png. Exit status 1: out of tolerance.",
    .out_help = "Folder of the results; made where it is missing",
    .takes = AGENT_TAKES_OUT | AGENT_TAKES_SET | AGENT_TAKES_RECIPE,
    .needs = AGENT_TAKES_OUT | AGENT_TAKES_RECIPE,
    .run = run,
};

static GArray *read_moves(const char *path, const AgentJob *job, char **sha256, GError **error);
static NcVerdict *judge(AgentJob *job, const char *path, const GArray *moves, double *seconds,
                        GError **error);
static bool write_results(AgentJob *job, const NcVerdict *verdict, const char *sha256,
                          const char *folder, GError **error);
static void describe(const AgentJob *job, const NcVerdict *verdict, const char *sha256,
                     double seconds, AgentJson *result);
static void print_table(const AgentJob *job, const NcVerdict *verdict);
static bool report(const NcVerdict *verdict, GError **error);

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentJob) job = agent_job_for_recipe(options, error);
    if (!job || !agent_job_segment(job, error))
        return false;
    g_autofree char *sha256 = NULL;
    g_autoptr(GArray) moves = read_moves(options->argument, job, &sha256, error);
    double seconds = 0;
    g_autoptr(NcVerdict) verdict =
        moves ? judge(job, options->argument, moves, &seconds, error) : NULL;
    if (!verdict || !write_results(job, verdict, sha256, options->out, error))
        return false;
    describe(job, verdict, sha256, seconds, result);
    if (!options->json)
        print_table(job, verdict);
    return report(verdict, error);
}

static GArray *read_moves(const char *path, const AgentJob *job, char **sha256, GError **error)
{
    g_autoptr(GBytes) bytes = agent_program_load(path, error);
    if (!bytes)
        return NULL;
    *sha256 = g_compute_checksum_for_bytes(G_CHECKSUM_SHA256, bytes);
    size_t length;
    const char *text = g_bytes_get_data(bytes, &length);
    GArray *moves = nc_read_program(text, length, job->machine, job->tools, error);
    if (!moves)
        g_prefix_error(error, "%s: ", path);
    return moves;
}

static NcVerdict *judge(AgentJob *job, const char *path, const GArray *moves, double *seconds,
                        GError **error)
{
    static char verifying[] = "verifying";
    NcPlanInput input = agent_job_input(job, verifying);
    agent_progress_step(verifying);
    int64_t start_us = g_get_monotonic_time();
    g_autoptr(GError) cause = NULL;
    NcVerdict *verdict =
        nc_verify(&input, (const NcMove *)(const void *)moves->data, moves->len, &cause);
    agent_progress_end();
    *seconds = (double)(g_get_monotonic_time() - start_us) * 1e-6;
    if (verdict)
        return verdict;
    /* Stock that cannot be read is bad input, as a part is; status 1 is a verdict. */
    bool of_program = g_error_matches(cause, NC_ERROR, NC_ERROR_PROGRAM);
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT, "%s%s%s", of_program ? path : "",
                of_program ? ": " : "", cause->message);
    return NULL;
}

static bool write_results(AgentJob *job, const NcVerdict *verdict, const char *sha256,
                          const char *folder, GError **error)
{
    NcSetup setup = nc_setup_new(job->part, job->recipe->up, job->recipe->zero);
    g_autofree char *json = agent_verify_json(verdict, job->recipe, job->part, sha256);
    g_autoptr(GBytes) png =
        agent_deviation_png(job->part, job->segmentation, &setup, verdict, error);
    return png && agent_file_folder(folder, error) &&
           agent_file_write(folder, "verify.json", json, strlen(json), error) &&
           agent_file_write(folder, "deviation.png", g_bytes_get_data(png, NULL),
                            g_bytes_get_size(png), error);
}

static void describe(const AgentJob *job, const NcVerdict *verdict, const char *sha256,
                     double seconds, AgentJson *result)
{
    const NcJudgement *whole = &verdict->whole;
    agent_json_string(result, "program_sha256", sha256);
    agent_json_bool(result, "in_tolerance", verdict->in_tolerance);
    agent_json_number(result, "gouge_max_mm", whole->gouge_max.depth_mm);
    agent_json_number(result, "excess_max_mm", whole->excess_max.depth_mm);
    agent_json_number(result, "coverage_percent", whole->coverage_percent);
    agent_json_number(result, "within_tolerance_percent", whole->within_tolerance_percent);
    agent_json_integer(result, "collisions", verdict->collisions->len);
    agent_json_row(result, "files");
    agent_json_string(result, NULL, "verify.json");
    agent_json_string(result, NULL, "deviation.png");
    agent_json_end(result);
    agent_json_object(result, "seconds");
    agent_json_number(result, "read", job->read_s);
    agent_json_number(result, "segment", job->segment_s);
    agent_json_number(result, "verify", seconds);
    agent_json_end(result);
}

/* -------------------------------------------------------------------- for people */

/* "-" where there is nothing to take a share of. */
static void print_percent(double percent)
{
    if (isnan(percent))
        printf(" %10s", "-");
    else
        printf(" %10.3f", percent);
}

static void print_row(const char *name, const NcJudgement *judgement)
{
    printf("%-16s %10.4f %10.4f %10.4f %12.3f %12.3f", name, judgement->gouge_max.depth_mm,
           judgement->excess_max.depth_mm, judgement->excess_p99_mm, judgement->requested_area_mm2,
           judgement->unreachable_area_mm2);
    print_percent(judgement->coverage_percent);
    print_percent(judgement->within_tolerance_percent);
    printf("\n");
}

static const char *region_name(const SegSegmentation *segmentation, int32_t id)
{
    for (size_t r = 0; r < segmentation->n_regions; r++)
        if (segmentation->regions[r].id == id)
            return segmentation->regions[r].name;
    return "";
}

static void print_table(const AgentJob *job, const NcVerdict *verdict)
{
    printf("%-16s %10s %10s %10s %12s %12s %10s %10s\n", "region", "gouge mm", "excess mm",
           "99 % mm", "asked mm²", "unreach. mm²", "covered %", "within %");
    for (size_t i = 0; i < verdict->n_regions; i++)
        print_row(region_name(job->segmentation, verdict->regions[i].region), &verdict->regions[i]);
    print_row("all", &verdict->whole);
    for (guint i = 0; i < verdict->collisions->len; i++) {
        const NcCollision *c = &g_array_index(verdict->collisions, NcCollision, i);
        printf("line %u: %s in material, %.3f mm deep at (%.3f, %.3f, %.3f)\n", c->line,
               nc_collision_name(c->kind), c->depth_mm, c->position.x, c->position.y,
               c->position.z);
    }
}

/* "0.0312 mm of excess (limit 0.03) at (1, 2, 3), line 17"; "at least 10 mm …" */
static void add_worst(GString *text, const char *what, const NcWorst *worst, double limit_mm)
{
    if (worst->depth_mm <= limit_mm)
        return;
    g_string_append_printf(text, "%s%s%.4g mm of %s (limit %.4g) at (%.3f, %.3f, %.3f), ",
                           text->len > 0 ? "; " : "",
                           worst->depth_mm >= NC_VERIFY_MOST_MM ? "at least " : "", worst->depth_mm,
                           what, limit_mm, worst->point.x, worst->point.y, worst->point.z);
    if (worst->line > 0)
        g_string_append_printf(text, "line %u", worst->line);
    else
        g_string_append(text, "where nothing was cut");
}

static bool report(const NcVerdict *verdict, GError **error)
{
    if (verdict->in_tolerance)
        return true;
    g_autoptr(GString) text = g_string_new(NULL);
    add_worst(text, "gouge", &verdict->whole.gouge_max, verdict->gouge_limit_mm);
    add_worst(text, "excess", &verdict->whole.excess_max, verdict->excess_limit_mm);
    if (verdict->collisions->len > 0) {
        const NcCollision *first = &g_array_index(verdict->collisions, NcCollision, 0);
        g_string_append_printf(text, "%s%u collision%s, the first in line %u (%s)",
                               text->len > 0 ? "; " : "", verdict->collisions->len,
                               verdict->collisions->len == 1 ? "" : "s", first->line,
                               nc_collision_name(first->kind));
    }
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_TOLERANCE, "out of tolerance: %s", text->str);
    return false;
}
