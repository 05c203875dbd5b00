/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A session is two deliveries to one machine, each on its own connection: `work` takes the lease,
 * carries the program and follows the run; `control` carries single commands, so that a HOLD never
 * waits behind a chunk.
 */
#include <gio/gio.h>
#include <string.h>

#include "fieldbus/modbus_client.h"

struct FbSession {
    char *address;
    FbSessionCallbacks callbacks;
    FbModbusClient *work, *control;
    GQueue commands; /* FbCommand that wait for `control` */
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
    show(s, fb_modbus_client_delivery(s->work));
}

static void on_work_ended(FbTask task, const GError *error, void *data)
{
    tell(data, task, error);
}

static void next_command(FbSession *s)
{
    FbDelivery *control = fb_modbus_client_delivery(s->control);
    if (fb_delivery_busy(control) || g_queue_is_empty(&s->commands))
        return;
    const FbCommand command = (FbCommand)GPOINTER_TO_INT(g_queue_pop_head(&s->commands));
    fb_delivery_command(control, command, g_get_monotonic_time());
    fb_modbus_client_wake(s->control);
}

static void on_control_ended(FbTask task, const GError *error, void *data)
{
    FbSession *s = data;
    const FbDelivery *control = fb_modbus_client_delivery(s->control);
    if (fb_delivery_status(control)->state != FB_STATE_UNKNOWN)
        show(s, control);
    next_command(s);
    tell(s, task, error);
}

void fb_session_deliver(FbSession *s, GBytes *program, const uint64_t *gates, size_t n_gates)
{
    fb_delivery_deliver(fb_modbus_client_delivery(s->work), program, gates, n_gates,
                        g_get_monotonic_time());
    fb_modbus_client_wake(s->work);
}

void fb_session_start(FbSession *s)
{
    fb_delivery_start(fb_modbus_client_delivery(s->work), g_get_monotonic_time());
    fb_modbus_client_wake(s->work);
}

void fb_session_command(FbSession *s, FbCommand command)
{
    const gpointer item = GINT_TO_POINTER(command);
    if (command == FB_COMMAND_HOLD || command == FB_COMMAND_ABORT)
        g_queue_push_head(&s->commands, item);
    else
        g_queue_push_tail(&s->commands, item);
    next_command(s);
}

const FbStatus *fb_session_status(const FbSession *s)
{
    return &s->status;
}

void fb_session_set_token(FbSession *s, uint64_t token)
{
    fb_delivery_set_token(fb_modbus_client_delivery(s->work), token);
    fb_delivery_set_token(fb_modbus_client_delivery(s->control), token);
}

static bool parse_address(const char *address, char **host, uint16_t *port, GError **error)
{
    const char *scheme = "modbus://";
    g_autoptr(GSocketConnectable) name = NULL;
    if (g_str_has_prefix(address, scheme))
        name = g_network_address_parse(address + strlen(scheme), 502, error);
    else
        g_set_error(error, FB_ERROR, FB_ERROR_UNREACHABLE, "write modbus://HOST:PORT");
    if (!name) {
        g_prefix_error(error, "%s is not an address of a machine: ", address);
        return false;
    }
    *host = g_strdup(g_network_address_get_hostname(G_NETWORK_ADDRESS(name)));
    *port = g_network_address_get_port(G_NETWORK_ADDRESS(name));
    return true;
}

static FbDelivery *new_delivery(const CfgAgent *agent, uint64_t token)
{
    const FbDeliveryOptions options = {
        .session = g_random_int() | 1,
        .token = token,
        .reply_timeout_us = (int64_t)(agent->reply_timeout_s * 1e6),
        .reconnect_us = (int64_t)(agent->reconnect_s * 1e6),
        .give_up_us = (int64_t)(agent->give_up_s * 1e6),
        .heartbeat_us = (int64_t)(agent->heartbeat_s * 1e6),
    };
    return fb_delivery_new(&options, g_get_monotonic_time());
}

FbSession *fb_session_new(const char *address, int unit_id, const CfgAgent *agent,
                          const FbSessionCallbacks *callbacks, GMainContext *context,
                          GError **error)
{
    static const FbModbusClientCallbacks work = {on_work_show, on_work_ended};
    static const FbModbusClientCallbacks control = {NULL, on_control_ended};
    g_autofree char *host = NULL;
    uint16_t port;
    if (!parse_address(address, &host, &port, error))
        return NULL;
    FbSession *s = g_new0(FbSession, 1);
    const uint64_t token = (uint64_t)(g_random_int() | 1) << 32 | g_random_int();
    s->address = g_strdup(address);
    s->callbacks = *callbacks;
    s->status.state = FB_STATE_UNKNOWN;
    g_queue_init(&s->commands);
    s->work =
        fb_modbus_client_new(host, port, unit_id, new_delivery(agent, token), &work, s, context);
    s->control =
        fb_modbus_client_new(host, port, unit_id, new_delivery(agent, token), &control, s, context);
    return s;
}

void fb_session_free(FbSession *s)
{
    if (!s)
        return;
    fb_modbus_client_free(s->work);
    fb_modbus_client_free(s->control);
    g_queue_clear(&s->commands);
    g_free(s->address);
    g_free(s);
}
