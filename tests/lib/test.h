/* SPDX-License-Identifier: Apache-2.0 */
/* What every test program shares. */
#ifndef TESTS_LIB_TEST_H
#define TESTS_LIB_TEST_H

#include <glib.h>
#include <stdbool.h>

/* Runs the tests added by `add`, as TAP, going on after a failed assertion. */
int test_main(int argc, char **argv, void (*add)(void));

/* The same with the user's state and configuration (XDG_STATE_HOME, XDG_CONFIG_HOME) in a folder of
 * its own. */
int test_main_as_new_user(int argc, char **argv, void (*add)(void));

/* How many of `wanted` trials to make: in a program with sanitizers, where each takes several times
 * as long, a quarter, and at least one. */
int test_trials(int wanted);

/* Any finite double, each pattern of bits as likely. */
double test_any_double(GRand *random);

/* Path of a file of the outside test data; NULL where it is absent: then the test has been marked
 * as skipped (as failed where SEGMILL_TEST_DATA_REQUIRED=1) and returns. Caller frees. */
char *test_data(const char *relative);

/* Every file of the outside data below `folder` (recursive) whose name ends in one of the
 * NULL-terminated `suffixes`, sorted; as test_data where the folder is absent. */
GPtrArray *test_data_files(const char *folder, const char *const *suffixes);

/* Path of a program of the build, for example "segmill-cad". Caller frees. */
char *test_program(const char *name);

/* A fresh temporary folder; test_folder_remove deletes it with all that it holds and frees it. */
char *test_folder(void);
void test_folder_remove(char *folder);

/* |a - b| <= absolute + relative·|b|, with both values in the message. */
#define test_near(a, b, absolute, relative)                                                        \
    test_near_at(__FILE__, __LINE__, G_STRFUNC, #a, (a), (b), (absolute), (relative))
void test_near_at(const char *file, int line, const char *function, const char *expression,
                  double a, double b, double absolute, double relative);

#endif
