/* SPDX-License-Identifier: Apache-2.0 */
#include "config/ini.h"

#include <string.h>

/* A configuration is written by hand; what is larger is some other file given by mistake. */
#define MAX_BYTES (4u << 20)

static bool read_line(CfgIni *ini, const char **group, char *line, int number, GError **error);

static bool failed(const CfgIni *ini, int line, GError **error, const char *message,
                   const char *detail)
{
    g_autofree char *shown =
        detail ? g_utf8_substring(detail, 0, MIN(g_utf8_strlen(detail, -1), 60)) : g_strdup("");
    g_set_error(error, CFG_ERROR, CFG_ERROR_PARSE, "%s:%d: %s%s", ini->name, line, message, shown);
    return false;
}

static void free_group(void *data)
{
    CfgIniGroup *group = data;
    g_free(group->name);
    g_free(group);
}

static void free_entry(void *data)
{
    CfgIniEntry *entry = data;
    g_free(entry->group);
    g_free(entry->key);
    g_free(entry->value);
    g_free(entry);
}

CfgIni *cfg_ini_parse(const char *text, size_t length, const char *name, GError **error)
{
    g_autoptr(CfgIni) ini = g_new0(CfgIni, 1);
    ini->name = g_strdup(name);
    ini->groups = g_ptr_array_new_with_free_func(free_group);
    ini->entries = g_ptr_array_new_with_free_func(free_entry);
    ini->by_name = g_hash_table_new_full(g_str_hash, g_str_equal, g_free, NULL);

    const char *group = NULL;
    const char *end = text + length;
    int number = 1;
    for (const char *at = text; at < end; number++) {
        const char *newline = memchr(at, '\n', (size_t)(end - at));
        size_t n = (size_t)((newline ? newline : end) - at);
        if (!g_utf8_validate_len(at, n, NULL)) {
            failed(ini, number, error, "not UTF-8 text; is this a configuration file?", NULL);
            return NULL;
        }
        g_autofree char *line = g_strndup(at, n);
        if (!read_line(ini, &group, g_strstrip(line), number, error))
            return NULL;
        at += n + 1;
    }
    return g_steal_pointer(&ini);
}

CfgIni *cfg_ini_load(const char *path, GError **error)
{
    g_autofree char *text = NULL;
    size_t length = 0;
    g_autoptr(GError) cause = NULL;
    if (!g_file_get_contents(path, &text, &length, &cause)) {
        g_set_error_literal(error, CFG_ERROR, CFG_ERROR_IO, cause->message);
        return NULL;
    }
    if (length > MAX_BYTES) {
        g_set_error(error, CFG_ERROR, CFG_ERROR_PARSE,
                    "%s: %zu bytes is too long for a configuration file (at most %u)", path, length,
                    MAX_BYTES);
        return NULL;
    }
    return cfg_ini_parse(text, length, path, error);
}

void cfg_ini_free(CfgIni *ini)
{
    if (!ini)
        return;
    g_hash_table_unref(ini->by_name);
    g_ptr_array_unref(ini->entries);
    g_ptr_array_unref(ini->groups);
    g_free(ini->name);
    g_free(ini);
}

static bool is_name(const char *name, const char *also)
{
    for (const char *c = name; *c; c++)
        if (!g_ascii_isalnum(*c) && !strchr(also, *c))
            return false;
    return *name;
}

static bool has_control(const char *text)
{
    for (const char *c = text; *c; c++)
        if ((unsigned char)*c < ' ' && *c != '\t')
            return true;
    return false;
}

static CfgIniGroup *add_group(CfgIni *ini, const char *name, int line)
{
    CfgIniGroup *group = g_new(CfgIniGroup, 1);
    *group = (CfgIniGroup){g_strdup(name), line};
    g_ptr_array_add(ini->groups, group);
    g_hash_table_insert(ini->by_name, g_strdup_printf("[%s]", name), group);
    return group;
}

static bool read_group(CfgIni *ini, const char **group, char *line, int number, GError **error)
{
    char *close = strchr(line, ']');
    if (!close || close[1])
        return failed(ini, number, error, "a group is written [name], not ", line);
    *close = '\0';
    const char *name = line + 1;
    if (!is_name(name, "_.-"))
        return failed(ini, number, error,
                      "a group's name has letters, digits, '_', '-', '.': ", name);
    g_autofree char *id = g_strdup_printf("[%s]", name);
    const CfgIniGroup *first = g_hash_table_lookup(ini->by_name, id);
    if (first) {
        g_autofree char *message = g_strdup_printf(
            "[%s] is here twice, first in line %d; join the two", name, first->line);
        return failed(ini, number, error, message, NULL);
    }
    *group = add_group(ini, name, number)->name;
    return true;
}

static CfgIniEntry *add_entry(CfgIni *ini, const char *group, const char *key, const char *value,
                              int line)
{
    CfgIniEntry *entry = g_new(CfgIniEntry, 1);
    *entry = (CfgIniEntry){g_strdup(group), g_strdup(key), g_strdup(value), line};
    g_ptr_array_add(ini->entries, entry);
    g_hash_table_insert(ini->by_name, g_strdup_printf("[%s] %s", group, key), entry);
    return entry;
}

static bool read_line(CfgIni *ini, const char **group, char *line, int number, GError **error)
{
    if (!*line || *line == '#' || *line == ';')
        return true;
    if (has_control(line))
        return failed(ini, number, error, "a control character in the text", NULL);
    if (*line == '[')
        return read_group(ini, group, line, number, error);

    char *equals = strchr(line, '=');
    if (!equals)
        return failed(ini, number, error, "neither [group] nor key = value: ", line);
    *equals = '\0';
    const char *key = g_strstrip(line);
    const char *value = g_strstrip(equals + 1);
    if (!is_name(key, "_-"))
        return failed(ini, number, error, "a key has letters, digits, '_' and '-': ", key);
    if (!*group)
        return failed(ini, number, error, "a key before the first [group]: ", key);
    const CfgIniEntry *first = cfg_ini_entry(ini, *group, key);
    if (first) {
        g_autofree char *message = g_strdup_printf(
            "[%s] %s: given twice, first in line %d; keep one", *group, key, first->line);
        return failed(ini, number, error, message, NULL);
    }
    add_entry(ini, *group, key, value, number);
    return true;
}

const CfgIniEntry *cfg_ini_entry(const CfgIni *ini, const char *group, const char *key)
{
    g_autofree char *id = g_strdup_printf("[%s] %s", group, key);
    return g_hash_table_lookup(ini->by_name, id);
}

bool cfg_ini_override(CfgIni *ini, const char *group, const char *key, const char *value,
                      GError **error)
{
    if (!is_name(group, "_.-") || !is_name(key, "_-") || !g_utf8_validate(value, -1, NULL) ||
        has_control(value)) {
        g_set_error_literal(error, CFG_ERROR, CFG_ERROR_SET,
                            "--set wants group.key=value, in text that could stand in a file");
        return false;
    }
    g_autofree char *group_id = g_strdup_printf("[%s]", group);
    if (!g_hash_table_contains(ini->by_name, group_id))
        add_group(ini, group, 0);
    g_autofree char *id = g_strdup_printf("[%s] %s", group, key);
    CfgIniEntry *entry = g_hash_table_lookup(ini->by_name, id);
    if (!entry)
        entry = add_entry(ini, group, key, "", 0);
    g_free(entry->value);
    entry->value = g_strstrip(g_strdup(value));
    entry->line = 0;
    return true;
}
