/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/agent.h"
#include "config/config.h"
#include "fieldbus/fieldbus.h"
#include "nc/nc.h"
#include "segcore/segcore.h"

G_DEFINE_QUARK(agent_error, agent_error)

#define ANY_CODE (-1)

/* The first row that fits counts. */
static const struct {
    GQuark (*domain)(void);
    const char *name;
    int code;
    AgentExit status;
} statuses[] = {
    {agent_error_quark, "agent", AGENT_ERROR_INTERRUPTED, AGENT_EXIT_ABORTED},
    {agent_error_quark, "agent", AGENT_ERROR_USAGE, AGENT_EXIT_USAGE},
    {agent_error_quark, "agent", AGENT_ERROR_TARGET, AGENT_EXIT_USAGE},
    {agent_error_quark, "agent", AGENT_ERROR_INPUT, AGENT_EXIT_INPUT},
    {agent_error_quark, "agent", AGENT_ERROR_CAUTION, AGENT_EXIT_CAUTION},
    {agent_error_quark, "agent", ANY_CODE, AGENT_EXIT_FAILED},
    {cfg_error_quark, "config", CFG_ERROR_SET, AGENT_EXIT_USAGE},
    {cfg_error_quark, "config", ANY_CODE, AGENT_EXIT_INPUT},
    {seg_error_quark, "segcore", SEG_ERROR_IO, AGENT_EXIT_FAILED},
    {seg_error_quark, "segcore", ANY_CODE, AGENT_EXIT_INPUT},
    {nc_error_quark, "nc", ANY_CODE, AGENT_EXIT_INPUT},
    {fb_error_quark, "fieldbus", FB_ERROR_ALARM, AGENT_EXIT_ALARM},
    {fb_error_quark, "fieldbus", FB_ERROR_ABORTED, AGENT_EXIT_ABORTED},
    {fb_error_quark, "fieldbus", FB_ERROR_LINK_LOST, AGENT_EXIT_LINK_LOST},
    {fb_error_quark, "fieldbus", FB_ERROR_CREDENTIALS, AGENT_EXIT_INPUT},
    {fb_error_quark, "fieldbus", ANY_CODE, AGENT_EXIT_REFUSED},
};

AgentExit agent_exit_of(const GError *error)
{
    for (size_t i = 0; i < G_N_ELEMENTS(statuses); i++)
        if (error->domain == statuses[i].domain() &&
            (statuses[i].code == ANY_CODE || statuses[i].code == error->code))
            return statuses[i].status;
    return AGENT_EXIT_FAILED;
}

const char *agent_domain_name(GQuark domain)
{
    for (size_t i = 0; i < G_N_ELEMENTS(statuses); i++)
        if (domain == statuses[i].domain())
            return statuses[i].name;
    return g_quark_to_string(domain);
}
