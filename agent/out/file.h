/* SPDX-License-Identifier: Apache-2.0 */
/* Result files: written beside and renamed, so that a reader never sees half of one. */
#ifndef AGENT_OUT_FILE_H
#define AGENT_OUT_FILE_H

#include <glib.h>
#include <stdbool.h>

/* Makes `folder` and its parents. Errors: AGENT_ERROR_OUTPUT. */
bool agent_file_folder(const char *folder, GError **error);

/* Writes folder/name. Errors: AGENT_ERROR_OUTPUT. */
bool agent_file_write(const char *folder, const char *name, const void *bytes, size_t length,
                      GError **error);

#endif
