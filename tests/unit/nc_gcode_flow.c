/* SPDX-License-Identifier: Apache-2.0 */
/* O words: what is refused and how, limits, line numbers, gates, and that a refused line changes
 * nothing. What they do is compared with LinuxCNC in tests/gcode. */
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <string.h>

static void refusals(void)
{
    static const struct {
        const char *program, *message;
    } cases[] = {
        {"o1", "line 1, column 1: o1 needs sub, call, while"},
        {"O0001 (a program's number)", "line 1, column 1: O0001 needs sub, call"},
        {"o sub", "line 1, column 3: the character \"s\" does not belong here"},
        {"o<a sub", "line 1, column 8: the block ends too early"},
        {"o[1+1] sub", "line 1, column 1: o[1+1] may be an expression only before call"},
        {"o1 call", "line 1: o1 is not a subroutine known here"},
        {"o<a> call", "line 1: o<A> is not a subroutine known here"},
        {"o[1/0] call", "line 1, column 4: / would divide by zero"},
        {"o1 endsub", "line 1, column 1: o1 endsub closes nothing"},
        {"o1 endwhile", "line 1, column 1: o1 endwhile closes nothing"},
        {"o1 if [1]\no2 endif", "line 2, column 1: o2 endif belongs to no if"},
        {"o1 if [1]\no1 else\no1 else", "line 3, column 1: o1 else comes after the else"},
        {"o1 while [1]\no2 if [1]\no1 endwhile", "line 3, column 1: o1 endwhile closes nothing"},
        {"o1 break", "line 1, column 1: o1 break leaves no loop"},
        {"o1 if [1]\no1 continue", "line 2, column 1: o1 continue leaves no loop"},
        {"o1 do\no1 continue", "line 2, column 1: o1 continue is not supported in a do loop"},
        {"o1 return", "line 1, column 1: o1 return leaves no subroutine"},
        {"o1 sub\no2 sub", "line 2, column 1: o2 sub cannot begin inside"},
        {"o1 sub\nM2", "line 1, column 1: o1 sub is not closed before the program's end"},
        {"%\no1 sub\n%", "line 3: % ends the program, and an O word is not closed"},
        {"o1 while 1\no1 endwhile", "line 1, column 10: the character \"1\" does not belong"},
        {"o1 while [1] 2\no1 endwhile", "line 1, column 14: the character \"2\" does not"},
        {"o1 sub\no1 endsub\no1 call 5", "line 3, column 9: the character \"5\" does not"},
        {"o1 sub\nG0 X[1/#1]\no1 endsub\no1 call", "line 2, column 7: / would divide by zero"},
        {"o1 sub\no1 call\no1 endsub\no1 call", "line 2: subroutines are called 10 deep"},
        {"F1 G98 G17\no1 while [1]\nG81 X1 Z0 R0 L90000\no1 endwhile", "moves were made since the"},
        {"o1 while [1]\no1 endwhile", "lines were executed since the O word began"},
        {"o1 repeat [3]\nG0 X[#5420+600]\no1 endrepeat\nM2", "line 2: X would go to 1200.0000"},
        {"M2\no1 call", NULL},
    };
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(GArray) moves = nc_read_program(cases[i].program, strlen(cases[i].program),
                                                  &machine, gcode_tools(), &error);
        g_assert_true(!moves == (cases[i].message != NULL));
        if (error && cases[i].message && !strstr(error->message, cases[i].message)) {
            g_test_message("%s\n got: %s\nwant: %s", cases[i].program, error->message,
                           cases[i].message);
            g_test_fail();
        }
    }
}

/* Lines ascend; the block's own is told too. */
static void lines(void)
{
    static const struct {
        uint32_t line, block_line;
    } expected[] = {{4, 2}, {7, 6}, {7, 6}, {8, 0}, {9, 0}};
    CfgMachine machine = gcode_machine();
    g_autoptr(GArray) moves = gcode_read("o1 sub\nG0 X1\no1 endsub\no1 call\no2 repeat [2]\nG0 "
                                         "X2\no2 endrepeat\nG0 X3\nM2",
                                         &machine);
    g_assert_cmpuint(moves ? moves->len : 0, ==, G_N_ELEMENTS(expected));
    for (guint i = 0; moves && i < MIN(moves->len, G_N_ELEMENTS(expected)); i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        g_assert_cmpuint(move->line, ==, expected[i].line);
        g_assert_cmpuint(move->block_line, ==, expected[i].block_line);
    }
}

/* Line by line, as a machine gets it; what is refused leaves no trace. */
static void atomic(void)
{
    static const struct {
        const char *line;
        bool good;
    } cases[] = {
        {"o1 sub", true},       {"o2 endwhile", false}, {"#100=[#100+1]", true},
        {"G0 X#100 Y#1", true}, {"o1 endsub", true},    {"o1 call [5]", true},
        {"o1 call [6", false},  {"o3 if [1]", true},    {"o1 call [7]", true},
        {"#<b>=[1/0]", true},   {"o3 endif", false},    {"o3 else", true},
        {"o3 endif", false},    {"o3 while", true},     {"o3 endwhile", true},
        {"o3 endif", false},
    };
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        bool good =
            nc_interpreter_block(interpreter, cases[i].line, strlen(cases[i].line), moves, NULL);
        if (good != cases[i].good)
            g_test_message("%zu: %s", i, cases[i].line);
        g_assert_true(good == cases[i].good);
    }
    g_autofree char *text = gcode_text(moves);
    g_assert_cmpstr(text, ==, "rapid 1 5 0\n");
}

static void block_delete(void)
{
    static const char *const lines[] = {"/o1 if [1]", "G0 X1", "/o1 endif", "/ o1 call"};
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, NULL);
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    nc_interpreter_set_block_delete(interpreter, true);
    for (size_t i = 0; i < G_N_ELEMENTS(lines); i++)
        g_assert_true(nc_interpreter_block(interpreter, lines[i], strlen(lines[i]), moves, NULL));
    g_assert_cmpuint(moves->len, ==, 1);
}

/* Heights that are reached inside a loop count; where its tool changes nothing can be compared. */
static void gates(void)
{
    static const struct {
        const char *program;
        size_t n_gates;
    } cases[] = {
        {"G0 Z5\no1 repeat [2]\nG1 Z-1 F100\nG0 Z5\no1 endrepeat\nG1 Z-1\nG0 Z5\nM2", 3},
        {"G0 Z5\no1 repeat [2]\nG1 Z-1 F100\nG0 Z9\no1 endrepeat\nG1 Z-1\nG0 Z5\nM2", 2},
        {"G0 Z5\no1 if [1]\nT1 M6\no1 endif\nG1 Z-1 F100\nG0 Z5\nM2", 3},
        {"G0 Z5\no1 if [1]\nT1 M6\nG0 Z5\no1 endif\nG1 Z-1 F100\nG0 Z5\nM2", 1},
    };
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GBytes) bytes = g_bytes_new_static(cases[i].program, strlen(cases[i].program));
        g_autoptr(NcProgram) program = nc_program_from_bytes(bytes, &machine, gcode_tools(), NULL);
        g_assert_cmpuint(program ? program->n_gates : 0, ==, cases[i].n_gates);
    }
}

static void add(void)
{
    g_test_add_func("/nc/gcode/flow/refusals", refusals);
    g_test_add_func("/nc/gcode/flow/lines", lines);
    g_test_add_func("/nc/gcode/flow/atomic", atomic);
    g_test_add_func("/nc/gcode/flow/block-delete", block_delete);
    g_test_add_func("/nc/gcode/flow/gates", gates);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
