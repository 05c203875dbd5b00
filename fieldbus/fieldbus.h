/* SPDX-License-Identifier: Apache-2.0 */
/*
 * fieldbus: a program, as bytes, on its way to a machine, and the commands around it.
 *
 * docs/protocol.md is the specification. Both ends are pure state machines,
 * step(state, event, now) -> actions: FbDelivery on the agent's side, FbReceiver on the machine's.
 * The sessions and servers below them own sockets and run in a GMainContext; nothing here sleeps.
 * Times are microseconds of a monotonic clock (now_us), passed in.
 */
#ifndef FIELDBUS_FIELDBUS_H
#define FIELDBUS_FIELDBUS_H

#include <glib.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/config.h"

typedef enum {
    FB_ERROR_UNREACHABLE, /* no connection, or lost and not back in time */
    FB_ERROR_PROTOCOL,    /* the peer answered what the protocol does not allow */
    FB_ERROR_REFUSED,     /* the machine refused a command; the message has its reason */
    FB_ERROR_ALARM,       /* the machine raised an alarm; code and text in the message */
    FB_ERROR_LINK_LOST,   /* while running: the machine's state is UNKNOWN */
    FB_ERROR_ABORTED,     /* a person aborted */
    FB_ERROR_CREDENTIALS, /* a certificate or key is of no use, or plain Modbus not allowed there */
} FbError;

#define FB_ERROR fb_error_quark()
GQuark fb_error_quark(void);

typedef enum {
    FB_STATE_OFF,
    FB_STATE_IDLE,
    FB_STATE_LOADING,
    FB_STATE_VERIFYING,
    FB_STATE_READY,
    FB_STATE_RUNNING,
    FB_STATE_HOLDING,
    FB_STATE_HELD,
    FB_STATE_PROGRAM_STOP,
    FB_STATE_TOOL_CHANGE,
    FB_STATE_ABORTING,
    FB_STATE_COMPLETE,
    FB_STATE_ALARM,
    FB_STATE_ESTOP,
    FB_STATE_UNKNOWN, /* agent's side only: the link is down */
    FB_N_STATES
} FbState;

const char *fb_state_name(FbState state); /* "RUNNING" */
bool fb_state_runs(FbState state);        /* RUNNING to ABORTING: a program is on */

typedef enum {
    FB_COMMAND_NONE,
    FB_COMMAND_LEASE,   /* take or renew; argument: token */
    FB_COMMAND_RELEASE, /* give the lease up */
    FB_COMMAND_OPEN,    /* id, length, gates */
    FB_COMMAND_VERIFY,
    FB_COMMAND_START,
    FB_COMMAND_HOLD, /* never needs the lease */
    FB_COMMAND_RESUME,
    FB_COMMAND_ABORT,         /* never needs the lease */
    FB_COMMAND_ACKNOWLEDGE,   /* clears COMPLETE; an alarm is acknowledged at the machine only */
    FB_COMMAND_CLOSE,         /* forget the program: back to IDLE */
    FB_COMMAND_RESTART,       /* START at a gate */
    FB_COMMAND_OVERRIDE,      /* feed, rapid, spindle */
    FB_COMMAND_OPTIONAL_STOP, /* the switch that M1 asks for */
    FB_N_COMMANDS
} FbCommand;

const char *fb_command_name(FbCommand command); /* "START" */
bool fb_command_stops(FbCommand command);       /* HOLD and ABORT: anybody's, at any time */

/* What OVERRIDE and OPTIONAL_STOP say beside their name. */
typedef struct {
    uint16_t feed_percent, rapid_percent, spindle_percent;
    bool optional_stop;
} FbArguments;

/* What overrides may be: docs/protocol.md, section 4. */
enum {
    FB_OVERRIDE_MOST_PERCENT = 200,
    FB_RAPID_MOST_PERCENT = 100,
    FB_SPINDLE_LEAST_PERCENT = 50,
};

/* Who asks, as the carrier knows it. Each may do what those before it may: an observer reads; an
 * operator takes the lease, starts, stops and overrides; a programmer delivers. */
typedef enum { FB_ROLE_NONE, FB_ROLE_OBSERVER, FB_ROLE_OPERATOR, FB_ROLE_PROGRAMMER } FbRole;

