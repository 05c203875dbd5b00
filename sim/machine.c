/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/machine.h"

#include <gio/gio.h>
#include <math.h>

#include "sim/alarm.h"
#include "sim/feed.h"
#include "sim/setup.h"
#include "sim/summary.h"

/* How often the clock is looked at while a program runs, and while it waits for bytes. */
#define TICK_US 5000
#define STARVING_TICK_US 100000

/* A step that executes this many blocks and logs them takes some milliseconds: that is how long a
 * request may wait at --speed max. */
#define MOVES_PER_STEP 1000

/* The lease lapses after this multiple of the agent's time-out, as in docs/protocol.md, 6.2. */
#define LEASE_PER_AGENT_TIMEOUT 6

#define UNIT_ID 1

/* With nobody there: how often it looks, and how long the machine stands before it acknowledges. An
 * agent with the default heartbeat has seen the alarm by then. */
#define ATTEND_MS 50
#define ATTEND_US 1000000

struct SimMachine {
    SimMachineOptions options;
    SimController *controller;
    FbReceiver *receiver;
    FbModbusServer *plain, *secure; /* Modbus; NULL: not asked for */
    FbCanServer *can;               /* as well */
    GSource *clock;
    SimFeed *feed;
    bool verifying;   /* what is being examined is the answer to VERIFY */
    size_t n_fed;     /* passes given to `feed` */
    unsigned refused; /* programs, at VERIFY and while they dripped */
    FbAlarm fault;    /* why a pass cannot be executed; code 0: all can. Or of a fault on purpose */
    char *fault_text; /* its text */
    bool off;         /* the power is cut */
    guint attending;  /* source; 0: a person is there */
    int64_t asked_us; /* since when it wants an acknowledgement; 0: it does not */
};

static void act(FbDo what, void *data);
static bool listen_on(SimMachine *machine, const SimAddress *at, const CfgTls *tls,
                      FbModbusServer **server, GError **error);
static bool join_can(SimMachine *machine, GError **error);
static void examine(SimMachine *machine);
static void feed_more(SimMachine *machine);
static void examined(GPtrArray *programs, const GError *error, void *data);
static void planned(SimProgram *program, SimPlan *plan, void *data);
static NcOverride override_in_force(const SimMachine *machine);
static void step(SimMachine *machine, SimEvent event);
static void step_by(SimMachine *machine, SimEventKind kind);
static void carry_out(SimMachine *machine, const SimAction *action);
static void tell(SimMachine *machine, FbMachineEvent event, const FbAlarm *alarm);
static void publish_setup(SimMachine *machine, int work_offset);
static GSource *clock_new(SimMachine *machine);
static void count_jobs(SimMachine *machine, SimTotals before);
static void end_job(SimMachine *machine, bool complete);
static void removed(const SimRemoval *removal, void *data);
static void raise_alarm(SimMachine *machine, const FbAlarm *alarm);
static void do_faults(SimMachine *machine, SimFaultEvent event, double time_s, FbFate *fate);
static FbFate fate_of_reply(void *data);
static gboolean attend(void *data);

SimMachine *sim_machine_new(const SimMachineOptions *options, GError **error)
{
    g_autoptr(SimMachine) machine = g_new0(SimMachine, 1);
    const CfgMachine *cfg = options->machine;
    machine->options = *options;
    SimControllerOptions controller = {
        .machine = cfg,
        .speed = options->speed,
        .moves_per_step = MOVES_PER_STEP,
        .course = options->material ? sim_material_course(options->material) : NULL};
    machine->controller = sim_controller_new(&controller);
    int64_t agent_timeout_us = (int64_t)(cfg->agent_timeout_s * 1e6);
    FbReceiverOptions receiver = {.epoch = options->epoch,
                                  .memory_bytes = cfg->program_memory_bytes,
                                  .on_agent_loss = cfg->on_agent_loss,
                                  .agent_timeout_us = agent_timeout_us,
                                  .lease_timeout_us = LEASE_PER_AGENT_TIMEOUT * agent_timeout_us};
    machine->receiver = fb_receiver_new(&receiver);
    SimFeedCallbacks feed = {.examined = examined, .planned = planned, .data = machine};
    machine->feed = sim_feed_new(cfg, options->tools, &feed);
    sim_feed_set_material(machine->feed, options->material);
    publish_setup(machine, 54);
    if (options->tools->n_tools > FB_TOOLS_MOST)
        g_printerr("vcnc: the tool table has %zu tools: the %d with the lowest numbers are "
                   "published, programs may use all\n",
                   options->tools->n_tools, FB_TOOLS_MOST);
    machine->clock = clock_new(machine);
    if (!listen_on(machine, &options->plain, NULL, &machine->plain, error) ||
        !listen_on(machine, &options->secure, &cfg->tls, &machine->secure, error) ||
        !join_can(machine, error))
        return NULL;
    step_by(machine, SIM_TICK);
    if (options->faults)
        do_faults(machine, (SimFaultEvent){.kind = SIM_FAULT_BOOTED}, 0, NULL);
    if (options->acknowledge) {
        attend(machine);
        machine->attending = g_timeout_add(ATTEND_MS, attend, machine);
    }
    return g_steal_pointer(&machine);
}

