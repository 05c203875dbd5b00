/* SPDX-License-Identifier: Apache-2.0 */
/* Values: numbers, parameters, functions and expressions; angles in degrees. */
#include "nc/gcode/cursor.h"

#include <math.h>
#include <string.h>

/* LinuxCNC: EQ and NE call numbers equal that are no further apart. */
#define EQUAL_WITHIN 1e-5
/* And a parameter's number is whole within this. */
#define WHOLE_WITHIN 1e-4

typedef enum {
    OP_POWER,
    OP_TIMES,
    OP_DIVIDE,
    OP_MODULO,
    OP_PLUS,
    OP_MINUS,
    OP_EQ,
    OP_NE,
    OP_GT,
    OP_GE,
    OP_LT,
    OP_LE,
    OP_AND,
    OP_XOR,
    OP_OR,
} Operator;

/* Of those that begin alike the longer one is first. */
static const struct {
    const char *text;
    int strength;
} operators[] = {
    [OP_POWER] = {"**", 5}, [OP_TIMES] = {"*", 4}, [OP_DIVIDE] = {"/", 4}, [OP_MODULO] = {"MOD", 4},
    [OP_PLUS] = {"+", 3},   [OP_MINUS] = {"-", 3}, [OP_EQ] = {"EQ", 2},    [OP_NE] = {"NE", 2},
    [OP_GT] = {"GT", 2},    [OP_GE] = {"GE", 2},   [OP_LT] = {"LT", 2},    [OP_LE] = {"LE", 2},
    [OP_AND] = {"AND", 1},  [OP_XOR] = {"XOR", 1}, [OP_OR] = {"OR", 1},
};

static bool read_expression(NcCursor *cursor, double *value, GError **error);
static bool read_function(NcCursor *cursor, double *value, GError **error);
static bool read_named_or_numbered(NcCursor *cursor, double *value, GError **error);

static bool refuse(const NcCursor *cursor, const char *first, const char *why, GError **error)
{
    NcWord word = nc_word_at(cursor, first);
    return nc_word_error(error, cursor->x->modal.line, &word, "%s", why);
}

bool nc_read_value(NcCursor *cursor, double *value, GError **error)
{
    char c = nc_peek(cursor);
    const char *first = cursor->at;
    if (c == '+' || c == '-') {
        NcCursor ahead = {cursor->start, cursor->at + 1, cursor->end, cursor->x};
        char next = nc_peek(&ahead);
        if (next == '#' || next == '[' || (next >= 'A' && next <= 'Z')) {
            cursor->at = ahead.at;
            bool good = nc_read_value(cursor, value, error);
            *value = c == '-' ? -*value : *value;
            return good;
        }
    }
    if (c == '[')
        return read_expression(cursor, value, error);
    if (c == '#')
        return read_named_or_numbered(cursor, value, error);
    if (c >= 'A' && c <= 'Z')
        return read_function(cursor, value, error);
    if (!strchr("+-.0123456789", c) || c == '\0')
        return nc_character_error(cursor, error);
    *value = 0.0;
    if (nc_read_number(cursor, value))
        return true;
    bool large = fabs(*value) > NC_LARGEST_NUMBER;
    return refuse(cursor, first, large ? "is too large a number" : "is not a number", error);
}

/* ------------------------------------------------------------------- expressions */

