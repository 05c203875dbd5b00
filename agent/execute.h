/* SPDX-License-Identifier: Apache-2.0 */
/* What `run` and `send` share: deliver, start, follow, and Ctrl-C. */
#ifndef AGENT_EXECUTE_H
#define AGENT_EXECUTE_H

#include "agent/follow.h"
#include "agent/link.h"

typedef struct {
    AgentLink *link;
    AgentFollow *follow; /* NULL: only the machine's line is shown */
    int64_t start_us;    /* of the record's clock, monotonic */
    bool started;        /* START was sent */
    int interrupts;      /* Ctrl-C so far, since START */
    FbCommand stop;      /* what they asked for last */
    FbState state;       /* as last told to the person */
    char *name;          /* of the machine, for messages */
} AgentExecution;

/* Lease, transfer, VERIFY. Ctrl-C ends it. */
bool agent_execute_deliver(AgentExecution *execution, GBytes *program, const uint64_t *gates,
                           size_t n_gates, GError **error);

/* START, and follows to the end. Ctrl-C asks for a hold, a second one for an abort; a third gives
 * up on an answer. Running a command that calls this is the person's explicit act. */
bool agent_execute_start(AgentExecution *execution, GError **error);

#endif
