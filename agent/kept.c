/* SPDX-License-Identifier: Apache-2.0 */
#include "agent/kept.h"

#include <errno.h>
#include <glib/gstdio.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "agent/agent.h"

static bool write_file(const char *path, const void *bytes, size_t length, int mode,
                       GError **error);
static char *description(const NcProgram *program, const char *machine_file,
                         const char *tools_file);
static bool read_description(AgentKept *kept, const char *path, GError **error);
static void forget_oldest(const char *folder);

static char *folder_path(void)
{
    return g_build_filename(g_get_user_state_dir(), "segmill", "programs", NULL);
}

static char *path_of(const char *folder, const char *name, const char *suffix)
{
    g_autofree char *file = g_strconcat(name, suffix, NULL);
    return g_build_filename(folder, file, NULL);
}

bool agent_kept_store(const NcProgram *program, const char *machine_file, const char *tools_file,
                      GError **error)
{
    g_autofree char *folder = folder_path();
    if (g_mkdir_with_parents(folder, 0700) != 0) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_OUTPUT, "%s: cannot make the folder: %s",
                    folder, g_strerror(errno));
        return false;
    }
    g_autofree char *bytes_path = path_of(folder, program->sha256, ".ngc");
    g_autofree char *ini_path = path_of(folder, program->sha256, ".ini");
    g_autofree char *text = description(program, machine_file, tools_file);
    size_t length;
    const void *bytes = g_bytes_get_data(program->bytes, &length);
    if (!write_file(ini_path, text, strlen(text), 0600, error) ||
        !write_file(bytes_path, bytes, length, 0444, error))
        return false;
    forget_oldest(folder);
    return true;
}

AgentKept *agent_kept_load(const uint8_t id[32], GError **error)
{
    char name[65];
    agent_kept_name(id, name);
    g_autofree char *folder = folder_path();
    g_autofree char *bytes_path = path_of(folder, name, ".ngc");
    g_autofree char *ini_path = path_of(folder, name, ".ini");
    g_autoptr(GError) cause = NULL;
    g_autoptr(GBytes) bytes = agent_program_load(bytes_path, &cause);
    if (!bytes) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "this user has no copy of the machine's program: %s; send it again",
                    cause->message);
        return NULL;
    }
    g_autoptr(AgentKept) kept = g_new0(AgentKept, 1);
    kept->program = nc_program_new(bytes, NULL, 0);
    const char *sha256 = kept->program->sha256;
    if (strcmp(sha256, name) != 0) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT,
                    "%s is damaged: its SHA-256 is %s; send the program again", bytes_path, sha256);
        return NULL;
    }
    memcpy(kept->id, id, sizeof kept->id);
    return read_description(kept, ini_path, error) ? g_steal_pointer(&kept) : NULL;
}

const char *agent_kept_machine_file(const AgentKept *kept, const char *given, const char *known,
                                    const char **tools_file)
{
    const bool as_sent = !given && kept->machine_file;
    *tools_file = as_sent ? kept->tools_file : NULL;
    return as_sent ? kept->machine_file : given ? given : known;
}

void agent_kept_free(AgentKept *kept)
{
    if (!kept)
        return;
    nc_program_free(kept->program);
    g_free(kept->machine_file);
    g_free(kept->tools_file);
    g_free(kept);
}

void agent_kept_name(const uint8_t id[32], char name[65])
{
    for (size_t i = 0; i < 32; i++)
        snprintf(name + 2 * i, 3, "%02x", id[i]);
}

/* Beside, then renamed, and on the disk before it is relied on. */
static bool write_file(const char *path, const void *bytes, size_t length, int mode, GError **error)
{
    const GFileSetContentsFlags flags =
        G_FILE_SET_CONTENTS_CONSISTENT | G_FILE_SET_CONTENTS_DURABLE;
    g_autoptr(GError) cause = NULL;
    if (g_file_set_contents_full(path, bytes, (gssize)length, flags, mode, &cause))
        return true;
    g_set_error(error, AGENT_ERROR, AGENT_ERROR_OUTPUT,
                "the program cannot be kept for a restart: %s", cause->message);
    return false;
}

