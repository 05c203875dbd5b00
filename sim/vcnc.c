/* SPDX-License-Identifier: Apache-2.0 */
/*
 * vcnc, the virtual CNC: a machine on the network that takes a program, examines it and executes it
 * on a virtual clock. docs/vcnc.1 and docs/vcnc.md are its manual.
 */
#include <errno.h>
#include <glib-unix.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "sim/options.h"

enum { EXIT_DONE = 0, EXIT_FAILED = 1, EXIT_USAGE = 2, EXIT_CONFIGURATION = 3 };

/* Behind the last job agents have this long to see how it ended: a second connection and a
 * heartbeat, as they are by default. One that keeps the lease has the longer time. */
#define LINGER_US 2000000
#define LINGER_OWNER_US 15000000
#define LINGER_LOOK_MS 50

typedef struct {
    const SimOptions *options;
    GMainLoop *loop;
    SimMachine *machine; /* NULL: switched off */
    SimFaults *faults;   /* NULL: none */
    GString *input;      /* of the operator, up to the next newline */
    bool cut;            /* the power: the machine begins anew, */
    bool over;           /* unless it was the last time */
    unsigned jobs;       /* that have ended, */
    unsigned bad;        /* and not completed */
    int64_t ended_us;    /* when the last one that was asked for did; 0: not yet */
} Program;

static int serve(const SimOptions *options);
static int run(Program *program, SimMachineOptions *how, GError **error);
static bool serve_once(Program *program, SimMachineOptions *how, GError **error);
static gboolean operator_input(int fd, GIOCondition condition, void *data);
static void operator_command(SimMachine *machine, const char *command);

int main(int argc, char **argv)
{
    g_autoptr(GError) error = NULL;
    g_auto(SimOptions) options = {0};
    if (!sim_options_parse(&options, argc, argv, &error)) {
        g_printerr("vcnc: %s\nTry vcnc --help.\n", error->message);
        return EXIT_USAGE;
    }
    return serve(&options);
}

/* ------------------------------------------------------------------------ serving */

static int failed(int status, const GError *error)
{
    g_printerr("vcnc: %s\n", error->message);
    return status;
}

/* Another one than before, with all likelihood, and never 0. */
static bool random_epoch(uint32_t *epoch, GError **error)
{
    do {
        if (getrandom(epoch, sizeof *epoch, 0) != sizeof *epoch) {
            g_set_error(error, G_FILE_ERROR, (int)g_file_error_from_errno(errno),
                        "the kernel gives no random number: %s", g_strerror(errno));
            return false;
        }
    } while (*epoch == 0);
    return true;
}

/* Plain Modbus knows nobody. */
static bool may_listen(const SimOptions *options, const CfgMachine *machine, GError **error)
{
    const char *host = options->plain.host;
    if (!host || fb_is_loopback(host))
        return true;
    if (!machine->beyond_loopback) {
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                    "--modbus %s: everybody who reaches it could command this machine: use --tls, "
                    "or set [modbus] beyond_loopback = true in %s",
                    options->modbus, options->machine);
        return false;
    }
    g_printerr("vcnc: listening on %s: everybody who reaches it can command this machine\n", host);
    return true;
}

static int exit_of(const GError *error)
{
    return g_error_matches(error, FB_ERROR, FB_ERROR_CREDENTIALS) ? EXIT_CONFIGURATION
                                                                  : EXIT_FAILED;
}

/* NULL without an error: nothing is clamped. */
static SimMaterial *clamp(const SimOptions *options, const CfgMachine *machine,
                          const CfgToolTable *tools, GError **error)
{
    const SimMaterialOptions how = {.machine = machine,
                                    .tools = tools,
                                    .stock = options->stock,
                                    .model = options->model,
                                    .pitch_mm = options->pitch_mm};
    return options->stock ? sim_material_new(&how, error) : NULL;
}

static int serve(const SimOptions *options)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgMachine) machine = cfg_machine_load(options->machine, &error);
    g_autoptr(CfgToolTable) tools = machine ? cfg_tools_load(machine->tools_file, &error) : NULL;
    if (!tools)
        return failed(EXIT_CONFIGURATION, error);
    g_autoptr(SimFaults) faults = options->script ? sim_faults_new(options->script) : NULL;
    Program program = {.options = options, .faults = faults};
    g_autoptr(SimMaterial) material = clamp(options, machine, tools, &error);
    if (error)
        return failed(EXIT_CONFIGURATION, error);
    SimMachineOptions how = {.machine = machine,
                             .tools = tools,
                             .plain = options->plain,
                             .secure = options->secure,
                             .can_interface = options->can,
                             .speed = options->speed,
                             .acknowledge = options->acknowledge,
                             .material = material,
                             .collision_alarm = options->collision_alarm,
                             .faults = faults};
    if (!may_listen(options, machine, &error))
        return failed(EXIT_CONFIGURATION, error);
    if (options->log && !(how.log = sim_log_open(options->log, &error)))
        return failed(EXIT_FAILED, error);
    if (options->script && options->script->rate > 0)
        g_printerr("vcnc: --fault random:%u:%g\n", options->script->seed, options->script->rate);
    int status = run(&program, &how, &error);
    if (error)
        failed(status, error);
    g_clear_error(&error);
    if (how.log && !sim_log_close(how.log, &error))
        return failed(EXIT_FAILED, error);
    return status;
}

static gboolean quit(void *data)
{
    Program *program = data;
    program->over = true;
    g_main_loop_quit(program->loop);
    return G_SOURCE_CONTINUE;
}

