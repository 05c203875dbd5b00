/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interpreter against LinuxCNC's: canonical calls that its stand-alone interpreter printed
 * (program coordinates) are turned into machine coordinates and compared with our moves.
 * tests/gcode holds programs and what LinuxCNC 2.9 said to them, to four decimals;
 * tests/ci/rs274.sh asks it again for every digit, for these and those that the writer's test
 * writes (SEGMILL_GCODE names their folder) and for the outside data (SEGMILL_GCODE_CORPUS). What
 * must come of each program of the data is in tests/gcode/corpus.txt.
 */
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_NUMBERS = 12 };

/* State of LinuxCNC's canonical machine, and what is compared: paths and stops. */
typedef struct {
    double unit_mm;
    SegVec3 work, local, tool;
    int plane;
    double feed, speed;
    int direction, tool_number;
    SegVec3 at;
    GArray *moves; /* NcMove */
} Canon;

static int numbers_of(const char *text, double numbers[MAX_NUMBERS])
{
    int n = 0;
    for (const char *at = text; *at && n < MAX_NUMBERS;) {
        char *end;
        numbers[n] = g_ascii_strtod(at, &end);
        if (end > at) {
            n++;
            at = end;
        } else {
            at++;
        }
    }
    return n;
}

static NcMove *canon_move(Canon *canon, NcMoveKind kind, SegVec3 to)
{
    NcMove move = {.kind = kind,
                   .from = canon->at,
                   .to = to,
                   .plane = canon->plane,
                   .tool = canon->tool_number,
                   .feed_mm_min = canon->feed,
                   .spindle_rpm = canon->direction * canon->speed};
    canon->at = to;
    g_array_append_val(canon->moves, move);
    return &g_array_index(canon->moves, NcMove, canon->moves->len - 1);
}

/* Program coordinates to millimetres of the gauge point. */
static SegVec3 canon_point(const Canon *canon, double x, double y, double z)
{
    SegVec3 shift = seg_add(seg_add(canon->work, canon->local), canon->tool);
    return seg_along(shift, seg_vec3(x, y, z), canon->unit_mm);
}

static void canon_arc(Canon *canon, const double *n)
{
    /* first end, second end, first centre, second centre, turns, end along the normal */
    SegVec3 to, centre;
    if (canon->plane == 17) {
        to = canon_point(canon, n[0], n[1], n[5]);
        centre = canon_point(canon, n[2], n[3], n[5]);
    } else if (canon->plane == 18) {
        to = canon_point(canon, n[1], n[5], n[0]);
        centre = canon_point(canon, n[3], n[5], n[2]);
    } else {
        to = canon_point(canon, n[5], n[0], n[1]);
        centre = canon_point(canon, n[5], n[2], n[3]);
    }
    NcMove *arc = canon_move(canon, NC_MOVE_ARC, to);
    arc->centre = centre;
    arc->turn = (int)n[4];
}

static bool canon_state(Canon *canon, const char *name, const char *arguments, const double *n)
{
    if (g_str_equal(name, "USE_LENGTH_UNITS"))
        canon->unit_mm = strstr(arguments, "INCHES") ? 25.4 : 1.0;
    else if (g_str_equal(name, "SET_G5X_OFFSET"))
        canon->work = seg_scale(seg_vec3(n[1], n[2], n[3]), canon->unit_mm);
    else if (g_str_equal(name, "SET_G92_OFFSET"))
        canon->local = seg_scale(seg_vec3(n[0], n[1], n[2]), canon->unit_mm);
    else if (g_str_equal(name, "USE_TOOL_LENGTH_OFFSET"))
        canon->tool = seg_scale(seg_vec3(n[0], n[1], n[2]), canon->unit_mm);
    else if (g_str_equal(name, "SELECT_PLANE"))
        canon->plane = strstr(arguments, "XY") ? 17 : strstr(arguments, "XZ") ? 18 : 19;
    else if (g_str_equal(name, "SET_FEED_RATE"))
        canon->feed = n[0] * canon->unit_mm;
    else if (g_str_equal(name, "SET_SPINDLE_SPEED"))
        canon->speed = n[1];
    else if (g_str_equal(name, "START_SPINDLE_CLOCKWISE"))
        canon->direction = 1;
    else if (g_str_equal(name, "START_SPINDLE_COUNTERCLOCKWISE"))
        canon->direction = -1;
    else if (g_str_equal(name, "STOP_SPINDLE_TURNING"))
        canon->direction = 0;
    else
        return false;
    return true;
}

static void canon_call(Canon *canon, const char *name, const char *arguments)
{
    double n[MAX_NUMBERS] = {0.0};
    numbers_of(arguments, n);
    if (canon_state(canon, name, arguments, n))
        return;
    if (g_str_equal(name, "STRAIGHT_TRAVERSE")) {
        canon_move(canon, NC_MOVE_RAPID, canon_point(canon, n[0], n[1], n[2]));
    } else if (g_str_equal(name, "STRAIGHT_FEED")) {
        canon_move(canon, NC_MOVE_FEED, canon_point(canon, n[0], n[1], n[2]));
    } else if (g_str_equal(name, "ARC_FEED")) {
        canon_arc(canon, n);
    } else if (g_str_equal(name, "DWELL")) {
        canon_move(canon, NC_MOVE_DWELL, canon->at)->dwell_s = n[0];
    } else if (g_str_equal(name, "CHANGE_TOOL")) {
        canon->tool_number = (int)n[0];
        canon_move(canon, NC_MOVE_TOOL_CHANGE, canon->at);
    } else if (g_str_equal(name, "PROGRAM_STOP")) {
        canon_move(canon, NC_MOVE_STOP, canon->at);
    } else if (g_str_equal(name, "OPTIONAL_PROGRAM_STOP")) {
        canon_move(canon, NC_MOVE_OPTIONAL_STOP, canon->at);
    } else if (g_str_equal(name, "PROGRAM_END") || g_str_equal(name, "FINISH")) {
        canon_move(canon, NC_MOVE_END, canon->at);
    }
}