const char *fb_role_name(FbRole role); /* "operator" */
bool fb_role_may(FbRole role, FbCommand command);

typedef enum {
    FB_ANSWER_NONE, /* nothing asked yet; or (VERIFY) taken and still at work: read again */
    FB_ANSWER_DONE,
    FB_ANSWER_WRONG_STATE,
    FB_ANSWER_NO_LEASE,
    FB_ANSWER_WRONG_EPOCH,
    FB_ANSWER_WRONG_TRANSFER,
    FB_ANSWER_GAP, /* a chunk that is neither next nor a duplicate */
    FB_ANSWER_CRC,
    FB_ANSWER_CONFLICT, /* a chunk below `received` with other bytes */
    FB_ANSWER_TOO_LARGE,
    FB_ANSWER_INCOMPLETE, /* VERIFY before the last byte */
    FB_ANSWER_HASH,       /* the machine's hash is not the program's id */
    FB_ANSWER_PROGRAM,    /* the machine cannot run it: see the alarm fields */
    FB_ANSWER_MALFORMED,
    FB_ANSWER_NEEDS_ACKNOWLEDGE, /* START, RESUME want an acknowledgement at the machine first */
    FB_ANSWER_OUT_OF_SEQUENCE,   /* a sequence number below the session's last */
    FB_ANSWER_ROLE,              /* the sender's role does not include this */
    FB_ANSWER_GATE,              /* RESTART: not a gate of this program */
    FB_N_ANSWERS
} FbAnswer;

const char *fb_answer_name(FbAnswer answer);   /* "WRONG_STATE" */
const char *fb_answer_advice(FbAnswer answer); /* one sentence: what to do */

/* How a run ended. */
typedef enum {
    FB_RUN_NONE, /* none yet, or not ended */
    FB_RUN_COMPLETE,
    FB_RUN_ABORTED,
    FB_RUN_ALARM, /* alarm or e-stop */
} FbRunEnd;

#define FB_TEXT_BYTES 96 /* longest alarm text on the wire, NUL-padded UTF-8 */

/* What the machine publishes; every field but the two texts is read in one transaction, and the
 * texts are re-read whenever alarm_serial moves. A transfer is one stream of bytes: the table of
 * gates (8 bytes each; 40 where the program drips), then the program; length, received,
 * may_send_to and released count that stream. */
typedef struct {
    uint16_t protocol_version;
    FbState state;
    uint32_t epoch;           /* new at each start of the machine */
    uint32_t transfer;        /* handle of the accepted program, 0: none */
    uint64_t length;          /* of the stream: table of gates and program */
    uint64_t received;        /* length of the contiguous prefix */
    uint64_t may_send_to;     /* absolute offset: the sender's credit */
    uint32_t line;            /* in execution, from 1; 0: none */
    uint64_t executed_blocks; /* monotone over the life of the epoch */
    uint32_t gates, gates_crc;
    uint8_t id[32];           /* SHA-256 announced by OPEN */
    uint32_t lease_owner;     /* public part (high half) of the owner's token; 0: free */
    uint32_t lease_ms;        /* until it lapses unless renewed */
    uint32_t command_session; /* who sent the last command taken, */
    uint32_t command_seq;     /* its sequence number, and its answer */
    FbCommand command;
    FbAnswer answer;
    FbAnswer chunk_answer;  /* of the last chunk */
    bool needs_acknowledge; /* START and RESUME are refused until a person acknowledged */
    bool agent_lost;        /* the owner's heartbeat is missing */
    uint32_t run;           /* starts in this epoch */
    FbRunEnd run_end;       /* of that run */
    uint16_t window_max;    /* requests in flight on a connection that the machine allows, */
    uint16_t window;        /* and has granted for this transfer */
    uint16_t chunk_max;     /* bytes of a chunk */
    uint16_t alarm_code;    /* 0: none */
    uint16_t alarm_serial;  /* moves with every change of code, text or advice */
    uint16_t feed_override_percent, rapid_override_percent, spindle_override_percent;
    int32_t tool;          /* in the spindle; 0: none */
    double position_mm[3]; /* machine coordinates; resolution 1 µm on the wire */
    double feed_mm_min;
    double spindle_rpm;
    uint32_t program_time_ms; /* of machine time in this run */
    uint32_t heartbeat;       /* counts at least once a second while the machine is alive */
    uint32_t gate;            /* last gate that this run has passed, from 1; 0: none */
    uint32_t stop_line;       /* first line not done when the last run ended; 0: none */
    bool optional_stop;       /* M1 stops */
    bool drip;                /* the program is larger than the memory: fed while it runs */
    bool starving;            /* drip: stands at a gate, the next pass has not come */
    uint32_t starved;         /* how often, in this run, */
    uint32_t starved_ms;      /* and for how long */
    uint64_t released;        /* end of the last whole, verified pass: what may be executed */
    uint64_t memory_bytes;    /* for a stream; 0: the machine does not say */
    uint16_t setup_serial;    /* moves with every change of the tool table or the offsets */
    uint16_t n_tools;         /* in the machine's tool table */
    uint16_t work_offset;     /* in force: 54 … 59; 60 … 62: G59.1 … */
    uint8_t sha256[32];       /* the machine's own hash after VERIFY, zeros before */
    char alarm_text[FB_TEXT_BYTES];
    char alarm_advice[FB_TEXT_BYTES];
} FbStatus;

