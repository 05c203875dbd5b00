/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/setup.h"

#include <string.h>

FbSetup sim_setup(const CfgMachine *machine, const CfgToolTable *tools, int work_offset)
{
    FbSetup setup = {.n_tools = (uint16_t)MIN(tools->n_tools, FB_TOOLS_MOST),
                     .work_offset = (uint16_t)work_offset};
    for (size_t i = 0; i < setup.n_tools; i++) {
        const CfgTool *tool = &tools->tools[i];
        setup.tools[i] = (FbTool){.number = tool->number,
                                  .kind = tool->kind,
                                  .diameter_mm = tool->diameter_mm,
                                  .corner_radius_mm = tool->corner_radius_mm,
                                  .length_mm = tool->length_mm};
    }
    memcpy(setup.work_offset_mm, machine->work_offset_mm, sizeof setup.work_offset_mm);
    return setup;
}
