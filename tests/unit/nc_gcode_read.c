/* SPDX-License-Identifier: Apache-2.0 */
/* The interpreter: what blocks mean, what is refused and how, and that a refused block changes
 * nothing. Expected values are from the RS-274/NGC definition, by hand. */
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <string.h>

typedef struct {
    const char *program;
    const char *moves;
} Case;

static void check_cases(const Case *cases, size_t n)
{
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < n; i++) {
        g_autoptr(GArray) moves = gcode_read(cases[i].program, &machine);
        g_autofree char *text = moves ? gcode_text(moves) : g_strdup("refused");
        if (g_strcmp0(text, cases[i].moves) != 0)
            g_test_message("%s", cases[i].program);
        g_assert_cmpstr(text, ==, cases[i].moves);
    }
}

static void words(void)
{
    static const Case cases[] = {
        {"G0X1Y2Z3\nM2", "rapid 1 2 3\nend\n"},
        {"  g 0 x - 1 2 . 5 y +.5 z 7. \r\nm 2", "rapid -12.5 0.5 7\nend\n"},
        {"x1 (axis first) g0 ; and a remark (of sorts\nM02", "rapid 1 0 0\nend\n"},
        {"N10 G00 X0001.2500\nN20 M30\nanything", "rapid 1.25 0 0\nend\n"},
        {"\n%\nG0 X1\n%\nG0 X9", "rapid 1 0 0\nend\n"},
        {"G1 X0.1 F1000000\nX0.2\nM2", "feed 0.1 0 0 f1000000\nfeed 0.2 0 0 f1000000\nend\n"},
        {"/G0 X1\nM2", "rapid 1 0 0\nend\n"},
        {"G0 X1.12345678901234567890\nM2", "rapid 1.12345679 0 0\nend\n"},
        {"", "refused"},
        {"G0 X1", "refused"},
        {"%\nG0 X1", "refused"},
        {"(first)\n%\nM2", "refused"},
    };
    check_cases(cases, G_N_ELEMENTS(cases));
}

static void coordinates(void)
{
    static const Case cases[] = {
        {"G20 G0 X1 Y-2\nG21 X1\nM2", "rapid 25.4 -50.8 0\nrapid 1 -50.8 0\nend\n"},
        {"G55 G0 X1 Y1 Z1\nG53 G0 X1\nG54 Y1\nM2",
         "rapid 11 21 -29\nrapid 1 21 -29\nrapid 1 1 -29\nend\n"},
        {"G91 G0 X1\nX1 Y1\nG90 X1\nM2", "rapid 1 0 0\nrapid 2 1 0\nrapid 1 1 0\nend\n"},
        {"T1 M6 G43\nG0 Z1\nG43 H2 Z1\nG49 Z1\nG43 H0 X1\nZ1\nM2",
         "tool 1\nrapid 0 0 51.8\nrapid 0 0 61\nrapid 0 0 1\nrapid 1 0 1\nrapid 1 0 51.8\nend\n"},
        {"G43 H2 G55\nG53 G0 Z-5\nG0 Z0\nM2", "rapid 0 0 -5\nrapid 0 0 30\nend\n"},
        {"G0 X5 Y6 Z7\nG28.1\nX1 Y1 Z1\nG28 Z9\nG28\nM2",
         "rapid 5 6 7\nrapid 1 1 1\nrapid 1 1 9\nrapid 1 1 7\nrapid 1 1 7\nrapid 5 6 7\nend\n"},
        {"G0 X5 Y6 Z7\nG91 G28 X0\nM2", "rapid 5 6 7\nrapid 5 6 7\nrapid 0 6 7\nend\n"},
        {"G80 G0 X1\nG80\nM2", "rapid 1 0 0\nend\n"},
    };
    check_cases(cases, G_N_ELEMENTS(cases));
}

