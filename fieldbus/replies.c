/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/replies.h"

#include <string.h>

#include "fieldbus/source.h"

/* What waits; the bytes lie behind it. */
typedef struct {
    void *connection;
    int64_t due_us;
    size_t n;
    uint8_t bytes[];
} Waiting;

struct FbReplies {
    void (*send)(void *connection, const uint8_t *bytes, size_t n, void *data);
    void *data;
    FbReplyFilter filter;
    void *filter_data;
    GQueue waiting; /* in the order in which they came */
    GSource *timer;
};

static void hold_up(FbReplies *r, void *connection, const uint8_t *bytes, size_t n, int64_t due_us);
static int64_t last_due_us(const FbReplies *r, const void *connection);
static void on_time(void *data);

bool fb_replies_send(FbReplies *r, void *connection, const uint8_t *bytes, size_t n)
{
    if (!r->filter) {
        r->send(connection, bytes, n, r->data);
        return true;
    }
    const FbFate fate = r->filter(r->filter_data);
    if (fate.close)
        return false;
    g_autofree uint8_t *copy = g_memdup2(bytes, n);
    const uint32_t bit = n > 0 ? fate.bit % (8 * (uint32_t)n) : 0;
    if (fate.corrupt && n > 0)
        copy[bit / 8] ^= (uint8_t)(1 << bit % 8);
    const int64_t now_us = g_get_monotonic_time();
    const int64_t due_us = MAX(now_us + fate.delay_us, last_due_us(r, connection));
    for (unsigned i = 0; i < fate.copies; i++) {
        if (due_us > now_us)
            hold_up(r, connection, copy, n, due_us);
        else
            r->send(connection, copy, n, r->data);
    }
    return true;
}

static void hold_up(FbReplies *r, void *connection, const uint8_t *bytes, size_t n, int64_t due_us)
{
    Waiting *w = g_malloc(sizeof *w + n);
    *w = (Waiting){.connection = connection, .due_us = due_us, .n = n};
    memcpy(w->bytes, bytes, n);
    g_queue_push_tail(&r->waiting, w);
    const int64_t ready_us = g_source_get_ready_time(r->timer);
    if (ready_us < 0 || due_us < ready_us)
        g_source_set_ready_time(r->timer, due_us);
}

/* When the connection's last one of those that wait goes; 0: none waits. */
static int64_t last_due_us(const FbReplies *r, const void *connection)
{
    for (const GList *l = r->waiting.tail; l; l = l->prev) {
        const Waiting *w = l->data;
        if (w->connection == connection)
            return w->due_us;
    }
    return 0;
}

static void on_time(void *data)
{
    FbReplies *r = data;
    const int64_t now_us = g_get_monotonic_time();
    int64_t next_us = -1;
    for (GList *l = r->waiting.head, *next; l; l = next) {
        Waiting *w = l->data;
        next = l->next;
        if (w->due_us <= now_us) {
            g_queue_delete_link(&r->waiting, l);
            r->send(w->connection, w->bytes, w->n, r->data);
            g_free(w);
        } else if (next_us < 0 || w->due_us < next_us) {
            next_us = w->due_us;
        }
    }
    g_source_set_ready_time(r->timer, next_us);
}

void fb_replies_forget(FbReplies *r, const void *connection)
{
    for (GList *l = r->waiting.head, *next; l; l = next) {
        Waiting *w = l->data;
        next = l->next;
        if (w->connection == connection) {
            g_queue_delete_link(&r->waiting, l);
            g_free(w);
        }
    }
}

void fb_replies_filter(FbReplies *r, FbReplyFilter filter, void *data)
{
    r->filter = filter;
    r->filter_data = data;
}

FbReplies *fb_replies_new(void (*send)(void *connection, const uint8_t *bytes, size_t n,
                                       void *data),
                          void *data, GMainContext *context)
{
    FbReplies *r = g_new0(FbReplies, 1);
    r->send = send;
    r->data = data;
    g_queue_init(&r->waiting);
    r->timer = fb_source_new(on_time, r, context);
    return r;
}

void fb_replies_free(FbReplies *r)
{
    if (!r)
        return;
    fb_source_end(&r->timer);
    g_queue_clear_full(&r->waiting, g_free);
    g_free(r);
}
