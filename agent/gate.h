/* SPDX-License-Identifier: Apache-2.0 */
/* What is known of a program's gates: where a restart would go on, and in which state. */
#ifndef AGENT_GATE_H
#define AGENT_GATE_H

#include "agent/program.h"

typedef struct {
    uint32_t number;    /* from 1 */
    uint32_t line;      /* first block behind it that is more than a comment, from 1 */
    char *text;         /* of that block */
    int32_t region;     /* that it belongs to; 0: none */
    int tool;           /* in the spindle; 0: none */
    double spindle_rpm; /* signed as in NcMove */
    bool mist, flood;
    int work_offset; /* 54 … 62 */
    double feed_mm_min;
    SegVec3 position_mm; /* gauge point, machine coordinates */
    double left_s;       /* planned, from there to the end */
    size_t left_blocks;  /* lines that act */
} AgentGate;

/* The line behind each gate: blocks before it, plus one. Caller frees. */
uint32_t *agent_gate_lines(const NcProgram *program);

/* Reads the whole program to know the state at gate `number`, 1 … n_gates - 1. Errors: NC_ERROR. */
bool agent_gate_read(const NcProgram *program, uint32_t number, const AgentMachine *machine,
                     AgentGate *gate, GError **error);
void agent_gate_clear(AgentGate *gate);
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(AgentGate, agent_gate_clear)

#endif
