/* SPDX-License-Identifier: Apache-2.0 */
/* CAD files, through segmill-cad: what becomes of the child, and what is told about it. */
#include "segcore/geom/child.h"
#include "segcore/geom/reader.h"

#include <errno.h>
#include <glib/gstdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { CHILD_INPUT = 3 }; /* segmill-cad's exit status for a file that is not usable */

static char *find_helper(const SegLoadOptions *options);
static bool judge(const SegChildResult *child, const char *doing, const char *path,
                  const SegLoadOptions *options, GError **error);

SegPart *seg_read_cad(const char *path, const char *sha256, const SegLoadOptions *options,
                      GError **error)
{
    const SegLoadOptions defaults = SEG_LOAD_DEFAULTS;
    if (!options)
        options = &defaults;
    char chord[G_ASCII_DTOSTR_BUF_SIZE], angle[G_ASCII_DTOSTR_BUF_SIZE];
    g_ascii_dtostr(chord, sizeof chord, options->chord_mm);
    g_ascii_dtostr(angle, sizeof angle, options->angle_rad);
    g_autofree char *helper = find_helper(options);
    g_autofree char *absolute = g_canonicalize_filename(path, NULL); /* no name is an option */
    const char *argv[] = {helper, "read", absolute, "--chord", chord, "--angle", angle, NULL};
    SegChildLimits limits = {options->timeout_s, options->memory_bytes};
    g_auto(SegChildResult) child = {0};
    if (!seg_child_run(argv, NULL, &limits, &child, error) ||
        !judge(&child, "reading", path, options, error))
        return NULL;

    g_autoptr(GBytes) form = g_bytes_new_take(g_steal_pointer(&child.out), child.out_length);
    g_autoptr(SegPart) part = seg_part_from_form(form, error);
    if (!part) {
        g_prefix_error(error, "%s: segmill-cad sent what is no part: ", path);
        return NULL;
    }
    if (strcmp(part->sha256, sha256) != 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT, "%s: changed while it was being read", path);
        return NULL;
    }
    return g_steal_pointer(&part);
}

/* "0\n5\n…", for the child's standard input. */
static GString *list_faces(const SegPart *part, const int32_t *faces, size_t n, GError **error)
{
    g_autoptr(GString) list = g_string_new(NULL);
    for (size_t i = 0; i < n; i++) {
        if (faces[i] < 0 || faces[i] >= part->n_faces) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT, "%s: face %d of %d does not exist",
                        part->path, faces[i], part->n_faces);
            return NULL;
        }
        g_string_append_printf(list, "%d\n", faces[i]);
    }
    return g_steal_pointer(&list);
}

static bool is_unchanged(const SegPart *part, GError **error)
{
    g_autofree char *bytes = NULL;
    g_autoptr(GError) why = NULL;
    gsize length;
    if (!g_file_get_contents(part->path, &bytes, &length, &why)) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_IO, "%s: %s", part->path, why->message);
        return false;
    }
    g_autofree char *sha256 =
        g_compute_checksum_for_data(G_CHECKSUM_SHA256, (const guchar *)bytes, length);
    if (strcmp(sha256, part->sha256) == 0)
        return true;
    g_set_error(error, SEG_ERROR, SEG_ERROR_INPUT,
                "%s: changed since the part was read; read it again", part->path);
    return false;
}

bool seg_part_write_iges(const SegPart *part, const int32_t *faces, size_t n_faces,
                         const char *out_path, const SegLoadOptions *options, GError **error)
{
    const SegLoadOptions defaults = SEG_LOAD_DEFAULTS;
    if (!options)
        options = &defaults;
    bool mesh = part->n_faces > 0 && part->faces[0].type == SEG_SURFACE_MESH;
    if (!part->path || mesh || n_faces == 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT,
                    "%s: only faces of an IGES or STEP file can be written as IGES",
                    part->path ? part->path : "a part without a file");
        return false;
    }
    g_autoptr(GString) list = list_faces(part, faces, n_faces, error);
    if (!list || !is_unchanged(part, error))
        return false;

    g_autofree char *helper = find_helper(options);
    g_autofree char *in = g_canonicalize_filename(part->path, NULL);
    g_autofree char *out = g_canonicalize_filename(out_path, NULL);
    g_autofree char *beside = g_strdup_printf("%s.%d.part", out, (int)getpid());
    const char *argv[] = {helper, "write", in, beside, "--faces", "-", NULL};
    SegChildLimits limits = {options->timeout_s, options->memory_bytes};
    g_auto(SegChildResult) child = {0};
    bool good = seg_child_run(argv, list->str, &limits, &child, error) &&
                judge(&child, "writing faces of", part->path, options, error);
    if (good && g_rename(beside, out) != 0) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_IO, "%s: %s", out_path, g_strerror(errno));
        good = false;
    }
    if (!good)
        g_unlink(beside);
    return good;
}

