/* SPDX-License-Identifier: Apache-2.0 */
/* Both sides of the delivery over a CAN bus: docs/protocol.md, section 9. */
#include <errno.h>

#include "tests/unit/fieldbus_hub.h"

static void assert_state(const CanCell *c, const char *state)
{
    g_assert_cmpstr(fb_state_name(fb_receiver_state(c->cell.receiver)), ==, state);
}

static void delivers_and_runs(bool machine_fd, bool agent_fd)
{
    CanCell c;
    open_can(&c, machine_fd);
    FbCanBus bus = hub_bus(&c.hub);
    if (!agent_fd)
        bus.has_fd = hub_has_no_fd;
    c.cell.session = new_can_session(&c, bus, &KEY, 1, 1);
    g_autoptr(GBytes) p = program(100001);
    can_deliver(&c, p);
    g_assert_no_error(c.cell.error);
    assert_state(&c, "READY");
    g_assert_cmpint(c.cell.starts, ==, 0);
    fb_session_start(c.cell.session);
    g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_RUN], 1));
    g_assert_no_error(c.cell.error);
    g_assert_cmpint(c.cell.starts, ==, 1);
    g_assert_true(c.cell.executed && g_bytes_equal(c.cell.executed, p));

    unsigned chunks = 0, fd = 0;
    for (guint i = 0; i < c.hub.log->len; i++) {
        const Sent *sent = c.hub.log->pdata[i];
        if (sent->frame)
            continue;
        const bool opening = sent->bytes[0] == FB_CAN_HELLO || sent->bytes[0] == FB_CAN_WELCOME;
        g_assert_true(sent->fd == (machine_fd && agent_fd && !opening));
        g_assert_cmpuint(sent->n, <=, FB_CAN_MESSAGE_BYTES);
        chunks += sent->bytes[0] == FB_CAN_CHUNK;
        fd += sent->fd;
    }
    g_assert_true((fd > 0) == (machine_fd && agent_fd));
    g_assert_cmpuint(chunks, ==, (g_bytes_get_size(p) + 8 + 4049) / 4050);
    const FbCanCounts counts = fb_can_server_counts(c.server);
    g_assert_cmpuint(counts.hellos, ==, 2);
    g_assert_cmpuint(counts.openings, ==, 2);
    g_assert_cmpuint(counts.forged + counts.replayed + counts.malformed + counts.torn, ==, 0);
    close_can(&c);
}

static void classic(void)
{
    delivers_and_runs(false, false);
}

static void flexible(void)
{
    delivers_and_runs(true, true);
}

static void flexible_machine_only(void)
{
    delivers_and_runs(true, false);
}

static void hold_resume_abort(void)
{
    CanCell c;
    open_can(&c, true);
    c.cell.slow = true;
    open_can_session(&c);
    g_autoptr(GBytes) p = program(5000);
    can_deliver(&c, p);
    fb_session_start(c.cell.session);
    g_assert_true(run_until(&c.cell, &c.cell.starts, 1));
    for (int i = 0; i < 3; i++) {
        fb_session_command(c.cell.session, FB_COMMAND_HOLD, NULL);
        g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_COMMAND], 2 * i + 1));
        g_assert_no_error(c.cell.error);
        assert_state(&c, "HELD");
        const Sent *stop = hub_last(&c.hub, STOP_ID);
        g_assert_true(stop && stop->frame && stop->n == 8 && stop->bytes[0] == FB_COMMAND_HOLD);
        fb_session_command(c.cell.session, FB_COMMAND_RESUME, NULL);
        g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_COMMAND], 2 * i + 2));
        g_assert_no_error(c.cell.error);
        assert_state(&c, "RUNNING");
    }
    g_assert_cmpint(c.cell.holds, ==, 3);
    fb_session_command(c.cell.session, FB_COMMAND_ABORT, NULL);
    g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_RUN], 1));
    g_assert_error(c.cell.error, FB_ERROR, FB_ERROR_ABORTED);
    const Sent *stop = hub_last(&c.hub, STOP_ID);
    g_assert_true(stop && stop->bytes[0] == FB_COMMAND_ABORT);
    close_can(&c);
}

static void setup_is_read(void)
{
    CanCell c;
    FbSetup setup = {.n_tools = FB_TOOLS_MOST, .work_offset = 54};
    for (int i = 0; i < FB_TOOLS_MOST; i++)
        setup.tools[i] = (FbTool){i + 1, CFG_TOOL_BALL, 6, 3, 100 + i};
    open_can(&c, false);
    fb_receiver_set_setup(c.cell.receiver, &setup);
    open_can_session(&c);
    fb_session_read_setup(c.cell.session);
    g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_SETUP], 1));
    g_assert_no_error(c.cell.error);
    const FbSetup *read = fb_session_setup(c.cell.session);
    g_assert_true(read && read->n_tools == FB_TOOLS_MOST && read->tools[59].length_mm == 159);
    close_can(&c);
}

