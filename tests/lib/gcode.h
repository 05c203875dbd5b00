/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of nc/gcode and nc/motion share: a machine, tools, and moves as text. */
#ifndef TESTS_LIB_GCODE_H
#define TESTS_LIB_GCODE_H

#include "nc/nc.h"

/* ±1000 mm, 6000 mm/min and 500 mm/s² on every axis; G54 at the machine's zero, G55 at
 * (10, 20, -30); tool change at the zero. */
CfgMachine gcode_machine(void);

/* Tools 1 to 4, 50.8 mm, 60, 70 and 80 mm long, of 6.35 mm diameter. */
const CfgToolTable *gcode_tools(void);

/* One line a move, shortest numbers: "rapid 1 2 3", "feed 1 2 3 f100", "arc 1 2 3 centre 4 5 3
 * g17 turn -1 f100", "dwell 1", "tool 2", "spindle -100", "coolant mist flood", "stop",
 * "optional stop", "end". */
char *gcode_text(const GArray *moves);

/* The moves of a program, or NULL with the message as a test's message. */
GArray *gcode_read(const char *program, const CfgMachine *machine);

#endif
