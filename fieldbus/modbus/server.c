/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's Modbus TCP server. mbap.* frames each connection; here an ADU is checked against
 * section 2.7 of docs/protocol.md, its block is written to the receiver, and libmodbus answers it
 * from the registers. libmodbus blocks on a slow peer and believes any length, so it sits behind a
 * socketpair and sees one whole, checked ADU at a time.
 */
#include <errno.h>
#include <gio/gio.h>
#include <modbus.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fieldbus/modbus/mbap.h"
#include "fieldbus/receiver.h"

enum {
    CHUNK_BYTES = 218, /* of the stream: what a FC23 can write less the chunk's header */
    WRITE_BYTES = 242, /* what it can write: 121 registers */
    MAX_CLIENTS = 16,
    BACKLOG = 64, /* connections that wait to be accepted: a crowd must not keep a hold out */
    READ_MOST = MODBUS_MAX_READ_REGISTERS,
    UNIT_NOT_HERE = MODBUS_EXCEPTION_GATEWAY_TARGET,
};

struct FbModbusServer {
    GSocket *listener;
    GSource *accepting, *ticking;
    GMainContext *context;
    FbReceiver *receiver;
    void (*act)(FbDo what, void *data);
    void *data;
    int unit_id;
    GPtrArray *clients;  /* of FbMbap */
    GArray *actions;     /* of FbDo */
    uint64_t exceptions; /* answered */
    modbus_t *modbus;
    int modbus_fd; /* our end of its socketpair */
    modbus_mapping_t map;
    uint16_t registers[FB_N_REGISTERS];
};

/* What an ADU asks for; counts are 0 where it does not read or write. */
typedef struct {
    unsigned read_at, n_read, write_at, n_write;
    const uint8_t *written;
} Wish;

static int parse(const uint8_t *pdu, size_t n, Wish *wish);
static int check(const Wish *wish);
static void write_block(FbModbusServer *s, const Wish *wish);
static size_t answer(FbModbusServer *s, const uint8_t *adu, size_t n, uint8_t *out);
static void tick(FbModbusServer *s);

static void on_adu(FbMbap *client, const uint8_t *adu, size_t n, void *data)
{
    FbModbusServer *s = data;
    const int unit = adu[6];
    const uint8_t *pdu = adu + FB_MBAP_HEADER_BYTES;
    Wish wish = {0};
    uint8_t out[FB_ADU_BYTES];
    size_t n_out;
    int exception = unit == s->unit_id || unit == 0 || unit == 255 ? 0 : UNIT_NOT_HERE;
    if (!exception)
        exception = parse(pdu, n - FB_MBAP_HEADER_BYTES, &wish);
    if (!exception)
        exception = check(&wish);
    if (exception) {
        s->exceptions++;
        const uint8_t refusal[] = {
            adu[0], adu[1], 0, 0, 0, 3, adu[6], pdu[0] | 0x80, (uint8_t)exception};
        n_out = sizeof refusal;
        memcpy(out, refusal, n_out);
    } else {
        if (wish.n_write > 0)
            write_block(s, &wish);
        n_out = answer(s, adu, n, out);
    }
    if (n_out > 0)
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

static void write_block(FbModbusServer *s, const Wish *w)
{
    const FbBlock block = blocks[find_block(w)].block;
    fb_receiver_write(s->receiver, FB_ROLE_PROGRAMMER, block, w->written, 2 * (size_t)w->n_write,
                      g_get_monotonic_time(), s->actions);
    do_actions(s);
    if (block != FB_BLOCK_CHUNK) /* the lease's times may have moved */
        tick(s);
}

static void load(uint16_t *registers, const uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i < n; i += 2)
        *registers++ = (uint16_t)u16(bytes + i);
}

static void load_setup(FbModbusServer *s)
{
    uint8_t block[FB_BLOCK_BYTES];
    const FbSetup *setup = fb_receiver_setup(s->receiver);
    load(s->registers + FB_AT_OFFSETS, block, fb_wire_put_offsets(block, setup));
    for (unsigned page = 0; page < FB_TOOLS_PAGES; page++)
        load(s->registers + FB_AT_TOOLS + page * FB_TOOLS_PAGE_REGISTERS, block,
             fb_wire_put_tools(block, setup, page));
}

