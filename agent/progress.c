/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/progress.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <unistd.h>

#define WIDTH 40
#define ERASE "\r\033[K"

static bool on_terminal(void)
{
    return isatty(STDERR_FILENO);
}

void agent_progress_step(const char *what)
{
    if (on_terminal())
        fprintf(stderr, ERASE "%s …", what);
    else
        fprintf(stderr, "segmill: %s\n", what);
}

void agent_progress_share(const char *what, double done)
{
    if (!on_terminal())
        return;
    int full = (int)(done * WIDTH);
    fprintf(stderr, ERASE "%-24s [", what);
    for (int i = 0; i < WIDTH; i++)
        fputc(i < full ? '#' : '.', stderr);
    fprintf(stderr, "] %3d %%", (int)(done * 100));
}

void agent_progress_end(void)
{
    if (on_terminal())
        fprintf(stderr, ERASE);
}

void agent_progress_note(const char *format, ...)
{
    fprintf(stderr, on_terminal() ? ERASE : "segmill: ");
    va_list args;
    va_start(args, format);
    vfprintf(stderr, format, args);
    va_end(args);
    fputc('\n', stderr);
}
