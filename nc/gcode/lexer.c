/* SPDX-License-Identifier: Apache-2.0 */
/* A line of RS-274 into words [NIST 3.3]: spaces and case mean nothing outside comments. */
#include "nc/gcode/cursor.h"

#include <string.h>

/* Those that words begin with; E, O, U, V and W are not among them. */
#define LETTERS                                                                                    \
    (NC_AXES | NC_LETTER('D') | NC_LETTER('F') | NC_LETTER('G') | NC_LETTER('H') |                 \
     NC_LETTER('I') | NC_LETTER('J') | NC_LETTER('K') | NC_LETTER('L') | NC_LETTER('M') |          \
     NC_LETTER('N') | NC_LETTER('P') | NC_LETTER('Q') | NC_LETTER('R') | NC_LETTER('S') |          \
     NC_LETTER('T'))

static bool lex_comment(NcCursor *cursor, NcBlock *block, GError **error);
static bool lex_word(NcCursor *cursor, NcBlock *block, GError **error);
static bool lex_setting(NcCursor *cursor, NcBlock *block, GError **error);
static bool lex_mark(NcCursor *cursor, NcBlock *block, GError **error);

/* All but the words, which are many. */
static void clear_block(NcBlock *block)
{
    block->n_words = block->n_settings = 0;
    block->region = block->motion = -1;
    block->message = NULL;
    block->structure = block->blank = block->deleted = block->percent = false;
    memset(&block->by, 0, sizeof block->by);
    memset(block->by.g, -1, sizeof block->by.g);
    memset(block->by.m, -1, sizeof block->by.m);
}

bool nc_lex(const NcExecution *x, const char *text, size_t length, GError **error)
{
    NcBlock *block = x->block;
    if (length > 0 && text[length - 1] == '\n')
        length--;
    clear_block(block);
    if (length > NC_MAX_LINE_BYTES) {
        return nc_word_error(error, x->modal.line, NULL,
                             "the block has %zu characters; at most %d are read: split it", length,
                             NC_MAX_LINE_BYTES);
    }
    NcCursor cursor = {text, text, text + length, x};
    char c = nc_peek(&cursor);
    block->blank = cursor.at == cursor.end;
    for (; cursor.at < cursor.end && c != ';'; c = nc_peek(&cursor)) {
        bool good;
        if (c >= 'A' && c <= 'Z')
            good = lex_word(&cursor, block, error);
        else if (c == '(')
            good = lex_comment(&cursor, block, error);
        else if (c == '#')
            good = lex_setting(&cursor, block, error);
        else if (c == '/' || c == '%')
            good = lex_mark(&cursor, block, error);
        else
            good = nc_character_error(&cursor, error);
        if (!good)
            return false;
    }
    return true;
}

/* A place in the line, for messages that are not about a word. */
static NcWord column_at(const NcCursor *cursor, const char *at)
{
    return (NcWord){.column = (int)(at - cursor->start) + 1};
}

/* "/" may only begin a line; "%" must be alone on it. */
static bool lex_mark(NcCursor *cursor, NcBlock *block, GError **error)
{
    const char *first = cursor->at;
    for (const char *p = cursor->start; p < first; p++)
        if (*p != ' ' && *p != '\t')
            return nc_character_error(cursor, error);
    cursor->at++;
    if (*first == '/') {
        block->deleted = true;
        return true;
    }
    nc_peek(cursor);
    if (cursor->at < cursor->end)
        return nc_word_error(error, cursor->x->modal.line, NULL, "%% must stand alone on its line");
    block->percent = true;
    return true;
}

/* "MSG,…" and the like; of several comments the last one counts, as in LinuxCNC. */
static void read_message(NcBlock *block, const char *text, const char *end)
{
    static const char *const kinds[] = {"MSG,", "DEBUG,", "PRINT,", "LOG,"};
    block->message = NULL;
    while (text < end && (*text == ' ' || *text == '\t'))
        text++;
    for (size_t i = 0; i < G_N_ELEMENTS(kinds); i++) {
        size_t n = strlen(kinds[i]);
        if ((size_t)(end - text) < n || g_ascii_strncasecmp(text, kinds[i], n) != 0)
            continue;
        block->message = text + n;
        block->message_length = (int)(end - text - (ptrdiff_t)n);
        block->message_expands = i > 0;
    }
}

