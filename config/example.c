/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#include <string.h>

#define COLUMNS 96

static void add_key(GString *out, const CfgKey *key, const char *required);
static void add_comment(GString *out, const char *text);

char *cfg_schema_example(const CfgSchema *schema, const char *element, const char *required)
{
    GString *out = g_string_new("# SPDX-License-Identifier: Apache-2.0\n");
    add_comment(out, schema->help);
    const char *group = "";
    for (size_t i = 0; i < schema->n_keys; i++) {
        const CfgKey *key = &schema->keys[i];
        if (strcmp(key->group, group) != 0) {
            group = key->group;
            bool many = strchr(group, '*');
            g_string_append_printf(out, "\n%s[%.*s%s]\n", many && !element ? "#" : "",
                                   (int)strcspn(group, "*"), group,
                                   !many     ? ""
                                   : element ? element
                                             : "NAME");
        }
        add_key(out, key, required);
    }
    return g_string_free(out, false);
}

static void add_choices(GString *help, const CfgKey *key)
{
    for (const CfgChoice *choice = key->choices; choice->name; choice++)
        g_string_append_printf(help, "%s%s", choice == key->choices ? " One of " : ", ",
                               choice->name);
    g_string_append_c(help, '.');
}

static void add_key(GString *out, const CfgKey *key, const char *required)
{
    g_autoptr(GString) help = g_string_new(key->help);
    bool bounded = key->type == CFG_INT || key->type == CFG_REAL || key->type == CFG_VECTOR ||
                   key->type == CFG_BYTES;
    if (bounded)
        g_string_append_printf(help, " %.12g … %.12g%s%s.", key->min, key->max,
                               *key->unit ? " " : "", key->unit);
    if (key->choices)
        add_choices(help, key);
    add_comment(out, help->str);
    if (key->initial)
        g_string_append_printf(out, "#%s =%s%s\n", key->name, *key->initial ? " " : "",
                               key->initial);
    else
        g_string_append_printf(out, "%s = %s\n", key->name, required);
}

/* `text` as comment lines, broken between words. */
static void add_comment(GString *out, const char *text)
{
    g_auto(GStrv) words = g_strsplit(text, " ", -1);
    long column = 0;
    for (char **word = words; *word; word++) {
        long width = g_utf8_strlen(*word, -1) + 1;
        if (column > 0 && column + width > COLUMNS) {
            g_string_append_c(out, '\n');
            column = 0;
        }
        g_string_append_printf(out, "%s%s", column == 0 ? "# " : " ", *word);
        column += width + (column == 0);
    }
    g_string_append_c(out, '\n');
}
