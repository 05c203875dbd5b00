/* SPDX-License-Identifier: Apache-2.0 */
/* A person's work over the test's bus: deliver, start, once; and how it ended. */
#ifndef TESTS_LIB_FB_WORK_H
#define TESTS_LIB_FB_WORK_H

#include "tests/lib/fb_bus.h"

typedef enum {
    END_DONE,    /* told so; executed whole, once */
    END_REFUSED, /* an error that says why, or nobody left to tell; nothing was executed */
    END_STOPPED, /* the machine rebooted: LINK_LOST, or nobody left to tell; OFF, up to a line */
    END_HELD,    /* the agent is lost: HELD at a gate */
    END_UNTOLD,  /* COMPLETE, executed whole, but the agent died or lost the machine before */
    END_ABORTED, /* as a person wished, behind a line */
    END_BAD,     /* none of these: what must not be */
} End;

const char *end_name(End end);

/* Delivers, and starts; an agent that died is begun again, and so is, where the machine is
 * attended, a delivery that was refused. What was started is not started again. Where a person has
 * to acknowledge at the machine, one does. */
void work(Bus *bus);

/* Until nothing moves any more, and whatever is late has arrived. */
void work_settle(Bus *bus);

End work_end(const Bus *bus);

/* Of these (bits) a work with this fault may be. */
unsigned work_ends(FaultKind kind);

/* Fails the test and says with what; true where the end is one of `ends` (bits). */
bool work_check(const Bus *bus, unsigned ends);

#endif
