/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's CAN server: descriptors, clock and random numbers around the slave of slave.h. A
 * bus that is off or down is opened again once a second; nothing here ever waits.
 */
#include "fieldbus/can/server.h"

#include <errno.h>
#include <glib-unix.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "fieldbus/replies.h"
#include "fieldbus/source.h"

enum {
    BEAT_US = 450000, /* at least twice a second */
    RETRY_US = 1000000,
    N_PORTS = 1 + FB_CAN_N_CHANNELS * FB_CAN_AGENTS_MOST * 2,
};

/* A descriptor and whom it belongs to. */
typedef struct {
    FbCanServer *server;
    unsigned agent;
    FbCanChannel channel;
    bool fd;
    int file; /* -1: closed */
    GSource *source;
} Port;

typedef struct {
    GSource source;
    FbCanServer *server;
} Clock;

struct FbCanServer {
    FbCanBus bus;
    FbCanSlave *slave;
    FbReplies *replies;
    uint16_t base;
    unsigned agents;
    FbReceiver *receiver;
    void (*act)(FbDo what, void *data);
    void *data;
    GMainContext *context;
    GSource *clock;
    GArray *actions;     /* of FbDo */
    Port ports[N_PORTS]; /* the first is for plain frames */
    bool up;
    int64_t beat_us, retry_us; /* when next */
    FbCanCounts counts;
};

static Port *port_of(FbCanServer *s, FbCanChannel channel, unsigned agent, bool fd);
static bool open_bus(FbCanServer *s, GError **error);
static void break_bus(FbCanServer *s);
static void tick(FbCanServer *s);

/* ------------------------------------------------------------------------ requests */

/* The answer goes first: it may have been a STOP, and what is to be done may take its time. */
static void answer_and_do(FbCanServer *s, unsigned agent, FbCanChannel channel,
                          const FbCanAnswer *answer)
{
    Port *port = port_of(s, channel, agent, answer->fd);
    const bool stays =
        answer->n == 0 || fb_replies_send(s->replies, port, answer->bytes, answer->n);
    fb_do_actions(s->actions, s->act, s->data);
    if (!stays)
        break_bus(s);
    tick(s);
}

static void send_reply(void *port, const uint8_t *bytes, size_t n, void *data)
{
    if (!fb_can_write_message(((Port *)port)->file, bytes, n))
        ((FbCanServer *)data)->counts.unsent++;
}

static gboolean on_message(gint file, GIOCondition condition, gpointer data)
{
    (void)condition;
    Port *port = data;
    FbCanServer *s = port->server;
    uint8_t bytes[FB_CAN_MESSAGE_BYTES + 1], nonce[FB_CAN_NONCE_BYTES] = {0};
    FbCanMessage message = {port->agent, port->channel, port->fd, bytes, sizeof bytes};
    FbCanAnswer answer;
    switch (fb_can_read_message(file, bytes, &message.n)) {
    case FB_CAN_READ_DONE:
        if (fb_can_is_hello(bytes, message.n) &&
            getrandom(nonce, sizeof nonce, GRND_NONBLOCK) != sizeof nonce)
            break; /* before the kernel has gathered any: as if it had been lost */
        fb_can_slave_message(s->slave, &message, nonce, g_get_monotonic_time(), s->actions,
                             &answer);
        answer_and_do(s, port->agent, port->channel, &answer);
        break;
    case FB_CAN_READ_TORN:
        s->counts.torn++;
        break;
    case FB_CAN_READ_BROKEN:
        break_bus(s);
        break;
    case FB_CAN_READ_NONE:
        break;
    }
    return G_SOURCE_CONTINUE;
}

static void take_frame(FbCanServer *s, const FbCanFrame *frame)
{
    FbCanAnswer answer;
    const unsigned agent = (unsigned)frame->id - s->base - FB_CAN_ID_STOP;
    for (unsigned i = 0; i < FB_CAN_N_ERRORS; i++)
        s->counts.errors[i] += frame->errors >> i & 1;
    if (frame->errors >> FB_CAN_ERROR_BUS_OFF & 1)
        break_bus(s);
    if (frame->errors != 0 || agent >= s->agents)
        return;
    fb_can_slave_stop(s->slave, agent, frame->bytes, frame->n, g_get_monotonic_time(), s->actions,
                      &answer);
    answer_and_do(s, agent, FB_CAN_CONTROL_CHANNEL, &answer);
}

