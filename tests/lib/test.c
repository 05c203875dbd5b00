/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/test.h"

#include <gio/gio.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

int test_main(int argc, char **argv, void (*add)(void))
{
    g_autoptr(GPtrArray) with_tap = g_ptr_array_new();
    for (int i = 0; i < argc; i++)
        g_ptr_array_add(with_tap, argv[i]);
    g_ptr_array_add(with_tap, "--tap");
    g_ptr_array_add(with_tap, NULL);
    char **arguments = (char **)with_tap->pdata;
    int n = (int)with_tap->len - 1;
    g_test_init(&n, &arguments, NULL);
    g_test_set_nonfatal_assertions();
    add();
    return g_test_run();
}

static void absent(const char *path)
{
    if (g_strcmp0(g_getenv("SEGMILL_TEST_DATA_REQUIRED"), "1") == 0) {
        g_test_message("required test data is absent: %s", path);
        g_test_fail();
    } else {
        g_test_skip("outside test data is absent (SEGMILL_TEST_DATA)");
    }
}

static char *data_path(const char *relative)
{
    const char *root = g_getenv("SEGMILL_TEST_DATA");
    return g_build_filename(root ? root : "../shared/data", relative, NULL);
}

char *test_data(const char *relative)
{
    g_autofree char *path = data_path(relative);
    if (g_file_test(path, G_FILE_TEST_EXISTS))
        return g_steal_pointer(&path);
    absent(path);
    return NULL;
}

static bool has_suffix(const char *name, const char *const *suffixes)
{
    for (; *suffixes; suffixes++)
        if (g_str_has_suffix(name, *suffixes))
            return true;
    return false;
}

static void collect(const char *folder, const char *const *suffixes, GPtrArray *files)
{
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    for (const char *name; dir && (name = g_dir_read_name(dir));) {
        char *path = g_build_filename(folder, name, NULL);
        if (g_file_test(path, G_FILE_TEST_IS_DIR))
            collect(path, suffixes, files);
        if (has_suffix(name, suffixes))
            g_ptr_array_add(files, path);
        else
            g_free(path);
    }
}

static int compare_paths(const void *a, const void *b)
{
    return g_strcmp0(*(char *const *)a, *(char *const *)b);
}

GPtrArray *test_data_files(const char *folder, const char *const *suffixes)
{
    GPtrArray *files = g_ptr_array_new_with_free_func(g_free);
    g_autofree char *root = data_path(folder);
    collect(root, suffixes, files);
    g_ptr_array_sort(files, compare_paths);
    if (files->len == 0)
        absent(root);
    return files;
}

int test_main_as_new_user(int argc, char **argv, void (*add)(void))
{
    char *folder = test_folder();
    g_setenv("XDG_STATE_HOME", folder, TRUE);
    g_setenv("XDG_CONFIG_HOME", folder, TRUE);
    const int failed = test_main(argc, argv, add);
    test_folder_remove(folder);
    return failed;
}

#if defined(__SANITIZE_ADDRESS__)
#define SANITIZED true
#elif defined(__has_feature)
#define SANITIZED __has_feature(address_sanitizer)
#else
#define SANITIZED false
#endif

int test_trials(int wanted)
{
    return SANITIZED ? MAX(wanted / 4, 1) : wanted;
}

double test_any_double(GRand *random)
{
    double value;
    do {
        uint64_t bits = (uint64_t)g_rand_int(random) << 32 | g_rand_int(random);
        memcpy(&value, &bits, sizeof value);
    } while (!isfinite(value));
    return value;
}

char *test_program(const char *name)
{
    const char *build = g_getenv("BUILD");
    return g_build_filename(build ? build : "build", name, NULL);
}

char *test_folder(void)
{
    g_autoptr(GError) error = NULL;
    char *folder = g_dir_make_tmp("segmill-XXXXXX", &error);
    g_assert_no_error(error);
    return folder;
}

static void remove_tree(GFile *file)
{
    g_autoptr(GFileEnumerator) children = g_file_enumerate_children(
        file, G_FILE_ATTRIBUTE_STANDARD_NAME, G_FILE_QUERY_INFO_NOFOLLOW_SYMLINKS, NULL, NULL);
    for (GFile *child;
         children && g_file_enumerator_iterate(children, NULL, &child, NULL, NULL) && child;)
        remove_tree(child);
    g_file_delete(file, NULL, NULL);
}

void test_folder_remove(char *folder)
{
    g_autoptr(GFile) file = g_file_new_for_path(folder);
    remove_tree(file);
    g_free(folder);
}

void test_near_at(const char *file, int line, const char *function, const char *expression,
                  double a, double b, double absolute, double relative)
{
    if (fabs(a - b) <= absolute + relative * fabs(b))
        return;
    g_autofree char *message = g_strdup_printf("%s = %.17g, expected %.17g within %g + %g relative",
                                               expression, a, b, absolute, relative);
    g_assertion_message(NULL, file, line, function, message);
}
