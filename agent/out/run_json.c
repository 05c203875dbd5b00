/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/out/run_json.h"

#include <stdio.h>
#include <string.h>

#include "agent/out/file.h"
#include "agent/preflight.h"

static void write_states(AgentJson *json, const AgentFollow *follow);
static void write_regions(AgentJson *json, const AgentFollow *follow);
static void write_alarms(AgentJson *json, const AgentFollow *follow);
static void write_holds(AgentJson *json, const AgentFollow *follow);

const char *agent_run_outcome(const GError *error)
{
    static const char *const names[] = {
        [FB_ERROR_UNREACHABLE] = "unreachable", [FB_ERROR_PROTOCOL] = "failed",
        [FB_ERROR_REFUSED] = "refused",         [FB_ERROR_ALARM] = "alarm",
        [FB_ERROR_LINK_LOST] = "link-lost",     [FB_ERROR_ABORTED] = "aborted",
    };
    if (!error)
        return "complete";
    if (g_error_matches(error, AGENT_ERROR, AGENT_ERROR_CAUTION))
        return "blocked";
    bool ours =
        error->domain == FB_ERROR && error->code >= 0 && error->code < (int)G_N_ELEMENTS(names);
    return ours ? names[error->code] : "failed";
}

void agent_run_begin(AgentRunReport *report)
{
    g_autoptr(GDateTime) now = g_date_time_new_now_utc();
    report->started = g_date_time_format_iso8601(now);
}

void agent_run_end(AgentRunReport *report)
{
    g_clear_pointer(&report->started, g_free);
}

bool agent_run_write(const AgentRunReport *report, const char *folder, GError **error)
{
    g_autofree char *text = agent_run_json(report);
    return agent_file_folder(folder, error) &&
           agent_file_write(folder, "run.json", text, strlen(text), error);
}

void agent_run_describe(const AgentRunReport *report, AgentJson *result, bool json)
{
    const AgentFollow *follow = report->follow;
    double planned_s = agent_follow_planned_s(follow);
    agent_json_string(result, "outcome", agent_run_outcome(NULL));
    agent_json_integer(result, "blocks", (int64_t)follow->blocks);
    agent_json_number(result, "planned_s", planned_s);
    agent_json_number(result, "actual_s", follow->actual_s);
    if (!json)
        printf("done: %.1f s machine time (planned %.1f s), %" G_GUINT64_FORMAT " blocks\n",
               follow->actual_s, planned_s, follow->blocks);
    if (!json && follow->starved > 0)
        printf("it waited %u times at gates for more of the program, %.1f s in all\n",
               follow->starved, follow->starved_s);
}

char *agent_run_json(const AgentRunReport *report)
{
    const AgentFollow *follow = report->follow;
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_string(json, "program_sha256", report->program_sha256);
    agent_json_string(json, "machine", report->machine);
    agent_json_string(json, "started", report->started);
    agent_json_string(json, "outcome", agent_run_outcome(report->error));
    agent_json_string(json, "message", report->error ? report->error->message : NULL);
    agent_json_integer(json, "gate", report->gate);
    agent_preflight_write(report->findings, json);
    write_states(json, follow);
    agent_json_integer(json, "blocks", (int64_t)follow->blocks);
    agent_json_integer(json, "line", follow->line);
    agent_json_number(json, "planned_s", agent_follow_planned_s(follow));
    agent_json_number(json, "actual_s", follow->actual_s);
    agent_json_bool(json, "drip", follow->drip);
    agent_json_integer(json, "starved", follow->starved);
    agent_json_number(json, "starved_s", follow->starved_s);
    write_regions(json, follow);
    write_alarms(json, follow);
    write_holds(json, follow);
    return agent_json_finish(json);
}

static void write_states(AgentJson *json, const AgentFollow *follow)
{
    agent_json_array(json, "states");
    for (guint i = 0; i < follow->states->len; i++) {
        const AgentFollowState *state = &g_array_index(follow->states, AgentFollowState, i);
        agent_json_object(json, NULL);
        agent_json_string(json, "state", fb_state_name(state->state));
        agent_json_number(json, "at_s", state->at_s);
        agent_json_integer(json, "line", state->line);
        agent_json_end(json);
    }
    agent_json_end(json);
}

static void write_regions(AgentJson *json, const AgentFollow *follow)
{
    agent_json_array(json, "regions");
    for (size_t i = 0; i < follow->program->n_regions; i++) {
        const AgentProgramRegion *region = &follow->program->regions[i];
        if (region->id == 0)
            continue;
        agent_json_object(json, NULL);
        agent_json_integer(json, "id", region->id);
        agent_json_number(json, "planned_s", follow->planned_region_s[i]);
        agent_json_number(json, "actual_s", follow->region_s[i]);
        agent_json_end(json);
    }
    agent_json_end(json);
}

static void write_alarms(AgentJson *json, const AgentFollow *follow)
{
    agent_json_array(json, "alarms");
    for (guint i = 0; i < follow->alarms->len; i++) {
        const AgentFollowAlarm *alarm = &g_array_index(follow->alarms, AgentFollowAlarm, i);
        agent_json_object(json, NULL);
        agent_json_integer(json, "code", alarm->code);
        agent_json_string(json, "text", alarm->text);
        agent_json_string(json, "advice", alarm->advice);
        agent_json_number(json, "at_s", alarm->at_s);
        agent_json_integer(json, "line", alarm->line);
        agent_json_end(json);
    }
    agent_json_end(json);
}

static void write_holds(AgentJson *json, const AgentFollow *follow)
{
    agent_json_array(json, "holds");
    for (guint i = 0; i < follow->holds->len; i++) {
        const AgentFollowHold *hold = &g_array_index(follow->holds, AgentFollowHold, i);
        agent_json_object(json, NULL);
        agent_json_number(json, "at_s", hold->at_s);
        agent_json_integer(json, "line", hold->line);
        agent_json_number(json, "duration_s", hold->duration_s);
        agent_json_end(json);
    }
    agent_json_end(json);
}
