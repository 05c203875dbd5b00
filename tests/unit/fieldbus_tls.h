/* SPDX-License-Identifier: Apache-2.0 */
/* Certificates of every kind in files, machines in TLS, and peers that speak it to them. */
#ifndef TESTS_UNIT_FIELDBUS_TLS_H
#define TESTS_UNIT_FIELDBUS_TLS_H

#include <glib-unix.h>
#include <openssl/err.h>
#include <openssl/ssl.h>

#include "fieldbus/modbus/mbap.h"
#include "fieldbus/modbus/pki.h"
#include "tests/unit/fieldbus_cell.h"

static char *folder; /* of the certificates, for the whole program */

/* ---------------------------------------------------------------------- certificates */

static inline char *in_folder(const char *name, const char *suffix)
{
    g_autofree char *file = g_strconcat(name, suffix, NULL);
    return g_build_filename(folder, file, NULL);
}

static inline void keep(const char *name, const char *suffix, char *text, int mode)
{
    g_autoptr(GError) error = NULL;
    g_autofree char *path = in_folder(name, suffix);
    g_file_set_contents_full(path, text, -1, G_FILE_SET_CONTENTS_NONE, mode, &error);
    g_assert_no_error(error);
    g_free(text);
}

static inline void issue(const FbPki *pki, const FbPkiSubject *subject)
{
    char *certificate = NULL, *key = NULL;
    g_autoptr(GError) error = NULL;
    g_assert_true(fb_pki_issue(pki, subject, &certificate, &key, &error));
    g_assert_no_error(error);
    keep(subject->name, ".pem", certificate, 0644);
    keep(subject->name, ".key", key, 0600);
}

/* ca signs all but what `stranger-ca` signs: a programmer and a machine of another shop. */
static inline void make_certificates(void)
{
    static const char *const local[] = {"localhost", "127.0.0.1", "::1", NULL};
    static const char *const elsewhere[] = {"mill.example", "192.0.2.7", NULL};
    static const char *const number[] = {"192.0.2.7", NULL};
    g_autoptr(FbPki) ours = fb_pki_new("ca", 30, NULL);
    g_autoptr(FbPki) theirs = fb_pki_new("stranger-ca", 30, NULL);
    const FbPkiSubject subjects[] = {
        {"machine", local, NULL, 30},
        {"elsewhere", elsewhere, NULL, 30},
        {"expired-machine", local, NULL, -1},
        {"localhost", number, NULL, 30}, /* a common name that is a host's */
        {"observer", NULL, "observer", 30},
        {"operator", NULL, "operator", 30},
        {"programmer", NULL, "programmer", 30},
        {"no-role", NULL, NULL, 30},
        {"wrong-word", NULL, "Programmer", 30},
        {"long-word", NULL, "programmers", 30},
        {"empty-word", NULL, "", 30},
        {"expired", NULL, "programmer", -1},
    };
    keep("ca", ".pem", fb_pki_certificate(ours), 0644);
    keep("stranger-ca", ".pem", fb_pki_certificate(theirs), 0644);
    for (size_t i = 0; i < G_N_ELEMENTS(subjects); i++)
        issue(ours, &subjects[i]);
    issue(theirs, &(FbPkiSubject){"stranger", NULL, "programmer", 30});
    issue(theirs, &(FbPkiSubject){"stranger-machine", local, NULL, 30});
}

/* NAME.pem and NAME.key beside CA.pem; tls_clear frees. */
static inline CfgTls tls_files(const char *ca, const char *name)
{
    return (CfgTls){in_folder(ca, ".pem"), in_folder(name, ".pem"), in_folder(name, ".key")};
}

static inline void tls_clear(CfgTls *files)
{
    g_free(files->ca);
    g_free(files->certificate);
    g_free(files->key);
}
G_DEFINE_AUTO_CLEANUP_CLEAR_FUNC(CfgTls, tls_clear)

/* ------------------------------------------------------------------------- machines */

static inline FbModbusServer *serve_tls(Cell *c, uint16_t port, const char *name)
{
    g_auto(CfgTls) files = tls_files("ca", name);
    const FbModbusServerOptions options = {
        .host = "127.0.0.1", .port = port, .unit_id = 1, .tls = &files};
    FbModbusServer *server =
        fb_modbus_server_new(&options, c->receiver, act, c, c->context, &c->error);
    g_assert_no_error(c->error);
    return server;
}