static void arcs(void)
{
    static const Case cases[] = {
        {"G2 X1 Y1 I1 F60\nM2", "arc 1 1 0 centre 1 0 0 g17 turn -1 f60\nend\n"},
        {"F60 G3 I-1 P3\nI2\nM2",
         "arc 0 0 0 centre -1 0 0 g17 turn 3 f60\narc 0 0 0 centre 2 0 0 g17 turn 1 f60\nend\n"},
        {"F60 G3 X2 R1\nM2", "arc 2 0 0 centre 1 0 0 g17 turn 1 f60\nend\n"},
        {"F60 G2 X1 Y1 R1\nX0 Y0 R-1\nM2",
         "arc 1 1 0 centre 1 0 0 g17 turn -1 f60\narc 0 0 0 centre 1 0 0 g17 turn -1 f60\nend\n"},
        {"F60 G3 X1 Y1 R1\nM2", "arc 1 1 0 centre 0 1 0 g17 turn 1 f60\nend\n"},
        {"F60 G3 X1 Y1 R-1 Z5\nM2", "arc 1 1 5 centre 1 0 0 g17 turn 1 f60\nend\n"},
        {"F60 G18 G2 X2 I1\nM2", "arc 2 0 0 centre 1 0 0 g18 turn -1 f60\nend\n"},
        {"F60 G19 G3 Y2 Z0 J1 X3\nM2", "arc 3 2 0 centre 0 1 0 g19 turn 1 f60\nend\n"},
        {"F60 G90.1 G55\nG0 X0 Y0 Z0\nG2 X2 Y0 I1 J0\nM2",
         "rapid 10 20 -30\narc 12 20 -30 centre 11 20 -30 g17 turn -1 f60\nend\n"},
        {"G20 F1\nF1 G2 X2 I1\nM2", "arc 50.8 0 0 centre 25.4 0 0 g17 turn -1 f25.4\nend\n"},
        {"F60 G2 X2.02 I1\nM2", "arc 2.02 0 0 centre 1 0 0 g17 turn -1 f60\nend\n"},
    };
    check_cases(cases, G_N_ELEMENTS(cases));
}

static void functions(void)
{
    static const Case cases[] = {
        {"M3 S100\nS200\nM4\nM5\nS300\nM3\nM2",
         "spindle 100\nspindle 200\nspindle -200\nspindle 0\nspindle 300\nspindle 0\nend\n"},
        {"M7\nM8\nM9\nM8\nM2", "coolant mist\ncoolant mist flood\ncoolant\ncoolant flood\n"
                               "coolant\nend\n"},
        {"G4 P1.5\nM0\nM1\nM2", "dwell 1.5\nstop\noptional stop\nend\n"},
        {"M6 M3 S20 T1 M8 M0\nM2",
         "tool 1\nspindle 20\ncoolant flood\nstop\nspindle 0\ncoolant\nend\n"},
        {"G0 X1 G4 P2 F3\nG1 X2\nM2", "dwell 2\nrapid 1 0 0\nfeed 2 0 0 f3\nend\n"},
        {"G20 F10 G1 X1\nF10 X2\nM2", "feed 25.4 0 0 f10\nfeed 50.8 0 0 f254\nend\n"},
    };
    check_cases(cases, G_N_ELEMENTS(cases));
}

static void tolerance(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(GArray) moves = gcode_read("G0 X1\nG64 P0.02 X2\nG61 X3\nG61.1 X4\nG64 X5\n"
                                         "G20 G64 P1 Q.1 X6\nG64 P0 X7\n(REGION 3 concave)\nX8\n"
                                         "(REGION 4a)\nX9\n( REGION 5)\nX10\nM2",
                                         &machine);
    g_assert_nonnull(moves);
    if (!moves)
        return;
    static const double expected[] = {INFINITY, 0.02, 0.0, 0.0, INFINITY, 25.4, INFINITY};
    for (guint i = 0; i < G_N_ELEMENTS(expected); i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        g_assert_cmpfloat(move->tolerance_mm, ==, expected[i]);
        g_assert_true(move->exact_stop == (i == 3));
        g_assert_cmpint(move->region, ==, 0);
        g_assert_cmpuint(move->line, ==, i + 1);
    }
    g_assert_cmpint(g_array_index(moves, NcMove, 7).region, ==, 3);
    g_assert_cmpint(g_array_index(moves, NcMove, 9).region, ==, 3);
}

/* Each is refused, and the message says where and why. */
static void check_refusals(const Case *cases, size_t n, NcError code)
{
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < n; i++) {
        g_autoptr(GError) error = NULL;
        g_autoptr(GArray) moves = nc_read_program(cases[i].program, strlen(cases[i].program),
                                                  &machine, gcode_tools(), &error);
        g_assert_null(moves);
        g_assert_error(error, NC_ERROR, (int)code);
        if (error && !strstr(error->message, cases[i].moves)) {
            g_test_message("%s\n got: %s\nwant: %s", cases[i].program, error->message,
                           cases[i].moves);
            g_test_fail();
        }
    }
}

