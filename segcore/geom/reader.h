/* SPDX-License-Identifier: Apache-2.0 */
/* The readers behind seg_part_load. */
#ifndef SEGCORE_GEOM_READER_H
#define SEGCORE_GEOM_READER_H

#include "segcore/segcore.h"

/* Reads IGES or STEP through segmill-cad; `sha256` is of the bytes that the caller has seen, and
 * the child must have read the same. */
SegPart *seg_read_cad(const char *path, const char *sha256, const SegLoadOptions *options,
                      GError **error);

/* What looks like OFF, and what like STL. The readers append three SegVec3 a triangle to `corners`,
 * every coordinate within the part form's range; a triangle may still be degenerate. */
bool seg_is_off(const char *bytes, size_t length);
bool seg_read_off(const char *bytes, size_t length, const char *name, GArray *corners,
                  GError **error);
bool seg_is_stl(const char *bytes, size_t length);
bool seg_read_stl(const char *bytes, size_t length, const char *name, GArray *corners,
                  GError **error);

/* Most triangles of a mesh: more would not fit GLib's arrays. */
enum { SEG_MESH_MAX_TRIANGLES = 50 * 1000 * 1000 };

/* The words of a text file, with the line they stand on. Begin with line 1. */
typedef struct {
    const char *at, *end;
    int line;
    char comment;  /* from here to the end of a line nothing counts; '\0': no such character */
    char word[64]; /* the last one read, in lower case; a longer one is cut */
    bool cut;      /* it was: no number */
} SegWords;

bool seg_next_word(SegWords *words); /* false at the end */
void seg_skip_line(SegWords *words);
/* The next word as a coordinate; false when it is none. */
bool seg_next_coordinate(SegWords *words, double *value);
bool seg_next_point(SegWords *words, SegVec3 *point);

#endif
