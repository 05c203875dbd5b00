/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A session is two deliveries to one machine, each on its own connection: `work` takes the lease,
 * carries the program and follows the run; `control` carries single commands, so that a HOLD never
 * waits behind a chunk.
 */
#include "fieldbus/session.h"

#include <string.h>

#include "fieldbus/can/client.h"
#include "fieldbus/driver.h"
#include "fieldbus/modbus/client.h"

typedef struct {
    FbCommand command;
    FbArguments arguments;
    int64_t asked_us;
} Command;

struct FbSession {
    char *address;
    FbSessionCallbacks callbacks;
    FbDriver *work, *control;
    GQueue commands; /* of Command, that wait for `control` */
    FbStatus status; /* as shown last */
};

static void show(FbSession *s, const FbDelivery *delivery)
{
    s->status = *fb_delivery_status(delivery);
    if (s->callbacks.status)
        s->callbacks.status(&s->status, s->callbacks.data);
}

static void tell(FbSession *s, FbTask task, const GError *error)
{
    g_autoptr(GError) named = error ? g_error_copy(error) : NULL;
    if (named)
        g_prefix_error(&named, "%s: ", s->address);
    if (s->callbacks.done)
        s->callbacks.done(task, named, s->callbacks.data);
}

static void on_work_show(void *data)
{
    FbSession *s = data;
    show(s, fb_driver_delivery(s->work));
}

static void on_work_ended(FbTask task, const GError *error, void *data)
{
    tell(data, task, error);
}

static void next_command(FbSession *s)
{
    FbDelivery *control = fb_driver_delivery(s->control);
    if (fb_delivery_busy(control) || g_queue_is_empty(&s->commands))
        return;
    g_autofree Command *next = g_queue_pop_head(&s->commands);
    fb_delivery_command(control, next->command, &next->arguments, next->asked_us,
                        g_get_monotonic_time());
    fb_driver_wake(s->control);
}

static void on_control_ended(FbTask task, const GError *error, void *data)
{
    FbSession *s = data;
    const FbDelivery *control = fb_driver_delivery(s->control);
    if (fb_delivery_status(control)->state != FB_STATE_UNKNOWN)
        show(s, control);
    next_command(s);
    tell(s, task, error);
}

void fb_session_deliver(FbSession *s, GBytes *program, const uint64_t *gates, size_t n_gates)
{
    fb_delivery_deliver(fb_driver_delivery(s->work), program, gates, n_gates,
                        g_get_monotonic_time());
    fb_driver_wake(s->work);
}

void fb_session_start(FbSession *s)
{
    fb_delivery_start(fb_driver_delivery(s->work), g_get_monotonic_time());
    fb_driver_wake(s->work);
}

void fb_session_start_stored(FbSession *s, const FbStored *stored)
{
    fb_delivery_start_stored(fb_driver_delivery(s->work), stored, g_get_monotonic_time());
    fb_driver_wake(s->work);
}

void fb_session_read_setup(FbSession *s)
{
    fb_delivery_read_setup(fb_driver_delivery(s->work), g_get_monotonic_time());
    fb_driver_wake(s->work);
}

const FbSetup *fb_session_setup(const FbSession *s)
{
    return fb_delivery_setup(fb_driver_delivery(s->work));
}

/* Nothing that was asked for before a stop sets the machine in motion behind it. */
static void withdraw_movers(FbSession *s)
{
    FbDriver *const drivers[] = {s->work, s->control};
    for (size_t i = 0; i < G_N_ELEMENTS(drivers); i++) {
        fb_delivery_withdraw(fb_driver_delivery(drivers[i]));
        fb_driver_wake(drivers[i]);
    }
    for (GList *link = s->commands.head, *next; link; link = next) {
        next = link->next;
        if (((Command *)link->data)->command != FB_COMMAND_RESUME)
            continue;
        g_autoptr(GError) error = g_error_new_literal(
            FB_ERROR, FB_ERROR_REFUSED, "RESUME was not sent: a stop was asked for meanwhile");
        g_free(link->data);
        g_queue_delete_link(&s->commands, link);
        tell(s, FB_TASK_COMMAND, error);
    }
}

