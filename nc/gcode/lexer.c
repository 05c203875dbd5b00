/* SPDX-License-Identifier: Apache-2.0 */
/* A line of RS-274 into words [NIST 3.3]: spaces and case mean nothing outside comments. */
#include "nc/gcode/interpreter.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* No machine is larger; it keeps squares of coordinates far from overflow. */
#define LARGEST_NUMBER 1e9

typedef struct {
    const char *start, *at, *end;
    uint32_t line;
} Cursor;

static bool lex_comment(Cursor *cursor, NcBlock *block, GError **error);
static bool lex_word(Cursor *cursor, NcBlock *block, GError **error);
static bool lex_character(const Cursor *cursor, GError **error);
static bool lex_mark(Cursor *cursor, NcBlock *block, GError **error);

static void skip_space(Cursor *cursor)
{
    while (cursor->at < cursor->end &&
           (*cursor->at == ' ' || *cursor->at == '\t' || *cursor->at == '\r'))
        cursor->at++;
}

static char upper(char c)
{
    return c >= 'a' && c <= 'z' ? (char)(c - 'a' + 'A') : c;
}

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* All but the words, which are many. */
static void clear_block(NcBlock *block)
{
    block->n_words = 0;
    block->region = block->motion = -1;
    block->blank = block->deleted = block->percent = false;
    memset(block->letter, 0, sizeof block->letter);
    memset(block->g_word, 0, sizeof block->g_word);
    memset(block->m_word, 0, sizeof block->m_word);
    memset(block->g, -1, sizeof block->g);
    memset(block->m, -1, sizeof block->m);
}

bool nc_lex(const char *text, size_t length, uint32_t line, NcBlock *block, GError **error)
{
    if (length > 0 && text[length - 1] == '\n')
        length--;
    clear_block(block);
    if (length > NC_MAX_LINE_BYTES) {
        return nc_word_error(error, line, NULL,
                             "the block has %zu characters; at most %d are read: split it", length,
                             NC_MAX_LINE_BYTES);
    }
    Cursor cursor = {text, text, text + length, line};
    skip_space(&cursor);
    block->blank = cursor.at == cursor.end;
    for (; cursor.at < cursor.end; skip_space(&cursor)) {
        char c = upper(*cursor.at);
        if (c == ';')
            break;
        bool good;
        if (c == '(')
            good = lex_comment(&cursor, block, error);
        else if (c == '/' || c == '%')
            good = lex_mark(&cursor, block, error);
        else if (c >= 'A' && c <= 'Z')
            good = lex_word(&cursor, block, error);
        else
            good = lex_character(&cursor, error);
        if (!good)
            return false;
    }
    return true;
}

/* A place in the line, for messages that are not about a word. */
static NcWord column_at(const Cursor *cursor, const char *at)
{
    return (NcWord){.column = (int)(at - cursor->start) + 1};
}

static NcWord word_at(const Cursor *cursor, const char *first)
{
    return (NcWord){.letter = upper(*first),
                    .column = (int)(first - cursor->start) + 1,
                    .length = (int)(cursor->at - first),
                    .text = first};
}

static bool lex_character(const Cursor *cursor, GError **error)
{
    unsigned char c = (unsigned char)*cursor->at;
    NcWord here = column_at(cursor, cursor->at);
    if (c == '#' || c == '[') {
        return nc_word_error(error, cursor->line, &here,
                             "parameters and expressions are not supported");
    }
    if (c > ' ' && c < 127) {
        return nc_word_error(error, cursor->line, &here,
                             "the character \"%c\" does not belong here", c);
    }
    return nc_word_error(error, cursor->line, &here, "the byte 0x%02x does not belong here", c);
}

/* "/" may only begin a line; "%" must be alone on it. */
static bool lex_mark(Cursor *cursor, NcBlock *block, GError **error)
{
    const char *first = cursor->at;
    for (const char *p = cursor->start; p < first; p++)
        if (*p != ' ' && *p != '\t')
            return lex_character(cursor, error);
    cursor->at++;
    if (*first == '/') {
        block->deleted = true;
        return true;
    }
    skip_space(cursor);
    if (cursor->at < cursor->end)
        return nc_word_error(error, cursor->line, NULL, "%% must stand alone on its line");
    block->percent = true;
    return true;
}

