/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/modbus_client.h"

#include <gio/gio.h>
#include <modbus.h>
#include <string.h>
#include <unistd.h>

#include "fieldbus/mbap.h"

/* A connect that is on its way; outlives a client that no longer wants it. */
typedef struct {
    FbModbusClient *client; /* NULL: nobody waits */
    GCancellable *cancellable;
} Attempt;

struct FbModbusClient {
    char *host;
    uint16_t port;
    uint8_t unit_id;
    FbDelivery *delivery;
    FbModbusClientCallbacks callbacks;
    void *data;
    GMainContext *context;
    GSource *timer;
    int64_t timer_us; /* when it goes off; INT64_MAX: never */
    Attempt *attempt;
    FbMbap *mbap; /* NULL: not connected */
    uint16_t transaction;
    uint8_t function; /* of the request in flight, */
    size_t n_read;    /* and the registers it reads; 0: none is in flight */
};

static void carry_out(FbModbusClient *c, FbActions *actions);

static void step(FbModbusClient *c, const FbEvent *event)
{
    FbActions actions;
    fb_delivery_step(c->delivery, event, g_get_monotonic_time(), &actions);
    carry_out(c, &actions);
}

static void disconnect(FbModbusClient *c);
static void connect_to(FbModbusClient *c);
static void send_request(FbModbusClient *c, const FbRequest *request);

/* Moving the timer wakes the main loop: it is only moved to an earlier time, and asks for the right
 * one when it goes off. */
static void set_timer(FbModbusClient *c, int64_t at_us)
{
    if (at_us >= c->timer_us)
        return;
    c->timer_us = at_us;
    g_source_set_ready_time(c->timer, at_us);
}

static void carry_out(FbModbusClient *c, FbActions *actions)
{
    g_autoptr(GError) error = actions->error;
    if (actions->close)
        disconnect(c);
    if (actions->connect)
        connect_to(c);
    if (actions->request)
        send_request(c, actions->request);
    set_timer(c, actions->wake_us);
    if (actions->show && c->callbacks.show)
        c->callbacks.show(c->data);
    if (actions->ended)
        c->callbacks.ended(actions->task, error, c->data);
}

/* ------------------------------------------------------------------- requests */

static uint8_t *put16(uint8_t *p, size_t v)
{
    p[0] = (uint8_t)(v >> 8);
    p[1] = (uint8_t)v;
    return p + 2;
}

static unsigned u16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

static void send_request(FbModbusClient *c, const FbRequest *request)
{
    static const uint16_t written[] = {[FB_REQUEST_COMMAND] = FB_AT_COMMAND,
                                       [FB_REQUEST_CHUNK] = FB_AT_CHUNK,
                                       [FB_REQUEST_BEAT] = FB_AT_BEAT};
    const bool alarm = request->kind == FB_REQUEST_ALARM;
    uint8_t adu[FB_ADU_BYTES];
    if (!c->mbap)
        return;
    c->n_read = (alarm ? FB_ALARM_BYTES : FB_STATUS_BYTES) / 2;
    c->function =
        request->n > 0 ? MODBUS_FC_WRITE_AND_READ_REGISTERS : MODBUS_FC_READ_HOLDING_REGISTERS;
    uint8_t *p = put16(put16(adu, ++c->transaction), 0) + 2;
    *p++ = c->unit_id;
    *p++ = c->function;
    p = put16(put16(p, alarm ? FB_AT_ALARM : FB_AT_STATUS), c->n_read);
    if (request->n > 0) {
        p = put16(put16(p, written[request->kind]), request->n / 2);
        *p++ = (uint8_t)request->n;
        memcpy(p, request->bytes, request->n);
        p += request->n;
    }
    put16(adu + 4, (size_t)(p - adu) - 6);
    fb_mbap_send(c->mbap, adu, (size_t)(p - adu));
}

static void break_off(FbModbusClient *c, const char *why)
{
    step(c, &(FbEvent){.kind = FB_EVENT_BROKEN, .why = why});
}

static void on_adu(FbMbap *mbap, const uint8_t *adu, size_t n, void *data)
{
    (void)mbap;
    FbModbusClient *c = data;
    const uint8_t *pdu = adu + FB_MBAP_HEADER_BYTES;
    const size_t n_pdu = n - FB_MBAP_HEADER_BYTES, n_bytes = 2 * c->n_read;
    if (c->n_read == 0 || u16(adu) != c->transaction || adu[6] != c->unit_id) {
        break_off(c, "an answer to another request");
    } else if (n_pdu == 2 && pdu[0] == (c->function | 0x80)) {
        g_autofree char *why = g_strdup_printf("Modbus exception %d: is this the right port and "
                                               "unit?",
                                               pdu[1]);
        break_off(c, why);
    } else if (pdu[0] != c->function || n_pdu != 2 + n_bytes || pdu[1] != n_bytes) {
        break_off(c, "an answer that is not Modbus");
    } else {
        c->n_read = 0;
        step(c, &(FbEvent){.kind = FB_EVENT_REPLY, .bytes = pdu + 2, .n = n_bytes});
    }
}

