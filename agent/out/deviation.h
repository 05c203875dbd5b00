/* SPDX-License-Identifier: Apache-2.0 */
/* deviation.png: the part as it stands on the machine, coloured by what the program leaves. */
#ifndef AGENT_OUT_DEVIATION_H
#define AGENT_OUT_DEVIATION_H

#include "nc/nc.h"

/* PNG bytes. Errors: AGENT_ERROR_OUTPUT. */
GBytes *agent_deviation_png(const SegPart *part, const SegSegmentation *segmentation,
                            const NcSetup *setup, const NcVerdict *verdict, GError **error);

#endif
