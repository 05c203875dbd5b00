/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The record of one run, fed with statuses: pure, time is an argument. Statuses are samples, so the
 * machine time between two of them is shared among the regions of the lines between, in proportion
 * to the times that the program plans for those lines; the sum over the regions is exact.
 */
#ifndef AGENT_FOLLOW_H
#define AGENT_FOLLOW_H

#include "agent/program.h"
#include "fieldbus/fieldbus.h"

/* A change of state, as seen. */
typedef struct {
    FbState state;
    double at_s;
    uint32_t line;
} AgentFollowState;

typedef struct {
    double at_s;
    uint32_t line;
    double duration_s; /* NAN while it lasts */
} AgentFollowHold;

typedef struct {
    double at_s;
    uint32_t line;
    int code;
    char *text, *advice;
} AgentFollowAlarm;

typedef struct {
    const AgentProgram *program;
    double *region_s;         /* actual, one a region of the program */
    double *planned_region_s; /* planned, of what this record covers */
    double begin_s;           /* planned time where it begins: 0, or that of a gate or line */
    double actual_s;          /* machine time of the run, of what this record covers */
    double planned_s;         /* where the program plans the line in execution to begin */
    bool drip;                /* the program came while it ran: waited for bytes, */
    uint32_t starved;         /* so often */
    double starved_s;         /* and so long */
    uint64_t blocks;          /* executed in this run */
    uint32_t line;
    GArray *states, *holds, *alarms; /* AgentFollowState, …Hold, …Alarm */
    /* what the next status is compared with */
    FbState known; /* the last state seen that was not UNKNOWN */
    bool armed;
    uint32_t epoch, run_before;
    uint64_t blocks_before;
    double time_before_s;
    uint16_t alarm_serial;
} AgentFollow;

/* `program` is kept, not copied. */
void agent_follow_init(AgentFollow *follow, const AgentProgram *program);
void agent_follow_clear(AgentFollow *follow);

/* START is about to be sent: what `status` counts was before this run. */
void agent_follow_arm(AgentFollow *follow, const FbStatus *status);

/* The run begins at `line`, behind a gate. Before the first status of the run. */
void agent_follow_begin(AgentFollow *follow, uint32_t line);

/* The run of `status` is on already, and is recorded from here. */
void agent_follow_join(AgentFollow *follow, const FbStatus *status);

/* A fresh status, `at_s` after the record began. */
void agent_follow_step(AgentFollow *follow, const FbStatus *status, double at_s);

/* Planned, of what the record covers. */
double agent_follow_planned_s(const AgentFollow *follow);

/* 0 … 1, by planned time. */
double agent_follow_share(const AgentFollow *follow);

#endif
