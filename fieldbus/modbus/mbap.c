/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/modbus/mbap.h"

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fieldbus/bytes.h"

enum {
    IN_BYTES = 8 * FB_ADU_BYTES,
    OUT_BYTES = 64 * 1024, /* answers that the peer has not read: more is no honest peer */
    PARTIAL_US = 5000000,  /* for a handshake to be done, for an ADU to come whole */
};

/* The connection is its own GSource: it lives while it is dispatched, whatever a callback frees. */
struct FbMbap {
    GSource source;
    int fd;
    FbTlsStream *tls; /* NULL: plain */
    FbRole role;      /* NONE: not ready */
    gpointer tag;
    GIOCondition wanted;
    bool dispatching;
    FbMbapCallbacks callbacks;
    void *data;
    int64_t heard_us;
    int64_t partial_until_us; /* INT64_MAX: no part of anything is here */
    const char *fault;        /* told from the main loop, never from fb_mbap_send */
    GByteArray *out;
    size_t n_in;
    uint8_t in[IN_BYTES];
};

/* The functions that touch the network: > 0 bytes, 0 would block, -1 ended. */
static ssize_t stream_read(FbMbap *m, uint8_t *bytes, size_t n)
{
    if (m->tls)
        return fb_tls_read(m->tls, bytes, n);
    const ssize_t got = recv(m->fd, bytes, n, 0);
    if (got > 0)
        return got;
    return got < 0 && (errno == EAGAIN || errno == EINTR) ? 0 : -1;
}

static ssize_t stream_write(FbMbap *m, const uint8_t *bytes, size_t n)
{
    if (m->tls)
        return fb_tls_write(m->tls, bytes, n);
    const ssize_t put = send(m->fd, bytes, n, MSG_NOSIGNAL);
    if (put >= 0)
        return put;
    return errno == EAGAIN || errno == EINTR ? 0 : -1;
}

static ssize_t stream_open(FbMbap *m)
{
    return m->tls ? fb_tls_handshake(m->tls) : 1;
}

static bool stream_pending(const FbMbap *m)
{
    return m->tls && m->role != FB_ROLE_NONE && fb_tls_pending(m->tls);
}

static const char *stream_why(const FbMbap *m)
{
    return m->tls ? fb_tls_why(m->tls) : "the connection was closed";
}

static void fail(FbMbap *m)
{
    void (*broken)(FbMbap *, const char *, void *) = m->callbacks.broken;
    m->callbacks.broken = NULL;
    if (broken)
        broken(m, m->fault, m->data);
}

/* Bytes of the whole ADU at the head of `in`; 0: not whole yet; -1: no Modbus. */
static ssize_t whole_adu(const uint8_t *in, size_t n)
{
    if (n < FB_MBAP_HEADER_BYTES - 1)
        return 0;
    const unsigned protocol = fb_get16(in + 2), length = fb_get16(in + 4);
    if (protocol != 0 || length < 2 || length > FB_ADU_BYTES - 6)
        return -1;
    return n >= 6 + length ? (ssize_t)(6 + length) : 0;
}

/* Hands up the whole ADUs; what is left gets a time by which it must be whole. */
static void hand_up(FbMbap *m, int64_t now_us)
{
    size_t at = 0;
    ssize_t n;
    while ((n = whole_adu(m->in + at, m->n_in - at)) > 0) {
        m->heard_us = now_us;
        m->callbacks.adu(m, m->in + at, (size_t)n, m->data);
        if (g_source_is_destroyed(&m->source) || m->fault)
            return;
        at += (size_t)n;
    }
    if (n < 0) {
        m->fault = "what came is not Modbus TCP";
        return;
    }
    m->n_in -= at;
    memmove(m->in, m->in + at, m->n_in);
    if (m->n_in == 0)
        m->partial_until_us = INT64_MAX;
    else if (at > 0 || m->partial_until_us == INT64_MAX)
        m->partial_until_us = now_us + PARTIAL_US;
}

/* A change wakes the main loop: not for every message. */
static void poll_for_what_is_wanted(FbMbap *m)
{
    const bool sending = m->out->len > 0;
    const GIOCondition wanted = m->tls    ? fb_tls_wanted(m->tls, sending)
                                : sending ? G_IO_IN | G_IO_OUT
                                          : G_IO_IN;
    if (wanted != m->wanted)
        g_source_modify_unix_fd(&m->source, m->tag, wanted);
    m->wanted = wanted;
}

static void write_out(FbMbap *m)
{
    const ssize_t n = stream_write(m, m->out->data, m->out->len);
    if (n < 0)
        m->fault = stream_why(m);
    else if (n > 0)
        g_byte_array_remove_range(m->out, 0, (guint)n);
}

