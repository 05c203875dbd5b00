/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The log of --log: one JSON object a line (docs/schema/vcnc-log.json). Times are those of the
 * program's clock, so two runs of one program give the same bytes.
 */
#ifndef SIM_LOG_H
#define SIM_LOG_H

#include "sim/controller.h"

typedef struct SimLog SimLog;

/* Begins a new file. Errors: G_FILE_ERROR. */
SimLog *sim_log_open(const char *path, GError **error);

/* Frees the log; false with G_FILE_ERROR where a line could not be written. */
bool sim_log_close(SimLog *log, GError **error);

/* A stored program: its SHA-256, and how long it takes. */
void sim_log_program(SimLog *log, const uint8_t id[32], double planned_s);
void sim_log_refused(SimLog *log, uint16_t code, const char *text);
void sim_log_state(SimLog *log, FbState state, double time_s);
void sim_log_block(SimLog *log, const SimBlock *block);

/* One that drips: its SHA-256 as announced, and how many passes it has. */
void sim_log_passes(SimLog *log, const uint8_t id[32], uint32_t n_passes);

/* A message of the program. */
void sim_log_message(SimLog *log, uint32_t line, const char *text, double time_s);

/* A fault of the script begins. */
void sim_log_fault(SimLog *log, const char *spec, double time_s);

/* A move of the way to the program. */
void sim_log_way(SimLog *log, const SimBlock *move);
void sim_log_override(SimLog *log, NcOverride override, double time_s);

/*
 * What became of the material is known some time after a run. So that the log does not depend on
 * when: `hold` keeps what is logged from now on back, and the `release` that belongs to it, the
 * first to the first, lets it go. Between them, what a run is blamed for comes at once.
 */
void sim_log_hold(SimLog *log);
void sim_log_release(SimLog *log);
void sim_log_collision(SimLog *log, const NcCollision *collision);

/* Why material was not removed, or the model not written. */
void sim_log_material(SimLog *log, const char *text);

#endif
