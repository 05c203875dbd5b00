/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/file.h"

#include <errno.h>
#include <glib/gstdio.h>
#include <string.h>

#include "agent/agent.h"

bool agent_file_folder(const char *folder, GError **error)
{
    if (g_mkdir_with_parents(folder, 0777) == 0)
        return true;
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_OUTPUT, "%s: cannot make the folder: %s", folder,
                g_strerror(errno));
    return false;
}

bool agent_file_write(const char *folder, const char *name, const void *bytes, size_t length,
                      GError **error)
{
    g_autofree char *path = g_build_filename(folder, name, NULL);
    g_autoptr(GError) cause = NULL;
    /* CONSISTENT is GLib's way to say: beside, then renamed. */
    if (g_file_set_contents_full(path, bytes, (gssize)length, G_FILE_SET_CONTENTS_CONSISTENT, 0666,
                                 &cause))
        return true;
    g_set_error_literal(error, AGENT_ERROR, AGENT_ERROR_OUTPUT, cause->message);
    return false;
}
