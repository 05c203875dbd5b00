/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Pre-flight: before anything moves, what a program needs is compared with what the machine says
 * of itself. The comparison is pure. What cannot be run at all is the machine's own VERIFY.
 */
#ifndef AGENT_PREFLIGHT_H
#define AGENT_PREFLIGHT_H

#include "agent/link.h"
#include "agent/program.h"

/* Two lengths that differ by no more are the same. */
#define AGENT_PREFLIGHT_TOLERANCE_MM 0.01

typedef enum {
    AGENT_NOTE,    /* good to know */
    AGENT_TIP,     /* could be better */
    AGENT_WARNING, /* look at it */
    AGENT_CAUTION, /* blocks the start until a person accepts it */
} AgentLevel;

const char *agent_level_name(AgentLevel level); /* "note" */

typedef struct {
    AgentLevel level;
    const char *code; /* for programs: "tool-length" … */
    char *message;    /* for people: what differs, both values, what to do */
} AgentFinding;

typedef struct {
    const NcProgram *program;
    const AgentProgram *needs;   /* NULL: there is no description to read the program with */
    const AgentMachine *machine; /* it; NULL together with `needs` */
    CfgDrip drip;                /* from here on filled in by agent_preflight */
    const FbStatus *status;      /* of the machine, */
    const FbSetup *setup;        /* its tools and offsets */
} AgentPreflight;

/* What there is to say: AgentFindings in the order of the checks. */
GArray *agent_preflight_compare(const AgentPreflight *flight);

/* Reads the machine's status, tools and offsets, compares, and tells a person on stderr. NULL with
 * an error where the machine does not answer. */
GArray *agent_preflight(AgentLink *link, AgentPreflight *flight, GError **error);

/* Right before the start, where that took its time: as the machine's last status says, `findings`
 * still hold; or everything is compared again, replaces them, and must be allowed again. What
 * changes between that status and the START is not seen. */
bool agent_preflight_again(AgentLink *link, AgentPreflight *flight, bool accepted,
                           GArray **findings, GError **error);

/* Whether that may be started; AGENT_ERROR_CAUTION where there are cautions that nobody accepted.
 */
bool agent_preflight_allows(const GArray *findings, bool accepted, GError **error);

/* The member "preflight". `findings` NULL: none. */
void agent_preflight_write(const GArray *findings, AgentJson *json);

#endif
