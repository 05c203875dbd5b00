/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/token.h"

#include <glib/gstdio.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

#include "agent/progress.h"

static bool read_token(const char *path, uint64_t *token)
{
    g_autofree char *text = NULL;
    return g_file_get_contents(path, &text, NULL, NULL) &&
           g_ascii_string_to_unsigned(g_strstrip(text), 16, 1ull << 32, UINT64_MAX, token, NULL);
}

static uint64_t new_token(void)
{
    uint64_t token = 0;
    while (token >> 32 == 0)
        if (getrandom(&token, sizeof token, 0) != sizeof token)
            token = 0;
    return token;
}

uint64_t agent_token(void)
{
    g_autofree char *folder = g_build_filename(g_get_user_state_dir(), "segmill", NULL);
    g_autofree char *path = g_build_filename(folder, "token", NULL);
    uint64_t token;
    if (read_token(path, &token))
        return token;
    token = new_token();
    g_autofree char *text = g_strdup_printf("%016" G_GINT64_MODIFIER "x\n", token);
    g_autoptr(GError) error = NULL;
    g_mkdir_with_parents(folder, 0700);
    if (!g_file_set_contents_full(path, text, (gssize)strlen(text), G_FILE_SET_CONTENTS_CONSISTENT,
                                  0600, &error))
        agent_progress_note("%s; only this process will own the machine's lease", error->message);
    return token;
}