static bool listen_on(SimMachine *machine, const SimAddress *at, const CfgTls *tls,
                      FbModbusServer **server, GError **error)
{
    const FbModbusServerOptions options = {
        .host = at->host, .port = at->port, .unit_id = UNIT_ID, .tls = tls};
    if (at->host)
        *server = fb_modbus_server_new(&options, machine->receiver, act, machine, NULL, error);
    if (*server && machine->options.faults)
        fb_modbus_server_filter(*server, fate_of_reply, machine);
    return !at->host || *server;
}

static bool join_can(SimMachine *machine, GError **error)
{
    const CfgMachine *cfg = machine->options.machine;
    const FbCanOptions options = {.interface = machine->options.can_interface,
                                  .key_file = cfg->can_key,
                                  .base = (uint16_t)cfg->can_base,
                                  .agents = (unsigned)cfg->can_agents};
    if (!options.interface)
        return true;
    if (!options.key_file) {
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                    "a CAN bus needs a key: [can] key in the machine file");
        return false;
    }
    machine->can = fb_can_server_new(&options, machine->receiver, act, machine, NULL, error);
    if (machine->can && machine->options.faults)
        fb_can_server_filter(machine->can, fate_of_reply, machine);
    return machine->can != NULL;
}

void sim_machine_free(SimMachine *machine)
{
    if (!machine)
        return;
    g_clear_handle_id(&machine->attending, g_source_remove);
    g_clear_pointer(&machine->plain, fb_modbus_server_free);
    g_clear_pointer(&machine->secure, fb_modbus_server_free);
    g_clear_pointer(&machine->can, fb_can_server_free);
    sim_feed_free(machine->feed);
    g_source_destroy(machine->clock);
    g_source_unref(machine->clock);
    fb_receiver_free(machine->receiver);
    sim_controller_free(machine->controller);
    g_free(machine->fault_text);
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
    step_by(machine, button);
}

bool sim_machine_owned(const SimMachine *machine)
{
    FbStatus status;
    fb_receiver_status(machine->receiver, g_get_monotonic_time(), &status);
    return status.lease_owner != 0 && !status.agent_lost;
}

char *sim_machine_summary(const SimMachine *machine)
{
    const SimSummary summary = {
        .totals = sim_controller_totals(machine->controller),
        .executed_blocks = sim_controller_progress(machine->controller).executed_blocks,
        .refused = machine->refused,
        .answers = fb_receiver_counts(machine->receiver),
        .plain = machine->plain,
        .secure = machine->secure,
        .can = machine->can,
    };
    return sim_summary(&summary);
}

static void act(FbDo what, void *data)
{
    SimMachine *machine = data;
    switch (what) {
    case FB_DO_VERIFY:
        examine(machine);
        break;
    case FB_DO_START:
        step_by(machine, SIM_START);
        break;
    case FB_DO_RESTART:
        step(machine,
             (SimEvent){.kind = SIM_RESTART, .gate = fb_receiver_restart_gate(machine->receiver)});
        break;
    case FB_DO_PASS:
        feed_more(machine);
        break;
    case FB_DO_HOLD:
        step_by(machine, SIM_HOLD);
        break;
    case FB_DO_HOLD_AT_GATE:
        step_by(machine, SIM_HOLD_AT_GATE);
        break;
    case FB_DO_RESUME:
        step_by(machine, SIM_RESUME);
        break;
    case FB_DO_ABORT:
        step_by(machine, SIM_ABORT);
        break;
    case FB_DO_OVERRIDE:
        step(machine, (SimEvent){.kind = SIM_OVERRIDE, .override = override_in_force(machine)});
        break;
    case FB_DO_OPTIONAL_STOP:
        step(machine, (SimEvent){.kind = SIM_OPTIONAL_STOP,
                                 .on = fb_receiver_overrides(machine->receiver).optional_stop});
        break;
    case FB_DO_FORGET:
        machine->verifying = false;
        sim_feed_begin(machine->feed);
        step_by(machine, SIM_FORGET);
        break;
    }
}

