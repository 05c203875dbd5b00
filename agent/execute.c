/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/execute.h"

#include <glib-unix.h>
#include <signal.h>

#include "agent/progress.h"

static void show_delivery(const FbStatus *status);
static void show_run(AgentExecution *execution, const FbStatus *status);
static void watch(AgentExecution *execution, const FbStatus *status);

AgentExecution agent_execution(AgentLink *link, AgentFollow *follow, char *name)
{
    return (AgentExecution){.link = link,
                            .follow = follow,
                            .start_us = g_get_monotonic_time(),
                            .state = FB_N_STATES, /* told of none yet */
                            .name = name};
}

/* Asks for a hold or an abort; what the machine says to it is seen with the next status. */
static void ask_stop(AgentExecution *execution, FbCommand stop)
{
    AgentLink *link = execution->link;
    execution->stop = stop;
    link->done[FB_TASK_COMMAND] = false;
    fb_session_command(link->session, stop, NULL);
}

/* A stop may fail, or come to the machine before the START that is on its way over the other
 * connection: as long as the program is on it is asked for again. */
static void insist_on_stop(AgentExecution *execution, const FbStatus *status)
{
    AgentLink *link = execution->link;
    const GError *error = link->error[FB_TASK_COMMAND];
    if (execution->stop == FB_COMMAND_NONE || !link->done[FB_TASK_COMMAND] || !error ||
        !fb_state_runs(status->state))
        return;
    agent_progress_note("asking again: %s", error->message);
    ask_stop(execution, execution->stop);
}

static void on_status(const FbStatus *status, void *data)
{
    AgentExecution *execution = data;
    if (execution->follow)
        agent_follow_step(execution->follow, status,
                          (double)(g_get_monotonic_time() - execution->start_us) * 1e-6);
    if (execution->started) {
        show_run(execution, status);
        insist_on_stop(execution, status);
    } else {
        show_delivery(status);
    }
    if (execution->watching)
        watch(execution, status);
}

static gboolean on_interrupt(void *data)
{
    AgentExecution *execution = data;
    AgentLink *link = execution->link;
    if (!execution->started) {
        agent_link_cancel(link, g_error_new_literal(AGENT_ERROR, AGENT_ERROR_INTERRUPTED,
                                                    "interrupted before the start"));
        return G_SOURCE_CONTINUE;
    }
    switch (++execution->interrupts) {
    case 1:
        agent_progress_note("asking for a hold; Ctrl-C again aborts, `segmill resume --to %s` "
                            "goes on",
                            execution->name);
        ask_stop(execution, FB_COMMAND_HOLD);
        break;
    case 2:
        agent_progress_note("asking for an abort");
        ask_stop(execution, FB_COMMAND_ABORT);
        break;
    default:
        agent_link_cancel(
            link, g_error_new_literal(FB_ERROR, FB_ERROR_LINK_LOST,
                                      "gave up waiting for the machine; its state is UNKNOWN"));
    }
    return G_SOURCE_CONTINUE;
}

static GSource *catch_interrupts(AgentExecution *execution)
{
    GSource *interrupt = g_unix_signal_source_new(SIGINT);
    g_source_set_callback(interrupt, on_interrupt, execution, NULL);
    g_source_attach(interrupt, execution->link->context);
    return interrupt;
}

static void end_source(GSource *source)
{
    g_source_destroy(source);
    g_source_unref(source);
}

static bool wait_for(AgentExecution *execution, FbTask task, GError **error)
{
    GSource *interrupt = catch_interrupts(execution);
    bool ok = agent_link_wait(execution->link, task, error);
    end_source(interrupt);
    agent_progress_end();
    return ok;
}

bool agent_execute_deliver(AgentExecution *execution, GBytes *program, const uint64_t *gates,
                           size_t n_gates, GError **error)
{
    AgentLink *link = execution->link;
    link->status = on_status;
    link->data = execution;
    agent_progress_step("delivering");
    fb_session_deliver(link->session, program, gates, n_gates);
    return wait_for(execution, FB_TASK_DELIVER, error);
}

bool agent_execute_start(AgentExecution *execution, const FbStored *stored, GError **error)
{
    AgentLink *link = execution->link;
    link->status = on_status;
    link->data = execution;
    if (execution->follow)
        agent_follow_arm(execution->follow, fb_session_status(link->session));
    execution->started = true;
    agent_progress_step("running");
    if (stored)
        fb_session_start_stored(link->session, stored);
    else
        fb_session_start(link->session);
    return wait_for(execution, FB_TASK_RUN, error);
}

/* ----------------------------------------------------------------------- watch */

bool agent_execute_watch(AgentExecution *execution, GError **error)
{
    AgentLink *link = execution->link;
    const FbStatus *status = fb_session_status(link->session);
    execution->started = execution->watching = true;
    execution->epoch = status->epoch;
    execution->run = status->run;
    link->status = on_status;
    link->data = execution;
    agent_progress_step("running");
    on_status(status, execution);
    GSource *interrupt = catch_interrupts(execution);
    while (!execution->ended && !link->cancelled)
        g_main_context_iteration(link->context, true);
    end_source(interrupt);
    g_clear_pointer(&execution->lost, end_source);
    agent_progress_end();
    link->status = NULL;
    if (!execution->ended)
        return agent_link_take_cause(link, error);
    if (!execution->why)
        return true;
    g_propagate_error(error, g_steal_pointer(&execution->why));
    return false;
}

static gboolean on_lost(void *data)
{
    AgentExecution *execution = data;
    AgentLink *link = execution->link;
    agent_link_cancel(link, g_error_new(FB_ERROR, FB_ERROR_LINK_LOST,
                                        "%s: no answer for %g s; its state is UNKNOWN: look at the "
                                        "machine",
                                        link->target.address, link->agent->give_up_s));
    return G_SOURCE_CONTINUE;
}

static void watch(AgentExecution *execution, const FbStatus *status)
{
    AgentLink *link = execution->link;
    bool known = status->state != FB_STATE_UNKNOWN;
    if (known)
        g_clear_pointer(&execution->lost, end_source);
    else if (!execution->lost)
        execution->lost = agent_link_timer(link, link->agent->give_up_s, on_lost, execution);
    if (!execution->ended)
        execution->ended = fb_run_ended(status, execution->epoch, execution->run, &execution->why);
}

/* ------------------------------------------------------------------------ show */

static void show_delivery(const FbStatus *status)
{
    if (status->state == FB_STATE_LOADING && status->length > 0)
        agent_progress_share("delivering", (double)status->received / (double)status->length);
}

/* Every state in which a run does not get on is told once; between them the bar moves. */
static void show_run(AgentExecution *execution, const FbStatus *status)
{
    bool changed = status->state != execution->state;
    execution->state = status->state;
    if (status->starving && !execution->starved) {
        agent_progress_note(
            "the machine waits at a gate for more of the program: the link is slow");
        execution->starved = true;
    }
    switch (status->state) {
    case FB_STATE_RUNNING:
        if (execution->follow)
            agent_progress_share("running", agent_follow_share(execution->follow));
        break;
    case FB_STATE_READY:
    case FB_STATE_TOOL_CHANGE:
    case FB_STATE_COMPLETE:
        break;
    case FB_STATE_PROGRAM_STOP:
        if (changed)
            agent_progress_note("program stop in line %u; `segmill resume --to %s` goes on",
                                status->line, execution->name);
        break;
    default:
        if (changed)
            agent_progress_note("the machine is %s", fb_state_name(status->state));
    }
}
