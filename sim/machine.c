/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/machine.h"

#include <gio/gio.h>
#include <math.h>
#include <string.h>

#include "sim/alarm.h"

/* How often the clock is looked at while a program runs. */
#define TICK_US 5000

/* A step that executes this many blocks and logs them takes some milliseconds: that is how long a
 * request may wait at --speed max. */
#define MOVES_PER_STEP 1000

/* The lease lapses after this multiple of the agent's time-out, as in docs/protocol.md, 6.2. */
#define LEASE_PER_AGENT_TIMEOUT 6

#define UNIT_ID 1

struct SimMachine {
    SimMachineOptions options;
    SimController *controller;
    FbReceiver *receiver;
    FbModbusServer *plain, *secure; /* Modbus; NULL: not asked for */
    GSource *clock;
    GTask *examination; /* whose result is wanted; not owned */
    int examinations;   /* under way */
    unsigned refused;   /* programs, at VERIFY */
};

static void act(FbDo what, void *data);
static bool listen_on(SimMachine *machine, const SimAddress *at, const CfgTls *tls,
                      FbModbusServer **server, GError **error);
static void examine(SimMachine *machine);
static void step(SimMachine *machine, SimEventKind kind, SimProgram *program);
static void carry_out(SimMachine *machine, const SimAction *action);
static void tell(SimMachine *machine, FbMachineEvent event, const FbAlarm *alarm);
static GSource *clock_new(SimMachine *machine);

SimMachine *sim_machine_new(const SimMachineOptions *options, GError **error)
{
    g_autoptr(SimMachine) machine = g_new0(SimMachine, 1);
    const CfgMachine *cfg = options->machine;
    machine->options = *options;
    SimControllerOptions controller = {
        .machine = cfg, .speed = options->speed, .moves_per_step = MOVES_PER_STEP};
    machine->controller = sim_controller_new(&controller);
    int64_t agent_timeout_us = (int64_t)(cfg->agent_timeout_s * 1e6);
    FbReceiverOptions receiver = {.epoch = options->epoch,
                                  .memory_bytes = cfg->program_memory_bytes,
                                  .on_agent_loss = cfg->on_agent_loss,
                                  .agent_timeout_us = agent_timeout_us,
                                  .lease_timeout_us = LEASE_PER_AGENT_TIMEOUT * agent_timeout_us};
    machine->receiver = fb_receiver_new(&receiver);
    machine->clock = clock_new(machine);
    if (!listen_on(machine, &options->plain, NULL, &machine->plain, error) ||
        !listen_on(machine, &options->secure, &cfg->tls, &machine->secure, error))
        return NULL;
    step(machine, SIM_TICK, NULL);
    return g_steal_pointer(&machine);
}

static bool listen_on(SimMachine *machine, const SimAddress *at, const CfgTls *tls,
                      FbModbusServer **server, GError **error)
{
    const FbModbusServerOptions options = {
        .host = at->host, .port = at->port, .unit_id = UNIT_ID, .tls = tls};
    if (at->host)
        *server = fb_modbus_server_new(&options, machine->receiver, act, machine, NULL, error);
    return !at->host || *server;
}

void sim_machine_free(SimMachine *machine)
{
    if (!machine)
        return;
    g_clear_pointer(&machine->plain, fb_modbus_server_free);
    g_clear_pointer(&machine->secure, fb_modbus_server_free);
    machine->examination = NULL;
    while (machine->examinations > 0)
        g_main_context_iteration(NULL, TRUE);
    g_source_destroy(machine->clock);
    g_source_unref(machine->clock);
    fb_receiver_free(machine->receiver);
    sim_controller_free(machine->controller);
    g_free(machine);
}

uint16_t sim_machine_port(const SimMachine *machine)
{
    return machine->plain ? fb_modbus_server_port(machine->plain) : 0;
}

uint16_t sim_machine_tls_port(const SimMachine *machine)
{
    return machine->secure ? fb_modbus_server_port(machine->secure) : 0;
}

void sim_machine_press(SimMachine *machine, SimEventKind button)
{
    step(machine, button, NULL);
}

