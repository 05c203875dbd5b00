/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/kernel/can_cell.h"

#include <glib-unix.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

enum {
    BASE = 0x100,
    AGENTS = 2,
    LINES = 16,
    GATES = 4,
    LINE_MS = 400, /* the program lasts longer than it takes to lose an agent */
};

static const uint64_t token = UINT64_C(0x5e91a77000000001);

/* About 2 kB. */
static GBytes *new_program(void)
{
    GString *text = g_string_new(NULL);
    for (int i = 0; i < LINES; i++)
        g_string_append_printf(text, "N%d G1 X%d.5 Y%d.25 Z-%d.125 F%d (%0*d)\n", i + 1, i % 7,
                               i % 11, i % 3, 1000 + i, 85, i);
    return g_string_free_to_bytes(text);
}

/* Behind every LINES / GATES lines. */
static void gates_of(GBytes *program, uint64_t *gates)
{
    gsize n;
    const char *text = g_bytes_get_data(program, &n);
    for (gsize i = 0, lines = 0; i < n; i++)
        if (text[i] == '\n' && ++lines % (LINES / GATES) == 0)
            *gates++ = i + 1;
}

static void ring(int file)
{
    const uint64_t once = 1;
    if (write(file, &once, sizeof once) != sizeof once)
        abort();
}

static bool rang(int file)
{
    uint64_t times;
    return read(file, &times, sizeof times) == sizeof times;
}

/* --------------------------------------------------------------------------- machine */

typedef struct {
    const Cell *cell;
    CellSeen *seen;
    FbReceiver *receiver;
    FbCanServer *server;
    GBytes *program; /* while a run is on */
    FbProgress progress;
    size_t next; /* first byte that is not executed yet */
    guint line;  /* the timer of the one in execution; 0: none */
    bool stops, stops_at_gate, aborts, shown;
} Machine;

static void act(FbDo what, void *data);

static void tell(Machine *m, FbMachineEvent event)
{
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    fb_receiver_machine(m->receiver, event, NULL, g_get_monotonic_time(), actions);
    for (guint i = 0; i < actions->len; i++)
        act(g_array_index(actions, FbDo, i), m);
}

static void end_run(Machine *m, FbMachineEvent how)
{
    g_clear_pointer(&m->program, g_bytes_unref);
    tell(m, how);
}

static void execute_line(Machine *m)
{
    gsize n;
    const char *text = g_bytes_get_data(m->program, &n);
    const char *line = text + m->next;
    const char *end = memchr(line, '\n', n - m->next);
    const size_t length = end ? (size_t)(end + 1 - line) : n - m->next;
    if (m->seen->n_executed + length <= CELL_EXECUTED_BYTES)
        memcpy(m->seen->executed + m->seen->n_executed, line, length);
    m->seen->n_executed += (unsigned)length;
    m->next += length;
    m->progress.executed_blocks++;
    m->progress.line++;
    m->progress.gate += m->progress.line % (LINES / GATES) == 0;
    fb_receiver_progress(m->receiver, &m->progress);
}

static gboolean on_line(gpointer data);

/* Stands still at a block, or begins the next. */
static void go_on(Machine *m)
{
    const bool at_gate = m->progress.line % (LINES / GATES) == 0;
    if (!m->program || m->line != 0)
        return;
    if (m->next == g_bytes_get_size(m->program)) {
        m->seen->completed++;
        end_run(m, FB_MACHINE_COMPLETE);
    } else if (m->aborts) {
        end_run(m, FB_MACHINE_ABORTED);
    } else if (m->stops || (m->stops_at_gate && at_gate)) {
        m->stops = m->stops_at_gate = false;
        m->seen->held++;
        tell(m, FB_MACHINE_HELD);
    } else {
        m->line = g_timeout_add(LINE_MS, on_line, m);
    }
}

static gboolean on_line(gpointer data)
{
    Machine *m = data;
    m->line = 0;
    execute_line(m);
    go_on(m);
    return G_SOURCE_REMOVE;
}

static void start_run(Machine *m)
{
    m->seen->starts++;
    m->program = g_bytes_ref(fb_receiver_program(m->receiver));
    m->stops = m->stops_at_gate = m->aborts = false;
    m->next = m->progress.line = m->progress.gate = 0;
}

