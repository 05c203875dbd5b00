/* SPDX-License-Identifier: Apache-2.0 */
/* The command line of vcnc. */
#ifndef SIM_OPTIONS_H
#define SIM_OPTIONS_H

#include "sim/fault.h"
#include "sim/machine.h"

typedef struct {
    char *machine; /* file */
    char *modbus;  /* as it was written, for messages; NULL: the default, or nowhere */
    SimAddress plain, secure;
    char *can;              /* interface; NULL: no CAN */
    double speed;           /* INFINITY: as fast as it can */
    char *log;              /* file; NULL: none */
    SimFaultScript *script; /* NULL: no faults */
    bool acknowledge;       /* nobody is at the machine */
    char *stock, *model;    /* --stock, --ipm; NULL: none */
    double pitch_mm;        /* of the stock */
    bool collision_alarm;   /* a run that collides ends in an alarm */
    unsigned jobs;          /* after which it ends; 0: never */
} SimOptions;

/* Errors: G_OPTION_ERROR, SIM_FAULT_ERROR, G_FILE_ERROR. With --help it prints and exits. */
bool sim_options_parse(SimOptions *options, int argc, char **argv, GError **error);
void sim_options_clear(SimOptions *options);
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(SimOptions, sim_options_clear)

#endif
