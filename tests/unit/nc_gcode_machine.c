/* SPDX-License-Identifier: Apache-2.0 */
/* What a program asks of the machine beside G0 to G3: probing, messages, rotary axes and their
 * limits, feeds and speeds that depend on the way, offsets of tools. What LinuxCNC says to the same
 * codes is compared in tests/gcode. */
#include "nc/gcode.h"

#include <math.h>
#include <string.h>

#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

static CfgMachine new_machine(void)
{
    CfgMachine machine = gcode_machine();
    machine.rotary[0] = (CfgRotary){true, -90.0, 370.0, 3600.0, 1000.0, 0.0};
    machine.work_offset_deg[1][0] = 30.0;
    machine.work_offset_mm[6][2] = 7.0;
    return machine;
}

/* Reads block by block; the last one's error, or NULL. */
static GError *run(NcInterpreter *interpreter, const char *program, GArray *moves)
{
    g_auto(GStrv) lines = g_strsplit(program, "\n", -1);
    GError *error = NULL;
    for (char **line = lines; *line && !error; line++)
        nc_interpreter_block(interpreter, *line, strlen(*line), moves, &error);
    return error;
}

static void assert_moves(const CfgMachine *machine, const char *program, const char *wanted)
{
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autoptr(GError) error = run(interpreter, program, moves);
    g_autofree char *text = gcode_text(moves);
    g_assert_no_error(error);
    if (g_strcmp0(text, wanted) != 0)
        g_test_message("%s", program);
    g_assert_cmpstr(text, ==, wanted);
}

/* ------------------------------------------------------------------------- probing */

/* A table at z = 10, and a wall at x = 50. */
static bool touch(const NcMove *move, bool away, SegVec3 *where, void *data)
{
    int *calls = data;
    const bool down = move->to.z < move->from.z;
    const double from = down ? move->from.z : move->from.x, to = down ? move->to.z : move->to.x;
    const double at = down ? 10.0 : 50.0, part = (at - from) / (to - from);
    ++*calls;
    if (away || part < 0.0 || part > 1.0)
        return false;
    *where = seg_lerp(move->from, move->to, part);
    return true;
}

static void probing(void)
{
    const CfgMachine machine = new_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    int calls = 0;
    nc_interpreter_set_probe(interpreter, touch, &calls);
    g_autoptr(GError) error = run(interpreter,
                                  "G55 F60 G0 X1 Y2 Z60\n"
                                  "G38.2 Z20 A10\n"
                                  "G0 X#5061 Y#5062 Z#5063 A#5064\n"
                                  "X#5070\n"
                                  "G38.3 X30\n"
                                  "G0 Y#5070\n"
                                  "G38.3 X70\n"
                                  "G0 Y#5070 X#5061",
                                  moves);
    g_autofree char *text = gcode_text(moves);
    g_assert_no_error(error);
    g_assert_cmpint(calls, ==, 3);
    /* G55 is at 10, 20, -30 and A 30: the table is half way from 30 to -10. */
    g_assert_cmpstr(text, ==,
                    "rapid 11 22 30\n"
                    "probe 11 22 10 a20 f60\n"
                    "rapid 11 22 10 a20\n"
                    "rapid 11 22 10 a20\n"
                    "probe 40 22 10 a20 f60\n"
                    "rapid 40 20 10 a20\n"
                    "probe 50 20 10 a20 f60\n"
                    "rapid 50 21 10 a20\n");
}

