/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who speaks on a CAN bus: the shared key, the opening of a channel, and the seals of its messages
 * and frames; docs/protocol.md, section 9, byte by byte. Pure: nonces are passed in, and whoever
 * counts (what is larger than before) is the caller.
 */
#ifndef FIELDBUS_CAN_SEAL_H
#define FIELDBUS_CAN_SEAL_H

#include "fieldbus/wire.h"

enum {
    FB_CAN_KEY_LEAST_BYTES = 16,
    FB_CAN_KEY_MOST_BYTES = 64,
    FB_CAN_MAC_BYTES = 16,
    FB_CAN_NONCE_BYTES = 16,
    FB_CAN_SEAL_BYTES = 4 + FB_CAN_MAC_BYTES,
    FB_CAN_MESSAGE_BYTES = 4095, /* the longest, all in all */
    FB_CAN_BODY_BYTES = FB_CAN_MESSAGE_BYTES - 1 - FB_CAN_SEAL_BYTES,
    FB_CAN_HELLO_BYTES = 25 + FB_CAN_MAC_BYTES,
    FB_CAN_WELCOME_BYTES = 29 + FB_CAN_MAC_BYTES,
    FB_CAN_FRAME_BYTES = 8, /* STOP, and the machine's beat */

    FB_CAN_COUNTER_MOST = INT32_MAX, /* of messages */

    FB_CAN_FLAG_FD = 1,

    /* Identifiers, from the base; the agent's number is added to all but the beat's. */
    FB_CAN_ID_STOP = 0x00,
    FB_CAN_ID_BEAT = 0x10,
    FB_CAN_ID_CONTROL = 0x20, /* requests; the answers' is FB_CAN_ID_ANSWER more */
    FB_CAN_ID_WORK = 0x40,
    FB_CAN_ID_ANSWER = 0x10,
    FB_CAN_AGENTS_MOST = 16,
};

typedef enum {
    FB_CAN_COMMAND = 1,
    FB_CAN_CHUNK,
    FB_CAN_BEAT,
    FB_CAN_READ,
    FB_CAN_HELLO,
    FB_CAN_STATUS = 16,
    FB_CAN_ALARM,
    FB_CAN_ACK,
    FB_CAN_OFFSETS,
    FB_CAN_TOOLS,
    FB_CAN_WELCOME,
} FbCanKind;

typedef enum { FB_CAN_CONTROL_CHANNEL, FB_CAN_WORK_CHANNEL, FB_CAN_N_CHANNELS } FbCanChannel;

/* The identifier of a channel's requests. */
static inline uint16_t fb_can_request_id(uint16_t base, unsigned agent, FbCanChannel channel)
{
    const unsigned offset = channel == FB_CAN_WORK_CHANNEL ? FB_CAN_ID_WORK : FB_CAN_ID_CONTROL;
    return (uint16_t)(base + offset + agent);
}

typedef struct {
    uint8_t bytes[FB_CAN_KEY_MOST_BYTES];
    size_t n;
} FbCanKey;

/* The shared key: a file of hexadecimal digits, 32 to 128 of them, and white space around them,
 * which nobody but its owner may read. Errors: FB_ERROR_CREDENTIALS, with the file's name. */
bool fb_can_key_load(FbCanKey *key, const char *path, GError **error);

/* Whether a message says that it is a HELLO. */
static inline bool fb_can_is_hello(const uint8_t *message, size_t n)
{
    return n > 0 && message[0] == FB_CAN_HELLO;
}

typedef struct {
    uint16_t version, flags;
    uint32_t session;
    uint8_t nonce[FB_CAN_NONCE_BYTES];
} FbCanHello;

typedef struct {
    uint16_t version, flags;
    uint32_t epoch, beat_count;
    uint8_t nonce[FB_CAN_NONCE_BYTES];
} FbCanWelcome;

/* Encoders return the bytes written. Decoders take any bytes and answer whether they are what they
 * should be and sealed with this key; nothing is to be believed otherwise. `id` is the channel's
 * request identifier. */
size_t fb_can_put_hello(uint8_t *out, const FbCanHello *hello, const FbCanKey *shared, uint16_t id);
bool fb_can_get_hello(const uint8_t *in, size_t n, const FbCanKey *shared, uint16_t id,
                      FbCanHello *hello);
size_t fb_can_put_welcome(uint8_t *out, const FbCanWelcome *welcome, const FbCanKey *shared,
                          uint16_t id, const uint8_t *nonce_agent);
bool fb_can_get_welcome(const uint8_t *in, size_t n, const FbCanKey *shared, uint16_t id,
                        const uint8_t *nonce_agent, FbCanWelcome *welcome);

/* The keys of one opening: of what the agent sends, and of what it is sent. */
typedef struct {
    FbCanKey agent, machine;
} FbCanKeys;

void fb_can_derive(FbCanKeys *keys, const FbCanKey *shared, uint16_t id, const uint8_t *nonce_agent,
                   const uint8_t *nonce_machine);

/* Appends the seal to a message of n bytes (kind and body); returns its new length. */
size_t fb_can_seal(uint8_t *message, size_t n, uint32_t counter, const FbCanKey *key);

/* Whether a whole message of n bytes, at least 1 + FB_CAN_SEAL_BYTES, has a seal of this key; its
 * counter. */
bool fb_can_unseal(const uint8_t *message, size_t n, const FbCanKey *key, uint32_t *counter);

/* STOP: FB_CAN_FRAME_BYTES. A seq has 24 bits. */
enum { FB_CAN_SEQ_MOST = (1 << 24) - 1 };
void fb_can_put_stop(uint8_t *out, FbCommand command, uint32_t seq, const FbCanKey *agent);
bool fb_can_get_stop(const uint8_t *in, const FbCanKey *agent, FbCommand *command, uint32_t *seq);

/* The counter of the answer to it. */
static inline uint32_t fb_can_stop_counter(uint32_t seq)
{
    return UINT32_C(1) << 31 | seq;
}

/* The beat of the machine: FB_CAN_FRAME_BYTES. */
typedef struct {
    FbState state;
    uint8_t flags; /* low byte of those in STATUS */
    uint32_t count;
} FbCanMachineBeat;

void fb_can_beat_key(FbCanKey *key, const FbCanKey *shared, uint32_t epoch);
void fb_can_put_beat(uint8_t *out, const FbCanMachineBeat *beat, const FbCanKey *key);

/* `next` is the lowest count that is in front of the last one; the beat's own is found from it. */
bool fb_can_get_beat(const uint8_t *in, const FbCanKey *key, uint32_t next, FbCanMachineBeat *beat);

#endif
