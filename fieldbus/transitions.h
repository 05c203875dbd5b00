/* SPDX-License-Identifier: Apache-2.0 */
/* The two tables of docs/protocol.md, section 3: which state comes after which. */
#ifndef FIELDBUS_TRANSITIONS_H
#define FIELDBUS_TRANSITIONS_H

#include "fieldbus/fieldbus.h"

enum {
    FB_STAY_REFUSED = -1, /* means nothing, or is refused, in this state */
    FB_STAY = -2,         /* done; the state stays */
    FB_BACK = -3,         /* to where the machine was before its alarm */
};

/* The state after it, or one of the three above. */
int fb_after_command(FbState state, FbCommand command);
int fb_after_event(FbState state, FbMachineEvent event);

#endif