/* A cell whose only server is in TLS. */
static inline void open_tls_cell(Cell *c)
{
    open_cell(c);
    fb_modbus_server_free(c->server);
    c->server = serve_tls(c, 0, "machine");
}

/* A session as NAME with the cell's server, which is in TLS. */
static inline FbSession *tls_session(Cell *c, const char *name, const char *host, int window)
{
    const CfgAgent agent = {.reply_timeout_s = 2,
                            .reconnect_s = 0.02,
                            .give_up_s = 1,
                            .heartbeat_s = 0.05,
                            .window = window};
    const FbSessionCallbacks callbacks = {on_status, on_done, c};
    g_auto(CfgTls) files = tls_files("ca", name);
    g_autofree char *address =
        g_strdup_printf("mbaps://%s:%u", host, fb_modbus_server_port(c->server));
    const CfgTarget target = {.address = address, .unit_id = 1, .tls = files};
    FbSession *session = fb_session_new(&target, &agent, &callbacks, c->context, &c->error);
    g_assert_no_error(c->error);
    return session;
}

/* ---------------------------------------------------------------------------- peers */

/* One connection of ours to the machine. */
typedef struct {
    FbMbap *mbap; /* NULL: it broke, */
    const char *why;
    int ready, answers;
    uint8_t answer[FB_ADU_BYTES]; /* the last one */
    size_t n;
} Peer;

static inline void peer_ready(FbMbap *mbap, void *data)
{
    (void)mbap;
    ((Peer *)data)->ready++;
}

static inline void peer_adu(FbMbap *mbap, const uint8_t *adu, size_t n, void *data)
{
    (void)mbap;
    Peer *p = data;
    memcpy(p->answer, adu, n);
    p->n = n;
    p->answers++;
}

static inline void peer_broken(FbMbap *mbap, const char *why, void *data)
{
    Peer *p = data;
    p->why = why;
    p->mbap = NULL;
    fb_mbap_free(mbap);
}

static inline void peer_open(Cell *c, Peer *p, const char *name, const char *host)
{
    static const FbMbapCallbacks callbacks = {peer_ready, peer_adu, peer_broken};
    g_auto(CfgTls) files = tls_files("ca", name);
    g_autoptr(GError) error = NULL;
    g_autoptr(FbTls) tls = fb_tls_new(&files, false, &error);
    g_assert_no_error(error);
    *p = (Peer){.mbap = fb_mbap_new(raw_connect(c), tls, host, &callbacks, p, c->context)};
}

/* A stranger's own OpenSSL, with our CA and NAME's certificate (NULL: none), before its handshake.
 */
static inline SSL *stranger(const char *name, bool server, int fd)
{
    SSL_CTX *context = SSL_CTX_new(server ? TLS_server_method() : TLS_client_method());
    if (name) {
        g_auto(CfgTls) files = tls_files("ca", name);
        g_assert_cmpint(SSL_CTX_use_certificate_chain_file(context, files.certificate), ==, 1);
        g_assert_cmpint(SSL_CTX_use_PrivateKey_file(context, files.key, SSL_FILETYPE_PEM), ==, 1);
    }
    SSL *ssl = SSL_new(context);
    SSL_CTX_free(context);
    SSL_set_fd(ssl, fd);
    g_unix_set_fd_nonblocking(fd, TRUE, NULL);
    if (server)
        SSL_set_accept_state(ssl);
    else
        SSL_set_connect_state(ssl);
    return ssl;
}

/* Goes on, for 3 s at most, until the peer has answered with a byte (1) or ended it: OpenSSL's
 * reason, or 0 where it has none. -1: neither. */
static inline int stranger_goes_on(Cell *c, SSL *ssl)
{
    const int64_t end_us = g_get_monotonic_time() + 3000000;
    while (g_get_monotonic_time() < end_us) {
        char byte;
        turn(c, 1);
        ERR_clear_error();
        const int got = SSL_read(ssl, &byte, 1); /* does the handshake, too */
        const int error = SSL_get_error(ssl, got);
        if (got > 0)
            return 1;
        if (error != SSL_ERROR_WANT_READ && error != SSL_ERROR_WANT_WRITE)
            return ERR_GET_REASON(ERR_peek_last_error());
    }
    return -1;
}

#endif