/* Whether that run of that epoch has ended; not while the state is UNKNOWN. What ended it goes into
 * `why`: nothing where it is complete, else LINK_LOST (another epoch), PROTOCOL (another run),
 * ABORTED or ALARM, with the first line that was not done. */
bool fb_run_ended(const FbStatus *status, uint32_t epoch, uint32_t run, GError **why);

/* The machine's tool table and work offsets, as it publishes them; lengths to 0.1 µm. */
enum { FB_TOOLS_MOST = 60 };

typedef struct {
    int32_t number;
    CfgToolKind kind;
    double diameter_mm, corner_radius_mm, length_mm;
} FbTool;

typedef struct {
    uint16_t serial; /* 0: the machine publishes none of this */
    uint16_t n_tools;
    FbTool tools[FB_TOOLS_MOST]; /* ascending by number */
    uint16_t work_offset;        /* in force: 54 … 59; 60 … 62: G59.1 … */
    double work_offset_mm[6][3]; /* G54 … G59 */
} FbSetup;

/* Bytes of an entry of the table of gates: docs/protocol.md, 2.6. */
enum {
    FB_GATE_BYTES = 8,       /* offset; */
    FB_DRIP_GATE_BYTES = 40, /* and, where the program drips, SHA-256 of the bytes before it */
};

/* The memory that a program takes: stored, the whole stream; */
uint64_t fb_stored_bytes(uint64_t program_bytes, size_t n_gates);
/* dripping, at least the table and the longest way from gate to gate. `gates` ascend. */
uint64_t fb_dripped_bytes(const uint64_t *gates, size_t n_gates);

/* `gates_crc` of a stored program with these gates. */
uint32_t fb_stored_gates_crc(const uint64_t *gates, size_t n_gates);

/* Whether a host, a name or an address, is this one: plain Modbus goes elsewhere only where a
 * person configured it. */
bool fb_is_loopback(const char *host);

/* --------------------------------------------------------------- machine's side */

typedef struct {
    uint32_t epoch; /* passed in: random or a counter kept by the machine, never 0 */
    uint64_t memory_bytes;
    CfgAgentLoss on_agent_loss;
    int64_t agent_timeout_us; /* silence of the owner that counts as agent loss */
    int64_t lease_timeout_us; /* silence after which anybody may take the lease; the longer one */
} FbReceiverOptions;

/* What the machine has to do; the receiver has changed state already. */
typedef enum {
    FB_DO_VERIFY, /* read the program (fb_receiver_program), answer with FB_MACHINE_VERIFIED */
    FB_DO_START,
    FB_DO_HOLD,
    FB_DO_HOLD_AT_GATE, /* the agent is lost: hold at the next gate */
    FB_DO_RESUME,
    FB_DO_ABORT,
    FB_DO_FORGET,        /* the program was closed */
    FB_DO_RESTART,       /* START at fb_receiver_restart_gate */
    FB_DO_PASS,          /* drip: more passes than before are released (fb_receiver_released) */
    FB_DO_OVERRIDE,      /* fb_receiver_overrides has others, */
    FB_DO_OPTIONAL_STOP, /* or another switch */
} FbDo;

