/* SPDX-License-Identifier: Apache-2.0 */
/* A session on any CAN bus; fieldbus.h has it for those of the kernel, and for Modbus. */
#ifndef FIELDBUS_SESSION_H
#define FIELDBUS_SESSION_H

#include "fieldbus/can/agent.h"

/* `address` is for messages. */
FbSession *fb_session_new_on_can(const char *address, FbCanAgent *can, const CfgAgent *agent,
                                 const FbSessionCallbacks *callbacks, GMainContext *context);

#endif
