/* SPDX-License-Identifier: Apache-2.0 */
#ifndef NC_GCODE_PROGRAM_H
#define NC_GCODE_PROGRAM_H

#include "nc/nc.h"

/* A program of these bytes and gates (uint64_t, ascending); both are kept. */
NcProgram *nc_program_new(GBytes *bytes, const GArray *gates);

#endif
