/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The lines of an INI file: `[group]`, `key = value`, comments that open with # or ;. Every group
 * and key keeps its line; a repeated one is refused. Knows nothing of what the keys mean.
 */
#ifndef CONFIG_INI_H
#define CONFIG_INI_H

#include "config/config.h"

typedef struct {
    char *name;
    int line; /* 0: it came from --set */
} CfgIniGroup;

typedef struct {
    char *group, *key;
    char *value; /* without the space around it; may be empty */
    int line;    /* 0: it came from --set */
} CfgIniEntry;

typedef struct {
    char *name;          /* for messages: the file's path as given */
    GPtrArray *groups;   /* CfgIniGroup, in file order */
    GPtrArray *entries;  /* CfgIniEntry, in file order */
    GHashTable *by_name; /* "[group] key" → CfgIniEntry; "[group]" → CfgIniGroup */
} CfgIni;

/* Reads lines from memory. Errors: CFG_ERROR_PARSE, with "name:line: ". */
CfgIni *cfg_ini_parse(const char *text, size_t length, const char *name, GError **error);

/* The same from a file. Errors: also CFG_ERROR_IO. */
CfgIni *cfg_ini_load(const char *path, GError **error);
void cfg_ini_free(CfgIni *ini);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(CfgIni, cfg_ini_free)

/* NULL where the file does not have it. */
const CfgIniEntry *cfg_ini_entry(const CfgIni *ini, const char *group, const char *key);

/* Puts a value from the command line in the place of the file's own. Errors: CFG_ERROR_SET where
 * a name or the value could not stand in a file. */
bool cfg_ini_override(CfgIni *ini, const char *group, const char *key, const char *value,
                      GError **error);

#endif
