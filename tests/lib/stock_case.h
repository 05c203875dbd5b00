/* SPDX-License-Identifier: Apache-2.0 */
/* Tools with simple drawings, and programs for the stock written as tip positions. */
#ifndef TESTS_LIB_STOCK_CASE_H
#define TESTS_LIB_STOCK_CASE_H

#include "nc/nc.h"

/* Numbers 1 … 6: flat 6, ball 6, bull 10 with corner 1.5, drill 5 of 118°, chamfer 8 with tip 1 of
 * 90°, taper 6 with ball 1 of 10°. Flutes 20 (drill 25, chamfer 6), stickout 30, length 80, holder
 * 40. Number 7: a flat 6 with flutes 5 and a shank of 8. Number 8: number 1, left-hand. Number 9: a
 * flat 6 with flutes 3; number 10: its neck is 5.97. */
extern const CfgToolTable test_tools;

/* The tool's profile from its drawing: radius at height z above the tip, -1 where there is none. */
double test_drawn_radius(const CfgTool *tool, double z);

/* Moves with one tool, in machine coordinates with this work zero; the tip begins at `from`. */
typedef struct {
    GArray *moves; /* NcMove */
    NcMove next;   /* what the next one takes over: tool, spindle, line, place */
} TestProgram;

extern const SegVec3 test_zero;

void test_program_begin(TestProgram *program, int tool, SegVec3 from);
/* Another tool, whose tip begins at `from`. */
void test_program_tool(TestProgram *program, int tool, SegVec3 from);
void test_program_move(TestProgram *program, NcMoveKind kind, SegVec3 tip);
void test_program_arc(TestProgram *program, SegVec3 tip, SegVec3 centre, int plane, int turn);
/* nc_stock_cut; collisions may be NULL. */
bool test_program_cut(const TestProgram *program, NcStock *stock, GArray *collisions,
                      GError **error);
void test_program_end(TestProgram *program);

#endif
