/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/alarm.h"

typedef struct {
    SimAlarm alarm;
    const char *text, *advice;
} Row;

static const Row table[] = {
    {SIM_ALARM_PROGRAM, "a block cannot be executed",
     "Correct the block named, or the tool table, and deliver again."},
    {SIM_ALARM_LIMIT, "a limit of the machine is exceeded",
     "Move the part or its work offset, change the S word, or use another machine."},
    {SIM_ALARM_ESTOP, "emergency stop pressed",
     "Make the machine safe, acknowledge at the machine, start anew."},
    {SIM_ALARM_TOOL, "the tool is not in the magazine",
     "Put the tool into the magazine, acknowledge at the machine, start anew."},
    {SIM_ALARM_SWITCH, "an axis has hit its limit switch",
     "Free the axis, acknowledge at the machine, start anew."},
    {SIM_ALARM_COLLISION, "the tool or its holder met material",
     "Look at the material, correct the block named, acknowledge at the machine."},
};

static const Row *row(SimAlarm alarm)
{
    const Row *found = table;
    while (found->alarm != alarm) {
        found++;
        g_assert(found < table + G_N_ELEMENTS(table));
    }
    return found;
}

const char *sim_alarm_text(SimAlarm alarm)
{
    return row(alarm)->text;
}

const char *sim_alarm_advice(SimAlarm alarm)
{
    return row(alarm)->advice;
}

G_DEFINE_QUARK(sim_alarm, sim_alarm)
