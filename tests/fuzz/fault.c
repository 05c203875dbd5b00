/* SPDX-License-Identifier: Apache-2.0 */
/* Any bytes as a fault script; what is taken is carried out to its end. */
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "sim/fault.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A reply has one fate; a fault of the script begins once. */
static void carry_out(const SimFaultScript *script)
{
    g_autoptr(SimFaults) faults = sim_faults_new(script);
    g_autoptr(GArray) actions = g_array_new(FALSE, FALSE, sizeof(SimFaultDo));
    guint notes = 0, fates = 0;
    for (uint32_t i = 0; i < 60; i++) {
        const SimFaultEvent event = {.kind = i % 3, .line = i < 50 ? i : UINT32_MAX};
        sim_faults_step(faults, &event, i < 50 ? i : 1e9, actions);
        fates += event.kind == SIM_FAULT_FRAME;
    }
    for (guint i = 0; i < actions->len; i++) {
        const SimFaultDo *what = &g_array_index(actions, SimFaultDo, i);
        notes += what->kind == SIM_FAULT_DO_NOTE;
        fates -= what->kind == SIM_FAULT_DO_FATE;
        g_assert(what->event != SIM_FAIL || what->alarm.code > 0);
        g_assert(what->fate.delay_us >= 0 && what->fate.copies <= 2);
    }
    g_assert(fates == 0 && notes <= script->faults->len);
    g_free(sim_faults_summary(faults));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int file = memfd_create("faults", 0);
    if (file < 0 || write(file, data, size) != (ssize_t)size)
        return 0;
    g_autofree char *path = g_strdup_printf("/proc/self/fd/%d", file);
    g_autoptr(GError) error = NULL;
    g_autoptr(SimFaultScript) script = sim_fault_script_new();
    const bool good = sim_fault_script_read(script, path, &error);
    g_assert(good == !error);
    g_assert(!error || error->domain == SIM_FAULT_ERROR);
    g_assert(script->rate >= 0 && script->rate <= 1);
    carry_out(script);
    close(file);
    return 0;
}