/* Until the power is on for the last time. */
static int run(Program *program, SimMachineOptions *how, GError **error)
{
    bool good;
    program->loop = g_main_loop_new(NULL, FALSE);
    program->input = g_string_new(NULL);
    const guint sources[] = {
        g_unix_signal_add(SIGTERM, quit, program), g_unix_signal_add(SIGINT, quit, program),
        g_unix_fd_add(STDIN_FILENO, G_IO_IN | G_IO_HUP | G_IO_ERR, operator_input, program)};
    signal(SIGPIPE, SIG_IGN);
    /* In the background of a terminal reading must fail, not stop the machine. */
    signal(SIGTTIN, SIG_IGN);
    do {
        if (program->cut && how->log)
            sim_log_state(how->log, FB_STATE_OFF, 0);
        program->cut = false;
        good = serve_once(program, how, error);
    } while (good && program->cut && !program->over);
    for (size_t i = 0; i < G_N_ELEMENTS(sources); i++)
        if (g_main_context_find_source_by_id(NULL, sources[i]))
            g_source_remove(sources[i]);
    g_string_free(program->input, TRUE);
    g_main_loop_unref(program->loop);
    if (!good)
        return exit_of(*error);
    return program->ended_us > 0 && program->bad > 0 ? EXIT_FAILED : EXIT_DONE;
}

/* ---------------------------------------------------------------------------- jobs */

/* Whether behind the last job everybody has had the time to see how it ended. */
static gboolean look_for_end(void *data)
{
    Program *program = data;
    const int64_t since_us = g_get_monotonic_time() - program->ended_us;
    const bool owned = program->machine && sim_machine_owned(program->machine);
    if (since_us < (owned ? LINGER_OWNER_US : LINGER_US))
        return G_SOURCE_CONTINUE;
    quit(program);
    return G_SOURCE_REMOVE;
}

static void job_ended(bool complete, void *data)
{
    Program *program = data;
    if (program->ended_us > 0)
        return;
    program->jobs++;
    program->bad += !complete;
    if (program->jobs != program->options->jobs)
        return;
    program->ended_us = g_get_monotonic_time();
    g_timeout_add(LINGER_LOOK_MS, look_for_end, program);
}

static void power_cut(void *data)
{
    Program *program = data;
    program->cut = true;
    g_main_loop_quit(program->loop);
}

/* ------------------------------------------------------------------------ one epoch */

static void print_address(const char *scheme, const SimAddress *at, uint16_t port)
{
    if (at->host)
        g_print(strchr(at->host, ':') ? "%s [%s]:%u\n" : "%s %s:%u\n", scheme, at->host, port);
}

static void print_addresses(const SimMachineOptions *how)
{
    print_address("modbus", &how->plain, how->plain.port);
    print_address("mbaps", &how->secure, how->secure.port);
    if (how->can_interface)
        g_print("can %s\n", how->can_interface);
    fflush(stdout);
}

static void print_summary(const Program *program, const SimMaterial *material)
{
    g_autofree char *summary = sim_machine_summary(program->machine);
    g_autofree char *faults =
        program->faults && !program->cut ? sim_faults_summary(program->faults) : NULL;
    g_autofree char *removed = material ? sim_material_summary(material) : NULL;
    g_print("%s%s%s", summary, removed ? removed : "", faults ? faults : "");
    fflush(stdout);
}

/* From power on to power off. What port 0 became is kept: the machine comes back there. */
static bool serve_once(Program *program, SimMachineOptions *how, GError **error)
{
    how->calls = (SimMachineCalls){.ended = job_ended, .cut = power_cut, .data = program};
    if (!random_epoch(&how->epoch, error) || !(program->machine = sim_machine_new(how, error)))
        return false;
    how->plain.port = sim_machine_port(program->machine);
    how->secure.port = sim_machine_tls_port(program->machine);
    print_addresses(how);
    g_main_loop_run(program->loop);
    sim_machine_settle(program->machine);
    print_summary(program, how->material);
    SimMachine *machine = g_steal_pointer(&program->machine);
    sim_machine_free(machine);
    return true;
}

/* ----------------------------------------------------------------------- operator */

static gboolean operator_input(int fd, GIOCondition condition, void *data)
{
    (void)condition;
    Program *program = data;
    char bytes[256];
    ssize_t n = read(fd, bytes, sizeof bytes);
    if (n < 0 && (errno == EAGAIN || errno == EINTR))
        return G_SOURCE_CONTINUE;
    if (n <= 0)
        return G_SOURCE_REMOVE;
    for (ssize_t i = 0; i < n; i++) {
        if (bytes[i] == '\n') {
            operator_command(program->machine, g_strstrip(program->input->str));
            g_string_truncate(program->input, 0);
        } else if (program->input->len < sizeof bytes) {
            g_string_append_c(program->input, bytes[i]);
        }
    }
    return G_SOURCE_CONTINUE;
}

static void operator_command(SimMachine *machine, const char *command)
{
    static const struct {
        const char *word;
        SimEventKind button;
    } buttons[] = {
        {"ack", SIM_ACKNOWLEDGE}, {"estop", SIM_ESTOP}, {"hold", SIM_HOLD}, {"resume", SIM_RESUME}};
    if (!machine || *command == '\0')
        return;
    for (size_t i = 0; i < G_N_ELEMENTS(buttons); i++)
        if (strcmp(command, buttons[i].word) == 0) {
            sim_machine_press(machine, buttons[i].button);
            return;
        }
    g_printerr("vcnc: \"%s\": commands at the machine are ack, estop, hold and resume\n", command);
}
