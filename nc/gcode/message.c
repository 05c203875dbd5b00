/* SPDX-License-Identifier: Apache-2.0 */
/* Comments that speak to people [LinuxCNC 2.9, "Messages", "Debug Messages", "Print Messages"]. */
#include "nc/gcode/message.h"

#include "nc/gcode/cursor.h"

#include <string.h>

NcMessages *nc_messages_new(void)
{
    NcMessages *messages = g_new(NcMessages, 1);
    messages->texts = g_ptr_array_new_with_free_func(g_free);
    messages->numbers = g_hash_table_new(g_str_hash, g_str_equal);
    return messages;
}

void nc_messages_free(NcMessages *messages)
{
    if (messages) {
        g_hash_table_unref(messages->numbers);
        g_ptr_array_unref(messages->texts);
        g_free(messages);
    }
}

int nc_messages_add(NcMessages *messages, const char *text)
{
    void *number;
    if (g_hash_table_lookup_extended(messages->numbers, text, NULL, &number))
        return GPOINTER_TO_INT(number);
    int next = (int)messages->texts->len;
    char *kept = g_strdup(text);
    g_ptr_array_add(messages->texts, kept);
    g_hash_table_insert(messages->numbers, kept, GINT_TO_POINTER(next));
    return next;
}

const char *nc_interpreter_message(const NcInterpreter *interpreter, const NcMove *move)
{
    const GPtrArray *texts = interpreter->x.messages->texts;
    g_return_val_if_fail(move->kind == NC_MOVE_MESSAGE && (guint)move->message < texts->len, "");
    return texts->pdata[move->message];
}

/* What the block itself sets counts already. */
static bool value_of(const NcExecution *x, NcParameter parameter, double *value)
{
    for (int i = x->block->n_settings - 1; i >= 0; i--) {
        const NcSetting *setting = &x->block->settings[i];
        if (setting->parameter.named == parameter.named &&
            setting->parameter.index == parameter.index) {
            *value = setting->value;
            return true;
        }
    }
    return nc_parameter_value(x, parameter, value);
}

/* "#5" or "#<name>"; LinuxCNC shows what has no value as "######". */
static bool put_value(GString *text, NcCursor *cursor, int decimals)
{
    NcCursor ahead = {cursor->start, cursor->at + 1, cursor->end, cursor->x};
    NcParameter parameter;
    double value = 0.0;
    char c = ahead.at < ahead.end ? *ahead.at : '\0';
    if (!nc_is_digit(c) && c != '<')
        return false;
    bool good = nc_read_parameter(&ahead, &parameter, NULL);
    if (!good && c == '<')
        return false;
    if (good && value_of(cursor->x, parameter, &value))
        g_string_append_printf(text, "%.*f", decimals, value);
    else
        g_string_append(text, "######");
    cursor->at = ahead.at;
    return true;
}

/* "%d", "%f" and "%.3f" say how the values behind them are written; -1: it is none of these. */
static int take_format(NcCursor *cursor)
{
    const char *at = cursor->at + 1;
    size_t left = (size_t)(cursor->end - at);
    if (left >= 1 && (*at == 'd' || *at == 'f')) {
        cursor->at += 2;
        return *at == 'd' ? 0 : 4;
    }
    if (left >= 3 && at[0] == '.' && nc_is_digit(at[1]) && at[2] == 'f') {
        cursor->at += 4;
        return at[1] - '0';
    }
    return -1;
}

static void expand(const NcExecution *x, GString *text)
{
    const NcBlock *block = x->block;
    NcCursor cursor = {block->message, block->message, block->message + block->message_length, x};
    int decimals = 6;
    while (cursor.at < cursor.end) {
        int format = *cursor.at == '%' ? take_format(&cursor) : -1;
        if (format >= 0)
            decimals = format;
        else if (*cursor.at != '#' || !put_value(text, &cursor, decimals))
            g_string_append_c(text, *cursor.at++);
    }
}

void nc_speak(NcExecution *x)
{
    g_autoptr(GString) text = g_string_new(NULL);
    if (x->block->message_expands)
        expand(x, text);
    else
        g_string_append_len(text, x->block->message, x->block->message_length);
    nc_append_move(x, NC_MOVE_MESSAGE)->message = nc_messages_add(x->messages, text->str);
}
