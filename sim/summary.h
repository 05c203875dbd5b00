/* SPDX-License-Identifier: Apache-2.0 */
/* What a machine has done since its start, as text for people. */
#ifndef SIM_SUMMARY_H
#define SIM_SUMMARY_H

#include "sim/controller.h"

typedef struct {
    SimTotals totals;
    uint64_t executed_blocks;
    unsigned refused;                     /* programs */
    const uint64_t *answers;              /* as fb_receiver_counts */
    const FbModbusServer *plain, *secure; /* NULL: there is none */
    const FbCanServer *can;               /* as well */
} SimSummary;

/* Some lines; caller frees. */
char *sim_summary(const SimSummary *summary);

#endif
