/* SPDX-License-Identifier: Apache-2.0 */
/* Reading by content, and what becomes of a child that misbehaves. */
#include <glib/gstdio.h>
#include <string.h>

#include "segcore/segcore.h"
#include "tests/lib/test.h"

/* A file that looks like IGES, for children that do not read it. */
static char *write_iges_start(const char *folder)
{
    char *path = g_build_filename(folder, "part.igs", NULL);
    g_autoptr(GString) text = g_string_new("a part");
    for (int i = 6; i < 72; i++)
        g_string_append_c(text, ' ');
    g_string_append(text, "S      1\n");
    g_file_set_contents(path, text->str, -1, NULL);
    return path;
}

static char *write_script(const char *folder, const char *body)
{
    char *path = g_build_filename(folder, "helper", NULL);
    g_autofree char *script = g_strconcat("#!/bin/sh\n", body, "\n", NULL);
    g_file_set_contents(path, script, -1, NULL);
    g_chmod(path, 0755);
    return path;
}

/* What seg_part_load says when segmill-cad is the script. */
static void try_child(const char *body, SegLoadOptions options, int code, const char *what)
{
    char *folder = test_folder();
    g_autofree char *path = write_iges_start(folder);
    g_autofree char *helper = write_script(folder, body);
    options.helper = helper;
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = seg_part_load(path, &options, &error);
    g_assert_null(part);
    g_assert_error(error, SEG_ERROR, code);
    if (error && (!strstr(error->message, what) || !strstr(error->message, "part.igs"))) {
        g_test_message("\"%s\" does not say \"%s\"", error->message, what);
        g_test_fail();
    }
    test_folder_remove(folder);
}

static void test_crash(void)
{
    try_child("echo 'IGES: bad entity' >&2; kill -SEGV $$", SEG_LOAD_DEFAULTS, SEG_ERROR_INPUT,
              "crashed (SIGSEGV) while reading it; the file may be damaged: export it again; it "
              "said: IGES: bad entity");
    try_child("kill -ABRT $$", SEG_LOAD_DEFAULTS, SEG_ERROR_INPUT, "SIGABRT");
}

static void test_hang(void)
{
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.timeout_s = 1;
    gint64 start = g_get_monotonic_time();
    try_child("exec sleep 60", options, SEG_ERROR_INPUT, "within 1 s");
    try_child("exec sleep 60 >&- 2>&-", options, SEG_ERROR_INPUT, "within 1 s");
    try_child("while :; do :; done", options, SEG_ERROR_INPUT, "within 1 s");
    g_assert_cmpint(g_get_monotonic_time() - start, <, 20 * G_USEC_PER_SEC);
}

static void test_flood(void)
{
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.memory_bytes = 64 << 20;
    try_child("exec cat /dev/zero", options, SEG_ERROR_INPUT, "exceeds the memory limit of 64 MiB");
    try_child("head -c 5000000 /dev/zero | tr '\\0' x >&2; echo >&2; echo 'the end' >&2; exit 3",
              SEG_LOAD_DEFAULTS, SEG_ERROR_INPUT, "the end");
}

static void test_refusals(void)
{
    try_child("echo \"$2: face 3: has no surface\" >&2; exit 3", SEG_LOAD_DEFAULTS, SEG_ERROR_INPUT,
              "part.igs: face 3: has no surface");
    try_child("echo out of wits >&2; exit 1", SEG_LOAD_DEFAULTS, SEG_ERROR_IO, "out of wits");
    try_child("exit 0", SEG_LOAD_DEFAULTS, SEG_ERROR_INPUT, "sent what is no part");
    try_child("echo SEGPART", SEG_LOAD_DEFAULTS, SEG_ERROR_INPUT, "sent what is no part");
}

/* No address space, no processor time: limits that the child cannot lift. */
static void test_limits(void)
{
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.memory_bytes = 256 << 20;
    try_child("ulimit -v unlimited 2>/dev/null; ulimit -v >&2; exit 3", options, SEG_ERROR_INPUT,
              ": 262144");
    try_child("ulimit -c >&2; exit 3", options, SEG_ERROR_INPUT, ": 0");
}

