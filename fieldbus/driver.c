/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/driver.h"

#include "fieldbus/source.h"

struct FbDriver {
    FbDelivery *delivery;
    FbDriverCallbacks callbacks;
    void *data;
    GMainContext *context;
    GSource *timer;
    int64_t timer_us; /* when it goes off; INT64_MAX: never */
    const FbTransport *transport;
    void *instance;
};

static void carry_out(FbDriver *d, FbActions *actions);

void fb_driver_event(FbDriver *d, const FbEvent *event)
{
    static const FbEvent tick = {.kind = FB_EVENT_TICK};
    FbActions actions;
    do {
        fb_delivery_step(d->delivery, event, g_get_monotonic_time(), &actions);
        carry_out(d, &actions);
        event = &tick;
    } while (actions.more);
}

void fb_driver_broken(FbDriver *d, const char *why)
{
    fb_driver_event(d, &(FbEvent){.kind = FB_EVENT_BROKEN, .why = why});
}

/* Moving the timer wakes the main loop: it is only moved to an earlier time, and asks for the right
 * one when it goes off. */
static void set_timer(FbDriver *d, int64_t at_us)
{
    if (at_us >= d->timer_us)
        return;
    d->timer_us = at_us;
    g_source_set_ready_time(d->timer, at_us);
}

static void carry_out(FbDriver *d, FbActions *actions)
{
    g_autoptr(GError) error = actions->error;
    if (actions->close)
        d->transport->disconnect(d->instance);
    if (actions->connect)
        d->transport->connect(d->instance);
    if (actions->request)
        d->transport->send(d->instance, actions->request);
    set_timer(d, actions->wake_us);
    if (actions->show && d->callbacks.show)
        d->callbacks.show(d->data);
    if (actions->ended)
        d->callbacks.ended(actions->task, error, d->data);
}

static void on_timer(void *data)
{
    FbDriver *d = data;
    d->timer_us = INT64_MAX;
    g_source_set_ready_time(d->timer, -1);
    fb_driver_event(d, &(FbEvent){.kind = FB_EVENT_TICK});
}

FbDriver *fb_driver_new(FbDelivery *delivery, const FbDriverCallbacks *callbacks, void *data,
                        GMainContext *context)
{
    FbDriver *d = g_new0(FbDriver, 1);
    d->delivery = delivery;
    d->callbacks = *callbacks;
    d->data = data;
    d->context = g_main_context_ref(context ? context : g_main_context_default());
    d->timer = fb_source_new(on_timer, d, d->context);
    d->timer_us = INT64_MAX;
    return d;
}

void fb_driver_set_transport(FbDriver *d, const FbTransport *transport, void *instance)
{
    d->transport = transport;
    d->instance = instance;
    set_timer(d, 0);
}

void fb_driver_free(FbDriver *d)
{
    if (!d)
        return;
    const FbRequest *farewell = fb_delivery_farewell(d->delivery);
    if (farewell && d->transport)
        d->transport->send(d->instance, farewell);
    if (d->transport)
        d->transport->free(d->instance);
    fb_source_end(&d->timer);
    fb_delivery_free(d->delivery);
    g_main_context_unref(d->context);
    g_free(d);
}

FbDelivery *fb_driver_delivery(FbDriver *d)
{
    return d->delivery;
}

GMainContext *fb_driver_context(FbDriver *d)
{
    return d->context;
}

void fb_driver_wake(FbDriver *d)
{
    set_timer(d, 0);
}
