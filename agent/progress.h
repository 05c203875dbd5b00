/* SPDX-License-Identifier: Apache-2.0 */
/* Progress on stderr: a bar on a terminal, a line a step elsewhere. */
#ifndef AGENT_PROGRESS_H
#define AGENT_PROGRESS_H

/* A step has begun. */
void agent_progress_step(const char *what);

/* `done` of the step, 0 … 1. Only a terminal shows it. */
void agent_progress_share(const char *what, double done);

/* The step has ended: the terminal's line is free again. */
void agent_progress_end(void);

/* One line of text that must not get lost behind a bar. */
void agent_progress_note(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
