/* SPDX-License-Identifier: Apache-2.0 */
/* What differs from one controller to the next. */
#ifndef NC_GCODE_DIALECT_H
#define NC_GCODE_DIALECT_H

#include <glib.h>

typedef struct {
    const char *name;
    const char *preamble;    /* a known modal state; the path tolerance goes behind it */
    const char *tool_change; /* printf, the tool's number */
    const char *tool_length; /* printf, the tool's number */
    const char *end;         /* the last block */
} NcDialect;

/* NULL, with an error that names the known ones, where there is no such dialect. NULL as `name`
 * is the reference dialect, linuxcnc. */
const NcDialect *nc_dialect(const char *name, GError **error);

#endif
