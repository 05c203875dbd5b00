/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/token.h"

#include <fcntl.h>
#include <glib.h>
#include <glib/gstdio.h>
#include <stdbool.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "agent/progress.h"

static bool read_token(const char *path, uint64_t *token);
static uint64_t make_token(const char *path);

uint64_t agent_token(void)
{
    g_autofree char *folder = g_build_filename(g_get_user_state_dir(), "segmill", NULL);
    g_autofree char *path = g_build_filename(folder, "token", NULL);
    g_mkdir_with_parents(folder, 0700);
    /* Of several first processes one makes it, and the others read it. */
    const int lock = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (lock >= 0)
        flock(lock, LOCK_EX);
    uint64_t token;
    if (!read_token(path, &token))
        token = make_token(path);
    if (lock >= 0)
        close(lock);
    return token;
}

/* What others may have read is nobody's token. */
static bool is_private(int file, const char *path)
{
    struct stat found;
    const bool good = fstat(file, &found) == 0 && S_ISREG(found.st_mode) &&
                      found.st_uid == geteuid() && (found.st_mode & 077) == 0;
    if (!good)
        agent_progress_note("%s is not this user's alone: a new token takes its place", path);
    return good;
}

static bool read_token(const char *path, uint64_t *token)
{
    char text[32] = "";
    const int file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0)
        return false;
    const bool read_all = is_private(file, path) && read(file, text, sizeof text - 1) > 0;
    close(file);
    return read_all &&
           g_ascii_string_to_unsigned(g_strstrip(text), 16, 1ull << 32, UINT64_MAX, token, NULL);
}

static uint64_t make_token(const char *path)
{
    uint64_t token = 0;
    while (token >> 32 == 0)
        if (getrandom(&token, sizeof token, 0) != sizeof token)
            token = 0;
    g_autofree char *text = g_strdup_printf("%016" G_GINT64_MODIFIER "x\n", token);
    g_autoptr(GError) error = NULL;
    if (!g_file_set_contents_full(path, text, (gssize)strlen(text), G_FILE_SET_CONTENTS_CONSISTENT,
                                  0600, &error))
        agent_progress_note("%s; only this process will own the machine's lease", error->message);
    return token;
}