void fb_session_command(FbSession *s, FbCommand command, const FbArguments *arguments)
{
    const bool stop = fb_command_stops(command);
    Command *item = g_new0(Command, 1);
    item->command = command;
    item->asked_us = g_get_monotonic_time();
    if (arguments)
        item->arguments = *arguments;
    if (stop)
        withdraw_movers(s);
    if (stop)
        g_queue_push_head(&s->commands, item);
    else
        g_queue_push_tail(&s->commands, item);
    next_command(s);
}

const FbStatus *fb_session_status(const FbSession *s)
{
    return &s->status;
}

const char *fb_session_why(const FbSession *s)
{
    return fb_delivery_why(fb_driver_delivery(s->work));
}

void fb_session_set_token(FbSession *s, uint64_t token)
{
    fb_delivery_set_token(fb_driver_delivery(s->work), token);
    fb_delivery_set_token(fb_driver_delivery(s->control), token);
}

/* Any number but 0, each as likely. */
static uint32_t draw(void)
{
    uint32_t number;
    do
        number = g_random_int();
    while (number == 0);
    return number;
}

static FbDelivery *new_delivery(const CfgAgent *agent, uint64_t token)
{
    const FbDeliveryOptions options = {
        .session = draw(),
        .token = token,
        .reply_timeout_us = (int64_t)(agent->reply_timeout_s * 1e6),
        .reconnect_us = (int64_t)(agent->reconnect_s * 1e6),
        .give_up_us = (int64_t)(agent->give_up_s * 1e6),
        .heartbeat_us = (int64_t)(agent->heartbeat_s * 1e6),
        .window = (uint16_t)agent->window,
        .drip = agent->drip,
    };
    return fb_delivery_new(&options, g_get_monotonic_time());
}

/* Without its transports. */
static FbSession *new_session(const char *address, const CfgAgent *agent,
                              const FbSessionCallbacks *callbacks, GMainContext *context)
{
    static const FbDriverCallbacks work = {on_work_show, on_work_ended};
    static const FbDriverCallbacks control = {NULL, on_control_ended};
    FbSession *s = g_new0(FbSession, 1);
    const uint64_t token = (uint64_t)draw() << 32 | g_random_int();
    s->address = g_strdup(address);
    s->callbacks = *callbacks;
    s->status.state = FB_STATE_UNKNOWN;
    g_queue_init(&s->commands);
    s->work = fb_driver_new(new_delivery(agent, token), &work, s, context);
    s->control = fb_driver_new(new_delivery(agent, token), &control, s, context);
    return s;
}

FbSession *fb_session_new_on_can(const char *address, FbCanAgent *can, const CfgAgent *agent,
                                 const FbSessionCallbacks *callbacks, GMainContext *context)
{
    FbSession *s = new_session(address, agent, callbacks, context);
    fb_can_client_attach(s->work, can, FB_CAN_WORK_CHANNEL);
    fb_can_client_attach(s->control, can, FB_CAN_CONTROL_CHANNEL);
    return s;
}

FbSession *fb_session_new(const CfgTarget *target, const CfgAgent *agent,
                          const FbSessionCallbacks *callbacks, GMainContext *context,
                          GError **error)
{
    if (g_str_has_prefix(target->address, "can://")) {
        g_autoptr(FbCanAgent) can = fb_can_agent_new(target, error);
        return can ? fb_session_new_on_can(target->address, can, agent, callbacks, context) : NULL;
    }
    g_autoptr(FbSession) s = new_session(target->address, agent, callbacks, context);
    if (!fb_modbus_client_attach(s->work, target, error) ||
        !fb_modbus_client_attach(s->control, target, error))
        return NULL;
    return g_steal_pointer(&s);
}

void fb_session_free(FbSession *s)
{
    if (!s)
        return;
    fb_driver_free(s->work);
    fb_driver_free(s->control);
    g_queue_clear_full(&s->commands, g_free);
    g_free(s->address);
    g_free(s);
}
