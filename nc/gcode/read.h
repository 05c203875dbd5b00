/* SPDX-License-Identifier: Apache-2.0 */
/* A program block by block, for those who need more than its moves. */
#ifndef NC_GCODE_READ_H
#define NC_GCODE_READ_H

#include "nc/gcode/interpreter.h"

/* Called after each line: `end` is the offset behind it, its moves begin at `first_move`. `block`
 * is NULL where the line belongs to O words: then the moves are of many blocks, or there are none.
 */
typedef void (*NcBlockRead)(const NcInterpreter *interpreter, const NcBlock *block, size_t end,
                            guint first_move, void *data);

/* Reads blocks up to the program's end, checking the machine's limits; text behind the end is no
 * part of the program. `read` may be NULL. */
bool nc_read_blocks(NcInterpreter *interpreter, const char *text, size_t length, GArray *moves,
                    NcBlockRead read, void *data, GError **error);

#endif
