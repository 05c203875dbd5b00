/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/source.h"

typedef struct {
    GSource source;
    void (*call)(void *data);
    void *data;
} Source;

static gboolean dispatch(GSource *source, GSourceFunc none, gpointer nothing)
{
    (void)none, (void)nothing;
    const Source *s = (const Source *)source;
    s->call(s->data);
    return G_SOURCE_CONTINUE;
}

GSource *fb_source_new(void (*call)(void *data), void *data, GMainContext *context)
{
    static GSourceFuncs functions = {.dispatch = dispatch};
    GSource *source = g_source_new(&functions, sizeof(Source));
    ((Source *)source)->call = call;
    ((Source *)source)->data = data;
    g_source_attach(source, context);
    return source;
}

void fb_source_end(GSource **source)
{
    if (!*source)
        return;
    g_source_destroy(*source);
    g_clear_pointer(source, g_source_unref);
}