/* "REGION 3 …": segmill's own comment that opens a region. */
static void read_region(NcBlock *block, const char *text, const char *end)
{
    static const char word[] = "REGION ";
    size_t n = sizeof word - 1;
    if ((size_t)(end - text) <= n || memcmp(text, word, n) != 0 || !is_digit(text[n]))
        return;
    int64_t region = 0;
    for (text += n; text < end && is_digit(*text) && region <= INT32_MAX; text++)
        region = region * 10 + (*text - '0');
    if (region > 0 && region <= INT32_MAX && (text == end || *text == ' '))
        block->region = (int32_t)region;
}

static bool lex_comment(Cursor *cursor, NcBlock *block, GError **error)
{
    NcWord open = column_at(cursor, cursor->at);
    const char *text = ++cursor->at;
    while (cursor->at < cursor->end && *cursor->at != ')') {
        if (*cursor->at == '(') {
            NcWord here = column_at(cursor, cursor->at);
            return nc_word_error(error, cursor->line, &here,
                                 "a comment cannot be inside a comment");
        }
        cursor->at++;
    }
    if (cursor->at == cursor->end)
        return nc_word_error(error, cursor->line, &open, "the comment is not closed with \")\"");
    read_region(block, text, cursor->at);
    cursor->at++;
    return true;
}

/*
 * [+-]digits[.digits] with at least one digit; spaces may stand anywhere. Up to 15 digits and 22
 * decimals the quotient of two exact doubles is the nearest double (W. Clinger, "How to read
 * floating point numbers accurately", PLDI 1990); longer ones go to strtod.
 */
static bool lex_number(Cursor *cursor, double *value)
{
    static const double power[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                   1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                   1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    char digits[NC_MAX_LINE_BYTES + 1];
    int n = 0, n_significant = 0, n_decimals = 0;
    uint64_t mantissa = 0;
    bool point = false, negative = false;
    skip_space(cursor);
    if (cursor->at < cursor->end && (*cursor->at == '+' || *cursor->at == '-'))
        negative = *cursor->at++ == '-';
    for (; cursor->at < cursor->end; cursor->at++) {
        char c = *cursor->at;
        if (is_digit(c)) {
            n_significant += n_significant > 0 || c != '0';
            n_decimals += point;
            mantissa = n_significant <= 15 ? mantissa * 10 + (uint64_t)(c - '0') : mantissa;
        } else if (c == '.' && !point) {
            point = true;
        } else if (c == ' ' || c == '\t') {
            continue;
        } else {
            break;
        }
        digits[n++] = c;
    }
    if (n == (int)point)
        return false;
    digits[n] = '\0';
    double number = n_significant <= 15 && n_decimals <= 22 ? (double)mantissa / power[n_decimals]
                                                            : g_ascii_strtod(digits, NULL);
    *value = negative ? -number : number;
    return number <= LARGEST_NUMBER;
}

static bool lex_word(Cursor *cursor, NcBlock *block, GError **error)
{
    const char *first = cursor->at++;
    double value = 0.0;
    bool good = lex_number(cursor, &value);
    NcWord word = word_at(cursor, first);
    while (word.length > 1 && (first[word.length - 1] == ' ' || first[word.length - 1] == '\t'))
        word.length--;
    if (!strchr("FGHIJKMNPQRSTXYZ", word.letter))
        return nc_word_error(error, cursor->line, &word, "is not supported");
    if (!good && fabs(value) > LARGEST_NUMBER)
        return nc_word_error(error, cursor->line, &word, "is too large a number");
    if (!good) {
        bool expression = cursor->at < cursor->end && strchr("#[", *cursor->at);
        return nc_word_error(error, cursor->line, &word, "%s",
                             expression ? "takes a plain number: parameters and expressions are "
                                          "not supported"
                                        : "needs a number like -12.5 behind it");
    }
    if (block->n_words == NC_MAX_WORDS)
        return nc_word_error(error, cursor->line, &word, "is one word too many for a block");
    word.value = value;
    block->words[block->n_words++] = word;
    return true;
}

bool nc_word_error(GError **error, uint32_t line, const NcWord *word, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_autofree char *message = g_strdup_vprintf(format, arguments);
    va_end(arguments);
    if (word) {
        g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM, "line %u, column %d: %.*s%s%s", line,
                    word->column, word->length, word->text, word->length ? " " : "", message);
    } else {
        g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM, "line %u: %s", line, message);
    }
    return false;
}
