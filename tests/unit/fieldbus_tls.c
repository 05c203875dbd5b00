/* SPDX-License-Identifier: Apache-2.0 */
/* Modbus/TCP Security: docs/protocol.md, section 2.10. Who gets in, and that nobody who does not
 * delays those who have. */
#include "tests/unit/fieldbus_tls.h"

#include <glib/gstdio.h>
#include <sys/stat.h>

static void deliver(Cell *c, FbSession *session, GBytes *p)
{
    const uint64_t end = g_bytes_get_size(p);
    const int before = c->done[FB_TASK_DELIVER];
    fb_session_deliver(session, p, &end, 1);
    g_assert_true(run_until(c, &c->done[FB_TASK_DELIVER], before + 1));
}

static void delivers_and_runs(void)
{
    static const int windows[] = {1, 16};
    for (size_t i = 0; i < G_N_ELEMENTS(windows); i++) {
        Cell c;
        open_tls_cell(&c);
        c.session = tls_session(&c, "programmer", i == 0 ? "127.0.0.1" : "localhost", windows[i]);
        g_autoptr(GBytes) p = program(300000);
        deliver(&c, c.session, p);
        g_assert_no_error(c.error);
        fb_session_start(c.session);
        g_assert_true(run_until(&c, &c.done[FB_TASK_RUN], 1));
        g_assert_no_error(c.error);
        g_assert_cmpint(c.starts, ==, 1);
        g_assert_true(c.executed && g_bytes_equal(c.executed, p));
        g_assert_cmpuint(fb_modbus_server_refused(c.server), ==, 0);
        close_cell(&c);
    }
}

/* ------------------------------------------------------------------------- strangers */

/* The machine refuses, counts, and goes on. */
static void assert_refused(Cell *c, SSL *ssl, int fd, int reason)
{
    const uint64_t before = fb_modbus_server_refused(c->server);
    const int got = stranger_goes_on(c, ssl);
    g_test_message("the stranger sees: %s", ERR_reason_error_string(ERR_PACK(ERR_LIB_SSL, 0, got)));
    g_assert_cmpint(got, ==, reason);
    g_assert_cmpuint(fb_modbus_server_refused(c->server), ==, before + 1);
    SSL_free(ssl);
    close(fd);
}

static void strangers_stay_out(void)
{
    Cell c;
    FbStatus before, after;
    open_tls_cell(&c);
    fb_receiver_status(c.receiver, 0, &before);
    const struct {
        const char *certificate;
        int versions, reason; /* highest version; 0: any */
    } strangers[] = {
        {NULL, 0, SSL_R_TLSV13_ALERT_CERTIFICATE_REQUIRED},
        {NULL, TLS1_2_VERSION, SSL_R_SSLV3_ALERT_HANDSHAKE_FAILURE},
        {"stranger", 0, SSL_R_TLSV1_ALERT_UNKNOWN_CA},
        {"stranger", TLS1_2_VERSION, SSL_R_TLSV1_ALERT_UNKNOWN_CA},
        {"expired", 0, SSL_R_SSLV3_ALERT_CERTIFICATE_EXPIRED},
        {"machine", 0, SSL_R_SSLV3_ALERT_UNSUPPORTED_CERTIFICATE},
        {"programmer", TLS1_1_VERSION, SSL_R_TLSV1_ALERT_PROTOCOL_VERSION},
    };
    for (size_t i = 0; i < G_N_ELEMENTS(strangers); i++) {
        const int fd = raw_connect(&c);
        SSL *ssl = stranger(strangers[i].certificate, false, fd);
        SSL_set_security_level(ssl, 0);
        SSL_set_cipher_list(ssl, "ALL:@SECLEVEL=0");
        if (strangers[i].versions)
            SSL_set_max_proto_version(ssl, strangers[i].versions);
        g_test_message("%s, %d", strangers[i].certificate, strangers[i].versions);
        assert_refused(&c, ssl, fd, strangers[i].reason);
    }
    /* The same OpenSSL with a good certificate gets in, by 1.2 and by 1.3. */
    for (int version = TLS1_2_VERSION; version <= TLS1_3_VERSION; version++) {
        static const uint8_t read[] = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1};
        const int fd = raw_connect(&c);
        SSL *ssl = stranger("observer", false, fd);
        SSL_set_min_proto_version(ssl, version);
        SSL_set_max_proto_version(ssl, version);
        const int64_t end_us = g_get_monotonic_time() + 3000000;
        while (SSL_write(ssl, read, sizeof read) <= 0 && g_get_monotonic_time() < end_us)
            turn(&c, 1);
        g_assert_cmpint(SSL_version(ssl), ==, version);
        g_test_message("%s", SSL_get_cipher(ssl));
        g_assert_cmpint(stranger_goes_on(&c, ssl), ==, 1);
        SSL_free(ssl);
        close(fd);
    }
    fb_receiver_status(c.receiver, 0, &after);
    after.heartbeat = before.heartbeat;
    g_assert_true(memcmp(&before, &after, sizeof before) == 0);
    close_cell(&c);
}

