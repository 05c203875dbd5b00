/* SPDX-License-Identifier: Apache-2.0 */
/* Structures of O words, executed. */
#include "nc/gcode/cursor.h"
#include "nc/gcode/flow.h"

#include <string.h>

typedef struct {
    const NcFlow *flow;
    NcExecution *x;
    int calls;
    int lines;   /* executed so far */
    guint moves; /* there when it began */
} Run;

static bool run_lines(Run *run, const GArray *lines, GError **error);

bool nc_flow_run(const NcFlow *flow, NcExecution *x, const GArray *lines, GError **error)
{
    return run_lines(&(Run){flow, x, 0, 0, x->moves->len}, lines, error);
}

/* What stands behind the keyword. */
static NcCursor rest_of(const Run *run, const NcFlowLine *line)
{
    return (NcCursor){line->text, line->text + line->rest, line->text + line->length, run->x};
}

static bool at_value(NcCursor *cursor, GError **error)
{
    char c = nc_peek(cursor);
    return c == '[' || c == '#' || c == '\0' || nc_character_error(cursor, error);
}

/* Comments may stand between arguments and behind them. */
static bool skip_comments(NcCursor *cursor, GError **error)
{
    char c;
    while ((c = nc_peek(cursor)) == '(') {
        const char *close = memchr(cursor->at, ')', (size_t)(cursor->end - cursor->at));
        if (!close)
            return nc_character_error(cursor, error);
        cursor->at = close + 1;
    }
    if (c == ';')
        cursor->at = cursor->end;
    return true;
}

static bool at_end(NcCursor *cursor, GError **error)
{
    return skip_comments(cursor, error) &&
           (nc_peek(cursor) == '\0' || nc_character_error(cursor, error));
}

static bool read_condition(const Run *run, const NcFlowLine *line, double *value, GError **error)
{
    run->x->modal.line = line->line;
    NcCursor cursor = rest_of(run, line);
    if (nc_peek(&cursor) != '[')
        return nc_character_error(&cursor, error);
    return nc_read_value(&cursor, value, error) && at_end(&cursor, error);
}

static void set_named(const Run *run, const char *name, double value)
{
    NcParameters *parameters = run->x->parameters;
    nc_parameter_set(parameters, nc_parameter_named(parameters, name), value);
}

/* endsub and return may bring a value. */
static bool read_result(const Run *run, const NcFlowLine *line, GError **error)
{
    NcCursor cursor = rest_of(run, line);
    double value = 0.0;
    if (!skip_comments(&cursor, error) || !at_value(&cursor, error))
        return false;
    bool brings = nc_peek(&cursor) != '\0';
    if (brings && (!nc_read_value(&cursor, &value, error) || !at_end(&cursor, error)))
        return false;
    set_named(run, "_VALUE", value);
    set_named(run, "_VALUE_RETURNED", brings);
    return true;
}

/* ------------------------------------------------------------------------- calls */

/* Of "o[2*#1] call" the label is known only now. */
static const GArray *find_sub(const Run *run, const NcFlowLine *line, GError **error)
{
    NcCursor cursor = {line->text, line->text + line->label_at, line->text + line->length, run->x};
    g_autofree char *label = g_strdup(line->label);
    if (!label) {
        double value = 0.0;
        if (!nc_read_value(&cursor, &value, error))
            return NULL;
        label = g_strdup_printf("%.0f", value);
    }
    const GArray *sub = g_hash_table_lookup(run->flow->subs, label);
    if (!sub) {
        nc_word_error(error, line->line, NULL,
                      "o%s is not a subroutine known here: it has to stand in the program, before "
                      "its call",
                      label);
    }
    return sub;
}

static bool call(Run *run, const NcFlowLine *line, GError **error)
{
    NcExecution *x = run->x;
    double arguments[NC_N_LOCAL_PARAMETERS] = {0.0};
    NcCursor cursor = rest_of(run, line);
    const GArray *sub = find_sub(run, line, error);
    if (!sub || !skip_comments(&cursor, error))
        return false;
    for (int n = 0; nc_peek(&cursor) != '\0'; n++) {
        if (!at_value(&cursor, error))
            return false;
        if (n == NC_N_LOCAL_PARAMETERS)
            return nc_word_error(error, line->line, NULL, "a call has at most 30 arguments");
        if (!nc_read_value(&cursor, &arguments[n], error) || !skip_comments(&cursor, error))
            return false;
    }
    if (run->calls == NC_MAX_CALLS) {
        return nc_word_error(error, line->line, NULL,
                             "subroutines are called %d deep: no deeper call is read",
                             NC_MAX_CALLS);
    }
    run->calls++;
    nc_parameters_enter(x->parameters, arguments);
    set_named(run, "_VALUE", 0.0);
    set_named(run, "_VALUE_RETURNED", 0.0);
    bool good = run_lines(run, sub, error);
    nc_parameters_leave(x->parameters);
    run->calls--;
    return good;
}

