/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An FbDelivery in a main loop: its clock, and a transport that carries its requests. Modbus TCP
 * (fieldbus/modbus/client.c) and CAN (fieldbus/can/client.c) are the transports.
 */
#ifndef FIELDBUS_DRIVER_H
#define FIELDBUS_DRIVER_H

#include "fieldbus/delivery.h"

typedef struct FbDriver FbDriver;

/* One connection to a machine. What happens on it is told by fb_driver_event: CONNECTED after
 * `connect`; REPLY for each request, in the order of the requests; BROKEN when it ended, or could
 * not be made, after which it is disconnected. Never from inside these four. */
typedef struct {
    void (*connect)(void *transport);
    void (*disconnect)(void *transport);
    void (*send)(void *transport, const FbRequest *request);
    void (*free)(void *transport);
} FbTransport;

/* Called after a step, when there is something to tell. `show` may be NULL; neither may free the
 * driver. */
typedef struct {
    void (*show)(void *data);
    void (*ended)(FbTask task, const GError *error, void *data);
} FbDriverCallbacks;

/* Takes the delivery. Connects from the main loop, once it has a transport. */
FbDriver *fb_driver_new(FbDelivery *delivery, const FbDriverCallbacks *callbacks, void *data,
                        GMainContext *context);

/* Takes `instance`, the transport's own data. */
void fb_driver_set_transport(FbDriver *driver, const FbTransport *transport, void *instance);
void fb_driver_free(FbDriver *driver); /* says farewell where it can */
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbDriver, fb_driver_free)

FbDelivery *fb_driver_delivery(FbDriver *driver);
GMainContext *fb_driver_context(FbDriver *driver);

/* Steps the delivery from the main loop, soon: after it was given a task. */
void fb_driver_wake(FbDriver *driver);

/* For the transport. */
void fb_driver_event(FbDriver *driver, const FbEvent *event);
void fb_driver_broken(FbDriver *driver, const char *why);

#endif
