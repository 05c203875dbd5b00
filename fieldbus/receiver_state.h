/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The inside of an FbReceiver, for its two files: receiver.c steps it, receiver_status.c says what
 * it publishes.
 */
#ifndef FIELDBUS_RECEIVER_STATE_H
#define FIELDBUS_RECEIVER_STATE_H

#include "fieldbus/receiver.h"
#include "fieldbus/store.h"

enum { FB_N_RECORDS = 32 };

/* The last command of a session, and what became of it. */
typedef struct {
    uint32_t session, seq, crc;
    FbCommand command;
    FbAnswer answer;
    uint64_t used; /* ascending: who is longest unused */
} FbRecord;

struct FbReceiver {
    FbReceiverOptions options;
    FbState state;
    bool verified; /* what the store holds is ready to run */
    FbStore store;
    uint32_t transfers; /* handles given */

    uint64_t lease_token; /* 0: free */
    uint32_t lease_session;
    int64_t heard_us; /* the owner's last sign of life */
    bool agent_lost;
    bool needs_acknowledge;

    FbRecord records[FB_N_RECORDS];
    uint64_t n_used;
    FbRecord last; /* as published */
    uint32_t verify_session;
    FbAnswer chunk_answer;

    uint32_t run, restart_gate;
    FbRunEnd run_end;
    FbArguments overrides;
    FbSetup setup;
    uint16_t alarm_code, alarm_serial;
    char alarm_text[FB_TEXT_BYTES], alarm_advice[FB_TEXT_BYTES];
    FbProgress progress;
    uint32_t heartbeat;
    int64_t heartbeat_us; /* when it counts next */
    uint64_t counts[FB_N_ANSWERS];
};

#endif
