/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An FbDelivery on Modbus TCP: its clock, its connection, its transaction ids. The PDUs are built
 * here and not by libmodbus, whose calls block and whose raw requests all carry transaction id 0.
 */
#ifndef FIELDBUS_MODBUS_CLIENT_H
#define FIELDBUS_MODBUS_CLIENT_H

#include "fieldbus/delivery.h"

typedef struct FbModbusClient FbModbusClient;

/* Called after a step, when there is something to tell. `show` may be NULL; neither
 * may free the client. */
typedef struct {
    void (*show)(void *data);
    void (*ended)(FbTask task, const GError *error, void *data);
} FbModbusClientCallbacks;

/* Takes the delivery. Connects from the main loop. */
FbModbusClient *fb_modbus_client_new(const char *host, uint16_t port, int unit_id,
                                     FbDelivery *delivery, const FbModbusClientCallbacks *callbacks,
                                     void *data, GMainContext *context);
void fb_modbus_client_free(FbModbusClient *client); /* says farewell where it can */
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbModbusClient, fb_modbus_client_free)

FbDelivery *fb_modbus_client_delivery(FbModbusClient *client);

/* Steps the delivery from the main loop, soon: after it was given a task. */
void fb_modbus_client_wake(FbModbusClient *client);

#endif
