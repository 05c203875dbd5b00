/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's Modbus TCP server, plain or in TLS: who is connected, and when the receiver is to
 * be ticked. mbap.* frames each connection, slave.* answers its ADUs.
 */
#include <gio/gio.h>
#include <unistd.h>

#include "fieldbus/modbus/slave.h"

enum {
    MAX_CLIENTS = 16, /* that are ready; as many again may be on their way to it */
    BACKLOG = 64,     /* connections that wait to be accepted: a crowd must not keep a hold out */
};

struct FbModbusServer {
    GSocket *listener;
    GSource *accepting, *ticking;
    GMainContext *context;
    FbReceiver *receiver;
    FbModbusSlave *slave;
    FbTls *tls; /* NULL: plain */
    void (*act)(FbDo what, void *data);
    void *data;
    GPtrArray *clients; /* of FbMbap */
    GArray *actions;    /* of FbDo */
    uint64_t refused;   /* handshakes */
};

static void tick(FbModbusServer *s);

static void on_adu(FbMbap *client, const uint8_t *adu, size_t n, void *data)
{
    FbModbusServer *s = data;
    FbModbusAnswer answer;
    fb_modbus_slave_adu(s->slave, fb_mbap_role(client), adu, n, g_get_monotonic_time(), &answer);
    if (answer.times_moved)
        tick(s);
    fb_mbap_send(client, answer.bytes, answer.n);
}

/* ------------------------------------------------------------------- connections */

static void on_broken(FbMbap *client, const char *why, void *data)
{
    (void)why;
    FbModbusServer *s = data;
    if (s->tls && fb_mbap_role(client) == FB_ROLE_NONE)
        s->refused++;
    g_ptr_array_remove_fast(s->clients, client);
}

/* Room for one more that is ready, or that is not: the one of its kind that was silent longest
 * goes. So whoever cannot make itself known closes nobody's connection who has. */
static void make_room(FbModbusServer *s, bool ready, const FbMbap *newcomer)
{
    unsigned n = 0;
    FbMbap *oldest = NULL;
    for (guint i = 0; i < s->clients->len; i++) {
        FbMbap *client = s->clients->pdata[i];
        if (client == newcomer || (fb_mbap_role(client) != FB_ROLE_NONE) != ready)
            continue;
        n++;
        if (!oldest || fb_mbap_heard_us(client) < fb_mbap_heard_us(oldest))
            oldest = client;
    }
    if (n >= MAX_CLIENTS)
        g_ptr_array_remove_fast(s->clients, oldest);
}

static void on_ready(FbMbap *client, void *data)
{
    make_room(data, true, client);
}

static gboolean on_accept(GSocket *listener, GIOCondition condition, gpointer data)
{
    static const FbMbapCallbacks callbacks = {on_ready, on_adu, on_broken};
    (void)condition;
    FbModbusServer *s = data;
    g_autoptr(GSocket) socket = g_socket_accept(listener, NULL, NULL);
    const int fd = socket ? dup(g_socket_get_fd(socket)) : -1;
    if (fd < 0)
        return G_SOURCE_CONTINUE;
    make_room(s, false, NULL);
    g_ptr_array_add(s->clients, fb_mbap_new(fd, s->tls, NULL, &callbacks, s, s->context));
    return G_SOURCE_CONTINUE;
}

static void do_actions(FbModbusServer *s)
{
    for (guint i = 0; i < s->actions->len; i++)
        s->act(g_array_index(s->actions, FbDo, i), s->data);
    g_array_set_size(s->actions, 0);
}

static void tick(FbModbusServer *s)
{
    const int64_t next_us = fb_receiver_tick(s->receiver, g_get_monotonic_time(), s->actions);
    do_actions(s);
    g_source_set_ready_time(s->ticking, next_us);
}

static gboolean on_tick(gpointer data)
{
    tick(data);
    return G_SOURCE_CONTINUE;
}

static gboolean dispatch_tick(GSource *source, GSourceFunc callback, gpointer data)
{
    (void)source;
    return callback(data);
}

/* --------------------------------------------------------------------- life */

static GSocket *listen_on(const char *host, uint16_t port, GError **error)
{
    g_autoptr(GSocketConnectable) name = g_network_address_new(host, port);
    g_autoptr(GSocketAddressEnumerator) each = g_socket_connectable_enumerate(name);
    g_autoptr(GSocketAddress) address = g_socket_address_enumerator_next(each, NULL, error);
    if (!address)
        return NULL;
    g_autoptr(GSocket) socket = g_socket_new(g_socket_address_get_family(address),
                                             G_SOCKET_TYPE_STREAM, G_SOCKET_PROTOCOL_TCP, error);
    if (socket)
        g_socket_set_listen_backlog(socket, BACKLOG);
    if (!socket || !g_socket_bind(socket, address, TRUE, error) || !g_socket_listen(socket, error))
        return NULL;
    g_socket_set_blocking(socket, FALSE);
    return g_steal_pointer(&socket);
}

FbModbusServer *fb_modbus_server_new(const FbModbusServerOptions *options, FbReceiver *receiver,
                                     void (*act)(FbDo what, void *data), void *data,
                                     GMainContext *context, GError **error)
{
    static GSourceFuncs ticks = {.dispatch = dispatch_tick};
    g_autoptr(FbModbusServer) s = g_new0(FbModbusServer, 1);
    s->receiver = receiver;
    s->act = act;
    s->data = data;
    s->slave = fb_modbus_slave_new(options->unit_id, receiver, act, data);
    s->context = context ? g_main_context_ref(context) : NULL;
    s->clients = g_ptr_array_new_with_free_func((GDestroyNotify)fb_mbap_free);
    s->actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    if (options->tls && !(s->tls = fb_tls_new(options->tls, true, error)))
        return NULL;
    s->listener = listen_on(options->host, options->port, error);
    if (!s->listener) {
        g_prefix_error(error, "cannot listen for Modbus on %s:%u: ", options->host, options->port);
        return NULL;
    }
    s->accepting = g_socket_create_source(s->listener, G_IO_IN, NULL);
    g_source_set_callback(s->accepting, G_SOURCE_FUNC(on_accept), s, NULL);
    g_source_attach(s->accepting, context);
    s->ticking = g_source_new(&ticks, sizeof(GSource));
    g_source_set_callback(s->ticking, on_tick, s, NULL);
    g_source_attach(s->ticking, context);
    tick(s);
    return g_steal_pointer(&s);
}

uint16_t fb_modbus_server_port(const FbModbusServer *s)
{
    g_autoptr(GSocketAddress) address = g_socket_get_local_address(s->listener, NULL);
    return address ? g_inet_socket_address_get_port(G_INET_SOCKET_ADDRESS(address)) : 0;
}

uint64_t fb_modbus_server_exceptions(const FbModbusServer *s)
{
    return fb_modbus_slave_exceptions(s->slave);
}

uint64_t fb_modbus_server_refused(const FbModbusServer *s)
{
    return s->refused;
}

static void end_source(GSource *source)
{
    if (!source)
        return;
    g_source_destroy(source);
    g_source_unref(source);
}

void fb_modbus_server_free(FbModbusServer *s)
{
    if (!s)
        return;
    end_source(s->accepting);
    end_source(s->ticking);
    g_ptr_array_unref(s->clients);
    g_array_unref(s->actions);
    g_clear_object(&s->listener);
    fb_tls_unref(s->tls);
    fb_modbus_slave_free(s->slave);
    if (s->context)
        g_main_context_unref(s->context);
    g_free(s);
}
