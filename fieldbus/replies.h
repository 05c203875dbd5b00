/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a machine's server sends back, past a filter that may lose, double, damage or hold up each
 * reply. Without a filter they go at once. What is held up keeps its order with what follows on its
 * connection, as it does on a wire that is slow.
 */
#ifndef FIELDBUS_REPLIES_H
#define FIELDBUS_REPLIES_H

#include "fieldbus/fieldbus.h"

typedef struct FbReplies FbReplies;

/* `send` sends on a connection, whatever that is to the server. */
FbReplies *fb_replies_new(void (*send)(void *connection, const uint8_t *bytes, size_t n,
                                       void *data),
                          void *data, GMainContext *context);
void fb_replies_free(FbReplies *replies); /* what waits is lost */
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbReplies, fb_replies_free)

/* NULL: none. */
void fb_replies_filter(FbReplies *replies, FbReplyFilter filter, void *data);

/* False where the filter wants the connection closed: nothing is sent. */
bool fb_replies_send(FbReplies *replies, void *connection, const uint8_t *bytes, size_t n);

/* A connection has ended: nothing is sent on it any more. */
void fb_replies_forget(FbReplies *replies, const void *connection);

#endif
