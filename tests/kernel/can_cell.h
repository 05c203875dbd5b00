/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A machine and an agent on CAN, each a process of its own, and what is seen of them. There are two
 * of these cells: can_cell.c has a machine that executes a line of a program at a time, around the
 * receiver and the CAN server of fieldbus, and an agent that does its tasks with a session each;
 * both do case after case, since a fork costs more than a case. can_programs.c has vcnc and
 * segmill.
 */
#ifndef TESTS_KERNEL_CAN_CELL_H
#define TESTS_KERNEL_CAN_CELL_H

#include <sys/types.h>

#include "fieldbus/fieldbus.h"

enum { CELL_WHY_BYTES = 300, CELL_EXECUTED_BYTES = 8192 };

/* As `segmill send --start`, `segmill resume`; the third also holds the run and resumes it. */
typedef enum { CELL_SEND, CELL_RESUME, CELL_SEND_HOLDING } CellTask;

/* What has been seen of both; of the lines executed the text, each with its newline. */
typedef struct {
    /* The machine, in its present life: */
    FbState state;
    uint32_t run;
    bool stored; /* holds the program, byte for byte */
    /* in all its lives: */
    unsigned lives, starts, completed, held;
    unsigned n_executed;
    char executed[CELL_EXECUTED_BYTES];
    /* The last agent: */
    bool at_work;
    CellTask task;
    bool ended; /* its task */
    int code;   /* -1: done; else an FbError */
    char why[CELL_WHY_BYTES];
} CellSeen;

typedef struct {
    const char *agent_bus, *machine_bus;
    const char *folder; /* with can.key */
    size_t program_bytes;
    CellSeen *seen;
    pid_t machine, agent;
    /* Descriptors: */
    int button; /* a person acknowledges at the machine */
    int reset;  /* the machine begins a new life */
    int order;  /* the agent has a task */
    int news;   /* for the caller: something of `seen` is another */
    /* Of the programs' cell: */
    char id[65];
    struct {
        unsigned starts, completed, held, n_executed;
    } earlier; /* in the machine's lives before this one */
} Cell;

bool cell_open(Cell *cell);  /* the caller has set the names; false with errno */
void cell_begin(Cell *cell); /* a case: a machine in its first life, OFF; nothing seen */
void cell_button(const Cell *cell);
void cell_agent(Cell *cell, CellTask task); /* can_programs.c has no CELL_SEND_HOLDING */

/* SIGKILL. A machine that was cut is started, in its next life, by cell_boot. */
void cell_kill_agent(Cell *cell);
void cell_cut(Cell *cell);
void cell_boot(Cell *cell);

/* Sees what is new, and buries an agent that was killed. */
void cell_look(Cell *cell);

#endif
