/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Delivery over Modbus TCP on loopback, each figure beside its limit or peer, measured in the same
 * run: what libmodbus alone does with the same FC23, one request in flight over a slow network. The
 * machine is a receiver in a child process that executes in no time; agent and machine are pinned
 * to one core.
 */
#include <arpa/inet.h>
#include <math.h>
#include <modbus.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fieldbus/fieldbus.h"
#include "fieldbus/wire.h"
#include "tests/lib/relay.h"

enum {
    PROGRAM_BYTES = 4 << 20,
    SLOW_BYTES = 200 << 10, /* over the slow network */
    PASS_BYTES = 64 << 10,
    MEMORY_BYTES = 1 << 20, /* of the machine that is fed while it runs */
    CHUNK_BYTES = 218,      /* of Modbus */
    RAW_REQUESTS = 40000,
    RUNS = 3,
    HOLDS = 2000,
    DELAY_US = 5000, /* of the network, in each direction */
};

static double seconds(void)
{
    return (double)g_get_monotonic_time() / 1e6;
}

static void pin(void)
{
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(0, &one);
    sched_setaffinity(0, sizeof one, &one);
}

static void report(const char *what, double figure, const char *unit, const char *peer, double its,
                   const char *goal)
{
    printf("%-34s %9.2f %-5s %-26s %9.2f  ratio %6.2f%s\n", what, figure, unit, peer, its,
           figure / its, goal);
}

/* ------------------------------------------------------------------------- raw libmodbus */

static void serve_raw(int listener)
{
    uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
    modbus_t *modbus = modbus_new_tcp("127.0.0.1", 0);
    modbus_mapping_t *map = modbus_mapping_new(0, 0, FB_N_REGISTERS, 0);
    int n;
    modbus_set_socket(modbus, accept(listener, NULL, NULL));
    while ((n = modbus_receive(modbus, request)) >= 0)
        modbus_reply(modbus, request, n, map);
    _exit(0);
}

/* Round trips/s of FC23 with as many registers out and in as a full chunk and the status have. */
static double raw_libmodbus(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t n = sizeof at;
    uint16_t out[242 / 2] = {0}, in[FB_STATUS_BYTES / 2];
    const int listener = socket(AF_INET, SOCK_STREAM, 0);
    bind(listener, (struct sockaddr *)&at, sizeof at);
    listen(listener, 1);
    getsockname(listener, (struct sockaddr *)&at, &n);
    const pid_t child = fork();
    if (child == 0)
        serve_raw(listener);
    modbus_t *modbus = modbus_new_tcp("127.0.0.1", ntohs(at.sin_port));
    modbus_connect(modbus);
    const double began = seconds();
    for (int i = 0; i < RAW_REQUESTS; i++)
        modbus_write_and_read_registers(modbus, FB_AT_CHUNK, 242 / 2, out, 0, FB_STATUS_BYTES / 2,
                                        in);
    const double rate = RAW_REQUESTS / (seconds() - began);
    modbus_close(modbus);
    modbus_free(modbus);
    close(listener);
    waitpid(child, NULL, 0);
    return rate;
}

/* ------------------------------------------------------------------------------- machine */

typedef struct {
    FbReceiver *receiver;
    bool running;
} Machine;

/* It has executed whatever it is given. */
static void execute(Machine *m)
{
    size_t n = 0;
    fb_receiver_gates(m->receiver, &n);
    const size_t released = fb_receiver_released(m->receiver);
    fb_receiver_progress(m->receiver, &(FbProgress){.gate = (uint32_t)released, .work_offset = 54});
    if (released == n)
        fb_receiver_machine(m->receiver, FB_MACHINE_COMPLETE, NULL, g_get_monotonic_time(), NULL);
}

/* A hold stays on its way: so it can be asked for again and again. */
static void act(FbDo what, void *data)
{
    Machine *m = data;
    if (what == FB_DO_VERIFY)
        fb_receiver_machine(m->receiver, FB_MACHINE_VERIFIED, NULL, g_get_monotonic_time(), NULL);
    m->running = what == FB_DO_START || (m->running && what != FB_DO_FORGET);
    if (m->running && fb_receiver_drips(m->receiver))
        execute(m);
}

static void serve_ours(uint64_t memory_bytes, int port_pipe)
{
    const FbReceiverOptions options = {.epoch = 1,
                                       .memory_bytes = memory_bytes,
                                       .agent_timeout_us = 60000000,
                                       .lease_timeout_us = 120000000};
    Machine m = {.receiver = fb_receiver_new(&options)};
    g_autoptr(GMainLoop) loop = g_main_loop_new(NULL, FALSE);
    fb_receiver_machine(m.receiver, FB_MACHINE_ACKNOWLEDGED, NULL, 0, NULL);
    FbModbusServer *server =
        fb_modbus_server_new(&(FbModbusServerOptions){.host = "127.0.0.1", .unit_id = 1},
                             m.receiver, act, &m, NULL, NULL);
    const uint16_t port = server ? fb_modbus_server_port(server) : 0;
    if (write(port_pipe, &port, sizeof port) == sizeof port)
        g_main_loop_run(loop);
    _exit(0);
}

