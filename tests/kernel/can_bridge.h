/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A bridge between two CAN interfaces, the agent's and the machine's: it numbers the frames that
 * come, in both directions together, and does one fault at one of them.
 */
#ifndef TESTS_KERNEL_CAN_BRIDGE_H
#define TESTS_KERNEL_CAN_BRIDGE_H

#include <linux/can.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum { BRIDGE_AGENT, BRIDGE_MACHINE, BRIDGE_N_SIDES } BridgeSide;

typedef enum {
    BRIDGE_NO_FAULT,
    BRIDGE_LOST,
    BRIDGE_TWICE,
    BRIDGE_TWICE_LATE, /* the copy past the time-out of the answer */
    BRIDGE_LATE,       /* past that time-out; others overtake it */
    BRIDGE_STALLED,    /* past ISO-TP's time-outs as well, and all of this direction behind it */
    BRIDGE_DAMAGED,    /* one bit of its data */
    /* An interface goes down, and up again; the frame is lost. */
    BRIDGE_AGENT_DOWN,
    BRIDGE_MACHINE_DOWN,
    /* An error frame there, bus-off; nothing goes or comes for some time. */
    BRIDGE_AGENT_OFF,
    BRIDGE_MACHINE_OFF,
    BRIDGE_REBOOTED, /* by the caller: the machine is dead for some time */
    BRIDGE_KILLED,   /* by the caller: the agent is dead until bridge_revive */
    BRIDGE_N_FAULTS
} BridgeFault;

const char *bridge_fault_name(BridgeFault fault);

/* What came, for choosing faults. */
typedef struct {
    BridgeSide from;
    uint16_t id;
    uint8_t first; /* byte of data: ISO-TP's kind of frame is its high half */
} BridgeSeen;

typedef struct {
    void (*kill)(void *data); /* the agent */
    void (*cut)(void *data);  /* the machine's power, */
    void (*boot)(void *data); /* and its return */
    void *data;
} BridgeHands;

typedef struct Bridge Bridge;

/* NULL, with errno, where an interface is not there. It lives as long as its process. */
Bridge *bridge_new(const char *agent, const char *machine, const BridgeHands *hands);

/* Begins anew: forgets what is there or on its way; the next frame is number 0, and `fault` hits
 * number `at`. `bit` is that of a damaged frame, modulo its size. */
void bridge_reset(Bridge *bridge, BridgeFault fault, unsigned at, unsigned bit);

/* Passes on what came, and what is due; waits for it, and for `other` to be readable, at most
 * `most_ms`. Whether `other` is readable, or nothing came. */
bool bridge_turn(Bridge *bridge, int other, int most_ms);

void bridge_revive(Bridge *bridge);       /* the agent lives again */
bool bridge_struck(const Bridge *bridge); /* the fault has been */

/* Of the frames since the reset. */
const BridgeSeen *bridge_seen(const Bridge *bridge, unsigned *n);

int64_t bridge_now_us(void);

#endif
