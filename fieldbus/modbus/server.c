/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's Modbus TCP server, plain or in TLS. mbap.* frames each connection; here an ADU is
 * checked against section 2.9 of docs/protocol.md, its block is written to the receiver, and the
 * registers that it reads are copied out.
 */
#include <gio/gio.h>
#include <modbus.h>
#include <string.h>
#include <unistd.h>

#include "fieldbus/modbus/mbap.h"
#include "fieldbus/receiver.h"

enum {
    CHUNK_BYTES = 218, /* of the stream: what a FC23 can write less the chunk's header */
    WRITE_BYTES = 242, /* what it can write: 121 registers */
    MAX_CLIENTS = 16,  /* that are ready; as many again may be on their way to it */
    BACKLOG = 64,      /* connections that wait to be accepted: a crowd must not keep a hold out */
    READ_MOST = MODBUS_MAX_READ_REGISTERS,
    UNIT_NOT_HERE = MODBUS_EXCEPTION_GATEWAY_TARGET,
};

struct FbModbusServer {
    GSocket *listener;
    GSource *accepting, *ticking;
    GMainContext *context;
    FbReceiver *receiver;
    FbTls *tls; /* NULL: plain */
    void (*act)(FbDo what, void *data);
    void *data;
    int unit_id;
    GPtrArray *clients;  /* of FbMbap */
    GArray *actions;     /* of FbDo */
    uint64_t exceptions; /* answered */
    uint64_t refused;    /* handshakes */
    bool published;      /* ALARM, OFFSETS and TOOLS are in `map`, by these serials */
    uint16_t alarm_serial, setup_serial;
    uint8_t map[2 * FB_N_REGISTERS]; /* as it is read; the blocks that are written stay 0 */
};

/* What an ADU asks for; counts are 0 where it does not read or write. */
typedef struct {
    unsigned read_at, n_read, write_at, n_write;
    const uint8_t *written;
} Wish;

static int parse(const uint8_t *pdu, size_t n, Wish *wish);
static int check(const Wish *wish);
static void write_block(FbModbusServer *s, FbRole role, const Wish *wish);
static size_t answer(FbModbusServer *s, const uint8_t *pdu, const Wish *wish, uint8_t *out);
static void tick(FbModbusServer *s);

static void on_adu(FbMbap *client, const uint8_t *adu, size_t n, void *data)
{
    FbModbusServer *s = data;
    const int unit = adu[6];
    const uint8_t *pdu = adu + FB_MBAP_HEADER_BYTES;
    Wish wish = {0};
    uint8_t out[FB_ADU_BYTES] = {adu[0], adu[1], 0, 0, 0, 0, adu[6]};
    size_t n_out = FB_MBAP_HEADER_BYTES;
    int exception = unit == s->unit_id || unit == 0 || unit == 255 ? 0 : UNIT_NOT_HERE;
    if (!exception)
        exception = parse(pdu, n - FB_MBAP_HEADER_BYTES, &wish);
    if (!exception)
        exception = check(&wish);
    if (exception) {
        s->exceptions++;
        out[n_out++] = pdu[0] | 0x80;
        out[n_out++] = (uint8_t)exception;
    } else {
        if (wish.n_write > 0)
            write_block(s, fb_mbap_role(client), &wish);
        n_out += answer(s, pdu, &wish, out + n_out);
    }
    out[5] = (uint8_t)(n_out - 6);
    fb_mbap_send(client, out, n_out);
}

static unsigned u16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

/* The exception, or 0. */
static int parse(const uint8_t *pdu, size_t n, Wish *w)
{
    const uint8_t *write = NULL; /* at the address of the writing half */
    switch (pdu[0]) {
    case MODBUS_FC_READ_HOLDING_REGISTERS:
    case MODBUS_FC_READ_INPUT_REGISTERS:
        if (n != 5)
            return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
        break;
    case MODBUS_FC_WRITE_MULTIPLE_REGISTERS:
        write = pdu + 1;
        break;
    case MODBUS_FC_WRITE_AND_READ_REGISTERS:
        write = pdu + 5;
        break;
    default:
        return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
    }
    const unsigned most =
        write == pdu + 1 ? MODBUS_MAX_WRITE_REGISTERS : MODBUS_MAX_WR_WRITE_REGISTERS;
    if (write) {
        const size_t head = (size_t)(write - pdu) + 5;
        if (n < head || u16(write + 2) < 1 || u16(write + 2) > most ||
            write[4] != 2 * u16(write + 2) || n != head + write[4])
            return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
        *w = (Wish){.write_at = u16(write), .n_write = u16(write + 2), .written = write + 5};
    }
    if (write != pdu + 1) {
        w->read_at = u16(pdu + 1);
        w->n_read = u16(pdu + 3);
        if (w->n_read < 1 || w->n_read > READ_MOST)
            return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
    }
    return 0;
}

