/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A main for fuzz targets without libFuzzer: runs every file of tests/fuzz/corpus/NAME, then seeded
 * mutations of them, and prints TAP. SEGMILL_FUZZ_RUNS sets how many mutations (default 2000).
 */
#include <glib.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { SEED = 20260101, MAX_EDITS = 8 };

/* Runs in a heap block of the exact size, so that a sanitizer sees the first byte read past it. */
static void run(const uint8_t *data, size_t size)
{
    uint8_t *exact = malloc(size ? size : 1);
    memcpy(exact, data, size);
    LLVMFuzzerTestOneInput(exact, size);
    free(exact);
}

static void mutate(GByteArray *bytes, GRand *random)
{
    int edits = g_rand_int_range(random, 1, MAX_EDITS + 1);
    guint8 repeated[64];
    for (int i = 0; i < edits && bytes->len > 0; i++) {
        guint at = (guint)g_rand_int_range(random, 0, (gint32)bytes->len);
        switch (g_rand_int_range(random, 0, 4)) {
        case 0:
            bytes->data[at] = (guint8)g_rand_int_range(random, 0, 256);
            break;
        case 1:
            bytes->data[at] ^= (guint8)(1 << g_rand_int_range(random, 0, 8));
            break;
        case 2:
            g_byte_array_set_size(bytes, at);
            break;
        case 3:
            memcpy(repeated, bytes->data + at, MIN(bytes->len - at, sizeof repeated));
            g_byte_array_append(bytes, repeated, MIN(bytes->len - at, sizeof repeated));
            break;
        }
    }
}

static int compare_names(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* Sorted by name: a folder's own order differs by machine, and would change the mutations. */
static GPtrArray *read_corpus(const char *folder)
{
    g_autoptr(GPtrArray) names = g_ptr_array_new_with_free_func(g_free);
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    for (const char *name; dir && (name = g_dir_read_name(dir));)
        g_ptr_array_add(names, g_strdup(name));
    g_ptr_array_sort(names, compare_names);

    GPtrArray *corpus = g_ptr_array_new_with_free_func((GDestroyNotify)g_bytes_unref);
    for (guint i = 0; i < names->len; i++) {
        g_autofree char *path = g_build_filename(folder, names->pdata[i], NULL);
        char *bytes;
        gsize size;
        if (g_file_get_contents(path, &bytes, &size, NULL))
            g_ptr_array_add(corpus, g_bytes_new_take(bytes, size));
    }
    return corpus;
}

int main(int argc, char **argv)
{
    (void)argc;
    g_autofree char *name = g_path_get_basename(argv[0]);
    g_autofree char *folder = g_build_filename("tests/fuzz/corpus", name, NULL);
    g_autoptr(GPtrArray) corpus = read_corpus(folder);
    puts("1..2");
    for (guint i = 0; i < corpus->len; i++) {
        gsize size;
        const uint8_t *data = g_bytes_get_data(corpus->pdata[i], &size);
        run(data, size);
    }
    printf("%s 1 - corpus of %u inputs in %s\n", corpus->len ? "ok" : "not ok", corpus->len,
           folder);

    const char *asked = g_getenv("SEGMILL_FUZZ_RUNS");
    unsigned long runs = asked ? strtoul(asked, NULL, 10) : 2000;
    GRand *random = g_rand_new_with_seed(SEED);
    for (unsigned long i = 0; i < runs && corpus->len; i++) {
        gsize size;
        const void *data = g_bytes_get_data(
            corpus->pdata[g_rand_int_range(random, 0, (gint32)corpus->len)], &size);
        g_autoptr(GByteArray) bytes = g_byte_array_new();
        g_byte_array_append(bytes, data, (guint)size);
        mutate(bytes, random);
        run(bytes->data, bytes->len);
    }
    g_rand_free(random);
    printf("ok 2 - %lu mutations, seed %d\n", runs, SEED);
    return corpus->len ? 0 : 1;
}
