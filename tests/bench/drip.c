/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drip feed of vcnc at the speed of a real machine: a program of a thousand short blocks a second,
 * many times larger than the machine's memory, over a network with 2 ms round trip. What counts is
 * that the machine never waits for bytes.
 */
#include <glib/gstdio.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>

#include "fieldbus/fieldbus.h"
#include "tests/lib/relay.h"
#include "tests/lib/test.h"

enum {
    PASSES = 20,
    BLOCKS = 1000,        /* of a pass, 0.085 mm each at 100 mm/s */
    MEMORY_BYTES = 32768, /* three passes and the table of gates */
    DELAY_US = 1000,      /* of the network, in each direction */
    WINDOW = 8,
};

/* Passes to and fro, the tool raised a little between them; offsets of the gates in `gates`. */
static GBytes *make_program(uint64_t *gates)
{
    GString *text = g_string_new("G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01\nT2 M6\nS6000 M3\n"
                                 "G53 G0 Z0\nG53 G0 X-100 Y-100\n");
    for (int pass = 0; pass < PASSES; pass++) {
        const double from = pass % 2 ? -185 : -100, step = pass % 2 ? 0.085 : -0.085;
        g_string_append_printf(text, "(REGION %d convex tool=2 feed=6000)\nG53 G1 Z-0.2 F6000\n",
                               pass + 1);
        for (int i = 1; i <= BLOCKS; i++)
            g_string_append_printf(text, "G53 X%.3f\n", from + i * step);
        g_string_append(text, "G53 G0 Z0\n");
        gates[pass] = text->len;
    }
    g_string_append(text, "M5\nM30\n");
    gates[PASSES] = text->len;
    return g_string_free_to_bytes(text);
}

typedef struct {
    GPid pid;
    GIOChannel *person, *output;
    uint16_t port;
    char *folder;
} Vcnc;

static bool vcnc_start(Vcnc *vcnc, GError **error)
{
    vcnc->folder = test_folder();
    g_autofree char *program = test_program("vcnc");
    g_autofree char *machine = g_build_filename(vcnc->folder, "machine.ini", NULL);
    g_autofree char *here = g_get_current_dir();
    g_autofree char *text = g_strdup_printf("[machine]\nprogram_memory_bytes = %d\n[tools]\n"
                                            "file = %s/config/etc/tools.ini\nchange_s = 0\n",
                                            MEMORY_BYTES, here);
    char *const arguments[] = {program, "--machine", machine, "--modbus", "127.0.0.1:0", NULL};
    g_autofree char *line = NULL;
    int in, out;
    if (!g_file_set_contents(machine, text, -1, error) ||
        !g_spawn_async_with_pipes(NULL, (char **)arguments, NULL, G_SPAWN_DO_NOT_REAP_CHILD, NULL,
                                  NULL, &vcnc->pid, &in, &out, NULL, error))
        return false;
    vcnc->person = g_io_channel_unix_new(in);
    vcnc->output = g_io_channel_unix_new(out);
    if (g_io_channel_read_line(vcnc->output, &line, NULL, NULL, error) != G_IO_STATUS_NORMAL)
        return false;
    vcnc->port = (uint16_t)g_ascii_strtoull(strrchr(line, ':') + 1, NULL, 10);
    return g_io_channel_write_chars(vcnc->person, "ack\n", 4, NULL, error) == G_IO_STATUS_NORMAL &&
           g_io_channel_flush(vcnc->person, error) == G_IO_STATUS_NORMAL;
}

static void vcnc_end(Vcnc *vcnc)
{
    if (vcnc->pid > 0) {
        kill(vcnc->pid, SIGTERM);
        waitpid(vcnc->pid, NULL, 0);
    }
    g_clear_pointer(&vcnc->person, g_io_channel_unref);
    g_clear_pointer(&vcnc->output, g_io_channel_unref);
    test_folder_remove(vcnc->folder);
}

static void on_done(FbTask task, const GError *error, void *data)
{
    (void)task;
    GError **ended = data;
    *ended = error ? g_error_copy(error) : g_error_new(FB_ERROR, -1, "done");
}

/* Waits for the task's end; false with the error where it failed. */
static bool ended_well(GError **ended, GError **error)
{
    while (!*ended)
        g_main_context_iteration(NULL, TRUE);
    g_autoptr(GError) how = g_steal_pointer(ended);
    if (how->code == -1)
        return true;
    g_propagate_error(error, g_steal_pointer(&how));
    return false;
}

static bool feed(uint16_t port, GError **error)
{
    const CfgAgent agent = {.reply_timeout_s = 1,
                            .reconnect_s = 0.1,
                            .give_up_s = 5,
                            .heartbeat_s = 0.5,
                            .window = WINDOW,
                            .drip = CFG_DRIP_AUTO};
    g_autoptr(GError) ended = NULL;
    const FbSessionCallbacks callbacks = {.done = on_done, .data = &ended};
    g_autofree char *address = g_strdup_printf("modbus://127.0.0.1:%u", port);
    g_autoptr(FbSession) session = fb_session_new(&(CfgTarget){.address = address, .unit_id = 1},
                                                  &agent, &callbacks, NULL, error);
    uint64_t gates[PASSES + 1];
    g_autoptr(GBytes) program = make_program(gates);
    if (!session)
        return false;
    while (fb_session_status(session)->state != FB_STATE_IDLE)
        g_main_context_iteration(NULL, TRUE);
    const int64_t began_us = g_get_monotonic_time();
    fb_session_deliver(session, program, gates, G_N_ELEMENTS(gates));
    if (!ended_well(&ended, error))
        return false;
    const double line_kb_s = (double)fb_session_status(session)->received * 1e3 /
                             (double)(g_get_monotonic_time() - began_us);
    fb_session_start(session);
    if (!ended_well(&ended, error))
        return false;
    const FbStatus *s = fb_session_status(session);
    const double time_s = s->program_time_ms * 1e-3;
    const double used_kb_s = (double)g_bytes_get_size(program) * 1e-3 / time_s;
    printf("drip feed, %d ms round trip: %.0f blocks/s over %.1f s, program %zu kB in a memory of "
           "%d kB\n",
           2 * DELAY_US / 1000, (double)s->executed_blocks / time_s, time_s,
           g_bytes_get_size(program) / 1000, MEMORY_BYTES / 1000);
    printf(
        "  the machine used %.1f kB/s, the line with window %d brought %.1f kB/s in the prefill, "
        "ratio %.1f\n",
        used_kb_s, WINDOW, line_kb_s, line_kb_s / used_kb_s);
    printf("  starved %u times, %u ms  (goal 0)\n", s->starved, s->starved_ms);
    return true;
}

int main(void)
{
    g_autoptr(GError) error = NULL;
    Vcnc vcnc = {0};
    uint16_t far;
    pid_t relay = -1;
    bool good = vcnc_start(&vcnc, &error);
    if (good)
        relay = relay_spawn(vcnc.port, DELAY_US, &far);
    good = relay > 0 && feed(far, &error);
    if (!good)
        fprintf(stderr, "%s\n", error ? error->message : "no relay");
    if (relay > 0) {
        kill(relay, SIGTERM);
        waitpid(relay, NULL, 0);
    }
    vcnc_end(&vcnc);
    return good ? 0 : 1;
}