static SSL *observer_of_1_2(Cell *c, int *fd)
{
    *fd = raw_connect(c);
    SSL *ssl = stranger("observer", false, *fd);
    SSL_set_max_proto_version(ssl, TLS1_2_VERSION);
    const int64_t end_us = g_get_monotonic_time() + 3000000;
    while (SSL_do_handshake(ssl) != 1 && g_get_monotonic_time() < end_us)
        turn(c, 1);
    g_assert_true(SSL_is_init_finished(ssl));
    return ssl;
}

/* There is no second handshake on a connection: nobody makes the machine work for nothing. */
static void no_renegotiation(void)
{
    Cell c;
    int fd;
    open_tls_cell(&c);
    SSL *ssl = observer_of_1_2(&c, &fd);
    g_assert_cmpint(SSL_renegotiate(ssl), ==, 1);
    g_assert_cmpint(stranger_goes_on(&c, ssl), ==, SSL_R_NO_RENEGOTIATION);
    SSL_free(ssl);
    close(fd);
    close_cell(&c);
}

/* Whoever ends a connection says so: the peer can tell it from one that was cut. */
static void says_close_notify(void)
{
    Cell c;
    int fd;
    open_tls_cell(&c);
    SSL *ssl = observer_of_1_2(&c, &fd);
    turn(&c, 5);
    fb_modbus_server_free(g_steal_pointer(&c.server));
    g_assert_cmpint(stranger_goes_on(&c, ssl), ==, 0);
    g_assert_cmpint(SSL_get_shutdown(ssl) & SSL_RECEIVED_SHUTDOWN, !=, 0);
    SSL_free(ssl);
    close(fd);
    close_cell(&c);
}

/* Plain Modbus on the port of TLS: no answer, the connection ends, it is counted. */
static void plain_client(void)
{
    static const uint8_t read[] = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1};
    Cell c;
    uint8_t answer[FB_ADU_BYTES];
    open_tls_cell(&c);
    const int fd = raw_connect(&c);
    g_assert_cmpint(send(fd, read, sizeof read, MSG_NOSIGNAL), ==, sizeof read);
    ssize_t n = -1;
    for (int i = 0; i < 2000 && n != 0; i++) {
        turn(&c, 1);
        n = recv(fd, answer, sizeof answer, MSG_DONTWAIT);
        g_assert_true(n <= 7); /* an alert at most */
    }
    g_assert_cmpint(n, ==, 0);
    g_assert_cmpuint(fb_modbus_server_refused(c.server), ==, 1);
    close(fd);
    close_cell(&c);
}

/* ---------------------------------------------------------- what the agent believes */

/* What our client says of a machine with this certificate, under this name. */
static void assert_distrusted(const char *certificate, const char *host, const char *why)
{
    static const FbMbapCallbacks callbacks = {peer_ready, peer_adu, peer_broken};
    Cell c = {.context = g_main_context_new()};
    int pair[2];
    g_assert_cmpint(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), ==, 0);
    g_auto(CfgTls) files = tls_files("ca", "programmer");
    g_autoptr(FbTls) tls = fb_tls_new(&files, false, NULL);
    SSL *machine_ssl = stranger(certificate, true, pair[0]);
    Peer p = {0};
    p.mbap = fb_mbap_new(pair[1], tls, host, &callbacks, &p, c.context);
    stranger_goes_on(&c, machine_ssl);
    turn(&c, 10);
    g_test_message("%s as %s: %s", certificate, host, p.why);
    g_assert_cmpint(p.ready, ==, why == NULL);
    if (why)
        g_assert_nonnull(p.why ? strstr(p.why, why) : NULL);
    fb_mbap_free(p.mbap);
    SSL_free(machine_ssl);
    close(pair[0]);
    g_main_context_unref(c.context);
}

