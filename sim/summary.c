/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/summary.h"

static void append_programs(GString *text, const SimSummary *s);
static void append_modbus(GString *text, const SimSummary *s);
static void append_can(GString *text, const FbCanServer *can);
static void append_counts(GString *text, const uint64_t *counts, unsigned first, unsigned n,
                          const char *(*name)(unsigned what));

static const char *answer_name(unsigned answer)
{
    return fb_answer_name((FbAnswer)answer);
}

char *sim_summary(const SimSummary *s)
{
    GString *text = g_string_new(NULL);
    append_programs(text, s);
    g_string_append(text, "requests refused:");
    append_counts(text, s->answers, FB_ANSWER_DONE + 1, FB_N_ANSWERS, answer_name);
    append_modbus(text, s);
    if (s->can)
        append_can(text, s->can);
    return g_string_free(text, FALSE);
}

static void append_programs(GString *text, const SimSummary *s)
{
    const SimTotals *t = &s->totals;
    g_string_append_printf(text,
                           "programs: %u started, %u completed, %u aborted, %u ended by e-stop or "
                           "alarm, %u refused at VERIFY\n"
                           "blocks executed: %" G_GUINT64_FORMAT "\nmachine time: %.3f s\n",
                           t->started, t->completed, t->aborted, t->stopped, s->refused,
                           s->executed_blocks, t->machine_s);
}

static void append_modbus(GString *text, const SimSummary *s)
{
    uint64_t exceptions = s->plain ? fb_modbus_server_exceptions(s->plain) : 0;
    if (s->secure)
        exceptions += fb_modbus_server_exceptions(s->secure);
    if (s->plain || s->secure)
        g_string_append_printf(text, "Modbus exceptions: %" G_GUINT64_FORMAT "\n", exceptions);
    if (s->secure)
        g_string_append_printf(text, "TLS handshakes refused: %" G_GUINT64_FORMAT "\n",
                               fb_modbus_server_refused(s->secure));
}

static void append_can(GString *text, const FbCanServer *can)
{
    const FbCanCounts c = fb_can_server_counts(can);
    g_string_append_printf(
        text,
        "CAN: forged %" G_GUINT64_FORMAT ", replayed %" G_GUINT64_FORMAT
        ", malformed %" G_GUINT64_FORMAT ", torn %" G_GUINT64_FORMAT ", unsent %" G_GUINT64_FORMAT
        "\nCAN: hellos %" G_GUINT64_FORMAT ", openings %" G_GUINT64_FORMAT
        ", breaks %" G_GUINT64_FORMAT "\nCAN: error frames:",
        c.forged, c.replayed, c.malformed, c.torn, c.unsent, c.hellos, c.openings, c.breaks);
    append_counts(text, c.errors, 0, FB_CAN_N_ERRORS, fb_can_error_name);
}

/* " NAME 3, NAME 1" of those that are not 0, to the end of the line. */
static void append_counts(GString *text, const uint64_t *counts, unsigned first, unsigned n,
                          const char *(*name)(unsigned what))
{
    bool any = false;
    for (unsigned i = first; i < n; i++) {
        if (counts[i] == 0)
            continue;
        g_string_append_printf(text, "%s %s %" G_GUINT64_FORMAT, any ? "," : "", name(i),
                               counts[i]);
        any = true;
    }
    g_string_append(text, any ? "\n" : " none\n");
}
