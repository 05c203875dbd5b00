/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/feed.h"

#include <gio/gio.h>

#include "sim/probing.h"

struct SimFeed {
    const CfgMachine *machine;
    const CfgToolTable *tools;
    SimFeedCallbacks callbacks;
    SimMaterial *material; /* NULL: none */
    SimReader *reader;     /* of the program that was begun */
    GTask *examination;    /* whose result is wanted; not owned */
    bool planning;
    int under_way; /* tasks */
    bool closing;
};

/* What a thread works on: all of it its own, or immutable. */
typedef struct {
    SimReader *reader;
    GPtrArray *parts; /* GBytes */
    uint64_t *gates;  /* of the one part; NULL: each part's end */
    size_t n_gates;
    bool last;
    NcOverride override;
    GPtrArray *programs; /* the result */
} Examination;

typedef struct {
    SimProgram *program;
    const CfgMachine *machine;
    NcOverride override;
} Planning;

static void examine(SimFeed *feed, Examination *examination);

void sim_feed_program(SimFeed *feed, GBytes *bytes, const uint64_t *gates, size_t n_gates,
                      NcOverride override)
{
    Examination *examination = g_new0(Examination, 1);
    examination->parts = g_ptr_array_new_with_free_func((GDestroyNotify)g_bytes_unref);
    g_ptr_array_add(examination->parts, g_bytes_ref(bytes));
    examination->gates = g_memdup2(gates, n_gates * sizeof *gates);
    examination->n_gates = n_gates;
    examination->last = true;
    examination->override = override;
    examine(feed, examination);
}

void sim_feed_passes(SimFeed *feed, GPtrArray *passes, bool last, NcOverride override)
{
    Examination *examination = g_new0(Examination, 1);
    examination->parts = passes;
    examination->last = last;
    examination->override = override;
    examine(feed, examination);
}

/* -------------------------------------------------------------------- examination */

static void examination_free(void *data)
{
    Examination *examination = data;
    sim_reader_unref(examination->reader);
    g_ptr_array_unref(examination->parts);
    g_ptr_array_unref(examination->programs);
    g_free(examination->gates);
    g_free(examination);
}

static void examine_in_thread(GTask *task, void *source, void *data, GCancellable *cancellable)
{
    (void)source, (void)cancellable;
    Examination *e = data;
    GError *error = NULL;
    for (guint i = 0; i < e->parts->len; i++) {
        GBytes *bytes = g_ptr_array_index(e->parts, i);
        const uint64_t end = g_bytes_get_size(bytes);
        const bool last = e->last && i + 1 == e->parts->len;
        SimProgram *program = sim_reader_read(e->reader, bytes, e->gates ? e->gates : &end,
                                              e->gates ? e->n_gates : 1, last, e->override, &error);
        if (!program) {
            g_task_return_error(task, error);
            return;
        }
        g_ptr_array_add(e->programs, program);
    }
    g_task_return_boolean(task, TRUE);
}

static void examined(GObject *source, GAsyncResult *result, void *data)
{
    (void)source;
    SimFeed *feed = data;
    g_autoptr(GError) error = NULL;
    const Examination *examination = g_task_get_task_data(G_TASK(result));
    g_task_propagate_boolean(G_TASK(result), &error);
    feed->under_way--;
    if (feed->examination != G_TASK(result))
        return;
    feed->examination = NULL;
    feed->callbacks.examined(examination->programs, error, feed->callbacks.data);
}

static void examine(SimFeed *feed, Examination *examination)
{
    g_assert(!feed->examination && feed->reader);
    examination->reader = sim_reader_ref(feed->reader);
    examination->programs = g_ptr_array_new_with_free_func((GDestroyNotify)sim_program_unref);
    g_autoptr(GTask) task = g_task_new(NULL, NULL, examined, feed);
    g_task_set_task_data(task, examination, examination_free);
    feed->examination = task;
    feed->under_way++;
    g_task_run_in_thread(task, examine_in_thread);
}

/* ----------------------------------------------------------------------- planning */

static void planning_free(void *data)
{
    Planning *planning = data;
    sim_program_unref(planning->program);
    g_free(planning);
}

static void plan_in_thread(GTask *task, void *source, void *data, GCancellable *cancellable)
{
    (void)source, (void)cancellable;
    const Planning *p = data;
    g_task_return_pointer(task, sim_plan_new(p->program, p->machine, p->override),
                          (GDestroyNotify)sim_plan_unref);
}

static void planned(GObject *source, GAsyncResult *result, void *data)
{
    (void)source;
    SimFeed *feed = data;
    g_autoptr(SimPlan) plan = g_task_propagate_pointer(G_TASK(result), NULL);
    const Planning *planning = g_task_get_task_data(G_TASK(result));
    feed->under_way--;
    feed->planning = false;
    if (!feed->closing)
        feed->callbacks.planned(planning->program, g_steal_pointer(&plan), feed->callbacks.data);
}

bool sim_feed_plan(SimFeed *feed, SimProgram *program, NcOverride override)
{
    if (feed->planning || feed->closing)
        return false;
    Planning *planning = g_new0(Planning, 1);
    *planning = (Planning){sim_program_ref(program), feed->machine, override};
    g_autoptr(GTask) task = g_task_new(NULL, NULL, planned, feed);
    g_task_set_task_data(task, planning, planning_free);
    feed->planning = true;
    feed->under_way++;
    g_task_run_in_thread(task, plan_in_thread);
    return true;
}

/* ---------------------------------------------------------------------- ownership */

SimFeed *sim_feed_new(const CfgMachine *machine, const CfgToolTable *tools,
                      const SimFeedCallbacks *callbacks)
{
    SimFeed *feed = g_new0(SimFeed, 1);
    feed->machine = machine;
    feed->tools = tools;
    feed->callbacks = *callbacks;
    return feed;
}

void sim_feed_set_material(SimFeed *feed, SimMaterial *material)
{
    feed->material = material;
}

void sim_feed_free(SimFeed *feed)
{
    if (!feed)
        return;
    feed->closing = true;
    feed->examination = NULL;
    while (feed->under_way > 0)
        g_main_context_iteration(NULL, TRUE);
    sim_reader_unref(feed->reader);
    g_free(feed);
}

void sim_feed_begin(SimFeed *feed)
{
    feed->examination = NULL;
    sim_reader_unref(feed->reader);
    feed->reader = sim_reader_new(feed->machine, feed->tools);
    if (feed->material)
        sim_reader_set_probing(feed->reader, sim_probing_new(feed->material));
}

bool sim_feed_busy(const SimFeed *feed)
{
    return feed->examination != NULL;
}
