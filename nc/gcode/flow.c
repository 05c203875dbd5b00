/* SPDX-License-Identifier: Apache-2.0 */
/* Lines into structures: which line closes what, found while they come. */
#include "nc/gcode/flow.h"

#include "nc/gcode/cursor.h"

#include <string.h>

static bool read_line(NcFlowLine *line, NcCursor *cursor, bool *deleted, GError **error);
static bool link_line(NcFlow *flow, NcFlowLine *line, GError **error);
static bool finish(NcFlow *flow, NcExecution *x, GError **error);
static NcFlowLine *innermost(const NcFlow *flow);
static bool link_error(const NcFlowLine *line, GError **error, const char *why);

static void line_clear(void *data)
{
    NcFlowLine *line = data;
    g_free(line->text);
    g_free(line->label);
}

static GArray *lines_new(void)
{
    GArray *lines = g_array_new(FALSE, FALSE, sizeof(NcFlowLine));
    g_array_set_clear_func(lines, line_clear);
    return lines;
}

NcFlow *nc_flow_new(void)
{
    NcFlow *flow = g_new0(NcFlow, 1);
    flow->lines = lines_new();
    flow->open = g_array_new(FALSE, FALSE, sizeof(int));
    flow->subs =
        g_hash_table_new_full(g_str_hash, g_str_equal, g_free, (GDestroyNotify)g_array_unref);
    return flow;
}

void nc_flow_free(NcFlow *flow)
{
    if (flow) {
        g_array_unref(flow->lines);
        g_array_unref(flow->open);
        g_hash_table_unref(flow->subs);
        g_free(flow);
    }
}

static NcFlowLine *line_at(const NcFlow *flow, int index)
{
    return &g_array_index(flow->lines, NcFlowLine, index);
}

/* Passes over "/" and the line number. */
static bool at_o_word(NcCursor *cursor, bool *deleted)
{
    *deleted = nc_take(cursor, "/");
    if (nc_take(cursor, "N"))
        while (nc_is_digit(nc_peek(cursor)))
            cursor->at++;
    return nc_peek(cursor) == 'O';
}

bool nc_flow_takes(const NcFlow *flow, const char *text, size_t length)
{
    if (nc_flow_open(flow))
        return true;
    NcCursor cursor = {text, text, text + length, NULL};
    char c = nc_peek(&cursor);
    bool deleted;
    return c == 'O' || ((c == '/' || c == 'N') && at_o_word(&cursor, &deleted));
}

bool nc_flow_open(const NcFlow *flow)
{
    return flow->open->len > 0;
}

bool nc_flow_open_error(const NcFlow *flow, GError **error)
{
    return link_error(innermost(flow), error, "is not closed before the program's end");
}

/* The structure closes with its first line's match; then it runs, or is a subroutine and kept. */
bool nc_flow_read(NcFlow *flow, NcExecution *x, const char *text, size_t length, GError **error)
{
    if (length > 0 && text[length - 1] == '\n')
        length--;
    NcFlowLine line = {.line = x->modal.line,
                       .text = g_strndup(text, length),
                       .length = length,
                       .begin = -1,
                       .end = -1,
                       .next = -1};
    NcCursor cursor = {line.text, line.text, line.text + length, x};
    g_autoptr(GArray) open = g_array_copy(flow->open);
    bool deleted = false;
    bool good = read_line(&line, &cursor, &deleted, error);
    if (!good || (deleted && x->block_delete && line.kind != NC_FLOW_BLOCK)) {
        line_clear(&line);
        return good;
    }
    good = link_line(flow, &line, error);
    g_array_append_val(flow->lines, line);
    if (good && flow->open->len == 0) {
        good = finish(flow, x, error);
        if (good)
            g_array_set_size(flow->lines, 0);
    }
    if (!good) {
        g_array_set_size(flow->lines, (guint)(flow->lines->len - 1));
        g_array_set_size(flow->open, 0);
        g_array_append_vals(flow->open, open->data, open->len);
    }
    return good;
}

static bool finish(NcFlow *flow, NcExecution *x, GError **error)
{
    const NcFlowLine *first = line_at(flow, 0);
    if (first->kind != NC_FLOW_SUB) {
        nc_parameters_begin(x->parameters);
        bool good = nc_flow_run(flow, x, flow->lines, error);
        if (!good)
            nc_parameters_take_back(x->parameters);
        return good;
    }
    g_hash_table_replace(flow->subs, g_strdup(first->label), g_array_ref(flow->lines));
    g_array_unref(flow->lines);
    flow->lines = lines_new();
    return true;
}

