/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/geom/child.h"

#include "segcore/segcore.h"

#include <errno.h>
#include <fcntl.h>
#include <glib-unix.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/pidfd.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { READ_BYTES = 1 << 20 };

typedef struct {
    int in, out, err; /* our ends; -1 when closed */
    const char *input;
    size_t input_left;
    size_t out_room;
} Pipes;

static void limit_child(gpointer limits);
static bool attend(Pipes *pipes, gint64 deadline_us, uint64_t most, SegChildResult *result);
static bool ends_by(GPid pid, gint64 deadline_us, SegChildResult *result);
static void close_pipes(Pipes *pipes);

bool seg_child_run(const char *const *argv, const char *input, const SegChildLimits *limits,
                   SegChildResult *result, GError **error)
{
    Pipes pipes = {.in = -1, .input = input, .input_left = input ? strlen(input) : 0};
    GPid pid;
    g_autoptr(GError) why = NULL;
    if (!g_spawn_async_with_pipes(NULL, (char **)(uintptr_t)argv, NULL, G_SPAWN_DO_NOT_REAP_CHILD,
                                  limit_child, (gpointer)limits, &pid, input ? &pipes.in : NULL,
                                  &pipes.out, &pipes.err, &why)) {
        g_set_error(error, SEG_ERROR, SEG_ERROR_IO, "%s: %s", argv[0], why->message);
        return false;
    }
    gint64 deadline_us = g_get_monotonic_time() + (gint64)limits->timeout_s * G_USEC_PER_SEC;
    if (!attend(&pipes, deadline_us, limits->memory_bytes, result) ||
        !ends_by(pid, deadline_us, result))
        kill(pid, SIGKILL);
    close_pipes(&pipes);
    while (waitpid(pid, &result->status, 0) < 0)
        if (errno != EINTR) {
            g_set_error(error, SEG_ERROR, SEG_ERROR_IO, "%s: %s", argv[0], g_strerror(errno));
            return false;
        }
    return true;
}

void seg_child_result_clear(SegChildResult *result)
{
    g_clear_pointer(&result->out, g_free);
}

/* Between fork and exec: only what is safe in a signal handler. */
static void limit_child(gpointer data)
{
    const SegChildLimits *limits = data;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
    setrlimit(RLIMIT_AS, &(struct rlimit){limits->memory_bytes, limits->memory_bytes});
    setrlimit(RLIMIT_CPU, &(struct rlimit){limits->timeout_s + 1, limits->timeout_s + 2});
}

/* ------------------------------------------------------------------ its pipes */

static void close_fd(int *fd)
{
    if (*fd >= 0)
        close(*fd);
    *fd = -1;
}

static void close_pipes(Pipes *pipes)
{
    close_fd(&pipes->in);
    close_fd(&pipes->out);
    close_fd(&pipes->err);
}

static bool again(ssize_t n)
{
    return n < 0 && (errno == EAGAIN || errno == EINTR);
}

/* A child that does not read must not end us: SIGPIPE is blocked for the write. */
static void feed(Pipes *pipes)
{
    sigset_t broken, before;
    sigemptyset(&broken);
    sigaddset(&broken, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &broken, &before);
    ssize_t n = write(pipes->in, pipes->input, pipes->input_left);
    bool ended = n < 0 && errno == EPIPE;
    if (ended)
        sigtimedwait(&broken, NULL, &(struct timespec){0});
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (n > 0) {
        pipes->input += n;
        pipes->input_left -= (size_t)n;
    }
    if (pipes->input_left == 0 || ended || (n < 0 && !again(n)))
        close_fd(&pipes->in);
}

static void take_output(Pipes *pipes, SegChildResult *result)
{
    if (pipes->out_room < READ_BYTES) {
        size_t size = result->out_length + MAX(READ_BYTES, result->out_length);
        result->out = g_realloc(result->out, size);
        pipes->out_room = size - result->out_length;
    }
    ssize_t n = read(pipes->out, result->out + result->out_length, READ_BYTES);
    if (n > 0) {
        result->out_length += (size_t)n;
        pipes->out_room -= (size_t)n;
    } else if (!again(n)) {
        close_fd(&pipes->out);
    }
}

/* Keeps the last of what is said. */
static void take_errors(Pipes *pipes, SegChildResult *result)
{
    enum { KEPT = sizeof result->err - 1 };
    char said[KEPT];
    ssize_t n = read(pipes->err, said, sizeof said);
    if (n <= 0) {
        if (!again(n))
            close_fd(&pipes->err);
        return;
    }
    size_t fresh = (size_t)n, old = MIN(result->err_length, KEPT - fresh);
    memmove(result->err, result->err + result->err_length - old, old);
    memcpy(result->err + old, said, fresh);
    result->err_length = old + fresh;
    result->err[result->err_length] = '\0';
}

static void make_ready(Pipes *pipes)
{
    if (pipes->in >= 0)
        g_unix_set_fd_nonblocking(pipes->in, TRUE, NULL);
    g_unix_set_fd_nonblocking(pipes->out, TRUE, NULL);
    g_unix_set_fd_nonblocking(pipes->err, TRUE, NULL);
    fcntl(pipes->out, F_SETPIPE_SZ, READ_BYTES); /* fewer wake-ups; refused is as good */
    if (pipes->in >= 0 && pipes->input_left == 0)
        close_fd(&pipes->in);
}

/* Milliseconds for poll; 0 when the time is over. */
static int wait_ms(gint64 deadline_us)
{
    return (int)CLAMP((deadline_us - g_get_monotonic_time() + 999) / 1000, 0, 1000);
}

/* Until the child has closed both its outputs; false when it is to be killed. */
static bool attend(Pipes *pipes, gint64 deadline_us, uint64_t most, SegChildResult *result)
{
    make_ready(pipes);
    while (pipes->out >= 0 || pipes->err >= 0) {
        struct pollfd fds[] = {
            {pipes->out, POLLIN, 0}, {pipes->err, POLLIN, 0}, {pipes->in, POLLOUT, 0}};
        int ms = wait_ms(deadline_us);
        if (ms == 0) {
            result->end = SEG_CHILD_TIMED_OUT;
            return false;
        }
        if (poll(fds, G_N_ELEMENTS(fds), ms) <= 0)
            continue;
        if (fds[2].revents)
            feed(pipes);
        if (fds[1].revents)
            take_errors(pipes, result);
        if (fds[0].revents)
            take_output(pipes, result);
        if (result->out_length > most) {
            result->end = SEG_CHILD_TOO_LONG;
            return false;
        }
    }
    return true;
}

/* It may live on with its outputs closed. */
static bool ends_by(GPid pid, gint64 deadline_us, SegChildResult *result)
{
    struct pollfd ended = {pidfd_open(pid, 0), POLLIN, 0};
    int ms = 0;
    while (ended.fd >= 0 && !ended.revents && (ms = wait_ms(deadline_us)) > 0)
        poll(&ended, 1, ms);
    bool in_time = ended.fd >= 0 && ended.revents;
    close_fd(&ended.fd);
    if (!in_time)
        result->end = SEG_CHILD_TIMED_OUT;
    return in_time;
}
