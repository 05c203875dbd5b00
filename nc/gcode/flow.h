/* SPDX-License-Identifier: Apache-2.0 */
/*
 * O words: subroutines, loops and branches [LinuxCNC 2.9, "O Codes"].
 *
 * Programs come line by line, and may come in pieces while the machine runs. So a structure is
 * kept until the line that closes it, and runs as one then; a subroutine is known from its endsub
 * on, and has to stand before the call.
 */
#ifndef NC_GCODE_FLOW_H
#define NC_GCODE_FLOW_H

#include "nc/gcode/interpreter.h"

typedef enum {
    NC_FLOW_BLOCK, /* any line without an O word */
    NC_FLOW_SUB,
    NC_FLOW_ENDSUB,
    NC_FLOW_RETURN,
    NC_FLOW_CALL,
    NC_FLOW_WHILE,
    NC_FLOW_ENDWHILE,
    NC_FLOW_DO,
    NC_FLOW_DO_WHILE, /* the "while" that closes a "do" */
    NC_FLOW_IF,
    NC_FLOW_ELSEIF,
    NC_FLOW_ELSE,
    NC_FLOW_ENDIF,
    NC_FLOW_REPEAT,
    NC_FLOW_ENDREPEAT,
    NC_FLOW_BREAK,
    NC_FLOW_CONTINUE,
} NcFlowKind;

/* LinuxCNC nests no deeper; and how many lines one structure may execute, and moves make, before it
 * is taken for one that never ends. */
enum { NC_MAX_CALLS = 10, NC_MAX_FLOW_LINES = 2000000, NC_MAX_FLOW_MOVES = 2000000 };

/* Places are indices into the lines of the same structure. */
typedef struct {
    NcFlowKind kind;
    char *text;
    size_t length;
    uint32_t line;
    size_t rest; /* where in the text the keyword ends */
    char *label; /* "100", "<NAME>"; NULL: an expression that a call names */
    size_t label_at;
    int begin; /* ends of loops, break and continue: the loop's first line */
    int end;   /* the line that closes it; of branches the endif */
    int next;  /* if, elseif: the next branch, or the endif */
} NcFlowLine;

struct NcFlow {
    GArray *lines;    /* NcFlowLine: of the structure that is open */
    GArray *open;     /* int: the lines that opened what is not closed yet */
    GHashTable *subs; /* label to GArray of NcFlowLine */
};

NcFlow *nc_flow_new(void);
void nc_flow_free(NcFlow *flow);

/* Whether a structure is open, or the line begins with an O word: then nc_flow_read reads it. */
bool nc_flow_takes(const NcFlow *flow, const char *text, size_t length);

/* Keeps the line, and runs what it closes. After an error the structure and the parameters are as
 * they were before; moves may have been appended. */
bool nc_flow_read(NcFlow *flow, NcExecution *execution, const char *text, size_t length,
                  GError **error);

/* Whether lines are kept that wait for their end; and the error that it did not come. */
bool nc_flow_open(const NcFlow *flow);
bool nc_flow_open_error(const NcFlow *flow, GError **error);

/* The lines of a structure. */
bool nc_flow_run(const NcFlow *flow, NcExecution *execution, const GArray *lines, GError **error);

#endif
