/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/gcode/dialect.h"

#include "nc/nc.h"

static const NcDialect dialects[] = {
    {
        .name = "linuxcnc",
        .preamble = "G17 G21 G40 G49 G80 G90 G91.1 G94 G64 ",
        .tool_change = "T%d M6\n",
        .tool_length = "G43 H%d\n",
        .end = "M30\n",
    },
};

const NcDialect *nc_dialect(const char *name, GError **error)
{
    g_autoptr(GString) known = g_string_new(NULL);
    for (size_t i = 0; i < G_N_ELEMENTS(dialects); i++) {
        if (!name || g_str_equal(name, dialects[i].name))
            return &dialects[i];
        g_string_append_printf(known, "%s%s", i ? ", " : "", dialects[i].name);
    }
    g_set_error(error, NC_ERROR, NC_ERROR_PLAN,
                "machine.dialect = %s is not known: programs can be written for %s", name,
                known->str);
    return NULL;
}
