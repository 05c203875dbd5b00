/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The operator's panel as a pure state machine: what two buttons and one lamp mean. docs/panel.md
 * has the rules. It knows neither lines nor sockets; every time is µs of one monotonic clock.
 *
 * A result depends on when things happened, not on when the machine was told: edges carry their own
 * time, and what a time-out brings about is done, as of its own time, by whatever event comes next.
 */
#ifndef AGENT_PANEL_PANEL_H
#define AGENT_PANEL_PANEL_H

#include "fieldbus/fieldbus.h"

typedef enum { AGENT_KEY_START, AGENT_KEY_HOLD, AGENT_N_KEYS } AgentKey;

enum {
    AGENT_PANEL_CLEAR_US = 2000000,  /* start released for this long, before a fault may go */
    AGENT_PANEL_STUCK_US = 10000000, /* start pressed for this long is a fault */
    AGENT_PANEL_LATE_US = 1000000,   /* a press seen later than this starts nothing */
    AGENT_PANEL_AGAIN_US = 100000,   /* between an answer to HOLD and asking again */
};

typedef enum {
    AGENT_FAULT_NONE,
    AGENT_FAULT_NO_LINES, /* the lines are not there (any more) */
    AGENT_FAULT_PRESSED,  /* a button was pressed when its line was first seen */
    AGENT_FAULT_STUCK,    /* start does not come back */
    AGENT_FAULT_REFUSED,  /* the machine did not take the START */
} AgentFault;

/* What happened and what to do about it. */
const char *agent_fault_text(AgentFault fault);

typedef enum {
    AGENT_LAMP_OFF,    /* nothing to start */
    AGENT_LAMP_STEADY, /* running */
    AGENT_LAMP_SLOW,   /* READY and armed: a press starts the program */
    AGENT_LAMP_FAST,   /* held, or waits for a person */
    AGENT_LAMP_DOUBLE, /* a fault, an alarm, or the machine's state is not known */
    AGENT_N_LAMPS
} AgentLamp;

/* Whether the lamp is lit; *until_us is when that changes next, INT64_MAX: never. */
bool agent_lamp_lit(AgentLamp lamp, int64_t now_us, int64_t *until_us);

typedef enum {
    AGENT_PANEL_LINES,         /* the lines are there (again), with these levels */
    AGENT_PANEL_NO_LINES,      /* they are gone */
    AGENT_PANEL_EDGE,          /* one of them has changed */
    AGENT_PANEL_STATUS,        /* of the machine; UNKNOWN: the link is lost */
    AGENT_PANEL_RUN_ENDED,     /* what `start` began is over */
    AGENT_PANEL_HOLD_ANSWERED, /* what `hold` asked for was answered, or given up */
    AGENT_PANEL_TICK,
} AgentPanelKind;

typedef struct {
    AgentPanelKind kind;
    int64_t at_us;              /* EDGE: when, of the same clock as now_us; not later */
    AgentKey key;               /* EDGE */
    bool pressed[AGENT_N_KEYS]; /* LINES: all; EDGE: that of `key` */
    const FbStatus *status;     /* STATUS */
    bool failed;                /* RUN_ENDED: refused, aborted, alarm … */
} AgentPanelEvent;

typedef struct {
    bool start; /* the verified program of AgentPanel.id */
    bool drop; /* the link was lost before `start` was seen to be done: it must not be done later */
    bool hold;
    bool lamp;           /* lit */
    int64_t wake_us;     /* TICK then, at the latest */
    const char *ignored; /* why a press of start did nothing; NULL: there was none */
} AgentPanelActions;

typedef struct {
    bool pressed;     /* as of its last edge */
    bool settled;     /* the same without bounces; hold's goes up with the first edge */
    int64_t since_us; /* its last edge, or when it was first seen */
} AgentKeyState;

/* A value: may be copied. Others only read it. */
typedef struct {
    int64_t debounce_us;
    int64_t at_us; /* nothing before this can happen any more */
    bool lines;    /* the keys' states are known */
    AgentKeyState keys[AGENT_N_KEYS];

    FbState state; /* of the machine */
    uint32_t epoch, transfer, run;
    uint8_t id[32];
    bool ready;        /* READY with a program that a START would run, */
    int64_t ready_us;  /* this very one, since */
    bool acknowledge;  /* a person has to acknowledge at the machine first */
    bool armed;        /* start was seen released while `ready`: a press counts */
    bool started;      /* a START or the run behind it is on */
    bool running;      /* and was seen to be so */
    bool hold_pressed; /* and no HOLD has been sent since */
    bool hold_wanted;  /* until the machine stands */
    bool hold_asking;  /* a HOLD is on its way */
    int64_t hold_again_us;
    AgentFault fault; /* but for NO_LINES, */
    int64_t fault_us; /* since */
} AgentPanel;

/* `debounce_us`: a start button is believed when its line has not changed for this long. */
AgentPanel agent_panel_new(int64_t debounce_us, int64_t now_us);

/* Events in the order of their times, as far as they are known: all edges that are there to be read
 * come before a STATUS or TICK of now. */
void agent_panel_step(AgentPanel *panel, const AgentPanelEvent *event, int64_t now_us,
                      AgentPanelActions *out);

AgentFault agent_panel_fault(const AgentPanel *panel);
AgentLamp agent_panel_lamp(const AgentPanel *panel);

#endif
