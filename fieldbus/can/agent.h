/* SPDX-License-Identifier: Apache-2.0 */
/* Who the two channels of a session are on a CAN bus. */
#ifndef FIELDBUS_CAN_AGENT_H
#define FIELDBUS_CAN_AGENT_H

#include "fieldbus/can/bus.h"
#include "fieldbus/can/seal.h"

/* Shared by the clients of both channels. */
typedef struct {
    unsigned references;
    FbCanBus bus;
    FbCanKey key;
    uint16_t base;
    unsigned number; /* the agent's, */
    int seat;        /* held by this socket; -1: by nothing */
} FbCanAgent;

/* Of the target's address, can://interface. Takes the first number of its range that no other
 * program of this host has; it is free again when this one ends, however it does. Errors:
 * FB_ERROR_UNREACHABLE (no number is free), FB_ERROR_CREDENTIALS (the key). */
FbCanAgent *fb_can_agent_new(const CfgTarget *target, GError **error);

/* On any bus, which it takes, with a number that the caller knows to be free. */
FbCanAgent *fb_can_agent_new_on(FbCanBus bus, const FbCanKey *key, uint16_t base, unsigned number);

FbCanAgent *fb_can_agent_ref(FbCanAgent *agent);
void fb_can_agent_unref(FbCanAgent *agent); /* NULL is fine */
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbCanAgent, fb_can_agent_unref)

#endif