static void false_machines(void)
{
    g_autofree char *endless = g_strnfill(300, 'a');
    assert_distrusted("localhost", "localhost", "names another host");
    assert_distrusted("localhost", "192.0.2.7", NULL);
    assert_distrusted("machine", "", "cannot name this host");
    assert_distrusted("machine", endless, "cannot name this host");
    assert_distrusted("stranger-machine", "localhost", "not signed by our CA");
    assert_distrusted("expired-machine", "localhost", "has expired");
    assert_distrusted("elsewhere", "localhost", "names another host");
    assert_distrusted("elsewhere", "192.0.2.8", "names another host");
    assert_distrusted("machine", "mill.example", "names another host");
    assert_distrusted("programmer", "localhost", "for another purpose");
}

/* A session says why it cannot go on, or why the machine does not want it; nothing is commanded. */
static void session_says_why(void)
{
    static const struct {
        const char *machine, *agent, *why;
    } cases[] = {{"elsewhere", "programmer", "names another host"},
                 {"stranger-machine", "programmer", "not signed by our CA"},
                 {"machine", "stranger", "does not know the CA of our certificate"},
                 {"machine", "machine", "our certificate is for another purpose"}};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        Cell c;
        open_tls_cell(&c);
        fb_modbus_server_free(c.server);
        c.server = serve_tls(&c, 0, cases[i].machine);
        c.session = tls_session(&c, cases[i].agent, "127.0.0.1", 1);
        fb_session_command(c.session, FB_COMMAND_HOLD, NULL);
        const uint64_t *counts = fb_receiver_counts(c.receiver);
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], 1));
        g_assert_error(c.error, FB_ERROR, FB_ERROR_UNREACHABLE);
        g_test_message("%s", c.error ? c.error->message : "");
        g_assert_nonnull(c.error ? strstr(c.error->message, cases[i].why) : NULL);
        for (int answer = 0; answer < FB_N_ANSWERS; answer++)
            g_assert_cmpuint(counts[answer], ==, 0);
        g_assert_cmpuint(fb_modbus_server_refused(c.server), >, 0);
        close_cell(&c);
    }
}

/* ---------------------------------------------------------------------- credentials */

static void assert_no_tls(const CfgTls *files, bool server, const char *why)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(FbTls) tls = fb_tls_new(files, server, &error);
    g_assert_null(tls);
    g_assert_error(error, FB_ERROR, FB_ERROR_CREDENTIALS);
    g_test_message("%s", error ? error->message : "");
    g_assert_nonnull(error ? strstr(error->message, why) : NULL);
}

static void files_of_no_use(void)
{
    g_auto(CfgTls) good = tls_files("ca", "machine");
    g_auto(CfgTls) other = tls_files("ca", "observer");
    g_auto(CfgTls) expired = tls_files("ca", "expired-machine");
    g_autofree char *nowhere = in_folder("nowhere", ".pem");
    CfgTls bad = good;
    assert_no_tls(&expired, true, "expired");
    assert_no_tls(&(CfgTls){0}, true, "[tls] ca");
    assert_no_tls(&(CfgTls){0}, false, "tls_ca");
    bad.certificate = nowhere;
    assert_no_tls(&bad, true, "nowhere.pem");
    bad = good;
    bad.ca = nowhere;
    assert_no_tls(&bad, true, "nowhere.pem");
    bad.ca = good.key;
    assert_no_tls(&bad, true, "machine.key");
    bad = good;
    bad.key = nowhere;
    assert_no_tls(&bad, true, "nowhere.pem");
    bad.key = other.key;
    assert_no_tls(&bad, true, "not the certificate's");
    bad.key = good.certificate;
    g_assert_cmpint(g_chmod(good.certificate, 0600), ==, 0);
    assert_no_tls(&bad, true, "no private key");
    static const mode_t modes[] = {0640, 0604, 0620, 0601};
    for (size_t i = 0; i < G_N_ELEMENTS(modes); i++) {
        g_assert_cmpint(g_chmod(good.key, modes[i]), ==, 0);
        assert_no_tls(&good, true, "chmod 600");
    }
    g_assert_cmpint(g_chmod(good.key, 0600), ==, 0);
    g_autoptr(FbTls) tls = fb_tls_new(&good, true, NULL);
    g_assert_nonnull(tls);
}