static NcOverride override_in_force(const SimMachine *machine)
{
    FbArguments o = fb_receiver_overrides(machine->receiver);
    return (NcOverride){o.feed_percent, o.rapid_percent, o.spindle_percent};
}

/* -------------------------------------------------------------------- examination */

static void examine(SimMachine *machine)
{
    sim_feed_begin(machine->feed);
    machine->verifying = true;
    machine->n_fed = 0;
    machine->fault.code = 0;
    if (fb_receiver_drips(machine->receiver)) {
        feed_more(machine);
        return;
    }
    size_t n;
    const uint64_t *gates = fb_receiver_gates(machine->receiver, &n);
    sim_feed_program(machine->feed, fb_receiver_program(machine->receiver), gates, n,
                     override_in_force(machine));
}

/* Has the passes examined that were released since. */
static void feed_more(SimMachine *machine)
{
    const size_t released = fb_receiver_released(machine->receiver);
    if (sim_feed_busy(machine->feed) || machine->fault.code != 0 || machine->n_fed >= released)
        return;
    size_t n;
    fb_receiver_gates(machine->receiver, &n);
    GPtrArray *passes = g_ptr_array_new_with_free_func((GDestroyNotify)g_bytes_unref);
    for (; machine->n_fed < released; machine->n_fed++)
        g_ptr_array_add(passes, fb_receiver_pass(machine->receiver, machine->n_fed));
    sim_feed_passes(machine->feed, passes, released == n, override_in_force(machine));
}

/* Keeps why, for an alarm, now or when the gate before is reached. */
static void refuse(SimMachine *machine, const GError *error)
{
    SimAlarm code = (SimAlarm)error->code;
    g_free(machine->fault_text);
    machine->fault_text = g_utf8_make_valid(error->message, -1);
    machine->fault = (FbAlarm){
        .code = (uint16_t)code, .text = machine->fault_text, .advice = sim_alarm_advice(code)};
    machine->refused++;
    g_printerr("vcnc: alarm %u: %s\n", machine->fault.code, error->message);
    if (machine->options.log)
        sim_log_refused(machine->options.log, machine->fault.code, error->message);
}

/* The answer to VERIFY. */
static void load(SimMachine *machine, GPtrArray *programs)
{
    SimLog *log = machine->options.log;
    const bool drips = fb_receiver_drips(machine->receiver);
    SimProgram *whole = drips ? NULL : sim_program_ref(g_ptr_array_index(programs, 0));
    FbStatus status;
    fb_receiver_status(machine->receiver, g_get_monotonic_time(), &status);
    if (log && drips)
        sim_log_passes(log, status.id, status.gates);
    else if (log)
        sim_log_program(log, status.id, sim_program_duration_s(whole));
    step(machine, (SimEvent){.kind = SIM_LOAD, .program = whole});
}

static void examined(GPtrArray *programs, const GError *error, void *data)
{
    SimMachine *machine = data;
    const bool verifying = machine->verifying;
    machine->verifying = false;
    if (error)
        refuse(machine, error);
    if (verifying && error) {
        tell(machine, FB_MACHINE_REFUSED, &machine->fault);
        if (machine->options.calls.ended)
            machine->options.calls.ended(false, machine->options.calls.data);
        return;
    }
    if (verifying)
        load(machine, programs);
    if (!fb_receiver_drips(machine->receiver))
        return;
    for (guint i = 0; i < programs->len; i++)
        step(machine, (SimEvent){.kind = SIM_PASS,
                                 .program = sim_program_ref(g_ptr_array_index(programs, i))});
    if (error)
        step_by(machine, SIM_PASS);
    feed_more(machine);
}

static void planned(SimProgram *program, SimPlan *plan, void *data)
{
    step(data, (SimEvent){.kind = SIM_PLAN, .program = program, .plan = plan});
}

