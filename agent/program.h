/* SPDX-License-Identifier: Apache-2.0 */
/* A program with its planned times: which region each line is for, and when it is due. */
#ifndef AGENT_PROGRAM_H
#define AGENT_PROGRAM_H

#include "config/config.h"
#include "nc/nc.h"

typedef struct {
    int32_t id; /* of the last (REGION n …) comment; 0: before the first */
    double planned_s;
} AgentProgramRegion;

/* A line that moves: from its start to the next one's the time is `region`'s. */
typedef struct {
    uint32_t line;
    double start_s;
    size_t region; /* index into regions */
} AgentProgramLine;

typedef struct {
    AgentProgramRegion *regions; /* in order of their first line */
    size_t n_regions;
    AgentProgramLine *lines; /* ascending; what a line does not name goes on as before */
    size_t n_lines;
    double total_s;
    double length_mm, air_mm; /* feed moves and arcs; rapids */
    int tool_changes;
    int *tools; /* numbers that are called, ascending */
    size_t n_tools;
    unsigned work_offsets; /* bit 0: some move is counted from G54 … bit 8: from G59.3 */
    bool rotary;           /* A, B or C move, and are counted from one of them */
} AgentProgram;

/* "G54" … "G59", and "G59.1" … "G59.3" of 60 … 62. */
const char *agent_work_offset_name(unsigned number);

/* The machine a program was made for: its description, and the tools. */
typedef struct {
    char *machine_file, *tools_file;
    CfgMachine *machine;
    CfgToolTable *tools;
} AgentMachine;

/* `tools_file` NULL: the machine's own. Errors: CFG_ERROR. */
AgentMachine *agent_machine_load(const char *machine_file, const char *tools_file, GError **error);
void agent_machine_free(AgentMachine *machine);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(AgentMachine, agent_machine_free)

/* The bytes of a file. Errors: AGENT_ERROR_INPUT. */
GBytes *agent_program_load(const char *path, GError **error);

/* Reads and times the whole program; `name` opens the messages. Errors: NC_ERROR. */
AgentProgram *agent_program_read(GBytes *bytes, const char *name, const CfgMachine *machine,
                                 const CfgToolTable *tools, GError **error);
void agent_program_free(AgentProgram *program);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(AgentProgram, agent_program_free)

/* Index of the last line at or before `line`; n_lines where there is none. */
size_t agent_program_line(const AgentProgram *program, uint32_t line);

#endif