static void addresses(void)
{
    static const struct {
        const char *address;
        bool plain, ok;
        int code;
    } cases[] = {
        {"modbus://127.0.0.1:1", false, true, 0},
        {"modbus://localhost:1", false, true, 0},
        {"modbus://[::1]:1", false, true, 0},
        {"modbus://127.9.9.9:1", false, true, 0},
        {"modbus://192.0.2.1:1", true, true, 0},
        {"modbus://192.0.2.1:1", false, false, FB_ERROR_CREDENTIALS},
        {"modbus://mill.example", false, false, FB_ERROR_CREDENTIALS},
        {"modbus://localhost.example", false, false, FB_ERROR_CREDENTIALS},
        {"modbus://0.0.0.0:1", false, false, FB_ERROR_CREDENTIALS},
        {"mbaps://127.0.0.1:1", false, false, FB_ERROR_CREDENTIALS}, /* no certificate */
        {"mbap://127.0.0.1:1", false, false, FB_ERROR_UNREACHABLE},
    };
    static const CfgAgent agent = {.reply_timeout_s = 1, .reconnect_s = 1, .give_up_s = 1};
    for (size_t i = 0; i < G_N_ELEMENTS(cases); i++) {
        g_autoptr(GMainContext) context = g_main_context_new();
        g_autoptr(GError) error = NULL;
        const CfgTarget target = {.address = (char *)cases[i].address, .plain = cases[i].plain};
        g_autoptr(FbSession) session =
            fb_session_new(&target, &agent, &(FbSessionCallbacks){0}, context, &error);
        g_test_message("%s: %s", cases[i].address, error ? error->message : "");
        g_assert_cmpint(session != NULL, ==, cases[i].ok);
        if (!cases[i].ok)
            g_assert_error(error, FB_ERROR, cases[i].code);
    }
}

/* ------------------------------------------------------------------------ bad peers */

/* The first bytes of a client's handshake. */
static size_t hello(uint8_t *bytes, size_t most)
{
    int pair[2];
    g_assert_cmpint(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), ==, 0);
    SSL *ssl = stranger(NULL, false, pair[0]);
    SSL_do_handshake(ssl);
    const ssize_t n = recv(pair[1], bytes, most, MSG_DONTWAIT);
    SSL_free(ssl);
    close(pair[0]);
    close(pair[1]);
    g_assert_cmpint(n, >, 100);
    return (size_t)n;
}

/* Handshakes that come a byte at a time delay nobody's hold, and have 5 s. */
static void dripping_handshakes(void)
{
    Cell c;
    int fds[14], closed = 0;
    uint8_t bytes[2048];
    const size_t n = hello(bytes, sizeof bytes);
    open_tls_cell(&c);
    c.slow = true;
    c.session = tls_session(&c, "programmer", "127.0.0.1", 1);
    g_autoptr(GBytes) p = program(40000);
    deliver(&c, c.session, p);
    g_assert_no_error(c.error);
    fb_session_start(c.session);
    g_assert_true(run_until(&c, &c.starts, 1));
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++)
        fds[i] = raw_connect(&c);
    const int64_t opened_us = g_get_monotonic_time();
    int64_t worst_us = 0;
    for (int round = 0; round < 40; round++) {
        for (size_t i = 0; i < G_N_ELEMENTS(fds); i++)
            for (size_t at = 2 * (size_t)round; at < 2 * (size_t)round + 2 && at < n; at++)
                send(fds[i], bytes + at, 1, MSG_NOSIGNAL | MSG_DONTWAIT);
        const int64_t began_us = g_get_monotonic_time();
        fb_session_command(c.session, round % 2 ? FB_COMMAND_RESUME : FB_COMMAND_HOLD, NULL);
        g_assert_true(run_until(&c, &c.done[FB_TASK_COMMAND], round + 1));
        worst_us = MAX(worst_us, g_get_monotonic_time() - began_us);
        g_assert_no_error(c.error);
    }
    g_test_message("hold or resume, worst of 40 with dripping handshakes: %.3f ms",
                   (double)worst_us / 1000);
    g_assert_cmpint(worst_us, <, 500000);
    g_assert_cmpint(c.holds, ==, 20);
    while (closed < (int)G_N_ELEMENTS(fds) && g_get_monotonic_time() < opened_us + 8000000) {
        closed = 0;
        turn(&c, 1);
        for (size_t i = 0; i < G_N_ELEMENTS(fds); i++)
            closed += recv(fds[i], bytes, 1, MSG_DONTWAIT) == 0;
        g_usleep(1000);
    }
    const int64_t took_us = g_get_monotonic_time() - opened_us;
    g_assert_cmpint(closed, ==, G_N_ELEMENTS(fds));
    g_assert_cmpint(took_us, >, 4900000);
    g_assert_cmpuint(fb_modbus_server_refused(c.server), ==, G_N_ELEMENTS(fds));
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++)
        close(fds[i]);
    close_cell(&c);
}

