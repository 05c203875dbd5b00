/* SPDX-License-Identifier: Apache-2.0 */
/* The one number writer. */
#include <math.h>
#include <string.h>

#include "config/config.h"
#include "tests/lib/test.h"

/* No other decimal with fewer digits reads back as the same double. */
static void shortest(void)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(2);
    for (int i = 0; i < 20000; i++) {
        double value = test_any_double(random);
        if (i % 4 == 0)
            value = g_rand_int_range(random, -100000, 100000) / 1000.0;
        g_autoptr(GString) text = g_string_new(NULL);
        cfg_number_append(text, value);
        g_assert_cmpfloat(g_ascii_strtod(text->str, NULL), ==, value);
        int digits = 0;
        for (const char *c = text->str; *c && *c != 'e'; c++)
            digits += g_ascii_isdigit(*c) && (digits > 0 || *c != '0');
        char shorter[40];
        for (int n = 1; n < MIN(digits, 17); n++) {
            g_snprintf(shorter, sizeof shorter, "%.*e", n - 1, value);
            /* Trailing zeros before the point are no digits that %.15g could have left out. */
            if (g_ascii_strtod(shorter, NULL) == value && fabs(value) < 1e15 &&
                value != floor(value))
                g_assert_cmpstr(text->str, ==, shorter);
        }
    }
}

static void numbers(void)
{
    static const struct {
        double value;
        const char *text;
    } known[] = {
        {0, "0"},
        {-0.0, "0"},
        {1, "1"},
        {-2.5, "-2.5"},
        {0.1, "0.1"},
        {100, "100"},
        {1e21, "1e+21"},
        {1e-7, "1e-07"},
        {0.3, "0.3"},
        {0.1 + 0.2, "0.30000000000000004"},
        {1.0 / 3, "0.3333333333333333"},
        {12345678, "12345678"},
        {INFINITY, "null"},
        {-INFINITY, "null"},
        {NAN, "null"},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(known); i++) {
        g_autoptr(GString) text = g_string_new(NULL);
        cfg_number_append(text, known[i].value);
        g_assert_cmpstr(text->str, ==, known[i].text);
    }
}

static void add(void)
{
    g_test_add_func("/config/number/shortest", shortest);
    g_test_add_func("/config/number/known", numbers);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
