/* SPDX-License-Identifier: Apache-2.0 */
/* Progress on stderr: a bar on a terminal, a line a step elsewhere. */
#ifndef AGENT_PROGRESS_H
#define AGENT_PROGRESS_H

/* A step of unknown length has begun. */
void agent_progress_step(const char *what);

/* `done` of the step, 0 … 1. At 1 the bar ends. */
void agent_progress_share(const char *what, double done);

/* One line of text that must not get lost behind a bar. */
void agent_progress_note(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
