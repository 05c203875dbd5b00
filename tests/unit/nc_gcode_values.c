/* SPDX-License-Identifier: Apache-2.0 */
/* Parameters and expressions: what is refused and how, when settings count, and that a refused
 * block sets nothing. What they are worth is compared with LinuxCNC in tests/gcode. */
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <string.h>

typedef struct {
    const char *program, *result;
} Case;

static void values(void)
{
    static const Case cases[] = {
        {"#1=2\nG0 X#1 #1=3 Y#1\nX#1\nM2", "rapid 2 2 0\nrapid 3 2 0\nend\n"},
        {"G0 X-[1+1]Y-#5221Z+[2]\nM2", "rapid -2 0 2\nend\n"},
        {"#5=7 #5=8\nG0 X#5\nM2", "rapid 8 0 0\nend\n"},
        {"#<a b>=1\nG0 X#<AB>\nM2", "rapid 1 0 0\nend\n"},
        {"G0 X [ 1 . 5 * 2 ] Y S Q R T [ 4 ]\nM2", "rapid 3 2 0\nend\n"},
        {"#5221=5 G0 X1\nG54 X1\nG56 X1\nG54 X1\nM2",
         "rapid 1 0 0\nrapid 1 0 0\nrapid 1 0 0\nrapid 6 0 0\nend\n"},
        {"#5241=5 G55 G0 X1 Y0 Z30\nX#5220\nM2", "rapid 6 20 0\nrapid 7 20 0\nend\n"},
        {"#5161=5 G28\n#5162=6\nG28 Y0\nG0 X9\nG28.1\nX[#5161+1]\nM2",
         "rapid 0 0 0\nrapid 5 0 0\nrapid 5 0 0\nrapid 5 6 0\nrapid 9 6 0\nrapid 10 6 0\nend\n"},
        {"T1 M6\nG0 Z[#5403-#5410]\nM2", "tool 1\nrapid 0 0 44.45\nend\n"},
        {"/#1=4\nG0 X#1\nM2", "rapid 4 0 0\nend\n"},
    };
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GArray) moves = gcode_read(cases[i].program, &machine);
        g_autofree char *text = moves ? gcode_text(moves) : g_strdup("refused");
        if (g_strcmp0(text, cases[i].result) != 0)
            g_test_message("%s", cases[i].program);
        g_assert_cmpstr(text, ==, cases[i].result);
    }
}

static void refusals(void)
{
    static const Case cases[] = {
        {"#1", "line 1, column 1: #1 needs \"=\" and a value"},
        {"#1=", "line 1, column 4: the block ends too early"},
        {"#1=)", "line 1, column 4: the character \")\" does not belong here"},
        {"#1=+.", "line 1, column 4: +. is not a number"},
        {"#1=99999999999", "line 1, column 4: 99999999999 is too large"},
        {"#0=1", "line 1, column 2: 0 is no parameter: they are #1 to #5601"},
        {"#5602=1", "line 1, column 2: 5602 is no parameter"},
        {"G0 X#1.5", "line 1, column 6: 1.5 is no parameter"},
        {"#5420=1", "line 1, column 1: #5420 is set by the machine"},
        {"#5220=2", "line 1, column 1: #5220 is set by the machine"},
        {"#<_x>=1", "line 1, column 1: #<_x> is set by the machine"},
        {"G0 X#<none>", "line 1, column 5: #<none> was never set"},
        {"#<open=1", "line 1, column 2: <open=1 is not closed"},
        {"#<>=1", "line 1, column 2: <> has no name"},
        {"#<a<b>=1", "line 1, column 4: the character \"<\" does not belong here"},
        {"#<_ini[a]b>=1", "line 1, column 7: the character \"[\" does not belong here"},
        {"G0 X[1+2", "line 1, column 9: the block ends too early"},
        {"G0 X[1 #2]", "line 1, column 8: the character \"#\" does not belong here"},
        {"G0 X[]", "line 1, column 6: the character \"]\" does not belong here"},
        {"G0 X[1/0]", "line 1, column 7: / would divide by zero"},
        {"G0 X[[0-8]**.5]", "line 1, column 11: ** would raise a negative number"},
        {"G0 X[10**[10**9]]", "line 1, column 8: ** has no finite result"},
        {"G0 X[1 MOD 0]", "line 1, column 8: MOD has no finite result"},
        {"G0 X[10**10]", "line 1, column 4: X[10**10] is too large a number"},
        {"G0 X SQRT[-1]", "line 1, column 6: SQRT has no value for this argument"},
        {"G0 X ASIN[1.1]", "line 1, column 6: ASIN has no value"},
        {"G0 X LN[0]", "line 1, column 6: LN has no value"},
        {"G0 X EXP[1000]", "line 1, column 6: EXP has no value"},
        {"G0 X SIN 30", "line 1, column 10: the character \"3\" does not belong here"},
        {"G0 X ATAN[1]", "line 1, column 13: the block ends too early"},
        {"G0 X Y1", "line 1, column 6: Y is no function"},
        {"G0 X EXISTS[1]", "line 1, column 13: the character \"1\" does not belong here"},
        {"G0 X EXISTS[#<a>+1]", "line 1, column 17: the character \"+\" does not belong here"},
        {"G[0.5]", "line 1, column 1: G[0.5] is not supported"},
    };
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(GArray) moves = nc_read_program(cases[i].program, strlen(cases[i].program),
                                                  &machine, gcode_tools(), &error);
        g_assert_null(moves);
        g_assert_error(error, NC_ERROR, NC_ERROR_PROGRAM);
        if (error && !strstr(error->message, cases[i].result)) {
            g_test_message("%s\n got: %s\nwant: %s", cases[i].program, error->message,
                           cases[i].result);
            g_test_fail();
        }
    }
}

static void atomic(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    g_assert_true(nc_interpreter_block(interpreter, "#1=1 #<a>=2", 11, moves, NULL));
    g_assert_false(nc_interpreter_block(interpreter, "#1=5 #<a>=6 G99.9", 17, moves, NULL));
    g_assert_false(nc_interpreter_block(interpreter, "G28.1 #1=7 G2 X1", 16, moves, NULL));
    g_assert_true(nc_interpreter_block(interpreter, "G0 X#1 Y#<a>", 12, moves, NULL));
    g_autofree char *text = gcode_text(moves);
    g_assert_cmpstr(text, ==, "rapid 1 2 0\n");
}

static void add(void)
{
    g_test_add_func("/nc/gcode/values/values", values);
    g_test_add_func("/nc/gcode/values/refusals", refusals);
    g_test_add_func("/nc/gcode/values/atomic", atomic);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
