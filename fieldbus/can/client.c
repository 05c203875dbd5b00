/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/can/client.h"

#include <errno.h>
#include <glib-unix.h>
#include <poll.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "fieldbus/bytes.h"
#include "fieldbus/source.h"

enum { CLASSIC, FD, FRAMES, N_FILES, LEAVE_MS = 100 };

typedef enum { CLOSED, ASKED, OPEN } Phase; /* ASKED: HELLO was sent, WELCOME has not come */

typedef struct {
    FbDriver *driver;
    FbCanAgent *agent;
    FbCanChannel channel;
    uint16_t id; /* of requests */
    int files[N_FILES];
    GSource *sources[N_FILES];
    bool worn;     /* the bus broke under the files: they are opened anew */
    GSource *late; /* tells of what went wrong inside a call of the driver */
    char *why;

    Phase phase;
    uint8_t nonce[FB_CAN_NONCE_BYTES];
    bool fd; /* messages go in FD frames */
    FbCanKeys keys;
    uint32_t counter;       /* of the last request */
    uint32_t awaited;       /* that of the answer; 0: none */
    FbCanKind awaited_kind; /* and what it should be */
    FbCanKey beat_key;      /* of the machine's beats, */
    uint32_t next_beat;     /* from this count on */
    FbCanMachineBeat heard; /* the last one, */
    bool heard_new;         /* not compared with the status yet */
} Client;

static void on_message(Client *c, unsigned which, const uint8_t *bytes, size_t n);
static void on_beat(Client *c, const FbCanFrame *frame);
static void weigh_beat(Client *c);
static void disconnect(void *transport);

/* ------------------------------------------------------------------------- breaking */

static void break_now(Client *c, const char *why)
{
    disconnect(c);
    fb_driver_broken(c->driver, why);
}

static gboolean on_late(gpointer data)
{
    Client *c = data;
    g_autofree char *why = g_steal_pointer(&c->why);
    break_now(c, why);
    return G_SOURCE_REMOVE;
}

/* As break_now, from the main loop: the driver does not want to hear it while it calls. */
static void break_late(Client *c, char *why)
{
    g_free(c->why);
    c->why = why;
    if (c->late)
        return;
    c->late = g_idle_source_new();
    g_source_set_priority(c->late, G_PRIORITY_DEFAULT);
    g_source_set_callback(c->late, on_late, c, NULL);
    g_source_attach(c->late, fb_driver_context(c->driver));
}

/* ------------------------------------------------------------------------- requests */

static FbCanKind answer_to(FbRequestKind kind)
{
    switch (kind) {
    case FB_REQUEST_ALARM:
        return FB_CAN_ALARM;
    case FB_REQUEST_OFFSETS:
        return FB_CAN_OFFSETS;
    case FB_REQUEST_TOOLS:
        return FB_CAN_TOOLS;
    case FB_REQUEST_CHUNK:
        return FB_CAN_ACK;
    default:
        return FB_CAN_STATUS;
    }
}

/* Kind and body; returns their length. */
static size_t put_message(uint8_t *out, const FbRequest *request)
{
    static const FbCanKind written[] = {[FB_REQUEST_COMMAND] = FB_CAN_COMMAND,
                                        [FB_REQUEST_CHUNK] = FB_CAN_CHUNK,
                                        [FB_REQUEST_BEAT] = FB_CAN_BEAT};
    FbChunk chunk;
    size_t n = request->n;
    if (n == 0) {
        out[0] = FB_CAN_READ;
        fb_put16(out + 1, fb_request_register(request));
        return 3;
    }
    if (request->kind == FB_REQUEST_CHUNK &&
        fb_wire_get_chunk(request->bytes, n, &chunk) == FB_ANSWER_DONE)
        n -= chunk.length % 2; /* the byte that makes it even stays here */
    out[0] = (uint8_t)written[request->kind];
    memcpy(out + 1, request->bytes, n);
    return 1 + n;
}

