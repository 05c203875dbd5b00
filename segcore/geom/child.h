/* SPDX-License-Identifier: Apache-2.0 */
/* A child process that may misbehave: limited in memory, time and output. */
#ifndef SEGCORE_GEOM_CHILD_H
#define SEGCORE_GEOM_CHILD_H

#include <glib.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct {
    unsigned timeout_s;    /* wall clock and processor; then SIGKILL */
    uint64_t memory_bytes; /* address space, and the most it may write to standard output */
} SegChildLimits;

typedef enum {
    SEG_CHILD_ENDED,     /* by itself, or by a signal of its own: see status */
    SEG_CHILD_TIMED_OUT, /* killed */
    SEG_CHILD_TOO_LONG,  /* killed: it wrote more than memory_bytes */
} SegChildEnd;

typedef struct {
    SegChildEnd end;
    int status; /* as of waitpid */
    char *out;  /* standard output */
    size_t out_length;
    char err[2048]; /* the last of standard error, NUL-terminated */
    size_t err_length;
} SegChildResult;

void seg_child_result_clear(SegChildResult *result);
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(SegChildResult, seg_child_result_clear)

/*
 * Runs argv to its end, with `input` (may be NULL) on its standard input. False, SEG_ERROR_IO, only
 * where it could not be started or watched; how it ended is in `result`, which the caller clears.
 * The child dies with the calling thread, and leaves no core.
 */
bool seg_child_run(const char *const *argv, const char *input, const SegChildLimits *limits,
                   SegChildResult *result, GError **error);

#endif
