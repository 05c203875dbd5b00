/* SPDX-License-Identifier: Apache-2.0 */
/* The grammar of faults: docs/vcnc.1, FAULTS. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "sim/fault.h"

/* Bit 100 lies behind every header: in what a CRC or a seal covers. */
#define DEFAULT_BIT 100
#define DEFAULT_RATE 0.01
#define MOST_SECONDS 3600
#define MOST_LINE 1e9

/* What is left of one spec; columns are counted in bytes from 1. */
typedef struct {
    const char *begin, *at;
} Cursor;

typedef enum { NO_ARGUMENT, A_CODE, SECONDS, A_BIT } Argument;

static const struct {
    const char *name;
    SimFaultKind kind;
    Argument argument;
} kinds[] = {
    {"alarm", SIM_FAULT_ALARM, A_CODE},
    {"hold", SIM_FAULT_HOLD, NO_ARGUMENT},
    {"estop", SIM_FAULT_ESTOP, NO_ARGUMENT},
    {"tool-missing", SIM_FAULT_TOOL_MISSING, NO_ARGUMENT},
    {"limit-hit", SIM_FAULT_LIMIT_HIT, NO_ARGUMENT},
    {"reboot", SIM_FAULT_REBOOT, NO_ARGUMENT},
    {"drop", SIM_FAULT_DROP, NO_ARGUMENT},
    {"duplicate", SIM_FAULT_DUPLICATE, NO_ARGUMENT},
    {"delay", SIM_FAULT_DELAY, SECONDS},
    {"corrupt", SIM_FAULT_CORRUPT, A_BIT},
    {"close", SIM_FAULT_CLOSE, NO_ARGUMENT},
    {"slow", SIM_FAULT_SLOW, SECONDS},
};

const char *sim_fault_name(SimFaultKind kind)
{
    size_t i = 0;
    while (i < G_N_ELEMENTS(kinds) && kinds[i].kind != kind)
        i++;
    g_assert(i < G_N_ELEMENTS(kinds));
    return kinds[i].name;
}

static bool parse_random(SimFaultScript *script, Cursor *c, GError **error);
static bool parse_fault(Cursor *c, SimFault *fault, GError **error);
static bool parse_moment(Cursor *c, SimFault *fault, GError **error);
static bool parse_kind(Cursor *c, SimFault *fault, GError **error);
static bool parse_argument(Cursor *c, Argument argument, SimFault *fault, GError **error);
static bool parse_end(Cursor *c, GError **error);
static void skip_spaces(Cursor *c);

bool sim_fault_script_add(SimFaultScript *script, const char *spec, GError **error)
{
    Cursor c = {spec, spec};
    SimFault fault = {0};
    if (!g_utf8_validate(spec, -1, &c.at)) {
        g_set_error(error, SIM_FAULT_ERROR, SIM_FAULT_ERROR_SYNTAX, "column %td: no UTF-8",
                    c.at - spec + 1);
        return false;
    }
    c.at = spec;
    skip_spaces(&c);
    if (g_str_has_prefix(c.at, "random"))
        return parse_random(script, &c, error);
    if (!parse_fault(&c, &fault, error)) {
        g_free(fault.text);
        return false;
    }
    fault.spec = g_strdup(spec);
    g_array_append_val(script->faults, fault);
    return true;
}

/* ----------------------------------------------------------------------------- words */

static void skip_spaces(Cursor *c)
{
    c->at += strspn(c->at, " \t");
}

static bool expected(const Cursor *c, const char *what, GError **error)
{
    g_set_error(error, SIM_FAULT_ERROR, SIM_FAULT_ERROR_SYNTAX, "column %td: \"%s\": expected %s",
                c->at - c->begin + 1, c->at, what);
    return false;
}

/* A word of letters and hyphens, whole. */
static bool take_word(Cursor *c, const char *word)
{
    skip_spaces(c);
    const size_t n = strspn(c->at, "abcdefghijklmnopqrstuvwxyz-");
    if (n != strlen(word) || strncmp(c->at, word, n) != 0)
        return false;
    c->at += n;
    return true;
}

static bool take_colon(Cursor *c, GError **error)
{
    skip_spaces(c);
    if (*c->at != ':')
        return expected(c, "\":\"", error);
    c->at++;
    return true;
}

/* Digits, and where `whole` is false one point among them. */
static bool take_number(Cursor *c, bool whole, double least, double most, double *value,
                        const char *what, GError **error)
{
    skip_spaces(c);
    const size_t n = strspn(c->at, whole ? "0123456789" : "0123456789.");
    char *end;
    *value = g_ascii_strtod(c->at, &end);
    /* strtod takes more than this grammar: signs, exponents, "0x", "inf". */
    if (n == 0 || end < c->at + n || !(*value >= least && *value <= most) ||
        (c->at[n] != '\0' && !strchr(" \t:", c->at[n])))
        return expected(c, what, error);
    c->at += n;
    return true;
}

static bool parse_end(Cursor *c, GError **error)
{
    skip_spaces(c);
    return *c->at == '\0' || expected(c, "the end", error);
}

/* ------------------------------------------------------------------------------ rules */

