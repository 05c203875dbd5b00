/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The canonical calls that LinuxCNC's interpreter prints, as moves in machine coordinates, and
 * their comparison with ours. Calls that only set a state show in the moves that follow.
 */
#ifndef TESTS_LIB_CANON_H
#define TESTS_LIB_CANON_H

#include "nc/nc.h"

/* Lines "   7 N..... NAME(arguments)", with or without what stands before the name. A GArray of
 * NcMove; the texts of its messages, by their number, are put into `texts`. A call that is not
 * known fails the test. */
GArray *canon_read(const char *calls, const CfgMachine *machine, GPtrArray *texts);

/* Whether both are the same but for `tolerance`; if not, the first that differs is a test's
 * message. `prints`: the program has (PRINT, …) comments, which LinuxCNC does not print as calls.
 */
bool canon_same(const char *name, const NcInterpreter *interpreter, const GArray *ours,
                const GArray *theirs, const GPtrArray *texts, double tolerance, bool prints);

#endif