static void act(FbDo what, void *data)
{
    Machine *m = data;
    g_autoptr(GBytes) program = new_program();
    switch (what) {
    case FB_DO_VERIFY:
        m->seen->stored = g_bytes_equal(fb_receiver_program(m->receiver), program);
        tell(m, FB_MACHINE_VERIFIED);
        break;
    case FB_DO_FORGET:
        m->seen->stored = false;
        break;
    case FB_DO_START:
        start_run(m);
        go_on(m);
        break;
    case FB_DO_HOLD:
        m->stops = true;
        break;
    case FB_DO_HOLD_AT_GATE:
        m->stops_at_gate = true;
        break;
    case FB_DO_RESUME:
        m->stops = m->stops_at_gate = false;
        go_on(m);
        break;
    case FB_DO_ABORT:
        m->aborts = true;
        go_on(m);
        break;
    default:
        break;
    }
}

static gboolean on_button(gint file, GIOCondition condition, gpointer data)
{
    (void)condition;
    if (rang(file))
        tell(data, FB_MACHINE_ACKNOWLEDGED);
    return G_SOURCE_CONTINUE;
}

static void live(Machine *m)
{
    const FbReceiverOptions options = {.epoch = g_random_int() | 1,
                                       .memory_bytes = 1 << 20,
                                       .on_agent_loss = CFG_AGENT_LOSS_NEXT_GATE,
                                       .agent_timeout_us = 4 * G_USEC_PER_SEC,
                                       .lease_timeout_us = 10 * G_USEC_PER_SEC};
    g_autofree char *key_file = g_build_filename(m->cell->folder, "can.key", NULL);
    const FbCanOptions can = {m->cell->machine_bus, key_file, BASE, AGENTS};
    const FbSetup setup = {
        .n_tools = 1, .tools = {{1, CFG_TOOL_BALL, 6, 3, 100}}, .work_offset = 54};
    g_autoptr(GError) error = NULL;
    m->receiver = fb_receiver_new(&options);
    m->seen->stored = false;
    fb_receiver_set_setup(m->receiver, &setup);
    m->server = fb_can_server_new(&can, m->receiver, act, m, NULL, &error);
    if (!m->server) {
        g_printerr("no machine: %s\n", error->message);
        _exit(1);
    }
    m->seen->lives++;
}

static gboolean on_reset(gint file, GIOCondition condition, gpointer data)
{
    Machine *m = data;
    (void)condition;
    if (!rang(file))
        return G_SOURCE_CONTINUE;
    fb_can_server_free(m->server);
    fb_receiver_free(m->receiver);
    g_clear_pointer(&m->program, g_bytes_unref);
    if (m->line != 0)
        g_source_remove(m->line);
    *m = (Machine){.cell = m->cell, .seen = m->seen};
    live(m);
    return G_SOURCE_CONTINUE;
}

/* What a person sees at the machine. */
static void show(Machine *m)
{
    FbStatus status;
    const FbState state = fb_receiver_state(m->receiver);
    if (m->shown && state == m->seen->state)
        return;
    fb_receiver_status(m->receiver, g_get_monotonic_time(), &status);
    m->shown = true;
    m->seen->state = state;
    m->seen->run = status.run;
    ring(m->cell->news);
}

static void be_machine(const Cell *cell)
{
    Machine m = {.cell = cell, .seen = cell->seen};
    live(&m);
    g_unix_fd_add(cell->button, G_IO_IN, on_button, &m);
    g_unix_fd_add(cell->reset, G_IO_IN, on_reset, &m);
    for (;;) {
        show(&m);
        g_main_context_iteration(NULL, TRUE);
    }
}

/* ----------------------------------------------------------------------------- agent */

typedef struct {
    const Cell *cell;
    CellSeen *seen;
    FbSession *session;
    GBytes *program;
    bool follows;        /* a run that it did not start */
    bool holds, holding; /* a hold is to be asked for; or was, and a RESUME is due */
} Agent;

static void end_task(Agent *a, const GError *error)
{
    a->seen->code = error ? error->code : -1;
    g_strlcpy(a->seen->why, error ? error->message : "", CELL_WHY_BYTES);
    a->seen->ended = true;
}

static void on_done(FbTask task, const GError *error, void *data)
{
    Agent *a = data;
    uint64_t gates[GATES];
    gates_of(a->program, gates);
    if (task == FB_TASK_COMMAND && a->seen->task == CELL_SEND_HOLDING)
        return; /* the run goes on, or ends with an error of its own */
    if (error || task == FB_TASK_RUN)
        end_task(a, error);
    else if (task == FB_TASK_SETUP)
        fb_session_deliver(a->session, a->program, gates, GATES);
    else if (task == FB_TASK_DELIVER)
        fb_session_start(a->session);
    else
        a->follows = true;
}