/* --------------------------------------------------------------------- what breaks */

typedef struct {
    uint16_t id;
    int left;  /* so many of them are lost, */
    int after; /* after so many */
} Loss;

static bool loses(const Sent *sent, void *data)
{
    Loss *loss = data;
    if (sent->id != loss->id || loss->left == 0 || loss->after-- > 0)
        return false;
    loss->left--;
    return true;
}

/* Delivers and runs; false where there were fewer messages than the loss waits for. */
static bool survives(Loss *loss, GBytes *p, bool fd)
{
    CanCell c;
    open_can(&c, fd);
    c.hub.loses = loses;
    c.hub.data = loss;
    c.cell.session = new_can_session(&c, hub_bus(&c.hub), &KEY, 0, 0.1);
    can_deliver(&c, p);
    g_assert_no_error(c.cell.error);
    fb_session_start(c.cell.session);
    g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_RUN], 1));
    g_assert_no_error(c.cell.error);
    g_assert_cmpint(c.cell.starts, ==, 1);
    g_assert_true(c.cell.executed && g_bytes_equal(c.cell.executed, p));
    close_can(&c);
    return loss->left == 0;
}

/* Each message of a delivery and its run is lost once: HELLO, WELCOME, requests, answers. */
static void a_lost_message(void)
{
    static const uint16_t ids[] = {WORK_ID, WORK_ID + ANSWER};
    g_autoptr(GBytes) p = program(9000);
    for (size_t i = 0; i < G_N_ELEMENTS(ids); i++) {
        int after = 0;
        while (survives(&(Loss){ids[i], 1, after}, p, after % 2))
            after++;
        g_test_message("%d messages on %x, each lost once", after, ids[i]);
        g_assert_cmpint(after, >=, 9);
    }
}

/* A STOP or its answer that is lost: the channel is opened again, and the hold is done once. */
static void a_lost_stop(void)
{
    static const uint16_t ids[] = {STOP_ID, CONTROL_ID + ANSWER};
    for (size_t i = 0; i < G_N_ELEMENTS(ids); i++) {
        CanCell c;
        open_can(&c, false);
        c.cell.slow = true;
        c.cell.session = new_can_session(&c, hub_bus(&c.hub), &KEY, 0, 0.3);
        g_autoptr(GBytes) p = program(500);
        can_deliver(&c, p);
        fb_session_start(c.cell.session);
        g_assert_true(run_until(&c.cell, &c.cell.starts, 1));
        Loss loss = {ids[i], 1, 0};
        c.hub.loses = loses;
        c.hub.data = &loss;
        fb_session_command(c.cell.session, FB_COMMAND_HOLD, NULL);
        g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_COMMAND], 1));
        g_assert_no_error(c.cell.error);
        g_assert_cmpint(loss.left, ==, 0);
        g_assert_cmpint(c.cell.holds, ==, 1);
        assert_state(&c, "HELD");
        close_can(&c);
    }
}

static void until_state(CanCell *c, FbState state)
{
    const int64_t end_us = g_get_monotonic_time() + 5 * G_USEC_PER_SEC;
    while (fb_session_status(c->cell.session)->state != state && g_get_monotonic_time() < end_us)
        g_main_context_iteration(c->cell.context, FALSE);
    g_assert_cmpstr(fb_state_name(fb_session_status(c->cell.session)->state), ==,
                    fb_state_name(state));
}

/* Off while a program runs: UNKNOWN on the agent's side, an agent lost on the machine's; then both
 * open the bus again, and the run is followed to its end. */
static void bus_off(void)
{
    CanCell c;
    open_can(&c, false);
    c.cell.slow = true;
    c.cell.session = new_can_session(&c, hub_bus(&c.hub), &KEY, 0, 0.1);
    g_autoptr(GBytes) p = program(500);
    can_deliver(&c, p);
    fb_session_start(c.cell.session);
    g_assert_true(run_until(&c.cell, &c.cell.starts, 1));
    until_state(&c, FB_STATE_RUNNING);
    hub_error(&c.hub, CAN_ERR_CRTL);
    hub_error(&c.hub, CAN_ERR_BUSOFF | CAN_ERR_CRTL);
    c.hub.down = true;
    until_state(&c, FB_STATE_UNKNOWN);
    c.hub.down = false;
    until_state(&c, FB_STATE_RUNNING);
    const FbCanCounts counts = fb_can_server_counts(c.server);
    g_assert_cmpuint(counts.breaks, ==, 1);
    g_assert_cmpuint(counts.errors[2], ==, 2);
    g_assert_cmpuint(counts.errors[FB_CAN_ERROR_BUS_OFF], ==, 1);
    machine(&c.cell, FB_MACHINE_COMPLETE);
    g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_RUN], 1));
    g_assert_no_error(c.cell.error);
    close_can(&c);
}

