/* SPDX-License-Identifier: Apache-2.0 */
/* The cell of can_cell.h with the programs themselves, segmill and vcnc, whose log tells what is
 * seen: for each executed block its line's number. The folder has agent.ini, machine.ini and
 * program.ngc; BUILD says where the programs are. */
#include <errno.h>
#include <fcntl.h>
#include <glib/gstdio.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/kernel/can_cell.h"

static const char speed[] = "2"; /* the program lasts longer than it takes to lose an agent */

enum { LINK_LOST = 7, OTHER_STATUS = 100 };

static char *path(const Cell *cell, const char *name)
{
    return g_build_filename(cell->folder, name, NULL);
}

/* With these as its standard input and output; -1: /dev/null, where its errors go, too. */
static pid_t start(char *const *words, int in, int out)
{
    const pid_t pid = fork();
    if (pid != 0)
        return pid;
    const int nothing = open("/dev/null", O_RDWR);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    dup2(in >= 0 ? in : nothing, STDIN_FILENO);
    dup2(out >= 0 ? out : nothing, STDOUT_FILENO);
    dup2(nothing, STDERR_FILENO);
    execv(words[0], words);
    _exit(127);
}

static char *program(const char *name)
{
    const char *build = g_getenv("BUILD");
    return g_build_filename(build ? build : "build", name, NULL);
}

/* --------------------------------------------------------------------------- machine */

/* Returns when it listens. */
void cell_boot(Cell *cell)
{
    g_autofree char *vcnc = program("vcnc"), *machine = path(cell, "machine.ini"),
                    *log = path(cell, "vcnc.log");
    char *const words[] = {vcnc,      "--machine",   machine, "--can", (char *)cell->machine_bus,
                           "--speed", (char *)speed, "--log", log,     NULL};
    int in[2], out[2];
    char said[64] = {0};
    g_unlink(log);
    if (pipe2(in, O_CLOEXEC) != 0 || pipe2(out, O_CLOEXEC) != 0)
        abort();
    cell->machine = start(words, in[0], out[1]);
    close(in[0]);
    close(out[1]);
    if (read(out[0], said, sizeof said - 1) <= 0 || !g_str_has_prefix(said, "can ")) {
        fprintf(stderr, "vcnc does not start: %s\n", said);
        exit(1);
    }
    close(out[0]);
    cell->button = in[1];
    cell->seen->lives++;
}

void cell_button(const Cell *cell)
{
    if (write(cell->button, "ack\n", 4) != 4)
        abort();
}

void cell_cut(Cell *cell)
{
    CellSeen *s = cell->seen;
    kill(cell->machine, SIGKILL);
    waitpid(cell->machine, NULL, 0);
    close(cell->button);
    cell_look(cell);
    cell->machine = 0;
    cell->earlier.starts = s->starts;
    cell->earlier.completed = s->completed;
    cell->earlier.held = s->held;
    cell->earlier.n_executed = s->n_executed;
    s->state = FB_STATE_OFF;
    s->run = 0;
    s->stored = false;
}

/* A run begins where the machine stood without one. */
static void see_state(CellSeen *s, const char *name)
{
    const FbState before = s->state;
    for (FbState state = 0; state < FB_N_STATES; state++)
        if (g_str_has_prefix(name, fb_state_name(state)) &&
            name[strlen(fb_state_name(state))] == '"')
            s->state = state;
    s->held += s->state == FB_STATE_HELD;
    s->completed += s->state == FB_STATE_COMPLETE;
    s->run += s->state == FB_STATE_RUNNING && before <= FB_STATE_READY;
}

static void see_entry(const Cell *cell, const char *entry)
{
    static const char line[] = "{\"line\":", state[] = "{\"state\":\"", id[] = "{\"program\":\"";
    CellSeen *s = cell->seen;
    if (g_str_has_prefix(entry, state))
        see_state(s, entry + strlen(state));
    else if (g_str_has_prefix(entry, id))
        s->stored = g_str_has_prefix(entry + strlen(id), cell->id);
    else if (g_str_has_prefix(entry, line) && s->n_executed + 8 < CELL_EXECUTED_BYTES)
        s->n_executed += (unsigned)g_snprintf(s->executed + s->n_executed, 8, "%d\n",
                                              atoi(entry + strlen(line)));
}

