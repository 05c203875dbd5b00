/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/gcode/parameters.h"

#include <math.h>
#include <string.h>

static GArray *values_new(void)
{
    return g_array_new(FALSE, FALSE, sizeof(double));
}

static GArray *values_copy(const GArray *values)
{
    GArray *copy = values_new();
    return values->len > 0 ? g_array_append_vals(copy, values->data, values->len) : copy;
}

static void frame_free(void *data)
{
    NcFrame *frame = data;
    g_array_unref(frame->locals);
    g_free(frame);
}

static NcFrame *innermost(const NcParameters *parameters)
{
    return parameters->frames->pdata[parameters->frames->len - 1];
}

static NcParameters *new_with(GHashTable *ids, GPtrArray *names, GArray *globals)
{
    NcParameters *parameters = g_new0(NcParameters, 1);
    parameters->ids = ids;
    parameters->names = names;
    parameters->globals = globals;
    parameters->frames = g_ptr_array_new_with_free_func(frame_free);
    return parameters;
}

NcParameters *nc_parameters_new(void)
{
    NcParameters *parameters = new_with(g_hash_table_new(g_str_hash, g_str_equal),
                                        g_ptr_array_new_with_free_func(g_free), values_new());
    NcFrame *main_program = g_new0(NcFrame, 1);
    main_program->locals = values_new();
    g_ptr_array_add(parameters->frames, main_program);
    return parameters;
}

/* The names are shared: they only grow. */
NcParameters *nc_parameters_copy(const NcParameters *parameters)
{
    NcParameters *copy =
        new_with(g_hash_table_ref(parameters->ids), g_ptr_array_ref(parameters->names),
                 values_copy(parameters->globals));
    memcpy(copy->numbered, parameters->numbered, sizeof copy->numbered);
    for (guint i = 0; i < parameters->frames->len; i++) {
        const NcFrame *frame = parameters->frames->pdata[i];
        NcFrame *same = g_memdup2(frame, sizeof *frame);
        same->locals = values_copy(frame->locals);
        g_ptr_array_add(copy->frames, same);
    }
    return copy;
}

void nc_parameters_exchange(NcParameters *a, NcParameters *b)
{
    NcParameters was = *a;
    *a = *b;
    *b = was;
}

void nc_parameters_free(NcParameters *parameters)
{
    if (parameters) {
        g_ptr_array_unref(parameters->frames);
        g_array_unref(parameters->globals);
        g_hash_table_unref(parameters->ids);
        g_ptr_array_unref(parameters->names);
        g_free(parameters);
    }
}

NcParameter nc_parameter_named(NcParameters *parameters, const char *name)
{
    void *id;
    bool global = *name == '_';
    if (g_hash_table_lookup_extended(parameters->ids, name, NULL, &id))
        return (NcParameter){true, global, GPOINTER_TO_INT(id)};
    int next = (int)parameters->names->len;
    char *kept = g_strdup(name);
    g_ptr_array_add(parameters->names, kept);
    g_hash_table_insert(parameters->ids, kept, GINT_TO_POINTER(next));
    return (NcParameter){true, global, next};
}

const char *nc_parameter_name(const NcParameters *parameters, NcParameter parameter)
{
    return parameters->names->pdata[parameter.index];
}

static GArray *values_of(const NcParameters *parameters, NcParameter parameter)
{
    return parameter.global ? parameters->globals : innermost(parameters)->locals;
}

double nc_parameter_get(const NcParameters *parameters, NcParameter parameter)
{
    if (!parameter.named)
        return parameters->numbered[parameter.index];
    const GArray *values = values_of(parameters, parameter);
    return (guint)parameter.index < values->len ? g_array_index(values, double, parameter.index)
                                                : NAN;
}

void nc_parameter_set(NcParameters *parameters, NcParameter parameter, double value)
{
    if (!parameter.named) {
        parameters->numbered[parameter.index] = value;
        return;
    }
    GArray *values = values_of(parameters, parameter);
    const double unset = NAN;
    while (values->len <= (guint)parameter.index)
        g_array_append_val(values, unset);
    g_array_index(values, double, parameter.index) = value;
}

void nc_parameters_enter(NcParameters *parameters, const double *arguments)
{
    NcFrame *frame = g_new0(NcFrame, 1);
    frame->locals = values_new();
    memcpy(frame->saved, parameters->numbered + 1, sizeof frame->saved);
    memcpy(parameters->numbered + 1, arguments, sizeof frame->saved);
    g_ptr_array_add(parameters->frames, frame);
}

void nc_parameters_leave(NcParameters *parameters)
{
    memcpy(parameters->numbered + 1, innermost(parameters)->saved,
           sizeof innermost(parameters)->saved);
    g_ptr_array_set_size(parameters->frames, (gint)parameters->frames->len - 1);
}