static void refusals(void)
{
    static const Case cases[] = {
        {"G33 X1", "line 1, column 1: G33 is not supported"},
        {"G1.5", "line 1, column 1: G1.5 is not supported"},
        {"F1 G0 X1\nN7 G87 Z-1 R1", "line 2, column 4: G87 needs a I word"},
        {"F1 G88 X1 Z-1 R1", "line 1, column 4: G88 needs a P word"},
        {"F1 G88 X1 Z-1 R1 P1", "line 1, column 4: G88 needs the spindle turning"},
        {"F1 G81 X1 Z-1 R1 A1", "line 1, column 18: A1 cannot stand in a canned cycle"},
        {"G81 X1 Z-1 R1", "line 1, column 1: G81 needs a feed"},
        {"F1 G81 R1", "line 1, column 4: G81 needs an axis word"},
        {"F1 G81 X1 R1", "line 1, column 4: G81 needs a Z word"},
        {"F1 G81 X1 Z1", "line 1, column 4: G81 needs a R word"},
        {"F1 G81 X1 Z1 R0", "line 1, column 4: G81 has its R plane below"},
        {"F1 G82 X1 Z0 R1", "line 1, column 4: G82 needs a P word"},
        {"F1 G83 X1 Z0 R1", "line 1, column 4: G83 needs a Q word"},
        {"F1 G83 X1 Z0 R1 Q0", "line 1, column 17: Q0 must be above 0"},
        {"F1 G83 X1 Z-99 R1 Q.0001", "line 1, column 4: G83 would go into the hole 1000000 times"},
        {"F1 G83 X1 Z0 R1 Q.1 L99999", "line 1, column 4: G83 would go into the hole 999990"},
        {"F1 G84 X1 Z0 R1", "line 1, column 4: G84 needs the spindle turning clockwise"},
        {"F1 G86 X1 Z0 R1 P0", "line 1, column 4: G86 needs the spindle turning"},
        {"F1 G81 X1 Z0 R1 L0", "line 1, column 17: L0 must be at least 1"},
        {"F1 G81 X1 Z0 R1 L1.5", "line 1, column 17: L1.5 must be a whole number"},
        {"F1 G81 X1 Z0 R1\nG53 X1", "line 2, column 1: G53 needs G0 or G1"},
        {"F1 G81 X1 Z0 R1\nG1 X1 R2", "line 2, column 7: R2 needs G2, G3, G10, M19"},
        {"M70", "line 1, column 1: M70 is not supported"},
        {"M61", "line 1, column 1: M61 needs a Q word: the number of the tool"},
        {"M61 Q9", "line 1, column 5: Q9 is not in the machine's tool table"},
        {"M61 Q1.5", "line 1, column 5: Q1.5 must be a whole number"},
        {"M6 M61 Q1", "line 1, column 4: M61 cannot stand with M6"},
        {"M19 R361", "line 1, column 5: R361 must be between 0 and 360"},
        {"M19 P3", "line 1, column 5: P3 must be 0, 1 or 2"},
        {"M19 Q0", "line 1, column 5: Q0 must be above 0"},
        {"M53 P0", "line 1, column 5: P0 is not supported with M53: a person can always hold"},
        {"M48 P1", "line 1, column 5: P1 needs"},
        {"M3.5", "line 1, column 1: M3.5 is not supported"},
        {"G0 A1", "line 1, column 4: A1 needs an axis A, which the machine file does not have"},
        {"G0 X", "line 1, column 4: X needs a number"},
        {"G0 X.", "line 1, column 4: X. needs a number"},
        {"G0 X+-1", "line 1, column 4: X+ needs a number"},
        {"G0 X1.2.3", "line 1, column 8: the character \".\" does not belong here"},
        {"G0 X1e3", "line 1, column 6: e3 is not supported"},
        {"G0 X1e", "line 1, column 6: e is not supported"},
        {"G0 X99999999999", "line 1, column 4: X99999999999 is too large"},
        {"G0 X1 ?", "line 1, column 7: the character \"?\" does not belong here"},
        {"G0 X1 \x01", "line 1, column 7: the byte 0x01 does not belong here"},
        {"G0 X1 \xc3\xa4", "line 1, column 7: the byte 0xc3 does not belong here"},
        {"G0 (open", "line 1, column 4: the comment is not closed"},
        {"G0 (a (b))", "line 1, column 7: a comment cannot be inside a comment"},
        {"G0 X1 X2", "line 1, column 7: X2 is the second X word of the block"},
        {"G0 G1 X1", "line 1, column 4: G1 cannot stand with G0 in one block"},
        {"M3 M5", "line 1, column 4: M5 cannot stand with M3 in one block"},
        {"M7 M8", "line 1, column 4: M8 cannot stand with M7 in one block"},
        {"G17 G18", "line 1, column 5: G18 cannot stand with G17 in one block"},
        {"G4 P1 G53 G0 X1", "line 1, column 7: G53 cannot stand with G4 in one block"},
        {"M0 M3 M6 M8 M9", "line 1, column 13: M9 cannot stand with M8"},
        {"G0 N1", "line 1, column 4: N1 must be the first word"},
        {"G0 /X1", "line 1, column 4: the character \"/\" does not belong here"},
        {"X1", "line 1, column 1: X1 has no use: no G0, G1, G2 or G3 is in force"},
        {"G80 X1", "line 1, column 5: X1 has no use with G80"},
        {"G28 G0 X1", "line 1, column 5: G0 cannot stand with G28"},
        {"G28.1 X1", "line 1, column 7: X1 has no use with G28.1"},
        {"G10 L2", "line 1, column 1: G10 needs L2 or L20 and P"},
        {"G10 P1", "line 1, column 1: G10 needs L2 or L20 and P"},
        {"G10 L1 P1", "line 1, column 1: G10 needs Z, the tool's length, or R"},
        {"G10 L1 P1 X1 Z1", "line 1, column 11: X1 is not supported here: a tool has a length"},
        {"G10 L1 P9 Z1", "line 1, column 8: P9 is not in the machine's tool table"},
        {"G10 L1 P1 R-1", "line 1, column 11: R-1 must not be negative"},
        {"G10 L3 P1 X1", "line 1, column 5: L3 is not supported: G10 has L1, L2, L10"},
        {"G10 L2 P10", "line 1, column 8: P10 must be 1 to 9"},
        {"G10 L2 P1.5", "line 1, column 8: P1.5 must be 1 to 9"},
        {"G10 L20 P1 R0", "line 1, column 12: R0 is not supported"},
        {"G10 L2 P1 R45", "line 1, column 11: R45 is not supported"},
        {"G10 L2 P1 G0 X1", "line 1, column 11: G0 cannot stand with G10"},
        {"L2", "line 1, column 1: L2 needs G10 or a canned cycle"},
        {"G52", "line 1, column 1: G52 needs an axis word"},
        {"G92", "line 1, column 1: G92 needs an axis word"},
        {"G92.1 X1", "line 1, column 7: X1 has no use with G92.1"},
        {"G59.4", "line 1, column 1: G59.4 is not supported"},
        {"G93 G1 X1", "line 1, column 5: G1 needs an F word in each block with G93"},
        {"G93\nG1 X1 F2\nX2", "line 3, column 1: X2 needs an F word in each block"},
        {"G93 F1 G81 X1 Z0 R1", "line 1, column 8: G81 cannot be used with G93"},
        {"F9 G94 G1 X1\nG94 X2", "line 2, column 1: G94 needs a feed"},
        {"G95 F1 S9 G1 X1", "line 1, column 11: G1 needs the spindle turning"},
        {"G95 F1 S9 M3 G38.2 X1", "line 1, column 14: G38.2 cannot be used with G95"},
        {"G96 D9", "line 1, column 1: G96 needs an S word"},
        {"G97 D9", "line 1, column 5: D9 needs G41, G42, G41.1, G42.1 or G96"},
        {"G38.2 X1", "line 1, column 1: G38.2 needs a feed"},
        {"G38.2 X0 F1", "line 1, column 1: G38.2 begins where it ends"},
        {"G43.1", "line 1, column 1: G43.1 needs a Z word"},
        {"G43.1 X1 Z1", "line 1, column 7: X1 is not supported with G43.1"},
        {"G43.1 Z1 G92 X1", "line 1, column 1: G43.1 cannot stand with another code"},
        {"G43.1 Z1 G1 F1", "line 1, column 10: G1 cannot stand with G43.1"},
        {"G1 X1", "line 1, column 1: G1 needs a feed"},
        {"G1 X1 F0", "line 1, column 1: G1 needs a feed"},
        {"F-1", "line 1, column 1: F-1 must not be negative"},
        {"S-1", "line 1, column 1: S-1 must not be negative"},
        {"T1.5", "line 1, column 1: T1.5 must be a whole number"},
        {"T9", "line 1, column 1: T9 is not in the machine's tool table"},
        {"G43 H9", "line 1, column 5: H9 is not in the machine's tool table"},
        {"H1", "line 1, column 1: H1 needs G43 in the same block"},
        {"P1", "line 1, column 1: P1 needs G2, G3, G4, G10, G64, G82"},
        {"G61 R0.5", "line 1, column 5: R0.5 needs G2, G3, G10, M19 or a"},
        {"G1 X1 F1 I1", "line 1, column 10: I1 needs G2, G3 or G87"},
        {"Q1", "line 1, column 1: Q1 needs G64, G73, G83, M19 or M61"},
        {"G4", "line 1, column 1: G4 needs a P word"},
        {"G4 P-1", "line 1, column 4: P-1 must not be negative"},
        {"G4 G64 P1", "line 1, column 8: P1 could belong to two"},
        {"G53 X1", "line 1, column 5: X1 has no use"},
        {"G0\nG2 F1\nG53 X1", "line 2, column 1: G2 needs a centre"},
        {"G2 I1 F1\nG53 X1", "line 2, column 1: G53 needs G0 or G1"},
        {"G91 G53 G0 X1", "line 1, column 5: G53 cannot be used with G91"},
        {"G2 X1 F1", "line 1, column 1: G2 needs a centre (I, J, K) or a radius (R) in plane G17"},
        {"G2 X1 I1 R1 F1", "line 1, column 10: R1 cannot stand with I, J or K"},
        {"G2 X1 K1 I1 F1", "line 1, column 7: K1 has no use for an arc in plane G17"},
        {"G2 R1 F1", "line 1, column 1: G2 needs an end point in plane G17"},
        {"G2 X0 Y0 R1 F1", "line 1, column 10: R1 cannot give an arc that ends where it begins"},
        {"G2 X3 R1 F1", "line 1, column 7: R1 is too small to reach the end point"},
        {"G2 X1 I1 F1", "line 1, column 1: G2 has an arc of radius zero"},
        {"G2 X2.1 I1 F1", "line 1, column 1: G2 has an arc whose radius is 1.00000 mm"},
        {"G2 X1 I1 P1.5 F1", "line 1, column 10: P1.5 must be a whole number"},
        {"G2 X1 I1 P0 F1", "line 1, column 10: P0 must be at least one turn"},
        {"G90.1 G2 X1 I1 F1", "line 1, column 7: G2 needs both centre coordinates with G90.1"},
        {"% X1", "line 1: % must stand alone"},
        {"G0\n%", "line 2: % ends a program that did not begin with %"},
        {"", "the program is empty: it needs at least M2 or M30"},
        {"\n", "line 1: the program ends without M2 or M30"},
        {"G0 X1\n", "line 1: the program ends without M2 or M30"},
        {"%\nG0 X1\n", "line 2: the program ends without its second %"},
    };
    check_refusals(cases, G_N_ELEMENTS(cases), NC_ERROR_PROGRAM);
}