/* ----------------------------------------------------------------- description */

static void set_path(GKeyFile *file, const char *key, const char *path)
{
    if (!path)
        return;
    g_autofree char *absolute = g_canonicalize_filename(path, NULL);
    g_key_file_set_string(file, "machine", key, absolute);
}

static char *description(const NcProgram *program, const char *machine_file, const char *tools_file)
{
    g_autoptr(GKeyFile) file = g_key_file_new();
    g_autoptr(GString) gates = g_string_new(NULL);
    for (size_t i = 0; i < program->n_gates; i++)
        g_string_append_printf(gates, "%s%" G_GUINT64_FORMAT, i ? " " : "", program->gates[i]);
    g_key_file_set_string(file, "program", "gates", gates->str);
    set_path(file, "file", machine_file);
    set_path(file, "tools", tools_file);
    return g_key_file_to_data(file, NULL, NULL);
}

/* Ascending, and the last one is the length: what the machine was told. */
static bool read_gates(NcProgram *program, const char *text)
{
    g_auto(GStrv) words = g_strsplit(text, " ", -1);
    size_t n = g_strv_length(words);
    program->gates = g_new(uint64_t, n + 1);
    for (size_t i = 0; i < n; i++) {
        guint64 gate;
        if (!g_ascii_string_to_unsigned(words[i], 10, 0, g_bytes_get_size(program->bytes), &gate,
                                        NULL) ||
            (i > 0 && gate <= program->gates[i - 1]))
            return false;
        program->gates[program->n_gates++] = gate;
    }
    return n > 0 && program->gates[n - 1] == g_bytes_get_size(program->bytes);
}

static bool read_description(AgentKept *kept, const char *path, GError **error)
{
    g_autoptr(GKeyFile) file = g_key_file_new();
    g_autoptr(GError) cause = NULL;
    g_autofree char *gates = NULL;
    if (g_key_file_load_from_file(file, path, G_KEY_FILE_NONE, &cause))
        gates = g_key_file_get_string(file, "program", "gates", &cause);
    if (!gates || !read_gates(kept->program, gates)) {
        g_set_error(error, AGENT_ERROR, AGENT_ERROR_INPUT, "%s: %s; send the program again", path,
                    cause ? cause->message : "the gates are not those of the program");
        return false;
    }
    kept->machine_file = g_key_file_get_string(file, "machine", "file", NULL);
    kept->tools_file = g_key_file_get_string(file, "machine", "tools", NULL);
    return true;
}

/* ------------------------------------------------------------------------ room */

typedef struct {
    char *path;
    struct timespec written;
} Old;

static int by_time(const void *a, const void *b)
{
    const struct timespec *x = &((const Old *)a)->written, *y = &((const Old *)b)->written;
    if (x->tv_sec != y->tv_sec)
        return x->tv_sec < y->tv_sec ? 1 : -1;
    return x->tv_nsec < y->tv_nsec ? 1 : x->tv_nsec > y->tv_nsec ? -1 : 0;
}

static void clear_old(void *data)
{
    g_free(((Old *)data)->path);
}

/* Another process may be doing the same: what is gone is gone. */
static void forget_oldest(const char *folder)
{
    g_autoptr(GArray) all = g_array_new(false, false, sizeof(Old));
    g_array_set_clear_func(all, clear_old);
    g_autoptr(GDir) dir = g_dir_open(folder, 0, NULL);
    for (const char *name; dir && (name = g_dir_read_name(dir));) {
        struct stat found;
        g_autofree char *path = g_build_filename(folder, name, NULL);
        if (!g_str_has_suffix(name, ".ngc") || stat(path, &found) != 0)
            continue;
        Old old = {g_steal_pointer(&path), found.st_mtim};
        g_array_append_val(all, old);
    }
    g_array_sort(all, by_time);
    for (guint i = AGENT_KEPT_MOST; i < all->len; i++) {
        char *path = g_array_index(all, Old, i).path;
        g_remove(path);
        strcpy(path + strlen(path) - strlen("ngc"), "ini");
        g_remove(path);
    }
}
