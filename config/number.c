/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "config/config.h"

void cfg_number_append(GString *out, double value)
{
    static const char *const formats[] = {"%.15g", "%.16g", "%.17g"};
    char text[G_ASCII_DTOSTR_BUF_SIZE] = "null";
    value += 0.0; /* -0 becomes 0 */
    for (size_t i = 0; isfinite(value) && i < G_N_ELEMENTS(formats); i++) {
        g_ascii_formatd(text, sizeof text, formats[i], value);
        if (g_ascii_strtod(text, NULL) == value)
            break;
    }
    g_string_append(out, text);
}
