/* SPDX-License-Identifier: Apache-2.0 */
/* A place in a line of RS-274, for the lexer and what it calls. Spaces mean nothing. */
#ifndef NC_GCODE_CURSOR_H
#define NC_GCODE_CURSOR_H

#include "nc/gcode/interpreter.h"

typedef struct {
    const char *start, *at, *end;
    const NcExecution *x; /* whose parameters and modes the values are read from */
} NcCursor;

/* No machine is larger; it keeps squares of coordinates far from overflow. */
#define NC_LARGEST_NUMBER 1e9

static inline bool nc_is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static inline char nc_upper(char c)
{
    return c >= 'a' && c <= 'z' ? (char)(c - 'a' + 'A') : c;
}

/* The next character that means something, in upper case; '\0' at the end. */
static inline char nc_peek(NcCursor *cursor)
{
    while (cursor->at < cursor->end &&
           (*cursor->at == ' ' || *cursor->at == '\t' || *cursor->at == '\r'))
        cursor->at++;
    return cursor->at < cursor->end ? nc_upper(*cursor->at) : '\0';
}

/* Passes over `text` (upper case) if that is what comes, spaces inside or not. */
bool nc_take(NcCursor *cursor, const char *text);

extern const double nc_power_of_ten[23];

/* A number behind its sign, with spaces inside or with many digits; false where there is none. */
bool nc_read_rare_number(NcCursor *cursor, double *number);

static inline bool nc_digits_go_on(const char *at, const char *end)
{
    while (at < end && (*at == ' ' || *at == '\t'))
        at++;
    return at < end && (nc_is_digit(*at) || *at == '.');
}

/*
 * [+-]digits[.digits] with at least one digit. False where there is none, or it is too large: then
 * the value is.
 *
 * Up to 15 digits and 22 decimals the quotient of two exact doubles is the nearest double
 * (W. Clinger, "How to read floating point numbers accurately", PLDI 1990); longer ones go to
 * strtod.
 */
static inline bool nc_read_number(NcCursor *cursor, double *value)
{
    const char sign = nc_peek(cursor), *end = cursor->end;
    cursor->at += sign == '+' || sign == '-';
    const char *const first = cursor->at, *at = first;
    uint64_t mantissa = 0;
    ptrdiff_t n_decimals = 0, n = 0;
    for (; at < end && nc_is_digit(*at); at++)
        mantissa = mantissa * 10 + (uint64_t)(*at - '0');
    n = at - first;
    if (at < end && *at == '.') {
        const char *const point = ++at;
        for (; at < end && nc_is_digit(*at); at++)
            mantissa = mantissa * 10 + (uint64_t)(*at - '0');
        n_decimals = at - point;
        n += n_decimals;
    }
    double number = 0.0;
    if (n > 0 && n <= 15 && (at == end || (*at > ' ' && *at != '.') || !nc_digits_go_on(at, end))) {
        number = (double)(int64_t)mantissa / nc_power_of_ten[n_decimals];
        cursor->at = at;
    } else if (!nc_read_rare_number(cursor, &number)) {
        return false;
    }
    *value = sign == '-' ? -number : number;
    return number <= NC_LARGEST_NUMBER;
}

/* What may stand behind a letter: a number, #parameter, [expression] or FUNCTION[…], with a sign
 * or without [NIST 3.3.2.2 and 3.3.2.3; LinuxCNC 2.9 for named parameters and comparisons]. */
bool nc_read_value(NcCursor *cursor, double *value, GError **error);

/* Where what follows "#" leads. */
bool nc_read_parameter(NcCursor *cursor, NcParameter *parameter, GError **error);

/* The text from `first` to the cursor, for messages; blanks behind it left off. */
NcWord nc_word_at(const NcCursor *cursor, const char *first);

/* The character at the cursor does not belong there. */
bool nc_character_error(const NcCursor *cursor, GError **error);

#endif
