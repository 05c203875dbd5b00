/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A kind of file as one table of keys. Reading, defaults, ranges, messages, suggestions, freeing
 * and the commented example all come from that table.
 */
#ifndef CONFIG_SCHEMA_H
#define CONFIG_SCHEMA_H

#include "config/ini.h"

typedef enum {
    CFG_STRING,  /* char *, NULL where empty; one of `choices` where there are any */
    CFG_FILE,    /* char *, resolved against the file's folder; NULL where empty */
    CFG_BOOL,    /* bool: true or false */
    CFG_INT,     /* int */
    CFG_BYTES,   /* uint64_t */
    CFG_REAL,    /* double */
    CFG_VECTOR,  /* double[3], written "x, y, z" */
    CFG_CHOICE,  /* an enum or int, by name */
    CFG_NUMBERS, /* int32_t * and a count, written "1, 4, 7-9" */
    CFG_PAIRS,   /* int32_t (*)[2] and a count, written "12:3, 14:3" */
    CFG_CUTTING, /* CfgCutting * and a count, written "steel: 120 0.05, titanium: 50 0.03" */
} CfgType;

typedef struct {
    const char *name;
    int value;
} CfgChoice;

typedef struct {
    const char *group; /* "setup"; "region.*" for every [region.NAME] */
    const char *name;
    CfgType type;
    const char *unit;    /* "" for none */
    const char *initial; /* the default as it stands in a file; NULL: the key must be given */
    double min, max;     /* of numbers, and of every number of a list */
    size_t offset;       /* in the file's struct; in the element's for a "*" group */
    const char *help;    /* one or more sentences for the example */
    size_t count_offset; /* of the count of a list */
    const CfgChoice *choices;
} CfgKey;

typedef struct {
    const char *what; /* "recipe" */
    const char *help; /* opens the example */
    const CfgKey *keys;
    size_t n_keys;
    size_t size; /* of the file's struct */
    /* The groups that may be there many times, as an array of elements; size 0 where none are. */
    size_t element_size;
    size_t elements_offset, n_elements_offset;
    CfgKey element_name; /* where NAME goes: CFG_STRING or CFG_INT; .group is "region.*" */
} CfgSchema;

/* The struct that `ini` describes, checked against the table; free with cfg_schema_free.
 * Errors: CFG_ERROR_KEY, CFG_ERROR_VALUE. */
void *cfg_schema_read(const CfgSchema *schema, const CfgIni *ini, GError **error);
void cfg_schema_free(const CfgSchema *schema, void *object);

/* Puts "group.key=value", or "key=value" where the key is unique, into `ini`. */
bool cfg_schema_set(const CfgSchema *schema, CfgIni *ini, const char *assignment, GError **error);

/* Every key in force, "group.key=value", sorted; NULL-terminated. */
char **cfg_schema_settings(const CfgSchema *schema, const CfgIni *ini);

/* A commented file: every key with its default; a key that must be given gets `required`. */
char *cfg_schema_example(const CfgSchema *schema, const char *element, const char *required);

/* Reads `text` into the key's field of `object`; false with *why where it does not fit. */
bool cfg_value_read(const CfgKey *key, const char *text, const char *folder, void *object,
                    char **why);
void cfg_value_free(const CfgKey *key, void *object);

/* Sets an error that opens with the place of [group] key: "FILE:12: [setup] wcs: ". Returns false,
 * so that a check may return it. */
bool cfg_refuse(const CfgIni *ini, const char *group, const char *key, GError **error,
                const char *format, ...) G_GNUC_PRINTF(5, 6);

#endif
