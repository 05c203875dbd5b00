/* SPDX-License-Identifier: Apache-2.0 */
/* Words and numbers of the text formats (ascii STL, OFF). */
#include "segcore/geom/part_form.h"
#include "segcore/geom/reader.h"

static void skip_space(SegWords *words)
{
    for (; words->at < words->end; words->at++) {
        if (words->comment && *words->at == words->comment) {
            seg_skip_line(words);
            if (words->at == words->end)
                return;
        }
        if (!g_ascii_isspace(*words->at) && *words->at != '\0')
            return;
        words->line += *words->at == '\n';
    }
}

bool seg_next_word(SegWords *words)
{
    skip_space(words);
    size_t n = 0;
    words->cut = false;
    for (; words->at < words->end; words->at++) {
        char c = *words->at;
        if (g_ascii_isspace(c) || c == '\0' || (words->comment && c == words->comment))
            break;
        if (n + 1 < sizeof words->word)
            words->word[n++] = g_ascii_tolower(c);
        else
            words->cut = true;
    }
    words->word[n] = '\0';
    return n > 0;
}

/* Stays before the line's end. */
void seg_skip_line(SegWords *words)
{
    while (words->at < words->end && *words->at != '\n')
        words->at++;
}

bool seg_next_coordinate(SegWords *words, double *value)
{
    char *rest;
    if (!seg_next_word(words))
        return false;
    *value = g_ascii_strtod(words->word, &rest);
    return !words->cut && *rest == '\0' && fabs(*value) <= SEG_FORM_MAX_REAL;
}

bool seg_next_point(SegWords *words, SegVec3 *point)
{
    return seg_next_coordinate(words, &point->x) && seg_next_coordinate(words, &point->y) &&
           seg_next_coordinate(words, &point->z);
}
