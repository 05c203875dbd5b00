/* SPDX-License-Identifier: Apache-2.0 */
/* panel: two buttons and a lamp at the machine. docs/panel.md */
#include <glib-unix.h>
#include <signal.h>
#include <stdio.h>

#include "agent/link.h"
#include "agent/panel/gpio.h"
#include "agent/panel/panel.h"
#include "agent/progress.h"

#define LOOK_US 500000 /* at the lines, at least that often */

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_panel = {
    .name = "panel",
    .synopsis = "--to NAME",
    .summary = "a start button, a hold button and a lamp on GPIO lines: the machine will move",
    .help =
        "Until Ctrl-C or SIGTERM, which touch no run. The start button starts the verified\n"
        "program that the machine holds, READY; the hold button asks for a hold. [panel] in the\n"
        "agent's configuration names the lines; docs/panel.md has the wiring, the rules and the\n"
        "lamp's patterns. This is neither an emergency stop nor a safety device.",
    .takes = AGENT_TAKES_TO | AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_TO,
    .run = run,
};

typedef struct {
    AgentLink *link;
    AgentPanel machine;
    AgentGpio *gpio;            /* NULL: the chip is gone */
    GSource *fds[AGENT_N_KEYS]; /* of `gpio` */
    GSource *wake;
    int64_t look_us;  /* at the lines, or for the chip, then */
    GArray *statuses; /* of FbStatus, not yet told */
    int starts, holds;
    bool stopped;
    GError *broken; /* ends it */
    /* as told to a person last */
    FbState state;
    AgentFault fault;
    bool hold_wanted;
    char *hold_error; /* of this hold; NULL: none */
    bool armed, lamp;
} Panel;

static void step(Panel *p, const AgentPanelEvent *event);
static void tell(Panel *p);
static bool open_lines(Panel *p, GError **error);
static void close_lines(Panel *p, const GError *why);

/* ------------------------------------------------------------------------ loop */

/* All edges there are, in the order of time, before anything else that happens now. */
static void take_edges(Panel *p)
{
    g_autoptr(GArray) edges = g_array_new(false, false, sizeof(AgentGpioEdge));
    g_autoptr(GError) error = NULL;
    const bool ok = agent_gpio_read(p->gpio, edges, &error);
    for (guint i = 0; i < edges->len; i++) {
        const AgentGpioEdge *edge = &g_array_index(edges, AgentGpioEdge, i);
        AgentPanelEvent event = {.kind = AGENT_PANEL_EDGE, .at_us = edge->at_us, .key = edge->key};
        event.pressed[edge->key] = edge->pressed;
        step(p, &event);
    }
    if (!ok)
        close_lines(p, error);
}

static void take_statuses(Panel *p)
{
    g_autoptr(GArray) statuses = g_steal_pointer(&p->statuses);
    p->statuses = g_array_new(false, false, sizeof(FbStatus));
    for (guint i = 0; i < statuses->len; i++)
        step(p, &(AgentPanelEvent){.kind = AGENT_PANEL_STATUS,
                                   .status = &g_array_index(statuses, FbStatus, i)});
}

/* True where a task has ended; *error is the caller's. */
static bool take_end(Panel *p, FbTask task, GError **error)
{
    const bool done = p->link->done[task];
    p->link->done[task] = false;
    if (done)
        *error = g_steal_pointer(&p->link->error[task]);
    return done;
}

/* A hold is asked for ten times a second: what is in its way is told when it changes. */
static void tell_hold_error(Panel *p, const GError *error)
{
    if (error && g_strcmp0(p->hold_error, error->message) != 0)
        agent_progress_note("%s", error->message);
    g_free(p->hold_error);
    p->hold_error = error ? g_strdup(error->message) : NULL;
}

static void take_ends(Panel *p)
{
    g_autoptr(GError) run_error = NULL;
    g_autoptr(GError) hold_error = NULL;
    if (take_end(p, FB_TASK_RUN, &run_error)) {
        agent_progress_note("%s", run_error ? run_error->message : "the program is complete");
        step(p, &(AgentPanelEvent){.kind = AGENT_PANEL_RUN_ENDED, .failed = run_error != NULL});
    }
    if (take_end(p, FB_TASK_COMMAND, &hold_error)) {
        tell_hold_error(p, hold_error);
        step(p, &(AgentPanelEvent){.kind = AGENT_PANEL_HOLD_ANSWERED});
    }
}

