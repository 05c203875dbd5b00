/* SPDX-License-Identifier: Apache-2.0 */
/* The program `segmill`: finds the subcommand in the table, and reports how it ended. */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "agent/agent.h"

static const AgentCommand *const commands[] = {
    &agent_init,
    &agent_segment,
    &agent_plan,
    &agent_estimate,
    &agent_verify,
    &agent_send,
    &agent_run,
    &agent_controls[AGENT_HOLD],
    &agent_controls[AGENT_RESUME],
    &agent_controls[AGENT_ABORT],
    &agent_controls[AGENT_OVERRIDE],
    &agent_controls[AGENT_OPTIONAL_STOP],
    &agent_restart,
    &agent_panel,
    &agent_status,
    &agent_pki,
};

static bool is_help(const char *name);
static bool is_asked(int argc, char **argv, const char *option);
static bool help(const char *name, GError **error);
static bool run(const char *name, int argc, char **argv, GError **error);
static const AgentCommand *find(const char *name, GError **error);
static int report(const GError *error);

static volatile sig_atomic_t wants_json;

/* Nothing has been sent to a machine yet, or `run` has put its own handler in this place: files are
 * written beside and renamed, so leaving at once does no harm. */
static void on_interrupt(int signal_number)
{
    (void)signal_number;
    static const char text[] = "\nsegmill: interrupted\n";
    static const char object[] =
        "{\"error\": {\"domain\": \"agent\", \"code\": 0, \"message\": \"interrupted\"}}\n";
    ssize_t written = write(STDERR_FILENO, text, sizeof text - 1);
    if (wants_json)
        written = write(STDOUT_FILENO, object, sizeof object - 1);
    (void)written;
    _exit(AGENT_EXIT_ABORTED);
}

int main(int argc, char **argv)
{
    /* The object is promised even where the command line itself is wrong. */
    wants_json = is_asked(argc, argv, "--json");
    signal(SIGINT, on_interrupt);
    signal(SIGPIPE, SIG_IGN);
    const char *name = argc > 1 ? argv[1] : "--help";
    g_autoptr(GError) error = NULL;
    bool ok;
    if (is_help(name))
        ok = help(argc > 2 ? argv[2] : NULL, &error);
    else
        ok = run(name, argc - 1, argv + 1, &error);
    if (!ok)
        return report(error);
    return argc > 1 ? AGENT_EXIT_DONE : AGENT_EXIT_USAGE;
}

static bool is_help(const char *name)
{
    return strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0 || strcmp(name, "help") == 0;
}

static bool is_asked(int argc, char **argv, const char *option)
{
    for (int i = 1; i < argc; i++)
        if (strcmp(argv[i], option) == 0)
            return true;
    return false;
}

static bool run(const char *name, int argc, char **argv, GError **error)
{
    const AgentCommand *command = find(name, error);
    if (!command)
        return false;
    g_auto(AgentOptions) options = {0};
    if (!agent_options_read(command, argc, argv, &options, error))
        return false;
    if (options.help)
        return help(name, error);
    g_autoptr(AgentJson) result = agent_json_new();
    agent_json_string(result, "command", command->name);
    if (!command->run(&options, result, error))
        return false;
    if (options.json) {
        g_autofree char *text = agent_json_finish(result);
        fputs(text, stdout);
    }
    if (fflush(stdout) == 0)
        return true;
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_OUTPUT, "stdout: %s", g_strerror(errno));
    return false;
}

static int report(const GError *error)
{
    fprintf(stderr, "segmill: %s\n", error->message);
    if (wants_json) {
        g_autoptr(AgentJson) object = agent_json_new();
        agent_json_object(object, "error");
        agent_json_string(object, "domain", agent_domain_name(error->domain));
        agent_json_integer(object, "code", error->code);
        agent_json_string(object, "message", error->message);
        agent_json_end(object);
        g_autofree char *text = agent_json_finish(object);
        fputs(text, stdout);
    }
    return (int)agent_exit_of(error);
}

static const AgentCommand *find(const char *name, GError **error)
{
    for (size_t i = 0; i < G_N_ELEMENTS(commands); i++)
        if (strcmp(commands[i]->name, name) == 0)
            return commands[i];
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE,
                "there is no command '%s'; segmill --help lists them", name);
    return NULL;
}

static bool help(const char *name, GError **error)
{
    if (name) {
        const AgentCommand *command = find(name, error);
        if (!command)
            return false;
        g_autofree char *page = agent_options_help(command);
        fputs(page, stdout);
        return true;
    }
    puts("segmill turns a CAD part into machining regions, gives every region its own tool and\n"
         "toolpath, writes one G-code program, delivers it to a CNC and follows the run.\n\n"
         "Commands:");
    for (size_t i = 0; i < G_N_ELEMENTS(commands); i++)
        printf("  %-13s %s\n                segmill %s %s\n", commands[i]->name,
               commands[i]->summary, commands[i]->name, commands[i]->synopsis);
    puts("\nsegmill help COMMAND explains one. Exit status: 0 done, 1 failed, 2 wrong usage,\n"
         "3 bad input or configuration file, 4 machine unreachable or refused before the start,\n"
         "5 machine alarm, 6 aborted by a person, 7 link lost while running (the machine's state\n"
         "is unknown), 8 blocked by a pre-flight caution.\n\n"
         "segmill is not a safety device: the emergency stop is wired in the machine.");
    return true;
}
