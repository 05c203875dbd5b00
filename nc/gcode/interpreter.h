/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interpreter's own structures: a line becomes words (lexer.c), words become a checked block
 * (check.c), a block is executed in RS-274's order (execute.c), arcs find their centre (arc.c).
 * Values are parameters and expressions (expression.c, predefined.c); lines with O words wait for
 * their end (flow.c) and run (run.c); where moves lead: travel.c; coordinate systems: offsets.c;
 * canned cycles: cycle.c; the
 * cutter's radius: cutter.c, compensation.c; messages to people: message.c.
 *
 * Meaning of the words: T. Kramer, F. Proctor, E. Messina, "The NIST RS274NGC Interpreter,
 * version 3", NISTIR 6556, 2000, below [NIST]; where LinuxCNC 2.9 differs, LinuxCNC is followed.
 */
#ifndef NC_GCODE_INTERPRETER_H
#define NC_GCODE_INTERPRETER_H

#include "nc/gcode/compensation.h"
#include "nc/gcode/message.h"
#include "nc/gcode/parameters.h"
#include "nc/motion/path.h"
#include "nc/nc.h"

#define NC_MM_PER_INCH 25.4

/* LinuxCNC reads no longer lines, so neither do we. */
enum {
    NC_MAX_LINE_BYTES = 252,
    NC_MAX_WORDS = 128,
    NC_MAX_SETTINGS = 64,
    NC_MAX_OWN_SETTINGS = 16
};

/* A letter and its number, and where it stands in the line. */
typedef struct {
    char letter; /* upper case */
    int column;  /* from 1 */
    int length;  /* of `text`, with the spaces inside */
    const char *text;
    double value;
} NcWord;

/* "#1=2": it counts from the next block on [NIST 3.3.2.2]. */
typedef struct {
    NcParameter parameter;
    double value;
} NcSetting;

/* Modal groups of G codes [NIST, table 4; LinuxCNC 2.9, "Modal Groups"]. */
typedef enum {
    NC_G_NON_MODAL, /* group 0: G4 G10 G28 G28.1 G30 G30.1 G52 G53 G92 … */
    NC_G_MOTION,    /* group 1: G0 G1 G2 G3 G38.2 G73 G81 … */
    NC_G_CANCEL,    /* G80, of group 1 too; beside another of them it says nothing */
    NC_G_PLANE,     /* group 2 */
    NC_G_DISTANCE,  /* group 3: G90 G91 */
    NC_G_ARC,       /* group 4: G90.1 G91.1 */
    NC_G_FEED_MODE, /* group 5: G93 G94 G95 */
    NC_G_UNITS,     /* group 6 */
    NC_G_CUTTER,    /* group 7: G40 G41 G42 G41.1 G42.1 */
    NC_G_TOOL,      /* group 8: G43 G43.1 G49 */
    NC_G_RETRACT,   /* group 10: G98 G99 */
    NC_G_WORK,      /* group 12: G54 … G59.3 */
    NC_G_CONTROL,   /* group 13: G61 G61.1 G64 */
    NC_G_SPINDLE,   /* group 14: G96 G97 */
    NC_N_G_GROUPS
} NcGGroup;

typedef enum {
    NC_M_STOP,     /* group 4: M0 M1 M2 M30 M60 */
    NC_M_TOOL,     /* group 6: M6 M61 */
    NC_M_SPINDLE,  /* group 7: M3 M4 M5 M19 */
    NC_M_COOLANT,  /* group 8: M7 M8 M9 */
    NC_M_OVERRIDE, /* group 9: M48 … M53 */
    NC_N_M_GROUPS
} NcMGroup;

/* The words of a block by what they are. A place in `words` is counted from 1; 0: none. */
typedef struct {
    uint32_t letters; /* bit 0: A … of every letter but G and M */
    uint8_t letter[26], g_word[NC_N_G_GROUPS], m_word[NC_N_M_GROUPS];
    int16_t g[NC_N_G_GROUPS]; /* ten times the code; -1: none */
    int16_t m[NC_N_M_GROUPS]; /* -1: none */
    bool some_g, some_m;      /* G codes but those of motion; M codes */
} NcSorted;

typedef struct {
    NcWord words[NC_MAX_WORDS];
    int n_words;
    NcSetting settings[NC_MAX_SETTINGS + NC_MAX_OWN_SETTINGS];
    int n_settings;
    bool blank;
    bool structure;      /* its line belongs to O words; nothing else is set */
    bool deleted;        /* begins with "/" */
    bool percent;        /* the line is "%" */
    int32_t region;      /* of a (REGION n …) comment; -1: none */
    const char *message; /* what stands behind "(MSG," or another such; NULL: none */
    int message_length;
    bool message_expands; /* "#1" and "#<name>" in it stand for their values */
    NcSorted by;
    int motion; /* ten times the code that moves in this block; -1: none does */
} NcBlock;

