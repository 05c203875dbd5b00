/* SPDX-License-Identifier: Apache-2.0 */
/* A session with the machine that --to names, for commands that wait for one thing at a time. */
#ifndef AGENT_LINK_H
#define AGENT_LINK_H

#include "agent/agent.h"
#include "config/config.h"
#include "fieldbus/fieldbus.h"

typedef struct AgentLink {
    CfgAgent *agent;
    CfgTarget target; /* its strings are the agent's or the options' */
    GMainContext *context;
    FbSession *session;
    /* Every status; may be NULL. */
    void (*status)(const FbStatus *status, void *data);
    void *data;
    bool known;        /* the status is the machine's own: the link is up */
    GSource *patience; /* tells a person that it is not, after a second */
    bool done[FB_N_TASKS];
    GError *error[FB_N_TASKS];
    bool cancelled; /* ends the wait; `cause` is its error */
    GError *cause;
} AgentLink;

/* The target of --to: a name in the agent's configuration (--config, the user's, the system's, the
 * built-in one), or an address. Connects in the background; where that takes more than a second,
 * whoever waits is told so on stderr. Errors: AGENT_ERROR_TARGET, CFG_ERROR. */
AgentLink *agent_link_open(const AgentOptions *options, GError **error);

/* Forgets every task, done or not, and connects anew: what was not sent is never sent. Not from a
 * callback. */
bool agent_link_renew(AgentLink *link, GError **error);

/* Gives the lease back, unless a run is on. */
void agent_link_free(AgentLink *link);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(AgentLink, agent_link_free)

/* Waits for the first status. Errors: FB_ERROR_UNREACHABLE after the agent's give_up_s. */
bool agent_link_wait_status(AgentLink *link, GError **error);

/* The same, and that the machine's state takes a program. Errors: also FB_ERROR_REFUSED. */
bool agent_link_wait_ready(AgentLink *link, GError **error);

/* A timer on the link's own context, for the caller to destroy and unref. */
GSource *agent_link_timer(AgentLink *link, double seconds, GSourceFunc call, void *data);

/* Waits until the task ends; fails with the error it ended with. */
bool agent_link_wait(AgentLink *link, FbTask task, GError **error);

/* Sends a command and waits; `arguments` as fb_session_command. */
bool agent_link_command(AgentLink *link, FbCommand command, const FbArguments *arguments,
                        GError **error);

/* Ends the wait that is going on; takes `cause`. */
void agent_link_cancel(AgentLink *link, GError *cause);

/* After a wait that was ended so: hands the cause over. Always false. */
bool agent_link_take_cause(AgentLink *link, GError **error);

#endif