/* ------------------------------------------------------------------ the program */

/* The folder of the running program, the one above (tests lie one deeper), where `make install`
 * puts it, then PATH. */
static char *find_helper(const SegLoadOptions *options)
{
    if (options->helper)
        return g_strdup(options->helper);
    g_autofree char *self = g_file_read_link("/proc/self/exe", NULL);
    g_autofree char *folder = g_path_get_dirname(self ? self : ".");
    static const char *const places[] = {"segmill-cad", "../segmill-cad",
                                         "../libexec/segmill/segmill-cad"};
    for (size_t i = 0; i < G_N_ELEMENTS(places); i++) {
        g_autofree char *candidate = g_build_filename(folder, places[i], NULL);
        if (g_file_test(candidate, G_FILE_TEST_IS_EXECUTABLE))
            return g_steal_pointer(&candidate);
    }
    char *found = g_find_program_in_path("segmill-cad");
    return found ? found : g_strdup("segmill-cad");
}

/* ------------------------------------------------------------------ its end */

/* The last line that the child wrote to stderr and that says something, without the name of the
 * file before it; "" when none. */
static char *last_words(const SegChildResult *child, const char *path)
{
    g_auto(GStrv) lines = g_strsplit(child->err, "\n", -1);
    guint n = g_strv_length(lines);
    while (n > 0 && !*g_strstrip(lines[n - 1]))
        n--;
    if (n == 0)
        return g_strdup("");
    g_autofree char *absolute = g_canonicalize_filename(path, NULL);
    const char *said = lines[n - 1];
    if (g_str_has_prefix(said, absolute) && g_str_has_prefix(said + strlen(absolute), ": "))
        said += strlen(absolute) + 2;
    char *line = g_utf8_make_valid(said, -1);
    for (char *c = line; *c; c++)
        if (g_ascii_iscntrl(*c))
            *c = ' ';
    return line;
}

static char *signal_name(int number)
{
    const char *abbreviation = sigabbrev_np(number);
    return abbreviation ? g_strdup_printf("SIG%s", abbreviation)
                        : g_strdup_printf("signal %d", number);
}

/* Nothing when the child did its work; else what is known of why not. */
static char *story(const SegChildResult *child, const char *doing, const char *path,
                   const SegLoadOptions *options)
{
    g_autofree char *said = last_words(child, path);
    if (child->end == SEG_CHILD_TIMED_OUT ||
        (WIFSIGNALED(child->status) && WTERMSIG(child->status) == SIGXCPU))
        return g_strdup_printf("%s: Open CASCADE did not end %s it within %u s and was stopped; "
                               "the file may be damaged, or give it more time",
                               path, doing, options->timeout_s);
    if (child->end == SEG_CHILD_TOO_LONG)
        return g_strdup_printf("%s: its part form exceeds the memory limit of %" G_GUINT64_FORMAT
                               " MiB; ask for a coarser chord, or raise the limit",
                               path, options->memory_bytes >> 20);
    if (WIFSIGNALED(child->status)) {
        g_autofree char *name = signal_name(WTERMSIG(child->status));
        return g_strdup_printf(
            "%s: Open CASCADE crashed (%s) while %s it; the file may be damaged: "
            "export it again%s%s",
            path, name, doing, *said ? "; it said: " : "", said);
    }
    if (WEXITSTATUS(child->status) == 0)
        return NULL;
    if (WEXITSTATUS(child->status) == CHILD_INPUT && *said)
        return g_strdup_printf("%s: %s", path, said);
    return g_strdup_printf("%s: segmill-cad failed while %s it (status %d)%s%s", path, doing,
                           WEXITSTATUS(child->status), *said ? ": " : "", said);
}

static bool judge(const SegChildResult *child, const char *doing, const char *path,
                  const SegLoadOptions *options, GError **error)
{
    g_autofree char *why = story(child, doing, path, options);
    if (!why)
        return true;
    bool failed = child->end == SEG_CHILD_ENDED && WIFEXITED(child->status) &&
                  WEXITSTATUS(child->status) != CHILD_INPUT;
    g_set_error_literal(error, SEG_ERROR, failed ? SEG_ERROR_IO : SEG_ERROR_INPUT, why);
    return false;
}
