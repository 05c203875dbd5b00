/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Faults on purpose: a script of what is to go wrong and when, and the state machine that carries
 * it out. docs/vcnc.1 has the grammar.
 */
#ifndef SIM_FAULT_H
#define SIM_FAULT_H

#include "sim/controller.h"

/* ----------------------------------------------------------------------- the script */

typedef enum {
    SIM_AT_LINE,  /* of a run, as SimMoment; */
    SIM_AT_TIME,  /* as well; */
    SIM_AT_FRAME, /* a reply, counted from 1 over all carriers and epochs */
} SimFaultMoment;

/* The first ones happen to the machine, those from DROP on to a reply. */
typedef enum {
    SIM_FAULT_ALARM,
    SIM_FAULT_HOLD,
    SIM_FAULT_ESTOP,
    SIM_FAULT_TOOL_MISSING,
    SIM_FAULT_LIMIT_HIT,
    SIM_FAULT_REBOOT,
    SIM_FAULT_DROP,
    SIM_FAULT_DUPLICATE,
    SIM_FAULT_DELAY,
    SIM_FAULT_CORRUPT,
    SIM_FAULT_CLOSE,
    SIM_FAULT_SLOW, /* all replies from now on */
} SimFaultKind;

const char *sim_fault_name(SimFaultKind kind); /* "tool-missing" */

typedef struct {
    SimFaultMoment moment;
    uint32_t number; /* of the line or frame */
    double time_s;
    SimFaultKind kind;
    uint16_t code;  /* ALARM */
    char *text;     /* ALARM; NULL: none given */
    double seconds; /* DELAY, SLOW */
    uint32_t bit;   /* CORRUPT: of the reply, modulo its length */
    char *spec;     /* as it was written */
} SimFault;

typedef struct {
    GArray *faults; /* SimFault, in the order of the script */
    bool random;    /* the mode has been asked for */
    double rate;    /* of replies that a fault of the link happens to at random */
    uint32_t seed;  /* of those; what it is before the script is read, unless that says another */
} SimFaultScript;

/* The script's texts are wrong: the message names the file, where there is one, line and column. */
#define SIM_FAULT_ERROR sim_fault_error_quark()
GQuark sim_fault_error_quark(void);

typedef enum { SIM_FAULT_ERROR_SYNTAX } SimFaultError;

SimFaultScript *sim_fault_script_new(void);
void sim_fault_script_free(SimFaultScript *script);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimFaultScript, sim_fault_script_free)

/* Adds one fault, or the mode "random", which can be asked for once; a wrong one adds
 * nothing. Errors: SIM_FAULT_ERROR. */
bool sim_fault_script_add(SimFaultScript *script, const char *spec, GError **error);

/* Adds a file's, one a line; a line may be empty, or a comment that begins with "#". What stands
 * before a wrong line has been added. Errors: SIM_FAULT_ERROR, G_FILE_ERROR. */
bool sim_fault_script_read(SimFaultScript *script, const char *path, GError **error);

/* ------------------------------------------------------------------ the state machine */

typedef enum {
    SIM_FAULT_TICK,   /* the program's clock is at a moment of a run, and stands */
    SIM_FAULT_FRAME,  /* a reply is about to go */
    SIM_FAULT_BOOTED, /* the machine has been switched on again */
} SimFaultEventKind;

typedef struct {
    SimFaultEventKind kind;
    uint32_t line; /* TICK: in execution, or about to be; 0: none of the program */
} SimFaultEvent;

typedef enum {
    SIM_FAULT_DO_EVENT, /* the controller has this event */
    SIM_FAULT_DO_CUT,   /* the power is cut */
    SIM_FAULT_DO_FATE,  /* of the reply: after every FRAME, once */
    SIM_FAULT_DO_NOTE,  /* a fault of the script begins: for the log */
} SimFaultDoKind;

/* Texts are the script's or static. */
typedef struct {
    SimFaultDoKind kind;
    SimEventKind event; /* EVENT */
    FbAlarm alarm;      /* EVENT, where that is SIM_FAIL */
    FbFate fate;        /* FATE */
    const char *spec;   /* NOTE */
} SimFaultDo;

typedef struct SimFaults SimFaults;

/* The script outlives it. */
SimFaults *sim_faults_new(const SimFaultScript *script);
void sim_faults_free(SimFaults *faults);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(SimFaults, sim_faults_free)

/* Steps by an event at time_s of the program's clock; appends SimFaultDo values. Each fault of the
 * script begins once. While the power is cut every reply is closed. */
void sim_faults_step(SimFaults *faults, const SimFaultEvent *event, double time_s, GArray *actions);

/* The next moment of a run that has to be a TICK. */
SimMoment sim_faults_next(const SimFaults *faults);

/* What it did and what did not come, some lines of text for people; caller frees. */
char *sim_faults_summary(const SimFaults *faults);

#endif
