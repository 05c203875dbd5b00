/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/transitions.h"

enum {
    N_STATES = FB_STATE_ESTOP + 1,
    N_EVENTS = FB_MACHINE_ACKNOWLEDGED + 1,
    NO = FB_STAY_REFUSED,
    KEEP = FB_STAY,
    BACK = FB_BACK,
};

#define S(x) FB_STATE_##x

/* clang-format off */
static const int8_t after_command[N_STATES][FB_N_COMMANDS] = {
    /*                   NONE LEASE RELEASE OPEN      VERIFY        START       HOLD        RESUME      ABORT        ACKNOWLEDGE CLOSE   RESTART     OVERRIDE OPTIONAL_STOP */
    [S(OFF)]          = {NO, KEEP, KEEP, NO,         NO,           NO,         NO,         NO,         NO,          NO,       NO,      NO,         NO,   NO},
    [S(IDLE)]         = {NO, KEEP, KEEP, S(LOADING), NO,           NO,         NO,         NO,         NO,          NO,       NO,      NO,         KEEP, KEEP},
    [S(LOADING)]      = {NO, KEEP, KEEP, S(LOADING), S(VERIFYING), NO,         NO,         NO,         NO,          NO,       S(IDLE), NO,         KEEP, KEEP},
    [S(VERIFYING)]    = {NO, KEEP, KEEP, NO,         NO,           NO,         NO,         NO,         NO,          NO,       NO,      NO,         KEEP, KEEP},
    [S(READY)]        = {NO, KEEP, KEEP, S(LOADING), NO,           S(RUNNING), NO,         NO,         NO,          NO,       S(IDLE), S(RUNNING), KEEP, KEEP},
    [S(RUNNING)]      = {NO, KEEP, NO,   NO,         NO,           NO,         S(HOLDING), NO,         S(ABORTING), NO,       NO,      NO,         KEEP, KEEP},
    [S(HOLDING)]      = {NO, KEEP, NO,   NO,         NO,           NO,         KEEP,       NO,         S(ABORTING), NO,       NO,      NO,         KEEP, KEEP},
    [S(HELD)]         = {NO, KEEP, NO,   NO,         NO,           NO,         KEEP,       S(RUNNING), S(ABORTING), NO,       NO,      NO,         KEEP, KEEP},
    [S(PROGRAM_STOP)] = {NO, KEEP, NO,   NO,         NO,           NO,         KEEP,       S(RUNNING), S(ABORTING), NO,       NO,      NO,         KEEP, KEEP},
    [S(TOOL_CHANGE)]  = {NO, KEEP, NO,   NO,         NO,           NO,         S(HOLDING), NO,         S(ABORTING), NO,       NO,      NO,         KEEP, KEEP},
    [S(ABORTING)]     = {NO, KEEP, NO,   NO,         NO,           NO,         KEEP,       NO,         KEEP,        NO,       NO,      NO,         KEEP, KEEP},
    [S(COMPLETE)]     = {NO, KEEP, KEEP, S(LOADING), NO,           NO,         NO,         NO,         NO,          S(READY), S(IDLE), NO,         KEEP, KEEP},
    [S(ALARM)]        = {NO, KEEP, KEEP, NO,         NO,           NO,         NO,         NO,         NO,          NO,       NO,      NO,         KEEP, KEEP},
    [S(ESTOP)]        = {NO, KEEP, KEEP, NO,         NO,           NO,         NO,         NO,         NO,          NO,       NO,      NO,         KEEP, KEEP},
};

static const int8_t after_event[N_STATES][N_EVENTS] = {
    /*                   VERIFIED REFUSED   RUNNING     HELD     PROGRAM_STOP     TOOL_CHANGE     COMPLETE     ABORTED   ALARM     ESTOP     ACKNOWLEDGED */
    [S(OFF)]          = {NO,       NO,         NO,         NO,      NO,              NO,             NO,          NO,       NO,       S(ESTOP), S(IDLE)},
    [S(IDLE)]         = {NO,       NO,         NO,         NO,      NO,              NO,             NO,          NO,       S(ALARM), S(ESTOP), NO},
    [S(LOADING)]      = {NO,       NO,         NO,         NO,      NO,              NO,             NO,          NO,       S(ALARM), S(ESTOP), NO},
    [S(VERIFYING)]    = {S(READY), S(LOADING), NO,         NO,      NO,              NO,             NO,          NO,       S(ALARM), S(ESTOP), NO},
    [S(READY)]        = {NO,       NO,         NO,         NO,      NO,              NO,             NO,          NO,       S(ALARM), S(ESTOP), NO},
    [S(RUNNING)]      = {NO,       NO,         NO,         S(HELD), S(PROGRAM_STOP), S(TOOL_CHANGE), S(COMPLETE), S(READY), S(ALARM), S(ESTOP), NO},
    [S(HOLDING)]      = {NO,       NO,         NO,         S(HELD), S(PROGRAM_STOP), NO,             S(COMPLETE), S(READY), S(ALARM), S(ESTOP), NO},
    [S(HELD)]         = {NO,       NO,         S(RUNNING), NO,      NO,              NO,             NO,          S(READY), S(ALARM), S(ESTOP), NO},
    [S(PROGRAM_STOP)] = {NO,       NO,         S(RUNNING), NO,      NO,              NO,             S(COMPLETE), S(READY), S(ALARM), S(ESTOP), NO},
    [S(TOOL_CHANGE)]  = {NO,       NO,         S(RUNNING), S(HELD), S(PROGRAM_STOP), NO,             S(COMPLETE), S(READY), S(ALARM), S(ESTOP), NO},
    [S(ABORTING)]     = {NO,       NO,         NO,         NO,      NO,              NO,             S(COMPLETE), S(READY), S(ALARM), S(ESTOP), NO},
    [S(COMPLETE)]     = {NO,       NO,         NO,         NO,      NO,              NO,             NO,          NO,       S(ALARM), S(ESTOP), NO},
    [S(ALARM)]        = {NO,       NO,         NO,         NO,      NO,              NO,             NO,          NO,       NO,       S(ESTOP), BACK},
    [S(ESTOP)]        = {NO,       NO,         NO,         NO,      NO,              NO,             NO,          NO,       NO,       NO,       BACK},
};
/* clang-format on */

int fb_after_command(FbState state, FbCommand command)
{
    return after_command[state][command];
}

int fb_after_event(FbState state, FbMachineEvent event)
{
    return after_event[state][event];
}
