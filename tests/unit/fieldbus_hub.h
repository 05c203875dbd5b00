/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A CAN bus without a kernel: socketpairs that keep message boundaries, and a hub that passes what
 * one end sends to whoever takes that identifier. It keeps a log, may lose what it is told to, and
 * puts in what strangers send. With it a machine with its CAN server, and sessions with it.
 */
#ifndef TESTS_UNIT_FIELDBUS_HUB_H
#define TESTS_UNIT_FIELDBUS_HUB_H

#include <glib-unix.h>
#include <linux/can.h>
#include <linux/can/error.h>

#include "fieldbus/can/server.h"
#include "fieldbus/session.h"
#include "tests/unit/fieldbus_cell.h"

/* What went over the bus: a message in classic or FD frames, or a plain frame. */
typedef struct {
    uint16_t id;
    bool frame, fd;
    size_t n;
    uint8_t bytes[FB_CAN_MESSAGE_BYTES + 1];
} Sent;

typedef struct Hub Hub;

/* One open descriptor: the hub has the other end. */
typedef struct {
    Hub *hub;
    int file;
    GSource *source;
    bool frames, fd;
    uint16_t sends, takes; /* of frames: takes the identifiers takes to takes + n - 1 */
    unsigned n;
} Plug;

struct Hub {
    GMainContext *context;
    GPtrArray *plugs;
    GPtrArray *log; /* of Sent */
    bool fd, down;
    bool (*loses)(const Sent *sent, void *data); /* may be NULL */
    void *data;
};

static inline void plug_free(void *data)
{
    Plug *plug = data;
    g_source_destroy(plug->source);
    g_source_unref(plug->source);
    close(plug->file);
    g_free(plug);
}

/* To all that take it but `from`. */
static inline void hub_pass(Hub *hub, const Sent *sent, const Plug *from)
{
    struct can_frame frame = {.can_id = sent->id, .len = (uint8_t)MIN(sent->n, 8)};
    memcpy(frame.data, sent->bytes, frame.len);
    for (guint i = 0; i < hub->plugs->len; i++) {
        const Plug *plug = hub->plugs->pdata[i];
        const bool takes = plug->frames ? (unsigned)sent->id - plug->takes < plug->n
                                        : plug->takes == sent->id && plug->fd == sent->fd;
        if (plug == from || plug->frames != sent->frame || !takes)
            continue;
        if (sent->frame)
            send(plug->file, &frame, sizeof frame, MSG_NOSIGNAL | MSG_DONTWAIT);
        else
            send(plug->file, sent->bytes, sent->n, MSG_NOSIGNAL | MSG_DONTWAIT);
    }
}

static inline gboolean hub_take(gint file, GIOCondition condition, gpointer data)
{
    (void)condition;
    Plug *plug = data;
    Hub *hub = plug->hub;
    struct can_frame frame;
    g_autofree Sent *sent = g_new0(Sent, 1);
    *sent = (Sent){.id = plug->sends, .frame = plug->frames, .fd = plug->fd};
    const ssize_t n = plug->frames ? read(file, &frame, sizeof frame)
                                   : read(file, sent->bytes, sizeof sent->bytes);
    if (n <= 0) {
        g_ptr_array_remove_fast(hub->plugs, plug);
        return G_SOURCE_REMOVE;
    }
    sent->n = plug->frames ? frame.len : (size_t)n;
    if (plug->frames) {
        sent->id = (uint16_t)frame.can_id;
        memcpy(sent->bytes, frame.data, frame.len);
    }
    g_ptr_array_add(hub->log, g_memdup2(sent, sizeof *sent));
    if (!hub->loses || !hub->loses(sent, hub->data))
        hub_pass(hub, sent, plug);
    return G_SOURCE_CONTINUE;
}

static inline int hub_plug(Hub *hub, const Plug *like, GError **error)
{
    int pair[2];
    if (hub->down || socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair)) {
        g_set_error(error, FB_ERROR, FB_ERROR_UNREACHABLE, "the hub is down");
        return -1;
    }
    Plug *plug = g_memdup2(like, sizeof *like);
    plug->hub = hub;
    plug->file = pair[0];
    plug->source = g_unix_fd_source_new(pair[0], G_IO_IN | G_IO_HUP);
    g_source_set_callback(plug->source, G_SOURCE_FUNC(hub_take), plug, NULL);
    g_source_attach(plug->source, hub->context);
    g_ptr_array_add(hub->plugs, plug);
    return pair[1];
}

static inline bool hub_has_fd(void *data)
{
    return ((Hub *)data)->fd;
}

static inline int hub_open_frames(void *data, uint16_t first, unsigned n, GError **error)
{
    return hub_plug(data, &(Plug){.frames = true, .takes = first, .n = n}, error);
}