/* Peers that go away at any byte of the handshake, and in the middle of an ADU. */
static void peers_that_go(void)
{
    Cell c;
    Peer p;
    uint8_t bytes[2048];
    const size_t n = hello(bytes, sizeof bytes);
    open_tls_cell(&c);
    for (size_t at = 0; at <= n; at += 7) {
        const int fd = raw_connect(&c);
        turn(&c, 2);
        send(fd, bytes, at, MSG_NOSIGNAL);
        turn(&c, 2);
        close(fd);
        turn(&c, 3);
    }
    g_assert_cmpuint(fb_modbus_server_refused(c.server), ==, n / 7 + 1);
    for (int i = 0; i < 20; i++) {
        static const uint8_t half[] = {0, 1, 0, 0, 0, 6, 1, 3, 0};
        peer_open(&c, &p, "programmer", "127.0.0.1");
        g_assert_true(run_until(&c, &p.ready, 1));
        fb_mbap_send(p.mbap, half, sizeof half);
        turn(&c, 2);
        fb_mbap_free(p.mbap);
        turn(&c, 3);
    }
    g_assert_cmpuint(fb_modbus_server_refused(c.server), ==, n / 7 + 1);
    c.session = tls_session(&c, "programmer", "127.0.0.1", 1);
    g_autoptr(GBytes) program_bytes = program(1000);
    deliver(&c, c.session, program_bytes);
    g_assert_no_error(c.error);
    close_cell(&c);
}

/* The machine goes away in the middle of a delivery and comes back: nothing is lost. */
static void machine_that_goes(void)
{
    Cell c;
    open_tls_cell(&c);
    c.session = tls_session(&c, "programmer", "127.0.0.1", 4);
    g_autoptr(GBytes) p = program(400000);
    const uint64_t end = g_bytes_get_size(p);
    const uint16_t port = fb_modbus_server_port(c.server);
    fb_session_deliver(c.session, p, &end, 1);
    for (uint64_t part = 1; part < 4; part++) {
        FbStatus s;
        const int64_t end_us = g_get_monotonic_time() + 5000000;
        do {
            turn(&c, 1);
            fb_receiver_status(c.receiver, 0, &s);
        } while (s.received < part * end / 4 && g_get_monotonic_time() < end_us);
        fb_modbus_server_free(c.server);
        turn(&c, 5);
        c.server = serve_tls(&c, port, "machine");
    }
    g_assert_true(run_until(&c, &c.done[FB_TASK_DELIVER], 1));
    g_assert_no_error(c.error);
    g_assert_true(g_bytes_equal(fb_receiver_program(c.receiver), p));
    close_cell(&c);
}

/* ------------------------------------------------------------------------- in numbers */

/* 16 that are known stay, whatever crowd of strangers comes; a 17th takes the place of the one
 * that was silent longest. */
static void sixteen_connections(void)
{
    static const uint8_t read[] = {0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1};
    Cell c;
    Peer peers[17];
    int fds[60];
    open_tls_cell(&c);
    for (int i = 0; i < 16; i++) {
        peer_open(&c, &peers[i], "observer", "127.0.0.1");
        g_assert_true(run_until(&c, &peers[i].ready, 1));
        turn(&c, 5);
    }
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++) {
        fds[i] = raw_connect(&c);
        turn(&c, 3);
    }
    g_assert_cmpuint(fb_modbus_server_refused(c.server), ==, G_N_ELEMENTS(fds) - 16);
    for (int i = 0; i < 16 && peers[i].mbap; i++) {
        fb_mbap_send(peers[i].mbap, read, sizeof read);
        g_assert_true(run_until(&c, &peers[i].answers, 1));
    }
    peer_open(&c, &peers[16], "observer", "127.0.0.1");
    g_assert_true(run_until(&c, &peers[16].ready, 1));
    turn(&c, 20);
    for (int i = 0; i < 17; i++) {
        g_assert_cmpint(peers[i].mbap != NULL, ==, i != 0);
        fb_mbap_free(peers[i].mbap);
    }
    for (size_t i = 0; i < G_N_ELEMENTS(fds); i++)
        close(fds[i]);
    close_cell(&c);
}

