/* SPDX-License-Identifier: Apache-2.0 */
/* Cutter radius compensation against geometry: every point of the tool's path is as far from the
 * programmed contour as the radius; and what blocks it refuses, and when it says what. That the
 * path is LinuxCNC's: tests/gcode/compensation*.ngc. */
#include "nc/gcode/compensation.h"
#include "nc/motion/path.h"
#include "tests/lib/gcode.h"
#include "tests/lib/test.h"

#include <math.h>
#include <string.h>

#define NEAR 1e-9

/* ------------------------------------------------------------------------ by hand */

static void compensated_is(const char *program, const char *expected)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(GArray) moves = gcode_read(program, &machine);
    g_assert_nonnull(moves);
    g_autofree char *text = moves ? gcode_text(moves) : NULL;
    g_assert_cmpstr(text, ==, expected);
}

static void square(void)
{
    compensated_is("F100 G0 X0 Y-10\nG41.1 D2\nG1 X0 Y0\nY10\nX10\nY0\nX-5\nG40\nX-10\nM2\n",
                   "rapid 0 -10 0\n"
                   "feed -1 0 0 f100\n"
                   "feed -1 10 0 f100\n"
                   "arc 0 11 0 centre 0 10 0 g17 turn -1 f100\n"
                   "feed 10 11 0 f100\n"
                   "arc 11 10 0 centre 10 10 0 g17 turn -1 f100\n"
                   "feed 11 0 0 f100\n"
                   "arc 10 -1 0 centre 10 0 0 g17 turn -1 f100\n"
                   "feed -5 -1 0 f100\n"
                   "feed -10 0 0 f100\n"
                   "end\n");
    compensated_is("F100 G0 X0 Y-10\nG42.1 D2\nG1 X0 Y0\nY10\nX10\nY0\nX5\nG40\nX5 Y5\nM2\n",
                   "rapid 0 -10 0\n"
                   "feed 1 0 0 f100\n"
                   "feed 1 9 0 f100\n"
                   "feed 9 9 0 f100\n"
                   "feed 9 1 0 f100\n"
                   "feed 5 1 0 f100\n"
                   "feed 5 5 0 f100\n"
                   "end\n");
}

/* In G18 the first axis is Z, the second X: left of +Z is +X. */
static void xz_plane(void)
{
    compensated_is("F100 G18 G0 X0 Z-10\nG41.1 D2\nG1 X0 Z0\nZ10\nX-5\nY3\nG40\nX-9\nM2\n",
                   "rapid 0 0 -10\n"
                   "feed 1 0 0 f100\n"
                   "feed 1 0 10 f100\n"
                   "arc 0 0 11 centre 0 0 10 g18 turn -1 f100\n"
                   "feed -5 0 11 f100\n"
                   "feed -5 3 11 f100\n"
                   "feed -9 3 10 f100\n"
                   "end\n");
}

static void circle(void)
{
    compensated_is("F100 G0 X0 Y0\nG41.1 D4\nG3 X20 I10\nG3 I-20 Z-1\nG3 I-20 P2\nG40\nG1 X0\nM2\n",
                   "rapid 0 0 0\n"
                   "arc 18 0 0 centre 9 0 0 g17 turn 1 f100\n"
                   "arc 18 0 -1 centre 0 0 0 g17 turn 1 f100\n"
                   "arc 18 0 -1 centre 0 0 -1 g17 turn 2 f100\n"
                   "feed 0 0 -1 f100\n"
                   "end\n");
    compensated_is("F100 G0 X20 Y-10\nG42.1 D4\nG1 Y0\nG3 I-20\nG40\nG1 X30\nM2\n",
                   "rapid 20 -10 0\n"
                   "feed 22 0 0 f100\n"
                   "arc 22 0 0 centre 0 0 0 g17 turn 1 f100\n"
                   "feed 30 0 0 f100\n"
                   "end\n");
}

/* --------------------------------------------------------------- distance kept */

/* A side of a random closed contour: a line, or an arc of a small angle. */
typedef struct {
    double from[2], to[2], centre[2];
    double sweep; /* 0: a line */
} Side;

static void make_arc(Side *side, double sweep)
{
    double dx = side->to[0] - side->from[0], dy = side->to[1] - side->from[1];
    double height = 0.5 / tan(0.5 * sweep);
    side->sweep = sweep;
    side->centre[0] = 0.5 * (side->from[0] + side->to[0]) - height * dy;
    side->centre[1] = 0.5 * (side->from[1] + side->to[1]) + height * dx;
}

