/* SPDX-License-Identifier: Apache-2.0 */
/* The agent's side on a CAN bus: the transport of a driver. */
#ifndef FIELDBUS_CAN_CLIENT_H
#define FIELDBUS_CAN_CLIENT_H

#include "fieldbus/can/agent.h"
#include "fieldbus/driver.h"

/* Gives the driver its transport, on one of the agent's channels. HOLD and ABORT leave the control
 * channel as STOP frames. */
void fb_can_client_attach(FbDriver *driver, FbCanAgent *agent, FbCanChannel channel);

#endif