static inline int hub_open_messages(void *data, uint16_t sends, uint16_t takes, bool fd,
                                    GError **error)
{
    return hub_plug(data, &(Plug){.fd = fd, .sends = sends, .takes = takes}, error);
}

static inline FbCanBus hub_bus(Hub *hub)
{
    return (FbCanBus){hub_has_fd, hub_open_frames, hub_open_messages, NULL, hub};
}

/* A bus that is another for an agent: without FD, where the machine's has it. */
static inline bool hub_has_no_fd(void *data)
{
    (void)data;
    return false;
}

static inline void hub_go_down(Hub *hub)
{
    hub->down = true;
    g_ptr_array_set_size(hub->plugs, 0);
}

/* An error frame to everybody. */
static inline void hub_error(Hub *hub, uint32_t classes)
{
    const struct can_frame frame = {.can_id = CAN_ERR_FLAG | classes, .len = 8};
    for (guint i = 0; i < hub->plugs->len; i++) {
        const Plug *plug = hub->plugs->pdata[i];
        if (plug->frames)
            send(plug->file, &frame, sizeof frame, MSG_NOSIGNAL | MSG_DONTWAIT);
    }
}

/* The last one in the log on this identifier; NULL where there is none. */
static inline const Sent *hub_last(const Hub *hub, uint16_t id)
{
    for (guint i = hub->log->len; i > 0; i--) {
        const Sent *sent = hub->log->pdata[i - 1];
        if (sent->id == id)
            return sent;
    }
    return NULL;
}

/* ---------------------------------------------------------------- machine and agents */

enum { BASE = 0x100, AGENTS = 2, STOP_ID = BASE, BEAT_ID = BASE + 0x10, CONTROL_ID = BASE + 0x20 };
enum { WORK_ID = BASE + 0x40, ANSWER = 0x10 };

static const FbCanKey KEY = {"an example's key", 16};

typedef struct {
    Cell cell; /* without its Modbus server */
    Hub hub;
    FbCanServer *server;
} CanCell;

static inline void start_machine(CanCell *c, uint32_t epoch)
{
    const FbReceiverOptions options = {.epoch = epoch,
                                       .memory_bytes = 8 << 20,
                                       .on_agent_loss = CFG_AGENT_LOSS_HOLD,
                                       .agent_timeout_us = 5000000,
                                       .lease_timeout_us = 30000000};
    const FbCanSlaveOptions slave = {.key = KEY, .base = BASE, .agents = AGENTS};
    c->cell.receiver = fb_receiver_new(&options);
    c->server = fb_can_server_new_on(hub_bus(&c->hub), &slave, c->cell.receiver, act, &c->cell,
                                     c->cell.context, &c->cell.error);
    g_assert_no_error(c->cell.error);
    machine(&c->cell, FB_MACHINE_ACKNOWLEDGED);
}

static inline void stop_machine(CanCell *c)
{
    g_clear_pointer(&c->server, fb_can_server_free);
    g_clear_pointer(&c->cell.receiver, fb_receiver_free);
}

static inline void open_can(CanCell *c, bool fd)
{
    *c = (CanCell){.cell.context = g_main_context_new()};
    c->hub = (Hub){.context = c->cell.context,
                   .plugs = g_ptr_array_new_with_free_func(plug_free),
                   .log = g_ptr_array_new_with_free_func(g_free),
                   .fd = fd};
    start_machine(c, 77);
}

static inline FbSession *new_can_session(CanCell *c, FbCanBus bus, const FbCanKey *key,
                                         unsigned number, double reply_timeout_s)
{
    const CfgAgent agent = {.reply_timeout_s = reply_timeout_s,
                            .reconnect_s = 0.02,
                            .give_up_s = 2,
                            .heartbeat_s = 0.05,
                            .window = 8};
    const FbSessionCallbacks callbacks = {on_status, on_done, &c->cell};
    g_autoptr(FbCanAgent) who = fb_can_agent_new_on(bus, key, BASE, number);
    return fb_session_new_on_can("can://hub", who, &agent, &callbacks, c->cell.context);
}

static inline void open_can_session(CanCell *c)
{
    c->cell.session = new_can_session(c, hub_bus(&c->hub), &KEY, 0, 1);
}

static inline void close_can(CanCell *c)
{
    g_clear_pointer(&c->cell.session, fb_session_free);
    stop_machine(c);
    g_ptr_array_unref(c->hub.plugs);
    g_ptr_array_unref(c->hub.log);
    close_cell(&c->cell);
}

/* The program's end is its only gate. */
static inline void can_deliver(CanCell *c, GBytes *p)
{
    const uint64_t end = g_bytes_get_size(p);
    const int before = c->cell.done[FB_TASK_DELIVER];
    fb_session_deliver(c->cell.session, p, &end, 1);
    g_assert_true(run_until(&c->cell, &c->cell.done[FB_TASK_DELIVER], before + 1));
}

#endif