/* G38.2 and G38.4 have to find something; what failed leaves no trace. */
static void probing_fails(void)
{
    static const struct {
        const char *block, *message;
    } cases[] = {
        {"G38.2 X20", "line 2, column 1: G38.2 came to its end and touched nothing"},
        {"G38.4 X60", "line 2, column 1: G38.4 came to its end and is still in touch"},
    };
    const CfgMachine machine = new_machine();
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
        g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
        int calls = 0;
        nc_interpreter_set_probe(interpreter, touch, &calls);
        g_autoptr(GError) none = run(interpreter, "G0 X1 F9", moves);
        g_autoptr(GError) error = run(interpreter, cases[i].block, moves);
        g_assert_no_error(none);
        g_assert_error(error, NC_ERROR, NC_ERROR_PROGRAM);
        g_assert_nonnull(error ? strstr(error->message, cases[i].message) : NULL);
        g_assert_cmpint((int)moves->len, ==, 1);
        g_autoptr(GError) after = run(interpreter, "X#5070", moves);
        g_assert_no_error(after);
        g_assert_cmpfloat(g_array_index(moves, NcMove, 1).to.x, ==, 0.0);
        g_assert_cmpint(g_array_index(moves, NcMove, 1).kind, ==, NC_MOVE_RAPID);
    }
}

/* ------------------------------------------------------------------------ messages */

static void messages(void)
{
    const CfgMachine machine = new_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autoptr(GError) error = run(interpreter,
                                  "(MSG,load the part)\n"
                                  "o1 repeat [2]\n"
                                  "#7=[#7+1.5] (DEBUG,%.1f#7 of #<gone>) M0\n"
                                  "o1 endrepeat\n"
                                  "(print,%d#7)",
                                  moves);
    static const char *const texts[] = {
        "load the part", "1.5 of ######", NULL, "3.0 of ######", NULL, "3"};
    g_assert_no_error(error);
    g_assert_cmpint((int)moves->len, ==, G_N_ELEMENTS(texts));
    for (guint i = 0; i < moves->len && i < G_N_ELEMENTS(texts); i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        g_assert_cmpint(move->kind, ==, texts[i] ? NC_MOVE_MESSAGE : NC_MOVE_STOP);
        if (texts[i])
            g_assert_cmpstr(nc_interpreter_message(interpreter, move), ==, texts[i]);
        g_assert_cmpint((int)nc_move_block_line(move), ==, i == 0 ? 1 : i == 5 ? 5 : 3);
        g_assert_true(move->begins_block == (texts[i] != NULL));
    }
}

/* -------------------------------------------------------------------- rotary axes */

static void rotary_axes(void)
{
    const CfgMachine machine = new_machine();
    assert_moves(&machine, "G0 A10\nG55 A10 X1\nG91 A5\nG90 G53 A5\nG28 A0\nM2",
                 "rapid 0 0 0 a10\nrapid 11 0 0 a40\nrapid 11 0 0 a45\nrapid 11 0 0 a5\n"
                 "rapid 11 0 0 a30\nrapid 11 0 0 a0\nend\n");
    assert_moves(&machine, "F50 G1 A90\nG20 A80\nF2 X1 A70\nA60\nG93 A0 F3\nX2 A9 F2\nM2",
                 "feed 0 0 0 a90 f50\nfeed 0 0 0 a80 f50\nfeed 25.4 0 0 a70 f50.8\n"
                 "feed 25.4 0 0 a60 f2\nfeed 25.4 0 0 a0 f180\nfeed 50.8 0 0 a9 f50.8\nend\n");
    assert_moves(&machine, "G59.1 G0 Z1\nG10 L2 P7 Z8 A-5\nG0 Z1 A1\nG10 L20 P0 A0\nA2\nM2",
                 "rapid 0 0 8\nrapid 0 0 9 a-4\nrapid 0 0 9 a-2\nend\n");
}

static void assert_limit(const char *program, const char *message)
{
    CfgMachine machine = new_machine();
    machine.orient_s = 2.0;
    g_autoptr(GError) error = NULL;
    g_autoptr(GArray) moves =
        nc_read_program(program, strlen(program), &machine, gcode_tools(), &error);
    g_assert_null(moves);
    g_assert_error(error, NC_ERROR, NC_ERROR_LIMIT);
    if (error && !strstr(error->message, message))
        g_test_message("%s", error->message);
    g_assert_nonnull(error ? strstr(error->message, message) : NULL);
}

