/* SPDX-License-Identifier: Apache-2.0 */
#include <glib-unix.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "agent/execute.h"
#include "agent/gate.h"
#include "agent/kept.h"
#include "agent/out/run_json.h"
#include "agent/preflight.h"
#include "agent/progress.h"

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_restart = {
    .name = "restart",
    .synopsis = "--at GATE --to NAME [--yes] [-o DIR]",
    .summary = "begin the machine's program again at a gate: the machine will move",
    .help =
        "For a run that was aborted, or ended by an alarm. A gate is a place in the program where\n"
        "the tool is clear of the part. Shows where the machine would go on and with what, runs\n"
        "the pre-flight again, and asks before anything moves; without a terminal it wants --yes.\n"
        "The machine rebuilds the whole state of that place, goes up, takes the tool, goes\n"
        "across, brings the spindle to its speed, and only then goes down. The program is the\n"
        "copy that was kept when it was sent. `segmill resume` goes on after a hold.",
    .out_help = "Folder of run.json, the record of the run; none is written without",
    .takes = AGENT_TAKES_AT | AGENT_TAKES_TO | AGENT_TAKES_YES | AGENT_TAKES_ACCEPT |
             AGENT_TAKES_MACHINE | AGENT_TAKES_OUT | AGENT_TAKES_CONFIG,
    .needs = AGENT_TAKES_AT | AGENT_TAKES_TO,
    .run = run,
};

/* What is to go on, and where. */
typedef struct {
    AgentKept *kept;
    AgentMachine *machine;
    AgentProgram *timed;
    GArray *findings;
    AgentGate gate;
} Restart;

static void restart_clear(Restart *restart)
{
    g_clear_pointer(&restart->kept, agent_kept_free);
    g_clear_pointer(&restart->machine, agent_machine_free);
    g_clear_pointer(&restart->timed, agent_program_free);
    g_clear_pointer(&restart->findings, g_array_unref);
    agent_gate_clear(&restart->gate);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(Restart, restart_clear)

static bool check_machine(const AgentLink *link, GError **error);
static bool load(const AgentOptions *options, const AgentLink *link, Restart *restart,
                 GError **error);
static bool find_gate(const AgentOptions *options, const FbStatus *status, const Restart *restart,
                      uint32_t *number, GError **error);
static void show(FILE *to, const Restart *restart, const FbStatus *status);
static void describe(const Restart *restart, const FbStatus *status, AgentJson *result);
static bool ask(const AgentOptions *options, const AgentLink *link, GError **error);
static bool execute(const AgentOptions *options, AgentLink *link, const Restart *restart,
                    AgentJson *result, GError **error);

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    g_autoptr(AgentLink) link = agent_link_open(options, error);
    if (!link || !agent_link_wait_status(link, error) || !check_machine(link, error))
        return false;
    g_auto(Restart) restart = {0};
    const FbStatus *status = fb_session_status(link->session);
    uint32_t number;
    if (!load(options, link, &restart, error) ||
        !find_gate(options, status, &restart, &number, error) ||
        !agent_gate_read(restart.kept->program, number, restart.machine, &restart.gate, error))
        return false;
    describe(&restart, status, result);
    /* Who is asked has to see it; stdout may be a program's. */
    show(options->json ? stderr : stdout, &restart, status);
    AgentPreflight flight = {
        .program = restart.kept->program, .needs = restart.timed, .machine = restart.machine};
    restart.findings = agent_preflight(link, &flight, error);
    if (!restart.findings ||
        !agent_preflight_allows(restart.findings, options->accept_cautions, error) ||
        !ask(options, link, error) ||
        !agent_preflight_again(link, &flight, options->accept_cautions, &restart.findings, error))
        return false;
    agent_preflight_write(restart.findings, result);
    return execute(options, link, &restart, result, error);
}

/* --------------------------------------------------------------------- program */

static bool check_machine(const AgentLink *link, GError **error)
{
    const FbStatus *status = fb_session_status(link->session);
    const char *advice;
    switch (status->state) {
    case FB_STATE_READY:
        if (!status->drip)
            return true;
        advice = "its program is fed while it runs, and what was executed is gone";
        break;
    case FB_STATE_OFF:
    case FB_STATE_ALARM:
    case FB_STATE_ESTOP:
        advice = "mend the cause and acknowledge at the machine, then restart";
        break;
    case FB_STATE_HELD:
    case FB_STATE_PROGRAM_STOP:
        advice = "`segmill resume` goes on where it stands; to restart, abort it first";
        break;
    case FB_STATE_COMPLETE:
        advice = "its program is complete; `segmill send --start` begins it again from the top";
        break;
    case FB_STATE_IDLE:
    case FB_STATE_LOADING:
    case FB_STATE_VERIFYING:
        advice = "it holds no verified program; send it again";
        break;
    default:
        advice = "wait for the run's end, or abort it";
    }
    g_set_error(error, FB_ERROR, FB_ERROR_REFUSED, "%s: the machine is %s and takes no restart: %s",
                link->target.address, fb_state_name(status->state), advice);
    return false;
}

