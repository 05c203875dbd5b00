/* SPDX-License-Identifier: Apache-2.0 */
/*
 * agent: the program `segmill`. Every subcommand is one AgentCommand in a file of its own; main,
 * the help and the options work from their table.
 */
#ifndef AGENT_AGENT_H
#define AGENT_AGENT_H

#include <glib.h>
#include <stdbool.h>

#include "agent/out/json.h"

typedef enum {
    AGENT_ERROR_INTERRUPTED, /* Ctrl-C before anything was started */
    AGENT_ERROR_USAGE,       /* wrong command line */
    AGENT_ERROR_INPUT,       /* a given file cannot be read */
    AGENT_ERROR_OUTPUT,      /* a result cannot be written */
    AGENT_ERROR_TARGET,      /* no machine of that name */
    AGENT_ERROR_CAUTION,     /* blocked by the pre-flight */
    AGENT_ERROR_TOLERANCE,   /* verify: a limit does not hold, or something collides */
} AgentError;

#define AGENT_ERROR agent_error_quark()
GQuark agent_error_quark(void);

/* The contract with whoever calls segmill. */
typedef enum {
    AGENT_EXIT_DONE = 0,
    AGENT_EXIT_FAILED = 1,
    AGENT_EXIT_USAGE = 2,
    AGENT_EXIT_INPUT = 3,   /* bad input or configuration file */
    AGENT_EXIT_REFUSED = 4, /* machine unreachable, or refused before the start */
    AGENT_EXIT_ALARM = 5,
    AGENT_EXIT_ABORTED = 6, /* by a person */
    AGENT_EXIT_LINK_LOST = 7,
    AGENT_EXIT_CAUTION = 8, /* blocked by a pre-flight caution */
} AgentExit;

/* The only place where errors become exit statuses, and where their domains get names. */
AgentExit agent_exit_of(const GError *error);
const char *agent_domain_name(GQuark domain);

typedef struct AgentCommand AgentCommand;

typedef struct {
    const AgentCommand *command;
    char *out;                                        /* -o */
    char *method;                                     /* --method */
    char **set;                                       /* --set, NULL-terminated; NULL: none */
    char *to;                                         /* --to */
    char *machine;                                    /* --machine */
    char *recipe;                                     /* --recipe */
    char *config;                                     /* --config */
    char *at;                                         /* --at */
    int feed_percent, rapid_percent, spindle_percent; /* -1: not given */
    char **host;                                      /* --host, NULL-terminated; NULL: none */
    int days;                                         /* --days; -1: not given */
    gboolean start;
    gboolean yes;
    gboolean accept_cautions;
    gboolean no_follow;
    gboolean json;
    gboolean help;
    char *argument; /* what the command names as its own: PART, RECIPE … */
} AgentOptions;

/* Which options a command takes, and which it cannot do without. */
enum {
    AGENT_TAKES_OUT = 1 << 0,
    AGENT_TAKES_METHOD = 1 << 1,
    AGENT_TAKES_SET = 1 << 2,
    AGENT_TAKES_TO = 1 << 3,
    AGENT_TAKES_MACHINE = 1 << 4,
    AGENT_TAKES_CONFIG = 1 << 5,
    AGENT_TAKES_START = 1 << 6,
    AGENT_TAKES_AT = 1 << 7,
    AGENT_TAKES_YES = 1 << 8,
    AGENT_TAKES_ACCEPT = 1 << 9,
    AGENT_TAKES_PERCENT = 1 << 10, /* at least one of the three */
    AGENT_TAKES_NO_FOLLOW = 1 << 11,
    AGENT_TAKES_HOST = 1 << 12,
    AGENT_TAKES_DAYS = 1 << 13,
    AGENT_TAKES_RECIPE = 1 << 14,
};

struct AgentCommand {
    const char *name;
    const char *argument; /* "PART"; NULL: none */
    const char *synopsis; /* what follows the name in the help */
    const char *summary;  /* one line */
    const char *help;     /* paragraphs */
    const char *out_help; /* what -o names */
    unsigned takes, needs;
    /* Does the work. Writes the members of the --json object into `result`, and, unless
     * options->json, what people read to stdout. */
    bool (*run)(const AgentOptions *options, AgentJson *result, GError **error);
};

extern const AgentCommand agent_init, agent_segment, agent_plan, agent_estimate, agent_verify,
    agent_send, agent_run, agent_restart, agent_panel, agent_status, agent_pki;

/* The commands that are one command to the machine. */
typedef enum {
    AGENT_HOLD,
    AGENT_RESUME,
    AGENT_ABORT,
    AGENT_OVERRIDE,
    AGENT_OPTIONAL_STOP,
    AGENT_N_CONTROLS
} AgentControl;
extern const AgentCommand agent_controls[AGENT_N_CONTROLS];

/* Reads the command line behind the command's name. Errors: AGENT_ERROR_USAGE. */
bool agent_options_read(const AgentCommand *command, int argc, char **argv, AgentOptions *options,
                        GError **error);
void agent_options_clear(AgentOptions *options);
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(AgentOptions, agent_options_clear)

/* The help page of one command; caller frees. */
char *agent_options_help(const AgentCommand *command);

#endif
