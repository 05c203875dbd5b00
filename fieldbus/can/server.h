/* SPDX-License-Identifier: Apache-2.0 */
/* The machine's CAN server on any bus; fieldbus.h has it for those of the kernel. */
#ifndef FIELDBUS_CAN_SERVER_H
#define FIELDBUS_CAN_SERVER_H

#include "fieldbus/can/bus.h"
#include "fieldbus/can/slave.h"

/* Takes the bus. `options->fd` is not looked at: the bus says it. */
FbCanServer *fb_can_server_new_on(FbCanBus bus, const FbCanSlaveOptions *options,
                                  FbReceiver *receiver, void (*act)(FbDo what, void *data),
                                  void *data, GMainContext *context, GError **error);

#endif