static gboolean on_frame(gint file, GIOCondition condition, gpointer data)
{
    (void)condition;
    FbCanServer *s = ((Port *)data)->server;
    FbCanFrame frame;
    switch (fb_can_read_frame(file, &frame)) {
    case FB_CAN_READ_DONE:
        take_frame(s, &frame);
        break;
    case FB_CAN_READ_BROKEN:
        break_bus(s);
        break;
    case FB_CAN_READ_TORN:
    case FB_CAN_READ_NONE:
        break;
    }
    return G_SOURCE_CONTINUE;
}

/* --------------------------------------------------------------------------- clock */

static void publish(FbCanServer *s, int64_t now_us)
{
    uint8_t beat[FB_CAN_FRAME_BYTES];
    fb_can_slave_beat(s->slave, now_us, beat);
    if (!fb_can_write_frame(s->ports[0].file, (uint16_t)(s->base + FB_CAN_ID_BEAT), beat,
                            sizeof beat))
        s->counts.unsent++;
    s->beat_us = now_us + BEAT_US;
}

static void tick(FbCanServer *s)
{
    const int64_t now_us = g_get_monotonic_time();
    int64_t next_us = fb_receiver_tick(s->receiver, now_us, s->actions);
    fb_do_actions(s->actions, s->act, s->data);
    if (!s->up && now_us >= s->retry_us) {
        s->retry_us = now_us + RETRY_US;
        open_bus(s, NULL);
    }
    if (s->up && (now_us >= s->beat_us || fb_can_slave_has_news(s->slave, now_us)))
        publish(s, now_us);
    next_us = MIN(next_us, s->up ? s->beat_us : s->retry_us);
    g_source_set_ready_time(s->clock, next_us);
}

/* The receiver's state is changed by others, too: looked at whenever the loop turns. */
static gboolean prepare_clock(GSource *source, gint *timeout_ms)
{
    const FbCanServer *s = ((Clock *)source)->server;
    *timeout_ms = -1;
    return s->up && fb_can_slave_has_news(s->slave, g_get_monotonic_time());
}

static gboolean dispatch_clock(GSource *source, GSourceFunc callback, gpointer data)
{
    (void)callback, (void)data;
    tick(((Clock *)source)->server);
    return G_SOURCE_CONTINUE;
}

static GSource *clock_new(FbCanServer *s)
{
    static GSourceFuncs functions = {.prepare = prepare_clock, .dispatch = dispatch_clock};
    GSource *source = g_source_new(&functions, sizeof(Clock));
    ((Clock *)source)->server = s;
    g_source_attach(source, s->context);
    return source;
}

/* ----------------------------------------------------------------------------- bus */

static bool watch(FbCanServer *s, Port *port, int file, GUnixFDSourceFunc call)
{
    port->server = s;
    port->file = file;
    if (file < 0)
        return false;
    port->source = g_unix_fd_source_new(file, G_IO_IN | G_IO_ERR | G_IO_HUP);
    g_source_set_callback(port->source, G_SOURCE_FUNC(call), port, NULL);
    g_source_attach(port->source, s->context);
    return true;
}

static void unwatch(Port *port)
{
    fb_source_end(&port->source);
}

static void forget_replies(Port *port)
{
    if (port->server)
        fb_replies_forget(port->server->replies, port);
}

static void close_port(Port *port)
{
    unwatch(port);
    if (port->file >= 0)
        close(port->file);
    port->file = -1;
}

static void for_each_port(FbCanServer *s, void (*call)(Port *port))
{
    for (size_t i = 0; i < N_PORTS; i++)
        call(&s->ports[i]);
}

static Port *port_of(FbCanServer *s, FbCanChannel channel, unsigned agent, bool fd)
{
    return &s->ports[1 + ((unsigned)channel * FB_CAN_AGENTS_MOST + agent) * 2 + fd];
}

/* To close a socket with a message on its way out would wait for it. */
static bool is_idle(const FbCanServer *s)
{
    for (size_t i = 0; i < N_PORTS; i++)
        if (s->ports[i].file >= 0 && !fb_can_is_idle(s->ports[i].file))
            return false;
    return true;
}