static bool load(const AgentOptions *options, const AgentLink *link, Restart *restart,
                 GError **error)
{
    const FbStatus *status = fb_session_status(link->session);
    AgentKept *kept = restart->kept = agent_kept_load(status->sha256, error);
    if (!kept)
        return false;
    const size_t n_gates = kept->program->n_gates;
    if (n_gates != status->gates ||
        fb_stored_gates_crc(kept->program->gates, n_gates) != status->gates_crc) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "the machine has the program with %u gates, the copy has %zu, or others: "
                    "somebody else sent it; send it again",
                    status->gates, n_gates);
        return false;
    }
    const char *tools_file;
    const char *file =
        agent_kept_machine_file(kept, options->machine, link->target.machine_file, &tools_file);
    if (!file) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE,
                    "no description of the machine is known, and without one nobody knows what "
                    "stands at a gate: add --machine FILE");
        return false;
    }
    restart->machine = agent_machine_load(file, tools_file, error);
    if (restart->machine)
        restart->timed =
            agent_program_read(kept->program->bytes, kept->program->sha256,
                               restart->machine->machine, restart->machine->tools, error);
    return restart->timed;
}

/* ------------------------------------------------------------------------ gate */

/* "gates: 3 (line 120), 4 (line 133)": those around the place where the run stopped. */
static char *near_stop(const NcProgram *program, const FbStatus *status)
{
    enum { AROUND = 3 };
    g_autofree uint32_t *lines = agent_gate_lines(program);
    size_t n = program->n_gates - 1; /* the last one is the end */
    size_t stop = 0;
    while (stop < n && lines[stop] <= status->stop_line)
        stop++;
    GString *text = g_string_new(NULL);
    size_t first = stop > AROUND ? stop - AROUND : 0;
    for (size_t i = first; i < n && i < stop + AROUND; i++)
        g_string_append_printf(text, "%s%zu (line %u)", i > first ? ", " : "", i + 1, lines[i]);
    return g_string_free(text, false);
}

static bool find_gate(const AgentOptions *options, const FbStatus *status, const Restart *restart,
                      uint32_t *number, GError **error)
{
    const NcProgram *program = restart->kept->program;
    if (program->n_gates == 1) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE,
                    "the program has no gate but its end; begin from the top with `segmill send "
                    "--start`, and with --machine FILE, which finds its gates");
        return false;
    }
    bool last = strcmp(options->at, "last") == 0;
    guint64 wanted = last ? status->gate : 0;
    if (last && status->gate == 0) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE,
                    "--at last: the last run passed no gate; begin from the top with `segmill send "
                    "--start`");
        return false;
    }
    bool good = last || g_ascii_string_to_unsigned(options->at, 10, 1, UINT32_MAX, &wanted, NULL);
    if (good && wanted < program->n_gates) {
        *number = (uint32_t)wanted;
        return true;
    }
    g_autofree char *around = near_stop(program, status);
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE,
                "--at %s: the program has gates 1 to %zu, and its end%s%s", options->at,
                program->n_gates - 1,
                *around ? status->stop_line ? "; near the stop: " : "; the first: " : "", around);
    return false;
}

/* ------------------------------------------------------------------------ show */

static const char *coolant_name(const AgentGate *gate)
{
    return gate->mist && gate->flood ? "mist and flood"
           : gate->mist              ? "mist"
           : gate->flood             ? "flood"
                                     : "off";
}

static char *tool_text(const Restart *restart)
{
    const CfgTool *tool = cfg_tools_find(restart->machine->tools, restart->gate.tool);
    return tool ? g_strdup_printf("T%d %s Ø%g mm", tool->number, cfg_tool_kind_name(tool->kind),
                                  tool->diameter_mm)
                : g_strdup("none");
}

static char *spindle_text(const AgentGate *gate)
{
    return gate->spindle_rpm != 0
               ? g_strdup_printf("%g rev/min %s", fabs(gate->spindle_rpm),
                                 gate->spindle_rpm > 0 ? "clockwise (M3)" : "anticlockwise (M4)")
               : g_strdup("off");
}

