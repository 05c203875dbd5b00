/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A streaming JSON writer: members and elements in the order of the calls. `key` names a member;
 * it is NULL for an element of an array. Calls that do not nest are our own bugs and assert.
 */
#ifndef AGENT_OUT_JSON_H
#define AGENT_OUT_JSON_H

#include <glib.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct AgentJson AgentJson;

/* Begins with the outermost object open. */
AgentJson *agent_json_new(void);
void agent_json_free(AgentJson *json);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(AgentJson, agent_json_free)

void agent_json_object(AgentJson *json, const char *key);
void agent_json_array(AgentJson *json, const char *key);

/* An array whose elements, and all below them, stay on one line. */
void agent_json_row(AgentJson *json, const char *key);

/* Ends the innermost object, array or row. */
void agent_json_end(AgentJson *json);

/* The shortest decimal number that reads back as the same double; null where it is not finite. */
void agent_json_number(AgentJson *json, const char *key, double value);
/* A row of them. */
void agent_json_numbers(AgentJson *json, const char *key, const double *values, size_t n);
void agent_json_integer(AgentJson *json, const char *key, int64_t value);
void agent_json_bool(AgentJson *json, const char *key, bool value);

/* `value` in UTF-8 (what is not becomes U+FFFD); null where it is NULL. */
void agent_json_string(AgentJson *json, const char *key, const char *value);

/* Ends the outermost object and hands the text over, with a newline; caller frees. The writer takes
 * no more after that. */
char *agent_json_finish(AgentJson *json);

#endif
