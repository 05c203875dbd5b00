/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/relay.h"

#include <arpa/inet.h>
#include <glib.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sched.h>
#include <stdbool.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { MOST = 32, PIECE_BYTES = 16384 };

/* What came from one side; n is 0 at its end. */
typedef struct {
    int64_t due_us;
    size_t n;
    uint8_t bytes[];
} Piece;

/* fd[i] and fd[i ^ 1] are the two sides of a connection: what one says goes to the other. */
typedef struct {
    int fd[MOST];
    GQueue pieces[MOST]; /* that came from fd[i] */
    int n;
} Relay;

static struct sockaddr_in loopback(uint16_t port)
{
    return (struct sockaddr_in){
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
}

static void add(Relay *r, int fd)
{
    const int one = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    r->fd[r->n] = fd;
    g_queue_init(&r->pieces[r->n++]);
}

static void take_connection(Relay *r, int listener, uint16_t to)
{
    const struct sockaddr_in at = loopback(to);
    const int agent = accept(listener, NULL, NULL), machine = socket(AF_INET, SOCK_STREAM, 0);
    if (agent < 0 || machine < 0 || r->n + 2 > MOST ||
        connect(machine, (const struct sockaddr *)&at, sizeof at) != 0) {
        close(agent);
        close(machine);
        return;
    }
    add(r, agent);
    add(r, machine);
}

static void take_piece(Relay *r, int i, int64_t delay_us)
{
    uint8_t bytes[PIECE_BYTES];
    const ssize_t n = read(r->fd[i], bytes, sizeof bytes);
    Piece *piece = g_malloc(sizeof *piece + sizeof bytes);
    piece->due_us = g_get_monotonic_time() + delay_us;
    piece->n = n > 0 ? (size_t)n : 0;
    memcpy(piece->bytes, bytes, piece->n);
    g_queue_push_tail(&r->pieces[i], piece);
}

static bool at_end(const Relay *r, int i)
{
    const Piece *last = g_queue_peek_tail((GQueue *)&r->pieces[i]);
    return last && last->n == 0;
}

/* Hands on what is due; when the next piece is, or INT64_MAX. */
static int64_t hand_on(Relay *r, int64_t now_us)
{
    int64_t next_us = INT64_MAX;
    for (int i = 0; i < r->n; i++) {
        Piece *piece;
        while ((piece = g_queue_peek_head(&r->pieces[i])) && piece->n > 0 &&
               piece->due_us <= now_us) {
            if (send(r->fd[i ^ 1], piece->bytes, piece->n, MSG_NOSIGNAL) < 0)
                piece->n = 0;
            g_free(g_queue_pop_head(&r->pieces[i]));
        }
        if (piece && piece->n == 0)
            shutdown(r->fd[i ^ 1], SHUT_WR);
        else if (piece)
            next_us = MIN(next_us, piece->due_us);
    }
    return next_us;
}

static void serve(int listener, uint16_t to, int64_t delay_us)
{
    static Relay r;
    cpu_set_t all; /* where the ends are pinned is no matter of the network's */
    memset(&all, 0xff, sizeof all);
    sched_setaffinity(0, sizeof all, &all);
    int64_t next_us = INT64_MAX;
    for (;;) {
        struct pollfd polled[MOST + 1] = {{.fd = listener, .events = POLLIN}};
        for (int i = 0; i < r.n; i++)
            polled[i + 1] = (struct pollfd){.fd = at_end(&r, i) ? -1 : r.fd[i], .events = POLLIN};
        const int64_t left_us = MAX(0, next_us - g_get_monotonic_time());
        const struct timespec left = {left_us / 1000000, left_us % 1000000 * 1000};
        const int n = r.n;
        if (ppoll(polled, (nfds_t)n + 1, next_us == INT64_MAX ? NULL : &left, NULL) < 0)
            _exit(1);
        for (int i = 0; i < n; i++)
            if (polled[i + 1].revents)
                take_piece(&r, i, delay_us);
        if (polled[0].revents)
            take_connection(&r, listener, to);
        next_us = hand_on(&r, g_get_monotonic_time());
    }
}

pid_t relay_spawn(uint16_t to, int64_t delay_us, uint16_t *port)
{
    struct sockaddr_in at = loopback(0);
    socklen_t n = sizeof at;
    const int listener = socket(AF_INET, SOCK_STREAM, 0);
    if (bind(listener, (struct sockaddr *)&at, sizeof at) != 0 || listen(listener, 8) != 0 ||
        getsockname(listener, (struct sockaddr *)&at, &n) != 0) {
        close(listener);
        return -1;
    }
    *port = ntohs(at.sin_port);
    const pid_t child = fork();
    if (child == 0)
        serve(listener, to, delay_us);
    close(listener);
    return child;
}