/* -------------------------------------------------------------------------- steps */

static void step(SimMachine *machine, SimEvent event)
{
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(SimAction));
    const SimTotals before = sim_controller_totals(machine->controller);
    if (machine->off) {
        sim_plan_unref(event.plan);
        if (!event.plan)
            sim_program_unref(event.program);
        return;
    }
    if (event.kind == SIM_ESTOP && machine->verifying) {
        machine->verifying = false;
        sim_feed_begin(machine->feed);
    }
    sim_controller_step(machine->controller, &event, g_get_monotonic_time(), actions);
    FbProgress progress = sim_controller_progress(machine->controller);
    fb_receiver_progress(machine->receiver, &progress);
    if (progress.work_offset != fb_receiver_setup(machine->receiver)->work_offset)
        publish_setup(machine, progress.work_offset);
    NcOverride override;
    SimProgram *unplanned = sim_controller_unplanned(machine->controller, &override);
    if (unplanned)
        sim_feed_plan(machine->feed, unplanned, override);
    bool moving = sim_controller_moving(machine->controller);
    int64_t pause_us = !moving ? STARVING_TICK_US : isfinite(machine->options.speed) ? TICK_US : 0;
    g_source_set_ready_time(machine->clock,
                            moving || progress.starving ? g_get_monotonic_time() + pause_us : -1);
    for (guint i = 0; i < actions->len; i++)
        carry_out(machine, &g_array_index(actions, SimAction, i));
    count_jobs(machine, before);
}

static void step_by(SimMachine *machine, SimEventKind kind)
{
    step(machine, (SimEvent){.kind = kind});
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
    case SIM_WAY:
        if (log)
            sim_log_way(log, &action->block);
        break;
    case SIM_MESSAGE:
        g_printerr("vcnc: line %u: %s\n", action->line, action->text);
        if (log)
            sim_log_message(log, action->line, action->text, action->time_s);
        g_free(action->text);
        break;
    case SIM_OVERRIDES:
        if (log)
            sim_log_override(log, action->override, action->time_s);
        break;
    case SIM_WOKEN:
        do_faults(machine, (SimFaultEvent){.kind = SIM_FAULT_TICK, .line = action->line},
                  action->time_s, NULL);
        break;
    case SIM_TELL:
        tell(machine, action->event,
             action->event == FB_MACHINE_ESTOP   ? &estop
             : action->event == FB_MACHINE_ALARM ? &machine->fault
                                                 : NULL);
        break;
    }
}

static void publish_setup(SimMachine *machine, int work_offset)
{
    FbSetup setup = sim_setup(machine->options.machine, machine->options.tools, work_offset);
    fb_receiver_set_setup(machine->receiver, &setup);
}

/* What the receiver asks for in turn is done when it has taken the event. */
static void tell(SimMachine *machine, FbMachineEvent event, const FbAlarm *alarm)
{
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    fb_receiver_machine(machine->receiver, event, alarm, g_get_monotonic_time(), actions);
    for (guint i = 0; i < actions->len; i++)
        act(g_array_index(actions, FbDo, i), machine);
}

/* ------------------------------------------------------------------ jobs and faults */

static void count_jobs(SimMachine *machine, SimTotals before)
{
    const SimTotals now = sim_controller_totals(machine->controller);
    const bool complete = now.completed > before.completed;
    const bool bad = now.aborted > before.aborted || now.stopped > before.stopped;
    if (complete || bad)
        end_job(machine, complete);
}

/* A run, and whether it was completed. */
typedef struct {
    SimMachine *machine;
    bool complete;
} Ended;

static void end_job(SimMachine *machine, bool complete)
{
    const SimMachineCalls *calls = &machine->options.calls;
    if (machine->options.material) {
        Ended *ended = g_new(Ended, 1);
        *ended = (Ended){machine, complete};
        if (machine->options.log)
            sim_log_hold(machine->options.log);
        sim_material_remove(machine->options.material, removed, ended);
    } else if (calls->ended) {
        calls->ended(complete, calls->data);
    }
}

