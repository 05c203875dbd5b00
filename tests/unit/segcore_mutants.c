/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Damaged IGES files through the real segmill-cad: each ends as a part or as SEG_ERROR_INPUT, in
 * time. SEGMILL_MUTANTS sets how many byte-mutated copies there are (default 200).
 */
#include <stdlib.h>
#include <string.h>

#include "segcore/segcore.h"
#include "tests/lib/test.h"

enum { SEED = 20260107, DEFAULT_MUTANTS = 200, TIMEOUT_S = 10 };

static const char *const originals[] = {"freeform/rounded_cube.iges", "freeform/pipe_hollow.iges",
                                        "freeform/ideas_cube_143.igs",
                                        "freeform/propeller_blade_root.iges"};

typedef struct {
    unsigned taken, refused, crashed, stopped, unsound;
} Ends;

static void try_bytes(const char *path, const char *bytes, gsize length, Ends *ends)
{
    g_file_set_contents(path, bytes, (gssize)length, NULL);
    g_autofree char *helper = test_program("segmill-cad");
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    options.chord_mm = 1;
    options.timeout_s = TIMEOUT_S;
    g_autoptr(GError) error = NULL;
    gint64 start = g_get_monotonic_time();
    g_autoptr(SegPart) part = seg_part_load(path, &options, &error);
    g_assert_cmpint(g_get_monotonic_time() - start, <, 10 * TIMEOUT_S * G_USEC_PER_SEC);
    if (part) {
        ends->taken++;
        g_autoptr(SegSegmentation) whole = seg_segment_none(part, NULL);
        SegFeatureSizeParams params = SEG_FEATURE_SIZE_DEFAULTS;
        g_autoptr(SegSegmentation) by_size = seg_segment_feature_size(part, &params, NULL);
        g_assert_nonnull(whole);
        g_assert_nonnull(by_size);
        return;
    }
    g_assert_error(error, SEG_ERROR, SEG_ERROR_INPUT);
    const char *message = error ? error->message : "";
    g_assert_nonnull(strstr(message, path)); /* names the file */
    if (strstr(message, "crashed"))
        ends->crashed++;
    else if (strstr(message, "was stopped"))
        ends->stopped++;
    else if (strstr(message, "sent what is no part"))
        ends->unsound++; /* segmill-cad believed a file that it should have refused */
    else
        ends->refused++;
}

static unsigned count(void)
{
    const char *asked = g_getenv("SEGMILL_MUTANTS");
    return asked ? (unsigned)strtoul(asked, NULL, 10) : DEFAULT_MUTANTS;
}

static void test_mutants(const void *original)
{
    g_autofree char *path = test_data(original);
    if (!path)
        return;
    g_autofree char *bytes = NULL;
    gsize length = 0;
    g_assert_true(g_file_get_contents(path, &bytes, &length, NULL));
    char *folder = test_folder();
    g_autofree char *copy = g_build_filename(folder, "part.igs", NULL);
    GRand *random = g_rand_new_with_seed(SEED);
    Ends ends = {0};
    gint64 start = g_get_monotonic_time();
    unsigned n = count() / G_N_ELEMENTS(originals);
    for (unsigned i = 0; i < n; i++) {
        g_autofree char *mutant = g_memdup2(bytes, length);
        for (int k = g_rand_int_range(random, 1, 9); k > 0; k--) {
            gint32 at = g_rand_int_range(random, 0, (gint32)length);
            mutant[at] = (char)(g_rand_boolean(random) ? g_rand_int_range(random, 32, 127)
                                                       : g_rand_int_range(random, 0, 256));
        }
        try_bytes(copy, mutant, length, &ends);
    }
    g_rand_free(random);
    g_test_message("%s, seed %d: %u mutants, %u taken, %u refused, %u crashed, %u stopped, %u "
                   "unsound; %.0f ms each",
                   (const char *)original, SEED, n, ends.taken, ends.refused, ends.crashed,
                   ends.stopped, ends.unsound,
                   (double)(g_get_monotonic_time() - start) / 1000 / MAX(n, 1));
    g_assert_cmpuint(ends.unsound, <=, 1 + n / 50);
    test_folder_remove(folder);
}

/* Cut off at every tenth of its length, and with its middle overwritten by other bytes. */
static void test_truncated(void)
{
    char *folder = test_folder();
    g_autofree char *copy = g_build_filename(folder, "part.igs", NULL);
    Ends ends = {0};
    for (size_t k = 0; k < G_N_ELEMENTS(originals); k++) {
        g_autofree char *path = test_data(originals[k]);
        g_autofree char *bytes = NULL;
        gsize length = 0;
        if (!path || !g_file_get_contents(path, &bytes, &length, NULL))
            continue;
        for (gsize i = 0; i < 10; i++)
            try_bytes(copy, bytes, length * i / 10, &ends);
        memset(bytes + length / 2, 0, 1000);
        try_bytes(copy, bytes, length, &ends);
        memset(bytes + length / 3, 0xff, 1000);
        try_bytes(copy, bytes, length, &ends);
    }
    g_test_message("truncated or overwritten: %u taken, %u refused, %u crashed, %u stopped",
                   ends.taken, ends.refused, ends.crashed, ends.stopped);
    test_folder_remove(folder);
}

static void add(void)
{
    for (size_t i = 0; i < G_N_ELEMENTS(originals); i++) {
        g_autofree char *path = g_strconcat("/segcore/mutants/", originals[i], NULL);
        g_test_add_data_func(path, originals[i], test_mutants);
    }
    g_test_add_func("/segcore/mutants/truncated", test_truncated);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
