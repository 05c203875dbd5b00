/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/follow.h"

#include <math.h>

static void follow_state(AgentFollow *follow, const FbStatus *status, double at_s);
static void follow_run(AgentFollow *follow, const FbStatus *status);

static void clear_alarm(void *data)
{
    AgentFollowAlarm *alarm = data;
    g_free(alarm->text);
    g_free(alarm->advice);
}

void agent_follow_init(AgentFollow *follow, const AgentProgram *program)
{
    *follow = (AgentFollow){
        .program = program,
        .region_s = g_new0(double, program->n_regions + 1),
        .planned_region_s = g_new0(double, program->n_regions + 1),
        .states = g_array_new(false, false, sizeof(AgentFollowState)),
        .holds = g_array_new(false, false, sizeof(AgentFollowHold)),
        .alarms = g_array_new(false, false, sizeof(AgentFollowAlarm)),
    };
    g_array_set_clear_func(follow->alarms, clear_alarm);
    for (size_t i = 0; i < program->n_regions; i++)
        follow->planned_region_s[i] = program->regions[i].planned_s;
}

void agent_follow_clear(AgentFollow *follow)
{
    g_free(follow->region_s);
    g_free(follow->planned_region_s);
    g_array_unref(follow->states);
    g_array_unref(follow->holds);
    g_array_unref(follow->alarms);
    *follow = (AgentFollow){0};
}

void agent_follow_arm(AgentFollow *follow, const FbStatus *status)
{
    follow->armed = true;
    follow->epoch = status->epoch;
    follow->run_before = status->run;
    follow->blocks_before = status->executed_blocks;
}

void agent_follow_step(AgentFollow *follow, const FbStatus *status, double at_s)
{
    bool known = status->state != FB_STATE_UNKNOWN;
    if (known && follow->armed && status->epoch == follow->epoch &&
        status->run == follow->run_before + 1)
        follow_run(follow, status);
    follow_state(follow, status, at_s);
}

void agent_follow_begin(AgentFollow *follow, uint32_t line)
{
    const AgentProgram *program = follow->program;
    size_t first = agent_program_line(program, line);
    /* A line that does not move begins with the next one that does. */
    if (first == program->n_lines)
        first = 0;
    else if (program->lines[first].line < line && first + 1 < program->n_lines)
        first++;
    follow->line = line;
    if (program->n_lines == 0)
        return;
    follow->begin_s = follow->planned_s = program->lines[first].start_s;
    for (size_t i = 0; i < first; i++)
        follow->planned_region_s[program->lines[i].region] -=
            program->lines[i + 1].start_s - program->lines[i].start_s;
    for (size_t i = 0; i < program->n_regions; i++)
        follow->planned_region_s[i] = fmax(0, follow->planned_region_s[i]);
}

void agent_follow_join(AgentFollow *follow, const FbStatus *status)
{
    agent_follow_arm(follow, status);
    follow->run_before = status->run - 1;
    follow->time_before_s = status->program_time_ms * 1e-3;
    agent_follow_begin(follow, status->line);
}

double agent_follow_planned_s(const AgentFollow *follow)
{
    return follow->program->total_s - follow->begin_s;
}

double agent_follow_share(const AgentFollow *follow)
{
    double total = agent_follow_planned_s(follow);
    return total > 0 ? fmin(1, (follow->planned_s - follow->begin_s) / total) : 0;
}

/* ---------------------------------------------------------------------- states */

static bool stands(FbState state)
{
    return state == FB_STATE_HOLDING || state == FB_STATE_HELD;
}

static void follow_hold(AgentFollow *follow, FbState before, FbState now, double at_s)
{
    if (!stands(before) && stands(now)) {
        AgentFollowHold hold = {at_s, follow->line, NAN};
        g_array_append_val(follow->holds, hold);
    } else if (stands(before) && !stands(now) && follow->holds->len > 0) {
        AgentFollowHold *hold =
            &g_array_index(follow->holds, AgentFollowHold, follow->holds->len - 1);
        hold->duration_s = at_s - hold->at_s;
    }
}

static void follow_alarm(AgentFollow *follow, const FbStatus *status, double at_s)
{
    if (status->alarm_code == 0 || status->alarm_serial == follow->alarm_serial)
        return;
    AgentFollowAlarm alarm = {
        at_s,
        status->line,
        status->alarm_code,
        g_strndup(status->alarm_text, sizeof status->alarm_text),
        g_strndup(status->alarm_advice, sizeof status->alarm_advice),
    };
    g_array_append_val(follow->alarms, alarm);
    follow->alarm_serial = status->alarm_serial;
}

static void follow_state(AgentFollow *follow, const FbStatus *status, double at_s)
{
    if (status->state != FB_STATE_UNKNOWN)
        follow_alarm(follow, status, at_s);
    guint n = follow->states->len;
    if (n > 0 && g_array_index(follow->states, AgentFollowState, n - 1).state == status->state)
        return;
    AgentFollowState state = {status->state, at_s, status->line};
    g_array_append_val(follow->states, state);
    /* A hold does not end because nobody can see it. */
    if (status->state == FB_STATE_UNKNOWN)
        return;
    follow_hold(follow, follow->known, status->state, at_s);
    follow->known = status->state;
}

/* ---------------------------------------------------------------------- region */

/* Shares `elapsed_s` among the lines planned between `from_s` and `to_s`. */
static void share_out(AgentFollow *follow, size_t first, double from_s, double to_s,
                      double elapsed_s)
{
    const AgentProgram *program = follow->program;
    double scale = elapsed_s / (to_s - from_s);
    for (size_t i = first; i < program->n_lines && program->lines[i].start_s < to_s; i++) {
        double end_s = i + 1 < program->n_lines ? program->lines[i + 1].start_s : program->total_s;
        double part_s = fmin(end_s, to_s) - fmax(program->lines[i].start_s, from_s);
        if (part_s > 0)
            follow->region_s[program->lines[i].region] += part_s * scale;
    }
}

static void follow_run(AgentFollow *follow, const FbStatus *status)
{
    const AgentProgram *program = follow->program;
    double elapsed_s = status->program_time_ms * 1e-3 - follow->time_before_s - follow->actual_s;
    size_t from = agent_program_line(program, follow->line);
    bool complete = status->run_end == FB_RUN_COMPLETE;
    uint32_t line = MAX(status->line, follow->line);
    size_t to = agent_program_line(program, line);
    double planned_s = complete                ? program->total_s
                       : to < program->n_lines ? program->lines[to].start_s
                                               : 0;
    if (elapsed_s > 0 && planned_s > follow->planned_s)
        share_out(follow, from < program->n_lines ? from : 0, follow->planned_s, planned_s,
                  elapsed_s);
    else if (elapsed_s > 0 && program->n_lines > 0)
        follow->region_s[program->lines[to < program->n_lines ? to : 0].region] += elapsed_s;
    follow->actual_s += MAX(elapsed_s, 0);
    follow->planned_s = MAX(follow->planned_s, planned_s);
    follow->line = line;
    follow->blocks = status->executed_blocks - follow->blocks_before;
    follow->drip = status->drip;
    follow->starved = status->starved;
    follow->starved_s = status->starved_ms * 1e-3;
}
