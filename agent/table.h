/* SPDX-License-Identifier: Apache-2.0 */
/* What people read on stdout. */
#ifndef AGENT_TABLE_H
#define AGENT_TABLE_H

#include "nc/nc.h"
#include "segcore/segcore.h"

void agent_table_regions(const SegSegmentation *segmentation);

/* The operations, the totals and, where there is a baseline, the saving. */
void agent_table_plan(const NcPlan *plan, const NcPlan *baseline);

#endif
