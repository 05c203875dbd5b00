/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interpreter against LinuxCNC's: canonical calls that its stand-alone interpreter printed
 * (program coordinates) are turned into machine coordinates and compared with our moves.
 * tests/gcode holds programs and what LinuxCNC 2.9 said to them, to four decimals;
 * tests/ci/rs274.sh asks it again for every digit, for these and those that the writer's test
 * writes (SEGMILL_GCODE names their folder) and for the outside data (SEGMILL_GCODE_CORPUS). What
 * must come of each program of the data is in tests/gcode/corpus.txt.
 */
#include "tests/lib/canon.h"

#include "nc/gcode/read.h"
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

/* How far numbers may be apart: every digit was printed, or four decimals of an inch or a
 * millimetre, with an offset added and a centre relative to it. */
#define EXACT 1e-6
#define PRINTED (2e-4 * 25.4)

/* A machine without limits, with every axis. */
static CfgMachine new_machine(void)
{
    CfgMachine machine = gcode_machine();
    for (int axis = 0; axis < 3; axis++) {
        machine.axis[axis].max_mm = -(machine.axis[axis].min_mm = -1e6);
        machine.rotary[axis] = (CfgRotary){true, -1e6, 1e6, 3600.0, 3600.0, 0.0};
    }
    machine.spindle_min_rpm = 0.0;
    return machine;
}

/* LinuxCNC's tool table beside a program of its own tests, "T1 P1 Z0.5 D0.0625;text" in inches, as
 * CfgTools; NULL where there is none. */
static GArray *tools_beside(const char *program)
{
    g_autofree char *folder = g_path_get_dirname(program), *text = NULL;
    g_autofree char *path = g_build_filename(folder, "test.tbl", NULL);
    if (!g_file_get_contents(path, &text, NULL, NULL))
        return NULL;
    GArray *tools = g_array_new(FALSE, FALSE, sizeof(CfgTool));
    g_auto(GStrv) lines = g_strsplit(text, "\n", -1);
    for (char **line = lines; *line; line++) {
        CfgTool tool = {.number = 0};
        (*line)[strcspn(*line, ";")] = '\0';
        g_auto(GStrv) words = g_strsplit(*line, " ", -1);
        for (char **word = words; *word; word++) {
            const double value = **word ? g_ascii_strtod(*word + 1, NULL) : 0.0;
            const char letter = g_ascii_toupper(**word);
            tool.number = letter == 'T' ? (int)value : tool.number;
            tool.length_mm = letter == 'Z' ? value * 25.4 : tool.length_mm;
            tool.diameter_mm = letter == 'D' ? value * 25.4 : tool.diameter_mm;
        }
        if (tool.number > 0)
            g_array_append_val(tools, tool);
    }
    return tools;
}

/* True where the program is accepted. `expected` may be NULL. */
static bool check_program(const char *path, const char *expected, double tolerance, GError **error)
{
    const CfgMachine machine = new_machine();
    g_autoptr(GArray) beside = tools_beside(path);
    const CfgToolTable table = {beside ? (CfgTool *)(void *)beside->data : NULL,
                                beside ? beside->len : 0};
    const CfgToolTable *tools = beside ? &table : gcode_tools();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, tools);
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autoptr(GPtrArray) texts = g_ptr_array_new_with_free_func(g_free);
    g_autofree char *program = NULL, *calls = NULL;
    gsize length;
    if (!g_file_get_contents(path, &program, &length, error) ||
        !nc_read_blocks(interpreter, program, length, moves, NULL, NULL, error))
        return false;
    if (expected && g_file_get_contents(expected, &calls, NULL, NULL)) {
        g_autoptr(GArray) theirs = canon_read(calls, &machine, texts);
        const bool prints = strstr(program, "PRINT,") || strstr(program, "print,");
        if (!canon_same(path, interpreter, moves, theirs, texts, tolerance, prints))
            g_test_fail();
    }
    return true;
}

static void own_programs(void)
{
    const char *folder = g_getenv("SEGMILL_GCODE") ? g_getenv("SEGMILL_GCODE") : "tests/gcode";
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    g_assert_nonnull(dir);
    double tolerance = g_getenv("SEGMILL_GCODE") ? EXACT : PRINTED;
    int n = 0;
    for (const char *name; dir && (name = g_dir_read_name(dir));) {
        if (!g_str_has_suffix(name, ".ngc"))
            continue;
        g_autoptr(GError) error = NULL;
        g_autofree char *path = g_build_filename(folder, name, NULL);
        g_autofree char *stem = g_strndup(path, strlen(path) - 4);
        g_autofree char *expected = g_strconcat(stem, ".expected", NULL);
        g_assert_true(g_file_test(expected, G_FILE_TEST_EXISTS));
        if (!check_program(path, expected, tolerance, &error)) {
            g_test_message("%s: %s", path, error->message);
            g_test_fail();
        }
        n++;
    }
    g_assert_cmpint(n, >, 0);
}

/* ------------------------------------------------------------------------- corpus */

/* The programs of others: what tests/gcode/corpus.txt says of each. */
typedef struct {
    char *path, *verdict, *reason;
} Entry;

static bool read_entry(const char *line, Entry *entry)
{
    g_auto(GStrv) field = g_strsplit(line, " ", 3);
    if (*line == '#' || !field[0] || !field[1])
        return false;
    *entry = (Entry){g_strdup(field[0]), g_strdup(field[1]), g_strdup(field[2] ? field[2] : "")};
    return true;
}

