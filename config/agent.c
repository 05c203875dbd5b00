/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#include <string.h>

#define AT(field) offsetof(CfgAgent, field)
#define PANEL(field) offsetof(CfgAgent, panel.field)
#define MACHINE(field) offsetof(CfgTarget, field)

static const CfgChoice drips[] = {
    {"auto", CFG_DRIP_AUTO}, {"never", CFG_DRIP_NEVER}, {"always", CFG_DRIP_ALWAYS}, {NULL, 0}};

static const CfgChoice biases[] = {{"as-is", CFG_BIAS_AS_IS},
                                   {"disabled", CFG_BIAS_DISABLED},
                                   {"pull-up", CFG_BIAS_PULL_UP},
                                   {"pull-down", CFG_BIAS_PULL_DOWN},
                                   {NULL, 0}};

static const CfgKey keys[] = {
    {"link", "reply_timeout_s", CFG_REAL, "s", "1", 0.01, 60, AT(reply_timeout_s),
     .help = "No answer for this long: close, reconnect, read where the machine is."},
    {"link", "reconnect_s", CFG_REAL, "s", "0.5", 0.01, 60, AT(reconnect_s),
     .help = "Pause before a reconnect."},
    {"link", "give_up_s", CFG_REAL, "s", "30", 0.1, 3600, AT(give_up_s),
     .help = "A machine that is not reachable for this long is given up."},
    {"link", "heartbeat_s", CFG_REAL, "s", "0.5", 0.01, 60, AT(heartbeat_s),
     .help = "How often the machine's state is read, which also tells it that the agent lives."},
    {"link", "window", CFG_INT, "", "8", 1, 16, AT(window),
     .help = "Requests in flight on a connection, if the machine allows as many: what a slow line "
             "needs to be filled."},
    {"link", "drip", CFG_CHOICE, "", "auto", 0, 0, AT(drip),
     .help = "Feed a program while it runs: only where it is larger than the machine's memory, "
             "never, or always.",
     .choices = drips},
    {"panel", "chip", CFG_STRING, "", "", 0, 0, PANEL(chip),
     .help = "The operator's panel: its GPIO chip by name, label or path; empty: there is none. "
             "Lines are given by name or by offset."},
    {"panel", "start", CFG_STRING, "", "", 0, 0, PANEL(start), .help = "Line of the start button."},
    {"panel", "hold", CFG_STRING, "", "", 0, 0, PANEL(hold), .help = "Line of the hold button."},
    {"panel", "lamp", CFG_STRING, "", "", 0, 0, PANEL(lamp), .help = "Line of the lamp."},
    {"panel", "active_low", CFG_BOOL, "", "false", 0, 0, PANEL(active_low),
     .help = "A pressed button pulls its line low."},
    {"panel", "lamp_active_low", CFG_BOOL, "", "false", 0, 0, PANEL(lamp_active_low),
     .help = "The lamp is lit by a low line."},
    {"panel", "bias", CFG_CHOICE, "", "as-is", 0, 0, PANEL(bias),
     .help = "The chip's own resistors at the buttons.", .choices = biases},
    {"panel", "debounce_ms", CFG_INT, "ms", "20", 1, 500, PANEL(debounce_ms),
     .help = "A start button is believed when its line has not changed for this long."},
    {"machine.*", "address", CFG_STRING, "", "modbus://127.0.0.1:1502", 0, 0, MACHINE(address),
     .help = "Where the machine listens: modbus://host:port, mbaps://host:port with TLS, or "
             "can://interface."},
    {"machine.*", "plain", CFG_BOOL, "", "false", 0, 0, MACHINE(plain),
     .help = "Plain Modbus to another host, where everybody on the way can read and command."},
    {"machine.*", "tls_ca", CFG_FILE, "", "", 0, 0, MACHINE(tls.ca),
     .help = "mbaps: the CA that has signed the machine's certificate, a PEM file."},
    {"machine.*", "tls_certificate", CFG_FILE, "", "", 0, 0, MACHINE(tls.certificate),
     .help = "mbaps: the agent's certificate, which carries its role."},
    {"machine.*", "tls_key", CFG_FILE, "", "", 0, 0, MACHINE(tls.key),
     .help = "mbaps: the key of that certificate, in a file that only its owner may read."},
    {"machine.*", "unit_id", CFG_INT, "", "1", 0, 255, MACHINE(unit_id),
     .help = "Its Modbus unit identifier."},
    {"machine.*", "can_base", CFG_INT, "", "256", 0, CFG_CAN_BASE_MOST, MACHINE(can_base),
     .help = "can: the lowest of the bus's identifiers that are the machine's and its agents'."},
    {"machine.*", "can_key", CFG_FILE, "", "", 0, 0, MACHINE(can_key),
     .help =
         "can: the key that the machine has, too, as hexadecimal digits in a file that only its "
         "owner may read."},
    {"machine.*", "can_first", CFG_INT, "", "0", 0, CFG_CAN_AGENTS_MOST - 1, MACHINE(can_first),
     .help = "can: the lowest number that a program of this host may take."},
    {"machine.*", "can_last", CFG_INT, "", "3", 0, CFG_CAN_AGENTS_MOST - 1, MACHINE(can_last),
     .help = "can: the highest one; each program takes another, and each host has its own."},
    {"machine.*", "file", CFG_FILE, "", "", 0, 0, MACHINE(machine_file),
     .help = "Its description, where `send` finds the gates of a program; empty: none."},
};