/* The material of a run has been removed. */
static void removed(const SimRemoval *removal, void *data)
{
    g_autofree Ended *ended = data;
    SimMachine *machine = ended->machine;
    const SimMachineCalls *calls = &machine->options.calls;
    sim_material_report(removal, machine->options.log);
    if (removal->collisions->len > 0 && machine->options.collision_alarm && !machine->off) {
        g_autofree char *text =
            sim_collision_text(&g_array_index(removal->collisions, NcCollision, 0));
        const FbAlarm alarm = {SIM_ALARM_COLLISION, text, sim_alarm_advice(SIM_ALARM_COLLISION)};
        raise_alarm(machine, &alarm);
    }
    if (calls->ended)
        calls->ended(ended->complete && removal->collisions->len == 0 && !removal->error,
                     calls->data);
}

static bool is_in_run(const SimMachine *machine)
{
    const SimTotals t = sim_controller_totals(machine->controller);
    return t.started > t.completed + t.aborted + t.stopped;
}

void sim_machine_settle(SimMachine *machine)
{
    if (!machine->options.material)
        return;
    const bool was_on = !machine->off;
    machine->off = true;
    if (was_on && is_in_run(machine))
        end_job(machine, false);
    sim_material_settle(machine->options.material);
}

/* A run that is cut off has ended, too. */
static void cut_power(SimMachine *machine)
{
    const SimMachineCalls *calls = &machine->options.calls;
    machine->off = true;
    if (is_in_run(machine))
        end_job(machine, false);
    if (calls->cut)
        calls->cut(calls->data);
}

static void raise_alarm(SimMachine *machine, const FbAlarm *alarm)
{
    g_free(machine->fault_text);
    machine->fault_text = g_strdup(alarm->text);
    machine->fault = (FbAlarm){alarm->code, machine->fault_text, alarm->advice};
    step_by(machine, SIM_FAIL);
}

/* `fate`: of the reply that is about to go. */
static void do_faults(SimMachine *machine, SimFaultEvent event, double time_s, FbFate *fate)
{
    SimFaults *faults = machine->options.faults;
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(SimFaultDo));
    sim_faults_step(faults, &event, time_s, actions);
    sim_controller_wake(machine->controller, sim_faults_next(faults));
    for (guint i = 0; i < actions->len; i++) {
        const SimFaultDo *what = &g_array_index(actions, SimFaultDo, i);
        if (what->kind == SIM_FAULT_DO_NOTE && machine->options.log)
            sim_log_fault(machine->options.log, what->spec, time_s);
        else if (what->kind == SIM_FAULT_DO_EVENT && what->event == SIM_FAIL)
            raise_alarm(machine, &what->alarm);
        else if (what->kind == SIM_FAULT_DO_EVENT)
            step_by(machine, what->event);
        else if (what->kind == SIM_FAULT_DO_CUT)
            cut_power(machine);
        else if (what->kind == SIM_FAULT_DO_FATE)
            *fate = what->fate;
    }
}

static FbFate fate_of_reply(void *data)
{
    SimMachine *machine = data;
    const FbProgress now = sim_controller_progress(machine->controller);
    FbFate fate = {.copies = 1};
    do_faults(machine, (SimFaultEvent){.kind = SIM_FAULT_FRAME}, now.program_time_ms / 1000.0,
              &fate);
    return fate;
}

/* ------------------------------------------------------------------ nobody is there */

static gboolean attend(void *data)
{
    SimMachine *machine = data;
    const int64_t now_us = g_get_monotonic_time();
    FbStatus status;
    fb_receiver_status(machine->receiver, now_us, &status);
    const bool fresh = status.state == FB_STATE_OFF;
    const bool wanted = fresh || status.state == FB_STATE_ALARM || status.state == FB_STATE_ESTOP ||
                        status.needs_acknowledge;
    if (!wanted || sim_controller_moving(machine->controller))
        machine->asked_us = 0;
    else if (machine->asked_us == 0)
        machine->asked_us = now_us;
    if (fresh || (machine->asked_us > 0 && now_us - machine->asked_us >= ATTEND_US)) {
        machine->asked_us = 0;
        step_by(machine, SIM_ACKNOWLEDGE);
    }
    return G_SOURCE_CONTINUE;
}

/* -------------------------------------------------------------------------- clock */

typedef struct {
    GSource source;
    SimMachine *machine;
} Clock;

static gboolean clock_dispatch(GSource *source, GSourceFunc callback, void *data)
{
    (void)callback, (void)data;
    step_by(((Clock *)source)->machine, SIM_TICK);
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
