/* SPDX-License-Identifier: Apache-2.0 */
/* The machine as a whole: controller, receiver, servers and log in one main loop. */
#ifndef SIM_MACHINE_H
#define SIM_MACHINE_H

#include "sim/fault.h"
#include "sim/log.h"
#include "sim/material.h"

/* Where a server listens. */
typedef struct {
    char *host;    /* NULL: nowhere */
    uint16_t port; /* 0: any free one */
} SimAddress;

/* What the owner of a machine is told; NULL: nothing. Not the place to free it. */
typedef struct {
    /* A job has ended: a run, or a program that was refused at VERIFY. With material, once that is
     * removed: a run that collided is not complete. */
    void (*ended)(bool complete, void *data);
    /* A fault has cut the power: the machine does nothing any more. Free it, and begin anew. */
    void (*cut)(void *data);
    void *data;
} SimMachineCalls;

typedef struct {
    const CfgMachine *machine;
    const CfgToolTable *tools;
    SimAddress plain;          /* Modbus */
    SimAddress secure;         /* Modbus in TLS, with the machine's `tls` */
    const char *can_interface; /* NULL: no CAN; else with the machine's key */
    double speed;              /* as SimControllerOptions */
    uint32_t epoch;
    SimLog *log;           /* may be NULL; stays the caller's */
    SimFaults *faults;     /* the same; goes on with the next machine */
    SimMaterial *material; /* the same; NULL: nobody asks what is removed */
    bool collision_alarm;  /* a run that collided ends in an alarm */
    bool acknowledge; /* nobody is there: it acknowledges by itself, as soon as agents have had a
                         second to see what happened */
    SimMachineCalls calls;
} SimMachineOptions;

typedef struct SimMachine SimMachine;

/* Serves from now on, in the default main context, and is OFF until it is acknowledged. What the
 * options point to must outlive it. Errors: FB_ERROR of the server. */
SimMachine *sim_machine_new(const SimMachineOptions *options, GError **error);

/* Closes the connections; waits for a program that is just being examined. */
void sim_machine_free(SimMachine *machine);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimMachine, sim_machine_free)

/* What port 0 became; 0 where it does not listen. */
uint16_t sim_machine_port(const SimMachine *machine);
uint16_t sim_machine_tls_port(const SimMachine *machine);

/* What a person does at the machine: SIM_ACKNOWLEDGE, SIM_ESTOP, SIM_HOLD or SIM_RESUME. */
void sim_machine_press(SimMachine *machine, SimEventKind button);

/* Stops for good, and waits until the material of what has been executed is removed. */
void sim_machine_settle(SimMachine *machine);

/* Whether an agent that is heard has the lease. */
bool sim_machine_owned(const SimMachine *machine);

/* What has been done since the start, some lines of text; caller frees. */
char *sim_machine_summary(const SimMachine *machine);

#endif