/* The line is that of the block, inside a loop and a subroutine too. */
static void limits(void)
{
    assert_limit("G0 A371\nM2", "line 1: A would go to 371.0000 degrees");
    assert_limit("G55\nG0 A-121\nM2", "line 2: A would go to -91.0000 degrees");
    assert_limit("F9 G38.3 X1001\nM2", "line 1: X would go to 1001.0000 mm");
    assert_limit("o1 sub\nG0 X#1\no1 endsub\no2 repeat [2]\n#2=[#2+600]\no1 call [#2]\n"
                 "o2 endrepeat\nM2",
                 "line 2: X would go to 1200.0000 mm");
    assert_limit("o2 repeat [2]\n#2=[#2+30000]\nM3 S#2\no2 endrepeat\nM2",
                 "line 3: the spindle cannot turn at 60000");
    assert_limit("M3 S100\nM19 R10 Q2\nM19 Q1.5\nM2", "line 3: Q1.5: M19 takes 2 s");
}

/* ------------------------------------------------------------------- the spindle */

static const NcMove *last_of(const GArray *moves)
{
    return &g_array_index(moves, NcMove, moves->len - 1);
}

/* v = 2·π·r·n; never faster than D and the machine, nor slower than it can. */
static void surface_speed(void)
{
    const CfgMachine machine = new_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autoptr(GError) off = run(interpreter, "G96 S60\nG0 X5\nM3 G96 S0\nX6", moves);
    g_assert_no_error(off);
    for (guint i = 0; i < moves->len; i++)
        g_assert_cmpfloat(g_array_index(moves, NcMove, i).spindle_rpm, ==, 0.0);
    g_autoptr(GError) error = run(interpreter, "G96 S60 D2500\nG0 X20", moves);
    g_assert_no_error(error);
    test_near(last_of(moves)->spindle_rpm, 60e3 / (2.0 * G_PI * 20.0), 1e-9, 0);
    error = run(interpreter, "X0.1", moves);
    test_near(last_of(moves)->spindle_rpm, 2500.0, 1e-9, 0);
    g_clear_error(&error);
    error = run(interpreter, "G95 F0.2 G1 X-30", moves);
    test_near(last_of(moves)->feed_mm_min, 0.2 * 60e3 / (2.0 * G_PI * 30.0), 1e-9, 0);
    g_assert_true(last_of(moves)->feed_per_turn);
    g_clear_error(&error);
    error = run(interpreter, "G96 S300\nG0 X0", moves);
    test_near(last_of(moves)->spindle_rpm, machine.spindle_max_rpm, 1e-9, 0);
    g_clear_error(&error);
    error = run(interpreter, "G97 S700 X1", moves);
    test_near(last_of(moves)->spindle_rpm, 700.0, 1e-9, 0);
    g_clear_error(&error);
}

static void overrides(void)
{
    const CfgMachine machine = new_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    static const struct {
        const char *block;
        bool feed, spindle, adaptive;
    } cases[] = {{"M49 G0 X1", false, false, false}, {"M50 X2", true, false, false},
                 {"M51 P1 X3", true, true, false},   {"M50 P0 M3 S9 X4", false, true, false},
                 {"M52 X5", false, true, true},      {"M48 X6", true, true, true},
                 {"M53 X7", true, true, true},       {"M52 P0 M49 X8", true, true, true},
                 {"M51 P0 X9", true, false, true}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GError) error = run(interpreter, cases[i].block, moves);
        if (i == 7) { /* two of one modal group */
            g_assert_error(error, NC_ERROR, NC_ERROR_PROGRAM);
            continue;
        }
        g_assert_no_error(error);
        g_assert_true(last_of(moves)->feed_override_off != cases[i].feed);
        g_assert_true(last_of(moves)->spindle_override_off != cases[i].spindle);
        g_assert_true(last_of(moves)->adaptive_feed == cases[i].adaptive);
    }
}

