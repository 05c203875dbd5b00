/* SPDX-License-Identifier: Apache-2.0 */
/* The whole machine on loopback, and an agent's session in the same main loop. */
#ifndef TESTS_UNIT_SIM_CELL_H
#define TESTS_UNIT_SIM_CELL_H

#include "sim/machine.h"
#include "tests/unit/sim_rig.h"

typedef struct {
    Rig rig; /* its machine and tool table */
    SimMachine *machine;
    SimLog *log;
    char *folder;
    CfgAgent *agent;
    FbSession *session;
    int done[FB_N_TASKS];         /* tasks of each kind that have ended */
    GError *error;                /* of the last one */
    int64_t shown_us, longest_us; /* when the last status came; longest silence */
} Cell;

static inline void on_status(const FbStatus *status, void *data)
{
    (void)status;
    Cell *cell = data;
    int64_t now_us = g_get_monotonic_time();
    if (cell->shown_us)
        cell->longest_us = MAX(cell->longest_us, now_us - cell->shown_us);
    cell->shown_us = now_us;
}

static inline void on_done(FbTask task, const GError *error, void *data)
{
    Cell *cell = data;
    cell->done[task]++;
    g_clear_error(&cell->error);
    if (error)
        cell->error = g_error_copy(error);
}

static inline void connect_agent(Cell *cell)
{
    g_autofree char *address =
        g_strdup_printf("modbus://127.0.0.1:%u", sim_machine_port(cell->machine));
    FbSessionCallbacks callbacks = {.status = on_status, .done = on_done, .data = cell};
    cell->session = fb_session_new(&(CfgTarget){.address = address, .unit_id = 1}, cell->agent,
                                   &callbacks, NULL, NULL);
    g_assert_nonnull(cell->session);
}

static inline bool cell_init_dripping(Cell *cell, double speed, double agent_timeout_s,
                                      uint64_t memory_bytes, CfgDrip drip)
{
    *cell = (Cell){0};
    rig_init(&cell->rig, 1, 1);
    g_autoptr(GError) error = NULL;
    cell->rig.machine.program_memory_bytes = memory_bytes;
    cell->rig.machine.agent_timeout_s = agent_timeout_s;
    cell->folder = test_folder();
    g_autofree char *path = g_build_filename(cell->folder, "log", NULL);
    cell->log = sim_log_open(path, &error);
    g_assert_no_error(error);
    SimMachineOptions options = {.machine = &cell->rig.machine,
                                 .tools = &cell->rig.table,
                                 .plain = {(char *)"127.0.0.1", 0},
                                 .speed = speed,
                                 .epoch = 7,
                                 .log = cell->log};
    cell->machine = sim_machine_new(&options, &error);
    g_assert_no_error(error);
    cell->agent = cfg_agent_default(&error);
    g_assert_no_error(error);
    if (!cell->machine || !cell->agent)
        return false;
    cell->agent->heartbeat_s = 0.02;
    cell->agent->drip = drip;
    connect_agent(cell);
    return cell->session != NULL;
}

static inline bool cell_init(Cell *cell, double speed, double agent_timeout_s)
{
    return cell_init_dripping(cell, speed, agent_timeout_s, 64 << 20, CFG_DRIP_NEVER);
}

static inline void cell_clear(Cell *cell)
{
    fb_session_free(cell->session);
    cfg_agent_free(cell->agent);
    sim_machine_free(cell->machine);
    g_assert_true(sim_log_close(cell->log, NULL));
    test_folder_remove(cell->folder);
    g_clear_error(&cell->error);
    rig_clear(&cell->rig);
}

static inline gboolean wake(void *data)
{
    (void)data;
    return G_SOURCE_CONTINUE;
}

/* Serves both ends until the state is shown. */
static inline bool wait_state(Cell *cell, FbState state)
{
    guint timer = g_timeout_add(10, wake, NULL);
    int64_t end_us = g_get_monotonic_time() + 30000000;
    while (fb_session_status(cell->session)->state != state && g_get_monotonic_time() < end_us)
        g_main_context_iteration(NULL, TRUE);
    g_source_remove(timer);
    FbState reached = fb_session_status(cell->session)->state;
    g_assert_cmpstr(fb_state_name(reached), ==, fb_state_name(state));
    return reached == state;
}

/* Serves both ends until the feed is shown, in a line from this one on. */
static inline void wait_feed(Cell *cell, uint32_t line, double feed_mm_min)
{
    guint timer = g_timeout_add(10, wake, NULL);
    int64_t end_us = g_get_monotonic_time() + 30000000;
    const FbStatus *status = fb_session_status(cell->session);
    while ((status->line < line || fabs(status->feed_mm_min - feed_mm_min) > 1e-6) &&
           g_get_monotonic_time() < end_us) {
        g_main_context_iteration(NULL, TRUE);
        status = fb_session_status(cell->session);
    }
    g_source_remove(timer);
}

static inline bool wait_done(Cell *cell, FbTask task)
{
    guint timer = g_timeout_add(10, wake, NULL);
    int64_t end_us = g_get_monotonic_time() + 60000000;
    int before = cell->done[task];
    while (cell->done[task] == before && g_get_monotonic_time() < end_us)
        g_main_context_iteration(NULL, TRUE);
    g_source_remove(timer);
    g_assert_cmpint(cell->done[task], ==, before + 1);
    return cell->done[task] > before;
}

static inline void deliver(Cell *cell, const char *text, const uint64_t *gates, size_t n_gates)
{
    g_autoptr(GBytes) program = g_bytes_new(text, strlen(text));
    const uint64_t end = strlen(text);
    fb_session_deliver(cell->session, program, gates ? gates : &end, gates ? n_gates : 1);
    wait_done(cell, FB_TASK_DELIVER);
}

/* Switched on and with a program. */
static inline bool ready(Cell *cell, const char *text, const uint64_t *gates, size_t n_gates)
{
    sim_machine_press(cell->machine, SIM_ACKNOWLEDGE);
    deliver(cell, text, gates, n_gates);
    g_assert_no_error(cell->error);
    return wait_state(cell, FB_STATE_READY);
}

static inline char *read_log(const Cell *cell)
{
    g_autofree char *path = g_build_filename(cell->folder, "log", NULL);
    char *text = NULL;
    g_file_get_contents(path, &text, NULL, NULL);
    g_assert_nonnull(text);
    return text;
}

#endif