/* Direction of the side at its start, or its end. */
static double heading(const Side *side, bool at_end)
{
    double chord = atan2(side->to[1] - side->from[1], side->to[0] - side->from[0]);
    return chord + (at_end ? 0.5 : -0.5) * side->sweep;
}

/* LinuxCNC takes corners of less than 0.05 rad for none: there the radius is kept to 0.13 %. */
static bool has_faint_corner(const Side *sides, int n)
{
    for (int i = 1; i < n; i++)
        if (fabs(sin(heading(&sides[i], false) - heading(&sides[i - 1], true))) < 0.051)
            return true;
    return false;
}

/* A star about the origin; it begins and ends in the middle of a line. */
static int make_contour(GRand *random, Side *sides)
{
    int n = g_rand_int_range(random, 4, 9);
    double corner[10][2] = {{0.0}};
    for (int i = 0; i < n; i++) {
        double angle = 2.0 * G_PI * i / n, radius = g_rand_double_range(random, 40.0, 80.0);
        corner[i][0] = round(radius * cos(angle) * 1000.0) / 1000.0;
        corner[i][1] = round(radius * sin(angle) * 1000.0) / 1000.0;
    }
    double middle[2] = {0.5 * (corner[0][0] + corner[n - 1][0]),
                        0.5 * (corner[0][1] + corner[n - 1][1])};
    for (int i = 0; i <= n; i++) {
        Side *side = &sides[i];
        *side = (Side){.sweep = 0.0};
        memcpy(side->from, i == 0 ? middle : corner[i - 1], sizeof middle);
        memcpy(side->to, i == n ? middle : corner[i], sizeof middle);
        if (i > 0 && i < n && g_rand_boolean(random))
            make_arc(side,
                     g_rand_double_range(random, 0.1, 0.6) * (g_rand_boolean(random) ? 1 : -1));
    }
    return n + 1;
}

static double distance_to(const Side *side, double x, double y)
{
    double dx = side->to[0] - side->from[0], dy = side->to[1] - side->from[1];
    double px = x - side->from[0], py = y - side->from[1];
    double ends = fmin(hypot(px, py), hypot(x - side->to[0], y - side->to[1]));
    if (side->sweep == 0.0) {
        double along = (px * dx + py * dy) / (dx * dx + dy * dy);
        return along <= 0.0 || along >= 1.0 ? ends : fabs(px * dy - py * dx) / hypot(dx, dy);
    }
    double radius = hypot(side->from[0] - side->centre[0], side->from[1] - side->centre[1]);
    double begin = atan2(side->from[1] - side->centre[1], side->from[0] - side->centre[0]);
    double angle = atan2(y - side->centre[1], x - side->centre[0]);
    double part = side->sweep > 0.0 ? angle - begin : begin - angle;
    part -= 2.0 * G_PI * floor(part / (2.0 * G_PI));
    return part > fabs(side->sweep)
               ? ends
               : fabs(hypot(x - side->centre[0], y - side->centre[1]) - radius);
}

/* From the contour's first line, by whose length the tool is led in, to G40. */
static char *contour_program(const Side *sides, int n, int code, double radius)
{
    GString *text = g_string_new("F100\n");
    const Side *first = &sides[0];
    g_string_append_printf(text, "G0 X%.12f Y%.12f\nG%d.1 D%.9f\n",
                           2.0 * first->from[0] - first->to[0], 2.0 * first->from[1] - first->to[1],
                           code, 2.0 * radius);
    g_string_append_printf(text, "G1 X%.12f Y%.12f\n", first->from[0], first->from[1]);
    for (int i = 0; i < n; i++) {
        const Side *side = &sides[i];
        g_string_append_printf(text, "G%d X%.12f Y%.12f",
                               side->sweep > 0.0   ? 3
                               : side->sweep < 0.0 ? 2
                                                   : 1,
                               side->to[0], side->to[1]);
        if (side->sweep != 0.0) {
            g_string_append_printf(text, " I%.12f J%.12f", side->centre[0] - side->from[0],
                                   side->centre[1] - side->from[1]);
        }
        g_string_append_c(text, '\n');
    }
    g_string_append(text, "G40\n");
    return g_string_free(text, FALSE);
}

