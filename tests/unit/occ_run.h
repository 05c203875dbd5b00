/* SPDX-License-Identifier: Apache-2.0 */
/* Runs segmill-cad and the Open CASCADE judge; what they answer. */
#ifndef TESTS_UNIT_OCC_RUN_H
#define TESTS_UNIT_OCC_RUN_H

#include "segcore/segcore.h"
#include "tests/lib/test.h"

#include <gio/gio.h>
#include <string.h>

typedef struct {
    int status; /* exit status; -1 when the program did not exit by itself */
    GBytes *out;
    char *messages;
} OccRun;

static inline void occ_run_clear(OccRun *run)
{
    g_clear_pointer(&run->out, g_bytes_unref);
    g_free(run->messages);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(OccRun, occ_run_clear)

/* `argv` is NULL-terminated; its first word is a program of the build. */
static inline OccRun occ_run(const char *const *argv)
{
    g_autoptr(GError) error = NULL;
    g_autofree char *program = test_program(argv[0]);
    g_autoptr(GPtrArray) words = g_ptr_array_new();
    g_ptr_array_add(words, program);
    for (size_t i = 1; argv[i]; i++)
        g_ptr_array_add(words, (char *)argv[i]);
    g_ptr_array_add(words, NULL);
    g_autoptr(GSubprocess) child =
        g_subprocess_newv((const char *const *)words->pdata,
                          G_SUBPROCESS_FLAGS_STDOUT_PIPE | G_SUBPROCESS_FLAGS_STDERR_PIPE, &error);
    g_assert_no_error(error);
    OccRun run = {.status = -1};
    g_autoptr(GBytes) messages = NULL;
    if (child && g_subprocess_communicate(child, NULL, NULL, &run.out, &messages, NULL) &&
        g_subprocess_get_if_exited(child))
        run.status = g_subprocess_get_exit_status(child);
    gsize length = 0;
    const char *text = messages ? g_bytes_get_data(messages, &length) : "";
    run.messages = g_strndup(text, length);
    if (!run.out)
        run.out = g_bytes_new(NULL, 0);
    return run;
}

/* The part that `segmill-cad read` streams; NULL, and a failed assertion, where it does not. */
static inline SegPart *occ_read(const char *path, const char *chord)
{
    g_auto(OccRun) run =
        occ_run((const char *[]){"segmill-cad", "read", path, "--chord", chord, NULL});
    g_assert_cmpint(run.status, ==, 0);
    if (run.status != 0) {
        g_test_message("%s: %s", path, run.messages);
        return NULL;
    }
    g_autoptr(GError) error = NULL;
    SegPart *part = seg_part_from_form(run.out, &error);
    g_assert_no_error(error);
    return part;
}

/* A line of the judge: index type area box[6] gap. */
typedef struct {
    char type[16];
    double area, box[6], gap;
} OccFace;

/* What Open CASCADE says of each face: element type OccFace. */
static inline GArray *occ_judge(const char *path)
{
    g_auto(OccRun) run = occ_run((const char *[]){"judges/occ_judge", path, "--eps", "1e-7", NULL});
    g_assert_cmpint(run.status, ==, 0);
    GArray *faces = g_array_new(FALSE, TRUE, sizeof(OccFace));
    gsize length;
    const char *text = g_bytes_get_data(run.out, &length);
    g_autofree char *copy = g_strndup(text, length);
    g_auto(GStrv) lines = g_strsplit(copy, "\n", -1);
    for (size_t i = 0; lines[i] && *lines[i]; i++) {
        g_auto(GStrv) words = g_strsplit(lines[i], " ", -1);
        if (g_strv_length(words) != 10)
            continue; /* Open CASCADE's own chatter */
        OccFace face = {0};
        g_strlcpy(face.type, words[1], sizeof face.type);
        face.area = g_ascii_strtod(words[2], NULL);
        for (int k = 0; k < 6; k++)
            face.box[k] = g_ascii_strtod(words[3 + k], NULL);
        face.gap = g_ascii_strtod(words[9], NULL);
        g_array_append_val(faces, face);
    }
    return faces;
}

/* A test part of the build, for example "analytic.step". Caller frees. */
static inline char *occ_part(const char *name)
{
    g_autofree char *relative = g_build_filename("parts", name, NULL);
    return test_program(relative);
}

#endif
