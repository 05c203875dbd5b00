/* SPDX-License-Identifier: Apache-2.0 */
/*
 * vcnc, the virtual CNC: a machine on the network that takes a program, examines it and executes it
 * on a virtual clock. docs/vcnc.md is its manual.
 */
#include <errno.h>
#include <gio/gio.h>
#include <glib-unix.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "sim/machine.h"

enum { EXIT_DONE = 0, EXIT_FAILED = 1, EXIT_USAGE = 2, EXIT_CONFIGURATION = 3 };

#define DEFAULT_ADDRESS "127.0.0.1"
#define DEFAULT_PORT 1502
#define DEFAULT_TLS_PORT 1802

typedef struct {
    char *machine, *modbus, *tls, *can, *speed_text, *log;
    SimAddress plain, secure;
    double speed;
} Options;

typedef struct {
    GMainLoop *loop;
    SimMachine *machine;
    GString *input; /* of the operator, up to the next newline */
} Program;

static bool parse_options(Options *options, int argc, char **argv, GError **error);
static int serve(const Options *options);
static int run(SimMachine *machine, const Options *options);
static gboolean operator_input(int fd, GIOCondition condition, void *data);
static void operator_command(SimMachine *machine, const char *command);

static void options_clear(Options *options)
{
    g_free(options->machine);
    g_free(options->modbus);
    g_free(options->tls);
    g_free(options->can);
    g_free(options->speed_text);
    g_free(options->log);
    g_free(options->plain.host);
    g_free(options->secure.host);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Options, options_clear)

int main(int argc, char **argv)
{
    g_autoptr(GError) error = NULL;
    g_auto(Options) options = {0};
    if (!parse_options(&options, argc, argv, &error)) {
        g_printerr("vcnc: %s\nTry vcnc --help.\n", error->message);
        return EXIT_USAGE;
    }
    return serve(&options);
}

/* ------------------------------------------------------------------------ options */

static bool parse_speed(Options *options, GError **error)
{
    const char *text = options->speed_text ? options->speed_text : "1";
    char *end;
    if (strcmp(text, "max") == 0) {
        options->speed = INFINITY;
        return true;
    }
    options->speed = g_ascii_strtod(text, &end);
    if (*text != '\0' && *end == '\0' && isfinite(options->speed) && options->speed > 0)
        return true;
    g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_BAD_VALUE,
                "--speed %s: give a number above 0, or max", text);
    return false;
}

static bool parse_address(const char *option, const char *text, uint16_t port, SimAddress *to,
                          GError **error)
{
    g_autoptr(GError) cause = NULL;
    g_autoptr(GSocketConnectable) address = g_network_address_parse(text, port, &cause);
    const char *host = address ? g_network_address_get_hostname(G_NETWORK_ADDRESS(address)) : "";
    if (*host == '\0') {
        g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_BAD_VALUE,
                    "%s %s: give HOST:PORT, for example 127.0.0.1:0", option, text);
        return false;
    }
    to->host = g_strdup(host);
    to->port = g_network_address_get_port(G_NETWORK_ADDRESS(address));
    return true;
}

/* Plain Modbus on loopback, unless something else was asked for. */
static bool parse_addresses(Options *options, GError **error)
{
    const char *plain =
        options->modbus || options->tls || options->can ? options->modbus : DEFAULT_ADDRESS;
    return (!plain || parse_address("--modbus", plain, DEFAULT_PORT, &options->plain, error)) &&
           (!options->tls ||
            parse_address("--tls", options->tls, DEFAULT_TLS_PORT, &options->secure, error));
}