static void entry_clear(Entry *entry)
{
    g_free(entry->path);
    g_free(entry->verdict);
    g_free(entry->reason);
}

static int count_suffix(const char *folder, const char *suffix)
{
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    int n = 0;
    for (const char *name; dir && (name = g_dir_read_name(dir));)
        n += g_str_has_suffix(name, suffix);
    return n;
}

/* What LinuxCNC says to it: asked just now, or as its own tests expect, where that is of one
 * program and without a tool table, whose machine is another. NULL where nobody said anything. */
static char *answer_of(const Entry *entry, const char *path, double *tolerance)
{
    const char *asked = g_getenv("SEGMILL_GCODE_CORPUS");
    if (asked) {
        g_auto(GStrv) parts = g_strsplit(entry->path, "/", -1);
        g_autofree char *name = g_strjoinv("__", parts);
        *tolerance = EXACT;
        return g_strdup_printf("%s/%s", asked, name);
    }
    g_autofree char *folder = g_path_get_dirname(path);
    g_autofree char *beside = g_strconcat(path, ".expected", NULL);
    *tolerance = PRINTED;
    if (g_file_test(beside, G_FILE_TEST_EXISTS))
        return g_steal_pointer(&beside);
    bool one = count_suffix(folder, ".ngc") == 1 && count_suffix(folder, ".tbl") == 0;
    return one ? g_build_filename(folder, "expected", NULL) : NULL;
}

static void check_entry(const Entry *entry)
{
    g_autofree char *path = test_data(entry->path);
    if (!path)
        return;
    g_autoptr(GError) error = NULL;
    double tolerance;
    bool equal = g_str_equal(entry->verdict, "equal");
    bool refused = g_str_equal(entry->verdict, "refused") || g_str_equal(entry->verdict, "both");
    g_autofree char *answer = answer_of(entry, path, &tolerance);
    bool good = check_program(path, equal ? answer : NULL, tolerance, &error);
    bool as_said = good ? equal || (g_str_equal(entry->verdict, "differs") && *entry->reason)
                        : refused && *entry->reason && strstr(error->message, entry->reason);
    if (!as_said) {
        g_test_message("%s is to be %s %s, but: %s", entry->path, entry->verdict, entry->reason,
                       good ? "accepted" : error->message);
        g_test_fail();
    }
    if (equal && g_getenv("SEGMILL_GCODE_CORPUS") && !g_file_test(answer, G_FILE_TEST_EXISTS)) {
        g_test_message("%s is equal, but LinuxCNC refuses it", entry->path);
        g_test_fail();
    }
}

/* No program of the corpus is left out. */
static int count_programs(void)
{
    static const char *const folders[] = {"gcode_conformance/linuxcnc",
                                          "gcode_conformance/linuxcnc_trajectory",
                                          "gcode_conformance/camotics", "gcode_programs"};
    static const char *const suffixes[] = {".ngc", ".nc", ".gcode", "stdin", NULL};
    int n = 0;
    for (size_t i = 0; i < G_N_ELEMENTS(folders); i++) {
        g_autoptr(GPtrArray) files = test_data_files(folders[i], suffixes);
        n += files ? (int)files->len : 0;
    }
    return n;
}

static void corpus(void)
{
    g_autofree char *table = NULL;
    g_autofree char *data = test_data("gcode_programs");
    if (!data || !g_file_get_contents("tests/gcode/corpus.txt", &table, NULL, NULL)) {
        g_assert_null(data);
        return;
    }
    g_auto(GStrv) lines = g_strsplit(table, "\n", -1);
    int n = 0;
    for (char **line = lines; *line; line++) {
        Entry entry;
        if (!read_entry(*line, &entry))
            continue;
        check_entry(&entry);
        entry_clear(&entry);
        n++;
    }
    g_assert_cmpint(n, ==, count_programs());
}

/* ------------------------------------------------------------------------- speed */

/* Reading a program (SEGMILL_GCODE_LONG) takes at most a quarter of what LinuxCNC's interpreter has
 * taken (SEGMILL_GCODE_SECONDS, of the processor); tests/bench/gcode.c has the figure. */
static void speed(void)
{
    const char *path = g_getenv("SEGMILL_GCODE_LONG"), *seconds = g_getenv("SEGMILL_GCODE_SECONDS");
    const CfgMachine machine = new_machine();
    g_autofree char *program = NULL;
    gsize length;
    if (!path || !seconds || !g_file_get_contents(path, &program, &length, NULL)) {
        g_test_skip("nothing to compare with: tests/ci/rs274.sh asks LinuxCNC");
        return;
    }
    const clock_t start = clock();
    g_autoptr(GArray) moves = nc_read_program(program, length, &machine, gcode_tools(), NULL);
    const double ours_s = (double)(clock() - start) / CLOCKS_PER_SEC;
    g_assert_nonnull(moves);
    g_test_message("%.3f s, LinuxCNC %s s", ours_s, seconds);
    g_assert_cmpfloat(4.0 * ours_s, <=, g_ascii_strtod(seconds, NULL));
}

static void add(void)
{
    g_test_add_func("/nc/gcode/conformance/own", own_programs);
    g_test_add_func("/nc/gcode/conformance/corpus", corpus);
    g_test_add_func("/nc/gcode/conformance/speed", speed);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
