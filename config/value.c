/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#include <errno.h>
#include <math.h>
#include <string.h>

/* "0-2000000000" must not take all the memory there is. */
#define MAX_LIST 1000000

#define FIELD(type) ((type *)(void *)((char *)object + key->offset))
#define COUNT (*(size_t *)(void *)((char *)object + key->count_offset))

typedef bool Read(const CfgKey *key, const char *text, void *object, char **why);

static Read read_string, read_bool, read_int, read_bytes, read_real, read_vector, read_choice,
    read_numbers, read_pairs, read_cutting;

static Read *const readers[] = {
    [CFG_STRING] = read_string,   [CFG_FILE] = NULL,
    [CFG_BOOL] = read_bool,       [CFG_INT] = read_int,
    [CFG_BYTES] = read_bytes,     [CFG_REAL] = read_real,
    [CFG_VECTOR] = read_vector,   [CFG_CHOICE] = read_choice,
    [CFG_NUMBERS] = read_numbers, [CFG_PAIRS] = read_pairs,
    [CFG_CUTTING] = read_cutting,
};

bool cfg_value_read(const CfgKey *key, const char *text, const char *folder, void *object,
                    char **why)
{
    if (key->type != CFG_FILE)
        return readers[key->type](key, text, object, why);
    *FIELD(char *) = *text ? g_canonicalize_filename(text, folder) : NULL;
    return true;
}

static void free_cutting(CfgCutting *cutting, size_t n)
{
    for (size_t i = 0; i < n; i++)
        g_free(cutting[i].material);
    g_free(cutting);
}

void cfg_value_free(const CfgKey *key, void *object)
{
    switch (key->type) {
    case CFG_STRING:
    case CFG_FILE:
    case CFG_NUMBERS:
    case CFG_PAIRS:
        g_free(*FIELD(void *));
        break;
    case CFG_CUTTING:
        free_cutting(*FIELD(CfgCutting *), COUNT);
        break;
    default:
        break;
    }
}

static bool no(char **why, const char *format, ...) G_GNUC_PRINTF(2, 3);
static bool no(char **why, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    *why = g_strdup_vprintf(format, args);
    va_end(args);
    return false;
}

static const CfgChoice *find_choice(const CfgKey *key, const char *text, char **why);

static bool in_range(const CfgKey *key, double value, char **why)
{
    if (value >= key->min && value <= key->max)
        return true;
    return no(why, "%.12g is out of range: %.12g … %.12g%s%s", value, key->min, key->max,
              *key->unit ? " " : "", key->unit);
}

/* One number and nothing else. strtod alone would take "1 2", "nan" and "0x10". */
static bool number(const CfgKey *key, const char *text, double *value, char **why)
{
    char *end;
    *value = g_ascii_strtod(text, &end);
    if (!*text || *end || !isfinite(*value) || strpbrk(text, "xXnN"))
        return no(why, "'%s' is not a number", text);
    return in_range(key, *value, why);
}

static bool whole(const CfgKey *key, const char *text, double *value, char **why)
{
    if (!number(key, text, value, why))
        return false;
    return *value == floor(*value) || no(why, "'%s' is not a whole number", text);
}

static bool read_string(const CfgKey *key, const char *text, void *object, char **why)
{
    if (key->choices && !find_choice(key, text, why))
        return false;
    *FIELD(char *) = *text ? g_strdup(text) : NULL;
    return true;
}

static bool read_bool(const CfgKey *key, const char *text, void *object, char **why)
{
    *FIELD(bool) = strcmp(text, "true") == 0;
    return *FIELD(bool) || strcmp(text, "false") == 0 ||
           no(why, "'%s' is neither true nor false", text);
}

static bool read_int(const CfgKey *key, const char *text, void *object, char **why)
{
    double value;
    if (!whole(key, text, &value, why))
        return false;
    *FIELD(int) = (int)value;
    return true;
}

static bool read_bytes(const CfgKey *key, const char *text, void *object, char **why)
{
    double value;
    if (!whole(key, text, &value, why))
        return false;
    *FIELD(uint64_t) = (uint64_t)value;
    return true;
}

static bool read_real(const CfgKey *key, const char *text, void *object, char **why)
{
    return number(key, text, FIELD(double), why);
}

/* The parts of `text` between `separator`, stripped; none for an empty text. */
static char **split(const char *text, const char *separator)
{
    char **parts = g_strsplit(text, separator, -1);
    for (char **p = parts; *p; p++)
        g_strstrip(*p);
    return parts;
}

