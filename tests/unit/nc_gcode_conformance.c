/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interpreter against LinuxCNC's: canonical calls that its stand-alone interpreter printed
 * (program coordinates, four decimals) are turned into machine coordinates and compared with our
 * moves. tests/gcode holds programs and what LinuxCNC 2.9 said to them (tests/e2e/rs274.sh asks it
 * again); SEGMILL_GCODE names another folder of the kind. The outside data brings LinuxCNC's own
 * tests: what we accept must agree, what we do not must be refused for a word that is not
 * supported yet.
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
    SegVec3 work, tool;
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
    SegVec3 shift = seg_add(canon->work, canon->tool);
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

/* Of four printed decimals, with an offset added and a centre relative to it. */
static bool near(double a, double b, double unit_mm)
{
    return fabs(a - b) <= 2e-4 * unit_mm;
}

static bool near_point(SegVec3 a, SegVec3 b)
{
    return near(a.x, b.x, 25.4) && near(a.y, b.y, 25.4) && near(a.z, b.z, 25.4);
}

static bool same_move(const NcMove *ours, const NcMove *theirs)
{
    if (ours->kind != theirs->kind || !near_point(ours->to, theirs->to) ||
        !near(ours->spindle_rpm, theirs->spindle_rpm, 1.0))
        return false;
    if (ours->kind == NC_MOVE_ARC) {
        SegVec3 centre = theirs->centre;
        if (ours->plane == 17)
            centre.z = ours->centre.z;
        else if (ours->plane == 18)
            centre.y = ours->centre.y;
        else
            centre.x = ours->centre.x;
        return ours->plane == theirs->plane && ours->turn == theirs->turn &&
               near_point(ours->centre, centre) &&
               near(ours->feed_mm_min, theirs->feed_mm_min, 25.4);
    }
    return (ours->kind != NC_MOVE_FEED || near(ours->feed_mm_min, theirs->feed_mm_min, 25.4)) &&
           (ours->kind != NC_MOVE_DWELL || near(ours->dwell_s, theirs->dwell_s, 1.0)) &&
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

static void compare(const char *path, const GArray *moves, const char *expected)
{
    g_autoptr(GArray) ours = comparable(moves), theirs = canon_read(expected);
    guint i = 0, n = MIN(ours->len, theirs->len);
    while (i < n && same_move(&g_array_index(ours, NcMove, i), &g_array_index(theirs, NcMove, i)))
        i++;
    if (i < n || ours->len != theirs->len) {
        g_autofree char *a = gcode_text(ours), *b = gcode_text(theirs);
        g_test_message("%s differs at move %u of %u, %u:\nours\n%stheirs\n%s", path, i, ours->len,
                       theirs->len, a, b);
        g_test_fail();
    }
}

/* True where the program is accepted. `expected` may be NULL. */
static bool check_program(const char *path, const char *expected, GError **error)
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
        compare(path, moves, calls);
    return true;
}

static void own_programs(void)
{
    const char *folder = g_getenv("SEGMILL_GCODE") ? g_getenv("SEGMILL_GCODE") : "tests/gcode";
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    g_assert_nonnull(dir);
    int n = 0;
    for (const char *name; dir && (name = g_dir_read_name(dir));) {
        if (!g_str_has_suffix(name, ".ngc"))
            continue;
        g_autoptr(GError) error = NULL;
        g_autofree char *path = g_build_filename(folder, name, NULL);
        g_autofree char *stem = g_strndup(path, strlen(path) - 4);
        g_autofree char *expected = g_strconcat(stem, ".expected", NULL);
        g_assert_true(g_file_test(expected, G_FILE_TEST_EXISTS));
        if (!check_program(path, expected, &error)) {
            g_test_message("%s: %s", path, error->message);
            g_test_fail();
        }
        n++;
    }
    g_assert_cmpint(n, >, 0);
}

/* A refusal that growing the interpreter will lift: it names a word that is not supported. */
static bool not_yet(const GError *error)
{
    return strstr(error->message, "not supported") != NULL;
}

static void linuxcnc(void)
{
    static const char *const suffixes[] = {".ngc", NULL};
    g_autoptr(GPtrArray) files = test_data_files("gcode_conformance/linuxcnc", suffixes);
    int accepted = 0;
    for (guint i = 0; files && i < files->len; i++) {
        const char *path = files->pdata[i];
        g_autoptr(GError) error = NULL;
        g_autofree char *folder = g_path_get_dirname(path);
        g_autofree char *expected = g_build_filename(folder, "expected", NULL);
        bool bad = strstr(path, "interp__bad") != NULL;
        bool good = check_program(path, expected, &error);
        accepted += good;
        g_assert_false(bad && good);
        if (!good && !bad && !not_yet(error)) {
            g_test_message("%s: %s", path, error->message);
            g_test_fail();
        }
    }
    if (files && files->len > 0)
        g_assert_cmpint(accepted, >=, 1);
}

static void camotics(void)
{
    static const char *const suffixes[] = {"stdin", NULL};
    g_autoptr(GPtrArray) files = test_data_files("gcode_conformance/camotics", suffixes);
    for (guint i = 0; files && i < files->len; i++) {
        g_autoptr(GError) error = NULL;
        g_assert_false(check_program(files->pdata[i], NULL, &error));
        g_assert_true(error && not_yet(error));
    }
}

/* Real programs: accepted, or refused for this reason. */
static void programs(void)
{
    static const struct {
        const char *name;
        const char *refusal; /* NULL: accepted */
    } cases[] = {
        {"camotics_bear.nc", NULL},
        {"camotics_scorpion.nc", NULL},
        {"linuxcnc_cds.ngc", NULL},
        {"linuxcnc_tort.ngc", NULL},
        {"linuxcnc_3D_Chips.ngc", "line 8, column 1: parameters and expressions"},
        {"linuxcnc_G5_butterfly-xy.ngc", "line 12, column 1: G5.2 is not supported"},
        {"linuxcnc_comp-g1.ngc", "line 27, column 1: G41 is not supported"},
        {"linuxcnc_daisy.ngc", "line 3, column 1: O100 is not supported"},
        {"linuxcnc_flowsnake.ngc", "line 5, column 1: o1000 is not supported"},
        {"ugs_buffer_stress_test.gcode", "line 16, column 1: G1 needs a feed"},
        {"ugs_g17-g18-g19.gcode", "the program ends without M2 or M30"},
        {"ugs_no_spaces.gcode", "the program ends without M2 or M30"},
        {"ugs_spiral.gcode", "the program ends without M2 or M30"},
    };
    g_autofree char *folder = test_data("gcode_programs");
    for (size_t i = 0; folder && i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GError) error = NULL;
        g_autofree char *path = g_build_filename(folder, cases[i].name, NULL);
        bool good = check_program(path, NULL, &error);
        if (good != !cases[i].refusal || (error && !strstr(error->message, cases[i].refusal))) {
            g_test_message("%s: %s", cases[i].name, error ? error->message : "accepted");
            g_test_fail();
        }
    }
}

static void add(void)
{
    g_test_add_func("/nc/gcode/conformance/own", own_programs);
    g_test_add_func("/nc/gcode/conformance/linuxcnc", linuxcnc);
    g_test_add_func("/nc/gcode/conformance/camotics", camotics);
    g_test_add_func("/nc/gcode/conformance/programs", programs);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
