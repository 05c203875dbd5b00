/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/fieldbus.h"

bool fb_run_ended(const FbStatus *status, uint32_t epoch, uint32_t run, GError **why)
{
    if (status->state == FB_STATE_UNKNOWN)
        return false;
    if (status->epoch != epoch) {
        g_set_error_literal(why, FB_ERROR, FB_ERROR_LINK_LOST,
                            "the machine was restarted: what it did last is not known");
        return true;
    }
    if (status->run != run) {
        g_set_error(why, FB_ERROR, FB_ERROR_PROTOCOL,
                    "the machine was started by somebody else (run %u, this was %u)", status->run,
                    run);
        return true;
    }
    if (status->run_end == FB_RUN_ABORTED)
        g_set_error(why, FB_ERROR, FB_ERROR_ABORTED, "aborted in line %u", status->stop_line);
    if (status->run_end == FB_RUN_ALARM && status->alarm_code == 0)
        g_set_error(why, FB_ERROR, FB_ERROR_ALARM, "alarm in line %u, acknowledged meanwhile",
                    status->stop_line);
    else if (status->run_end == FB_RUN_ALARM)
        g_set_error(why, FB_ERROR, FB_ERROR_ALARM, "alarm %u in line %u: %s. %s",
                    status->alarm_code, status->stop_line, status->alarm_text,
                    status->alarm_advice);
    return status->run_end != FB_RUN_NONE;
}