/* HOLD and ABORT, as a frame that goes before all others; false where it is neither. */
static bool send_stop(Client *c, const FbRequest *request, bool *sent)
{
    FbOrder order;
    uint8_t frame[FB_CAN_FRAME_BYTES];
    if (c->channel != FB_CAN_CONTROL_CHANNEL || request->kind != FB_REQUEST_COMMAND ||
        fb_wire_get_order(request->bytes, request->n, &order) != FB_ANSWER_DONE ||
        !fb_command_stops(order.command) || order.seq > FB_CAN_SEQ_MOST)
        return false;
    fb_can_put_stop(frame, order.command, order.seq, &c->keys.agent);
    c->awaited = fb_can_stop_counter(order.seq);
    *sent = fb_can_write_frame(c->files[FRAMES],
                               (uint16_t)(c->agent->base + FB_CAN_ID_STOP + c->agent->number),
                               frame, sizeof frame);
    return true;
}

static void send_request(void *transport, const FbRequest *request)
{
    Client *c = transport;
    uint8_t message[FB_CAN_MESSAGE_BYTES];
    bool sent;
    if (c->phase != OPEN)
        return;
    if (c->counter == FB_CAN_COUNTER_MOST) {
        break_late(c, g_strdup("the channel's counter is used up"));
        return;
    }
    c->awaited_kind = answer_to(request->kind);
    if (!send_stop(c, request, &sent)) {
        const size_t n = put_message(message, request);
        c->awaited = ++c->counter;
        sent = fb_can_write_message(c->files[c->fd ? FD : CLASSIC], message,
                                    fb_can_seal(message, n, c->counter, &c->keys.agent));
    }
    if (!sent)
        break_late(c, g_strdup_printf("the CAN bus takes nothing: %s", g_strerror(errno)));
}

/* ------------------------------------------------------------------------- answers */

static void take_welcome(Client *c, const uint8_t *bytes, size_t n)
{
    FbCanWelcome w;
    if (!fb_can_get_welcome(bytes, n, &c->agent->key, c->id, c->nonce, &w))
        return; /* a stranger's, or of an earlier HELLO */
    if (w.version >> 8 != FB_PROTOCOL_VERSION >> 8) {
        g_autofree char *why = g_strdup_printf("the machine speaks version %d.%d of the protocol",
                                               w.version >> 8, w.version & 255);
        break_now(c, why);
        return;
    }
    fb_can_derive(&c->keys, &c->agent->key, c->id, c->nonce, w.nonce);
    fb_can_beat_key(&c->beat_key, &c->agent->key, w.epoch);
    c->next_beat = w.beat_count;
    c->heard_new = false;
    c->fd = w.flags & FB_CAN_FLAG_FD && c->files[FD] >= 0;
    c->counter = c->awaited = 0;
    c->phase = OPEN;
    fb_driver_event(c->driver, &(FbEvent){.kind = FB_EVENT_CONNECTED});
}

/* What is not sealed with the keys of this opening, or answers something else, was not said to us:
 * only the time-out ends the waiting for what was. */
static void on_message(Client *c, unsigned which, const uint8_t *bytes, size_t n)
{
    uint32_t counter;
    if (c->phase == ASKED && which == CLASSIC) {
        take_welcome(c, bytes, n);
        return;
    }
    if (c->phase != OPEN || which != (c->fd ? FD : CLASSIC) || c->awaited == 0 ||
        n > FB_CAN_MESSAGE_BYTES || !fb_can_unseal(bytes, n, &c->keys.machine, &counter) ||
        counter != c->awaited)
        return;
    c->awaited = 0;
    if (bytes[0] != c->awaited_kind) {
        break_now(c, "an answer that the protocol does not allow");
        return;
    }
    fb_driver_event(
        c->driver,
        &(FbEvent){.kind = FB_EVENT_REPLY, .bytes = bytes + 1, .n = n - 1 - FB_CAN_SEAL_BYTES});
    weigh_beat(c);
}

