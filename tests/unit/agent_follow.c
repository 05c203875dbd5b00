/* SPDX-License-Identifier: Apache-2.0 */
/* The record of a run from made-up statuses, and its run.json. */
#include <json-glib/json-glib.h>
#include <math.h>
#include <string.h>

#include "agent/follow.h"
#include "agent/out/run_json.h"
#include "tests/lib/test.h"

/* Lines 1 to 100: region 0 on lines 1 and 2 (1 s each), region 7 on 3 to 52 (2 s each), region 4 on
 * 53 to 100 (1 s each): 2 + 100 + 48 s. */
static AgentProgram *program(void)
{
    AgentProgram *p = g_new0(AgentProgram, 1);
    static const AgentProgramRegion regions[] = {{0, 2}, {7, 100}, {4, 48}};
    p->regions = g_memdup2(regions, sizeof regions);
    p->n_regions = 3;
    p->n_lines = 100;
    p->lines = g_new0(AgentProgramLine, 100);
    for (size_t i = 0; i < 100; i++) {
        size_t region = i < 2 ? 0 : i < 52 ? 1 : 2;
        p->lines[i] = (AgentProgramLine){(uint32_t)i + 1, p->total_s, region};
        p->total_s += region == 1 ? 2 : 1;
    }
    return p;
}

static FbStatus running(uint32_t line, double time_s)
{
    return (FbStatus){.state = FB_STATE_RUNNING,
                      .epoch = 9,
                      .run = 4,
                      .line = line,
                      .executed_blocks = 1000 + line,
                      .program_time_ms = (uint32_t)(time_s * 1000)};
}

static AgentFollow armed(const AgentProgram *p)
{
    AgentFollow follow;
    agent_follow_init(&follow, p);
    FbStatus ready = {.state = FB_STATE_READY,
                      .epoch = 9,
                      .run = 3,
                      .executed_blocks = 1000,
                      .program_time_ms = 777000};
    agent_follow_step(&follow, &ready, 0.5);
    agent_follow_arm(&follow, &ready);
    return follow;
}

static void line_search(void)
{
    g_autoptr(AgentProgram) p = program();
    g_assert_cmpuint(agent_program_line(p, 0), ==, p->n_lines);
    for (uint32_t line = 1; line <= 100; line++)
        g_assert_cmpuint(agent_program_line(p, line), ==, line - 1);
    g_assert_cmpuint(agent_program_line(p, 5000), ==, 99);
}

/* A machine that takes twice the planned time, seen at few places: the sum is exact and each region
 * has twice its plan. */
static void shares(void)
{
    g_autoptr(AgentProgram) p = program();
    AgentFollow follow = armed(p);
    static const uint32_t lines[] = {1, 20, 60, 90};
    for (size_t i = 0; i < G_N_ELEMENTS(lines); i++) {
        FbStatus status = running(lines[i], 2 * p->lines[lines[i] - 1].start_s);
        agent_follow_step(&follow, &status, 1 + (double)i);
    }
    test_near(agent_follow_share(&follow), p->lines[89].start_s / 150, 1e-12, 0);
    FbStatus complete = running(0, 300);
    complete.state = FB_STATE_COMPLETE;
    complete.run_end = FB_RUN_COMPLETE;
    complete.executed_blocks = 1100;
    agent_follow_step(&follow, &complete, 9);
    test_near(follow.actual_s, 300, 1e-9, 0);
    test_near(follow.region_s[0], 4, 1e-9, 0);
    test_near(follow.region_s[1], 200, 1e-9, 0);
    test_near(follow.region_s[2], 96, 1e-9, 0);
    test_near(agent_follow_share(&follow), 1, 0, 0);
    g_assert_cmpuint(follow.blocks, ==, 100);
    agent_follow_clear(&follow);
}

/* A dwell on one line belongs to that line's region; a run too short for samples is shared out. */
static void corners(void)
{
    g_autoptr(AgentProgram) p = program();
    AgentFollow follow = armed(p);
    FbStatus status = running(60, 110);
    agent_follow_step(&follow, &status, 1);
    double before = follow.region_s[2];
    status = running(60, 130);
    agent_follow_step(&follow, &status, 2);
    test_near(follow.region_s[2], before + 20, 1e-9, 0);
    agent_follow_clear(&follow);

    follow = armed(p);
    FbStatus complete = running(0, 75);
    complete.state = FB_STATE_COMPLETE;
    complete.run_end = FB_RUN_COMPLETE;
    agent_follow_step(&follow, &complete, 1);
    test_near(follow.region_s[1], 50, 1e-9, 0);
    test_near(follow.region_s[0] + follow.region_s[1] + follow.region_s[2], 75, 1e-9, 0);
    agent_follow_clear(&follow);
}

