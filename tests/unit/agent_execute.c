/* SPDX-License-Identifier: Apache-2.0 */
/* The person's stop, asked for until the machine has taken it; and what changes before a start. */
#include <stdlib.h>
#include <string.h>

#include "agent/execute.h"
#include "agent/preflight.h"
#include "tests/lib/test.h"

/* A machine in a thread of its own, as it is in life. A hold ends its run. */
typedef struct {
    GMainContext *context;
    GMainLoop *loop;
    GThread *thread;
    FbReceiver *receiver;
    FbModbusServer *server;
    gint starts, holds, setups;
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

/* `setup` may be NULL. */
static bool machine_init(Machine *m, const FbSetup *setup)
{
    const FbReceiverOptions options = {.epoch = 1,
                                       .memory_bytes = 1 << 20,
                                       .agent_timeout_us = 5 * G_USEC_PER_SEC,
                                       .lease_timeout_us = 30 * G_USEC_PER_SEC};
    g_autoptr(GError) error = NULL;
    *m = (Machine){.context = g_main_context_new(), .receiver = fb_receiver_new(&options)};
    tell(m, FB_MACHINE_ACKNOWLEDGED);
    if (setup)
        fb_receiver_set_setup(m->receiver, setup);
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

/* Where an agent finds it; caller frees. */
static char *machine_address(const Machine *m)
{
    return g_strdup_printf("modbus://127.0.0.1:%u", fb_modbus_server_port(m->server));
}

static AgentLink *link_to(char *address)
{
    g_autoptr(GError) error = NULL;
    const AgentOptions options = {.to = address};
    AgentLink *link = agent_link_open(&options, &error);
    g_assert_no_error(error);
    return link;
}

/* Ctrl-C overtakes the START: the machine refuses the hold, and runs. */
static void hold_before_start(void)
{
    static const char program[] = "G0 X1\nM30\n";
    const uint64_t end = sizeof program - 1;
    Machine m;
    g_autoptr(GError) error = NULL;
    g_autoptr(GBytes) bytes = g_bytes_new_static(program, sizeof program - 1);
    if (!machine_init(&m, NULL))
        return;
    g_autofree char *address = machine_address(&m);
    AgentLink *link = link_to(address);
    AgentExecution execution = agent_execution(link, NULL, address);
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
    if (!machine_init(&m, NULL))
        return;
    g_autofree char *address = machine_address(&m);
    AgentLink *starter = link_to(address);
    AgentExecution start = agent_execution(starter, NULL, address);
    bool good = starter && agent_execute_deliver(&start, bytes, &end, 1, &error);
    g_assert_true(good);
    if (good)
        fb_session_start(starter->session);
    while (good && g_atomic_int_get(&m.starts) == 0)
        g_main_context_iteration(starter->context, TRUE);
    AgentLink *link = link_to(address);
    if (good && link && agent_link_wait_status(link, &error)) {
        AgentExecution other = agent_execution(link, NULL, address);
        fb_session_command(link->session, FB_COMMAND_HOLD, NULL);
        g_assert_false(agent_execute_watch(&other, &error));
        g_assert_error(error, FB_ERROR, FB_ERROR_ABORTED);
    }
    g_assert_cmpint(g_atomic_int_get(&m.holds), ==, 1);
    agent_link_free(link);
    agent_link_free(starter);
    machine_clear(&m);
}

static gboolean change_setup(void *data)
{
    Machine *m = data;
    const FbSetup setup = {.n_tools = 1, .tools = {{.number = 4}}, .work_offset = 54};
    fb_receiver_set_setup(m->receiver, &setup);
    g_atomic_int_inc(&m->setups);
    return G_SOURCE_REMOVE;
}

/* Somebody changes a tool while the program is on its way: what was found right is so no more. */
static void changed_on_the_way(void)
{
    static const char bytes[] = "T3 M6\nM30\n";
    const uint64_t end = sizeof bytes - 1;
    int used[] = {3};
    CfgTool planned = {.number = 3};
    CfgToolTable table = {&planned, 1};
    const AgentMachine described = {.tools = &table};
    const AgentProgram needs = {.tools = used, .n_tools = 1};
    g_autoptr(GBytes) program_bytes = g_bytes_new_static(bytes, sizeof bytes - 1);
    const NcProgram program = {.bytes = program_bytes, .gates = (uint64_t *)&end, .n_gates = 1};
    const FbSetup right = {.n_tools = 1, .tools = {{.number = 3}}, .work_offset = 54};
    Machine m;
    g_autoptr(GError) error = NULL;
    if (!machine_init(&m, &right))
        return;
    g_autofree char *address = machine_address(&m);
    AgentLink *link = link_to(address);
    AgentPreflight flight = {.program = &program, .needs = &needs, .machine = &described};
    g_autoptr(GArray) findings = link ? agent_preflight(link, &flight, &error) : NULL;
    g_assert_no_error(error);
    g_assert_true(findings && agent_preflight_allows(findings, false, NULL));
    AgentExecution execution = agent_execution(link, NULL, address);
    if (findings) {
        g_assert_true(agent_preflight_again(link, &flight, false, &findings, &error));
        g_main_context_invoke(m.context, change_setup, &m);
        while (g_atomic_int_get(&m.setups) == 0)
            g_thread_yield();
        g_assert_true(agent_execute_deliver(&execution, program_bytes, &end, 1, &error));
        g_assert_false(agent_preflight_again(link, &flight, false, &findings, &error));
        g_assert_error(error, AGENT_ERROR, AGENT_ERROR_CAUTION);
        g_clear_error(&error);
        g_assert_true(findings && !agent_preflight_allows(findings, false, NULL));
        /* What a person accepts all the same is started, though the lease was given back. */
        g_assert_true(agent_preflight_again(link, &flight, true, &findings, &error));
        execution.stop = FB_COMMAND_HOLD;
        fb_session_command(link->session, FB_COMMAND_HOLD, NULL);
        g_assert_false(agent_execute_start(&execution, NULL, &error));
        g_assert_error(error, FB_ERROR, FB_ERROR_ABORTED);
    }
    g_assert_cmpint(g_atomic_int_get(&m.starts), ==, 1);
    agent_link_free(link);
    machine_clear(&m);
}

static void add(void)
{
    g_test_add_func("/agent/execute/watch", watch);
    g_test_add_func("/agent/execute/changed-on-the-way", changed_on_the_way);
    g_test_add_func("/agent/execute/hold-before-start", hold_before_start);
}

int main(int argc, char **argv)
{
    return test_main_as_new_user(argc, argv, add);
}
