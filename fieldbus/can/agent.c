/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/can/agent.h"

#include <net/if.h>
#include <stddef.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static const char scheme[] = "can://";

FbCanAgent *fb_can_agent_new_on(FbCanBus bus, const FbCanKey *key, uint16_t base, unsigned number)
{
    FbCanAgent *agent = g_new0(FbCanAgent, 1);
    *agent = (FbCanAgent){1, bus, *key, base, number, -1};
    return agent;
}

/* A name in the kernel, that only one program at a time can have, and that goes with its process.
 * Any user of this host can take it, and so keep agents from this bus: he gets no key by that. */
static bool take_seat(FbCanAgent *agent, const char *interface, int number)
{
    struct sockaddr_un name = {.sun_family = AF_UNIX};
    const int n = g_snprintf(name.sun_path + 1, sizeof name.sun_path - 1, "segmill/can/%s/%d",
                             interface, number);
    agent->number = (unsigned)number;
    agent->seat = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (agent->seat >= 0 &&
        bind(agent->seat, (const struct sockaddr *)&name,
             (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)n)) == 0)
        return true;
    if (agent->seat >= 0)
        close(agent->seat);
    agent->seat = -1;
    return false;
}

FbCanAgent *fb_can_agent_new(const CfgTarget *target, GError **error)
{
    FbCanKey key;
    const char *interface = target->address + strlen(scheme);
    if (!target->can_key) {
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                    "a CAN bus needs a key: can_key of a [machine.NAME] with this address in the "
                    "agent's configuration");
        return NULL;
    }
    if (*interface == '\0' || strlen(interface) >= IFNAMSIZ) {
        g_set_error(error, FB_ERROR, FB_ERROR_UNREACHABLE,
                    "%s: a network interface has a name of 1 to %d bytes: can://can0",
                    target->address, IFNAMSIZ - 1);
        return NULL;
    }
    if (!fb_can_key_load(&key, target->can_key, error))
        return NULL;
    g_autoptr(FbCanAgent) agent =
        fb_can_agent_new_on(fb_can_bus_new(interface), &key, (uint16_t)target->can_base, 0);
    explicit_bzero(&key, sizeof key);
    for (int number = target->can_first; number <= target->can_last; number++)
        if (take_seat(agent, interface, number))
            return g_steal_pointer(&agent);
    g_set_error(
        error, FB_ERROR, FB_ERROR_UNREACHABLE,
        "other programs have all the agents' numbers from %d to %d on %s: wait for them, or "
        "widen can_first and can_last",
        target->can_first, target->can_last, interface);
    return NULL;
}

FbCanAgent *fb_can_agent_ref(FbCanAgent *agent)
{
    agent->references++;
    return agent;
}

void fb_can_agent_unref(FbCanAgent *agent)
{
    if (!agent || --agent->references > 0)
        return;
    fb_can_bus_clear(&agent->bus);
    if (agent->seat >= 0)
        close(agent->seat);
    explicit_bzero(&agent->key, sizeof agent->key);
    g_free(agent);
}