static void interface_down(void)
{
    CanCell c;
    open_can(&c, true);
    c.cell.session = new_can_session(&c, hub_bus(&c.hub), &KEY, 0, 0.1);
    g_autoptr(GBytes) p = program(500);
    can_deliver(&c, p);
    hub_go_down(&c.hub);
    until_state(&c, FB_STATE_UNKNOWN);
    c.hub.down = false;
    until_state(&c, FB_STATE_READY);
    fb_session_start(c.cell.session);
    g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_RUN], 1));
    g_assert_no_error(c.cell.error);
    g_assert_cmpuint(fb_can_server_counts(c.server).breaks, ==, 1);
    close_can(&c);
}

/* Another epoch ends the task; the next one is delivered to the machine as it is now. */
static void machine_restarted(void)
{
    CanCell c;
    open_can(&c, true);
    c.cell.slow = true;
    c.cell.session = new_can_session(&c, hub_bus(&c.hub), &KEY, 0, 0.1);
    g_autoptr(GBytes) p = program(30000);
    can_deliver(&c, p);
    fb_session_start(c.cell.session);
    g_assert_true(run_until(&c.cell, &c.cell.starts, 1));
    stop_machine(&c);
    start_machine(&c, 78);
    g_assert_true(run_until(&c.cell, &c.cell.done[FB_TASK_RUN], 1));
    g_assert_error(c.cell.error, FB_ERROR, FB_ERROR_LINK_LOST);
    can_deliver(&c, p);
    g_assert_no_error(c.cell.error);
    assert_state(&c, "READY");
    close_can(&c);
}

static void nobody_there(void)
{
    CanCell c;
    open_can(&c, false);
    c.cell.session = new_can_session(&c, hub_bus(&c.hub), &KEY, AGENTS, 0.1); /* not served */
    g_autoptr(GBytes) p = program(500);
    can_deliver(&c, p);
    g_assert_error(c.cell.error, FB_ERROR, FB_ERROR_UNREACHABLE);
    close_can(&c);
}

/* ----------------------------------------------------------------------------- beats */

static void beats(void)
{
    CanCell c;
    FbCanKey key;
    FbCanMachineBeat beat = {0};
    uint32_t next = 1;
    open_can(&c, false);
    c.hub.log->len = 0;
    const int64_t end_us = g_get_monotonic_time() + 2100000;
    bool alarmed = false;
    while (g_get_monotonic_time() < end_us) {
        if (!alarmed && g_get_monotonic_time() > end_us - 1000000) {
            machine(&c.cell, FB_MACHINE_ESTOP);
            alarmed = true;
        }
        if (!g_main_context_iteration(c.cell.context, FALSE))
            g_usleep(1000);
    }
    fb_can_beat_key(&key, &KEY, 77);
    g_assert_cmpuint(c.hub.log->len, >=, 5);
    g_assert_cmpuint(c.hub.log->len, <=, 8);
    for (guint i = 0; i < c.hub.log->len; i++) {
        const Sent *sent = c.hub.log->pdata[i];
        g_assert_true(sent->frame && sent->id == BEAT_ID && sent->n == 8);
        g_assert_true(fb_can_get_beat(sent->bytes, &key, next, &beat));
        next = beat.count + 1;
    }
    g_assert_cmpint(beat.state, ==, FB_STATE_ESTOP);
    g_assert_cmpuint(next, ==, c.hub.log->len + 1);
    close_can(&c);
}

/* With a status read once in ten seconds, it is the beat that tells of the end. */
static void beat_is_news(void)
{
    CanCell c;
    open_can(&c, false);
    c.cell.slow = true;
    const CfgAgent slow = {
        .reply_timeout_s = 1, .reconnect_s = 0.02, .give_up_s = 5, .heartbeat_s = 10, .window = 1};
    const FbSessionCallbacks callbacks = {on_status, on_done, &c.cell};
    g_autoptr(FbCanAgent) who = fb_can_agent_new_on(hub_bus(&c.hub), &KEY, BASE, 0);
    c.cell.session = fb_session_new_on_can("can://hub", who, &slow, &callbacks, c.cell.context);
    g_autoptr(GBytes) p = program(500);
    can_deliver(&c, p);
    until_state(&c, FB_STATE_READY);
    machine(&c.cell, FB_MACHINE_ALARM);
    until_state(&c, FB_STATE_ALARM);
    close_can(&c);
}

