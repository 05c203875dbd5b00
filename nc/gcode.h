/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Part of nc/nc.h, which others include: from G-code to canonical moves (RS-274/NGC, ISO 6983).
 * Lengths in mm, feeds mm/min, times s; rotary axes in degrees, as programs have them.
 */
#ifndef NC_GCODE_H
#define NC_GCODE_H

#include <glib.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/config.h"
#include "segcore/segcore.h"

typedef enum {
    NC_ERROR_PLAN,    /* the part, tools and recipe do not go together; the message says how */
    NC_ERROR_PROGRAM, /* a block is wrong; line, column and word are named */
    NC_ERROR_LIMIT,   /* a travel or speed limit of the machine is exceeded */
} NcError;

#define NC_ERROR nc_error_quark()
GQuark nc_error_quark(void);

/* ------------------------------------------------------------- reading G-code */

typedef enum {
    NC_MOVE_RAPID,
    NC_MOVE_FEED,
    NC_MOVE_ARC,
    NC_MOVE_DWELL,
    NC_MOVE_TOOL_CHANGE,
    NC_MOVE_SPINDLE,
    NC_MOVE_COOLANT,
    NC_MOVE_STOP,          /* M0 */
    NC_MOVE_OPTIONAL_STOP, /* M1 */
    NC_MOVE_END,           /* M2, M30 */
    NC_MOVE_PROBE,         /* G38.x, to where it touched */
    NC_MOVE_ORIENT,        /* M19 */
    NC_MOVE_TOOL_NUMBER,   /* M61: the tool in the spindle is this one; nothing is changed */
    NC_MOVE_MESSAGE,       /* (MSG, …), (DEBUG, …), (PRINT, …), (LOG, …) */
} NcMoveKind;

/* M19: the spindle stops at this angle. */
typedef struct {
    double angle_deg;
    int way;       /* 0: the shorter one, 1: clockwise, -1: anticlockwise */
    double wait_s; /* longer is an error of the machine; 0: not given */
} NcOrient;

/* One canonical action of a block, in MACHINE coordinates of the tool's gauge point. */
typedef struct {
    NcMoveKind kind;
    uint32_t line;       /* from 1; ascending: of a loop its last line, of a subroutine its call */
    uint32_t block_line; /* of the block itself, inside those; 0: the same */
    int32_t region;      /* of the last (REGION n …) comment; 0: none yet */
    int tool;            /* in the spindle; for a tool change the new one */
    int work_offset;     /* in force: 54 … 59; 60 … 62: G59.1 … G59.3 */
    int plane;           /* arcs: 17, 18, 19 */
    int turn; /* arcs: whole turns, positive anticlockwise: ±1 for up to one turn, ±2 … */
    SegVec3 from, to;
    double from_deg[3], to_deg[3]; /* A, B, C, machine coordinates */
    union {
        SegVec3 centre; /* arcs */
        double dwell_s;
        NcOrient orient;
        int message; /* for nc_interpreter_message */
    };
    double feed_mm_min;  /* of X, Y, Z; degrees in a minute where only A, B, C move */
    double spindle_rpm;  /* positive clockwise (M3), negative M4, 0 off; with G96 at its end */
    double tolerance_mm; /* G64 P in force; 0 with G61; INFINITY with G64 and no P, or P0 */
    bool begins_block;   /* the first action of its block, each time that is executed */
    bool exact_stop;     /* G61.1 in force */
    bool coolant_mist, coolant_flood;
    bool machine_coordinates;  /* its end was named by G53 or is home: no offset counts */
    bool feed_per_turn;        /* G95: feed_mm_min is that of spindle_rpm, and follows it */
    bool feed_override_off;    /* M49, M50 P0: what a person turns does not count */
    bool spindle_override_off; /* M49, M51 P0 */
    bool adaptive_feed;        /* M52 */
} NcMove;

/* The line of its own block, for messages. */
static inline uint32_t nc_move_block_line(const NcMove *move)
{
    return move->block_line > 0 ? move->block_line : move->line;
}

/* The modal state of an RS-274/NGC interpreter. */
typedef struct NcInterpreter NcInterpreter;

NcInterpreter *nc_interpreter_new(const CfgMachine *machine, const CfgToolTable *tools);
void nc_interpreter_free(NcInterpreter *interpreter);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcInterpreter, nc_interpreter_free)

/* The machine stands here, in machine coordinates of the gauge point; until told, where it changes
 * tools (the machine file's tool_change), which is also where G28 goes. G40 is in force then. */
void nc_interpreter_set_position(NcInterpreter *interpreter, SegVec3 gauge_point);

/* The operator's switch that skips blocks beginning with "/"; off until told. */
void nc_interpreter_set_block_delete(NcInterpreter *interpreter, bool on);

/* Whether and where a probing move ends before its end: a touch of the work, or with `away` (G38.4,
 * G38.5) its loss. `where` is on the move, machine coordinates of the gauge point. */
typedef bool (*NcProbe)(const NcMove *move, bool away, SegVec3 *where, void *data);

/* Who answers probing moves. Until told nobody does: they go to their end, as LinuxCNC's
 * stand-alone interpreter has them; #5070 is 0 then, and G38.2 and G38.4 are no errors. */
void nc_interpreter_set_probe(NcInterpreter *interpreter, NcProbe probe, void *data);

/* The text of a message move of this interpreter, as long as that lives. */
const char *nc_interpreter_message(const NcInterpreter *interpreter, const NcMove *move);

/* Reads one block (no newline needed) and appends its NcMoves; while the cutter's radius is
 * compensated (G41, G42) those of the contour come with a later block, in their order, and the
 * program's end leaves none out. Anything unknown is an error with
 * line, column and the offending word; nothing is ignored. After an error the interpreter stays as
 * it was before the block. */
bool nc_interpreter_block(NcInterpreter *interpreter, const char *text, size_t length,
                          GArray *moves, GError **error);

/* Whether a move stays within the machine's travel and spindle speeds, and M19's Q leaves it the
 * time that it takes; if not, NC_ERROR_LIMIT with line, axis or word, value and limit. The
 * interpreter itself does not ask. */
bool nc_move_check_limits(const CfgMachine *machine, const NcMove *move, GError **error);

/* A whole program, checked against the machine's limits too; result is a GArray of NcMove. It ends
 * with M2, M30 or the second "%"; what follows is no part of it. */
GArray *nc_read_program(const char *text, size_t length, const CfgMachine *machine,
                        const CfgToolTable *tools, GError **error);

#endif
