/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The programs that were sent to a machine, kept under their SHA-256 in the user's state folder
 * (XDG_STATE_HOME/segmill/programs): a restart needs the very bytes that the machine holds,
 * whatever became of the file they came from. ID.ngc is the program, never written again; ID.ini
 * beside it has its gates as they were announced last, and the files that describe the machine.
 */
#ifndef AGENT_KEPT_H
#define AGENT_KEPT_H

#include "agent/program.h"

/* So many are kept; the ones that were sent longest ago go. */
enum { AGENT_KEPT_MOST = 32 };

typedef struct {
    uint8_t id[32]; /* SHA-256 of the bytes */
    NcProgram *program;
    char *machine_file, *tools_file; /* NULL: sent without a description */
} AgentKept;

/* Keeps a program that is about to be sent. The files may be NULL. Errors: AGENT_ERROR_OUTPUT. */
bool agent_kept_store(const NcProgram *program, const char *machine_file, const char *tools_file,
                      GError **error);

/* The program whose id the machine shows. Errors: AGENT_ERROR_INPUT where there is no copy, or one
 * that is damaged. */
AgentKept *agent_kept_load(const uint8_t id[32], GError **error);
void agent_kept_free(AgentKept *kept);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(AgentKept, agent_kept_free)

/* Where the description is that the program is read with: `given`, else the one that it was sent
 * with, else `known`; NULL: nowhere. The tools are those it was sent with, or NULL: the
 * description's own. */
const char *agent_kept_machine_file(const AgentKept *kept, const char *given, const char *known,
                                    const char **tools_file);

/* An id as 64 hexadecimal digits and a NUL. */
void agent_kept_name(const uint8_t id[32], char name[65]);

#endif