static void long_lines(void)
{
    CfgMachine machine = gcode_machine();
    g_autofree char *comment = g_strnfill(244, 'x');
    g_autofree char *longest = g_strdup_printf("G0 X1 (%s)\nM2", comment);
    g_autofree char *longer = g_strdup_printf("G0 X1 (%s) \nM2", comment);
    g_autoptr(GArray) read = gcode_read(longest, &machine);
    g_autoptr(GArray) unread = gcode_read(longer, &machine);
    g_assert_nonnull(read);
    g_assert_null(unread);
}

/* A refused block leaves position, modes, line and moves as they were. */
static void atomic(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    static const char *const good[] = {"G0 X1\n", "G1 Y2 F100\n"};
    static const char *const bad[] = {
        "T2 M6 G20 G55 G91 G18 S100 M3 M8 G28 X1 G43 H9",
        "F5 G55 G61 G2 X4 I1",
        "(REGION 9)(",
    };
    for (size_t i = 0; i < G_N_ELEMENTS(good); i++)
        g_assert_true(nc_interpreter_block(interpreter, good[i], strlen(good[i]), moves, NULL));
    for (size_t i = 0; i < G_N_ELEMENTS(bad); i++) {
        g_autoptr(GError) error = NULL;
        g_assert_false(nc_interpreter_block(interpreter, bad[i], strlen(bad[i]), moves, &error));
        g_assert_error(error, NC_ERROR, NC_ERROR_PROGRAM);
        g_assert_true(error && g_str_has_prefix(error->message, "line 3"));
        g_assert_cmpuint(moves->len, ==, 2);
    }
    g_assert_true(nc_interpreter_block(interpreter, "X3", 2, moves, NULL));
    g_autofree char *text = gcode_text(moves);
    g_assert_cmpstr(text, ==, "rapid 1 0 0\nfeed 1 2 0 f100\nfeed 3 2 0 f100\n");
    const NcMove *last = &g_array_index(moves, NcMove, moves->len - 1);
    g_assert_cmpuint(last->line, ==, 3);
    g_assert_cmpint(last->region, ==, 0);
    g_assert_cmpfloat(last->spindle_rpm, ==, 0.0);
    g_assert_cmpint(last->tool, ==, 0);
}