static pid_t machine_spawn(uint64_t memory_bytes, uint16_t *port)
{
    int port_pipe[2];
    if (pipe(port_pipe) != 0)
        return -1;
    const pid_t child = fork();
    if (child == 0)
        serve_ours(memory_bytes, port_pipe[1]);
    const bool told = read(port_pipe[0], port, sizeof *port) == sizeof *port;
    close(port_pipe[0]);
    close(port_pipe[1]);
    return told ? child : -1;
}

static void end(pid_t child)
{
    if (child <= 0)
        return;
    kill(child, SIGTERM);
    waitpid(child, NULL, 0);
}

/* --------------------------------------------------------------------------------- agent */

typedef struct {
    FbSession *session;
    bool done[FB_N_TASKS];
    bool refused;  /* the last command */
    GError *error; /* of another task, the first */
} Agent;

static void on_done(FbTask task, const GError *error, void *data)
{
    Agent *a = data;
    a->done[task] = true;
    if (task == FB_TASK_COMMAND)
        a->refused = error != NULL;
    else if (error && !a->error)
        a->error = g_error_copy(error);
}

static void agent_open(Agent *a, uint16_t port, int window, CfgDrip drip)
{
    const CfgAgent agent = {.reply_timeout_s = 5,
                            .reconnect_s = 0.1,
                            .give_up_s = 10,
                            .heartbeat_s = 0.5,
                            .window = window,
                            .drip = drip};
    const FbSessionCallbacks callbacks = {.done = on_done, .data = a};
    g_autofree char *address = g_strdup_printf("modbus://127.0.0.1:%u", port);
    *a = (Agent){0};
    a->session = fb_session_new(&(CfgTarget){.address = address, .unit_id = 1}, &agent, &callbacks,
                                NULL, &a->error);
    while (!a->error && fb_session_status(a->session)->state == FB_STATE_UNKNOWN)
        g_main_context_iteration(NULL, TRUE);
}

/* False, with its message on stderr, where a task has failed. */
static bool agent_close(Agent *a)
{
    const bool good = !a->error;
    if (a->error)
        fprintf(stderr, "%s\n", a->error->message);
    g_clear_error(&a->error);
    g_clear_pointer(&a->session, fb_session_free);
    return good;
}

static void wait_for(Agent *a, FbTask task)
{
    while (!a->done[task] && !a->error)
        g_main_context_iteration(NULL, TRUE);
    a->done[task] = false;
}

/* Seconds that the delivery of so many bytes takes; a gate every PASS_BYTES. */
static double deliver(Agent *a, size_t n)
{
    char *bytes = g_malloc(n);
    memset(bytes, '\n', n);
    g_autoptr(GBytes) program = g_bytes_new_take(bytes, n);
    g_autofree uint64_t *gates = g_new(uint64_t, n / PASS_BYTES + 1);
    size_t n_gates = 0;
    for (size_t at = PASS_BYTES; at < n; at += PASS_BYTES)
        gates[n_gates++] = at;
    gates[n_gates++] = n;
    const double began = seconds();
    fb_session_deliver(a->session, program, gates, n_gates);
    wait_for(a, FB_TASK_DELIVER);
    return seconds() - began;
}

static void start(Agent *a)
{
    fb_session_start(a->session);
    while (!a->error && fb_session_status(a->session)->run == 0)
        g_main_context_iteration(NULL, TRUE);
}

/* ------------------------------------------------------------------------------ measures */

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Beside one round trip of libmodbus on a line that has nothing else to do. */
static void report_holds(const char *what, GArray *holds, double round_trip_ms)
{
    qsort(holds->data, holds->len, sizeof(double), compare);
    const double *ms = (const double *)(const void *)holds->data;
    const struct {
        const char *name;
        double ms;
    } rows[] = {{"p50", ms[holds->len / 2]},
                {"p99", ms[holds->len * 99 / 100]},
                {"max", ms[holds->len - 1]}};
    for (size_t i = 0; i < G_N_ELEMENTS(rows); i++) {
        g_autofree char *name = g_strdup_printf("hold, %s, %s", what, rows[i].name);
        report(name, rows[i].ms, "ms", "libmodbus, one FC23", round_trip_ms, "");
    }
    printf("  (%u holds)\n", holds->len);
}

