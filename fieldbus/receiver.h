/* SPDX-License-Identifier: Apache-2.0 */
/* What the machine's receiver is to the room: blocks written to it by whatever carries them. */
#ifndef FIELDBUS_RECEIVER_H
#define FIELDBUS_RECEIVER_H

#include "fieldbus/wire.h"

typedef enum { FB_BLOCK_COMMAND = 1, FB_BLOCK_CHUNK, FB_BLOCK_BEAT } FbBlock;

/* Steps by a block of any n bytes from somebody of this role; the answer is also in the status from
 * then on. Appends FbDo values to `actions`. */
FbAnswer fb_receiver_write(FbReceiver *receiver, FbRole role, FbBlock block, const uint8_t *bytes,
                           size_t n, int64_t now_us, GArray *actions);

/* What a carrier can do: bytes of the stream in a chunk, and requests in flight on a connection. */
typedef struct {
    uint16_t chunk_max, window_max;
} FbCarrier;

/* What is published on it. fb_receiver_status is of one without limits of its own. */
void fb_receiver_publish(const FbReceiver *receiver, FbCarrier carrier, int64_t now_us,
                         FbStatus *status);

/* Has them done, in their order, and empties the array. */
static inline void fb_do_actions(GArray *actions, void (*act)(FbDo what, void *data), void *data)
{
    for (guint i = 0; i < actions->len; i++)
        act(g_array_index(actions, FbDo, i), data);
    g_array_set_size(actions, 0);
}

#endif
