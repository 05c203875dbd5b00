/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/gcode/cursor.h"

#include <stdarg.h>

bool nc_take(NcCursor *cursor, const char *text)
{
    NcCursor ahead = *cursor;
    for (; *text; text++) {
        if (nc_peek(&ahead) != *text)
            return false;
        ahead.at++;
    }
    cursor->at = ahead.at;
    return true;
}

const double nc_power_of_ten[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                  1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                  1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

bool nc_read_rare_number(NcCursor *cursor, double *number)
{
    char digits[NC_MAX_LINE_BYTES + 1];
    int n = 0, n_significant = 0, n_decimals = 0;
    uint64_t mantissa = 0;
    bool point = false;
    for (; cursor->at < cursor->end; cursor->at++) {
        char c = *cursor->at;
        if (nc_is_digit(c)) {
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
    *number = n_significant <= 15 && n_decimals <= 22
                  ? (double)mantissa / nc_power_of_ten[n_decimals]
                  : g_ascii_strtod(digits, NULL);
    return true;
}

NcWord nc_word_at(const NcCursor *cursor, const char *first)
{
    NcWord word = {.letter = nc_upper(*first),
                   .column = (int)(first - cursor->start) + 1,
                   .length = (int)(cursor->at - first),
                   .text = first};
    while (word.length > 1 && (first[word.length - 1] == ' ' || first[word.length - 1] == '\t'))
        word.length--;
    return word;
}

bool nc_character_error(const NcCursor *cursor, GError **error)
{
    uint32_t line = cursor->x->modal.line;
    NcWord here = {.column = (int)(cursor->at - cursor->start) + 1};
    if (cursor->at >= cursor->end)
        return nc_word_error(error, line, &here, "the block ends too early");
    unsigned char c = (unsigned char)*cursor->at;
    if (c > ' ' && c < 127)
        return nc_word_error(error, line, &here, "the character \"%c\" does not belong here", c);
    return nc_word_error(error, line, &here, "the byte 0x%02x does not belong here", c);
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