static bool apply(Operator op, double *left, double right, const char **why)
{
    const double a = *left, b = right;
    switch (op) {
    case OP_POWER:
        if (a < 0.0 && b != floor(b))
            *why = "would raise a negative number to a power that is not whole";
        *left = pow(a, b);
        break;
    case OP_DIVIDE:
        if (b == 0.0)
            *why = "would divide by zero";
        *left = a / b;
        break;
    case OP_MODULO:
        *left = fmod(a, b);
        *left += *left < 0.0 ? fabs(b) : 0.0;
        break;
    case OP_TIMES:
        *left = a * b;
        break;
    case OP_PLUS:
        *left = a + b;
        break;
    case OP_MINUS:
        *left = a - b;
        break;
    case OP_EQ:
        *left = fabs(a - b) < EQUAL_WITHIN;
        break;
    case OP_NE:
        *left = !(fabs(a - b) < EQUAL_WITHIN);
        break;
    case OP_GT:
        *left = a > b;
        break;
    case OP_GE:
        *left = a >= b;
        break;
    case OP_LT:
        *left = a < b;
        break;
    case OP_LE:
        *left = a <= b;
        break;
    case OP_AND:
        *left = a != 0.0 && b != 0.0;
        break;
    case OP_XOR:
        *left = (a != 0.0) != (b != 0.0);
        break;
    case OP_OR:
        *left = a != 0.0 || b != 0.0;
        break;
    }
    if (!*why && !isfinite(*left))
        *why = "has no finite result";
    return *why == NULL;
}

/* Takes the next operator if it binds at least as strongly as `weakest`; else -1. */
static int take_operator(NcCursor *cursor, int weakest)
{
    for (int op = 0; op < (int)G_N_ELEMENTS(operators); op++) {
        const char *before = cursor->at;
        if (nc_take(cursor, operators[op].text)) {
            if (operators[op].strength >= weakest)
                return op;
            cursor->at = before;
            return -1;
        }
    }
    return -1;
}

/* Operators of one strength from left to right, "**" too. */
static bool read_terms(NcCursor *cursor, int weakest, double *value, GError **error)
{
    if (!nc_read_value(cursor, value, error))
        return false;
    for (;;) {
        nc_peek(cursor);
        const char *first = cursor->at, *why = NULL;
        int op = take_operator(cursor, weakest);
        if (op < 0)
            return true;
        double right = 0.0;
        NcCursor at_operator = *cursor;
        if (!read_terms(cursor, operators[op].strength + 1, &right, error))
            return false;
        if (!apply((Operator)op, value, right, &why))
            return refuse(&at_operator, first, why, error);
    }
}

static bool read_expression(NcCursor *cursor, double *value, GError **error)
{
    cursor->at++;
    if (!read_terms(cursor, 1, value, error))
        return false;
    if (nc_peek(cursor) != ']')
        return nc_character_error(cursor, error);
    cursor->at++;
    return true;
}

/* --------------------------------------------------------------------- functions */

typedef enum {
    F_ABS,
    F_ACOS,
    F_ASIN,
    F_ATAN,
    F_COS,
    F_EXISTS,
    F_EXP,
    F_FIX,
    F_FUP,
    F_LN,
    F_ROUND,
    F_SIN,
    F_SQRT,
    F_TAN,
} Function;

static const char *const functions[] = {
    [F_ABS] = "ABS",       [F_ACOS] = "ACOS", [F_ASIN] = "ASIN",   [F_ATAN] = "ATAN",
    [F_COS] = "COS",       [F_EXP] = "EXP",   [F_FIX] = "FIX",     [F_FUP] = "FUP",
    [F_EXISTS] = "EXISTS", [F_LN] = "LN",     [F_ROUND] = "ROUND", [F_SIN] = "SIN",
    [F_SQRT] = "SQRT",     [F_TAN] = "TAN",
};

static double degrees(double rad)
{
    return rad * 180.0 / G_PI;
}

static double radians(double deg)
{
    return deg * G_PI / 180.0;
}

static double function_of(Function function, double a)
{
    switch (function) {
    case F_ABS:
        return fabs(a);
    case F_ACOS:
        return degrees(acos(a));
    case F_ASIN:
        return degrees(asin(a));
    case F_COS:
        return cos(radians(a));
    case F_EXP:
        return exp(a);
    case F_FIX:
        return floor(a);
    case F_FUP:
        return ceil(a);
    case F_LN:
        return a > 0.0 ? log(a) : (double)NAN;
    case F_ROUND:
        return trunc(a + (a < 0.0 ? -0.5 : 0.5));
    case F_SIN:
        return sin(radians(a));
    case F_SQRT:
        return sqrt(a);
    case F_TAN:
        return tan(radians(a));
    case F_ATAN:
    case F_EXISTS:
        break;
    }
    return (double)NAN;
}

