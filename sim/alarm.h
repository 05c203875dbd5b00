/* SPDX-License-Identifier: Apache-2.0 */
/* The alarms of vcnc: one table, printed in docs/vcnc.md. */
#ifndef SIM_ALARM_H
#define SIM_ALARM_H

#include <glib.h>
#include <stdint.h>

/* Codes are stable: below 100 docs/protocol.md's, 1xx a program that the machine refuses at VERIFY,
 * 2xx the machine itself. */
typedef enum {
    SIM_ALARM_PROGRAM = 101,   /* a block that the machine does not know or cannot execute */
    SIM_ALARM_LIMIT = 102,     /* a limit of travel or spindle speed */
    SIM_ALARM_ESTOP = 201,     /* the emergency stop is pressed */
    SIM_ALARM_TOOL = 202,      /* a fault on purpose: the magazine does not have the tool */
    SIM_ALARM_SWITCH = 203,    /* a fault on purpose: an axis has hit its limit switch */
    SIM_ALARM_COLLISION = 204, /* the run that ended met material as it must not */
} SimAlarm;

/* What it is, where nothing more is known, and what to do. */
const char *sim_alarm_text(SimAlarm alarm);
const char *sim_alarm_advice(SimAlarm alarm);

/* A refused program is a GError of this domain whose code is a SimAlarm. */
#define SIM_ALARM sim_alarm_quark()
GQuark sim_alarm_quark(void);

#endif