/* A chip that is gone may come back; its lines are then seen for the first time. */
static void look(Panel *p)
{
    const int64_t now_us = g_get_monotonic_time();
    if (p->gpio)
        take_edges(p);
    else if (now_us < p->look_us)
        return;
    else if (open_lines(p, NULL))
        agent_progress_note("the panel's lines are back");
    p->look_us = now_us + LOOK_US;
}

static void loop(Panel *p)
{
    while (!p->stopped && !p->broken) {
        g_main_context_iteration(p->link->context, true);
        look(p);
        take_statuses(p);
        take_ends(p);
        step(p, &(AgentPanelEvent){.kind = AGENT_PANEL_TICK});
        tell(p);
    }
}

/* --------------------------------------------------------------------- actions */

static void start(Panel *p)
{
    const uint8_t *id = p->machine.id;
    agent_progress_note("start: program %02x%02x%02x%02x", id[0], id[1], id[2], id[3]);
    p->starts++;
    p->link->done[FB_TASK_RUN] = false;
    fb_session_start_stored(p->link->session, &(FbStored){.id = id});
}

static void hold(Panel *p)
{
    p->holds++;
    p->link->done[FB_TASK_COMMAND] = false;
    fb_session_command(p->link->session, FB_COMMAND_HOLD, NULL);
}

/* What is on its way goes with the session; a hold is asked for again by the new one. */
static void drop(Panel *p)
{
    agent_progress_note("the link was lost at the start: whether the machine has started is not "
                        "known; look at it");
    if (!agent_link_renew(p->link, &p->broken))
        return;
    if (p->machine.hold_asking)
        step(p, &(AgentPanelEvent){.kind = AGENT_PANEL_HOLD_ANSWERED});
}

static void light(Panel *p, bool lit)
{
    g_autoptr(GError) error = NULL;
    if (lit == p->lamp || !p->gpio)
        return;
    p->lamp = lit;
    if (!agent_gpio_light(p->gpio, lit, &error))
        close_lines(p, error);
}

static void step(Panel *p, const AgentPanelEvent *event)
{
    AgentPanelActions out;
    agent_panel_step(&p->machine, event, g_get_monotonic_time(), &out);
    g_source_set_ready_time(p->wake, MIN(out.wake_us, p->look_us));
    if (out.ignored)
        agent_progress_note("start does nothing: %s", out.ignored);
    if (out.hold)
        hold(p);
    if (out.start)
        start(p);
    if (out.drop)
        drop(p);
    else
        light(p, out.lamp);
}

/* What has changed, once. */
static void tell(Panel *p)
{
    const AgentFault fault = agent_panel_fault(&p->machine);
    if (fault != p->fault)
        agent_progress_note("panel: %s", agent_fault_text(fault));
    if (p->machine.state != p->state)
        agent_progress_note("the machine is %s%s", fb_state_name(p->machine.state),
                            p->machine.acknowledge ? "; a person has to acknowledge there" : "");
    if (p->machine.armed && !p->armed)
        agent_progress_note("armed: start runs program %02x%02x%02x%02x", p->machine.id[0],
                            p->machine.id[1], p->machine.id[2], p->machine.id[3]);
    if (p->machine.hold_wanted && !p->hold_wanted) {
        agent_progress_note("asking for a hold");
        g_clear_pointer(&p->hold_error, g_free);
    }
    p->hold_wanted = p->machine.hold_wanted;
    p->fault = fault;
    p->state = p->machine.state;
    p->armed = p->machine.armed;
}

/* ----------------------------------------------------------------------- lines */

static gboolean on_edge(int fd, GIOCondition condition, void *data)
{
    (void)fd, (void)condition, (void)data;
    return G_SOURCE_CONTINUE; /* the loop reads it */
}

