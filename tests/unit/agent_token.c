/* SPDX-License-Identifier: Apache-2.0 */
/* The agent's token: one for all processes, and nobody else's. */
#include "agent/token.h"

#include <glib/gstdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/lib/test.h"

static char *token_path(void)
{
    return g_build_filename(g_get_user_state_dir(), "segmill", "token", NULL);
}

static void check_mode(const char *path)
{
    struct stat found = {0};
    g_assert_cmpint(lstat(path, &found), ==, 0);
    g_assert_true(S_ISREG(found.st_mode));
    g_assert_cmpint((int)(found.st_mode & 07777), ==, 0600);
}

static void kept(void)
{
    g_autofree char *path = token_path();
    const uint64_t token = agent_token();
    g_assert_cmpuint(token >> 32, !=, 0);
    g_assert_cmpuint(agent_token(), ==, token);
    check_mode(path);
}

/* What others could read or write is not used again. */
static void others(void)
{
    static const mode_t modes[] = {0640, 0604, 0620, 0602};
    g_autofree char *path = token_path();
    for (size_t i = 0; i < G_N_ELEMENTS(modes); i++) {
        const uint64_t before = agent_token();
        g_assert_cmpint(chmod(path, modes[i]), ==, 0);
        const uint64_t token = agent_token();
        g_assert_cmpuint(token, !=, before);
        g_assert_cmpuint(agent_token(), ==, token);
        check_mode(path);
    }
}

/* A link to one's own file is as good; what is no file is replaced. */
static void no_plain_file(void)
{
    g_autofree char *path = token_path();
    g_autofree char *elsewhere = g_strconcat(path, "-elsewhere", NULL);
    const uint64_t before = agent_token();
    g_assert_cmpint(g_rename(path, elsewhere), ==, 0);
    g_assert_cmpint(symlink(elsewhere, path), ==, 0);
    g_assert_cmpuint(agent_token(), ==, before);
    g_assert_cmpint(g_remove(path), ==, 0);
    g_assert_cmpint(mkfifo(path, 0600), ==, 0);
    const uint64_t token = agent_token(); /* nobody writes to it: must not wait */
    g_assert_cmpuint(agent_token(), ==, token);
    check_mode(path);
    g_assert_cmpint(g_remove(elsewhere), ==, 0);
}

static void damaged(void)
{
    static const char *const texts[] = {
        "", "\n", "xyz\n", "ffffffff\n", "-123456789abcdef0\n", "123456789abcdef01234\n"};
    g_autofree char *path = token_path();
    for (size_t i = 0; i < G_N_ELEMENTS(texts); i++) {
        g_assert_true(
            g_file_set_contents_full(path, texts[i], -1, G_FILE_SET_CONTENTS_NONE, 0600, NULL));
        const uint64_t token = agent_token();
        g_assert_cmpuint(token >> 32, !=, 0);
        g_assert_cmpuint(agent_token(), ==, token);
    }
}

static gpointer ask(gpointer token)
{
    *(uint64_t *)token = agent_token();
    return NULL;
}

/* Who comes first at the same time gets the same one. A lock counts for threads as for processes:
 * each call has a file description of its own. */
static void together(void)
{
    enum { ROUNDS = 50, AT_ONCE = 8 };
    g_autofree char *path = token_path();
    for (int round = 0; round < ROUNDS; round++) {
        uint64_t tokens[AT_ONCE] = {0};
        GThread *threads[AT_ONCE];
        g_remove(path);
        for (int i = 0; i < AT_ONCE; i++)
            threads[i] = g_thread_new("first", ask, &tokens[i]);
        for (int i = 0; i < AT_ONCE; i++)
            g_thread_join(threads[i]);
        for (int i = 1; i < AT_ONCE; i++)
            g_assert_cmpuint(tokens[i], ==, tokens[0]);
    }
}

static void add(void)
{
    g_test_add_func("/agent/token/kept", kept);
    g_test_add_func("/agent/token/others", others);
    g_test_add_func("/agent/token/no-plain-file", no_plain_file);
    g_test_add_func("/agent/token/damaged", damaged);
    g_test_add_func("/agent/token/together", together);
}

int main(int argc, char **argv)
{
    return test_main_as_new_user(argc, argv, add);
}
