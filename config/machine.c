/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#define AT(field) offsetof(CfgMachine, field)

static const CfgChoice dialects[] = {{"linuxcnc", 0}, {NULL, 0}};
static const CfgChoice agent_losses[] = {{"next_gate", CFG_AGENT_LOSS_NEXT_GATE},
                                         {"finish", CFG_AGENT_LOSS_FINISH},
                                         {"hold", CFG_AGENT_LOSS_HOLD},
                                         {NULL, 0}};

#define AXIS_MIN "Lower end of the travel, machine coordinates."
#define AXIS_MAX "Upper end of the travel, machine coordinates."
#define AXIS_SPEED "Greatest speed; rapids run at it."
#define AXIS_ACCELERATION "Greatest acceleration."
#define AXIS_JERK "Greatest jerk; 0: not limited, speeds go in trapezoids."
#define OFFSET                                                                                     \
    "Machine coordinates of the gauge line when a tool of length 0 stands on the work zero."
#define ROTARY(group, i)                                                                           \
    {group,                                                                                        \
     "present",                                                                                    \
     CFG_BOOL,                                                                                     \
     "",                                                                                           \
     "false",                                                                                      \
     0,                                                                                            \
     0,                                                                                            \
     AT(rotary[i].present),                                                                        \
     .help = "Whether the machine has this rotary axis."},                                         \
        {group,           "min_deg", CFG_REAL, "deg", "-99999", -1e6, 1e6, AT(rotary[i].min_deg),  \
         .help = AXIS_MIN},                                                                        \
        {group,           "max_deg", CFG_REAL, "deg", "99999", -1e6, 1e6, AT(rotary[i].max_deg),   \
         .help = AXIS_MAX},                                                                        \
        {group,                                                                                    \
         "max_deg_min",                                                                            \
         CFG_REAL,                                                                                 \
         "deg/min",                                                                                \
         "7200",                                                                                   \
         1,                                                                                        \
         1e7,                                                                                      \
         AT(rotary[i].max_deg_min),                                                                \
         .help = AXIS_SPEED},                                                                      \
        {group,                                                                                    \
         "max_deg_s2",                                                                             \
         CFG_REAL,                                                                                 \
         "deg/s²",                                                                                 \
         "500",                                                                                    \
         1,                                                                                        \
         1e7,                                                                                      \
         AT(rotary[i].max_deg_s2),                                                                 \
         .help = AXIS_ACCELERATION},                                                               \
    {                                                                                              \
        group, "max_deg_s3", CFG_REAL, "deg/s³", "0", 0, 1e9, AT(rotary[i].max_deg_s3),            \
            .help = AXIS_JERK                                                                      \
    }

#define OFFSET_ROTARY "The same of A, B and C."
#define SYSTEM(name, i)                                                                            \
    {"work_offsets",        name,          CFG_VECTOR, "mm", "-381, -203, -420", -1e5, 1e5,        \
     AT(work_offset_mm[i]), .help = OFFSET},                                                       \
    {                                                                                              \
        "work_offsets", name "_abc", CFG_VECTOR, "deg", "0, 0, 0", -1e6, 1e6,                      \
            AT(work_offset_deg[i]), .help = OFFSET_ROTARY                                          \
    }