/* The words of a canned cycle, which go on counting in the next blocks; NAN: not given. */
typedef struct {
    int code; /* ten times */
    double bottom_mm, r_mm, peck_mm, dwell_s;
    double offset_mm[3]; /* I, J, K of G87 */
} NcCycle;

/* What F says: mm a minute, mm a turn of the spindle, or how often in a minute. */
typedef enum { NC_FEED_A_MINUTE, NC_FEED_A_TURN, NC_FEED_INVERSE } NcFeedMode;

/* X Y Z, and A B C in x, y, z. */
typedef struct {
    SegVec3 mm, deg;
} NcPlace;

/* What a block changes, and what the next one finds. */
typedef struct {
    SegVec3 position; /* gauge point, machine coordinates */
    SegVec3 local_mm; /* G52, G92: on top of it */
    SegVec3 work_mm;  /* the coordinate system in force, machine coordinates */
    SegVec3 position_deg, local_deg, work_deg; /* the same of A, B, C */
    NcCycle cycle;
    double cycle_level_mm; /* where the cycles began, for G98, program coordinates; NAN: none is in
                              force */
    double unit_mm;        /* 1, or 25.4 with G20 */
    double tool_length_mm;
    double feed_mm;        /* the F word; of no use with G93 */
    double feed_deg;       /* the same where only A, B, C move */
    double speed_rpm;      /* the S word; with G96 the largest */
    double surface_mm_min; /* the S word with G96 */
    double speed;          /* the S word as it was written */
    double tolerance_mm;
    NcFeedMode feed_mode;
    int spindle; /* 1 clockwise, -1 anticlockwise, 0 off */
    int motion;  /* ten times the code of group 1 */
    int plane;   /* 17, 18, 19 */
    int wcs;     /* 0: G54 */
    int tool, selected_tool;
    bool retract_r; /* G99 */
    bool incremental, arc_absolute, exact_stop, mist, flood;
    bool surface_speed; /* G96 */
    bool feed_override_off, spindle_override_off, adaptive_feed;
    bool begun, percent_open, ended;
    int32_t region;
    uint32_t line; /* the last one read */
} NcModal;

typedef struct NcFlow NcFlow;

/* What blocks are carried out on. The modal state is put back where a block fails; the parameters
 * that a block sets wait in it until it has succeeded. */
typedef struct {
    const CfgMachine *machine;
    const CfgToolTable *tools;
    NcModal modal;
    NcParameters *parameters;
    NcMessages *messages;
    NcProbe probe;
    void *probe_data;
    GArray *moves;
    guint first_move; /* of the block */
    NcCompensation *compensation;
    guint uncompensated; /* the first of the moves that have not gone by way of it */
    NcBlock *block;
    uint32_t statement_line; /* of the line that is carried out; within a subroutine the call's */
    bool block_delete;
    bool is_kept; /* as the statement found them: */
    NcModal kept;
    NcCompensation *kept_compensation;
} NcExecution;

struct NcInterpreter {
    NcExecution x;
    NcFlow *flow;
};

/* Reads and carries out the block of line modal.line; its settings count from then on. */
bool nc_run_block(NcExecution *execution, const char *text, size_t length, GError **error);

/* Splits a line into the words of the execution's block; comments are taken out. */
bool nc_lex(const NcExecution *execution, const char *text, size_t length, GError **error);

/* A parameter's value, those that the machine sets included; false (and 0 or NAN) where it was
 * never set. */
bool nc_parameter_value(const NcExecution *execution, NcParameter parameter, double *value);

/* The position by number, which LinuxCNC does not say while the cutter's radius is compensated. */
bool nc_parameter_hidden(const NcExecution *execution, NcParameter parameter);

/* Not those that the machine sets. */
bool nc_parameter_writable(const NcExecution *execution, NcParameter parameter);

/* Six numbered parameters from `index` on, as they are with what the block sets, and setting them.
 */
NcPlace nc_parameters_place(const NcExecution *execution, int index);
void nc_set_parameters_place(NcExecution *execution, int index, NcPlace place);
void nc_set_parameter(NcExecution *execution, int index, double value);

/* The tool of the table, with what G10 has set; false where there is none. */
bool nc_find_tool(const NcExecution *execution, int number, NcToolOffset *tool);
bool nc_no_tool(const NcExecution *execution, const NcWord *word, GError **error);

