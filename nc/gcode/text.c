/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/gcode/text.h"

#include <stdarg.h>
#include <string.h>

/* Of a comment, so that its block stays within what LinuxCNC reads. */
enum { MAX_COMMENT = 200 };

static const uint64_t power[] = {1, 10, 100, 1000, 10000, 100000, 1000000};

static void reserve(NcText *text, size_t more)
{
    if (text->capacity - text->length < more) {
        text->capacity = MAX(2 * text->capacity, text->length + more + 4096);
        text->bytes = g_realloc(text->bytes, text->capacity);
    }
}

void nc_text_clear(NcText *text)
{
    g_free(text->bytes);
    *text = (NcText){0};
}

GBytes *nc_text_steal(NcText *text)
{
    GBytes *bytes = g_bytes_new_take(text->bytes, text->length);
    *text = (NcText){0};
    return bytes;
}

static void put(NcText *text, const char *string, size_t length)
{
    reserve(text, length);
    memcpy(text->bytes + text->length, string, length);
    text->length += length;
}

void nc_text_put(NcText *text, const char *string)
{
    put(text, string, strlen(string));
}

void nc_text_printf(NcText *text, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    g_autofree char *string = g_strdup_vprintf(format, arguments);
    va_end(arguments);
    nc_text_put(text, string);
}

void nc_text_word(NcText *text, char letter, int64_t value, int decimals)
{
    reserve(text, 32);
    char *out = text->bytes + text->length;
    *out++ = letter;
    if (value < 0)
        *out++ = '-';
    uint64_t size = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    uint64_t whole = size / power[decimals], rest = size % power[decimals];
    char digits[20];
    int n = 0;
    do {
        digits[n++] = (char)('0' + whole % 10);
        whole /= 10;
    } while (whole > 0);
    while (n > 0)
        *out++ = digits[--n];
    if (rest > 0) {
        *out++ = '.';
        for (int i = decimals - 1; i >= 0; i--) {
            out[i] = (char)('0' + rest % 10);
            rest /= 10;
        }
        out += decimals;
        while (out[-1] == '0')
            out--;
    }
    text->length = (size_t)(out - text->bytes);
}

void nc_text_comment(NcText *text, const char *comment)
{
    do {
        char line[MAX_COMMENT + 4];
        int n = 0;
        line[n++] = '(';
        for (; *comment && n <= MAX_COMMENT; comment++) {
            char c = *comment;
            line[n++] = (char)(c == '(' ? '[' : c == ')' ? ']' : c < ' ' || c > '~' ? '?' : c);
        }
        line[n++] = ')';
        line[n++] = '\n';
        put(text, line, (size_t)n);
    } while (*comment);
}