static const CfgKey keys[] = {
    {"machine", "name", CFG_STRING, "", "vmc", 0, 0, AT(name),
     .help = "How reports call the machine."},
    {"machine", "dialect", CFG_STRING, "", "linuxcnc", 0, 0, AT(dialect),
     .help = "How the controller wants its G-code.", .choices = dialects},
    {"machine", "program_memory_bytes", CFG_BYTES, "bytes", "67108864", 1024, 1e12,
     AT(program_memory_bytes), .help = "Largest program that the controller stores."},
    {"machine", "on_agent_loss", CFG_CHOICE, "", "next_gate", 0, 0, AT(on_agent_loss),
     .help = "What a running machine does when the agent's heartbeat stops: hold where the tool is "
             "next clear of the part, finish the program, or hold at once.",
     .choices = agent_losses},
    {"machine", "agent_timeout_s", CFG_REAL, "s", "5", 0.1, 3600, AT(agent_timeout_s),
     .help = "The agent counts as lost when its heartbeat is missing for this long."},
    {"modbus", "beyond_loopback", CFG_BOOL, "", "false", 0, 0, AT(beyond_loopback),
     .help = "Plain Modbus knows nobody. Unless this is true it listens on loopback only."},
    {"tls", "ca", CFG_FILE, "", "", 0, 0, AT(tls.ca),
     .help = "Modbus/TCP Security: the CA that has signed the agents' certificates, a PEM file."},
    {"tls", "certificate", CFG_FILE, "", "", 0, 0, AT(tls.certificate),
     .help = "The machine's own certificate, which names the host that agents connect to."},
    {"tls", "key", CFG_FILE, "", "", 0, 0, AT(tls.key),
     .help = "The key of that certificate, in a file that only its owner may read."},
    {"can", "base", CFG_INT, "", "256", 0, CFG_CAN_BASE_MOST, AT(can_base),
     .help = "The lowest of the bus's identifiers that are the machine's and its agents': 96 of "
             "them."},
    {"can", "key", CFG_FILE, "", "", 0, 0, AT(can_key),
     .help = "The key that the agents have, too, as 32 to 128 hexadecimal digits in a file that "
             "only its owner may read."},
    {"can", "agents", CFG_INT, "", "4", 1, CFG_CAN_AGENTS_MOST, AT(can_agents),
     .help = "How many agents are served, with the numbers from 0."},
    {"axis.x", "min_mm", CFG_REAL, "mm", "-762", -1e5, 1e5, AT(axis[0].min_mm), .help = AXIS_MIN},
    {"axis.x", "max_mm", CFG_REAL, "mm", "0", -1e5, 1e5, AT(axis[0].max_mm), .help = AXIS_MAX},
    {"axis.x", "max_mm_min", CFG_REAL, "mm/min", "25000", 1, 1e6, AT(axis[0].max_mm_min),
     .help = AXIS_SPEED},
    {"axis.x", "max_mm_s2", CFG_REAL, "mm/s²", "5000", 1, 1e6, AT(axis[0].max_mm_s2),
     .help = AXIS_ACCELERATION},
    {"axis.x", "max_mm_s3", CFG_REAL, "mm/s³", "0", 0, 1e9, AT(axis[0].max_mm_s3),
     .help = AXIS_JERK},
    {"axis.y", "min_mm", CFG_REAL, "mm", "-406", -1e5, 1e5, AT(axis[1].min_mm), .help = AXIS_MIN},
    {"axis.y", "max_mm", CFG_REAL, "mm", "0", -1e5, 1e5, AT(axis[1].max_mm), .help = AXIS_MAX},
    {"axis.y", "max_mm_min", CFG_REAL, "mm/min", "25000", 1, 1e6, AT(axis[1].max_mm_min),
     .help = AXIS_SPEED},
    {"axis.y", "max_mm_s2", CFG_REAL, "mm/s²", "5000", 1, 1e6, AT(axis[1].max_mm_s2),
     .help = AXIS_ACCELERATION},
    {"axis.y", "max_mm_s3", CFG_REAL, "mm/s³", "0", 0, 1e9, AT(axis[1].max_mm_s3),
     .help = AXIS_JERK},
    {"axis.z", "min_mm", CFG_REAL, "mm", "-508", -1e5, 1e5, AT(axis[2].min_mm), .help = AXIS_MIN},
    {"axis.z", "max_mm", CFG_REAL, "mm", "0", -1e5, 1e5, AT(axis[2].max_mm), .help = AXIS_MAX},
    {"axis.z", "max_mm_min", CFG_REAL, "mm/min", "18000", 1, 1e6, AT(axis[2].max_mm_min),
     .help = AXIS_SPEED},
    {"axis.z", "max_mm_s2", CFG_REAL, "mm/s²", "4000", 1, 1e6, AT(axis[2].max_mm_s2),
     .help = AXIS_ACCELERATION},
    {"axis.z", "max_mm_s3", CFG_REAL, "mm/s³", "0", 0, 1e9, AT(axis[2].max_mm_s3),
     .help = AXIS_JERK},
    ROTARY("axis.a", 0),
    ROTARY("axis.b", 1),
    ROTARY("axis.c", 2),
    {"spindle", "min_rpm", CFG_REAL, "rev/min", "100", 0, 1e6, AT(spindle_min_rpm),
     .help = "Slowest speed."},
    {"spindle", "max_rpm", CFG_REAL, "rev/min", "24000", 1, 1e6, AT(spindle_max_rpm),
     .help = "Fastest speed."},
    {"spindle", "rpm_per_s", CFG_REAL, "rev/min per s", "8000", 1, 1e7, AT(spindle_rpm_per_s),
     .help = "How fast the spindle gains and loses speed."},
    {"spindle", "orient_s", CFG_REAL, "s", "1", 0, 3600, AT(orient_s),
     .help = "Time to turn the stopped spindle to an angle (M19)."},
    {"coolant", "switch_s", CFG_REAL, "s", "0", 0, 3600, AT(coolant_s),
     .help = "Time that the axes wait when coolant is switched on or off."},
    {"tools", "file", CFG_FILE, "", "tools.ini", 0, 0, AT(tools_file),
     .help = "The tool table, beside this file."},
    {"tools", "change_s", CFG_REAL, "s", "8", 0, 3600, AT(tool_change_s),
     .help = "Time of a tool change at the change position."},
    {"tools", "change_mm", CFG_VECTOR, "mm", "0, 0, 0", -1e5, 1e5, AT(tool_change_mm),
     .help = "Change position, machine coordinates."},
    SYSTEM("g54", 0),
    SYSTEM("g55", 1),
    SYSTEM("g56", 2),
    SYSTEM("g57", 3),
    SYSTEM("g58", 4),
    SYSTEM("g59", 5),
    SYSTEM("g59_1", 6),
    SYSTEM("g59_2", 7),
    SYSTEM("g59_3", 8),
};