/* --------------------------------------------------------------------------- agents */

/* Each agent of a host has a number of its own, and a key. */
static void numbers(void)
{
    char *folder = test_folder();
    g_autofree char *key = g_build_filename(folder, "can.key", NULL);
    g_autofree char *address = g_strdup_printf("can://test%d", getpid());
    CfgTarget target = {.address = address, .can_key = key, .can_first = 2, .can_last = 3};
    g_autoptr(GError) error = NULL;
    g_assert_null(fb_can_agent_new(&target, NULL)); /* no such file */
    g_file_set_contents_full(key, "000102030405060708090a0b0c0d0e0f\n", -1,
                             G_FILE_SET_CONTENTS_CONSISTENT, 0600, &error);
    g_assert_no_error(error);
    g_autoptr(FbCanAgent) first = fb_can_agent_new(&target, &error);
    g_assert_no_error(error);
    FbCanAgent *second = fb_can_agent_new(&target, &error);
    g_assert_no_error(error);
    g_assert_true(first && first->number == 2 && second && second->number == 3);
    g_assert_null(fb_can_agent_new(&target, &error));
    g_assert_error(error, FB_ERROR, FB_ERROR_UNREACHABLE);
    g_clear_error(&error);
    fb_can_agent_unref(second);
    g_autoptr(FbCanAgent) third = fb_can_agent_new(&target, &error);
    g_assert_no_error(error);
    g_assert_true(third && third->number == 3);
    static const char *const names[] = {"can://", "can://sixteen-bytes-is"};
    for (size_t i = 0; i < G_N_ELEMENTS(names); i++) {
        target.address = (char *)names[i];
        g_assert_null(fb_can_agent_new(&target, &error));
        g_assert_error(error, FB_ERROR, FB_ERROR_UNREACHABLE);
        g_assert_nonnull(error ? strstr(error->message, names[i]) : NULL);
        g_clear_error(&error);
    }
    target.address = address;
    target.can_key = NULL;
    const CfgAgent agent = {.window = 1};
    const FbSessionCallbacks callbacks = {0};
    g_assert_null(fb_session_new(&target, &agent, &callbacks, NULL, &error));
    g_assert_error(error, FB_ERROR, FB_ERROR_CREDENTIALS);
    test_folder_remove(folder);
}

/* What is no whole frame says nothing of the bus. */
static void short_frame(void)
{
    int pair[2];
    FbCanFrame frame;
    g_assert_cmpint(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair), ==, 0);
    g_assert_cmpint(send(pair[0], "short", 5, 0), ==, 5);
    errno = ENETDOWN;
    g_assert_cmpint(fb_can_read_frame(pair[1], &frame), ==, FB_CAN_READ_TORN);
    g_assert_cmpint(fb_can_read_frame(pair[1], &frame), ==, FB_CAN_READ_NONE);
    close(pair[0]);
    g_assert_cmpint(fb_can_read_frame(pair[1], &frame), ==, FB_CAN_READ_BROKEN);
    close(pair[1]);
}

static void add(void)
{
    g_test_add_func("/fieldbus/can/classic", classic);
    g_test_add_func("/fieldbus/can/fd", flexible);
    g_test_add_func("/fieldbus/can/fd-machine-only", flexible_machine_only);
    g_test_add_func("/fieldbus/can/hold-resume-abort", hold_resume_abort);
    g_test_add_func("/fieldbus/can/setup", setup_is_read);
    g_test_add_func("/fieldbus/can/lost-message", a_lost_message);
    g_test_add_func("/fieldbus/can/lost-stop", a_lost_stop);
    g_test_add_func("/fieldbus/can/bus-off", bus_off);
    g_test_add_func("/fieldbus/can/interface-down", interface_down);
    g_test_add_func("/fieldbus/can/restart", machine_restarted);
    g_test_add_func("/fieldbus/can/nobody", nobody_there);
    g_test_add_func("/fieldbus/can/numbers", numbers);
    g_test_add_func("/fieldbus/can/beats", beats);
    g_test_add_func("/fieldbus/can/beat-is-news", beat_is_news);
    g_test_add_func("/fieldbus/can/short-frame", short_frame);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