static void read_in(FbMbap *m, int64_t now_us)
{
    const ssize_t n = stream_read(m, m->in + m->n_in, IN_BYTES - m->n_in);
    if (n < 0) {
        m->fault = stream_why(m);
    } else if (n > 0) {
        m->n_in += (size_t)n;
        hand_up(m, now_us);
    }
}

static void open_up(FbMbap *m, int64_t now_us)
{
    const ssize_t done = stream_open(m);
    if (done < 0)
        m->fault = stream_why(m);
    if (done <= 0)
        return;
    m->role = m->tls ? fb_tls_role(m->tls) : FB_ROLE_PROGRAMMER;
    m->heard_us = now_us;
    m->partial_until_us = INT64_MAX;
    m->callbacks.ready(m, m->data);
}

/* One turn: whatever the socket is ready for, once, so that the others have theirs. */
static void turn(FbMbap *m, int64_t now_us)
{
    const GIOCondition ready = g_source_query_unix_fd(&m->source, m->tag);
    if (m->role == FB_ROLE_NONE)
        open_up(m, now_us);
    if (m->role == FB_ROLE_NONE || m->fault || g_source_is_destroyed(&m->source))
        return;
    if (m->out->len > 0 && (ready & G_IO_OUT || m->tls))
        write_out(m);
    if (!m->fault && (ready || stream_pending(m)))
        read_in(m, now_us);
}

static gboolean dispatch(GSource *source, GSourceFunc unused, gpointer none)
{
    (void)unused, (void)none;
    FbMbap *m = (FbMbap *)source;
    const int64_t now_us = g_source_get_time(source);
    if (m->dispatching) /* a callback runs the main loop: what came waits */
        return G_SOURCE_CONTINUE;
    m->dispatching = true;
    if (!m->fault)
        turn(m, now_us);
    if (g_source_is_destroyed(source))
        return G_SOURCE_CONTINUE;
    if (!m->fault && now_us >= m->partial_until_us)
        m->fault = m->role == FB_ROLE_NONE ? "the handshake was not done in time"
                                           : "a message did not come whole in time";
    m->dispatching = false;
    if (m->fault) {
        fail(m);
        return G_SOURCE_CONTINUE;
    }
    poll_for_what_is_wanted(m);
    g_source_set_ready_time(source, stream_pending(m)                  ? 0
                                    : m->partial_until_us == INT64_MAX ? -1
                                                                       : m->partial_until_us);
    return G_SOURCE_CONTINUE;
}

static void finalize(GSource *source)
{
    FbMbap *m = (FbMbap *)source;
    g_byte_array_unref(m->out);
}

static GSourceFuncs functions = {.dispatch = dispatch, .finalize = finalize};

FbMbap *fb_mbap_new(int fd, FbTls *tls, const char *host, const FbMbapCallbacks *callbacks,
                    void *data, GMainContext *context)
{
    const int one = 1;
    FbMbap *m = (FbMbap *)g_source_new(&functions, sizeof *m);
    fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    m->fd = fd;
    m->tls = tls ? fb_tls_stream_new(tls, fd, host) : NULL;
    m->callbacks = *callbacks;
    m->data = data;
    m->heard_us = g_get_monotonic_time();
    m->out = g_byte_array_new();
    m->partial_until_us = m->heard_us + PARTIAL_US;
    g_source_set_ready_time(&m->source, 0);
    m->tag = g_source_add_unix_fd(&m->source, fd, G_IO_IN);
    m->wanted = G_IO_IN;
    /* Else GLib takes the fd out of its poll for each dispatch and puts it back, and wakes itself
     * for both: four system calls a round trip. */
    g_source_set_can_recurse(&m->source, TRUE);
    g_source_set_static_name(&m->source, "modbus connection");
    g_source_attach(&m->source, context);
    return m;
}

void fb_mbap_free(FbMbap *m)
{
    if (!m)
        return;
    g_source_destroy(&m->source);
    fb_tls_stream_free(m->tls);
    m->tls = NULL;
    close(m->fd);
    g_source_unref(&m->source);
}

void fb_mbap_send(FbMbap *m, const uint8_t *adu, size_t n)
{
    const bool behind = m->out->len > 0;
    if (m->fault)
        return;
    g_byte_array_append(m->out, adu, (guint)n);
    if (!behind)
        write_out(m);
    if (!m->fault && m->out->len > OUT_BYTES)
        m->fault = "the peer does not read";
    if (m->fault)
        g_source_set_ready_time(&m->source, 0);
    else if (!behind && m->out->len > 0)
        poll_for_what_is_wanted(m);
}

FbRole fb_mbap_role(const FbMbap *m)
{
    return m->role;
}

int64_t fb_mbap_heard_us(const FbMbap *m)
{
    return m->heard_us;
}