static gboolean on_readable(gint file, GIOCondition condition, gpointer data)
{
    (void)condition;
    Client *c = data;
    uint8_t bytes[FB_CAN_MESSAGE_BYTES + 1];
    size_t n = sizeof bytes;
    const unsigned which = file == c->files[FD] ? FD : CLASSIC;
    switch (fb_can_read_message(file, bytes, &n)) {
    case FB_CAN_READ_DONE:
        on_message(c, which, bytes, n);
        break;
    case FB_CAN_READ_TORN:
        if (c->phase == ASKED || c->awaited != 0)
            break_now(c, errno == ECOMM ? "nobody on the CAN bus takes the message"
                                        : "a CAN message was torn");
        break;
    case FB_CAN_READ_BROKEN:
        c->worn = true;
        break_now(c, "the CAN bus is down");
        break;
    case FB_CAN_READ_NONE:
        break;
    }
    return G_SOURCE_CONTINUE;
}

/* --------------------------------------------------------------------------- frames */

/* A beat decides nothing: where it says something else than the status, that is read again. Not
 * before the answer that is awaited: it may say the same. Commands look for themselves, so the
 * channel that only carries commands is content with the beat. */
static void weigh_beat(Client *c)
{
    const FbStatus *status = fb_delivery_status(fb_driver_delivery(c->driver));
    if (c->phase != OPEN || c->awaited != 0 || !c->heard_new)
        return;
    c->heard_new = false;
    if (c->channel == FB_CAN_CONTROL_CHANNEL)
        fb_driver_event(c->driver, &(FbEvent){.kind = FB_EVENT_ALIVE});
    else if (c->heard.state != status->state || c->heard.flags != (uint8_t)fb_wire_flags(status))
        fb_driver_event(c->driver, &(FbEvent){.kind = FB_EVENT_NEWS});
}

static void on_beat(Client *c, const FbCanFrame *frame)
{
    FbCanMachineBeat beat;
    if (c->phase != OPEN || frame->n != FB_CAN_FRAME_BYTES ||
        !fb_can_get_beat(frame->bytes, &c->beat_key, c->next_beat, &beat))
        return;
    c->next_beat = beat.count + 1;
    c->heard = beat;
    c->heard_new = true;
    weigh_beat(c);
}

static gboolean on_frame(gint file, GIOCondition condition, gpointer data)
{
    (void)condition;
    Client *c = data;
    FbCanFrame frame;
    const FbCanRead got = fb_can_read_frame(file, &frame);
    if (got == FB_CAN_READ_DONE && frame.errors == 0) {
        on_beat(c, &frame);
    } else if (got == FB_CAN_READ_BROKEN ||
               (got == FB_CAN_READ_DONE && frame.errors >> FB_CAN_ERROR_BUS_OFF & 1)) {
        c->worn = true;
        break_now(c, got == FB_CAN_READ_DONE ? "the CAN bus is off" : "the CAN bus is down");
    }
    return G_SOURCE_CONTINUE;
}

/* ------------------------------------------------------------------------ connection */

static void close_files(Client *c)
{
    for (unsigned i = 0; i < N_FILES; i++) {
        fb_source_end(&c->sources[i]);
        if (c->files[i] >= 0)
            close(c->files[i]);
        c->files[i] = -1;
    }
}

static bool open_files(Client *c, GError **error)
{
    const FbCanBus *bus = &c->agent->bus;
    const uint16_t takes = (uint16_t)(c->id + FB_CAN_ID_ANSWER);
    c->files[FRAMES] =
        bus->open_frames(bus->data, (uint16_t)(c->agent->base + FB_CAN_ID_BEAT), 1, error);
    if (c->files[FRAMES] >= 0)
        c->files[CLASSIC] = bus->open_messages(bus->data, c->id, takes, false, error);
    if (c->files[CLASSIC] >= 0 && bus->has_fd(bus->data))
        c->files[FD] = bus->open_messages(bus->data, c->id, takes, true, NULL);
    if (c->files[CLASSIC] < 0) {
        close_files(c);
        return false;
    }
    for (unsigned i = 0; i < N_FILES; i++) {
        if (c->files[i] < 0)
            continue;
        c->sources[i] = g_unix_fd_source_new(c->files[i], G_IO_IN | G_IO_ERR | G_IO_HUP);
        g_source_set_callback(c->sources[i], G_SOURCE_FUNC(i == FRAMES ? on_frame : on_readable), c,
                              NULL);
        g_source_attach(c->sources[i], fb_driver_context(c->driver));
    }
    return true;
}