static void orientation(void)
{
    const CfgMachine machine = new_machine();
    assert_moves(&machine, "M4 S100\nM19 R45 P2 Q3\nM19\nM61 Q2\nG43 G0 Z1\nM2",
                 "spindle -100\norient 45\nspindle 0\ntool number 2\nrapid 0 0 61\nend\n");
    /* The person who bores by hand has retracted the tool when the machine goes on. */
    assert_moves(&machine, "M3 S100 G0 Z9 F20\nG88 X1 Z-1 R2 P1\nG80 G0 X0\nM2",
                 "spindle 100\nrapid 0 0 9\nrapid 1 0 9\nrapid 1 0 2\nfeed 1 0 -1 f20\ndwell 1\n"
                 "spindle 0\nstop\nspindle 100\nrapid 0 0 2\nspindle 0\nend\n");
}

/* ------------------------------------------------------------------ tools, and back */

static void tools(void)
{
    const CfgMachine machine = new_machine();
    assert_moves(&machine,
                 "G10 L1 P1 Z30 R2\nT1 M6\nG43 G0 Z0\nX[#5403+#5410]\nG10 L10 P1 Z5\nG43 Z0\n"
                 "G10 L11 P1 Z0\nG43 Z0\nG43 H2 Z0\nM2",
                 "tool 1\nrapid 0 0 30\nrapid 34 0 30\nrapid 34 0 25\nrapid 34 0 25\n"
                 "rapid 34 0 60\nend\n");
}

/* A call that is refused on its way has set nothing: parameters of every kind, tools, modes. */
static void taken_back(void)
{
    const CfgMachine machine = new_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_autoptr(GError) set = run(interpreter,
                                "#3=3 #40=4 #<a>=5 #<_g>=6\n"
                                "o9 sub\n"
                                "#3=30 #40=[#40+1] #41=7 #<a>=50 #<_g>=60 G10 L1 P2 Z90 G91\n"
                                "#40=[#40+1] G0 X1\n"
                                "o8 if [#1 EQ 1]\nG0 X#<none>\no8 endif\n"
                                "o9 endsub",
                                moves);
    g_assert_no_error(set);
    static const char look[] = "G90 G0 X#3 Y#40 Z[#41*100+#<a>*10+#<_g>]\nT2 M6 G43 Z0\nG49";
    for (int round = 0; round < 3; round++) {
        g_autoptr(GError) refused = run(interpreter, "o9 call [1]", moves);
        g_assert_error(refused, NC_ERROR, NC_ERROR_PROGRAM);
        g_autoptr(GError) same = run(interpreter, look, moves);
        g_assert_no_error(same);
        g_autofree char *text = gcode_text(moves);
        g_assert_cmpstr(text, ==, "rapid 3 4 56\ntool 2\nrapid 3 4 60\n");
        g_array_set_size(moves, 0);
    }
    g_autoptr(GError) good = run(interpreter, "o9 call [0]", moves);
    g_assert_no_error(good);
    g_autoptr(GError) then = run(interpreter, look, moves);
    g_assert_no_error(then);
    g_autofree char *text = gcode_text(moves);
    g_assert_cmpstr(text, ==, "rapid 4 4 60\nrapid 3 6 810\ntool 2\nrapid 3 6 90\n");
}

static void add(void)
{
    g_test_add_func("/nc/gcode/machine/probing", probing);
    g_test_add_func("/nc/gcode/machine/probing-fails", probing_fails);
    g_test_add_func("/nc/gcode/machine/messages", messages);
    g_test_add_func("/nc/gcode/machine/rotary-axes", rotary_axes);
    g_test_add_func("/nc/gcode/machine/limits", limits);
    g_test_add_func("/nc/gcode/machine/surface-speed", surface_speed);
    g_test_add_func("/nc/gcode/machine/overrides", overrides);
    g_test_add_func("/nc/gcode/machine/orientation", orientation);
    g_test_add_func("/nc/gcode/machine/tools", tools);
    g_test_add_func("/nc/gcode/machine/taken-back", taken_back);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