static const CfgSchema schema = {
    .what = "agent",
    .help = "The agent's machines, each by the name that --to takes, its timers and its panel. A "
            "commented key shows its default.",
    .keys = keys,
    .n_keys = G_N_ELEMENTS(keys),
    .size = sizeof(CfgAgent),
    .element_size = sizeof(CfgTarget),
    .elements_offset = offsetof(CfgAgent, machines),
    .n_elements_offset = offsetof(CfgAgent, n_machines),
    .element_name = {"machine.*", "name", CFG_STRING, "", NULL, 0, 0, MACHINE(name),
                     .help = "What --to names."},
};

static bool is_address(const char *text)
{
    static const char *const schemes[] = {"modbus://", "mbaps://", "can://"};
    for (size_t i = 0; i < G_N_ELEMENTS(schemes); i++)
        if (text && g_str_has_prefix(text, schemes[i]))
            return true;
    return false;
}

/* A panel is whole or not there. */
static bool check_panel(const CfgIni *ini, const CfgPanel *panel, GError **error)
{
    const char *const lines[][2] = {
        {"start", panel->start}, {"hold", panel->hold}, {"lamp", panel->lamp}};
    for (size_t i = 0; panel->chip && i < G_N_ELEMENTS(lines); i++)
        if (!lines[i][1])
            return cfg_refuse(ini, "panel", lines[i][0], error,
                              "missing; chip = %s wants start, hold and lamp", panel->chip);
    return true;
}

static CfgAgent *read_agent(const CfgIni *ini, GError **error)
{
    g_autoptr(CfgAgent) agent = cfg_schema_read(&schema, ini, error);
    if (!agent || !check_panel(ini, &agent->panel, error))
        return NULL;
    for (size_t i = 0; i < agent->n_machines; i++) {
        g_autofree char *group = g_strconcat("machine.", agent->machines[i].name, NULL);
        const char *address = agent->machines[i].address;
        if (!is_address(address)) {
            cfg_refuse(ini, group, "address", error,
                       "'%s' is neither modbus://host:port nor mbaps://host:port nor "
                       "can://interface",
                       address ? address : "");
            return NULL;
        }
        if (agent->machines[i].can_first > agent->machines[i].can_last) {
            cfg_refuse(ini, group, "can_first", error, "%d is above can_last = %d",
                       agent->machines[i].can_first, agent->machines[i].can_last);
            return NULL;
        }
    }
    return g_steal_pointer(&agent);
}

CfgAgent *cfg_agent_load(const char *path, GError **error)
{
    g_autoptr(CfgIni) ini = cfg_ini_load(path, error);
    return ini ? read_agent(ini, error) : NULL;
}

CfgAgent *cfg_agent_default(GError **error)
{
    static const char built_in[] = "[machine.sim]\n";
    g_autoptr(CfgIni) ini = cfg_ini_parse(built_in, strlen(built_in), "built-in agent", error);
    return ini ? read_agent(ini, error) : NULL;
}

void cfg_agent_free(CfgAgent *agent)
{
    cfg_schema_free(&schema, agent);
}

char *cfg_agent_example(void)
{
    return cfg_schema_example(&schema, "sim", NULL);
}
