/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Delivery over loopback beside what libmodbus alone does with the same FC23, in the same run: each
 * with its machine in a child, both ends pinned to one core.
 */
#include <arpa/inet.h>
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

enum { PROGRAM_BYTES = 8 << 20, CHUNK_BYTES = 218, RAW_REQUESTS = 40000, HOLDS = 2000 };

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

/* ------------------------------------------------------------------------------- ours */

typedef struct {
    FbReceiver *receiver;
    GMainLoop *loop;
    int tasks;
    GError *error;
} Peer;

static void act(FbDo what, void *data)
{
    static const int answer[] = {[FB_DO_VERIFY] = FB_MACHINE_VERIFIED,
                                 [FB_DO_START] = -1,
                                 [FB_DO_HOLD] = FB_MACHINE_HELD,
                                 [FB_DO_HOLD_AT_GATE] = -1,
                                 [FB_DO_RESUME] = -1,
                                 [FB_DO_ABORT] = FB_MACHINE_ABORTED,
                                 [FB_DO_FORGET] = -1};
    Peer *p = data;
    if (answer[what] >= 0)
        fb_receiver_machine(p->receiver, (FbMachineEvent)answer[what], NULL, g_get_monotonic_time(),
                            NULL);
}

static void serve_ours(int port_pipe)
{
    const FbReceiverOptions options = {.epoch = 1,
                                       .memory_bytes = 2 * PROGRAM_BYTES,
                                       .agent_timeout_us = 60000000,
                                       .lease_timeout_us = 120000000};
    Peer p = {.receiver = fb_receiver_new(&options), .loop = g_main_loop_new(NULL, FALSE)};
    fb_receiver_machine(p.receiver, FB_MACHINE_ACKNOWLEDGED, NULL, 0, NULL);
    FbModbusServer *server =
        fb_modbus_server_new(&(FbModbusServerOptions){.host = "127.0.0.1", .unit_id = 1},
                             p.receiver, act, &p, NULL, NULL);
    const uint16_t port = server ? fb_modbus_server_port(server) : 0;
    if (write(port_pipe, &port, sizeof port) == sizeof port)
        g_main_loop_run(p.loop);
    _exit(0);
}

static void on_done(FbTask task, const GError *error, void *data)
{
    (void)task;
    Peer *p = data;
    p->tasks++;
    if (error && !p->error)
        p->error = g_error_copy(error);
    g_main_loop_quit(p->loop);
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print_holds(FbSession *session, Peer *p)
{
    static double ms[HOLDS];
    for (int i = 0; i < HOLDS && !p->error; i++) {
        const double began = seconds();
        fb_session_command(session, FB_COMMAND_HOLD, NULL);
        g_main_loop_run(p->loop);
        ms[i] = 1000 * (seconds() - began);
        fb_session_command(session, FB_COMMAND_RESUME, NULL);
        g_main_loop_run(p->loop);
    }
    qsort(ms, HOLDS, sizeof *ms, compare);
    printf("hold request to answer: p50 %.3f ms, p99 %.3f ms, max %.3f ms (%d holds)\n",
           ms[HOLDS / 2], ms[HOLDS * 99 / 100], ms[HOLDS - 1], HOLDS);
}

static bool ours(double raw_rate)
{
    int port_pipe[2];
    uint16_t port = 0;
    if (pipe(port_pipe) != 0)
        return false;
    const pid_t child = fork();
    if (child == 0)
        serve_ours(port_pipe[1]);
    if (read(port_pipe[0], &port, sizeof port) != sizeof port)
        return false;
    const CfgAgent agent = {
        .reply_timeout_s = 5, .reconnect_s = 0.1, .give_up_s = 10, .heartbeat_s = 0.5};
    Peer p = {.loop = g_main_loop_new(NULL, FALSE)};
    const FbSessionCallbacks callbacks = {.done = on_done, .data = &p};
    g_autofree char *address = g_strdup_printf("modbus://127.0.0.1:%u", port);
    FbSession *session = fb_session_new(&(CfgTarget){.address = address, .unit_id = 1}, &agent,
                                        &callbacks, NULL, &p.error);
    char *bytes = g_malloc(PROGRAM_BYTES);
    memset(bytes, 'X', PROGRAM_BYTES);
    g_autoptr(GBytes) program = g_bytes_new_take(bytes, PROGRAM_BYTES);
    const uint64_t gates[] = {PROGRAM_BYTES};

    const double began = seconds();
    fb_session_deliver(session, program, gates, 1);
    g_main_loop_run(p.loop);
    const double took = seconds() - began;
    const double rate = PROGRAM_BYTES / (double)CHUNK_BYTES / took;
    printf("delivery: %.0f kB/s, %.0f round trips/s at window 1, %d MB in %.2f s\n",
           PROGRAM_BYTES / took / 1000, rate, PROGRAM_BYTES >> 20, took);
    printf("libmodbus alone, same FC23: %.0f kB/s, %.0f round trips/s; ours/its %.2f\n",
           raw_rate * CHUNK_BYTES / 1000, raw_rate, rate / raw_rate);
    if (!p.error) {
        fb_session_start(session);
        while (!p.error && fb_session_status(session)->state != FB_STATE_RUNNING)
            g_main_context_iteration(NULL, TRUE);
        print_holds(session, &p);
    }
    if (p.error)
        fprintf(stderr, "%s\n", p.error->message);
    kill(child, SIGTERM);
    waitpid(child, NULL, 0);
    fb_session_free(session);
    g_main_loop_unref(p.loop);
    return !p.error;
}

int main(void)
{
    pin();
    return ours(raw_libmodbus()) ? 0 : 1;
}
