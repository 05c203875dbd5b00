/* SPDX-License-Identifier: Apache-2.0 */
/* What programs say to people: the texts of (MSG, …), (DEBUG, …), (PRINT, …), (LOG, …). */
#ifndef NC_GCODE_MESSAGE_H
#define NC_GCODE_MESSAGE_H

#include <glib.h>

/* Texts by number; each is kept once. */
typedef struct {
    GPtrArray *texts;
    GHashTable *numbers;
} NcMessages;

NcMessages *nc_messages_new(void);
void nc_messages_free(NcMessages *messages);
int nc_messages_add(NcMessages *messages, const char *text);

#endif