/* random [":" SEED [":" RATE]] */
static bool parse_random(SimFaultScript *script, Cursor *c, GError **error)
{
    const char *begin = c->at;
    double seed = script->seed, rate = DEFAULT_RATE;
    if (!take_word(c, "random"))
        return expected(c, "random[:SEED[:RATE]], or at …", error);
    if (script->random) {
        g_set_error(error, SIM_FAULT_ERROR, SIM_FAULT_ERROR_SYNTAX,
                    "column %td: a second \"random\": one has its seed and rate already",
                    begin - c->begin + 1);
        return false;
    }
    skip_spaces(c);
    if (*c->at == ':') {
        c->at++;
        if (!take_number(c, true, 0, UINT32_MAX, &seed, "a seed from 0 to 4294967295", error))
            return false;
    }
    skip_spaces(c);
    if (*c->at == ':') {
        c->at++;
        if (!take_number(c, false, 0, 1, &rate, "a rate from 0 to 1", error))
            return false;
    }
    if (!parse_end(c, error))
        return false;
    script->random = true;
    script->seed = (uint32_t)seed;
    script->rate = rate;
    return true;
}

/* "at" MOMENT ":" FAULT */
static bool parse_fault(Cursor *c, SimFault *fault, GError **error)
{
    if (!take_word(c, "at"))
        return expected(c,
                        "\"at line N: FAULT\", \"at time T: FAULT\", \"at frame N: FAULT\" or "
                        "\"random[:SEED[:RATE]]\"",
                        error);
    return parse_moment(c, fault, error) && take_colon(c, error) && parse_kind(c, fault, error) &&
           parse_end(c, error);
}

/* "line" N | "time" SECONDS | "frame" N */
static bool parse_moment(Cursor *c, SimFault *fault, GError **error)
{
    double number;
    if (take_word(c, "time")) {
        fault->moment = SIM_AT_TIME;
        return take_number(c, false, 0, 1e9, &fault->time_s, "seconds of the program's clock",
                           error);
    }
    fault->moment = take_word(c, "line") ? SIM_AT_LINE : SIM_AT_FRAME;
    if (fault->moment == SIM_AT_FRAME && !take_word(c, "frame"))
        return expected(c, "line, time or frame", error);
    if (!take_number(c, true, 1, MOST_LINE, &number, "a whole number from 1", error))
        return false;
    fault->number = (uint32_t)number;
    return true;
}

static bool parse_kind(Cursor *c, SimFault *fault, GError **error)
{
    for (size_t i = 0; i < G_N_ELEMENTS(kinds); i++) {
        if (!take_word(c, kinds[i].name))
            continue;
        fault->kind = kinds[i].kind;
        return parse_argument(c, kinds[i].argument, fault, error);
    }
    g_autoptr(GString) names = g_string_new("one of");
    for (size_t i = 0; i < G_N_ELEMENTS(kinds); i++)
        g_string_append_printf(names, "%s %s", i > 0 ? "," : "", kinds[i].name);
    return expected(c, names->str, error);
}

static bool parse_argument(Cursor *c, Argument argument, SimFault *fault, GError **error)
{
    double number = DEFAULT_BIT;
    skip_spaces(c);
    switch (argument) {
    case NO_ARGUMENT:
        return true;
    case SECONDS:
        return take_number(c, false, 0, MOST_SECONDS, &fault->seconds, "seconds, up to 3600",
                           error);
    case A_BIT:
        if (*c->at != '\0' &&
            !take_number(c, true, 0, UINT32_MAX, &number, "the number of a bit", error))
            return false;
        fault->bit = (uint32_t)number;
        return true;
    case A_CODE:
        if (!take_number(c, true, 1, UINT16_MAX, &number, "a code from 1 to 65535", error))
            return false;
        fault->code = (uint16_t)number;
        skip_spaces(c);
        if (*c->at != '\0')
            fault->text = g_strchomp(g_strdup(c->at));
        c->at += strlen(c->at);
        return true;
    }
    return true;
}

/* ------------------------------------------------------------------------------ files */

bool sim_fault_script_read(SimFaultScript *script, const char *path, GError **error)
{
    g_autofree char *text = NULL;
    gsize n;
    if (!g_file_get_contents(path, &text, &n, error))
        return false;
    if (strlen(text) < n) {
        g_set_error(error, SIM_FAULT_ERROR, SIM_FAULT_ERROR_SYNTAX, "%s: no text file", path);
        return false;
    }
    g_auto(GStrv) lines = g_strsplit(text, "\n", -1);
    for (unsigned i = 0; lines[i]; i++) {
        const char first = g_strchomp(lines[i])[strspn(lines[i], " \t")];
        if (first == '\0' || first == '#')
            continue;
        if (!sim_fault_script_add(script, lines[i], error)) {
            g_prefix_error(error, "%s:%u: ", path, i + 1);
            return false;
        }
    }
    return true;
}

SimFaultScript *sim_fault_script_new(void)
{
    SimFaultScript *script = g_new0(SimFaultScript, 1);
    script->faults = g_array_new(FALSE, FALSE, sizeof(SimFault));
    return script;
}

void sim_fault_script_free(SimFaultScript *script)
{
    if (!script)
        return;
    for (guint i = 0; i < script->faults->len; i++) {
        g_free(g_array_index(script->faults, SimFault, i).text);
        g_free(g_array_index(script->faults, SimFault, i).spec);
    }
    g_array_unref(script->faults);
    g_free(script);
}

G_DEFINE_QUARK(sim_fault_error, sim_fault_error)