static bool parse_options(Options *options, int argc, char **argv, GError **error)
{
    const GOptionEntry entries[] = {
        {"machine", 0, 0, G_OPTION_ARG_FILENAME, &options->machine, "The machine (INI file)",
         "FILE"},
        {"modbus", 0, 0, G_OPTION_ARG_STRING, &options->modbus,
         "Where to listen; port 0 takes a free one (default 127.0.0.1:1502)", "HOST:PORT"},
        {"tls", 0, 0, G_OPTION_ARG_STRING, &options->tls,
         "Where to listen for Modbus in TLS, with the machine's certificate (default port 1802)",
         "HOST:PORT"},
        {"can", 0, 0, G_OPTION_ARG_STRING, &options->can,
         "The CAN interface to join, with the machine's key", "INTERFACE"},
        {"speed", 0, 0, G_OPTION_ARG_STRING, &options->speed_text,
         "Machine seconds a second, or as fast as it can (default 1)", "N|max"},
        {"log", 0, 0, G_OPTION_ARG_FILENAME, &options->log,
         "Write every executed block and change of state as a JSON line", "FILE"},
        {NULL, 0, 0, 0, NULL, NULL, NULL},
    };
    g_autoptr(GOptionContext) context = g_option_context_new("- the virtual CNC");
    g_option_context_add_main_entries(context, entries, NULL);
    g_option_context_set_description(
        context,
        "Prints \"modbus HOST:PORT\", \"mbaps HOST:PORT\", \"can INTERFACE\" when it listens.\n"
        "It is OFF until a person at the machine acknowledges: lines on standard input are that\n"
        "person: ack, estop. Ends with SIGTERM or SIGINT and a summary.\n");
    if (!g_option_context_parse(context, &argc, &argv, error))
        return false;
    if (argc > 1) {
        g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_UNKNOWN_OPTION,
                    "%s: vcnc takes options only", argv[1]);
        return false;
    }
    if (!options->machine) {
        g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_FAILED, "--machine FILE is missing");
        return false;
    }
    return parse_speed(options, error) && parse_addresses(options, error);
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
static bool may_listen(const Options *options, const CfgMachine *machine, GError **error)
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

static int serve(const Options *options)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(CfgMachine) machine = cfg_machine_load(options->machine, &error);
    g_autoptr(CfgToolTable) tools = machine ? cfg_tools_load(machine->tools_file, &error) : NULL;
    if (!tools)
        return failed(EXIT_CONFIGURATION, error);
    SimMachineOptions how = {.machine = machine,
                             .tools = tools,
                             .plain = options->plain,
                             .secure = options->secure,
                             .can_interface = options->can,
                             .speed = options->speed};
    if (!may_listen(options, machine, &error))
        return failed(EXIT_CONFIGURATION, error);
    if (!random_epoch(&how.epoch, &error))
        return failed(EXIT_FAILED, error);
    if (options->log && !(how.log = sim_log_open(options->log, &error)))
        return failed(EXIT_FAILED, error);
    SimMachine *served = sim_machine_new(&how, &error);
    int status = served ? run(served, options) : failed(exit_of(error), error);
    sim_machine_free(served);
    g_clear_error(&error);
    if (how.log && !sim_log_close(how.log, &error))
        return failed(EXIT_FAILED, error);
    return status;
}

static gboolean quit(void *data)
{
    g_main_loop_quit(((Program *)data)->loop);
    return G_SOURCE_CONTINUE;
}

static void print_address(const char *scheme, const SimAddress *at, uint16_t port)
{
    if (at->host)
        g_print(strchr(at->host, ':') ? "%s [%s]:%u\n" : "%s %s:%u\n", scheme, at->host, port);
}

static int run(SimMachine *machine, const Options *options)
{
    g_autoptr(GMainLoop) loop = g_main_loop_new(NULL, FALSE);
    Program program = {.loop = loop, .machine = machine, .input = g_string_new(NULL)};
    g_unix_signal_add(SIGTERM, quit, &program);
    g_unix_signal_add(SIGINT, quit, &program);
    signal(SIGPIPE, SIG_IGN);
    /* In the background of a terminal reading must fail, not stop the machine. */
    signal(SIGTTIN, SIG_IGN);
    g_unix_fd_add(STDIN_FILENO, G_IO_IN | G_IO_HUP | G_IO_ERR, operator_input, &program);
    print_address("modbus", &options->plain, sim_machine_port(machine));
    print_address("mbaps", &options->secure, sim_machine_tls_port(machine));
    if (options->can)
        g_print("can %s\n", options->can);
    fflush(stdout);
    g_main_loop_run(loop);
    g_autofree char *summary = sim_machine_summary(machine);
    g_print("%s", summary);
    fflush(stdout);
    g_string_free(program.input, TRUE);
    return EXIT_DONE;
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
    if (strcmp(command, "ack") == 0)
        sim_machine_press(machine, SIM_ACKNOWLEDGE);
    else if (strcmp(command, "estop") == 0)
        sim_machine_press(machine, SIM_ESTOP);
    else if (*command != '\0')
        g_printerr("vcnc: \"%s\": commands at the machine are ack and estop\n", command);
}