/* "REGION 3 …": segmill's own comment that opens a region. */
static void read_region(NcBlock *block, const char *text, const char *end)
{
    static const char word[] = "REGION ";
    size_t n = sizeof word - 1;
    if ((size_t)(end - text) <= n || memcmp(text, word, n) != 0 || !nc_is_digit(text[n]))
        return;
    int64_t region = 0;
    for (text += n; text < end && nc_is_digit(*text) && region <= INT32_MAX; text++)
        region = region * 10 + (*text - '0');
    if (region > 0 && region <= INT32_MAX && (text == end || *text == ' '))
        block->region = (int32_t)region;
}

static bool lex_comment(NcCursor *cursor, NcBlock *block, GError **error)
{
    NcWord open = column_at(cursor, cursor->at);
    const char *text = ++cursor->at;
    while (cursor->at < cursor->end && *cursor->at != ')') {
        if (*cursor->at == '(') {
            NcWord here = column_at(cursor, cursor->at);
            return nc_word_error(error, cursor->x->modal.line, &here,
                                 "a comment cannot be inside a comment");
        }
        cursor->at++;
    }
    if (cursor->at == cursor->end)
        return nc_word_error(error, cursor->x->modal.line, &open,
                             "the comment is not closed with \")\"");
    read_region(block, text, cursor->at);
    read_message(block, text, cursor->at);
    cursor->at++;
    return true;
}

static bool bad_value(const NcCursor *cursor, const char *first, double value, GError **error)
{
    NcWord word = nc_word_at(cursor, first);
    return nc_word_error(error, cursor->x->modal.line, &word,
                         fabs(value) > NC_LARGEST_NUMBER ? "is too large a number"
                                                         : "needs a number like -12.5 behind it");
}

/* Almost every word is a letter and a plain number. */
static bool lex_value(NcCursor *cursor, const char *first, double *value, GError **error)
{
    const char *at = cursor->at;
    if (nc_read_number(cursor, value))
        return true;
    char next = nc_peek(cursor);
    bool expression = next == '#' || next == '[' || (next >= 'A' && next <= 'Z');
    if (*value != 0.0 || !expression || memchr(at, '.', (size_t)(cursor->at - at)))
        return bad_value(cursor, first, *value, error);
    cursor->at = at;
    return nc_read_value(cursor, value, error) &&
           (fabs(*value) <= NC_LARGEST_NUMBER || bad_value(cursor, first, *value, error));
}

static bool lex_word(NcCursor *cursor, NcBlock *block, GError **error)
{
    const char *first = cursor->at++;
    double value = 0.0;
    if (!(LETTERS & NC_LETTER(nc_upper(*first)))) {
        (void)nc_read_number(cursor, &value);
        NcWord word = nc_word_at(cursor, first);
        return nc_word_error(error, cursor->x->modal.line, &word, "is not supported");
    }
    if (!lex_value(cursor, first, &value, error))
        return false;
    if (block->n_words == NC_MAX_WORDS) {
        NcWord word = nc_word_at(cursor, first);
        return nc_word_error(error, cursor->x->modal.line, &word,
                             "is one word too many for a block");
    }
    const char *end = cursor->at;
    while (end[-1] == ' ' || end[-1] == '\t')
        end--;
    NcWord *word = &block->words[block->n_words++];
    word->letter = nc_upper(*first);
    word->column = (int)(first - cursor->start) + 1;
    word->length = (int)(end - first);
    word->text = first;
    word->value = value;
    return true;
}

static bool lex_setting(NcCursor *cursor, NcBlock *block, GError **error)
{
    const char *first = cursor->at++;
    NcSetting setting;
    if (!nc_read_parameter(cursor, &setting.parameter, error))
        return false;
    NcWord word = nc_word_at(cursor, first);
    if (!nc_take(cursor, "=")) {
        return nc_word_error(error, cursor->x->modal.line, &word,
                             "needs \"=\" and a value behind it");
    }
    if (!nc_parameter_writable(cursor->x, setting.parameter)) {
        return nc_word_error(error, cursor->x->modal.line, &word,
                             "is set by the machine, not by the program");
    }
    if (!nc_read_value(cursor, &setting.value, error))
        return false;
    if (block->n_settings == NC_MAX_SETTINGS) {
        return nc_word_error(error, cursor->x->modal.line, &word,
                             "is one parameter too many for a block");
    }
    block->settings[block->n_settings++] = setting;
    return true;
}