/* The greatest deviation from the radius, on all moves but the first two, which lead in. */
static double deviation(const GArray *moves, const Side *sides, int n, double radius)
{
    double worst = 0.0;
    for (guint i = 2; i < moves->len; i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        for (int j = 0; nc_move_travels(move) && j <= 40; j++) {
            SegVec3 at = nc_move_point(move, j / 40.0);
            double distance = INFINITY;
            for (int k = 0; k < n; k++)
                distance = fmin(distance, distance_to(&sides[k], at.x, at.y));
            worst = fmax(worst, fabs(distance - radius));
        }
    }
    return worst;
}

/* For tests/ci/rs274.sh, which asks LinuxCNC. */
static void keep_program(const char *text)
{
    const char *folder = g_getenv("SEGMILL_GCODE_OUT");
    g_autofree char *path = folder ? g_build_filename(folder, "contours.ngc", NULL) : NULL;
    g_assert_true(!path || g_file_set_contents(path, text, -1, NULL));
}

static void distance_kept(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(GRand) random = g_rand_new_with_seed(41);
    g_autoptr(GString) all = g_string_new(NULL);
    int corners = 0;
    for (int i = 0; i < 400; i++) {
        Side sides[12];
        int n;
        do
            n = make_contour(random, sides);
        while (has_faint_corner(sides, n));
        double radius = g_rand_double_range(random, 0.2, 3.0);
        g_autofree char *contour = contour_program(sides, n, i % 2 ? 41 : 42, radius);
        g_autofree char *program = g_strconcat(contour, "M2\n", NULL);
        g_string_append(all, contour);
        g_autoptr(GArray) moves = gcode_read(program, &machine);
        g_assert_nonnull(moves);
        if (!moves)
            continue;
        corners += (int)moves->len - n;
        double worst = deviation(moves, sides, n, radius);
        if (!(worst < NEAR))
            g_test_message("%.3g off in\n%s", worst, program);
        g_assert_cmpfloat(worst, <, NEAR);
    }
    g_assert_cmpint(corners, >, 400);
    keep_program(g_string_append(all, "M2\n")->str);
}

/* ------------------------------------------------------------------------- refusals */

/* Behind "G41.1 D2, G1 X10, X20", as line 4. */
static const struct {
    const char *block, *message;
} refused[] = {
    {"G18", "line 4, column 1: G18 cannot be used while the cutter's radius is compensated"},
    {"X30 G19", "line 4, column 5: G19 cannot be used"},
    {"G41", "line 4, column 1: G41 finds the cutter's radius compensated already"},
    {"G42.1 D3", "line 4, column 1: G42.1 finds the cutter's radius compensated already"},
    {"M6", "line 4, column 1: M6 cannot be used"},
    {"G40 M6", "line 4, column 5: M6 cannot be used"},
    {"G43", "line 4, column 1: G43 cannot be used"},
    {"G49", "line 4, column 1: G49 cannot be used"},
    {"G55", "line 4, column 1: G55 cannot be used"},
    {"G61", "line 4, column 1: G61 cannot be used"},
    {"G64 P1", "line 4, column 1: G64 cannot be used"},
    {"G98", "line 4, column 1: G98 cannot be used"},
    {"G28", "line 4, column 1: G28 cannot be used"},
    {"G30.1", "line 4, column 1: G30.1 cannot be used"},
    {"G52 X1", "line 4, column 1: G52 cannot be used"},
    {"G92 X1", "line 4, column 1: G92 cannot be used"},
    {"G10 L2 P1 X1", "line 4, column 1: G10 cannot be used"},
    {"G10 L20 P0 X1", "line 4, column 1: G10 cannot be used"},
    {"G53 G0 X1", "line 4, column 1: G53 cannot be used"},
    {"G81 X1 Z-1 R0", "line 4, column 1: G81 cannot be used"},
    {"#1=#5420", "line 4, column 4: #5420 is not known while the cutter's radius is compensated"},
    {"D3", "line 4, column 1: D3 needs G41"},
    {"G3 X20.5 I0.25", "line 4, column 1: G3 is an arc too small for the tool"},
    {"G3 Y1 J0.5", "line 4, column 1: G3 is an arc too small for the tool"},
};

static void expect(NcInterpreter *interpreter, const char *block, GArray *moves,
                   const char *message)
{
    g_autoptr(GError) error = NULL;
    guint n_before = moves->len;
    bool good = nc_interpreter_block(interpreter, block, strlen(block), moves, &error);
    if (good != !message || (message && !g_str_has_prefix(error->message, message))) {
        g_test_message("%s: %s", block, good ? "taken" : error->message);
        g_test_fail();
    }
    if (message)
        g_assert_cmpuint(moves->len, ==, n_before);
}