static void show(FILE *to, const Restart *restart, const FbStatus *status)
{
    const AgentGate *gate = &restart->gate;
    const SegVec3 *at = &gate->position_mm;
    g_autofree char *tool = tool_text(restart);
    g_autofree char *spindle = spindle_text(gate);
    if (status->stop_line > 0)
        fprintf(to, "stopped   in line %u, last gate passed: %u\n", status->stop_line,
                status->gate);
    fprintf(to, "gate      %u of %zu\n", gate->number, restart->kept->program->n_gates);
    fprintf(to, "goes on   in line %u: %s\n", gate->line, gate->text);
    if (gate->region > 0)
        fprintf(to, "region    %d\n", gate->region);
    fprintf(to, "tool      %s\n", tool);
    fprintf(to, "spindle   %s, coolant %s\n", spindle, coolant_name(gate));
    fprintf(to, "offset    %s, feed %g mm/min\n",
            agent_work_offset_name((unsigned)gate->work_offset), gate->feed_mm_min);
    fprintf(to, "place     X%.3f Y%.3f Z%.3f mm, machine coordinates\n", at->x, at->y, at->z);
    fprintf(to, "left      %.1f s, %zu blocks\n\n", gate->left_s, gate->left_blocks);
    fprintf(to,
            "The machine will\n  1. go up, clear of everything\n  2. take the tool: %s\n"
            "  3. go across to X%.3f Y%.3f\n  4. coolant %s, spindle %s; wait for its speed\n"
            "  5. go down to Z%.3f and on with line %u\n",
            tool, at->x, at->y, coolant_name(gate), spindle, at->z, gate->line);
}

static void describe(const Restart *restart, const FbStatus *status, AgentJson *result)
{
    const AgentGate *gate = &restart->gate;
    const double position_mm[3] = {gate->position_mm.x, gate->position_mm.y, gate->position_mm.z};
    agent_json_string(result, "program_sha256", restart->kept->program->sha256);
    agent_json_integer(result, "gate", gate->number);
    agent_json_integer(result, "gates", (int64_t)restart->kept->program->n_gates);
    agent_json_integer(result, "stop_line", status->stop_line);
    agent_json_integer(result, "last_gate", status->gate);
    agent_json_integer(result, "line", gate->line);
    agent_json_string(result, "text", gate->text);
    agent_json_integer(result, "region", gate->region);
    agent_json_integer(result, "tool", gate->tool);
    agent_json_number(result, "spindle_rpm", gate->spindle_rpm);
    agent_json_string(result, "coolant", coolant_name(gate));
    agent_json_integer(result, "work_offset", gate->work_offset);
    agent_json_number(result, "feed_mm_min", gate->feed_mm_min);
    agent_json_numbers(result, "position_mm", position_mm, 3);
    agent_json_number(result, "left_s", gate->left_s);
    agent_json_integer(result, "left_blocks", (int64_t)gate->left_blocks);
}

/* --------------------------------------------------------------------- execute */

static gboolean on_input(int fd, GIOCondition condition, void *typed)
{
    (void)fd, (void)condition;
    *(bool *)typed = true;
    return G_SOURCE_CONTINUE;
}

/* Until a line was typed. The link is served meanwhile: what the machine says stays fresh. */
static void wait_for_line(const AgentLink *link)
{
    bool typed = false;
    GSource *input = g_unix_fd_source_new(STDIN_FILENO, G_IO_IN | G_IO_HUP | G_IO_ERR);
    g_source_set_callback(input, G_SOURCE_FUNC(on_input), &typed, NULL);
    g_source_attach(input, link->context);
    while (!typed)
        g_main_context_iteration(link->context, true);
    g_source_destroy(input);
    g_source_unref(input);
}

/* A person's explicit act: a word at the terminal, or --yes on the command line. */
static bool ask(const AgentOptions *options, const AgentLink *link, GError **error)
{
    if (options->yes)
        return true;
    if (!isatty(STDIN_FILENO)) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_USAGE,
                    "not started: there is no terminal to ask at; read what it would do, and add "
                    "--yes");
        return false;
    }
    char answer[16] = "";
    fflush(stdout);
    fputs("Start here? [y/N] ", stderr);
    wait_for_line(link);
    if (fgets(answer, sizeof answer, stdin) && (*answer == 'y' || *answer == 'Y'))
        return true;
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_INTERRUPTED, "not started");
    return false;
}

static bool execute(const AgentOptions *options, AgentLink *link, const Restart *restart,
                    AgentJson *result, GError **error)
{
    const NcProgram *program = restart->kept->program;
    const FbStored stored = {restart->kept->id, restart->gate.number,
                             program->gates[restart->gate.number - 1]};
    AgentFollow follow;
    agent_follow_init(&follow, restart->timed);
    agent_follow_begin(&follow, restart->gate.line);
    AgentExecution execution = agent_execution(link, &follow, options->to);
    AgentRunReport report = {.program_sha256 = program->sha256,
                             .machine = options->to,
                             .gate = restart->gate.number,
                             .findings = restart->findings,
                             .follow = &follow};
    agent_run_begin(&report);
    g_autoptr(GError) ended = NULL;
    bool ok = agent_execute_start(&execution, &stored, &ended);
    link->status = NULL;
    report.error = ended;
    bool written = !options->out || agent_run_write(&report, options->out, ok ? error : NULL);
    if (ok && written)
        agent_run_describe(&report, result, options->json);
    agent_run_end(&report);
    agent_follow_clear(&follow);
    if (!ok)
        g_propagate_error(error, g_steal_pointer(&ended));
    return ok && written;
}
