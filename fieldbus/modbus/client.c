/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/modbus/client.h"

#include <fcntl.h>
#include <gio/gio.h>
#include <modbus.h>
#include <string.h>
#include <unistd.h>

#include "fieldbus/bytes.h"
#include "fieldbus/modbus/mbap.h"

enum { PLAIN_PORT = 502, TLS_PORT = 802 };

typedef struct FbModbusClient FbModbusClient;

/* A connect that is on its way; outlives a client that no longer wants it. */
typedef struct {
    FbModbusClient *client; /* NULL: nobody waits */
    GCancellable *cancellable;
} Attempt;

/* A request without its answer. */
typedef struct {
    uint16_t transaction;
    uint8_t function;
    size_t n_read; /* registers */
} Flight;

struct FbModbusClient {
    FbDriver *driver;
    char *host;
    uint16_t port;
    uint8_t unit_id;
    FbTls *tls; /* NULL: plain */
    Attempt *attempt;
    FbMbap *mbap; /* NULL: not connected */
    uint16_t transaction;
    Flight flights[FB_WINDOW_MOST]; /* oldest first: the machine answers in order */
    unsigned n_flights;
};

static void disconnect(void *transport);

/* ------------------------------------------------------------------- requests */

static void send_request(void *transport, const FbRequest *request)
{
    FbModbusClient *c = transport;
    static const uint16_t written[] = {[FB_REQUEST_COMMAND] = FB_AT_COMMAND,
                                       [FB_REQUEST_CHUNK] = FB_AT_CHUNK,
                                       [FB_REQUEST_BEAT] = FB_AT_BEAT};
    static const uint8_t answers[] = {
        [FB_REQUEST_STATUS] = FB_STATUS_BYTES,   [FB_REQUEST_ALARM] = FB_ALARM_BYTES,
        [FB_REQUEST_OFFSETS] = FB_OFFSETS_BYTES, [FB_REQUEST_TOOLS] = FB_TOOLS_BYTES,
        [FB_REQUEST_COMMAND] = FB_STATUS_BYTES,  [FB_REQUEST_CHUNK] = FB_STATUS_BYTES,
        [FB_REQUEST_BEAT] = FB_STATUS_BYTES};
    uint8_t adu[FB_ADU_BYTES];
    if (!c->mbap || c->n_flights == FB_WINDOW_MOST)
        return;
    g_assert(request->n <= FB_CHUNK_HEADER_BYTES + FB_MODBUS_CHUNK_BYTES);
    Flight *flight = &c->flights[c->n_flights++];
    *flight = (Flight){++c->transaction,
                       request->n > 0 ? MODBUS_FC_WRITE_AND_READ_REGISTERS
                                      : MODBUS_FC_READ_HOLDING_REGISTERS,
                       answers[request->kind] / 2};
    uint8_t *p = fb_put16(fb_put16(adu, flight->transaction), 0) + 2;
    *p++ = c->unit_id;
    *p++ = flight->function;
    p = fb_put16(fb_put16(p, fb_request_register(request)), flight->n_read);
    if (request->n > 0) {
        p = fb_put16(fb_put16(p, written[request->kind]), request->n / 2);
        *p++ = (uint8_t)request->n;
        memcpy(p, request->bytes, request->n);
        p += request->n;
    }
    fb_put16(adu + 4, (size_t)(p - adu) - 6);
    fb_mbap_send(c->mbap, adu, (size_t)(p - adu));
}

static void on_adu(FbMbap *mbap, const uint8_t *adu, size_t n, void *data)
{
    (void)mbap;
    FbModbusClient *c = data;
    const uint8_t *pdu = adu + FB_MBAP_HEADER_BYTES;
    const size_t n_pdu = n - FB_MBAP_HEADER_BYTES;
    const Flight f = c->flights[0];
    if (c->n_flights == 0 || fb_get16(adu) != f.transaction || adu[6] != c->unit_id) {
        fb_driver_broken(c->driver, "an answer to another request");
    } else if (n_pdu == 2 && pdu[0] == (f.function | 0x80)) {
        g_autofree char *why = g_strdup_printf("Modbus exception %d: is this the right port and "
                                               "unit?",
                                               pdu[1]);
        fb_driver_broken(c->driver, why);
    } else if (pdu[0] != f.function || n_pdu != 2 + 2 * f.n_read || pdu[1] != 2 * f.n_read) {
        fb_driver_broken(c->driver, "an answer that is not Modbus");
    } else {
        memmove(c->flights, c->flights + 1, --c->n_flights * sizeof f);
        fb_driver_event(c->driver,
                        &(FbEvent){.kind = FB_EVENT_REPLY, .bytes = pdu + 2, .n = 2 * f.n_read});
    }
}