/* ------------------------------------------------------------------ control flow */

/* From an if to the branch that is taken: its first line. */
static bool choose_branch(const Run *run, const GArray *lines, int *at, GError **error)
{
    const NcFlowLine *line = &g_array_index(lines, NcFlowLine, *at);
    double value = 0.0;
    while (line->kind == NC_FLOW_IF || line->kind == NC_FLOW_ELSEIF) {
        if (!read_condition(run, line, &value, error))
            return false;
        if (value != 0.0)
            break;
        *at = line->next;
        line = &g_array_index(lines, NcFlowLine, *at);
    }
    ++*at;
    return true;
}

/* How often a repeat has to be done yet is kept at its line; it counts anew when it is reached. */
static bool step_loop(const Run *run, const NcFlowLine *line, double *left, int *at, GError **error)
{
    double value = 0.0;
    switch (line->kind) {
    case NC_FLOW_WHILE:
        if (!read_condition(run, line, &value, error))
            return false;
        *at = value != 0.0 ? *at + 1 : line->end + 1;
        return true;
    case NC_FLOW_ENDWHILE:
        *at = line->begin;
        return true;
    case NC_FLOW_DO_WHILE:
        if (!read_condition(run, line, &value, error))
            return false;
        *at = value != 0.0 ? line->begin + 1 : *at + 1;
        return true;
    case NC_FLOW_REPEAT:
        if (!read_condition(run, line, &value, error))
            return false;
        left[*at] = round(value);
        *at = left[*at] >= 1.0 ? *at + 1 : line->end + 1;
        return true;
    case NC_FLOW_ENDREPEAT:
        *at = --left[line->begin] >= 1.0 ? line->begin + 1 : *at + 1;
        return true;
    default:
        ++*at;
        return true;
    }
}

static void jump(const GArray *lines, const NcFlowLine *line, int *at)
{
    const NcFlowLine *loop = &g_array_index(lines, NcFlowLine, line->begin);
    if (line->kind == NC_FLOW_BREAK)
        *at = loop->end + 1;
    else
        *at = loop->kind == NC_FLOW_WHILE ? line->begin : loop->end; /* an endrepeat */
}

static bool step(Run *run, const GArray *lines, double *left, int *at, GError **error)
{
    const NcFlowLine *line = &g_array_index(lines, NcFlowLine, *at);
    bool good = true;
    switch (line->kind) {
    case NC_FLOW_BLOCK:
        good = nc_run_block(run->x, line->text, line->length, error);
        ++*at;
        return good;
    case NC_FLOW_CALL:
        good = call(run, line, error);
        ++*at;
        return good;
    case NC_FLOW_IF:
        return choose_branch(run, lines, at, error);
    case NC_FLOW_ELSEIF:
    case NC_FLOW_ELSE:
        *at = line->end + 1;
        return true;
    case NC_FLOW_BREAK:
    case NC_FLOW_CONTINUE:
        jump(lines, line, at);
        return true;
    case NC_FLOW_RETURN:
    case NC_FLOW_ENDSUB:
        *at = (int)lines->len;
        return read_result(run, line, error);
    default:
        return step_loop(run, line, left, at, error);
    }
}

static bool run_lines(Run *run, const GArray *lines, GError **error)
{
    NcExecution *x = run->x;
    g_autofree double *left = g_new0(double, lines->len);
    for (int at = 0; at < (int)lines->len && !x->modal.ended;) {
        const NcFlowLine *line = &g_array_index(lines, NcFlowLine, at);
        x->modal.line = line->line;
        if (++run->lines > NC_MAX_FLOW_LINES) {
            return nc_word_error(error, line->line, NULL,
                                 "%d lines were executed since the O word began: does it end?",
                                 NC_MAX_FLOW_LINES);
        }
        if (x->moves->len - run->moves > NC_MAX_FLOW_MOVES) {
            return nc_word_error(error, line->line, NULL,
                                 "%d moves were made since the O word began: does it end?",
                                 NC_MAX_FLOW_MOVES);
        }
        if (!step(run, lines, left, &at, error))
            return false;
    }
    return true;
}
