/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/options.h"

#include <gio/gio.h>
#include <math.h>
#include <string.h>

#define DEFAULT_ADDRESS "127.0.0.1"
#define DEFAULT_PORT 1502
#define DEFAULT_TLS_PORT 1802

/* As GOption has them. */
typedef struct {
    char *tls, *speed;
    char **faults, **fault_files;
    gboolean acknowledge, collision_alarm;
    unsigned jobs;
} Texts;

static void texts_clear(Texts *t)
{
    g_free(t->tls);
    g_free(t->speed);
    g_strfreev(t->faults);
    g_strfreev(t->fault_files);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Texts, texts_clear)

static bool read_command_line(SimOptions *options, Texts *texts, int argc, char **argv,
                              GError **error);
static bool parse_speed(SimOptions *options, const char *text, GError **error);
static bool parse_addresses(SimOptions *options, const char *tls, GError **error);
static bool parse_faults(SimOptions *options, const Texts *texts, GError **error);

bool sim_options_parse(SimOptions *options, int argc, char **argv, GError **error)
{
    g_auto(Texts) texts = {0};
    options->pitch_mm = 0.1;
    if (!read_command_line(options, &texts, argc, argv, error))
        return false;
    options->acknowledge = texts.acknowledge;
    options->collision_alarm = texts.collision_alarm;
    options->jobs = texts.jobs;
    return parse_speed(options, texts.speed ? texts.speed : "1", error) &&
           parse_addresses(options, texts.tls, error) && parse_faults(options, &texts, error);
}

/* The argument of --exit-after-job may be missing, so GOption hands it to a function. */
static gboolean parse_jobs(const char *name, const char *value, void *data, GError **error)
{
    guint64 jobs = 1;
    if (value && !g_ascii_string_to_unsigned(value, 10, 1, UINT_MAX, &jobs, NULL)) {
        g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_BAD_VALUE,
                    "%s=%s: give a whole number from 1", name, value);
        return FALSE;
    }
    ((Texts *)data)->jobs = (unsigned)jobs;
    return TRUE;
}

static bool read_command_line(SimOptions *options, Texts *texts, int argc, char **argv,
                              GError **error)
{
    const GOptionEntry entries[] = {
        {"machine", 0, 0, G_OPTION_ARG_FILENAME, &options->machine, "The machine (INI file)",
         "FILE"},
        {"modbus", 0, 0, G_OPTION_ARG_STRING, &options->modbus,
         "Where to listen; port 0 takes a free one (default 127.0.0.1:1502)", "HOST:PORT"},
        {"tls", 0, 0, G_OPTION_ARG_STRING, &texts->tls,
         "Where to listen for Modbus in TLS, with the machine's certificate (default port 1802)",
         "HOST:PORT"},
        {"can", 0, 0, G_OPTION_ARG_STRING, &options->can,
         "The CAN interface to join, with the machine's key", "INTERFACE"},
        {"speed", 0, 0, G_OPTION_ARG_STRING, &texts->speed,
         "Machine seconds a second, or as fast as it can (default 1)", "N|max"},
        {"log", 0, 0, G_OPTION_ARG_FILENAME, &options->log,
         "Write every executed block and change of state as a JSON line", "FILE"},
        {"fault", 0, 0, G_OPTION_ARG_STRING_ARRAY, &texts->faults,
         "Do a fault on purpose: \"at line 12: hold\", \"random:7\"; repeatable", "SPEC"},
        {"fault-file", 0, 0, G_OPTION_ARG_FILENAME_ARRAY, &texts->fault_files,
         "The same from a file, a fault on each line; repeatable", "FILE"},
        {"stock", 0, 0, G_OPTION_ARG_FILENAME, &options->stock,
         "What is clamped on the machine, from the zero of G54: STL, OFF, IGES, STEP, or a box",
         "FILE|box:X0,Y0,Z0,X1,Y1,Z1"},
        {"ipm", 0, 0, G_OPTION_ARG_FILENAME, &options->model,
         "Write what is left of it behind every run: .stl, or .off", "FILE"},
        {"pitch", 0, 0, G_OPTION_ARG_DOUBLE, &options->pitch_mm,
         "Distance of the lines that the material is kept in (default 0.1)", "MM"},
        {"collision-alarm", 0, 0, G_OPTION_ARG_NONE, &texts->collision_alarm,
         "A run that met material as it must not ends in alarm 204", NULL},
        {"acknowledge", 0, 0, G_OPTION_ARG_NONE, &texts->acknowledge,
         "Nobody is there: acknowledge whatever the machine wants acknowledged (for tests only)",
         NULL},
        {"exit-after-job", 0, G_OPTION_FLAG_OPTIONAL_ARG, G_OPTION_ARG_CALLBACK,
         (void *)(uintptr_t)parse_jobs,
         "End behind the Nth job (default 1): status 0 if all have been completed, else 1", "N"},
        {NULL, 0, 0, 0, NULL, NULL, NULL},
    };
    g_autoptr(GOptionContext) context = g_option_context_new("- the virtual CNC");
    GOptionGroup *group = g_option_group_new("vcnc", "", "", texts, NULL);
    g_option_group_add_entries(group, entries);
    g_option_context_set_main_group(context, group);
    g_option_context_set_description(
        context,
        "Prints \"modbus HOST:PORT\", \"mbaps HOST:PORT\", \"can INTERFACE\" when it listens.\n"
        "It is OFF until a person at the machine acknowledges: lines on standard input are that\n"
        "person: ack, estop, hold, resume. Ends with SIGTERM or SIGINT and a summary.\n"
        "vcnc(1) has the faults and the exit statuses.\n");
    if (!g_option_context_parse(context, &argc, &argv, error))
        return false;
    if (argc > 1) {
        g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_UNKNOWN_OPTION,
                    "%s: vcnc takes options only", argv[1]);
        return false;
    }
    if (!options->stock && (options->model || texts->collision_alarm)) {
        g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_FAILED, "%s needs --stock",
                    options->model ? "--ipm" : "--collision-alarm");
        return false;
    }
    if (!options->machine) {
        g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_FAILED, "--machine FILE is missing");
        return false;
    }
    return true;
}

static bool parse_speed(SimOptions *options, const char *text, GError **error)
{
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
static bool parse_addresses(SimOptions *options, const char *tls, GError **error)
{
    const char *plain = options->modbus || tls || options->can ? options->modbus : DEFAULT_ADDRESS;
    return (!plain || parse_address("--modbus", plain, DEFAULT_PORT, &options->plain, error)) &&
           (!tls || parse_address("--tls", tls, DEFAULT_TLS_PORT, &options->secure, error));
}

/* Those of the command line come before those of files. */
static bool parse_faults(SimOptions *options, const Texts *texts, GError **error)
{
    if (!texts->faults && !texts->fault_files)
        return true;
    options->script = sim_fault_script_new();
    options->script->seed = g_random_int();
    for (char **spec = texts->faults; spec && *spec; spec++)
        if (!sim_fault_script_add(options->script, *spec, error)) {
            g_prefix_error(error, "--fault \"%s\": ", *spec);
            return false;
        }
    for (char **path = texts->fault_files; path && *path; path++)
        if (!sim_fault_script_read(options->script, *path, error))
            return false;
    return true;
}

void sim_options_clear(SimOptions *options)
{
    g_free(options->machine);
    g_free(options->modbus);
    g_free(options->plain.host);
    g_free(options->secure.host);
    g_free(options->can);
    g_free(options->log);
    g_free(options->stock);
    g_free(options->model);
    sim_fault_script_free(options->script);
}