char *sim_machine_summary(const SimMachine *machine)
{
    SimTotals totals = sim_controller_totals(machine->controller);
    FbProgress progress = sim_controller_progress(machine->controller);
    const uint64_t *refused = fb_receiver_counts(machine->receiver);
    GString *text = g_string_new(NULL);
    g_string_append_printf(text,
                           "programs: %u started, %u completed, %u aborted, %u ended by e-stop, "
                           "%u refused at VERIFY\n"
                           "blocks executed: %" G_GUINT64_FORMAT "\nmachine time: %.3f s\n",
                           totals.started, totals.completed, totals.aborted, totals.stopped,
                           machine->refused, progress.executed_blocks, totals.machine_s);
    g_string_append(text, "requests refused:");
    bool any = false;
    for (int answer = FB_ANSWER_DONE + 1; answer < FB_N_ANSWERS; answer++) {
        if (refused[answer] == 0)
            continue;
        g_string_append_printf(text, "%s %s %" G_GUINT64_FORMAT, any ? "," : "",
                               fb_answer_name((FbAnswer)answer), refused[answer]);
        any = true;
    }
    g_string_append(text, any ? "\n" : " none\n");
    uint64_t exceptions = machine->plain ? fb_modbus_server_exceptions(machine->plain) : 0;
    if (machine->secure)
        exceptions += fb_modbus_server_exceptions(machine->secure);
    if (machine->plain || machine->secure)
        g_string_append_printf(text, "Modbus exceptions: %" G_GUINT64_FORMAT "\n", exceptions);
    if (machine->secure)
        g_string_append_printf(text, "TLS handshakes refused: %" G_GUINT64_FORMAT "\n",
                               fb_modbus_server_refused(machine->secure));
    return g_string_free(text, FALSE);
}

static void act(FbDo what, void *data)
{
    SimMachine *machine = data;
    switch (what) {
    case FB_DO_VERIFY:
        examine(machine);
        break;
    case FB_DO_START:
        step(machine, SIM_START, NULL);
        break;
    case FB_DO_HOLD:
        step(machine, SIM_HOLD, NULL);
        break;
    case FB_DO_HOLD_AT_GATE:
        step(machine, SIM_HOLD_AT_GATE, NULL);
        break;
    case FB_DO_RESUME:
        step(machine, SIM_RESUME, NULL);
        break;
    case FB_DO_ABORT:
        step(machine, SIM_ABORT, NULL);
        break;
    case FB_DO_RESTART:
    case FB_DO_PASS:
    case FB_DO_OVERRIDE:
    case FB_DO_OPTIONAL_STOP:
        break;
    case FB_DO_FORGET:
        machine->examination = NULL;
        step(machine, SIM_FORGET, NULL);
        break;
    }
}

/* -------------------------------------------------------------------- examination */

typedef struct {
    GBytes *bytes;
    uint64_t *gates;
    size_t n_gates;
    const CfgMachine *machine;
    const CfgToolTable *tools;
} Examination;

static void examination_free(void *data)
{
    Examination *examination = data;
    g_bytes_unref(examination->bytes);
    g_free(examination->gates);
    g_free(examination);
}

static void examine_in_thread(GTask *task, void *source, void *data, GCancellable *cancellable)
{
    (void)source, (void)cancellable;
    const Examination *e = data;
    GError *error = NULL;
    SimProgram *program =
        sim_program_new(e->bytes, e->gates, e->n_gates, e->machine, e->tools, &error);
    if (program)
        g_task_return_pointer(task, program, (GDestroyNotify)sim_program_free);
    else
        g_task_return_error(task, error);
}

/* An alarm's text on the wire, cut between characters where it is too long. */
static void fit_text(const char *text, char fitted[FB_TEXT_BYTES])
{
    g_autofree char *valid = g_utf8_make_valid(text, -1);
    size_t length = strlen(valid);
    if (length >= FB_TEXT_BYTES) {
        static const char more[] = "…";
        char *end = g_utf8_find_prev_char(valid, valid + FB_TEXT_BYTES - sizeof more + 1);
        length = (size_t)(end - valid);
        g_snprintf(fitted, FB_TEXT_BYTES, "%.*s%s", (int)length, valid, more);
    } else {
        g_strlcpy(fitted, valid, FB_TEXT_BYTES);
    }
}

static void refuse(SimMachine *machine, const GError *error)
{
    char text[FB_TEXT_BYTES];
    fit_text(error->message, text);
    SimAlarm code = (SimAlarm)error->code;
    FbAlarm alarm = {.code = (uint16_t)code, .text = text, .advice = sim_alarm_advice(code)};
    machine->refused++;
    g_printerr("vcnc: alarm %u: %s\n", alarm.code, error->message);
    if (machine->options.log)
        sim_log_refused(machine->options.log, alarm.code, error->message);
    tell(machine, FB_MACHINE_REFUSED, &alarm);
}