/* The log, from its beginning, up to its last whole line. */
static void see_log(const Cell *cell)
{
    g_autofree char *log = path(cell, "vcnc.log"), *text = NULL;
    CellSeen *s = cell->seen;
    if (!g_file_get_contents(log, &text, NULL, NULL))
        return;
    char *end = strrchr(text, '\n');
    *(end ? end : text) = 0;
    g_auto(GStrv) entries = g_strsplit(text, "\n", -1);
    s->state = FB_STATE_OFF;
    s->run = 0;
    s->held = cell->earlier.held;
    s->completed = cell->earlier.completed;
    s->n_executed = cell->earlier.n_executed;
    for (char **entry = entries; *entry; entry++)
        see_entry(cell, *entry);
    s->starts = cell->earlier.starts + s->run;
}

/* ----------------------------------------------------------------------------- agent */

void cell_agent(Cell *cell, CellTask task)
{
    CellSeen *s = cell->seen;
    g_autofree char *segmill = program("segmill"), *config = path(cell, "agent.ini"),
                    *machine = path(cell, "machine.ini"), *file = path(cell, "program.ngc"),
                    *said = path(cell, "agent.out");
    char *const send[] = {segmill, "send", file,       "--start", "--machine", machine,
                          "--to",  "mill", "--config", config,    "--json",    NULL};
    char *const resume[] = {segmill, "resume", "--to", "mill", "--config", config, "--json", NULL};
    const int out = open(said, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    s->at_work = true;
    s->ended = false;
    s->code = -1;
    s->why[0] = 0;
    cell->agent = start(task == CELL_SEND ? send : resume, -1, out);
    close(out);
}

void cell_kill_agent(Cell *cell)
{
    if (cell->agent > 0)
        kill(cell->agent, SIGKILL);
}

static void see_end(Cell *cell, int status)
{
    CellSeen *s = cell->seen;
    g_autofree char *said = path(cell, "agent.out"), *text = NULL;
    cell->agent = 0;
    s->at_work = false;
    s->ended = WIFEXITED(status);
    s->code = WEXITSTATUS(status) == 0           ? -1
              : WEXITSTATUS(status) == LINK_LOST ? FB_ERROR_LINK_LOST
                                                 : OTHER_STATUS + WEXITSTATUS(status);
    if (s->code != -1 && g_file_get_contents(said, &text, NULL, NULL)) {
        const char *error = strstr(text, "\"error\"");
        g_strlcpy(s->why, g_strdelimit((char *)(error ? error : text), "\n", ' '), CELL_WHY_BYTES);
    }
}

/* ------------------------------------------------------------------------------ both */

bool cell_open(Cell *cell)
{
    g_autofree char *file = path(cell, "program.ngc"), *text = NULL;
    gsize n;
    cell->seen = g_new0(CellSeen, 1);
    cell->news = eventfd(0, EFD_CLOEXEC); /* never: what is seen is looked for */
    if (!g_file_get_contents(file, &text, &n, NULL)) {
        errno = ENOENT;
        return false;
    }
    g_autofree char *id = g_compute_checksum_for_data(G_CHECKSUM_SHA256, (const guchar *)text, n);
    g_strlcpy(cell->id, id, sizeof cell->id);
    cell->program_bytes = n;
    return true;
}

void cell_begin(Cell *cell)
{
    if (cell->machine > 0)
        cell_cut(cell);
    memset(cell->seen, 0, sizeof *cell->seen);
    memset(&cell->earlier, 0, sizeof cell->earlier);
    cell_boot(cell);
}

void cell_look(Cell *cell)
{
    int status;
    if (cell->agent > 0 && waitpid(cell->agent, &status, WNOHANG) == cell->agent)
        see_end(cell, status);
    see_log(cell);
}
