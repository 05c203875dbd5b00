/* SPDX-License-Identifier: Apache-2.0 */
/* run.json: docs/schema/run.json. */
#ifndef AGENT_OUT_RUN_JSON_H
#define AGENT_OUT_RUN_JSON_H

#include "agent/follow.h"
#include "agent/out/json.h"

/* How a run ended, for people and programs: "complete", "alarm", "aborted", "link-lost",
 * "unreachable", "refused", "blocked" or "failed". `error` NULL: complete. */
const char *agent_run_outcome(const GError *error);

typedef struct {
    const char *program_sha256;
    const char *machine;    /* as --to named it */
    char *started;          /* ISO 8601, UTC */
    uint32_t gate;          /* where it began; 0: at the top */
    const GArray *findings; /* of the pre-flight; NULL: it was not reached */
    const GError *error;    /* what ended it; NULL: complete */
    const AgentFollow *follow;
} AgentRunReport;

/* Notes the time; agent_run_end frees it. */
void agent_run_begin(AgentRunReport *report);
void agent_run_end(AgentRunReport *report);

/* The text; caller frees. */
char *agent_run_json(const AgentRunReport *report);

/* Writes run.json into `folder`, which is made where it is missing. Errors: AGENT_ERROR_OUTPUT. */
bool agent_run_write(const AgentRunReport *report, const char *folder, GError **error);

/* What a complete run came to: into the --json object, and, unless `json`, to stdout. */
void agent_run_describe(const AgentRunReport *report, AgentJson *result, bool json);

#endif