static void assert_load_fails(const char *path, int code, const char *what)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = seg_part_load(path, NULL, &error);
    g_assert_null(part);
    g_assert_error(error, SEG_ERROR, code);
    if (error && !strstr(error->message, what)) {
        g_test_message("\"%s\" does not say \"%s\"", error->message, what);
        g_test_fail();
    }
}

static void test_content(void)
{
    char *folder = test_folder();
    g_autofree char *path = g_build_filename(folder, "part.igs", NULL);
    assert_load_fails(path, SEG_ERROR_IO, "part.igs");
    assert_load_fails(folder, SEG_ERROR_IO, "");
    g_file_set_contents(path, "", 0, NULL);
    assert_load_fails(path, SEG_ERROR_INPUT, "empty");
    static const char *const others[] = {"hello",          "\177ELF",     "%PDF-1.4\n",
                                         "G21 G90\nM30\n", "ISO-10303-2", "OFFICE\n"};
    for (size_t i = 0; i < G_N_ELEMENTS(others); i++) {
        g_file_set_contents(path, others[i], -1, NULL);
        assert_load_fails(path, SEG_ERROR_INPUT, "neither IGES, STEP, STL nor OFF");
    }
    test_folder_remove(folder);
}

static void test_no_helper(void)
{
    char *folder = test_folder();
    g_autofree char *path = write_iges_start(folder);
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = "/nowhere/segmill-cad";
    g_autoptr(GError) error = NULL;
    g_autoptr(SegPart) part = seg_part_load(path, &options, &error);
    g_assert_null(part);
    g_assert_error(error, SEG_ERROR, SEG_ERROR_IO);
    test_folder_remove(folder);
}

/* ------------------------------------------------------------------ writing */

static SegPart *load(const char *path)
{
    g_autofree char *helper = test_program("segmill-cad");
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    g_autoptr(GError) error = NULL;
    SegPart *part = seg_part_load(path, &options, &error);
    g_assert_no_error(error);
    return part;
}

static void test_write_iges(void)
{
    g_autofree char *source = test_program("parts/p0_piece.igs");
    g_autofree char *helper = test_program("segmill-cad");
    char *folder = test_folder();
    g_autofree char *copy = g_build_filename(folder, "piece.igs", NULL);
    g_autofree char *out = g_build_filename(folder, "some.igs", NULL);
    g_autofree char *bytes = NULL;
    gsize length = 0;
    g_file_get_contents(source, &bytes, &length, NULL);
    g_file_set_contents(copy, bytes, (gssize)length, NULL);

    g_autoptr(SegPart) part = load(copy);
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    const int32_t faces[] = {0, 3, 7}, wrong[] = {0, 99};
    g_autoptr(GError) error = NULL;
    if (part && seg_part_write_iges(part, faces, 3, out, &options, &error)) {
        g_autoptr(SegPart) back = load(out);
        g_assert_cmpint(back ? back->n_faces : 0, ==, 3);
        for (int i = 0; back && i < 3; i++)
            test_near(seg_face_area_mm2(back, i), seg_face_area_mm2(part, faces[i]), 0, 1e-6);
    }
    g_assert_no_error(error);
    if (part) {
        g_assert_false(seg_part_write_iges(part, wrong, 2, out, &options, &error));
        g_assert_error(error, SEG_ERROR, SEG_ERROR_ARGUMENT);
        g_clear_error(&error);
        g_assert_false(seg_part_write_iges(part, faces, 3, "/nowhere/x.igs", &options, &error));
        g_assert_error(error, SEG_ERROR, SEG_ERROR_IO);
        g_clear_error(&error);
        bytes[100]++;
        g_file_set_contents(copy, bytes, (gssize)length, NULL);
        g_assert_false(seg_part_write_iges(part, faces, 3, out, &options, &error));
        g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    }
    test_folder_remove(folder);
}

static void add(void)
{
    g_test_add_func("/segcore/load/crash", test_crash);
    g_test_add_func("/segcore/load/hang", test_hang);
    g_test_add_func("/segcore/load/flood", test_flood);
    g_test_add_func("/segcore/load/refusals", test_refusals);
    g_test_add_func("/segcore/load/limits", test_limits);
    g_test_add_func("/segcore/load/content", test_content);
    g_test_add_func("/segcore/load/no-helper", test_no_helper);
    g_test_add_func("/segcore/load/write-iges", test_write_iges);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