/* EXISTS[#5], EXISTS[#<name>]. */
static bool read_exists(NcCursor *cursor, double *value, GError **error)
{
    if (!nc_take(cursor, "[") || !nc_take(cursor, "#")) {
        nc_peek(cursor);
        return nc_character_error(cursor, error);
    }
    NcParameter parameter;
    double ignored;
    if (!nc_read_parameter(cursor, &parameter, error))
        return false;
    *value = nc_parameter_value(cursor->x, parameter, &ignored);
    if (nc_take(cursor, "]"))
        return true;
    nc_peek(cursor);
    return nc_character_error(cursor, error);
}

/* ATAN[y]/[x]. */
static bool read_arc_tangent(NcCursor *cursor, double *value, GError **error)
{
    double x = 0.0;
    if (!read_expression(cursor, value, error))
        return false;
    if (!nc_take(cursor, "/") || nc_peek(cursor) != '[') {
        nc_peek(cursor);
        return nc_character_error(cursor, error);
    }
    bool good = read_expression(cursor, &x, error);
    *value = degrees(atan2(*value, x));
    return good;
}

static bool read_function(NcCursor *cursor, double *value, GError **error)
{
    const char *first = cursor->at;
    for (int function = 0; function < (int)G_N_ELEMENTS(functions); function++) {
        if (!nc_take(cursor, functions[function]))
            continue;
        if (function == F_EXISTS)
            return read_exists(cursor, value, error);
        if (nc_peek(cursor) != '[')
            return nc_character_error(cursor, error);
        if (function == F_ATAN)
            return read_arc_tangent(cursor, value, error);
        NcCursor at_name = *cursor;
        if (!read_expression(cursor, value, error))
            return false;
        *value = function_of((Function)function, *value);
        return isfinite(*value) || refuse(&at_name, first, "has no value for this argument", error);
    }
    cursor->at++;
    return refuse(cursor, first, "is no function: a number is needed here", error);
}

/* -------------------------------------------------------------------- parameters */

/* Behind "<". */
static bool read_name(NcCursor *cursor, NcParameter *parameter, GError **error)
{
    const char *first = cursor->at - 1;
    char name[NC_MAX_LINE_BYTES + 1];
    size_t n = 0;
    for (char c; (c = nc_peek(cursor)) != '>'; cursor->at++) {
        if (c <= ' ' || c > '~' || strchr("<[]", c))
            return c == '\0' ? refuse(cursor, first, "is not closed with \">\"", error)
                             : nc_character_error(cursor, error);
        name[n++] = c;
    }
    cursor->at++;
    name[n] = '\0';
    if (n == 0)
        return refuse(cursor, first, "has no name in it", error);
    *parameter = nc_parameter_named(cursor->x->parameters, name);
    return true;
}

bool nc_read_parameter(NcCursor *cursor, NcParameter *parameter, GError **error)
{
    char c = nc_peek(cursor);
    const char *first = cursor->at;
    if (c == '<') {
        cursor->at++;
        return read_name(cursor, parameter, error);
    }
    double number = 0.0;
    if (!nc_read_value(cursor, &number, error))
        return false;
    double whole = round(number);
    if (fabs(number - whole) > WHOLE_WITHIN || whole < 1.0 || whole > NC_LAST_PARAMETER)
        return refuse(cursor, first, "is no parameter: they are #1 to #5601", error);
    *parameter = (NcParameter){.index = (int)whole};
    return true;
}

static bool read_named_or_numbered(NcCursor *cursor, double *value, GError **error)
{
    const char *first = cursor->at++;
    NcParameter parameter;
    if (!nc_read_parameter(cursor, &parameter, error))
        return false;
    if (nc_parameter_hidden(cursor->x, parameter))
        return refuse(cursor, first, "is not known while the cutter's radius is compensated",
                      error);
    return nc_parameter_value(cursor->x, parameter, value) ||
           refuse(cursor, first, "was never set", error);
}
