/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/json.h"

#include "config/config.h"

#define MAX_DEPTH 16

typedef struct {
    char close; /* '}' or ']' */
    bool row;   /* on one line */
    bool any;   /* has a member already */
} Level;

struct AgentJson {
    GString *out;
    Level levels[MAX_DEPTH];
    int depth; /* of the innermost level */
};

AgentJson *agent_json_new(void)
{
    AgentJson *json = g_new0(AgentJson, 1);
    json->out = g_string_new("{");
    json->levels[0].close = '}';
    return json;
}

void agent_json_free(AgentJson *json)
{
    if (!json)
        return;
    if (json->out)
        g_string_free(json->out, true);
    g_free(json);
}

static void new_line(AgentJson *json)
{
    g_string_append_c(json->out, '\n');
    for (int i = 0; i <= json->depth; i++)
        g_string_append(json->out, "  ");
}

static void append_string(GString *out, const char *text)
{
    g_autofree char *valid = g_utf8_make_valid(text, -1);
    g_string_append_c(out, '"');
    for (const char *c = valid; *c; c++) {
        if (*c == '"' || *c == '\\')
            g_string_append_printf(out, "\\%c", *c);
        else if (*c == '\n')
            g_string_append(out, "\\n");
        else if ((unsigned char)*c < ' ' || *c == 127)
            g_string_append_printf(out, "\\u%04x", *c);
        else
            g_string_append_c(out, *c);
    }
    g_string_append_c(out, '"');
}

/* What stands before every value: comma, place, key. */
static void before(AgentJson *json, const char *key)
{
    Level *level = &json->levels[json->depth];
    g_assert((level->close == '}') == (key != NULL));
    if (level->any)
        g_string_append(json->out, level->row ? ", " : ",");
    if (!level->row)
        new_line(json);
    level->any = true;
    if (key) {
        append_string(json->out, key);
        g_string_append(json->out, ": ");
    }
}

static void begin(AgentJson *json, const char *key, char open, char close, bool row)
{
    before(json, key);
    g_assert(json->depth + 1 < MAX_DEPTH);
    row = row || json->levels[json->depth].row;
    json->levels[++json->depth] = (Level){.close = close, .row = row};
    g_string_append_c(json->out, open);
}

void agent_json_object(AgentJson *json, const char *key)
{
    begin(json, key, '{', '}', false);
}

void agent_json_array(AgentJson *json, const char *key)
{
    begin(json, key, '[', ']', false);
}

void agent_json_row(AgentJson *json, const char *key)
{
    begin(json, key, '[', ']', true);
}

void agent_json_end(AgentJson *json)
{
    Level ended = json->levels[json->depth--];
    g_assert(json->depth >= -1);
    if (ended.any && !ended.row)
        new_line(json);
    g_string_append_c(json->out, ended.close);
}

void agent_json_number(AgentJson *json, const char *key, double value)
{
    before(json, key);
    cfg_number_append(json->out, value);
}

void agent_json_numbers(AgentJson *json, const char *key, const double *values, size_t n)
{
    agent_json_row(json, key);
    for (size_t i = 0; i < n; i++)
        agent_json_number(json, NULL, values[i]);
    agent_json_end(json);
}

void agent_json_integer(AgentJson *json, const char *key, int64_t value)
{
    before(json, key);
    g_string_append_printf(json->out, "%" G_GINT64_FORMAT, value);
}

void agent_json_bool(AgentJson *json, const char *key, bool value)
{
    before(json, key);
    g_string_append(json->out, value ? "true" : "false");
}

void agent_json_string(AgentJson *json, const char *key, const char *value)
{
    before(json, key);
    if (value)
        append_string(json->out, value);
    else
        g_string_append(json->out, "null");
}

char *agent_json_finish(AgentJson *json)
{
    g_assert(json->depth == 0);
    agent_json_end(json);
    g_string_append_c(json->out, '\n');
    char *text = g_string_free(json->out, false);
    json->out = NULL;
    return text;
}