static void on_broken(FbMbap *mbap, const char *why, void *data)
{
    (void)mbap;
    FbModbusClient *c = data;
    disconnect(c);
    break_off(c, why);
}

/* ------------------------------------------------------------------ connection */

static void on_connected(GObject *object, GAsyncResult *result, gpointer data)
{
    static const FbMbapCallbacks callbacks = {.adu = on_adu, .broken = on_broken};
    Attempt *attempt = data;
    FbModbusClient *c = attempt->client;
    g_autoptr(GError) error = NULL;
    g_autoptr(GSocketConnection) connection =
        g_socket_client_connect_to_host_finish(G_SOCKET_CLIENT(object), result, &error);
    g_object_unref(attempt->cancellable);
    g_free(attempt);
    if (!c)
        return;
    c->attempt = NULL;
    const int fd =
        connection ? dup(g_socket_get_fd(g_socket_connection_get_socket(connection))) : -1;
    if (fd < 0) {
        break_off(c, error ? error->message : "no file descriptor is left");
        return;
    }
    c->mbap = fb_mbap_new(fd, &callbacks, c, c->context);
    step(c, &(FbEvent){.kind = FB_EVENT_CONNECTED});
}

static void connect_to(FbModbusClient *c)
{
    g_autoptr(GSocketClient) client = g_socket_client_new();
    g_socket_client_set_enable_proxy(client, FALSE);
    c->attempt = g_new(Attempt, 1);
    *c->attempt = (Attempt){.client = c, .cancellable = g_cancellable_new()};
    g_main_context_push_thread_default(c->context);
    g_socket_client_connect_to_host_async(client, c->host, c->port, c->attempt->cancellable,
                                          on_connected, c->attempt);
    g_main_context_pop_thread_default(c->context);
}

static void disconnect(FbModbusClient *c)
{
    Attempt *attempt = g_steal_pointer(&c->attempt);
    if (attempt) {
        attempt->client = NULL;
        g_cancellable_cancel(attempt->cancellable);
    }
    fb_mbap_free(g_steal_pointer(&c->mbap));
    c->n_read = 0;
}

/* ----------------------------------------------------------------------- life */

static gboolean on_timer(gpointer data)
{
    FbModbusClient *c = data;
    c->timer_us = INT64_MAX;
    g_source_set_ready_time(c->timer, -1);
    step(c, &(FbEvent){.kind = FB_EVENT_TICK});
    return G_SOURCE_CONTINUE;
}

static gboolean dispatch_timer(GSource *source, GSourceFunc callback, gpointer data)
{
    (void)source;
    return callback(data);
}

FbModbusClient *fb_modbus_client_new(const char *host, uint16_t port, int unit_id,
                                     FbDelivery *delivery, const FbModbusClientCallbacks *callbacks,
                                     void *data, GMainContext *context)
{
    static GSourceFuncs timer = {.dispatch = dispatch_timer};
    FbModbusClient *c = g_new0(FbModbusClient, 1);
    c->host = g_strdup(host);
    c->port = port;
    c->unit_id = (uint8_t)unit_id;
    c->delivery = delivery;
    c->callbacks = *callbacks;
    c->data = data;
    c->context = g_main_context_ref(context ? context : g_main_context_default());
    c->timer = g_source_new(&timer, sizeof(GSource));
    g_source_set_callback(c->timer, on_timer, c, NULL);
    g_source_set_ready_time(c->timer, 0);
    g_source_attach(c->timer, c->context);
    return c;
}

void fb_modbus_client_free(FbModbusClient *c)
{
    if (!c)
        return;
    const FbRequest *farewell = fb_delivery_farewell(c->delivery);
    if (farewell)
        send_request(c, farewell);
    disconnect(c);
    g_source_destroy(c->timer);
    g_source_unref(c->timer);
    fb_delivery_free(c->delivery);
    g_main_context_unref(c->context);
    g_free(c->host);
    g_free(c);
}

FbDelivery *fb_modbus_client_delivery(FbModbusClient *c)
{
    return c->delivery;
}

void fb_modbus_client_wake(FbModbusClient *c)
{
    set_timer(c, 0);
}