/* False where there is nothing to hold any more. */
static bool hold(Agent *a, GArray *holds)
{
    const double began = seconds();
    fb_session_command(a->session, FB_COMMAND_HOLD, NULL);
    wait_for(a, FB_TASK_COMMAND);
    const double ms = 1000 * (seconds() - began);
    if (!a->refused && !a->error)
        g_array_append_val(holds, ms);
    return !a->refused && !a->error;
}

/* Bytes/s of a delivery, the program forgotten afterwards. */
static double rate_of(Agent *a, uint16_t port, int window, size_t n)
{
    agent_open(a, port, window, CFG_DRIP_NEVER);
    const double bytes_s = (double)n / deliver(a, n);
    fb_session_command(a->session, FB_COMMAND_CLOSE, NULL);
    wait_for(a, FB_TASK_COMMAND);
    return agent_close(a) ? bytes_s : 0;
}

/* The best of some runs, ours and libmodbus's in turn: what else the host does hits both. */
static double loopback(uint16_t port)
{
    double raw = 0, one = 0, sixteen = 0;
    Agent a;
    for (int i = 0; i < RUNS; i++) {
        raw = fmax(raw, raw_libmodbus());
        one = fmax(one, rate_of(&a, port, 1, PROGRAM_BYTES));
        sixteen = fmax(sixteen, rate_of(&a, port, 16, PROGRAM_BYTES));
    }
    const double its = raw * CHUNK_BYTES * 1e-6;
    report("delivery, window 1", one * 1e-6, "MB/s", "libmodbus, same FC23", its, "  (goal 0.8)");
    report("delivery, window 16", sixteen * 1e-6, "MB/s", "libmodbus, same FC23", its, "");
    return raw;
}

static bool holds_of_an_idle_line(uint16_t port, double raw_rate)
{
    Agent a;
    g_autoptr(GArray) holds = g_array_new(FALSE, FALSE, sizeof(double));
    agent_open(&a, port, 1, CFG_DRIP_NEVER);
    deliver(&a, SLOW_BYTES);
    start(&a);
    while (holds->len < HOLDS && hold(&a, holds))
        ;
    if (holds->len == HOLDS)
        report_holds("idle line", holds, 1000 / raw_rate);
    return agent_close(&a) && holds->len == HOLDS;
}

/* A program larger than the machine's memory, which is executed as fast as it comes: the line is
 * as full as it gets while the machine runs. */
static bool holds_in_a_download(double raw_rate)
{
    uint16_t port;
    Agent a;
    const pid_t machine = machine_spawn(MEMORY_BYTES, &port);
    if (machine < 0)
        return false;
    agent_open(&a, port, 16, CFG_DRIP_ALWAYS);
    deliver(&a, PROGRAM_BYTES);
    g_autoptr(GArray) holds = g_array_new(FALSE, FALSE, sizeof(double));
    const double began = seconds();
    const uint64_t before = fb_session_status(a.session)->received;
    start(&a);
    while (!a.error && !a.done[FB_TASK_RUN] && hold(&a, holds))
        ;
    wait_for(&a, FB_TASK_RUN);
    const double took = seconds() - began;
    const uint64_t bytes = fb_session_status(a.session)->received - before;
    const bool good = agent_close(&a);
    if (good) {
        report("download beside the holds", (double)bytes / took * 1e-6, "MB/s",
               "libmodbus, same FC23", raw_rate * CHUNK_BYTES * 1e-6, "");
        report_holds("download", holds, 1000 / raw_rate);
    }
    end(machine);
    return good;
}

static bool slow_network(void)
{
    static const int windows[] = {1, 4, 16};
    double bytes_s[G_N_ELEMENTS(windows)] = {0};
    uint16_t near, far;
    Agent a;
    const pid_t machine = machine_spawn(SLOW_BYTES * 2, &near);
    const pid_t relay = machine > 0 ? relay_spawn(near, DELAY_US, &far) : -1;
    for (size_t i = 0; relay > 0 && i < G_N_ELEMENTS(windows); i++) {
        bytes_s[i] = rate_of(&a, far, windows[i], SLOW_BYTES);
        g_autofree char *what =
            g_strdup_printf("delivery, %d ms, window %d", 2 * DELAY_US / 1000, windows[i]);
        report(what, bytes_s[i] * 1e-3, "kB/s", "window 1, same network", bytes_s[0] * 1e-3,
               windows[i] == 16 ? "  (goal 10)" : "");
    }
    end(relay);
    end(machine);
    return bytes_s[G_N_ELEMENTS(windows) - 1] > 0;
}

int main(void)
{
    uint16_t port;
    pin();
    const pid_t machine = machine_spawn(2 * PROGRAM_BYTES, &port);
    if (machine < 0)
        return 1;
    const double raw_rate = loopback(port);
    const bool good =
        holds_of_an_idle_line(port, raw_rate) && holds_in_a_download(raw_rate) && slow_network();
    end(machine);
    return good ? 0 : 1;
}