static bool open_ports(FbCanServer *s, GError **error)
{
    const FbCanBus *bus = &s->bus;
    const unsigned kinds = bus->has_fd(bus->data) ? 2 : 1;
    if (!watch(s, &s->ports[0],
               bus->open_frames(bus->data, (uint16_t)(s->base + FB_CAN_ID_STOP), s->agents, error),
               on_frame))
        return false;
    for (FbCanChannel c = 0; c < FB_CAN_N_CHANNELS; c++)
        for (unsigned agent = 0; agent < s->agents; agent++)
            for (unsigned fd = 0; fd < kinds; fd++) {
                const uint16_t takes = fb_can_request_id(s->base, agent, c);
                Port *port = port_of(s, c, agent, fd);
                *port = (Port){.agent = agent, .channel = c, .fd = fd == 1};
                if (!watch(s, port,
                           bus->open_messages(bus->data, (uint16_t)(takes + FB_CAN_ID_ANSWER),
                                              takes, port->fd, error),
                           on_message))
                    return false;
            }
    return true;
}

static bool open_bus(FbCanServer *s, GError **error)
{
    if (!is_idle(s))
        return false;
    for_each_port(s, close_port);
    s->up = open_ports(s, error);
    if (!s->up)
        for_each_port(s, close_port);
    return s->up;
}

static void break_bus(FbCanServer *s)
{
    if (!s->up)
        return;
    s->up = false;
    s->counts.breaks++;
    for_each_port(s, unwatch);
    for_each_port(s, forget_replies);
    s->retry_us = g_get_monotonic_time() + RETRY_US;
    tick(s);
}

/* ---------------------------------------------------------------------------- life */

FbCanServer *fb_can_server_new_on(FbCanBus bus, const FbCanSlaveOptions *options,
                                  FbReceiver *receiver, void (*act)(FbDo what, void *data),
                                  void *data, GMainContext *context, GError **error)
{
    g_autoptr(FbCanServer) s = g_new0(FbCanServer, 1);
    FbCanSlaveOptions with_fd = *options;
    with_fd.fd = bus.has_fd(bus.data);
    for (size_t i = 0; i < N_PORTS; i++)
        s->ports[i].file = -1;
    s->bus = bus;
    s->slave = fb_can_slave_new(&with_fd, receiver);
    explicit_bzero(&with_fd, sizeof with_fd);
    s->replies = fb_replies_new(send_reply, s, context);
    s->base = options->base;
    s->agents = options->agents;
    s->receiver = receiver;
    s->act = act;
    s->data = data;
    s->context = g_main_context_ref(context ? context : g_main_context_default());
    s->actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    s->clock = clock_new(s);
    if (!open_bus(s, error))
        return NULL;
    tick(s);
    return g_steal_pointer(&s);
}

FbCanServer *fb_can_server_new(const FbCanOptions *options, FbReceiver *receiver,
                               void (*act)(FbDo what, void *data), void *data,
                               GMainContext *context, GError **error)
{
    FbCanSlaveOptions slave = {.base = options->base, .agents = options->agents};
    if (!fb_can_key_load(&slave.key, options->key_file, error))
        return NULL;
    FbCanServer *s = fb_can_server_new_on(fb_can_bus_new(options->interface), &slave, receiver, act,
                                          data, context, error);
    explicit_bzero(&slave, sizeof slave);
    return s;
}

FbCanCounts fb_can_server_counts(const FbCanServer *s)
{
    FbCanCounts counts = fb_can_slave_counts(s->slave);
    counts.torn = s->counts.torn;
    counts.unsent = s->counts.unsent;
    counts.breaks = s->counts.breaks;
    memcpy(counts.errors, s->counts.errors, sizeof counts.errors);
    return counts;
}

void fb_can_server_filter(FbCanServer *s, FbReplyFilter filter, void *data)
{
    fb_replies_filter(s->replies, filter, data);
}

void fb_can_server_free(FbCanServer *s)
{
    if (!s)
        return;
    for_each_port(s, close_port);
    fb_source_end(&s->clock);
    g_array_unref(s->actions);
    fb_replies_free(s->replies);
    fb_can_slave_free(s->slave);
    fb_can_bus_clear(&s->bus);
    g_main_context_unref(s->context);
    g_free(s);
}
