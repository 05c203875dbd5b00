/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's Modbus TCP server, plain or in TLS: who is connected, and when the receiver is to
 * be ticked. mbap.* frames each connection, slave.* answers its ADUs.
 */
#include <errno.h>
#include <gio/gio.h>
#include <sys/socket.h>

#include "fieldbus/modbus/slave.h"
#include "fieldbus/replies.h"
#include "fieldbus/source.h"

enum {
    MAX_CLIENTS = 16, /* that are ready; as many again may be on their way to it */
    BACKLOG = 64,     /* connections that wait to be accepted: a crowd must not keep a hold out */
    RETRY_US = 100000,
};

struct FbModbusServer {
    GSocket *listener;
    GSource *accepting, *ticking;
    gpointer listening; /* the listener in `accepting` */
    GMainContext *context;
    FbReceiver *receiver;
    FbModbusSlave *slave;
    FbReplies *replies;
    FbTls *tls; /* NULL: plain */
    void (*act)(FbDo what, void *data);
    void *data;
    GPtrArray *clients; /* of FbMbap */
    GArray *actions;    /* of FbDo */
    uint64_t refused;   /* handshakes, and those that were put out */
};

static void tick(FbModbusServer *s);
static void drop(FbModbusServer *s, FbMbap *client);

static void on_adu(FbMbap *client, const uint8_t *adu, size_t n, void *data)
{
    FbModbusServer *s = data;
    FbModbusAnswer answer;
    fb_modbus_slave_adu(s->slave, fb_mbap_role(client), adu, n, g_get_monotonic_time(), &answer);
    if (answer.times_moved)
        tick(s);
    if (!fb_replies_send(s->replies, client, answer.bytes, answer.n))
        drop(s, client);
}

static void send_reply(void *client, const uint8_t *bytes, size_t n, void *data)
{
    (void)data;
    fb_mbap_send(client, bytes, n);
}

/* ------------------------------------------------------------------- connections */

static void on_broken(FbMbap *client, const char *why, void *data)
{
    (void)why;
    FbModbusServer *s = data;
    if (s->tls && fb_mbap_role(client) == FB_ROLE_NONE)
        s->refused++;
    drop(s, client);
}

static void drop(FbModbusServer *s, FbMbap *client)
{
    fb_replies_forget(s->replies, client);
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
    if (n < MAX_CLIENTS)
        return;
    if (s->tls && !ready)
        s->refused++;
    drop(s, oldest);
}

static void on_ready(FbMbap *client, void *data)
{
    make_room(data, true, client);
}

/* Whether connections are waited for; else they are looked for after a while. */
static void listen_for_more(FbModbusServer *s, bool now)
{
    g_source_modify_unix_fd(s->accepting, s->listening, now ? G_IO_IN : 0);
    g_source_set_ready_time(s->accepting, now ? -1 : g_get_monotonic_time() + RETRY_US);
}

static void on_accept(void *data)
{
    static const FbMbapCallbacks callbacks = {on_ready, on_adu, on_broken};
    FbModbusServer *s = data;
    const int fd = accept4(g_socket_get_fd(s->listener), NULL, NULL, SOCK_CLOEXEC);
    if (fd < 0) {
        /* One that waits where no descriptor is left would wake the main loop for ever. */
        const bool full = errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM;
        listen_for_more(s, !full);
        return;
    }
    if (g_source_get_ready_time(s->accepting) >= 0)
        listen_for_more(s, true);
    make_room(s, false, NULL);
    g_ptr_array_add(s->clients, fb_mbap_new(fd, s->tls, NULL, &callbacks, s, s->context));
}

static void tick(FbModbusServer *s)
{
    const int64_t next_us = fb_receiver_tick(s->receiver, g_get_monotonic_time(), s->actions);
    fb_do_actions(s->actions, s->act, s->data);
    g_source_set_ready_time(s->ticking, next_us);
}

static void on_tick(void *data)
{
    tick(data);
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
    g_autoptr(FbModbusServer) s = g_new0(FbModbusServer, 1);
    s->receiver = receiver;
    s->act = act;
    s->data = data;
    s->replies = fb_replies_new(send_reply, NULL, context);
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
    s->accepting = fb_source_new(on_accept, s, context);
    s->listening = g_source_add_unix_fd(s->accepting, g_socket_get_fd(s->listener), G_IO_IN);
    s->ticking = fb_source_new(on_tick, s, context);
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

void fb_modbus_server_filter(FbModbusServer *s, FbReplyFilter filter, void *data)
{
    fb_replies_filter(s->replies, filter, data);
}

void fb_modbus_server_free(FbModbusServer *s)
{
    if (!s)
        return;
    fb_source_end(&s->accepting);
    fb_source_end(&s->ticking);
    g_ptr_array_unref(s->clients);
    g_array_unref(s->actions);
    g_clear_object(&s->listener);
    fb_tls_unref(s->tls);
    fb_replies_free(s->replies);
    fb_modbus_slave_free(s->slave);
    if (s->context)
        g_main_context_unref(s->context);
    g_free(s);
}