/* ------------------------------------------------------------------ reading a line */

static const struct {
    const char *text;
    NcFlowKind kind;
} keywords[] = {
    {"SUB", NC_FLOW_SUB},
    {"ENDSUB", NC_FLOW_ENDSUB},
    {"RETURN", NC_FLOW_RETURN},
    {"CALL", NC_FLOW_CALL},
    {"WHILE", NC_FLOW_WHILE},
    {"ENDWHILE", NC_FLOW_ENDWHILE},
    {"DO", NC_FLOW_DO},
    {"IF", NC_FLOW_IF},
    {"ELSEIF", NC_FLOW_ELSEIF},
    {"ELSE", NC_FLOW_ELSE},
    {"ENDIF", NC_FLOW_ENDIF},
    {"REPEAT", NC_FLOW_REPEAT},
    {"ENDREPEAT", NC_FLOW_ENDREPEAT},
    {"BREAK", NC_FLOW_BREAK},
    {"CONTINUE", NC_FLOW_CONTINUE},
};

/* "100" and "0100" are one label. */
static bool read_label(NcFlowLine *line, NcCursor *cursor, GError **error)
{
    line->label_at = (size_t)(cursor->at - cursor->start);
    g_autoptr(GString) label = g_string_new(NULL);
    char c = nc_peek(cursor);
    if (c == '[') {
        int depth = 0;
        for (; (c = nc_peek(cursor)) != '\0'; cursor->at++) {
            depth += (c == '[') - (c == ']');
            if (depth == 0)
                break;
        }
    } else if (c == '<') {
        for (; (c = nc_peek(cursor)) != '\0' && c != '>'; cursor->at++)
            g_string_append_c(label, c);
        g_string_append_c(label, '>');
    } else if (nc_is_digit(c)) {
        for (; nc_is_digit(c = nc_peek(cursor)); cursor->at++)
            if (c != '0' || label->len > 0)
                g_string_append_c(label, c);
        if (label->len == 0)
            g_string_append_c(label, '0');
        line->label = g_strdup(label->str);
        return true;
    } else {
        return nc_character_error(cursor, error);
    }
    if (c == '\0')
        return nc_character_error(cursor, error);
    cursor->at++;
    line->label = label->len > 0 ? g_strdup(label->str) : NULL;
    return true;
}

static bool read_line(NcFlowLine *line, NcCursor *cursor, bool *deleted, GError **error)
{
    uint32_t number = cursor->x->modal.line;
    if (nc_peek(cursor) == '%') {
        return nc_word_error(error, number, NULL,
                             "%% ends the program, and an O word is not closed yet");
    }
    if (!at_o_word(cursor, deleted))
        return true;
    const char *first = cursor->at++;
    if (!read_label(line, cursor, error))
        return false;
    NcWord word = nc_word_at(cursor, first);
    for (size_t i = 0; i < G_N_ELEMENTS(keywords); i++) {
        if (!nc_take(cursor, keywords[i].text))
            continue;
        line->kind = keywords[i].kind;
        line->rest = (size_t)(cursor->at - cursor->start);
        return line->label || line->kind == NC_FLOW_CALL ||
               nc_word_error(error, number, &word, "may be an expression only before call");
    }
    return nc_word_error(error, number, &word,
                         "needs sub, call, while, do, if or repeat, or what closes them, behind "
                         "it: numbered programs are not supported");
}

/* ------------------------------------------------------------------------- linking */

static bool link_error(const NcFlowLine *line, GError **error, const char *why)
{
    NcWord word = {.column = 1, .text = line->text, .length = (int)line->rest};
    return nc_word_error(error, line->line, &word, "%s", why);
}

static void open_structure(NcFlow *flow)
{
    int index = (int)flow->lines->len;
    g_array_append_val(flow->open, index);
}

static NcFlowLine *innermost(const NcFlow *flow)
{
    return flow->open->len > 0 ? line_at(flow, g_array_index(flow->open, int, flow->open->len - 1))
                               : NULL;
}

