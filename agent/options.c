/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/agent.h"
#include "fieldbus/fieldbus.h"

#define MAX_ENTRIES 24
#define NOT_GIVEN (-1)

/* The options `command` takes, as GLib wants them. */
static void entries_of(const AgentCommand *command, AgentOptions *o,
                       GOptionEntry entries[MAX_ENTRIES])
{
    const struct {
        unsigned flag;
        GOptionEntry entry;
    } all[] = {
        {AGENT_TAKES_OUT,
         {"output", 'o', 0, G_OPTION_ARG_FILENAME, &o->out, command->out_help, "PATH"}},
        {AGENT_TAKES_METHOD,
         {"method", 0, 0, G_OPTION_ARG_STRING, &o->method,
          "How faces become regions: feature-size or none", "M"}},
        {AGENT_TAKES_SET,
         {"set", 0, 0, G_OPTION_ARG_STRING_ARRAY, &o->set,
          "Put a value in the place of the recipe's; may be repeated", "KEY=VALUE"}},
        {AGENT_TAKES_TO,
         {"to", 0, 0, G_OPTION_ARG_STRING, &o->to,
          "A machine of the agent's configuration, or modbus://HOST:PORT", "NAME"}},
        {AGENT_TAKES_MACHINE,
         {"machine", 0, 0, G_OPTION_ARG_FILENAME, &o->machine, "The machine's description",
          "FILE"}},
        {AGENT_TAKES_RECIPE,
         {"recipe", 0, 0, G_OPTION_ARG_FILENAME, &o->recipe, "The recipe that says what is wanted",
          "RECIPE"}},
        {AGENT_TAKES_START,
         {"start", 0, 0, G_OPTION_ARG_NONE, &o->start, "Start it too: the machine will move",
          NULL}},
        {AGENT_TAKES_AT,
         {"at", 0, 0, G_OPTION_ARG_STRING, &o->at,
          "Number of the gate, from 1, or `last`: the last one that the run passed", "GATE"}},
        {AGENT_TAKES_YES,
         {"yes", 0, 0, G_OPTION_ARG_NONE, &o->yes, "Do not ask: the machine will move", NULL}},
        {AGENT_TAKES_ACCEPT,
         {"accept-cautions", 0, 0, G_OPTION_ARG_NONE, &o->accept_cautions,
          "Start although the pre-flight has cautions", NULL}},
        {AGENT_TAKES_PERCENT,
         {"feed", 0, 0, G_OPTION_ARG_INT, &o->feed_percent, "Feed, 0 to 200 % of the program's",
          "N"}},
        {AGENT_TAKES_PERCENT,
         {"rapid", 0, 0, G_OPTION_ARG_INT, &o->rapid_percent, "Rapids, 0 to 100 %", "N"}},
        {AGENT_TAKES_PERCENT,
         {"spindle", 0, 0, G_OPTION_ARG_INT, &o->spindle_percent, "Spindle, 50 to 200 %", "N"}},
        {AGENT_TAKES_NO_FOLLOW,
         {"no-follow", 0, 0, G_OPTION_ARG_NONE, &o->no_follow,
          "Return at once instead of watching the run to its end", NULL}},
        {AGENT_TAKES_HOST,
         {"host", 0, 0, G_OPTION_ARG_STRING_ARRAY, &o->host,
          "A name or address by which agents reach the machine; may be repeated (default this "
          "host)",
          "NAME"}},
        {AGENT_TAKES_DAYS,
         {"days", 0, 0, G_OPTION_ARG_INT, &o->days, "How long they hold, 1 to 36500 (default 825)",
          "N"}},
        {AGENT_TAKES_CONFIG,
         {"config", 0, 0, G_OPTION_ARG_FILENAME, &o->config, "The agent's configuration", "FILE"}},
        {0,
         {"json", 0, 0, G_OPTION_ARG_NONE, &o->json, "One JSON object on stdout, instead of text",
          NULL}},
        {0, {"help", 'h', 0, G_OPTION_ARG_NONE, &o->help, "This page", NULL}},
    };
    G_STATIC_ASSERT(G_N_ELEMENTS(all) < MAX_ENTRIES);
    size_t n = 0;
    for (size_t i = 0; i < G_N_ELEMENTS(all); i++)
        if (!all[i].flag || command->takes & all[i].flag)
            entries[n++] = all[i].entry;
    entries[n] = (GOptionEntry){0};
}

static bool usage(const AgentCommand *command, GError **error, const char *format, ...)
    G_GNUC_PRINTF(3, 4);
