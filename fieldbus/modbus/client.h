/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modbus TCP as a driver's transport: connections and transaction ids. The PDUs are built here and
 * not by libmodbus, whose calls block and whose raw requests all carry transaction id 0.
 */
#ifndef FIELDBUS_MODBUS_CLIENT_H
#define FIELDBUS_MODBUS_CLIENT_H

#include "fieldbus/driver.h"

/* Gives the driver its transport, as the target's address and certificate say; false with an error
 * where fb_session_new refuses them. */
bool fb_modbus_client_attach(FbDriver *driver, const CfgTarget *target, GError **error);

#endif
