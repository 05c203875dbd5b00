/* SPDX-License-Identifier: Apache-2.0 */
/* Preloaded into LinuxCNC's rs274, which prints its canonical calls with four decimals: the same
 * calls with every digit of the doubles that the interpreter computed. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

int __fprintf_chk(FILE *file, int flag, const char *format, ...);

int __fprintf_chk(FILE *file, int flag, const char *format, ...)
{
    char exact[512];
    size_t n = 0;
    (void)flag;
    for (const char *at = format; *at && n + 6 < sizeof exact;) {
        if (strncmp(at, "%.4f", 4) == 0) {
            memcpy(exact + n, "%.17g", 5);
            n += 5;
            at += 4;
        } else {
            exact[n++] = *at++;
        }
    }
    exact[n] = '\0';
    va_list arguments;
    va_start(arguments, format);
    int printed = vfprintf(file, exact, arguments);
    va_end(arguments);
    return printed;
}
