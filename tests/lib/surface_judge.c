/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/surface_judge.h"

#include <gio/gio.h>
#include <stdlib.h>

#include "tests/lib/test.h"

static void append(GByteArray *to, const double *values, size_t n)
{
    g_byte_array_append(to, (const guint8 *)values, (guint)(n * sizeof *values));
}

void surface_judge_ask(GByteArray *question, const double *reals, const SegSurface *s,
                       const double *u, const double *v, size_t n)
{
    const double head[] = {s->degree_u, s->n_u, s->degree_v, s->n_v, s->rational};
    size_t poles = (size_t)s->n_u * (size_t)s->n_v;
    append(question, head, G_N_ELEMENTS(head));
    append(question, reals + s->data,
           (size_t)(s->n_u + s->degree_u + 1 + s->n_v + s->degree_v + 1) +
               (s->rational ? 4 : 3) * poles);
    append(question, &(double){(double)n}, 1);
    for (size_t i = 0; i < n; i++)
        append(question, (const double[]){u[i], v[i]}, 2);
}

static GBytes *run(const char *const *arguments, const GByteArray *question)
{
    g_autoptr(GSubprocess) judge = g_subprocess_newv(
        arguments, G_SUBPROCESS_FLAGS_STDIN_PIPE | G_SUBPROCESS_FLAGS_STDOUT_PIPE, NULL);
    g_autoptr(GBytes) in = g_bytes_new_static(question->data, question->len);
    GBytes *out = NULL;
    if (!judge || !g_subprocess_communicate(judge, in, NULL, &out, NULL, NULL))
        return NULL;
    if (!g_subprocess_get_successful(judge))
        g_clear_pointer(&out, g_bytes_unref);
    return out;
}

GBytes *surface_judge_answer(const GByteArray *question)
{
    g_autofree char *judge = test_program("judges/occ_surface");
    return run((const char *const[]){judge, NULL}, question);
}

double surface_judge_speed(const GByteArray *question, double seconds, bool directions)
{
    g_autofree char *judge = test_program("judges/occ_surface");
    g_autofree char *time = g_strdup_printf("%g", seconds);
    g_autoptr(GBytes) out = run(
        (const char *const[]){judge, "--time", time, directions ? NULL : "--no-directions", NULL},
        question);
    if (!out)
        return 0;
    g_autofree char *text = g_strndup(g_bytes_get_data(out, NULL), g_bytes_get_size(out));
    return g_ascii_strtod(text, NULL);
}