/* One record of TLS that holds more requests than are read at once. */
static void many_in_one_record(void)
{
    enum { REQUESTS = 1000, REQUEST_BYTES = 12 };
    Cell c;
    Peer p;
    uint8_t record[REQUESTS * REQUEST_BYTES];
    open_tls_cell(&c);
    peer_open(&c, &p, "observer", "127.0.0.1");
    g_assert_true(run_until(&c, &p.ready, 1));
    for (int i = 0; i < REQUESTS; i++)
        memcpy(record + i * REQUEST_BYTES,
               (const uint8_t[]){(uint8_t)(i >> 8), (uint8_t)i, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1},
               REQUEST_BYTES);
    fb_mbap_send(p.mbap, record, sizeof record);
    g_assert_true(run_until(&c, &p.answers, REQUESTS));
    g_assert_cmpint(p.answer[0] << 8 | p.answer[1], ==, REQUESTS - 1);
    fb_mbap_free(p.mbap);
    close_cell(&c);
}

/* Two servers, one receiver: what is commanded on the one is timed by the other as well, once. */
static void servers_compose(void)
{
    const FbReceiverOptions options = {.epoch = 77,
                                       .memory_bytes = 1 << 20,
                                       .on_agent_loss = CFG_AGENT_LOSS_HOLD,
                                       .agent_timeout_us = 300000,
                                       .lease_timeout_us = 600000};
    Cell c;
    FbStatus s;
    open_tls_cell(&c);
    fb_modbus_server_free(c.server);
    fb_receiver_free(c.receiver);
    c.receiver = fb_receiver_new(&options);
    machine(&c, FB_MACHINE_ACKNOWLEDGED);
    c.slow = true;
    serve(&c, 0);
    FbModbusServer *plain = c.server;
    c.server = serve_tls(&c, 0, "machine");
    c.session = tls_session(&c, "programmer", "127.0.0.1", 1);
    g_autoptr(GBytes) p = program(1000);
    deliver(&c, c.session, p);
    g_assert_no_error(c.error);
    fb_session_start(c.session);
    g_assert_true(run_until(&c, &c.starts, 1));
    fb_session_free(g_steal_pointer(&c.session)); /* it runs: no RELEASE */
    fb_modbus_server_free(c.server);
    c.server = plain;
    g_assert_true(run_until(&c, &c.holds, 1));
    const int64_t end_us = g_get_monotonic_time() + 2000000;
    do {
        g_main_context_iteration(c.context, TRUE);
        fb_receiver_status(c.receiver, g_get_monotonic_time(), &s);
    } while (s.lease_owner != 0 && g_get_monotonic_time() < end_us);
    g_assert_cmpuint(s.lease_owner, ==, 0);
    g_assert_cmpint(c.holds, ==, 1);
    close_cell(&c);
}

static void add(void)
{
    make_certificates();
    g_test_add_func("/fieldbus/tls/delivers-and-runs", delivers_and_runs);
    g_test_add_func("/fieldbus/tls/strangers-stay-out", strangers_stay_out);
    g_test_add_func("/fieldbus/tls/no-renegotiation", no_renegotiation);
    g_test_add_func("/fieldbus/tls/says-close-notify", says_close_notify);
    g_test_add_func("/fieldbus/tls/plain-client", plain_client);
    g_test_add_func("/fieldbus/tls/false-machines", false_machines);
    g_test_add_func("/fieldbus/tls/session-says-why", session_says_why);
    g_test_add_func("/fieldbus/tls/files-of-no-use", files_of_no_use);
    g_test_add_func("/fieldbus/tls/addresses", addresses);
    g_test_add_func("/fieldbus/tls/dripping-handshakes", dripping_handshakes);
    g_test_add_func("/fieldbus/tls/peers-that-go", peers_that_go);
    g_test_add_func("/fieldbus/tls/machine-that-goes", machine_that_goes);
    g_test_add_func("/fieldbus/tls/sixteen-connections", sixteen_connections);
    g_test_add_func("/fieldbus/tls/many-in-one-record", many_in_one_record);
    g_test_add_func("/fieldbus/tls/servers-compose", servers_compose);
}

int main(int argc, char **argv)
{
    folder = test_folder();
    const int status = test_main(argc, argv, add);
    test_folder_remove(folder);
    return status;
}