/* Carries out what the block says of coordinate systems: G10, G52, G92 and G92.1 to G92.3. */
bool nc_set_offsets(NcExecution *execution, GError **error);

/* G54 … G59.3, from 0. Its offset counts as it is now: one that is set later waits for the next
 * time. */
void nc_select_work(NcExecution *execution, int wcs);

/* Carries out the motion of the block, and G28, G30. */
bool nc_travel(NcExecution *execution, GError **error);

/* Refuses what has no place between G41 and G40; and carries these out. */
bool nc_check_compensated(const NcExecution *execution, GError **error);
bool nc_set_compensation(NcExecution *execution, GError **error);

/* The moves that the block has made so far become the tool's. */
bool nc_compensate(NcExecution *execution, GError **error);

/* Carries out the canned cycle of the block over the place that its axis words name. */
bool nc_run_cycle(NcExecution *execution, SegVec3 target, GError **error);

/* Machine coordinates of the gauge point minus program coordinates. */
SegVec3 nc_program_shift(const NcExecution *execution);

/* The gauge point, machine coordinates. While the cutter's radius is compensated, which the modal
 * position is not, the place beside the contour's last point. */
static inline SegVec3 nc_gauge_point(const NcExecution *x)
{
    return x->compensation->entered ? x->compensation->offset : x->modal.position;
}

/* The same in program coordinates: mm and degrees. */
NcPlace nc_program_place(const NcExecution *execution);

/* Sorts the words into groups and refuses what RS-274 forbids whatever the modal state is, and
 * motion that the state does not allow; finds the motion of the block. */
bool nc_check(NcBlock *block, const NcModal *modal, GError **error);

/* Appends a move that stands still, in the modal state; the caller sets what is special to its
 * kind. The pointer is good until the next one. */
NcMove *nc_append_move(NcExecution *execution, NcMoveKind kind);

/* Its spindle speed and feed, in the modal state, where it ends. */
void nc_move_speeds(const NcExecution *execution, NcMove *move);

/* Appends the block's message. */
void nc_speak(NcExecution *execution);

/* Carries a checked block out. */
bool nc_execute(NcExecution *execution, GError **error);

/* Centre of the arc of this block from `from` to `to`, machine coordinates; the centre's
 * coordinate along the plane's normal is that of `from`. `shift` is machine minus program
 * coordinates, for G90.1. */
bool nc_arc_centre(const NcBlock *block, const NcModal *modal, SegVec3 from, SegVec3 to,
                   SegVec3 shift, SegVec3 *centre, GError **error);

/* "line 12, column 7: G33 is not supported": the message begins with the word, where it has a
 * length. `word` may be NULL when the whole line is meant. Always returns false. */
bool nc_word_error(GError **error, uint32_t line, const NcWord *word, const char *format, ...)
    G_GNUC_PRINTF(4, 5);

static inline const NcWord *nc_word_of(const NcBlock *block, uint8_t place)
{
    return place > 0 ? &block->words[place - 1] : NULL;
}

static inline const NcWord *nc_word(const NcBlock *block, char letter)
{
    return nc_word_of(block, block->by.letter[letter - 'A']);
}

static inline const NcWord *nc_g_word(const NcBlock *block, NcGGroup group)
{
    return nc_word_of(block, block->by.g_word[group]);
}

static inline const NcWord *nc_m_word(const NcBlock *block, NcMGroup group)
{
    return nc_word_of(block, block->by.m_word[group]);
}

/* For messages: the word that moves, or the block's first one where the motion goes on. */
static inline const NcWord *nc_motion_word(const NcBlock *block)
{
    const NcWord *word = nc_g_word(block, NC_G_MOTION);
    return word ? word : &block->words[0];
}

/* Any of these letters: a set made with NC_LETTER. */
#define NC_LETTER(letter) (1u << ((letter) - 'A'))
#define NC_ROTARY_AXES (NC_LETTER('A') | NC_LETTER('B') | NC_LETTER('C'))
#define NC_AXES (NC_LETTER('X') | NC_LETTER('Y') | NC_LETTER('Z') | NC_ROTARY_AXES)

static inline bool nc_is_cycle(int motion)
{
    return motion == 730 || (motion > 800 && motion < 900);
}

static inline bool nc_is_probe(int motion)
{
    return motion >= 382 && motion <= 385;
}

/* Of X Y Z A B C, counted from 0. */
static inline char nc_axis_letter(int axis)
{
    return "XYZABC"[axis];
}

static inline double *nc_place_axis(NcPlace *place, int axis)
{
    return axis < 3 ? nc_axis(&place->mm, axis) : nc_axis(&place->deg, axis - 3);
}

#endif