/* And each leaves what waits as it was. */
static void refusals(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    expect(interpreter, "G41.1 D2 F100", moves, NULL);
    expect(interpreter, "G1 X10", moves, NULL);
    expect(interpreter, "X20", moves, NULL);
    for (size_t i = 0; i < G_N_ELEMENTS(refused); i++)
        expect(interpreter, refused[i].block, moves, refused[i].message);
    expect(interpreter, "Y20", moves, NULL);
    expect(interpreter, "Z-1", moves, NULL);
    expect(interpreter, "X19 Y10", moves,
           "line 6, column 1: X19 leaves an inside corner that the tool cannot reach");
    expect(interpreter, "M2", moves, NULL);
    g_autofree char *text = gcode_text(moves);
    g_assert_cmpstr(text, ==,
                    "feed 10 1 0 f100\nfeed 19 1 0 f100\nfeed 19 20 0 f100\nfeed 19 20 -1 f100\n"
                    "end\n");
}

static void refusals_at_the_ends(void)
{
    static const struct {
        const char *blocks[6], *message;
    } cases[] = {
        {{"G19", "G41.1 D2"}, "line 2, column 1: G41.1 needs the plane G17 or G18"},
        {{"G41.1"}, "line 1, column 1: G41.1 needs a D word"},
        {{"G41 D9"}, "line 1, column 5: D9 is not in the machine's tool table"},
        {{"G41 D1.5"}, "line 1, column 5: D1.5 must be a tool's number"},
        {{"G41 D-1"}, "line 1, column 5: D-1 must be a tool's number"},
        {{"F9 G41.1 D2", "G1 X1"}, "line 2, column 1: G1 leads to the contour and must be longer"},
        {{"F9 G41.1 D2", "G3 X1 I.5"}, "line 2, column 1: G3 leads to the contour and must be"},
        {{"F9 G41.1 D20", "G3 X12 I6"}, "line 2, column 1: G3 is an arc too small for the tool"},
        {{"F9 G41.1 D2", "G1 X9", "X19", "G40", "G2 X29 I5"},
         "line 5, column 1: G2 cannot be an arc behind G40"},
        {{"F9 G41.1 D2", "G1 X9", "X19", "M0", "Y9"},
         "line 5, column 1: Y9 leaves an inside corner in which the program stopped"},
        {{"F9 G41.1 D4", "G1 X9", "X19", "G3 X22 I1.5 Y0"}, "line 4, column 1: G3 is an arc too"},
        {{"F9 G41.1 D4", "G1 X9", "Y1", "X8"}, "line 4, column 1: X8 leaves an inside corner"},
    };
    CfgMachine machine = gcode_machine();
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
        g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
        for (int j = 0; cases[i].blocks[j]; j++)
            expect(interpreter, cases[i].blocks[j], moves,
                   cases[i].blocks[j + 1] ? NULL : cases[i].message);
    }
}

static void too_much_waits(void)
{
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    expect(interpreter, "G41.1 D2 F100", moves, NULL);
    expect(interpreter, "G1 X10", moves, NULL);
    for (int i = 1; i < NC_MAX_WAITING; i++)
        expect(interpreter, i % 2 ? "Z1" : "Z0", moves, NULL);
    expect(interpreter, "Z2", moves, "line 130, column 1: Z2 is one move too many");
    expect(interpreter, "G4 P1", moves, "line 130, column 1: G4 is one move too many");
    g_assert_cmpuint(moves->len, ==, 0);
    expect(interpreter, "X20", moves, NULL);
    g_assert_cmpuint(moves->len, ==, NC_MAX_WAITING);
}

/* ---------------------------------------------------------------------------- order */

