/* SPDX-License-Identifier: Apache-2.0 */
/* verify.json: docs/schema/verify.json. */
#ifndef AGENT_OUT_VERIFY_JSON_H
#define AGENT_OUT_VERIFY_JSON_H

#include "nc/nc.h"

/* The text; caller frees. */
char *agent_verify_json(const NcVerdict *verdict, const CfgRecipe *recipe, const SegPart *part,
                        const char *program_sha256);

#endif
