/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Moves as the stock sees them: straight chords of the tip in workpiece coordinates, in groups that
 * one look decides on.
 */
#ifndef NC_STOCK_CHORDS_H
#define NC_STOCK_CHORDS_H

#include "nc/stock/cutter_body.h"
#include "nc/stock/dexel.h"

/* How far a chord of an arc may lie from it: what is cut is wrong by no more. */
#define NC_STOCK_CHORD_MM 1e-4

enum { NC_GROUP = 64 };

typedef enum { NC_PART_CUTTING, NC_PART_SHANK, NC_PART_HOLDER, NC_N_PARTS } NcPart;

/* A shank within this of material rubs on it. */
#define NC_RUB_MM 0.01

typedef struct {
    const CfgTool *tool;
    NcToolBody part[NC_N_PARTS];
    NcToolBody reach[NC_N_PARTS]; /* the same, the shank wider by NC_RUB_MM all around */
} NcCutterParts;

typedef struct {
    SegVec3 a, b;
    uint32_t cut; /* index of the block's NcCut */
} NcChord;

/* Consecutive chords of one tool; each box is what a part's reach sweeps, empty (min > max) where
 * there is no such part. */
typedef struct {
    const NcCutterParts *cutter;
    const NcChord *chords;
    int n;
    int forbidden; /* NcCollisionKind of its cutting part in material; -1: it may cut */
    SegVec3 min[NC_N_PARTS], max[NC_N_PARTS];
} NcGroup;

/* The moves that sweep anything: G0 to G3 with a tool in the spindle. */
bool nc_chords_wanted(const NcMove *move);

/* Whether all moves can be judged; NC_ERROR_PROGRAM with the line where not. */
bool nc_chords_check(const NcMove *moves, size_t n, const CfgToolTable *tools, GError **error);

/* How many chords a move is, even shares of it: a straight one is one. */
size_t nc_chords_of(const NcMove *move);

/* A reader of moves into chords and groups, a batch at a time. */
typedef struct NcChordReader NcChordReader;

/* Nothing is copied; `zero` is the work zero in machine coordinates. */
NcChordReader *nc_chord_reader_new(const NcMove *moves, size_t n, SegVec3 zero,
                                   const CfgToolTable *tools);
void nc_chord_reader_free(NcChordReader *reader);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(NcChordReader, nc_chord_reader_free)

/* The next batch; its groups live until the next call. Appends the blocks' NcCuts to the stock. 0:
 * that was all. */
size_t nc_chord_reader_next(NcChordReader *reader, NcStock *stock, const NcGroup **groups);

#endif