static void on_broken(FbMbap *mbap, const char *why, void *data)
{
    (void)mbap;
    FbModbusClient *c = data;
    disconnect(c);
    fb_driver_broken(c->driver, why);
}

/* ------------------------------------------------------------------ connection */

static void on_ready(FbMbap *mbap, void *data)
{
    (void)mbap;
    FbModbusClient *c = data;
    fb_driver_event(c->driver, &(FbEvent){.kind = FB_EVENT_CONNECTED});
}

static void on_connected(GObject *object, GAsyncResult *result, gpointer data)
{
    static const FbMbapCallbacks callbacks = {on_ready, on_adu, on_broken};
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
    const int fd = connection ? fcntl(g_socket_get_fd(g_socket_connection_get_socket(connection)),
                                      F_DUPFD_CLOEXEC, 0)
                              : -1;
    if (fd < 0) {
        fb_driver_broken(c->driver, error ? error->message : "no file descriptor is left");
        return;
    }
    c->mbap = fb_mbap_new(fd, c->tls, c->host, &callbacks, c, fb_driver_context(c->driver));
}

static void connect_to(void *transport)
{
    FbModbusClient *c = transport;
    GMainContext *context = fb_driver_context(c->driver);
    g_autoptr(GSocketClient) client = g_socket_client_new();
    g_socket_client_set_enable_proxy(client, FALSE);
    c->attempt = g_new(Attempt, 1);
    *c->attempt = (Attempt){.client = c, .cancellable = g_cancellable_new()};
    g_main_context_push_thread_default(context);
    g_socket_client_connect_to_host_async(client, c->host, c->port, c->attempt->cancellable,
                                          on_connected, c->attempt);
    g_main_context_pop_thread_default(context);
}

static void disconnect(void *transport)
{
    FbModbusClient *c = transport;
    Attempt *attempt = g_steal_pointer(&c->attempt);
    if (attempt) {
        attempt->client = NULL;
        g_cancellable_cancel(attempt->cancellable);
    }
    fb_mbap_free(g_steal_pointer(&c->mbap));
    c->n_flights = 0;
}

/* ----------------------------------------------------------------------- life */

static void free_client(void *transport)
{
    FbModbusClient *c = transport;
    disconnect(c);
    fb_tls_unref(c->tls);
    g_free(c->host);
    g_free(c);
}

bool fb_is_loopback(const char *host)
{
    g_autoptr(GInetAddress) address = g_inet_address_new_from_string(host);
    return address ? g_inet_address_get_is_loopback(address) : strcmp(host, "localhost") == 0;
}

static bool parse_address(FbModbusClient *c, const char *address, bool *secure, GError **error)
{
    static const char plain[] = "modbus://", tls[] = "mbaps://";
    g_autoptr(GSocketConnectable) name = NULL;
    *secure = g_str_has_prefix(address, tls);
    if (*secure)
        name = g_network_address_parse(address + strlen(tls), TLS_PORT, error);
    else if (g_str_has_prefix(address, plain))
        name = g_network_address_parse(address + strlen(plain), PLAIN_PORT, error);
    else
        g_set_error(error, FB_ERROR, FB_ERROR_UNREACHABLE,
                    "write modbus://HOST:PORT, mbaps://HOST:PORT or can://INTERFACE");
    if (!name) {
        g_prefix_error(error, "%s is not an address of a machine: ", address);
        return false;
    }
    c->host = g_strdup(g_network_address_get_hostname(G_NETWORK_ADDRESS(name)));
    c->port = g_network_address_get_port(G_NETWORK_ADDRESS(name));
    return true;
}

bool fb_modbus_client_attach(FbDriver *driver, const CfgTarget *target, GError **error)
{
    static const FbTransport transport = {connect_to, disconnect, send_request, free_client};
    FbModbusClient *c = g_new0(FbModbusClient, 1);
    bool secure;
    c->driver = driver;
    c->unit_id = (uint8_t)target->unit_id;
    bool ok = parse_address(c, target->address, &secure, error);
    if (ok && secure) {
        c->tls = fb_tls_new(&target->tls, false, error);
        ok = c->tls != NULL;
    } else if (ok && !target->plain && !fb_is_loopback(c->host)) {
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                    "%s: plain Modbus beyond this host is open to everybody on the way: use "
                    "mbaps://, or set plain = true for this machine in the agent's configuration",
                    target->address);
        ok = false;
    }
    if (!ok) {
        free_client(c);
        return false;
    }
    fb_delivery_limit_chunks(fb_driver_delivery(driver), FB_MODBUS_CHUNK_BYTES);
    fb_driver_set_transport(driver, &transport, c);
    return true;
}