/* What comes out later is still of its own line, and goes on where the last one ended. */
static void order(void)
{
    static const char *const blocks[] = {"G41.1 D2 F100", "G1 X10", "X20 F50", "M8",
                                         "Y-20",          "G4 P1",  "Z-1",     "X0",
                                         "G40",           "M9",     "G0 Z5"};
    static const uint32_t lines[] = {2, 3, 4, 5, 5, 6, 7, 8, 8, 10, 11};
    CfgMachine machine = gcode_machine();
    g_autoptr(NcInterpreter) interpreter = nc_interpreter_new(&machine, gcode_tools());
    g_autoptr(GArray) moves = g_array_new(FALSE, FALSE, sizeof(NcMove));
    for (size_t i = 0; i < G_N_ELEMENTS(blocks); i++)
        expect(interpreter, blocks[i], moves, NULL);
    g_assert_cmpuint(moves->len, ==, G_N_ELEMENTS(lines));
    for (guint i = 0; i < MIN(moves->len, G_N_ELEMENTS(lines)); i++) {
        const NcMove *move = &g_array_index(moves, NcMove, i);
        g_assert_cmpuint(move->line, ==, lines[i]);
        g_assert_true(move->begins_block == (i == 0 || lines[i] != lines[i - 1]));
        g_assert_cmpfloat(move->feed_mm_min, ==, lines[i] < 3 ? 100.0 : 50.0);
        g_assert_true(move->coolant_flood == (lines[i] >= 4 && lines[i] < 10));
        if (i > 0)
            g_assert_cmpfloat(seg_distance(move->from, move[-1].to), ==, 0.0);
        if (!nc_move_travels(move))
            g_assert_cmpfloat(seg_distance(move->from, move->to), ==, 0.0);
    }
}

/* The way round a corner takes the rotary axes along, and the move behind it finds them there. */
static void rotary(void)
{
    NcCompensation c = {.side = 0};
    g_autoptr(GArray) out = g_array_new(FALSE, FALSE, sizeof(NcMove));
    const NcMove moves[] = {
        {.kind = NC_MOVE_FEED, .plane = 17, .to = {10.0, 0.0, 0.0}},
        {.kind = NC_MOVE_FEED, .plane = 17, .to = {10.0, -9.0, 0.0}, .to_deg = {0.0, 30.0, 0.0}},
    };
    const char *why = NULL;
    nc_compensation_begin(&c, 1, 1.0, 0.001, 17, seg_vec3(0.0, 0.0, 0.0));
    for (size_t i = 0; i < G_N_ELEMENTS(moves); i++)
        g_assert_true(nc_compensation_move(&c, &moves[i], out, &why));
    g_assert_true(nc_compensation_end(&c, out, &why));
    g_assert_cmpuint(out->len, ==, 3);
    static const double from[] = {0.0, 0.0, 30.0}, to[] = {0.0, 30.0, 30.0};
    for (guint i = 0; i < MIN(out->len, 3); i++) {
        g_assert_cmpfloat(g_array_index(out, NcMove, i).from_deg[1], ==, from[i]);
        g_assert_cmpfloat(g_array_index(out, NcMove, i).to_deg[1], ==, to[i]);
    }
}

/* None opens while what raises the tool still waits. */
static void gates(void)
{
    static const char before[] = "F100 G0 Z5\n";
    static const char within[] = "G0 X0 Y0\nG1 Z-1\nG41.1 D2\nG1 X10\nX20\nG0 Z5\nG0 X30\nG40\n";
    static const char behind[] = "G0 X0 Y0\nM2\n";
    const size_t expected[] = {strlen(before), strlen(before) + strlen(within),
                               strlen(before) + strlen(within) + strlen(behind)};
    CfgMachine machine = gcode_machine();
    g_autoptr(GError) error = NULL;
    g_autofree char *text = g_strconcat(before, within, behind, NULL);
    g_autoptr(GBytes) bytes = g_bytes_new(text, strlen(text));
    g_autoptr(NcProgram) program = nc_program_from_bytes(bytes, &machine, gcode_tools(), &error);
    g_assert_no_error(error);
    g_assert_cmpuint(program ? program->n_gates : 0, ==, G_N_ELEMENTS(expected));
    for (size_t i = 0; program && i < MIN(program->n_gates, G_N_ELEMENTS(expected)); i++)
        g_assert_cmpuint(program->gates[i], ==, expected[i]);
}

static void add(void)
{
    g_test_add_func("/nc/compensation/square", square);
    g_test_add_func("/nc/compensation/xz_plane", xz_plane);
    g_test_add_func("/nc/compensation/circle", circle);
    g_test_add_func("/nc/compensation/distance_kept", distance_kept);
    g_test_add_func("/nc/compensation/refusals", refusals);
    g_test_add_func("/nc/compensation/refusals_at_the_ends", refusals_at_the_ends);
    g_test_add_func("/nc/compensation/too_much_waits", too_much_waits);
    g_test_add_func("/nc/compensation/order", order);
    g_test_add_func("/nc/compensation/rotary", rotary);
    g_test_add_func("/nc/compensation/gates", gates);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
