/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's side of docs/protocol.md, section 9, between its messages and the receiver: who may
 * speak, what is done, what is answered. Pure: it knows neither sockets nor clocks, and its random
 * numbers are passed in.
 */
#ifndef FIELDBUS_CAN_SLAVE_H
#define FIELDBUS_CAN_SLAVE_H

#include "fieldbus/can/seal.h"
#include "fieldbus/receiver.h"

typedef struct {
    FbCanKey key;
    uint16_t base;
    unsigned agents; /* served: numbers 0 to agents - 1 */
    bool fd;         /* the bus can do CAN FD */
} FbCanSlaveOptions;

typedef struct FbCanSlave FbCanSlave;

/* The receiver must outlive it. */
FbCanSlave *fb_can_slave_new(const FbCanSlaveOptions *options, FbReceiver *receiver);
void fb_can_slave_free(FbCanSlave *slave);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbCanSlave, fb_can_slave_free)

/* What came, and from where: `n` bytes on the request identifier of a channel. */
typedef struct {
    unsigned agent;
    FbCanChannel channel;
    bool fd; /* in FD frames */
    const uint8_t *bytes;
    size_t n;
} FbCanMessage;

/* What goes back on that channel. */
typedef struct {
    size_t n; /* 0: nothing */
    bool fd;
    uint8_t bytes[FB_CAN_MESSAGE_BYTES];
} FbCanAnswer;

/* Steps by any message; `nonce` is FB_CAN_NONCE_BYTES, which for a HELLO were never used before; no
 * other message looks at them. Appends FbDo values to `actions`, for after the answer: what they
 * lead to is told by the beat, and one request is in flight, so an answer that waited for the
 * machine would keep the next one out. On Modbus they are done first (fieldbus/modbus/slave.h). */
void fb_can_slave_message(FbCanSlave *slave, const FbCanMessage *message, const uint8_t *nonce,
                          int64_t now_us, GArray *actions, FbCanAnswer *answer);

/* Steps by any plain frame of n bytes on an agent's STOP identifier. The answer is for its control
 * channel. */
void fb_can_slave_stop(FbCanSlave *slave, unsigned agent, const uint8_t *bytes, size_t n,
                       int64_t now_us, GArray *actions, FbCanAnswer *answer);

/* Whether state or flags are others than those of the last beat. */
bool fb_can_slave_has_news(const FbCanSlave *slave, int64_t now_us);

/* The next beat: FB_CAN_FRAME_BYTES. */
void fb_can_slave_beat(FbCanSlave *slave, int64_t now_us, uint8_t *frame);

/* forged, replayed, malformed, hellos and openings; the rest is 0. */
FbCanCounts fb_can_slave_counts(const FbCanSlave *slave);

#endif
