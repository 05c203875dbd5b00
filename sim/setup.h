/* SPDX-License-Identifier: Apache-2.0 */
/* What the machine publishes of itself: its tool table and its work offsets. */
#ifndef SIM_SETUP_H
#define SIM_SETUP_H

#include "fieldbus/fieldbus.h"

/* The tools with the lowest numbers, as many as the protocol carries, and all offsets;
 * `work_offset` is the one in force, 54 to 62. */
FbSetup sim_setup(const CfgMachine *machine, const CfgToolTable *tools, int work_offset);

#endif