static void switches(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, NULL);
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    nc_interpreter_set_position(interpreter, seg_vec3(7.0, 8.0, 9.0));
    g_assert_true(nc_interpreter_block(interpreter, "/G0 X1", 6, moves, NULL));
    nc_interpreter_set_block_delete(interpreter, true);
    g_assert_true(nc_interpreter_block(interpreter, "/ X2", 4, moves, NULL));
    g_assert_true(nc_interpreter_block(interpreter, "M2", 2, moves, NULL));
    g_autofree char *text = gcode_text(moves);
    g_assert_cmpstr(text, ==, "rapid 1 8 9\nend\n");
    g_assert_true(nc_interpreter_block(interpreter, "\r\n", 2, moves, NULL));
    g_assert_false(nc_interpreter_block(interpreter, "X1", 2, moves, NULL));
}

/* Which offset a move's end is counted from, for those who compare offsets. */
static void work_offsets(void)
{
    static const struct {
        int work_offset;
        bool machine_coordinates;
    } expected[] = {{54, true}, {55, false}, {55, true},  {55, true}, {55, false},
                    {55, true}, {56, false}, {56, false}, {54, false}};
    CfgMachine machine = gcode_machine();
    g_autoptr(GArray) moves = gcode_read("G53 G0 Z1\nG55\nG0 X1\nG28\nG28 Z2\nG56 G1 X2 F1\n"
                                         "G4 P1\nM2",
                                         &machine);
    g_assert_cmpuint(moves ? moves->len : 0, ==, G_N_ELEMENTS(expected));
    for (guint i = 0; moves && i < MIN(moves->len, G_N_ELEMENTS(expected)); i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        g_assert_cmpint(move->work_offset, ==, expected[i].work_offset);
        g_assert_cmpint(move->machine_coordinates, ==, expected[i].machine_coordinates);
    }
}

