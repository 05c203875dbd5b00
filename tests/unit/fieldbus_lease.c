/* SPDX-License-Identifier: Apache-2.0 */
/* Lease, heartbeats, loss of the agent, acknowledgement: docs/protocol.md, section 6. */
#include "tests/unit/fieldbus_rig.h"

static const int64_t SECOND = G_USEC_PER_SEC;

static FbAnswer lease(Rig *rig, uint32_t session, uint64_t token)
{
    static uint32_t seq = 1000;
    return rig_write_order(rig, &(FbOrder){.session = session,
                                           .seq = ++seq,
                                           .epoch = RIG_EPOCH,
                                           .token = token,
                                           .command = FB_COMMAND_LEASE});
}

/* Section 6.1: how the lease stands × who asks. */
static void lease_as_documented(void)
{
    static const int silent_s[] = {RIG_LEASE_S, RIG_AGENT_S, RIG_AGENT_S - 1};
    static const uint32_t session[] = {RIG_SESSION, 12, 13};
    static const uint64_t other[] = {0, 0, UINT64_C(1) << 33};
    g_autoptr(GPtrArray) rows = doc_table("### 6.1");
    g_assert_cmpuint(rows->len, ==, 4);
    for (guint i = 0; i < 3 && i + 1 < rows->len; i++)
        for (guint j = 0; j < 3; j++) {
            const char *cell = doc_cell(rows, i + 1, j + 1);
            Rig rig = rig_new();
            rig_lead(&rig, FB_STATE_READY);
            rig.now_us += silent_s[i] * SECOND;
            const FbAnswer answer = lease(&rig, session[j], RIG_TOKEN + other[j]);
            g_test_message("%s / %s: %s", doc_cell(rows, i + 1, 0), doc_cell(rows, 0, j + 1), cell);
            g_assert_cmpstr(fb_answer_name(answer), ==,
                            strcmp(cell, "NO_LEASE") == 0 ? "NO_LEASE" : "DONE");
            const FbStatus s = rig_status(&rig);
            const uint64_t owner = answer == FB_ANSWER_DONE ? RIG_TOKEN + other[j] : RIG_TOKEN;
            g_assert_cmpuint(s.lease_owner, ==, owner >> 32);
            if (answer == FB_ANSWER_DONE)
                g_assert_cmpuint(s.lease_ms, ==, RIG_LEASE_S * 1000);
            rig_free(&rig);
        }
}

static void timers_as_documented(void)
{
    static const char *const timers[] = {"agent_timeout", "lease_timeout", "heartbeat",
                                         "reply_timeout", "reconnect",     "give_up"};
    g_autoptr(GPtrArray) rows = doc_table("### 6.2");
    for (guint i = 0; i < G_N_ELEMENTS(timers); i++)
        g_assert_cmpstr(doc_cell(rows, i + 1, 0), ==, timers[i]);
    g_autoptr(CfgAgent) agent = cfg_agent_default(NULL);
    const double ours[] = {
        0, 0, agent->heartbeat_s, agent->reply_timeout_s, agent->reconnect_s, agent->give_up_s};
    for (guint i = 2; i < G_N_ELEMENTS(timers); i++)
        test_near(g_ascii_strtod(doc_cell(rows, i + 1, 2), NULL), ours[i], 1e-9, 0);
}

static void zero_owner(void)
{
    Rig rig = rig_new();
    g_assert_cmpstr(fb_answer_name(lease(&rig, 1, 5)), ==, "MALFORMED");
    g_assert_cmpuint(rig_status(&rig).lease_owner, ==, 0);
    g_assert_cmpstr(fb_answer_name(rig_beat(&rig)), ==, "NO_LEASE");
    rig_free(&rig);
}

/* The beats of the owner keep it; those of others, and chunks, do not. */
static void beats_keep_the_lease(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_RUNNING);
    for (int i = 0; i < 100; i++) {
        rig.now_us += (RIG_AGENT_S - 1) * SECOND;
        g_assert_cmpstr(fb_answer_name(rig_beat(&rig)), ==, "DONE");
        fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    }
    g_assert_false(rig_status(&rig).agent_lost);
    g_assert_cmpuint(rig.actions->len, ==, 0);
    uint8_t block[FB_BLOCK_BYTES];
    const FbBeat foreign = {.session = 12, .token = RIG_TOKEN};
    rig.now_us += (RIG_AGENT_S - 1) * SECOND;
    fb_receiver_write(rig.receiver, FB_ROLE_PROGRAMMER, FB_BLOCK_BEAT, block,
                      fb_wire_put_beat(block, &foreign), rig.now_us, rig.actions);
    rig.now_us += SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    g_assert_true(rig_status(&rig).agent_lost);
    rig_free(&rig);
}

/* A command that was on its way for long says nothing of who sent it. */
static void late_commands_keep_nothing(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_RUNNING);
    FbOrder old = rig.last;
    old.seq--;
    rig.now_us += (RIG_AGENT_S - 1) * SECOND;
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &old)), ==, "OUT_OF_SEQUENCE");
    rig.now_us += SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    g_assert_true(rig_status(&rig).agent_lost);
    rig_free(&rig);
}