static bool read_vector(const CfgKey *key, const char *text, void *object, char **why)
{
    g_auto(GStrv) parts = split(text, ",");
    if (g_strv_length(parts) != 3)
        return no(why, "'%s' is not three numbers: x, y, z", text);
    for (int i = 0; i < 3; i++)
        if (!number(key, parts[i], FIELD(double) + i, why))
            return false;
    return true;
}

static const CfgChoice *find_choice(const CfgKey *key, const char *text, char **why)
{
    g_autoptr(GString) names = g_string_new(NULL);
    for (const CfgChoice *choice = key->choices; choice->name; choice++) {
        if (strcmp(choice->name, text) == 0)
            return choice;
        g_string_append_printf(names, "%s%s", names->len ? ", " : "", choice->name);
    }
    no(why, "'%s' is not one of %s", text, names->str);
    return NULL;
}

static bool read_choice(const CfgKey *key, const char *text, void *object, char **why)
{
    const CfgChoice *choice = find_choice(key, text, why);
    if (choice)
        *FIELD(int) = choice->value;
    return choice;
}

static bool add_range(const CfgKey *key, const char *part, GArray *numbers, char **why)
{
    const char *dash = *part ? strchr(part + 1, '-') : NULL;
    g_autofree char *first = dash ? g_strndup(part, (size_t)(dash - part)) : g_strdup(part);
    g_autofree char *last = g_strdup(dash ? dash + 1 : part);
    double a, b;
    if (!whole(key, g_strstrip(first), &a, why) || !whole(key, g_strstrip(last), &b, why))
        return false;
    if (b < a)
        return no(why, "the range '%s' runs backwards", part);
    if (b - a >= MAX_LIST - (double)numbers->len)
        return no(why, "more than %d numbers", MAX_LIST);
    for (int32_t value = (int32_t)a; value <= (int32_t)b; value++)
        g_array_append_val(numbers, value);
    return true;
}

static bool read_numbers(const CfgKey *key, const char *text, void *object, char **why)
{
    g_auto(GStrv) parts = split(text, ",");
    g_autoptr(GArray) numbers = g_array_new(false, false, sizeof(int32_t));
    for (char **part = parts; *text && *part; part++)
        if (!add_range(key, *part, numbers, why))
            return false;
    *FIELD(void *) = g_array_steal(numbers, &COUNT);
    return true;
}

static bool read_pairs(const CfgKey *key, const char *text, void *object, char **why)
{
    g_auto(GStrv) parts = split(text, ",");
    g_autoptr(GArray) pairs = g_array_new(false, false, sizeof(int32_t[2]));
    for (char **part = parts; *text && *part; part++) {
        g_auto(GStrv) sides = split(*part, ":");
        if (g_strv_length(sides) != 2)
            return no(why, "'%s' is not face:tag", *part);
        double face, tag;
        if (!whole(key, sides[0], &face, why) || !whole(key, sides[1], &tag, why))
            return false;
        int32_t pair[2] = {(int32_t)face, (int32_t)tag};
        g_array_append_val(pairs, pair);
    }
    *FIELD(void *) = g_array_steal(pairs, &COUNT);
    return true;
}

static bool read_cutting_part(const CfgKey *key, const char *part, CfgCutting *cutting, char **why)
{
    g_auto(GStrv) sides = split(part, ":");
    bool two = g_strv_length(sides) == 2 && *sides[0];
    char *space = two ? strpbrk(sides[1], " \t") : NULL;
    if (!space)
        return no(why, "'%s' is not material: cutting speed and feed per tooth", part);
    *space = '\0';
    if (!number(key, sides[1], &cutting->cutting_speed_m_min, why) ||
        !number(key, g_strstrip(space + 1), &cutting->feed_per_tooth_mm, why))
        return false;
    cutting->material = g_strdup(sides[0]);
    return true;
}

static bool read_cutting(const CfgKey *key, const char *text, void *object, char **why)
{
    g_auto(GStrv) parts = split(text, ",");
    size_t n = *text ? g_strv_length(parts) : 0;
    *FIELD(CfgCutting *) = g_new0(CfgCutting, n);
    COUNT = n;
    for (size_t i = 0; i < n; i++) {
        CfgCutting *cutting = *FIELD(CfgCutting *);
        if (!read_cutting_part(key, parts[i], &cutting[i], why))
            return false;
        for (size_t k = 0; k < i; k++)
            if (strcmp(cutting[k].material, cutting[i].material) == 0)
                return no(why, "%s is there twice", cutting[i].material);
    }
    return true;
}