static void examined(GObject *source, GAsyncResult *result, void *data)
{
    (void)source;
    SimMachine *machine = data;
    g_autoptr(GError) error = NULL;
    g_autoptr(SimProgram) program = g_task_propagate_pointer(G_TASK(result), &error);
    machine->examinations--;
    if (machine->examination != G_TASK(result))
        return;
    machine->examination = NULL;
    if (!program) {
        refuse(machine, error);
        return;
    }
    if (machine->options.log)
        sim_log_program(machine->options.log, program);
    step(machine, SIM_LOAD, g_steal_pointer(&program));
}

/* Reading and planning a long program takes seconds; the link must not wait for it. */
static void examine(SimMachine *machine)
{
    Examination *examination = g_new0(Examination, 1);
    const uint64_t *gates = fb_receiver_gates(machine->receiver, &examination->n_gates);
    examination->bytes = g_bytes_ref(fb_receiver_program(machine->receiver));
    examination->gates = g_memdup2(gates, examination->n_gates * sizeof *gates);
    examination->machine = machine->options.machine;
    examination->tools = machine->options.tools;
    g_autoptr(GTask) task = g_task_new(NULL, NULL, examined, machine);
    g_task_set_task_data(task, examination, examination_free);
    machine->examination = task;
    machine->examinations++;
    g_task_run_in_thread(task, examine_in_thread);
}

/* -------------------------------------------------------------------------- steps */

static void step(SimMachine *machine, SimEventKind kind, SimProgram *program)
{
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(SimAction));
    SimEvent event = {.kind = kind, .program = program};
    if (kind == SIM_ESTOP)
        machine->examination = NULL;
    sim_controller_step(machine->controller, &event, g_get_monotonic_time(), actions);
    FbProgress progress = sim_controller_progress(machine->controller);
    fb_receiver_progress(machine->receiver, &progress);
    bool moving = sim_controller_moving(machine->controller);
    int64_t pause_us = isfinite(machine->options.speed) ? TICK_US : 0;
    g_source_set_ready_time(machine->clock, moving ? g_get_monotonic_time() + pause_us : -1);
    for (guint i = 0; i < actions->len; i++)
        carry_out(machine, &g_array_index(actions, SimAction, i));
}

static void carry_out(SimMachine *machine, const SimAction *action)
{
    SimLog *log = machine->options.log;
    FbAlarm estop = {.code = SIM_ALARM_ESTOP,
                     .text = sim_alarm_text(SIM_ALARM_ESTOP),
                     .advice = sim_alarm_advice(SIM_ALARM_ESTOP)};
    switch (action->kind) {
    case SIM_STATE:
        if (log)
            sim_log_state(log, action->state, action->time_s);
        break;
    case SIM_BLOCK:
        if (log)
            sim_log_block(log, &action->block);
        break;
    case SIM_TELL:
        tell(machine, action->event, action->event == FB_MACHINE_ESTOP ? &estop : NULL);
        break;
    }
}

/* What the receiver asks for in turn is done when it has taken the event. */
static void tell(SimMachine *machine, FbMachineEvent event, const FbAlarm *alarm)
{
    g_autoptr(GArray) todo = g_array_new(FALSE, FALSE, sizeof(FbDo));
    fb_receiver_machine(machine->receiver, event, alarm, g_get_monotonic_time(), todo);
    for (guint i = 0; i < todo->len; i++)
        act(g_array_index(todo, FbDo, i), machine);
}

/* -------------------------------------------------------------------------- clock */

typedef struct {
    GSource source;
    SimMachine *machine;
} Clock;

static gboolean clock_dispatch(GSource *source, GSourceFunc callback, void *data)
{
    (void)callback, (void)data;
    step(((Clock *)source)->machine, SIM_TICK, NULL);
    return G_SOURCE_CONTINUE;
}

/* Has the sockets' priority: at --speed max each turn of the loop serves both. */
static GSource *clock_new(SimMachine *machine)
{
    static GSourceFuncs functions = {.dispatch = clock_dispatch};
    GSource *source = g_source_new(&functions, sizeof(Clock));
    ((Clock *)source)->machine = machine;
    g_source_attach(source, NULL);
    return source;
}