/* tick() says when it wants to be called; that is when the agent is lost and the lease lapses. */
static void tick_says_when(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_RUNNING);
    const int64_t began_us = rig.now_us;
    int64_t lost_us = 0, lapsed_us = 0;
    uint32_t heartbeat = rig_status(&rig).heartbeat;
    while (lapsed_us == 0 && rig.now_us < began_us + 60 * SECOND) {
        const int64_t next_us = fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
        const FbStatus s = rig_status(&rig);
        if (s.agent_lost && lost_us == 0)
            lost_us = rig.now_us;
        if (s.lease_owner == 0)
            lapsed_us = rig.now_us;
        g_assert_cmpint(next_us, >, rig.now_us);
        g_assert_cmpint(next_us, <=, rig.now_us + SECOND);
        rig.now_us = next_us;
    }
    g_assert_cmpint(lost_us - began_us, ==, RIG_AGENT_S * SECOND);
    g_assert_cmpint(lapsed_us - began_us, ==, RIG_LEASE_S * SECOND);
    g_assert_cmpuint(rig_status(&rig).heartbeat, >=, heartbeat + RIG_LEASE_S);
    g_assert_true(rig_did(&rig, FB_DO_HOLD_AT_GATE));
    rig_free(&rig);
}

typedef struct {
    CfgAgentLoss loss;
    FbState in, then;
    int act; /* -1: none */
} LossCase;

static void agent_loss(void)
{
    static const LossCase cases[] = {
        {CFG_AGENT_LOSS_NEXT_GATE, FB_STATE_RUNNING, FB_STATE_RUNNING, FB_DO_HOLD_AT_GATE},
        {CFG_AGENT_LOSS_NEXT_GATE, FB_STATE_TOOL_CHANGE, FB_STATE_TOOL_CHANGE, FB_DO_HOLD_AT_GATE},
        {CFG_AGENT_LOSS_NEXT_GATE, FB_STATE_HELD, FB_STATE_HELD, -1},
        {CFG_AGENT_LOSS_NEXT_GATE, FB_STATE_READY, FB_STATE_READY, -1},
        {CFG_AGENT_LOSS_HOLD, FB_STATE_RUNNING, FB_STATE_HOLDING, FB_DO_HOLD},
        {CFG_AGENT_LOSS_HOLD, FB_STATE_TOOL_CHANGE, FB_STATE_HOLDING, FB_DO_HOLD},
        {CFG_AGENT_LOSS_HOLD, FB_STATE_PROGRAM_STOP, FB_STATE_PROGRAM_STOP, -1},
        {CFG_AGENT_LOSS_FINISH, FB_STATE_RUNNING, FB_STATE_RUNNING, -1},
        {CFG_AGENT_LOSS_FINISH, FB_STATE_LOADING, FB_STATE_LOADING, -1},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Rig rig = rig_new_with(cases[i].loss);
        rig_lead(&rig, cases[i].in);
        rig.now_us += RIG_AGENT_S * SECOND;
        fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
        fb_receiver_tick(rig.receiver, rig.now_us + 1, rig.actions);
        const FbStatus s = rig_status(&rig);
        g_assert_cmpstr(fb_state_name(s.state), ==, fb_state_name(cases[i].then));
        g_assert_true(s.agent_lost);
        g_assert_true(s.needs_acknowledge);
        if (cases[i].act < 0)
            g_assert_cmpuint(rig.actions->len, ==, 0);
        else
            g_assert_true(rig_did(&rig, (FbDo)cases[i].act));
        g_assert_cmpstr(fb_answer_name(rig_beat(&rig)), ==, "DONE");
        g_assert_false(rig_status(&rig).agent_lost);
        rig_free(&rig);
    }
}

/* After each of these START (or RESUME) is refused until a person acknowledged at the machine. */
static void must_be_acknowledged(Rig *rig, FbCommand command)
{
    g_array_set_size(rig->actions, 0);
    g_assert_cmpstr(fb_answer_name(rig_order(rig, command)), ==, "NEEDS_ACKNOWLEDGE");
    g_assert_cmpstr(fb_answer_name(rig_order(rig, command)), ==, "NEEDS_ACKNOWLEDGE");
    g_assert_cmpuint(rig->actions->len, ==, 0);
    rig_machine(rig, FB_MACHINE_ACKNOWLEDGED);
    g_assert_cmpstr(fb_answer_name(rig_order(rig, command)), ==, "DONE");
    g_assert_cmpstr(fb_state_name(rig_status(rig).state), ==, "RUNNING");
}