/* Lines "   7 N..... NAME(arguments)", with or without what stands before the name. */
static GArray *canon_read(const char *text)
{
    Canon canon = {.unit_mm = 1.0, .plane = 17, .moves = g_array_new(FALSE, FALSE, sizeof(NcMove))};
    g_auto(GStrv) lines = g_strsplit(text, "\n", -1);
    for (char **line = lines; *line; line++) {
        char *open = strchr(*line, '(');
        if (!open)
            continue;
        *open = '\0';
        char *blank = strrchr(*line, ' ');
        canon_call(&canon, blank ? blank + 1 : *line, open + 1);
    }
    return canon.moves;
}

/* How far numbers may be apart: every digit was printed, or four decimals of an inch or a
 * millimetre, with an offset added and a centre relative to it. */
#define EXACT 1e-6
#define PRINTED (2e-4 * 25.4)

static bool near_point(SegVec3 a, SegVec3 b, double tolerance)
{
    return fabs(a.x - b.x) <= tolerance && fabs(a.y - b.y) <= tolerance &&
           fabs(a.z - b.z) <= tolerance;
}

static bool same_arc(const NcMove *ours, const NcMove *theirs, double tolerance)
{
    SegVec3 centre = theirs->centre;
    if (ours->plane == 17)
        centre.z = ours->centre.z;
    else if (ours->plane == 18)
        centre.y = ours->centre.y;
    else
        centre.x = ours->centre.x;
    return ours->plane == theirs->plane && ours->turn == theirs->turn &&
           near_point(ours->centre, centre, tolerance);
}

static bool same_move(const NcMove *ours, const NcMove *theirs, double tolerance)
{
    bool fed = ours->kind == NC_MOVE_FEED || ours->kind == NC_MOVE_ARC;
    return ours->kind == theirs->kind && near_point(ours->to, theirs->to, tolerance) &&
           fabs(ours->spindle_rpm - theirs->spindle_rpm) <= tolerance &&
           (ours->kind != NC_MOVE_ARC || same_arc(ours, theirs, tolerance)) &&
           (!fed || fabs(ours->feed_mm_min - theirs->feed_mm_min) <= tolerance) &&
           (ours->kind != NC_MOVE_DWELL || fabs(ours->dwell_s - theirs->dwell_s) <= tolerance) &&
           (ours->kind != NC_MOVE_TOOL_CHANGE || ours->tool == theirs->tool);
}

/* Ours without what LinuxCNC's state calls say, which show in the other moves. */
static GArray *comparable(const GArray *moves)
{
    GArray *kept = g_array_new(FALSE, FALSE, sizeof(NcMove));
    for (guint i = 0; i < moves->len; i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        if (move->kind != NC_MOVE_SPINDLE && move->kind != NC_MOVE_COOLANT)
            g_array_append_val(kept, *move);
    }
    return kept;
}

static void compare(const char *path, const GArray *moves, const char *expected, double tolerance)
{
    g_autoptr(GArray) ours = comparable(moves), theirs = canon_read(expected);
    guint i = 0, n = MIN(ours->len, theirs->len);
    while (i < n &&
           same_move(&g_array_index(ours, NcMove, i), &g_array_index(theirs, NcMove, i), tolerance))
        i++;
    if (i < n || ours->len != theirs->len) {
        g_autofree char *a = gcode_text(ours), *b = gcode_text(theirs);
        g_test_message("%s differs at move %u of %u, %u:\nours\n%stheirs\n%s", path, i, ours->len,
                       theirs->len, a, b);
        g_test_fail();
    }
}

/* True where the program is accepted. `expected` may be NULL. */
static bool check_program(const char *path, const char *expected, double tolerance, GError **error)
{
    CfgMachine machine = gcode_machine();
    for (int axis = 0; axis < 3; axis++)
        machine.axis[axis].max_mm = -(machine.axis[axis].min_mm = -1e6);
    machine.spindle_min_rpm = 0.0;
    g_autofree char *program = NULL, *calls = NULL;
    gsize length;
    if (!g_file_get_contents(path, &program, &length, error))
        return false;
    g_autoptr(GArray) moves = nc_read_program(program, length, &machine, gcode_tools(), error);
    if (!moves)
        return false;
    if (expected && g_file_get_contents(expected, &calls, NULL, NULL))
        compare(path, moves, calls, tolerance);
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
 * program and without a tool table, which would not be ours. NULL where nobody said anything. */
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
    g_autofree char *answer = answer_of(entry, path, &tolerance);
    bool good = check_program(path, equal ? answer : NULL, tolerance, &error);
    bool as_said = good ? equal || (g_str_equal(entry->verdict, "differs") && *entry->reason)
                        : g_str_equal(entry->verdict, "refused") && *entry->reason &&
                              strstr(error->message, entry->reason);
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

static void add(void)
{
    g_test_add_func("/nc/gcode/conformance/own", own_programs);
    g_test_add_func("/nc/gcode/conformance/corpus", corpus);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