/* What the machine tells its receiver. */
typedef enum {
    FB_MACHINE_VERIFIED, /* ok */
    FB_MACHINE_REFUSED,  /* back to LOADING, VERIFY answered PROGRAM; `alarm` says why */
    FB_MACHINE_RUNNING,
    FB_MACHINE_HELD,
    FB_MACHINE_PROGRAM_STOP,
    FB_MACHINE_TOOL_CHANGE,
    FB_MACHINE_COMPLETE,
    FB_MACHINE_ABORTED,
    FB_MACHINE_ALARM,
    FB_MACHINE_ESTOP,
    /* By a person at the machine: switched on (a fresh receiver is OFF until then), alarm or e-stop
     * reset, or allowing START and RESUME again after the agent was lost or restarted. */
    FB_MACHINE_ACKNOWLEDGED,
} FbMachineEvent;

/* What the machine shows, refreshed as often as it likes. */
typedef struct {
    uint32_t line;
    uint64_t executed_blocks;
    int32_t tool;
    double position_mm[3];
    double feed_mm_min, spindle_rpm;
    uint32_t program_time_ms;
    uint32_t gate;      /* last one passed in this run, from 1; what lies before it is forgotten */
    uint32_t stop_line; /* first line not done when the last run ended; 0: none */
    bool starving;      /* drip: waits for a pass; how often and how long in this run */
    uint32_t starved, starved_ms;
    uint16_t work_offset;
} FbProgress;

typedef struct {
    uint16_t code;
    const char *text;
    const char *advice;
} FbAlarm;

typedef struct FbReceiver FbReceiver;

/* OFF until the first FB_MACHINE_ACKNOWLEDGED. */
FbReceiver *fb_receiver_new(const FbReceiverOptions *options);
void fb_receiver_free(FbReceiver *receiver);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbReceiver, fb_receiver_free)

/* Steps by a machine event; `alarm` for REFUSED, ALARM, ESTOP (copied). Appends FbDo values to
 * `actions`. May be called from inside the server's `act`. */
void fb_receiver_machine(FbReceiver *receiver, FbMachineEvent event, const FbAlarm *alarm,
                         int64_t now_us, GArray *actions);
void fb_receiver_progress(FbReceiver *receiver, const FbProgress *progress);

/* Steps by time: lease and heartbeat. Returns when to call again, in µs of the same clock. A
 * server does this for its receiver. */
int64_t fb_receiver_tick(FbReceiver *receiver, int64_t now_us, GArray *actions);

FbState fb_receiver_state(const FbReceiver *receiver);

void fb_receiver_status(const FbReceiver *receiver, int64_t now_us, FbStatus *status);

/* The program from FB_DO_VERIFY to FB_DO_FORGET: the machine's own immutable copy, and its gates.
 * Both are the receiver's; NULL outside that time. Take a reference to keep the bytes. A program
 * that drips has no such copy: NULL. */
GBytes *fb_receiver_program(const FbReceiver *receiver);
const uint64_t *fb_receiver_gates(const FbReceiver *receiver, size_t *n);

/* A program that drips comes pass by pass: pass i (from 0) is what lies between gate i - 1 (or the
 * beginning) and gate i. A pass is released when it is whole and its running hash holds; it can be
 * had until the machine's progress says that gate i is passed. */
bool fb_receiver_drips(const FbReceiver *receiver);
size_t fb_receiver_released(const FbReceiver *receiver);           /* passes */
GBytes *fb_receiver_pass(const FbReceiver *receiver, size_t pass); /* a new reference; or NULL */

/* The gate of the last RESTART, from 1: execution begins at its byte offset, gates[gate - 1]. */
uint32_t fb_receiver_restart_gate(const FbReceiver *receiver);

/* As commanded last; 100 % and no optional stop at first. */
FbArguments fb_receiver_overrides(const FbReceiver *receiver);

/* Publishes the machine's tools and offsets (copied; `serial` is the receiver's to count). */
void fb_receiver_set_setup(FbReceiver *receiver, const FbSetup *setup);
const FbSetup *fb_receiver_setup(const FbReceiver *receiver);