static void link_loss_needs_acknowledge(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    rig.now_us += RIG_AGENT_S * SECOND;
    must_be_acknowledged(&rig, FB_COMMAND_START);
    rig_free(&rig);

    rig = rig_new_with(CFG_AGENT_LOSS_HOLD);
    rig_lead(&rig, FB_STATE_RUNNING);
    rig.now_us += RIG_AGENT_S * SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    rig_machine(&rig, FB_MACHINE_HELD);
    must_be_acknowledged(&rig, FB_COMMAND_RESUME);
    /* Nobody beats behind the RESUME: lost again. */
    g_assert_false(rig_status(&rig).agent_lost);
    g_array_set_size(rig.actions, 0);
    rig.now_us += RIG_AGENT_S * SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    g_assert_true(rig_did(&rig, FB_DO_HOLD));
    g_assert_true(rig_status(&rig).needs_acknowledge);
    rig_free(&rig);
}

/* From a session that does not have the lease, but the token, the same. */
static void resumed_by_another_process(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_HELD);
    rig.now_us += RIG_AGENT_S * SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    rig_machine(&rig, FB_MACHINE_ACKNOWLEDGED);
    const FbOrder resume = {.session = 12,
                            .seq = 1,
                            .epoch = RIG_EPOCH,
                            .transfer = rig.transfer,
                            .token = RIG_TOKEN,
                            .command = FB_COMMAND_RESUME};
    g_assert_cmpstr(fb_answer_name(rig_write_order(&rig, &resume)), ==, "DONE");
    g_array_set_size(rig.actions, 0);
    rig.now_us += RIG_AGENT_S * SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    g_assert_true(rig_did(&rig, FB_DO_HOLD_AT_GATE));
    rig_free(&rig);
}

/* Lost while the machine still examines the program. */
static void lost_while_verifying(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_VERIFYING);
    rig.now_us += RIG_AGENT_S * SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    rig_machine(&rig, FB_MACHINE_VERIFIED);
    must_be_acknowledged(&rig, FB_COMMAND_START);
    rig_free(&rig);
}

static void restarted_agent_needs_acknowledge(void)
{
    Rig rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    g_assert_cmpstr(fb_answer_name(lease(&rig, 12, RIG_TOKEN)), ==, "NO_LEASE");
    rig.now_us += RIG_AGENT_S * SECOND;
    g_assert_cmpstr(fb_answer_name(lease(&rig, 12, RIG_TOKEN)), ==, "DONE");
    must_be_acknowledged(&rig, FB_COMMAND_START);
    rig_free(&rig);

    /* Released in good order it is no restart. */
    rig = rig_new();
    rig_lead(&rig, FB_STATE_READY);
    rig_order(&rig, FB_COMMAND_RELEASE);
    rig.now_us += 100 * RIG_LEASE_S * SECOND;
    fb_receiver_tick(rig.receiver, rig.now_us, rig.actions);
    g_assert_cmpstr(fb_answer_name(lease(&rig, 12, RIG_TOKEN)), ==, "DONE");
    g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "DONE");
    rig_free(&rig);
}

static void alarm_needs_acknowledge(void)
{
    static const FbMachineEvent events[] = {FB_MACHINE_ALARM, FB_MACHINE_ESTOP};
    for (size_t i = 0; i < G_N_ELEMENTS(events); i++) {
        Rig rig = rig_new();
        rig_lead(&rig, FB_STATE_RUNNING);
        rig_machine(&rig, events[i]);
        FbStatus s = rig_status(&rig);
        g_assert_cmpint(s.run_end, ==, FB_RUN_ALARM);
        g_assert_true(s.needs_acknowledge);
        g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "WRONG_STATE");
        rig_machine(&rig, FB_MACHINE_ACKNOWLEDGED);
        s = rig_status(&rig);
        g_assert_cmpstr(fb_state_name(s.state), ==, "READY");
        g_assert_false(s.needs_acknowledge);
        g_assert_cmpint(s.run_end, ==, FB_RUN_ALARM);
        g_assert_cmpstr(fb_answer_name(rig_order(&rig, FB_COMMAND_START)), ==, "DONE");
        s = rig_status(&rig);
        g_assert_cmpint(s.run_end, ==, FB_RUN_NONE);
        g_assert_cmpint(s.run, ==, 2);
        rig_free(&rig);
    }
}

static void add(void)
{
    g_test_add_func("/fieldbus/lease/as-documented", lease_as_documented);
    g_test_add_func("/fieldbus/lease/timers-as-documented", timers_as_documented);
    g_test_add_func("/fieldbus/lease/zero-owner", zero_owner);
    g_test_add_func("/fieldbus/lease/beats-keep-it", beats_keep_the_lease);
    g_test_add_func("/fieldbus/lease/late-commands-keep-nothing", late_commands_keep_nothing);
    g_test_add_func("/fieldbus/lease/tick-says-when", tick_says_when);
    g_test_add_func("/fieldbus/lease/agent-loss", agent_loss);
    g_test_add_func("/fieldbus/lease/link-loss-needs-acknowledge", link_loss_needs_acknowledge);
    g_test_add_func("/fieldbus/lease/resumed-by-another-process", resumed_by_another_process);
    g_test_add_func("/fieldbus/lease/lost-while-verifying", lost_while_verifying);
    g_test_add_func("/fieldbus/lease/restarted-agent", restarted_agent_needs_acknowledge);
    g_test_add_func("/fieldbus/lease/alarm-needs-acknowledge", alarm_needs_acknowledge);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
