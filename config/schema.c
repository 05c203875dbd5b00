/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#include <string.h>

G_DEFINE_QUARK(cfg_error, cfg_error)

static bool check_names(const CfgSchema *schema, const CfgIni *ini, GError **error);
static bool read_group(const CfgSchema *schema, const CfgIni *ini, const char *pattern,
                       const char *group, void *object, GError **error);
static CfgError place(GString *text, const CfgIni *ini, const char *group, const char *key,
                      CfgError in_file);
static const char *nearest(const CfgSchema *schema, const char *pattern, const char *name);

/* "*" groups are the elements. */
static bool is_element(const CfgSchema *schema, const char *group)
{
    if (!schema->element_size)
        return false;
    size_t prefix = strlen(schema->element_name.group) - 1;
    return strncmp(group, schema->element_name.group, prefix) == 0 && group[prefix];
}

/* The group as the table writes it: "region.boss" is "region.*". */
static const char *pattern_of(const CfgSchema *schema, const char *group)
{
    return is_element(schema, group) ? schema->element_name.group : group;
}

static bool is_first_of_group(const CfgSchema *schema, size_t i)
{
    return i == 0 || strcmp(schema->keys[i].group, schema->keys[i - 1].group) != 0;
}

static bool read_element(const CfgSchema *schema, const CfgIni *ini, const char *group,
                         void *element, GError **error)
{
    g_autofree char *why = NULL;
    const char *name = group + strlen(schema->element_name.group) - 1;
    if (!cfg_value_read(&schema->element_name, name, NULL, element, &why))
        return cfg_refuse(ini, group, NULL, error, "%s: %s", schema->element_name.name, why);
    return read_group(schema, ini, schema->element_name.group, group, element, error);
}

static bool read_elements(const CfgSchema *schema, const CfgIni *ini, char *object, GError **error)
{
    size_t *n = (size_t *)(void *)(object + schema->n_elements_offset);
    char **elements = (char **)(void *)(object + schema->elements_offset);
    *elements = g_malloc0_n(ini->groups->len + 1, schema->element_size);
    for (guint i = 0; i < ini->groups->len; i++) {
        const CfgIniGroup *group = g_ptr_array_index(ini->groups, i);
        if (is_element(schema, group->name) &&
            !read_element(schema, ini, group->name, *elements + (*n)++ * schema->element_size,
                          error))
            return false;
    }
    return true;
}

void *cfg_schema_read(const CfgSchema *schema, const CfgIni *ini, GError **error)
{
    if (!check_names(schema, ini, error))
        return NULL;
    char *object = g_malloc0(schema->size);
    bool ok = true;
    for (size_t i = 0; ok && i < schema->n_keys; i++) {
        const char *group = schema->keys[i].group;
        if (is_first_of_group(schema, i) && !strchr(group, '*'))
            ok = read_group(schema, ini, group, group, object, error);
    }
    if (ok && schema->element_size)
        ok = read_elements(schema, ini, object, error);
    if (ok)
        return object;
    cfg_schema_free(schema, object);
    return NULL;
}

void cfg_schema_free(const CfgSchema *schema, void *object)
{
    if (!object)
        return;
    char *elements = NULL;
    size_t n = 0;
    if (schema->element_size) {
        elements = *(char **)(void *)((char *)object + schema->elements_offset);
        n = *(size_t *)(void *)((char *)object + schema->n_elements_offset);
    }
    for (size_t e = 0; e < n; e++)
        cfg_value_free(&schema->element_name, elements + e * schema->element_size);
    for (size_t i = 0; i < schema->n_keys; i++) {
        const CfgKey *key = &schema->keys[i];
        if (!strchr(key->group, '*'))
            cfg_value_free(key, object);
        for (size_t e = 0; e < n && strchr(key->group, '*'); e++)
            cfg_value_free(key, elements + e * schema->element_size);
    }
    g_free(elements);
    g_free(object);
}

static bool read_group(const CfgSchema *schema, const CfgIni *ini, const char *pattern,
                       const char *group, void *object, GError **error)
{
    g_autofree char *relative = g_path_get_dirname(ini->name);
    g_autofree char *folder = g_canonicalize_filename(relative, NULL);
    for (size_t i = 0; i < schema->n_keys; i++) {
        const CfgKey *key = &schema->keys[i];
        if (strcmp(key->group, pattern) != 0)
            continue;
        const CfgIniEntry *entry = cfg_ini_entry(ini, group, key->name);
        const char *text = entry ? entry->value : key->initial;
        if (!text || (!*text && !key->initial))
            return cfg_refuse(ini, group, key->name, error, "missing; it must be given: %s",
                              key->help);
        g_autofree char *why = NULL;
        if (!cfg_value_read(key, text, folder, object, &why))
            return cfg_refuse(ini, group, key->name, error, "%s", why);
    }
    return true;
}

