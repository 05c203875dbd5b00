/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/link.h"

#include <string.h>

#include "agent/progress.h"
#include "agent/token.h"

#define PATIENCE_S 1

static CfgAgent *load_agent(const AgentOptions *options, GError **error);
static bool find_target(AgentLink *link, const char *name, GError **error);

static void on_status(const FbStatus *status, void *data)
{
    AgentLink *link = data;
    link->known = status->state != FB_STATE_UNKNOWN;
    if (link->status)
        link->status(status, link->data);
}

static void on_done(FbTask task, const GError *error, void *data)
{
    AgentLink *link = data;
    link->done[task] = true;
    g_clear_error(&link->error[task]);
    link->error[task] = error ? g_error_copy(error) : NULL;
}

static gboolean on_patience_lost(void *data)
{
    AgentLink *link = data;
    if (!link->known)
        agent_progress_note("no answer from %s yet; it is given up after %g s",
                            link->target.address, link->agent->give_up_s);
    return G_SOURCE_REMOVE;
}

static bool connect_session(AgentLink *link, GError **error)
{
    FbSessionCallbacks callbacks = {on_status, on_done, link};
    link->session = fb_session_new(&link->target, link->agent, &callbacks, link->context, error);
    if (link->session)
        fb_session_set_token(link->session, agent_token());
    return link->session != NULL;
}

AgentLink *agent_link_open(const AgentOptions *options, GError **error)
{
    g_autoptr(AgentLink) link = g_new0(AgentLink, 1);
    link->context = g_main_context_new();
    link->agent = load_agent(options, error);
    if (!link->agent || !find_target(link, options->to, error))
        return NULL;
    if (!connect_session(link, error))
        return NULL;
    link->patience = agent_link_timer(link, PATIENCE_S, on_patience_lost, link);
    return g_steal_pointer(&link);
}

bool agent_link_renew(AgentLink *link, GError **error)
{
    g_clear_pointer(&link->session, fb_session_free);
    link->known = false;
    for (size_t i = 0; i < FB_N_TASKS; i++) {
        link->done[i] = false;
        g_clear_error(&link->error[i]);
    }
    return connect_session(link, error);
}

void agent_link_free(AgentLink *link)
{
    if (!link)
        return;
    if (link->patience)
        g_source_destroy(link->patience);
    g_clear_pointer(&link->patience, g_source_unref);
    g_clear_pointer(&link->session, fb_session_free);
    for (size_t i = 0; i < G_N_ELEMENTS(link->error); i++)
        g_clear_error(&link->error[i]);
    g_clear_error(&link->cause);
    g_clear_pointer(&link->agent, cfg_agent_free);
    g_main_context_unref(link->context);
    g_free(link);
}

/* --------------------------------------------------------------------- machine */

static CfgAgent *load_agent(const AgentOptions *options, GError **error)
{
    if (options->config)
        return cfg_agent_load(options->config, error);
    g_autofree char *user = g_build_filename(g_get_user_config_dir(), "segmill", "agent.ini", NULL);
    const char *const places[] = {user, "/etc/segmill/agent.ini"};
    for (size_t i = 0; i < G_N_ELEMENTS(places); i++)
        if (g_file_test(places[i], G_FILE_TEST_EXISTS))
            return cfg_agent_load(places[i], error);
    return cfg_agent_default(error);
}

static bool find_target(AgentLink *link, const char *name, GError **error)
{
    const bool is_address = strstr(name, "://") != NULL;
    g_autoptr(GString) known = g_string_new(NULL);
    for (size_t i = 0; i < link->agent->n_machines; i++) {
        link->target = link->agent->machines[i];
        if (strcmp(is_address ? link->target.address : link->target.name, name) == 0)
            return true;
        g_string_append_printf(known, "%s%s", i ? ", " : "", link->target.name);
    }
    if (is_address) {
        link->target = (CfgTarget){.name = (char *)name, .address = (char *)name, .unit_id = 1};
        return true;
    }
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_TARGET,
                "--to %s: no machine of that name; the agent's configuration has: %s", name,
                known->len ? known->str : "none");
    return false;
}

/* ------------------------------------------------------------------------ wait */

bool agent_link_take_cause(AgentLink *link, GError **error)
{
    link->cancelled = false;
    g_propagate_error(error, g_steal_pointer(&link->cause));
    return false;
}

static gboolean on_give_up(void *data)
{
    AgentLink *link = data;
    const char *why = fb_session_why(link->session);
    agent_link_cancel(link, g_error_new(FB_ERROR, FB_ERROR_UNREACHABLE,
                                        "%s: no answer within %g s (%s); is the machine on, and is "
                                        "the address right?",
                                        link->target.address, link->agent->give_up_s,
                                        why ? why : "silence"));
    return G_SOURCE_REMOVE;
}

GSource *agent_link_timer(AgentLink *link, double seconds, GSourceFunc call, void *data)
{
    GSource *source = g_timeout_source_new((guint)(seconds * 1000));
    g_source_set_callback(source, call, data, NULL);
    g_source_attach(source, link->context);
    return source;
}

bool agent_link_wait_status(AgentLink *link, GError **error)
{
    GSource *source = agent_link_timer(link, link->agent->give_up_s, on_give_up, link);
    while (!link->known && !link->cancelled)
        g_main_context_iteration(link->context, true);
    g_source_destroy(source);
    g_source_unref(source);
    return link->cancelled ? agent_link_take_cause(link, error) : true;
}

bool agent_link_wait_ready(AgentLink *link, GError **error)
{
    if (!agent_link_wait_status(link, error))
        return false;
    const FbStatus *status = fb_session_status(link->session);
    const char *advice = "wait for its end, or abort it";
    switch (status->state) {
    case FB_STATE_IDLE:
    case FB_STATE_LOADING:
    case FB_STATE_READY:
    case FB_STATE_COMPLETE:
        return true;
    case FB_STATE_OFF:
        advice = "a person has to switch it on and acknowledge it there";
        break;
    case FB_STATE_ALARM:
    case FB_STATE_ESTOP:
        advice = status->alarm_advice;
        break;
    default:
        break;
    }
    g_set_error(error, FB_ERROR, FB_ERROR_REFUSED, "%s: the machine is %s and takes no program: %s",
                link->target.address, fb_state_name(status->state), advice);
    return false;
}

bool agent_link_wait(AgentLink *link, FbTask task, GError **error)
{
    while (!link->done[task] && !link->cancelled)
        g_main_context_iteration(link->context, true);
    if (!link->done[task])
        return agent_link_take_cause(link, error);
    link->done[task] = false;
    if (!link->error[task])
        return true;
    g_propagate_error(error, g_steal_pointer(&link->error[task]));
    return false;
}

void agent_link_cancel(AgentLink *link, GError *cause)
{
    g_clear_error(&link->cause);
    link->cause = cause;
    link->cancelled = true;
}

bool agent_link_command(AgentLink *link, FbCommand command, const FbArguments *arguments,
                        GError **error)
{
    link->done[FB_TASK_COMMAND] = false;
    fb_session_command(link->session, command, arguments);
    return agent_link_wait(link, FB_TASK_COMMAND, error);
}