/* Statuses of another run, of another epoch, or from a lost link do not count. */
static void foreign(void)
{
    g_autoptr(AgentProgram) p = program();
    AgentFollow follow = armed(p);
    FbStatus other_run = running(50, 60), other_epoch = running(50, 60), lost = running(50, 60);
    other_run.run = 3;
    other_epoch.epoch = 10;
    lost.state = FB_STATE_UNKNOWN;
    agent_follow_step(&follow, &other_run, 1);
    agent_follow_step(&follow, &other_epoch, 2);
    agent_follow_step(&follow, &lost, 3);
    g_assert_cmpfloat(follow.actual_s, ==, 0);
    g_assert_cmpuint(follow.line, ==, 0);
    agent_follow_clear(&follow);
}

static AgentFollow held_and_alarmed(const AgentProgram *p)
{
    AgentFollow follow = armed(p);
    static const struct {
        FbState state;
        double at_s;
    } seen[] = {{FB_STATE_RUNNING, 1}, {FB_STATE_HOLDING, 2}, {FB_STATE_UNKNOWN, 2.2},
                {FB_STATE_HELD, 2.5},  {FB_STATE_RUNNING, 6}, {FB_STATE_UNKNOWN, 7},
                {FB_STATE_RUNNING, 8}, {FB_STATE_HELD, 9}};
    for (size_t i = 0; i < G_N_ELEMENTS(seen); i++) {
        FbStatus status = running(10, 12);
        status.state = seen[i].state;
        agent_follow_step(&follow, &status, seen[i].at_s);
    }
    FbStatus alarm = running(10, 12);
    alarm.state = FB_STATE_ALARM;
    alarm.alarm_code = 17;
    alarm.alarm_serial = 5;
    strcpy(alarm.alarm_text, "spindle \"stalled\"");
    memset(alarm.alarm_advice, 'x', sizeof alarm.alarm_advice);
    agent_follow_step(&follow, &alarm, 10);
    agent_follow_step(&follow, &alarm, 11);
    return follow;
}

static void states_holds_alarms(void)
{
    g_autoptr(AgentProgram) p = program();
    AgentFollow follow = held_and_alarmed(p);
    g_assert_cmpuint(follow.states->len, ==, 10);
    g_assert_cmpuint(follow.holds->len, ==, 2);
    g_assert_cmpuint(follow.alarms->len, ==, 1);
    if (follow.holds->len == 2) {
        test_near(g_array_index(follow.holds, AgentFollowHold, 0).at_s, 2, 0, 0);
        test_near(g_array_index(follow.holds, AgentFollowHold, 0).duration_s, 4, 1e-12, 0);
    }
    if (follow.alarms->len == 1) {
        const AgentFollowAlarm *alarm = &g_array_index(follow.alarms, AgentFollowAlarm, 0);
        g_assert_cmpint(alarm->code, ==, 17);
        g_assert_cmpuint(strlen(alarm->advice), ==, FB_TEXT_BYTES);
    }
    agent_follow_clear(&follow);
}

static void run_json(void)
{
    g_autoptr(AgentProgram) p = program();
    AgentFollow follow = held_and_alarmed(p);
    g_autoptr(GError) ended = g_error_new_literal(FB_ERROR, FB_ERROR_ALARM, "17: spindle");
    AgentRunReport report = {.program_sha256 = "00",
                             .machine = "sim",
                             .started = "now",
                             .error = ended,
                             .follow = &follow};
    g_autofree char *text = agent_run_json(&report);
    g_autoptr(JsonParser) parser = json_parser_new();
    g_autoptr(GError) error = NULL;
    g_assert_true(json_parser_load_from_data(parser, text, -1, &error));
    g_assert_no_error(error);
    JsonObject *root = json_node_get_object(json_parser_get_root(parser));
    g_assert_cmpstr(json_object_get_string_member(root, "outcome"), ==, "alarm");
    g_assert_cmpstr(json_object_get_string_member(root, "message"), ==, "17: spindle");
    JsonArray *regions = json_object_get_array_member(root, "regions");
    g_assert_cmpuint(json_array_get_length(regions), ==, 2);
    JsonObject *alarm =
        json_array_get_object_element(json_object_get_array_member(root, "alarms"), 0);
    g_assert_cmpstr(json_object_get_string_member(alarm, "text"), ==, "spindle \"stalled\"");
    agent_follow_clear(&follow);
}

static void outcomes(void)
{
    g_assert_cmpstr(agent_run_outcome(NULL), ==, "complete");
    g_autoptr(GError) lost = g_error_new_literal(FB_ERROR, FB_ERROR_LINK_LOST, "");
    g_assert_cmpstr(agent_run_outcome(lost), ==, "link-lost");
    g_autoptr(GError) strange = g_error_new_literal(CFG_ERROR, CFG_ERROR_IO, "");
    g_assert_cmpstr(agent_run_outcome(strange), ==, "failed");
}

static void add(void)
{
    g_test_add_func("/agent/follow/line-search", line_search);
    g_test_add_func("/agent/follow/shares", shares);
    g_test_add_func("/agent/follow/corners", corners);
    g_test_add_func("/agent/follow/foreign", foreign);
    g_test_add_func("/agent/follow/states-holds-alarms", states_holds_alarms);
    g_test_add_func("/agent/follow/run-json", run_json);
    g_test_add_func("/agent/follow/outcomes", outcomes);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