/* The open structure of this label and one of these kinds; -1: none. */
static int find_open(const NcFlow *flow, const char *label, unsigned kinds)
{
    for (guint i = flow->open->len; i > 0; i--) {
        int index = g_array_index(flow->open, int, i - 1);
        const NcFlowLine *line = line_at(flow, index);
        if ((kinds >> line->kind & 1) && (!label || g_str_equal(line->label, label)))
            return index;
    }
    return -1;
}

static bool close_structure(NcFlow *flow, NcFlowLine *line, NcFlowKind opener, GError **error)
{
    NcFlowLine *first = innermost(flow);
    if (!first || first->kind != opener || !g_str_equal(first->label, line->label))
        return link_error(line, error, "closes nothing that is open here");
    line->begin = g_array_index(flow->open, int, flow->open->len - 1);
    first->end = (int)flow->lines->len;
    g_array_set_size(flow->open, flow->open->len - 1);
    return true;
}

/* Gives the branch before this one its way here; at the endif all learn where it is. */
static bool link_branch(NcFlow *flow, NcFlowLine *line, GError **error)
{
    NcFlowLine *first = innermost(flow);
    if (!first || first->kind != NC_FLOW_IF || !g_str_equal(first->label, line->label))
        return link_error(line, error, "belongs to no if that is open here");
    int at = g_array_index(flow->open, int, flow->open->len - 1), here = (int)flow->lines->len;
    while (line_at(flow, at)->next >= 0 && line_at(flow, at)->next < here)
        at = line_at(flow, at)->next;
    if (line_at(flow, at)->kind == NC_FLOW_ELSE && line->kind != NC_FLOW_ENDIF)
        return link_error(line, error, "comes after the else");
    line_at(flow, at)->next = here;
    if (line->kind != NC_FLOW_ENDIF)
        return true;
    for (at = g_array_index(flow->open, int, flow->open->len - 1); at != here;
         at = line_at(flow, at)->next)
        line_at(flow, at)->end = here;
    g_array_set_size(flow->open, flow->open->len - 1);
    return true;
}

static bool link_jump(const NcFlow *flow, NcFlowLine *line, GError **error)
{
    line->begin =
        find_open(flow, line->label, 1u << NC_FLOW_WHILE | 1u << NC_FLOW_DO | 1u << NC_FLOW_REPEAT);
    if (line->begin < 0)
        return link_error(line, error, "leaves no loop that is open here");
    bool of_do = line_at(flow, line->begin)->kind == NC_FLOW_DO;
    return line->kind == NC_FLOW_BREAK || !of_do ||
           link_error(
               line, error,
               "is not supported in a do loop: LinuxCNC goes on there without its condition");
}

static bool link_line(NcFlow *flow, NcFlowLine *line, GError **error)
{
    const NcFlowLine *inside = innermost(flow);
    switch (line->kind) {
    case NC_FLOW_SUB:
        if (inside)
            return link_error(line, error, "cannot begin inside another O word's lines");
        open_structure(flow);
        return true;
    case NC_FLOW_WHILE:
        if (inside && inside->kind == NC_FLOW_DO && g_str_equal(inside->label, line->label)) {
            line->kind = NC_FLOW_DO_WHILE;
            return close_structure(flow, line, NC_FLOW_DO, error);
        }
        open_structure(flow);
        return true;
    case NC_FLOW_DO:
    case NC_FLOW_IF:
    case NC_FLOW_REPEAT:
        open_structure(flow);
        return true;
    case NC_FLOW_ENDSUB:
        return close_structure(flow, line, NC_FLOW_SUB, error);
    case NC_FLOW_ENDWHILE:
        return close_structure(flow, line, NC_FLOW_WHILE, error);
    case NC_FLOW_ENDREPEAT:
        return close_structure(flow, line, NC_FLOW_REPEAT, error);
    case NC_FLOW_ELSEIF:
    case NC_FLOW_ELSE:
    case NC_FLOW_ENDIF:
        return link_branch(flow, line, error);
    case NC_FLOW_BREAK:
    case NC_FLOW_CONTINUE:
        return link_jump(flow, line, error);
    case NC_FLOW_RETURN:
        return find_open(flow, line->label, 1u << NC_FLOW_SUB) >= 0 ||
               link_error(line, error, "leaves no subroutine that is open here");
    case NC_FLOW_CALL:
    case NC_FLOW_BLOCK:
    case NC_FLOW_DO_WHILE:
        return true;
    }
    return true;
}
