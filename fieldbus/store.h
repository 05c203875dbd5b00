/* SPDX-License-Identifier: Apache-2.0 */
/* The machine's copy of a program while it comes in and after: docs/protocol.md, section 5.1. */
#ifndef FIELDBUS_STORE_H
#define FIELDBUS_STORE_H

#include "fieldbus/wire.h"

typedef struct {
    uint32_t transfer;   /* 0: nothing is stored */
    FbOpen open;         /* what was announced */
    uint64_t length;     /* of the stream */
    GByteArray *growing; /* until the hash was found right, */
    GBytes *stream;      /* from then on */
    GChecksum *hash;     /* of the program's bytes so far */
    bool hashed;
    uint8_t sha256[32]; /* once hashed */
    GBytes *program;    /* a part of `stream`, no copy */
    uint64_t *gates;
} FbStore;

/* DONE, MALFORMED or TOO_LARGE; the store was empty. */
FbAnswer fb_store_open(FbStore *store, const FbOpen *open, uint32_t transfer,
                       uint64_t memory_bytes);
void fb_store_clear(FbStore *store);

uint64_t fb_store_received(const FbStore *store);

/* DONE, MALFORMED, GAP or CONFLICT. */
FbAnswer fb_store_chunk(FbStore *store, const FbChunk *chunk);

/* DONE, then `program` and `gates` are set for good; or INCOMPLETE, PROGRAM (the gates; `why` says
 * what is wrong with them), HASH. */
FbAnswer fb_store_verify(FbStore *store, const char **why);

#endif
