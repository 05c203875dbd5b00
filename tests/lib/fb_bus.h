/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Agents' FbDeliverys and a machine around an FbReceiver, in memory, on a clock of the test's, with
 * a bus between them that does faults to frames that the test names.
 *
 * The bus is what docs/protocol.md says of its carriers. MODBUS: connections that keep their order;
 * several requests in flight, matched by transaction. A connection that breaks loses what is in
 * flight both ways; one that the agent closes still brings the machine what was sent. CAN: one
 * request in flight, chunks answered by ACK, a HELLO before each connection, and a message may be
 * lost without anybody noticing. Copies and late frames always reach the machine's door: no
 * transaction and no counter keeps them out here.
 */
#ifndef TESTS_LIB_FB_BUS_H
#define TESTS_LIB_FB_BUS_H

#include "fieldbus/delivery.h"
#include "fieldbus/receiver.h"

typedef enum { BUS_MODBUS, BUS_CAN, BUS_N_CARRIERS } BusCarrier;
typedef enum { BUS_STORED, BUS_DRIP, BUS_RESTART, BUS_N_MODES } BusMode;

typedef struct {
    BusCarrier carrier;
    BusMode mode;
    uint16_t window;
    uint16_t chunk_max;
    bool attended; /* who stands at the machine switches it on again after a reboot */
    bool untold;   /* the machine does not say how large its memory is */
} BusSetup;

const char *bus_setup_name(const BusSetup *setup); /* "Modbus, dripping" */

typedef enum {
    FAULT_NONE,
    FAULT_REQUEST_LOST,
    FAULT_REPLY_LOST,
    FAULT_REQUEST_TWICE,      /* the copy right behind it */
    FAULT_REQUEST_TWICE_LATE, /* the copy when the agent has gone on, or is on a new connection */
    FAULT_REPLY_TWICE,
    FAULT_REQUEST_LATE, /* past the time-out; on a connection that keeps order all behind it too */
    FAULT_REPLY_LATE,
    FAULT_REQUEST_DAMAGED,
    FAULT_REPLY_DAMAGED,
    FAULT_CLOSED_BEFORE, /* the machine never sees the request */
    FAULT_CLOSED_AFTER,  /* the agent never sees the reply */
    FAULT_REBOOT_BEFORE, /* the machine starts again: new epoch, nothing in memory */
    FAULT_REBOOT_AFTER,
    FAULT_KILLED_BEFORE, /* SIGKILL: another FbDelivery, another session, the same token */
    FAULT_KILLED_AFTER,  /* the request is on its way */
    FAULT_N_KINDS
} FaultKind;

const char *bus_fault_name(FaultKind kind);

enum { BUS_WORK, BUS_CONTROL, BUS_N_AGENTS, BUS_FAULTS = 3 };

typedef struct {
    FaultKind kind;
    unsigned agent; /* BUS_WORK or BUS_CONTROL */
    unsigned at;    /* which of its frames, from 0: connects and requests in their order */
    unsigned bit;   /* of a damaged block, modulo its size */
} Fault;

typedef struct {
    FbDelivery *delivery;
    int64_t wake_us;
    int64_t connect_us;         /* when a connect succeeds; INT64_MAX: none is on its way */
    int64_t order_us[2];        /* of this connection: nothing arrives earlier, there and back */
    unsigned connection, lives; /* lives: from 1 */
    unsigned frames;            /* of all lives */
    uint32_t transaction, flights[FB_WINDOW_MOST];
    FbRequestKind kinds[FB_WINDOW_MOST]; /* of the flights */
    unsigned n_flights, most_flights;
    bool cut, killed; /* what the agent is not told yet, or will never be */
    bool ended[FB_N_TASKS];
    GError *error; /* of the last task */
    unsigned shown_unknown;
} BusAgent;

typedef struct {
    BusSetup setup;
    Fault faults[BUS_FAULTS];
    int64_t now_us;
    BusAgent agents[BUS_N_AGENTS];
    GArray *flying; /* frames */
    uint64_t posted;
    bool dead;                        /* the machine answers nobody */
    bool closes[FB_REQUEST_BEAT + 1]; /* it closes the connection at each request of the kind */

    FbReceiver *receiver;
    GArray *actions; /* of FbDo */
    uint32_t epoch;
    unsigned reboots;
    int64_t tick_us;

    /* What is executed, a line of the program at a time. */
    FbProgress progress;
    bool on, stops, stops_at_gate, aborts;
    int64_t line_us; /* when the line in execution is done; INT64_MAX: stands still */
    uint64_t next;   /* first byte that is not executed yet */
    GByteArray *executed;
    unsigned starts, holds, gate_holds, resumes, aborted, starved, completed;
} Bus;

/* The program that the bus delivers, and its gates. */
enum { BUS_GATES = 4, BUS_LINES = 40 };
GBytes *bus_program(void);
const uint64_t *bus_gates(void);

/* A machine that is IDLE; for BUS_RESTART it holds the program, READY. The first frame that the
 * faults count is the first one after this. */
Bus *bus_new(const BusSetup *setup, const Fault *faults, size_t n_faults);
void bus_free(Bus *bus);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(Bus, bus_free)

/* Tasks of an agent. */
void bus_deliver(Bus *bus);
void bus_start(Bus *bus);
void bus_command(Bus *bus, FbCommand command); /* on the control connection */

/* The machine by itself. */
void bus_machine_event(Bus *bus, FbMachineEvent event);
void bus_boot(Bus *bus);
void bus_act(Bus *bus); /* does what the receiver asks for */
void bus_execute_line(Bus *bus);

/* What the machine publishes on this carrier. */
FbStatus bus_status(const Bus *bus);

/* Does the one thing that comes next in time. */
void bus_turn(Bus *bus);

/* Turns until the task of the agent has ended; false: after 60 s of the bus' time, or killed. */
bool bus_run(Bus *bus, unsigned agent, FbTask task);
void bus_wait(Bus *bus, int64_t us);

#endif
