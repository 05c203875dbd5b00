/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/methods/parameters.h"

#include <string.h>

static void add(GPtrArray *list, const char *key, const char *value)
{
    g_ptr_array_add(list, g_strconcat(key, "=", value, NULL));
}

/* The fewest digits that read back as the same number. */
static void add_number(GPtrArray *list, const char *key, double number)
{
    char text[G_ASCII_DTOSTR_BUF_SIZE];
    for (int digits = 1; digits <= 17; digits++) {
        char format[8];
        g_snprintf(format, sizeof format, "%%.%dg", digits);
        g_ascii_formatd(text, sizeof text, format, number);
        if (g_ascii_strtod(text, NULL) == number)
            break;
    }
    add(list, key, text);
}

static void add_integers(GPtrArray *list, const char *key, const int32_t *values, size_t n)
{
    g_autoptr(GString) text = g_string_new(NULL);
    for (size_t i = 0; i < n; i++)
        g_string_append_printf(text, "%s%d", i > 0 ? "," : "", values[i]);
    add(list, key, text->str);
}

static void add_pairs(GPtrArray *list, const char *key, const int32_t (*pairs)[2], size_t n)
{
    g_autoptr(GString) text = g_string_new(NULL);
    for (size_t i = 0; i < n; i++)
        g_string_append_printf(text, "%s%d:%d", i > 0 ? "," : "", pairs[i][0], pairs[i][1]);
    add(list, key, text->str);
}

char **seg_feature_size_parameters(const SegFeatureSizeParams *params)
{
    static const char *const repairs[] = {
        [SEG_REPAIR_EXACT] = "exact", [SEG_REPAIR_RULE] = "rule", [SEG_REPAIR_POINTS] = "points"};
    GPtrArray *list = g_ptr_array_new();
    if (params->repair == SEG_REPAIR_RULE)
        add_number(list, "datum_mm", params->datum_mm);
    add_integers(list, "local_faces", params->local_faces, params->n_local_faces);
    add_number(list, "local_ratio", params->local_ratio);
    add_integers(list, "local_tags", params->local_tags, params->n_local_tags);
    add_number(list, "min_size_mm", params->min_size_mm);
    if (params->repair == SEG_REPAIR_POINTS)
        add_number(list, "points", params->points);
    add_pairs(list, "reassign", params->reassign, params->n_reassign);
    add(list, "repair", repairs[params->repair]);
    add(list, "split_rest", params->split_rest ? "true" : "false");
    add_number(list, "subset_tolerance", params->subset_tolerance);
    add_number(list, "tolerance", params->tolerance);
    g_ptr_array_add(list, NULL);
    return (char **)g_ptr_array_free(list, FALSE);
}