/* The blocks that may be written. */
static const struct {
    FbBlock block;
    unsigned at, fewest, most;
} blocks[] = {
    {FB_BLOCK_COMMAND, FB_AT_COMMAND, FB_COMMAND_BYTES / 2, WRITE_BYTES / 2},
    {FB_BLOCK_CHUNK, FB_AT_CHUNK, FB_CHUNK_HEADER_BYTES / 2 + 1, WRITE_BYTES / 2},
    {FB_BLOCK_BEAT, FB_AT_BEAT, FB_BEAT_BYTES / 2, FB_BEAT_BYTES / 2},
};

/* The block that the wish writes; G_N_ELEMENTS(blocks) where there is none. */
static size_t find_block(const Wish *w)
{
    size_t i = 0;
    while (i < G_N_ELEMENTS(blocks) &&
           !(w->write_at == blocks[i].at && w->n_write >= blocks[i].fewest &&
             w->n_write <= blocks[i].most))
        i++;
    return i;
}

static int check(const Wish *w)
{
    if (w->n_read > 0 && w->read_at + w->n_read > FB_N_REGISTERS)
        return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    if (w->n_write > 0 && find_block(w) == G_N_ELEMENTS(blocks))
        return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    return 0;
}

static void do_actions(FbModbusServer *s)
{
    for (guint i = 0; i < s->actions->len; i++)
        s->act(g_array_index(s->actions, FbDo, i), s->data);
    g_array_set_size(s->actions, 0);
}

static void write_block(FbModbusServer *s, FbRole role, const Wish *w)
{
    const FbBlock block = blocks[find_block(w)].block;
    fb_receiver_write(s->receiver, role, block, w->written, 2 * (size_t)w->n_write,
                      g_get_monotonic_time(), s->actions);
    do_actions(s);
    if (block != FB_BLOCK_CHUNK) /* the lease's times may have moved */
        tick(s);
}

/* The map as it is now. What changes seldom has a serial number. */
static void publish(FbModbusServer *s)
{
    FbStatus status;
    const FbSetup *setup = fb_receiver_setup(s->receiver);
    fb_receiver_status(s->receiver, g_get_monotonic_time(), &status);
    status.chunk_max = CHUNK_BYTES;
    fb_wire_put_status(s->map + 2 * FB_AT_STATUS, &status);
    if (!s->published || status.alarm_serial != s->alarm_serial)
        fb_wire_put_alarm(s->map + 2 * FB_AT_ALARM, &status);
    if (!s->published || setup->serial != s->setup_serial) {
        fb_wire_put_offsets(s->map + 2 * FB_AT_OFFSETS, setup);
        for (unsigned page = 0; page < FB_TOOLS_PAGES; page++)
            fb_wire_put_tools(s->map + 2 * (FB_AT_TOOLS + page * FB_TOOLS_PAGE_REGISTERS), setup,
                              page);
    }
    s->published = true;
    s->alarm_serial = status.alarm_serial;
    s->setup_serial = setup->serial;
}

/* The PDU of the answer; its length. */
static size_t answer(FbModbusServer *s, const uint8_t *pdu, const Wish *w, uint8_t *out)
{
    out[0] = pdu[0];
    if (w->n_read == 0) {
        memcpy(out + 1, pdu + 1, 4); /* where, and how many */
        return 5;
    }
    publish(s);
    out[1] = (uint8_t)(2 * w->n_read);
    memcpy(out + 2, s->map + 2 * w->read_at, out[1]);
    return 2 + (size_t)out[1];
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
    s->unit_id = options->unit_id;
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
    return s->exceptions;
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
    if (s->context)
        g_main_context_unref(s->context);
    g_free(s);
}
