/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The part form: what segmill-cad streams and what lies in memory behind a SegPart; the page is
 * docs/part-form.md. A SegPartHeader, then the tables in the order of its counts, each starting on
 * a multiple of 8 bytes (zero padding between), little-endian. Every double is finite.
 * Shared by segcore/geom (reads, checks) and segcore/occ (writes).
 */
#ifndef SEGCORE_GEOM_PART_FORM_H
#define SEGCORE_GEOM_PART_FORM_H

#include "segcore/segcore.h"

#define SEG_FORM_MAGIC "SEGPART"
#define SEG_FORM_VERSION 1
#define SEG_FORM_BYTE_ORDER 0x01020304u

/* Most entries of any table: indices are 32 bits, and a part beyond this is refused. */
#define SEG_FORM_MAX_COUNT (1 << 28)

/* Largest magnitude of any double, and least weight: beyond them squares and quotients would leave
 * the range of numbers, and nothing that is machined is there. */
#define SEG_FORM_MAX_REAL 1e15
#define SEG_FORM_MIN_WEIGHT 1e-12

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order;
    double chord_mm;
    double unit_mm;
    char sha256[64]; /* lower-case hex of the CAD file's bytes */
    int64_t n_faces, n_loops, n_coedges, n_edges, n_iges_curves, n_vertices, n_triangles, n_reals;
} SegPartHeader;

#endif