static bool open_lines(Panel *p, GError **error)
{
    AgentPanelEvent event = {.kind = AGENT_PANEL_LINES};
    g_autoptr(AgentGpio) gpio = agent_gpio_open(&p->link->agent->panel, error);
    if (!gpio || !agent_gpio_levels(gpio, event.pressed, error))
        return false;
    for (AgentKey key = 0; key < AGENT_N_KEYS; key++) {
        p->fds[key] = g_unix_fd_source_new(agent_gpio_fd(gpio, key), G_IO_IN);
        g_source_set_callback(p->fds[key], G_SOURCE_FUNC(on_edge), NULL, NULL);
        g_source_attach(p->fds[key], p->link->context);
    }
    p->gpio = g_steal_pointer(&gpio);
    p->lamp = false;
    step(p, &event);
    return p->gpio != NULL;
}

static void close_lines(Panel *p, const GError *why)
{
    if (!p->gpio)
        return;
    for (size_t i = 0; i < AGENT_N_KEYS; i++) {
        g_source_destroy(p->fds[i]);
        g_clear_pointer(&p->fds[i], g_source_unref);
    }
    g_clear_pointer(&p->gpio, agent_gpio_close);
    if (!why)
        return;
    agent_progress_note("%s", why->message);
    step(p, &(AgentPanelEvent){.kind = AGENT_PANEL_NO_LINES});
}

/* ------------------------------------------------------------------------- run */

static void on_status(const FbStatus *status, void *data)
{
    Panel *p = data;
    g_array_append_vals(p->statuses, status, 1);
}

static gboolean on_signal(void *data)
{
    Panel *p = data;
    p->stopped = true;
    return G_SOURCE_CONTINUE;
}

static gboolean dispatch_wake(GSource *source, GSourceFunc callback, gpointer data)
{
    (void)source, (void)callback, (void)data;
    return G_SOURCE_CONTINUE; /* the loop steps, and sets the next time */
}

static GSource *attach_signal(Panel *p, int number)
{
    GSource *source = g_unix_signal_source_new(number);
    g_source_set_callback(source, on_signal, p, NULL);
    g_source_attach(source, p->link->context);
    return source;
}

static bool run_panel(Panel *p, GError **error)
{
    static GSourceFuncs wake = {.dispatch = dispatch_wake};
    p->wake = g_source_new(&wake, sizeof(GSource));
    g_source_attach(p->wake, p->link->context);
    GSource *signals[] = {attach_signal(p, SIGINT), attach_signal(p, SIGTERM)};
    if (open_lines(p, error))
        loop(p);
    close_lines(p, NULL);
    for (size_t i = 0; i < G_N_ELEMENTS(signals); i++) {
        g_source_destroy(signals[i]);
        g_source_unref(signals[i]);
    }
    g_source_destroy(p->wake);
    g_source_unref(p->wake);
    if (p->broken)
        g_propagate_error(error, g_steal_pointer(&p->broken));
    return p->stopped;
}

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentLink) link = agent_link_open(options, error);
    if (!link)
        return false;
    const CfgPanel *config = &link->agent->panel;
    if (!config->chip) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "the agent's configuration has no panel: write chip, start, hold and lamp "
                    "into its group [panel]");
        return false;
    }
    Panel panel = {
        .link = link,
        .machine = agent_panel_new((int64_t)config->debounce_ms * 1000, g_get_monotonic_time()),
        .statuses = g_array_new(false, false, sizeof(FbStatus)),
        .state = FB_STATE_UNKNOWN,
    };
    g_source_destroy(link->patience); /* nothing is given up here */
    link->status = on_status;
    link->data = &panel;
    const bool ok = run_panel(&panel, error);
    link->status = NULL;
    g_array_unref(panel.statuses);
    g_free(panel.hold_error);
    if (!ok)
        return false;
    agent_progress_note(panel.machine.started
                            ? "the panel ends; the run goes on without its heartbeats, as the "
                              "machine's on_agent_loss says"
                            : "the panel ends");
    agent_json_integer(result, "starts", panel.starts);
    agent_json_integer(result, "holds", panel.holds);
    if (!options->json)
        printf("%d starts, %d holds\n", panel.starts, panel.holds);
    return true;
}