static void on_status(const FbStatus *status, void *data)
{
    Agent *a = data;
    if (a->follows && (status->state == FB_STATE_HELD || status->state == FB_STATE_COMPLETE))
        end_task(a, NULL);
    if (a->holds && status->state == FB_STATE_RUNNING && status->executed_blocks > 0) {
        a->holds = false;
        a->holding = true;
        fb_session_command(a->session, FB_COMMAND_HOLD, NULL);
    } else if (a->holding && status->state == FB_STATE_HELD) {
        a->holding = false;
        fb_session_command(a->session, FB_COMMAND_RESUME, NULL);
    }
}

static FbSession *new_session(Agent *a, GError **error)
{
    g_autofree char *address = g_strconcat("can://", a->cell->agent_bus, NULL);
    g_autofree char *key_file = g_build_filename(a->cell->folder, "can.key", NULL);
    const CfgTarget target = {.address = address,
                              .can_base = BASE,
                              .can_key = key_file,
                              .can_first = 0,
                              .can_last = AGENTS - 1};
    const CfgAgent options = {.reply_timeout_s = 0.3,
                              .reconnect_s = 0.1,
                              .give_up_s = 20,
                              .heartbeat_s = 1.2,
                              .window = 1,
                              .drip = CFG_DRIP_NEVER};
    const FbSessionCallbacks callbacks = {on_status, on_done, a};
    return fb_session_new(&target, &options, &callbacks, NULL, error);
}

static void work(Agent *a)
{
    g_autoptr(GError) error = NULL;
    a->follows = a->holding = false;
    a->holds = a->seen->task == CELL_SEND_HOLDING;
    a->session = new_session(a, &error);
    if (!a->session) {
        end_task(a, error);
        return;
    }
    fb_session_set_token(a->session, token);
    if (a->seen->task == CELL_RESUME)
        fb_session_command(a->session, FB_COMMAND_RESUME, NULL);
    else
        fb_session_read_setup(a->session);
    while (!a->seen->ended)
        g_main_context_iteration(NULL, TRUE);
    fb_session_free(a->session);
}

static void be_agent(const Cell *cell)
{
    Agent a = {.cell = cell, .seen = cell->seen, .program = new_program()};
    for (;;) {
        if (!rang(cell->order)) /* waits */
            abort();
        work(&a);
        a.seen->at_work = false;
        ring(cell->news);
    }
}

/* ------------------------------------------------------------------------- processes */

/* They die with their parent. */
static pid_t start(const Cell *cell, void (*be)(const Cell *cell))
{
    const pid_t pid = fork();
    if (pid != 0)
        return pid;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    be(cell);
    _exit(1);
}

bool cell_open(Cell *cell)
{
    cell->seen =
        mmap(NULL, sizeof(CellSeen), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    cell->button = eventfd(0, EFD_NONBLOCK);
    cell->reset = eventfd(0, EFD_NONBLOCK);
    cell->order = eventfd(0, 0);
    cell->news = eventfd(0, EFD_NONBLOCK);
    g_autoptr(GBytes) program = new_program();
    cell->program_bytes = g_bytes_get_size(program);
    cell->machine = cell->agent = 0;
    return cell->seen != MAP_FAILED && cell->button >= 0 && cell->reset >= 0 && cell->order >= 0 &&
           cell->news >= 0;
}

static void wait_for_life(const Cell *cell, unsigned life)
{
    while (cell->seen->lives < life)
        g_usleep(1000);
}

void cell_begin(Cell *cell)
{
    memset(cell->seen, 0, sizeof *cell->seen);
    if (cell->machine > 0)
        ring(cell->reset);
    else
        cell_boot(cell);
    wait_for_life(cell, 1);
}

void cell_button(const Cell *cell)
{
    ring(cell->button);
}

void cell_agent(Cell *cell, CellTask task)
{
    CellSeen *s = cell->seen;
    if (cell->agent == 0)
        cell->agent = start(cell, be_agent);
    s->task = task;
    s->at_work = true;
    s->ended = false;
    s->code = -1;
    s->why[0] = 0;
    ring(cell->order);
}

void cell_kill_agent(Cell *cell)
{
    if (cell->agent > 0)
        kill(cell->agent, SIGKILL);
}

void cell_cut(Cell *cell)
{
    kill(cell->machine, SIGKILL);
    waitpid(cell->machine, NULL, 0);
    cell->machine = 0;
    cell->seen->state = FB_STATE_OFF;
    cell->seen->run = 0;
    rang(cell->button);
}

void cell_boot(Cell *cell)
{
    cell->machine = start(cell, be_machine);
}

void cell_look(Cell *cell)
{
    rang(cell->news);
    if (cell->agent > 0 && waitpid(cell->agent, NULL, WNOHANG) == cell->agent) {
        cell->agent = 0;
        cell->seen->at_work = false;
    }
}