/* Counters of what was refused, for the log: one per FbAnswer. */
const uint64_t *fb_receiver_counts(const FbReceiver *receiver);

/* For a machine that does faults on purpose: what becomes of one reply of a server. */
typedef struct {
    unsigned copies;  /* 1: it goes; 0: it is lost; 2: it goes twice */
    int64_t delay_us; /* it, and what comes behind it on its connection, waits so long */
    bool corrupt; /* one bit is turned over: of the ADU within TLS, of the sealed message on CAN, */
    uint32_t bit; /* this one, modulo how many there are */
    bool close;   /* instead of all that the connection is closed; the bus left, on CAN */
} FbFate;

/* Asked for every reply, before it goes. May not free the server. */
typedef FbFate (*FbReplyFilter)(void *data);

/* A Modbus TCP server around a receiver; several, and other carriers' servers, may share it. `act`
 * is called for every FbDo. The clock is g_get_monotonic_time. */
typedef struct {
    const char *host;  /* where it listens; plain Modbus has no identity: 127.0.0.1 unless the
                          machine's owner asked for more */
    uint16_t port;     /* 0: any free one */
    int unit_id;       /* is answered, and 0 and 255, which mean the device itself */
    const CfgTls *tls; /* roles by certificate; NULL: plain, and everybody is a programmer */
} FbModbusServerOptions;

typedef struct FbModbusServer FbModbusServer;
FbModbusServer *fb_modbus_server_new(const FbModbusServerOptions *options, FbReceiver *receiver,
                                     void (*act)(FbDo what, void *data), void *data,
                                     GMainContext *context, GError **error);
uint16_t fb_modbus_server_port(const FbModbusServer *server); /* what port 0 became */
/* Modbus exceptions answered so far, for the log: requests that are not of this protocol. */
uint64_t fb_modbus_server_exceptions(const FbModbusServer *server);
/* TLS handshakes that failed so far, for the log. */
uint64_t fb_modbus_server_refused(const FbModbusServer *server);
/* Whom to ask for the fate of replies; NULL: nobody. */
void fb_modbus_server_filter(FbModbusServer *server, FbReplyFilter filter, void *data);
void fb_modbus_server_free(FbModbusServer *server);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbModbusServer, fb_modbus_server_free)

/* A server on a CAN bus around a receiver: docs/protocol.md, section 9. Several servers may share a
 * receiver and its `act`. */
typedef struct {
    const char *interface; /* "can0" */
    const char *key_file;  /* hexadecimal; nobody but its owner may read it */
    uint16_t base;         /* lowest identifier; CFG_CAN_BASE_MOST at most */
    unsigned agents;       /* served: numbers 0 to agents - 1; 16 at most */
} FbCanOptions;

enum { FB_CAN_N_ERRORS = 9 };

/* What was seen on the bus, for the log. */
typedef struct {
    uint64_t forged, replayed, malformed; /* messages and frames: nothing was done */
    uint64_t hellos, openings; /* HELLOs answered, and gone on with; the others were replayed, or
                                  their senders gave up */
    uint64_t torn;             /* messages that did not come, or did not go, to their end */
    uint64_t unsent;           /* answers and beats that the bus did not take */
    uint64_t breaks;           /* how often the bus was off, down or gone */
    uint64_t errors[FB_CAN_N_ERRORS]; /* error frames by class: fb_can_error_name */
} FbCanCounts;

const char *fb_can_error_name(unsigned error_class); /* "bus-off" */

typedef struct FbCanServer FbCanServer;
FbCanServer *fb_can_server_new(const FbCanOptions *options, FbReceiver *receiver,
                               void (*act)(FbDo what, void *data), void *data,
                               GMainContext *context, GError **error);
FbCanCounts fb_can_server_counts(const FbCanServer *server);
/* The same; answers are replies, beats are none. */
void fb_can_server_filter(FbCanServer *server, FbReplyFilter filter, void *data);
void fb_can_server_free(FbCanServer *server);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbCanServer, fb_can_server_free)

/* ----------------------------------------------------------------- agent's side */

/* A connection to one machine: reads the status at `heartbeat_s`, reconnects by closing, opening
 * and READING, and never resends on an old connection. */
typedef struct FbSession FbSession;