/* -------------------------------------------------------------------- messages */

bool cfg_refuse(const CfgIni *ini, const char *group, const char *key, GError **error,
                const char *format, ...)
{
    g_autoptr(GString) text = g_string_new(NULL);
    CfgError code = place(text, ini, group, key, CFG_ERROR_VALUE);
    va_list args;
    va_start(args, format);
    g_string_append_vprintf(text, format, args);
    va_end(args);
    g_set_error_literal(error, CFG_ERROR, (int)code, text->str);
    return false;
}

/* Opens a message with where the key stands. Returns the code that goes with that place. */
static CfgError place(GString *text, const CfgIni *ini, const char *group, const char *key,
                      CfgError in_file)
{
    g_autofree char *id = g_strdup_printf("[%s]", group);
    const CfgIniGroup *header = g_hash_table_lookup(ini->by_name, id);
    const CfgIniEntry *entry = key ? cfg_ini_entry(ini, group, key) : NULL;
    if (entry ? entry->line == 0 : header && header->line == 0) {
        g_string_append_printf(text, "--set %s%s%s: ", group, key ? "." : "", key ? key : "");
        return CFG_ERROR_SET;
    }
    int line = entry ? entry->line : header ? header->line : 0;
    g_string_append(text, ini->name);
    if (line)
        g_string_append_printf(text, ":%d", line);
    g_string_append_printf(text, ": [%s]%s%s: ", group, key ? " " : "", key ? key : "");
    return in_file;
}

static bool is_known_group(const CfgSchema *schema, const char *group)
{
    const char *pattern = pattern_of(schema, group);
    for (size_t i = 0; i < schema->n_keys; i++)
        if (strcmp(schema->keys[i].group, pattern) == 0)
            return true;
    return false;
}

static const CfgKey *find_key(const CfgSchema *schema, const char *pattern, const char *name)
{
    for (size_t i = 0; i < schema->n_keys; i++)
        if (strcmp(schema->keys[i].group, pattern) == 0 && strcmp(schema->keys[i].name, name) == 0)
            return &schema->keys[i];
    return NULL;
}

static const CfgKey *find_elsewhere(const CfgSchema *schema, const char *name)
{
    for (size_t i = 0; i < schema->n_keys; i++)
        if (strcmp(schema->keys[i].name, name) == 0)
            return &schema->keys[i];
    return NULL;
}

static bool unknown(const CfgSchema *schema, const CfgIni *ini, const char *group, const char *key,
                    GError **error)
{
    g_autoptr(GString) text = g_string_new(NULL);
    CfgError code = place(text, ini, group, key, CFG_ERROR_KEY);
    g_string_append_printf(text, "unknown %s", key ? "key" : "group");
    const CfgKey *elsewhere = key ? find_elsewhere(schema, key) : NULL;
    const char *near = nearest(schema, key ? pattern_of(schema, group) : NULL, key ? key : group);
    if (elsewhere)
        g_string_append_printf(text, "; it belongs in [%s]", elsewhere->group);
    else if (near)
        g_string_append_printf(text, "; did you mean %s?", near);
    g_set_error_literal(error, CFG_ERROR, (int)code, text->str);
    return false;
}

static bool check_names(const CfgSchema *schema, const CfgIni *ini, GError **error)
{
    for (guint i = 0; i < ini->groups->len; i++) {
        const CfgIniGroup *group = g_ptr_array_index(ini->groups, i);
        if (!is_known_group(schema, group->name))
            return unknown(schema, ini, group->name, NULL, error);
    }
    for (guint i = 0; i < ini->entries->len; i++) {
        const CfgIniEntry *entry = g_ptr_array_index(ini->entries, i);
        if (!find_key(schema, pattern_of(schema, entry->group), entry->key))
            return unknown(schema, ini, entry->group, entry->key, error);
    }
    return true;
}

