/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What others recorded between other machines, sent to ours: every request of the captures is
 * answered by its own transaction, as section 2.9 says, or ends its connection; nothing changes.
 */
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/unit/fieldbus_rig.h"

enum { PCAP_HEADER = 24, PACKET_HEADER = 16, ETHERNET = 14, MODBUS_PORT = 502, ADU_BYTES = 260 };

static unsigned u16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

/* The payload of a TCP packet to the Modbus port, and its sender's port. */
static const uint8_t *payload(const uint8_t *frame, size_t n, unsigned *port, size_t *length)
{
    const uint8_t *ip = frame + ETHERNET;
    if (n < ETHERNET + 40 || u16(frame + 12) != 0x0800 || ip[0] >> 4 != 4 || ip[9] != IPPROTO_TCP)
        return NULL;
    const size_t header = (size_t)(ip[0] & 15) * 4, total = u16(ip + 2);
    const uint8_t *tcp = ip + header;
    if (total > n - ETHERNET || header + 20 > total)
        return NULL;
    const size_t offset = header + (size_t)(tcp[12] >> 4) * 4;
    if (u16(tcp + 2) != MODBUS_PORT || offset >= total)
        return NULL;
    *port = u16(tcp);
    *length = total - offset;
    return ip + offset;
}

typedef struct {
    Rig rig;
    FbModbusServer *server;
    GHashTable *sockets; /* sender's port in the capture → our socket + 1 */
    unsigned requests, answers, exceptions, closed;
} Stand;

static void act(FbDo what, void *data)
{
    (void)what;
    *(bool *)data = true;
}

static int connect_to(uint16_t port)
{
    const struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_port = htons(port), .sin_addr = {htonl(INADDR_LOOPBACK)}};
    const int fd = socket(AF_INET, SOCK_STREAM, 0);
    g_assert_cmpint(connect(fd, (const struct sockaddr *)&address, sizeof address), ==, 0);
    return fd;
}

static int socket_of(Stand *s, unsigned port)
{
    int fd = GPOINTER_TO_INT(g_hash_table_lookup(s->sockets, GUINT_TO_POINTER(port))) - 1;
    if (fd < 0) {
        fd = connect_to(fb_modbus_server_port(s->server));
        g_hash_table_insert(s->sockets, GUINT_TO_POINTER(port), GINT_TO_POINTER(fd + 1));
    }
    return fd;
}

/* Lets the server work; what it sends back on `fd`, 0: it closed it, -1: nothing. */
static ssize_t turn(int fd, uint8_t *in, size_t n)
{
    const int64_t end_us = g_get_monotonic_time() + 300000;
    ssize_t got = -1;
    while (got < 0 && g_get_monotonic_time() < end_us) {
        g_main_context_iteration(NULL, FALSE);
        got = recv(fd, in, n, MSG_DONTWAIT);
    }
    return got;
}

/* One packet holds whole ADUs in these captures, but for those that are damaged. */
static bool is_whole(const uint8_t *adu, size_t n)
{
    return n >= 8 && u16(adu + 2) == 0 && u16(adu + 4) == n - 6;
}

static void send_packet(Stand *s, unsigned port, const uint8_t *bytes, size_t n)
{
    uint8_t in[8 * ADU_BYTES];
    const int fd = socket_of(s, port);
    if (send(fd, bytes, n, MSG_NOSIGNAL) != (ssize_t)n)
        return;
    s->requests++;
    const ssize_t got = turn(fd, in, sizeof in);
    if (got == 0) {
        s->closed++;
        close(fd);
        g_hash_table_remove(s->sockets, GUINT_TO_POINTER(port));
    } else if (is_whole(bytes, n)) {
        g_assert_cmpint(got, >=, 9);
        if (got < 9)
            return;
        s->answers++;
        s->exceptions += (in[7] & 0x80) != 0;
        g_assert_cmpuint(u16(in), ==, u16(bytes));
        g_assert_cmpuint(in[6], ==, bytes[6]);
        g_assert_cmpuint(in[7] & 0x7f, ==, bytes[7] & 0x7f);
    }
}

static void send_capture(Stand *s, const uint8_t *pcap, size_t n)
{
    for (size_t at = PCAP_HEADER; at + PACKET_HEADER < n;) {
        uint32_t captured;
        unsigned port;
        size_t length;
        memcpy(&captured, pcap + at + 8, sizeof captured);
        at += PACKET_HEADER;
        if (captured > n - at)
            break;
        const uint8_t *bytes = payload(pcap + at, captured, &port, &length);
        if (bytes)
            send_packet(s, port, bytes, length);
        at += captured;
    }
}

static void close_all(Stand *s)
{
    GHashTableIter each;
    gpointer fd;
    g_hash_table_iter_init(&each, s->sockets);
    while (g_hash_table_iter_next(&each, NULL, &fd))
        close(GPOINTER_TO_INT(fd) - 1);
    g_hash_table_unref(s->sockets);
}

static void one_capture(const char *path)
{
    bool acted = false;
    g_autofree char *bytes = NULL;
    gsize n = 0;
    g_autoptr(GError) error = NULL;
    Stand s = {.rig = rig_new(), .sockets = g_hash_table_new(NULL, NULL)};
    const FbModbusServerOptions options = {.host = "127.0.0.1", .unit_id = 1};
    s.server = fb_modbus_server_new(&options, s.rig.receiver, act, &acted, NULL, &error);
    g_assert_no_error(error);
    g_assert_true(g_file_get_contents(path, &bytes, &n, NULL));
    if (s.server && n > PCAP_HEADER) {
        const FbStatus before = rig_status(&s.rig);
        send_capture(&s, (const uint8_t *)bytes, n);
        const FbStatus after = rig_status(&s.rig);
        g_test_message("%s: %u requests, %u answers, %u of them exceptions, %u connections ended",
                       path, s.requests, s.answers, s.exceptions, s.closed);
        g_assert_cmpuint(s.requests, >, 0);
        g_assert_cmpuint(fb_modbus_server_exceptions(s.server), >=, s.exceptions);
        g_assert_cmpint(after.state, ==, before.state);
        g_assert_cmpuint(after.transfer, ==, before.transfer);
        g_assert_cmpuint(after.lease_owner, ==, before.lease_owner);
        g_assert_cmpuint(after.command_session, ==, before.command_session);
        g_assert_false(acted);
    }
    close_all(&s);
    fb_modbus_server_free(s.server);
    rig_free(&s.rig);
}

static void captures(void)
{
    static const char *const suffixes[] = {".pcap", NULL};
    g_autoptr(GPtrArray) files = test_data_files("bus", suffixes);
    for (guint i = 0; files && i < files->len; i++)
        one_capture(files->pdata[i]);
}

static void add(void)
{
    g_test_add_func("/fieldbus/captures/others", captures);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
