/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/gcode/parameters.h"

#include <math.h>
#include <string.h>

static GArray *values_new(void)
{
    return g_array_new(FALSE, FALSE, sizeof(double));
}

/* As things were when it began. */
struct NcUndo {
    double locals[NC_N_LOCAL_PARAMETERS]; /* #1 to #30 */
    GArray *named_locals, *globals, *tools;
    GArray *changed; /* Change: of the other numbered ones */
    bool noted[NC_LAST_PARAMETER + 1];
};

typedef struct {
    int index;
    double was;
} Change;

static void copy(GArray *to, const GArray *from)
{
    g_array_set_size(to, 0);
    if (from->len > 0)
        g_array_append_vals(to, from->data, from->len);
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

NcParameters *nc_parameters_new(void)
{
    NcParameters *parameters = g_new0(NcParameters, 1);
    parameters->ids = g_hash_table_new(g_str_hash, g_str_equal);
    parameters->names = g_ptr_array_new_with_free_func(g_free);
    parameters->globals = values_new();
    parameters->tools = g_array_new(FALSE, FALSE, sizeof(NcToolOffset));
    parameters->frames = g_ptr_array_new_with_free_func(frame_free);
    NcFrame *main_program = g_new0(NcFrame, 1);
    main_program->locals = values_new();
    g_ptr_array_add(parameters->frames, main_program);
    struct NcUndo *undo = parameters->undo = g_new0(struct NcUndo, 1);
    undo->named_locals = values_new();
    undo->globals = values_new();
    undo->tools = g_array_new(FALSE, FALSE, sizeof(NcToolOffset));
    undo->changed = g_array_new(FALSE, FALSE, sizeof(Change));
    return parameters;
}

void nc_parameters_free(NcParameters *parameters)
{
    if (parameters) {
        g_ptr_array_unref(parameters->frames);
        g_array_unref(parameters->globals);
        g_array_unref(parameters->tools);
        g_hash_table_unref(parameters->ids);
        g_ptr_array_unref(parameters->names);
        g_array_unref(parameters->undo->named_locals);
        g_array_unref(parameters->undo->globals);
        g_array_unref(parameters->undo->tools);
        g_array_unref(parameters->undo->changed);
        g_free(parameters->undo);
        g_free(parameters);
    }
}

void nc_parameters_begin(NcParameters *parameters)
{
    struct NcUndo *undo = parameters->undo;
    for (guint i = 0; i < undo->changed->len; i++)
        undo->noted[g_array_index(undo->changed, Change, i).index] = false;
    g_array_set_size(undo->changed, 0);
    memcpy(undo->locals, parameters->numbered + 1, sizeof undo->locals);
    copy(undo->named_locals, innermost(parameters)->locals);
    copy(undo->globals, parameters->globals);
    copy(undo->tools, parameters->tools);
}

void nc_parameters_take_back(NcParameters *parameters)
{
    const struct NcUndo *undo = parameters->undo;
    for (guint i = 0; i < undo->changed->len; i++) {
        const Change *change = &g_array_index(undo->changed, Change, i);
        parameters->numbered[change->index] = change->was;
    }
    memcpy(parameters->numbered + 1, undo->locals, sizeof undo->locals);
    copy(innermost(parameters)->locals, undo->named_locals);
    copy(parameters->globals, undo->globals);
    copy(parameters->tools, undo->tools);
}

const NcToolOffset *nc_parameters_tool(const NcParameters *parameters, int number)
{
    for (guint i = 0; i < parameters->tools->len; i++) {
        const NcToolOffset *tool = &g_array_index(parameters->tools, NcToolOffset, i);
        if (tool->number == number)
            return tool;
    }
    return NULL;
}

void nc_parameters_set_tool(NcParameters *parameters, NcToolOffset tool)
{
    for (guint i = 0; i < parameters->tools->len; i++) {
        NcToolOffset *known = &g_array_index(parameters->tools, NcToolOffset, i);
        if (known->number == tool.number) {
            *known = tool;
            return;
        }
    }
    g_array_append_val(parameters->tools, tool);
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

static void set_numbered(NcParameters *parameters, int index, double value)
{
    struct NcUndo *undo = parameters->undo;
    if (index > NC_N_LOCAL_PARAMETERS && !undo->noted[index]) {
        const Change change = {index, parameters->numbered[index]};
        g_array_append_val(undo->changed, change);
        undo->noted[index] = true;
    }
    parameters->numbered[index] = value;
}

void nc_parameter_set(NcParameters *parameters, NcParameter parameter, double value)
{
    if (!parameter.named) {
        set_numbered(parameters, parameter.index, value);
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