/* Levenshtein's distance, as far as names of MAX_NAME letters go. */
#define MAX_NAME 64
static size_t edit_distance(const char *a, const char *b)
{
    size_t m = strlen(a), n = strlen(b);
    if (m > MAX_NAME || n > MAX_NAME)
        return SIZE_MAX;
    size_t row[MAX_NAME + 1];
    for (size_t j = 0; j <= n; j++)
        row[j] = j;
    for (size_t i = 1; i <= m; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= n; j++) {
            size_t above = row[j];
            size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
            row[j] = MIN(MIN(above, row[j - 1]) + 1, replaced);
            diagonal = above;
        }
    }
    return row[n];
}

/* The known key of the group (of the groups, where pattern is NULL) that is likely meant. */
static const char *nearest(const CfgSchema *schema, const char *pattern, const char *name)
{
    const char *best = NULL;
    size_t best_distance = MAX(2, strlen(name) / 2) + 1;
    for (size_t i = 0; i < schema->n_keys; i++) {
        const CfgKey *key = &schema->keys[i];
        if (pattern && strcmp(key->group, pattern) != 0)
            continue;
        const char *candidate = pattern ? key->name : key->group;
        size_t distance = edit_distance(name, candidate);
        if (distance < best_distance) {
            best_distance = distance;
            best = candidate;
        }
    }
    return best;
}

/* --------------------------------------------------------- overrides, settings */

/* The group of a key that was given without one; NULL with an error where that is not clear. */
static const char *only_group(const CfgSchema *schema, const char *name, GError **error)
{
    const char *group = NULL;
    g_autoptr(GString) all = g_string_new(NULL);
    for (size_t i = 0; i < schema->n_keys; i++) {
        if (strcmp(schema->keys[i].name, name) != 0)
            continue;
        group = schema->keys[i].group;
        g_string_append_printf(all, "%s%s.%s", all->len ? " or " : "", group, name);
    }
    if (group && !strstr(all->str, " or ") && !strchr(group, '*'))
        return group;
    const char *near = nearest(schema, NULL, name);
    for (size_t i = 0; !near && i < schema->n_keys; i++)
        near = nearest(schema, schema->keys[i].group, name);
    g_autofree char *hint = group  ? g_strconcat("say which: ", all->str, NULL)
                            : near ? g_strdup_printf("unknown key; did you mean %s?", near)
                                   : g_strdup("unknown key");
    g_set_error(error, CFG_ERROR, CFG_ERROR_SET, "--set %s: %s", name, hint);
    return NULL;
}

bool cfg_schema_set(const CfgSchema *schema, CfgIni *ini, const char *assignment, GError **error)
{
    const char *equals = strchr(assignment, '=');
    if (!equals) {
        g_set_error(error, CFG_ERROR, CFG_ERROR_SET, "--set %s: not group.key=value", assignment);
        return false;
    }
    g_autofree char *left = g_strstrip(g_strndup(assignment, (size_t)(equals - assignment)));
    char *dot = strrchr(left, '.');
    if (dot)
        *dot = '\0';
    const char *key = dot ? dot + 1 : left;
    const char *group = dot ? left : only_group(schema, key, error);
    return group && cfg_ini_override(ini, group, key, equals + 1, error);
}

static int compare_settings(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

static void add_settings(const CfgSchema *schema, const CfgIni *ini, const char *group,
                         GPtrArray *settings)
{
    for (size_t i = 0; i < schema->n_keys; i++) {
        const CfgKey *key = &schema->keys[i];
        if (strcmp(key->group, pattern_of(schema, group)) != 0)
            continue;
        const CfgIniEntry *entry = cfg_ini_entry(ini, group, key->name);
        g_ptr_array_add(settings, g_strdup_printf("%s.%s=%s", group, key->name,
                                                  entry ? entry->value : key->initial));
    }
}

char **cfg_schema_settings(const CfgSchema *schema, const CfgIni *ini)
{
    GPtrArray *settings = g_ptr_array_new();
    for (size_t i = 0; i < schema->n_keys; i++)
        if (is_first_of_group(schema, i) && !strchr(schema->keys[i].group, '*'))
            add_settings(schema, ini, schema->keys[i].group, settings);
    for (guint i = 0; i < ini->groups->len; i++) {
        const CfgIniGroup *group = g_ptr_array_index(ini->groups, i);
        if (is_element(schema, group->name))
            add_settings(schema, ini, group->name, settings);
    }
    g_ptr_array_sort(settings, compare_settings);
    g_ptr_array_add(settings, NULL);
    return (char **)g_ptr_array_free(settings, false);
}