static const CfgSchema schema = {
    .what = "machine",
    .help = "A machine with the axes X, Y, Z and up to three rotary ones. A commented key shows "
            "its default.",
    .keys = keys,
    .n_keys = G_N_ELEMENTS(keys),
    .size = sizeof(CfgMachine),
};

static bool check(const CfgMachine *machine, const CfgIni *ini, GError **error)
{
    static const char *const groups[3] = {"axis.x", "axis.y", "axis.z"};
    for (int i = 0; i < 3; i++) {
        const CfgAxis *axis = &machine->axis[i];
        if (axis->min_mm >= axis->max_mm)
            return cfg_refuse(ini, groups[i], "min_mm", error, "%g is not below max_mm = %g",
                              axis->min_mm, axis->max_mm);
        double change = machine->tool_change_mm[i];
        if (change < axis->min_mm || change > axis->max_mm)
            return cfg_refuse(ini, "tools", "change_mm", error,
                              "%g lies outside the travel %g … %g mm of %s", change, axis->min_mm,
                              axis->max_mm, groups[i]);
    }
    static const char *const rotary[3] = {"axis.a", "axis.b", "axis.c"};
    for (int i = 0; i < 3; i++)
        if (machine->rotary[i].min_deg >= machine->rotary[i].max_deg)
            return cfg_refuse(ini, rotary[i], "min_deg", error, "%g is not below max_deg = %g",
                              machine->rotary[i].min_deg, machine->rotary[i].max_deg);
    if (machine->spindle_min_rpm > machine->spindle_max_rpm)
        return cfg_refuse(ini, "spindle", "min_rpm", error, "%g is above max_rpm = %g",
                          machine->spindle_min_rpm, machine->spindle_max_rpm);
    if (!machine->name)
        return cfg_refuse(ini, "machine", "name", error, "must not be empty");
    if (!machine->tools_file)
        return cfg_refuse(ini, "tools", "file", error, "must not be empty");
    return true;
}

CfgMachine *cfg_machine_load(const char *path, GError **error)
{
    g_autoptr(CfgIni) ini = cfg_ini_load(path, error);
    g_autoptr(CfgMachine) machine = ini ? cfg_schema_read(&schema, ini, error) : NULL;
    return machine && check(machine, ini, error) ? g_steal_pointer(&machine) : NULL;
}

void cfg_machine_free(CfgMachine *machine)
{
    cfg_schema_free(&schema, machine);
}

char *cfg_machine_example(void)
{
    return cfg_schema_example(&schema, NULL, NULL);
}
