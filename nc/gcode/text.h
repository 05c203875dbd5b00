/* SPDX-License-Identifier: Apache-2.0 */
/* A growing text of G-code words. Numbers are integers of 10^-decimals, so that what is compared
 * for change is what is written. */
#ifndef NC_GCODE_TEXT_H
#define NC_GCODE_TEXT_H

#include <glib.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    char *bytes;
    size_t length, capacity;
} NcText;

void nc_text_clear(NcText *text);

/* The text as bytes, which takes it over. */
GBytes *nc_text_steal(NcText *text);

void nc_text_put(NcText *text, const char *string);
void nc_text_printf(NcText *text, const char *format, ...) G_GNUC_PRINTF(2, 3);

/* A letter and value·10^-decimals in its shortest form: no trailing zeros, no "-0". */
void nc_text_word(NcText *text, char letter, int64_t value, int decimals);

/* A comment: brackets inside become square, what is not printable ASCII becomes "?", and what is
 * too long for a block goes on in another one. */
void nc_text_comment(NcText *text, const char *comment);

static const double nc_text_power[] = {1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6};

/* The nearest integer of value·10^decimals, for up to six decimals. */
static inline int64_t nc_text_scaled(double value, int decimals)
{
    double scaled = value * nc_text_power[decimals];
    return (int64_t)(scaled + (scaled < 0.0 ? -0.5 : 0.5));
}

#endif
