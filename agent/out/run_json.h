/* SPDX-License-Identifier: Apache-2.0 */
/* run.json: docs/schema/run.json. */
#ifndef AGENT_OUT_RUN_JSON_H
#define AGENT_OUT_RUN_JSON_H

#include "agent/follow.h"

/* How a run ended, for people and programs: "complete", "alarm", "aborted", "link-lost",
 * "unreachable", "refused" or "failed". `error` NULL: complete. */
const char *agent_run_outcome(const GError *error);

typedef struct {
    const char *program_sha256;
    const char *machine; /* as --to named it */
    const char *started; /* ISO 8601, UTC */
    const GError *error; /* what ended it; NULL: complete */
    const AgentFollow *follow;
} AgentRunReport;

/* The text; caller frees. */
char *agent_run_json(const AgentRunReport *report);

#endif
