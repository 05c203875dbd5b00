/* SPDX-License-Identifier: Apache-2.0 */
/* Sources of a main loop, as the files of this room that live in one need them. */
#ifndef FIELDBUS_SOURCE_H
#define FIELDBUS_SOURCE_H

#include <glib.h>

/* Calls whenever its ready time (g_source_set_ready_time) is over, or one of its descriptors
 * (g_source_add_unix_fd) is ready; `call` sets the time anew. fb_source_end ends it. */
GSource *fb_source_new(void (*call)(void *data), void *data, GMainContext *context);

/* Takes it out of its main loop and sets it to NULL; NULL is nothing. */
void fb_source_end(GSource **source);

#endif
