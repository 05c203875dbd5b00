/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's copy of a program while it comes in and after: docs/protocol.md, section 5.1. A
 * stored program is kept whole; of one that drips only what has come and is not yet executed.
 */
#ifndef FIELDBUS_STORE_H
#define FIELDBUS_STORE_H

#include "fieldbus/wire.h"

/* GByteArray counts in 32 bits and doubles as it grows. */
enum { FB_STREAM_MOST = 1 << 30 };

typedef struct {
    uint32_t transfer; /* 0: nothing is stored */
    FbOpen open;       /* what was announced */
    bool drip;
    uint64_t memory_bytes; /* for the stream */
    uint64_t table_bytes;  /* of the stream's `length` bytes, the first */
    uint64_t length;
    GByteArray *growing; /* the stream's bytes until the hash was found right, */
    GBytes *stream;      /* from then on; a stream that drips grows to its end */
    uint64_t forgotten;  /* drip: bytes of the program that were executed, */
    uint64_t dropped;    /* and those of them that are no longer in `growing` */
    GChecksum *hash;     /* of the program's bytes so far */
    bool hashed;
    uint8_t sha256[32]; /* once hashed */
    GBytes *program;    /* a part of `stream`, no copy */
    uint64_t *gates;    /* once the table is there and right */
    uint8_t *running;   /* drip: 32 bytes a gate, the hashes announced */
    size_t n_released;  /* drip: passes that are whole and right */
} FbStore;

/* DONE, MALFORMED or TOO_LARGE; the store was empty. */
FbAnswer fb_store_open(FbStore *store, const FbOpen *open, uint32_t transfer,
                       uint64_t memory_bytes);
void fb_store_clear(FbStore *store);

uint64_t fb_store_received(const FbStore *store);

/* The sender's credit: it may send up to here. */
uint64_t fb_store_may_send_to(const FbStore *store);

/* The stream up to here may be executed. */
uint64_t fb_store_released(const FbStore *store);

/* DONE, MALFORMED, TOO_LARGE, GAP, CONFLICT; drip: HASH, where a pass is not the one announced: the
 * chunk that would have completed it is not taken. */
FbAnswer fb_store_chunk(FbStore *store, const FbChunk *chunk);

/* DONE: `gates` is set for good, and `program` or, drip, the first passes; or INCOMPLETE, PROGRAM
 * (the gates; `why` says what is wrong with them), HASH; drip: TOO_LARGE, a pass that does not fit.
 */
FbAnswer fb_store_verify(FbStore *store, const char **why);

/* Drip: the bytes of a released pass that is not forgotten; else NULL. */
GBytes *fb_store_pass(const FbStore *store, size_t pass);

/* Drip: the first `n` passes were executed; their bytes make room. */
void fb_store_forget(FbStore *store, size_t n);

#endif
