/* SPDX-License-Identifier: Apache-2.0 */
/* What the commands share that start a run or watch one: deliver, start, follow, and Ctrl-C. */
#ifndef AGENT_EXECUTE_H
#define AGENT_EXECUTE_H

#include "agent/follow.h"
#include "agent/link.h"

typedef struct {
    AgentLink *link;
    AgentFollow *follow; /* NULL: only the machine's line is shown */
    int64_t start_us;    /* of the record's clock, monotonic */
    bool started;        /* a run is on, or on its way */
    int interrupts;      /* Ctrl-C so far, since then */
    FbCommand stop;      /* what they asked for last */
    FbState state;       /* as last told to the person, */
    bool starved;        /* and that this happened */
    char *name;          /* of the machine, for messages */
    bool watching;       /* the run of the machine's epoch, */
    uint32_t epoch, run; /* whoever started it, */
    bool ended;          /* until it ends */
    GError *why;         /* what ended it; NULL: complete */
    GSource *lost;       /* gives the machine up; NULL while it answers */
} AgentExecution;

/* Nothing asked yet; the record's clock starts. `follow` may be NULL. All three outlive it. */
AgentExecution agent_execution(AgentLink *link, AgentFollow *follow, char *name);

/* Lease, transfer, VERIFY. Ctrl-C ends it. */
bool agent_execute_deliver(AgentExecution *execution, GBytes *program, const uint64_t *gates,
                           size_t n_gates, GError **error);

/* START, and follows to the end; with `stored` RESTART or START of what the machine holds, as
 * fb_session_start_stored. Ctrl-C asks for a hold, a second one for an abort; a third gives up on
 * an answer. Running a command that calls this is the person's explicit act. */
bool agent_execute_start(AgentExecution *execution, const FbStored *stored, GError **error);

/* Follows the run that is on, whoever started it, to its end; Ctrl-C as above. Errors: what ended
 * it, as fb_session_start's. */
bool agent_execute_watch(AgentExecution *execution, GError **error);

#endif