/* The bytes of libmodbus' answer; 0 where it has none. */
static size_t answer(FbModbusServer *s, const uint8_t *adu, size_t n, uint8_t *out)
{
    FbStatus status;
    uint8_t block[FB_BLOCK_BYTES], request[MODBUS_TCP_MAX_ADU_LENGTH];
    fb_receiver_status(s->receiver, g_get_monotonic_time(), &status);
    status.chunk_max = CHUNK_BYTES;
    load(s->registers + FB_AT_STATUS, block, fb_wire_put_status(block, &status));
    load(s->registers + FB_AT_ALARM, block, fb_wire_put_alarm(block, &status));
    load_setup(s);
    ssize_t got = -1;
    if (send(s->modbus_fd, adu, n, MSG_NOSIGNAL) == (ssize_t)n) {
        const int taken = modbus_receive(s->modbus, request);
        if (taken > 0 && modbus_reply(s->modbus, request, taken, &s->map) > 0)
            got = recv(s->modbus_fd, out, FB_ADU_BYTES, MSG_DONTWAIT);
    }
    /* What was written is the receiver's now: nobody reads a token back. */
    memset(s->registers + FB_AT_COMMAND, 0, (FB_N_REGISTERS - FB_AT_COMMAND) * 2);
    return got > 0 ? (size_t)got : 0;
}

/* ------------------------------------------------------------------- connections */

static void on_broken(FbMbap *client, const char *why, void *data)
{
    (void)why;
    FbModbusServer *s = data;
    g_ptr_array_remove_fast(s->clients, client);
}

/* Room for one more: the one that was silent longest goes. */
static void make_room(FbModbusServer *s)
{
    guint oldest = 0;
    if (s->clients->len < MAX_CLIENTS)
        return;
    for (guint i = 1; i < s->clients->len; i++)
        if (fb_mbap_heard_us(s->clients->pdata[i]) < fb_mbap_heard_us(s->clients->pdata[oldest]))
            oldest = i;
    g_ptr_array_remove_index_fast(s->clients, oldest);
}

static gboolean on_accept(GSocket *listener, GIOCondition condition, gpointer data)
{
    static const FbMbapCallbacks callbacks = {.adu = on_adu, .broken = on_broken};
    (void)condition;
    FbModbusServer *s = data;
    g_autoptr(GSocket) socket = g_socket_accept(listener, NULL, NULL);
    const int fd = socket ? dup(g_socket_get_fd(socket)) : -1;
    if (fd < 0)
        return G_SOURCE_CONTINUE;
    make_room(s);
    g_ptr_array_add(s->clients, fb_mbap_new(fd, &callbacks, s, s->context));
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

static bool put_libmodbus_behind_a_socketpair(FbModbusServer *s, GError **error)
{
    int pair[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0) {
        g_set_error(error, FB_ERROR, FB_ERROR_UNREACHABLE, "no socketpair: %s", g_strerror(errno));
        return false;
    }
    s->modbus_fd = pair[0];
    s->modbus = modbus_new_tcp("127.0.0.1", 0);
    modbus_set_socket(s->modbus, pair[1]);
    s->map = (modbus_mapping_t){.nb_registers = FB_N_REGISTERS,
                                .nb_input_registers = FB_N_REGISTERS,
                                .tab_registers = s->registers,
                                .tab_input_registers = s->registers};
    return true;
}

FbModbusServer *fb_modbus_server_new(const char *host, uint16_t port, int unit_id,
                                     FbReceiver *receiver, void (*act)(FbDo what, void *data),
                                     void *data, GMainContext *context, GError **error)
{
    static GSourceFuncs ticks = {.dispatch = dispatch_tick};
    g_autoptr(FbModbusServer) s = g_new0(FbModbusServer, 1);
    s->modbus_fd = -1;
    s->receiver = receiver;
    s->act = act;
    s->data = data;
    s->unit_id = unit_id;
    s->context = context ? g_main_context_ref(context) : NULL;
    s->clients = g_ptr_array_new_with_free_func((GDestroyNotify)fb_mbap_free);
    s->actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    s->listener = listen_on(host, port, error);
    if (!s->listener) {
        g_prefix_error(error, "cannot listen for Modbus on %s:%u: ", host, port);
        return NULL;
    }
    if (!put_libmodbus_behind_a_socketpair(s, error))
        return NULL;
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
    if (s->modbus) {
        modbus_close(s->modbus); /* with its end of the socketpair */
        modbus_free(s->modbus);
        close(s->modbus_fd);
    }
    if (s->context)
        g_main_context_unref(s->context);
    g_free(s);
}