static void limits(void)
{
    static const Case cases[] = {
        {"G0 X1000.1\nM2", "line 1: X would go to 1000.1000 mm"},
        {"G0 X1000 Y-1000 Z1000\nG1 F1 Z-1001", "line 2: Z would go to -1001.0000 mm"},
        {"G55 G0 X999", "line 1: X would go to 1009.0000 mm"},
        {"G43 H1 G0 Z950", "line 1: Z would go to 1000.8000 mm"},
        {"G0 X900 F1\nG3 X900 Y10 J5 I150", "line 2: X would go to 1200.0"},
        {"S5 M3", "line 1: the spindle cannot turn at 5 rev/min"},
        {"S60000 M4", "line 1: the spindle cannot turn at 60000 rev/min"},
    };
    check_refusals(cases, G_N_ELEMENTS(cases), NC_ERROR_LIMIT);
    CfgMachine machine = gcode_machine();
    g_autoptr(GArray) at = gcode_read("G0 X1000 Y-1000 Z1000\nM2", &machine);
    g_assert_nonnull(at);
}

static void add(void)
{
    g_test_add_func("/nc/gcode/read/words", words);
    g_test_add_func("/nc/gcode/read/coordinates", coordinates);
    g_test_add_func("/nc/gcode/read/arcs", arcs);
    g_test_add_func("/nc/gcode/read/functions", functions);
    g_test_add_func("/nc/gcode/read/tolerance", tolerance);
    g_test_add_func("/nc/gcode/read/refusals", refusals);
    g_test_add_func("/nc/gcode/read/long-lines", long_lines);
    g_test_add_func("/nc/gcode/read/atomic", atomic);
    g_test_add_func("/nc/gcode/read/switches", switches);
    g_test_add_func("/nc/gcode/read/work-offsets", work_offsets);
    g_test_add_func("/nc/gcode/read/limits", limits);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