static bool usage(const AgentCommand *command, GError **error, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    g_autofree char *what = g_strdup_vprintf(format, args);
    va_end(args);
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE, "%s; usage: segmill %s %s", what,
                command->name, command->synopsis);
    return false;
}

static bool check_percents(const AgentCommand *command, const AgentOptions *options, GError **error)
{
    const struct {
        const char *name;
        int value, least, most;
    } percents[] = {
        {"--feed", options->feed_percent, 0, FB_OVERRIDE_MOST_PERCENT},
        {"--rapid", options->rapid_percent, 0, FB_RAPID_MOST_PERCENT},
        {"--spindle", options->spindle_percent, FB_SPINDLE_LEAST_PERCENT, FB_OVERRIDE_MOST_PERCENT},
    };
    bool any = false;
    for (size_t i = 0; i < G_N_ELEMENTS(percents); i++) {
        int value = percents[i].value;
        if (value == NOT_GIVEN)
            continue;
        any = true;
        if (value < percents[i].least || value > percents[i].most)
            return usage(command, error, "%s %d is not within %d to %d percent", percents[i].name,
                         value, percents[i].least, percents[i].most);
    }
    return any || usage(command, error, "--feed, --rapid and --spindle are missing");
}

static bool check(const AgentCommand *command, int argc, char **argv, const AgentOptions *options,
                  GError **error)
{
    int wanted = command->argument ? 1 : 0;
    if (argc - 1 > wanted)
        return usage(command, error, "'%s' is one argument too many", argv[wanted + 1]);
    if (argc - 1 < wanted)
        return usage(command, error, "%s is missing", command->argument);
    if (command->needs & AGENT_TAKES_OUT && !options->out)
        return usage(command, error, "-o is missing");
    if (command->needs & AGENT_TAKES_TO && !options->to)
        return usage(command, error, "--to is missing");
    if (command->needs & AGENT_TAKES_MACHINE && !options->machine)
        return usage(command, error, "--machine is missing");
    if (command->needs & AGENT_TAKES_RECIPE && !options->recipe)
        return usage(command, error, "--recipe is missing");
    if (command->needs & AGENT_TAKES_AT && !options->at)
        return usage(command, error, "--at is missing");
    if (options->days != NOT_GIVEN && (options->days < 1 || options->days > 36500))
        return usage(command, error, "--days %d is not within 1 to 36500", options->days);
    return !(command->needs & AGENT_TAKES_PERCENT) || check_percents(command, options, error);
}

bool agent_options_read(const AgentCommand *command, int argc, char **argv, AgentOptions *options,
                        GError **error)
{
    GOptionEntry entries[MAX_ENTRIES];
    options->command = command;
    options->days = NOT_GIVEN;
    options->feed_percent = options->rapid_percent = options->spindle_percent = NOT_GIVEN;
    entries_of(command, options, entries);
    g_autoptr(GOptionContext) context = g_option_context_new(NULL);
    g_option_context_set_help_enabled(context, false);
    g_option_context_add_main_entries(context, entries, NULL);
    g_autoptr(GError) cause = NULL;
    if (!g_option_context_parse(context, &argc, &argv, &cause))
        return usage(command, error, "%s", cause->message);
    if (options->help)
        return true;
    if (argc > 1 && g_str_equal(argv[1], "--")) {
        argv++;
        argc--;
    }
    if (!check(command, argc, argv, options, error))
        return false;
    options->argument = g_strdup(command->argument ? argv[1] : NULL);
    return true;
}

void agent_options_clear(AgentOptions *options)
{
    g_free(options->out);
    g_free(options->method);
    g_strfreev(options->set);
    g_free(options->to);
    g_free(options->machine);
    g_free(options->recipe);
    g_free(options->config);
    g_free(options->at);
    g_strfreev(options->host);
    g_free(options->argument);
    *options = (AgentOptions){0};
}

char *agent_options_help(const AgentCommand *command)
{
    AgentOptions unused = {0};
    GOptionEntry entries[MAX_ENTRIES];
    entries_of(command, &unused, entries);
    GString *page = g_string_new(NULL);
    g_string_append_printf(page, "segmill %s %s\n\n%s\n\n%s\n\nOptions:\n", command->name,
                           command->synopsis, command->summary, command->help);
    for (const GOptionEntry *entry = entries; entry->long_name; entry++) {
        g_autofree char *left =
            g_strdup_printf("%s--%s%s%s", entry->short_name == 'o' ? "-o, " : "", entry->long_name,
                            entry->arg_description ? " " : "",
                            entry->arg_description ? entry->arg_description : "");
        g_string_append_printf(page, "  %-20s %s\n", left, entry->description);
    }
    return g_string_free(page, false);
}