/* Files that are sound are kept: to close one with a message on its way out would wait for it. */
static bool have_files(Client *c, GError **error)
{
    if (c->files[CLASSIC] >= 0 && !c->worn)
        return true;
    for (unsigned i = 0; i < N_FILES; i++)
        if (c->files[i] >= 0 && !fb_can_is_idle(c->files[i])) {
            g_set_error(error, FB_ERROR, FB_ERROR_UNREACHABLE, "the last message is stuck");
            return false;
        }
    close_files(c);
    c->worn = false;
    return open_files(c, error);
}

/* Says HELLO on a bus that may have been used before: what is still on its way there belongs to
 * other keys. */
static void connect_to(void *transport)
{
    Client *c = transport;
    g_autoptr(GError) error = NULL;
    uint8_t message[FB_CAN_HELLO_BYTES];
    FbCanHello hello = {.version = FB_PROTOCOL_VERSION,
                        .session = fb_delivery_session(fb_driver_delivery(c->driver))};
    if (!have_files(c, &error)) {
        break_late(c, g_strdup(error->message));
        return;
    }
    hello.flags = c->files[FD] >= 0 ? FB_CAN_FLAG_FD : 0;
    if (getrandom(c->nonce, sizeof c->nonce, 0) != sizeof c->nonce) {
        break_late(c, g_strdup("the kernel gives no random number"));
        return;
    }
    memcpy(hello.nonce, c->nonce, sizeof c->nonce);
    c->phase = ASKED;
    if (!fb_can_write_message(c->files[CLASSIC], message,
                              fb_can_put_hello(message, &hello, &c->agent->key, c->id)))
        break_late(c, g_strdup_printf("the CAN bus takes nothing: %s", g_strerror(errno)));
}

/* What was agreed on is forgotten. */
static void disconnect(void *transport)
{
    Client *c = transport;
    fb_source_end(&c->late);
    g_clear_pointer(&c->why, g_free);
    c->phase = CLOSED;
    c->awaited = 0;
    explicit_bzero(&c->keys, sizeof c->keys);
    if (c->worn)
        for (unsigned i = 0; i < N_FILES; i++)
            fb_source_end(&c->sources[i]);
}

/* ----------------------------------------------------------------------------- life */

/* Lets the last answer come: one that nobody takes any more would keep the machine from answering
 * the next agent of this number for a second. */
static void take_leave(const Client *c)
{
    struct pollfd answer = {.fd = c->files[c->fd ? FD : CLASSIC], .events = POLLIN};
    if (c->phase == OPEN && c->awaited != 0)
        poll(&answer, 1, LEAVE_MS);
}

static void free_client(void *transport)
{
    Client *c = transport;
    take_leave(c);
    disconnect(c);
    close_files(c);
    fb_can_agent_unref(c->agent);
    explicit_bzero(c, sizeof *c);
    g_free(c);
}

void fb_can_client_attach(FbDriver *driver, FbCanAgent *agent, FbCanChannel channel)
{
    static const FbTransport transport = {connect_to, disconnect, send_request, free_client};
    Client *c = g_new0(Client, 1);
    c->driver = driver;
    c->agent = fb_can_agent_ref(agent);
    c->channel = channel;
    c->id = fb_can_request_id(agent->base, agent->number, channel);
    for (unsigned i = 0; i < N_FILES; i++)
        c->files[i] = -1;
    fb_driver_set_transport(driver, &transport, c);
}
