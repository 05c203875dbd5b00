/* SPDX-License-Identifier: Apache-2.0 */
/* The person's stop: asked for until the machine has taken it. */
#include <stdlib.h>
#include <string.h>

#include "agent/execute.h"
#include "tests/lib/test.h"

/* A machine in a thread of its own, as it is in life. A hold ends its run. */
typedef struct {
    GMainContext *context;
    GMainLoop *loop;
    GThread *thread;
    FbReceiver *receiver;
    FbModbusServer *server;
    gint starts, holds;
} Machine;

static void tell(Machine *m, FbMachineEvent event)
{
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    fb_receiver_machine(m->receiver, event, NULL, g_get_monotonic_time(), actions);
}

static void act(FbDo what, void *data)
{
    Machine *m = data;
    if (what == FB_DO_VERIFY) {
        tell(m, FB_MACHINE_VERIFIED);
    } else if (what == FB_DO_START) {
        g_atomic_int_inc(&m->starts);
    } else if (what == FB_DO_HOLD) {
        g_atomic_int_inc(&m->holds);
        tell(m, FB_MACHINE_HELD);
        tell(m, FB_MACHINE_ABORTED);
    }
}

static gpointer serve(gpointer data)
{
    g_main_loop_run(((Machine *)data)->loop);
    return NULL;
}

static bool machine_init(Machine *m)
{
    const FbReceiverOptions options = {.epoch = 1,
                                       .memory_bytes = 1 << 20,
                                       .agent_timeout_us = 5 * G_USEC_PER_SEC,
                                       .lease_timeout_us = 30 * G_USEC_PER_SEC};
    g_autoptr(GError) error = NULL;
    *m = (Machine){.context = g_main_context_new(), .receiver = fb_receiver_new(&options)};
    tell(m, FB_MACHINE_ACKNOWLEDGED);
    m->loop = g_main_loop_new(m->context, FALSE);
    const FbModbusServerOptions server = {.host = "127.0.0.1", .unit_id = 1};
    m->server = fb_modbus_server_new(&server, m->receiver, act, m, m->context, &error);
    g_assert_no_error(error);
    m->thread = g_thread_new("machine", serve, m);
    return m->server != NULL;
}

static void machine_clear(Machine *m)
{
    g_main_loop_quit(m->loop);
    g_thread_join(m->thread);
    fb_modbus_server_free(m->server);
    fb_receiver_free(m->receiver);
    g_main_loop_unref(m->loop);
    g_main_context_unref(m->context);
}

/* Ctrl-C overtakes the START: the machine refuses the hold, and runs. */
static void hold_before_start(void)
{
    static const char program[] = "G0 X1\nM30\n";
    const uint64_t end = sizeof program - 1;
    Machine m;
    g_autoptr(GError) error = NULL;
    g_autoptr(GBytes) bytes = g_bytes_new_static(program, sizeof program - 1);
    if (!machine_init(&m))
        return;
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(m.server));
    const AgentOptions options = {.to = address};
    AgentLink *link = agent_link_open(&options, &error);
    g_assert_no_error(error);
    AgentExecution execution = {.link = link, .state = FB_N_STATES, .name = address};
    if (link && agent_execute_deliver(&execution, bytes, &end, 1, &error)) {
        execution.stop = FB_COMMAND_HOLD;
        fb_session_command(link->session, FB_COMMAND_HOLD, NULL);
        while (!link->done[FB_TASK_COMMAND])
            g_main_context_iteration(link->context, TRUE);
        g_assert_error(link->error[FB_TASK_COMMAND], FB_ERROR, FB_ERROR_REFUSED);
        g_assert_cmpint(g_atomic_int_get(&m.holds), ==, 0);
        g_assert_false(agent_execute_start(&execution, NULL, &error));
        g_assert_error(error, FB_ERROR, FB_ERROR_ABORTED);
    }
    g_assert_cmpint(g_atomic_int_get(&m.starts), ==, 1);
    g_assert_cmpint(g_atomic_int_get(&m.holds), ==, 1);
    agent_link_free(link);
    machine_clear(&m);
}

/* Whoever resumes a run that somebody else has started watches it, stops it, and hears how it
 * ended. */
static void watch(void)
{
    static const char program[] = "G0 X1\nM30\n";
    const uint64_t end = sizeof program - 1;
    Machine m;
    g_autoptr(GError) error = NULL;
    g_autoptr(GBytes) bytes = g_bytes_new_static(program, sizeof program - 1);
    if (!machine_init(&m))
        return;
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(m.server));
    const AgentOptions options = {.to = address};
    AgentLink *starter = agent_link_open(&options, &error);
    g_assert_no_error(error);
    AgentExecution start = {.link = starter, .state = FB_N_STATES, .name = address};
    bool good = starter && agent_execute_deliver(&start, bytes, &end, 1, &error);
    g_assert_true(good);
    if (good)
        fb_session_start(starter->session);
    while (good && g_atomic_int_get(&m.starts) == 0)
        g_main_context_iteration(starter->context, TRUE);
    AgentLink *link = agent_link_open(&options, &error);
    if (good && link && agent_link_wait_status(link, &error)) {
        AgentExecution other = {.link = link, .state = FB_N_STATES, .name = address};
        fb_session_command(link->session, FB_COMMAND_HOLD, NULL);
        g_assert_false(agent_execute_watch(&other, &error));
        g_assert_error(error, FB_ERROR, FB_ERROR_ABORTED);
    }
    g_assert_cmpint(g_atomic_int_get(&m.holds), ==, 1);
    agent_link_free(link);
    agent_link_free(starter);
    machine_clear(&m);
}

static void add(void)
{
    g_test_add_func("/agent/execute/watch", watch);
    g_test_add_func("/agent/execute/hold-before-start", hold_before_start);
}

int main(int argc, char **argv)
{
    char *folder = test_folder();
    g_setenv("XDG_STATE_HOME", folder, TRUE);
    g_setenv("XDG_CONFIG_HOME", folder, TRUE);
    const int failed = test_main(argc, argv, add);
    test_folder_remove(folder);
    return failed;
}