typedef enum {
    FB_TASK_DELIVER, /* fb_session_deliver */
    FB_TASK_RUN,     /* fb_session_start */
    FB_TASK_COMMAND, /* fb_session_command */
    FB_TASK_SETUP,   /* fb_session_read_setup */
    FB_N_TASKS
} FbTask;

typedef struct {
    /* Every fresh status, and one with state UNKNOWN (the rest as last seen) when the link goes
     * down. */
    void (*status)(const FbStatus *status, void *data);
    /* A task ended: error NULL on success; the callee does not own it. A command may end while a
     * delivery or a run goes on. The callee must not free the session in here. */
    void (*done)(FbTask task, const GError *error, void *data);
    void *data;
} FbSessionCallbacks;

/* The target's address is modbus://host:port, or mbaps://host:port with the target's certificate;
 * plain Modbus goes beyond loopback only where the target says so. NULL with an error where this
 * does not hold. Connects in the background, and shows the status as soon as there is one. */
FbSession *fb_session_new(const CfgTarget *target, const CfgAgent *agent,
                          const FbSessionCallbacks *callbacks, GMainContext *context,
                          GError **error);
void fb_session_free(FbSession *session);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbSession, fb_session_free)

/* The agent's token for the lease: kept by the agent over its restarts, shared by its processes.
 * High half: public owner number, never 0; low half: secret. Before any task; else it is random. */
void fb_session_set_token(FbSession *session, uint64_t token);

/* Lease, OPEN, chunks, VERIFY; `done` when the machine is READY with the program's own hash. */
void fb_session_deliver(FbSession *session, GBytes *program, const uint64_t *gates, size_t n_gates);

/* START of what was delivered, then follows it: `done` at COMPLETE, or with the error that ended
 * it (alarm, abort, link lost). Only ever called for an explicit act of a person or controller. */
void fb_session_start(FbSession *session);

/* The same for a verified program that the machine holds already, whoever delivered it: for a
 * button, and for a restart. */
typedef struct {
    const uint8_t *id;    /* SHA-256 of the program that is meant (copied); NULL: any */
    uint32_t gate;        /* from 1: RESTART there; 0: START */
    uint64_t gate_offset; /* of that gate in the program: the machine compares */
} FbStored;
void fb_session_start_stored(FbSession *session, const FbStored *stored);

/* Reads the machine's tool table and offsets; `done` when fb_session_setup has them. */
void fb_session_read_setup(FbSession *session);
const FbSetup *fb_session_setup(const FbSession *session); /* NULL before */

/* A single command: HOLD, RESUME, ABORT, ACKNOWLEDGE, CLOSE, RELEASE, and with `arguments` (else
 * NULL) OVERRIDE, OPTIONAL_STOP; on a connection of its own, so never behind a chunk. Commands are
 * done in the order of the calls, but HOLD and ABORT go before those that have not been sent.
 * RESUME, ACKNOWLEDGE and CLOSE take the lease for their time where it is free. After RESUME the
 * machine wants beats: those of the session that started the run, or, where the lease was free, of
 * this one.
 *
 * What may set the machine in motion (START, RESTART, RESUME) is neither sent nor repeated later
 * than 3 s behind the call, or behind a HOLD or ABORT that was asked for after it: it ends with
 * REFUSED where it was not sent, LINK_LOST where its answer was lost. */
void fb_session_command(FbSession *session, FbCommand command, const FbArguments *arguments);

const FbStatus *fb_session_status(const FbSession *session);

/* Why the connection broke last, for people; NULL: it never did. */
const char *fb_session_why(const FbSession *session);

/* ----------------------------------------------------------------- test certificates */

/* A TEST CA, for trying and testing: its key lies beside what it signs, and it revokes nothing. */
typedef struct {
    const char *folder;       /* made where it is not there */
    const char *const *hosts; /* the machine's names and addresses, NULL-terminated, at least one */
    int days;                 /* how long the certificates hold, from now */
} FbPkiOptions;

/* Writes NAME.pem and NAME.key (mode 0600) of ca, machine, and the agents observer, operator and
 * programmer, each with the role of its name. Nothing that is there is overwritten:
 * FB_ERROR_CREDENTIALS. */
bool fb_pki_write(const FbPkiOptions *options, GError **error);

#endif
