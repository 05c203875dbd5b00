/* SPDX-License-Identifier: Apache-2.0 */
/* Any bytes as any of the configuration files: the first byte chooses which. */
#include <stdint.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

#include "config/config.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void load(uint8_t kind, const char *path, GError **error)
{
    switch (kind % 4) {
    case 0:
        cfg_recipe_free(cfg_recipe_load(path, NULL, error));
        break;
    case 1:
        cfg_machine_free(cfg_machine_load(path, error));
        break;
    case 2:
        cfg_tools_free(cfg_tools_load(path, error));
        break;
    default:
        cfg_agent_free(cfg_agent_load(path, error));
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size == 0)
        return 0;
    int file = memfd_create("ini", 0);
    if (file < 0 || write(file, data + 1, size - 1) != (ssize_t)(size - 1))
        return 0;
    g_autofree char *path = g_strdup_printf("/proc/self/fd/%d", file);
    g_autoptr(GError) error = NULL;
    load(data[0], path, &error);
    g_assert(!error || error->domain == CFG_ERROR);
    close(file);
    return 0;
}
