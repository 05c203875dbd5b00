/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/modbus/tls.h"

#include <errno.h>
#include <fcntl.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

/* Forward secrecy and authenticated encryption only; 1.3 has nothing else. */
#define CIPHERS_OF_1_2 "ECDHE+AESGCM:ECDHE+CHACHA20"

struct FbTls {
    gatomicrefcount refs;
    SSL_CTX *context;
    BIO_METHOD *socket;
    bool server;
};

struct FbTlsStream {
    FbTls *tls;
    SSL *ssl;
    bool up, ended;
    bool read_wants_out, write_wants_in; /* TLS may read to write, and write to read */
    const char *why;
};

static bool load(FbTls *tls, const CfgTls *files, GError **error);
static bool refuse(GError **error, const char *file, const char *what);
static BIO_METHOD *socket_method(void);
static ssize_t judge(FbTlsStream *s, int result);
static const char *reason(const FbTlsStream *s, int ssl_error);
static FbRole role_of(const X509 *certificate);

/* ------------------------------------------------------------------------ contexts */

FbTls *fb_tls_new(const CfgTls *files, bool server, GError **error)
{
    g_autoptr(FbTls) tls = g_new0(FbTls, 1);
    g_atomic_ref_count_init(&tls->refs);
    tls->server = server;
    tls->socket = socket_method();
    tls->context = SSL_CTX_new(server ? TLS_server_method() : TLS_client_method());
    if (!tls->socket || !tls->context) {
        refuse(error, "OpenSSL", "cannot be used: is its configuration right?");
        return NULL;
    }
    SSL_CTX_set_security_level(tls->context, 2); /* 112 bits: no SHA-1, no RSA below 2048 */
    SSL_CTX_set_min_proto_version(tls->context, TLS1_2_VERSION);
    SSL_CTX_set_cipher_list(tls->context, CIPHERS_OF_1_2);
    SSL_CTX_set_options(tls->context, SSL_OP_NO_COMPRESSION | SSL_OP_NO_RENEGOTIATION |
                                          SSL_OP_NO_TICKET | SSL_OP_CIPHER_SERVER_PREFERENCE);
    SSL_CTX_set_num_tickets(tls->context, 0);
    SSL_CTX_set_session_cache_mode(tls->context, SSL_SESS_CACHE_OFF);
    /* What was not written lies in a buffer that grows, and so moves. */
    SSL_CTX_set_mode(tls->context,
                     SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
    SSL_CTX_set_verify(tls->context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, NULL);
    const bool ok = load(tls, files, error);
    ERR_clear_error();
    return ok ? g_steal_pointer(&tls) : NULL;
}

FbTls *fb_tls_ref(FbTls *tls)
{
    g_atomic_ref_count_inc(&tls->refs);
    return tls;
}

void fb_tls_unref(FbTls *tls)
{
    if (!tls || !g_atomic_ref_count_dec(&tls->refs))
        return;
    SSL_CTX_free(tls->context);
    BIO_meth_free(tls->socket);
    g_free(tls);
}

/* Sets "FILE: what happened: what to do", with OpenSSL's word where it has one. */
static bool refuse(GError **error, const char *file, const char *what)
{
    const char *openssl = ERR_reason_error_string(ERR_peek_last_error());
    g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS, "%s: %s%s%s%s", file, what,
                openssl ? " (" : "", openssl ? openssl : "", openssl ? ")" : "");
    return false;
}

/* Nobody is asked for a passphrase. */
static int no_passphrase(char *to, int n, int writing, void *data)
{
    (void)to, (void)n, (void)writing, (void)data;
    return -1;
}

static bool load_key(SSL_CTX *context, const char *file, GError **error)
{
    struct stat is;
    const int fd = open(file, O_RDONLY | O_CLOEXEC);
    if (fd < 0 || fstat(fd, &is) != 0) {
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS, "%s: %s", file, g_strerror(errno));
        if (fd >= 0)
            close(fd);
        return false;
    }
    if (is.st_mode & (S_IRWXG | S_IRWXO)) {
        close(fd);
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                    "%s: others than its owner may use this key (mode %03o): chmod 600 it, and "
                    "make a new one if they may have read it",
                    file, is.st_mode & 0777);
        return false;
    }
    BIO *bio = BIO_new_fd(fd, BIO_CLOSE);
    EVP_PKEY *key = PEM_read_bio_PrivateKey(bio, NULL, no_passphrase, NULL);
    BIO_free(bio);
    const bool ok = key && SSL_CTX_use_PrivateKey(context, key) == 1;
    const bool fits = ok && SSL_CTX_check_private_key(context) == 1;
    EVP_PKEY_free(key);
    if (!key)
        return refuse(error, file, "no private key in PEM, without a passphrase");
    return fits || refuse(error, file,
                          "this key is not the certificate's: give the two that belong "
                          "together");
}

static bool check_times(SSL_CTX *context, const char *file, GError **error)
{
    const X509 *own = SSL_CTX_get0_certificate(context);
    const bool early = X509_cmp_current_time(X509_get0_notBefore(own)) > 0;
    if (!early && X509_cmp_current_time(X509_get0_notAfter(own)) > 0)
        return true;
    char *date = NULL;
    BIO *bio = BIO_new(BIO_s_mem());
    ASN1_TIME_print(bio, early ? X509_get0_notBefore(own) : X509_get0_notAfter(own));
    const long n = BIO_get_mem_data(bio, &date);
    g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                "%s: this certificate %s %.*s: %s, or set the clock", file,
                early ? "is not valid before" : "expired", (int)n, date,
                early ? "wait" : "make a new one");
    BIO_free(bio);
    return false;
}

static bool load(FbTls *tls, const CfgTls *files, GError **error)
{
    SSL_CTX *context = tls->context;
    ERR_clear_error();
    if (!files->ca || !files->certificate || !files->key) {
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                    "TLS needs three files, and %s is not configured: %s",
                    !files->ca            ? "the CA"
                    : !files->certificate ? "the certificate"
                                          : "the key",
                    tls->server ? "[tls] ca, certificate and key of the machine's file"
                                : "tls_ca, tls_certificate and tls_key of the machine's group in "
                                  "the agent's configuration");
        return false;
    }
    if (SSL_CTX_load_verify_file(context, files->ca) != 1)
        return refuse(error, files->ca, "no CA certificate in PEM that can be read");
    if (tls->server)
        SSL_CTX_set_client_CA_list(context, SSL_load_client_CA_file(files->ca));
    if (SSL_CTX_use_certificate_chain_file(context, files->certificate) != 1)
        return refuse(error, files->certificate, "no certificate in PEM that can be read");
    return check_times(context, files->certificate, error) && load_key(context, files->key, error);
}

/* -------------------------------------------------------------------------- socket */

/* OpenSSL's own socket BIO writes without MSG_NOSIGNAL. */
static int socket_read(BIO *bio, char *bytes, int n)
{
    const ssize_t got = recv((int)(intptr_t)BIO_get_data(bio), bytes, (size_t)n, 0);
    BIO_clear_retry_flags(bio);
    if (got < 0 && (errno == EAGAIN || errno == EINTR))
        BIO_set_retry_read(bio);
    if (got == 0)
        BIO_set_flags(bio, BIO_FLAGS_IN_EOF);
    return (int)got;
}

static int socket_write(BIO *bio, const char *bytes, int n)
{
    const ssize_t put = send((int)(intptr_t)BIO_get_data(bio), bytes, (size_t)n, MSG_NOSIGNAL);
    BIO_clear_retry_flags(bio);
    if (put < 0 && (errno == EAGAIN || errno == EINTR))
        BIO_set_retry_write(bio);
    return (int)put;
}

static long socket_control(BIO *bio, int command, long number, void *data)
{
    (void)number, (void)data;
    if (command == BIO_CTRL_EOF)
        return BIO_test_flags(bio, BIO_FLAGS_IN_EOF) != 0;
    return command == BIO_CTRL_FLUSH;
}

static BIO_METHOD *socket_method(void)
{
    BIO_METHOD *method = BIO_meth_new(BIO_TYPE_SOURCE_SINK, "modbus socket");
    BIO_meth_set_read(method, socket_read);
    BIO_meth_set_write(method, socket_write);
    BIO_meth_set_ctrl(method, socket_control);
    return method;
}

/* -------------------------------------------------------------------------- streams */

/* Who the certificate must name; never in its common name. False where nobody can be named so. */
static bool expect_host(SSL *ssl, const char *host)
{
    X509_VERIFY_PARAM *verify = SSL_get0_param(ssl);
    X509_VERIFY_PARAM_set_hostflags(verify, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS |
                                                X509_CHECK_FLAG_NEVER_CHECK_SUBJECT);
    if (X509_VERIFY_PARAM_set1_ip_asc(verify, host) == 1)
        return true;
    return *host && X509_VERIFY_PARAM_set1_host(verify, host, 0) == 1 &&
           SSL_set_tlsext_host_name(ssl, host) == 1;
}

FbTlsStream *fb_tls_stream_new(FbTls *tls, int fd, const char *host)
{
    FbTlsStream *s = g_new0(FbTlsStream, 1);
    BIO *bio = BIO_new(tls->socket);
    s->tls = fb_tls_ref(tls);
    s->ssl = SSL_new(tls->context);
    g_assert(bio && s->ssl);
    BIO_set_data(bio, (void *)(intptr_t)fd);
    BIO_set_init(bio, 1);
    SSL_set_bio(s->ssl, bio, bio);
    if (tls->server) {
        SSL_set_accept_state(s->ssl);
    } else {
        SSL_set_connect_state(s->ssl);
        if (!expect_host(s->ssl, host))
            s->why = "a certificate cannot name this host: is the address right?";
    }
    return s;
}

void fb_tls_stream_free(FbTlsStream *s)
{
    if (!s)
        return;
    if (s->up && !s->ended)
        SSL_shutdown(s->ssl);
    SSL_free(s->ssl);
    ERR_clear_error();
    fb_tls_unref(s->tls);
    g_free(s);
}

ssize_t fb_tls_handshake(FbTlsStream *s)
{
    if (s->why)
        return -1;
    ERR_clear_error();
    const ssize_t done = judge(s, SSL_do_handshake(s->ssl));
    s->up = done > 0;
    return done;
}

ssize_t fb_tls_read(FbTlsStream *s, uint8_t *bytes, size_t n)
{
    ERR_clear_error();
    const ssize_t got = judge(s, SSL_read(s->ssl, bytes, (int)n));
    s->read_wants_out = got == 0 && SSL_want_write(s->ssl);
    return got;
}

/* Who has closed the connection may have said why before: it is still to be read. */
static void hear_why(FbTlsStream *s)
{
    uint8_t last[256];
    ssize_t got;
    do {
        ERR_clear_error();
        got = judge(s, SSL_read(s->ssl, last, sizeof last));
    } while (got > 0);
}

ssize_t fb_tls_write(FbTlsStream *s, const uint8_t *bytes, size_t n)
{
    ERR_clear_error();
    const ssize_t put = judge(s, SSL_write(s->ssl, bytes, (int)n));
    s->write_wants_in = put == 0 && SSL_want_read(s->ssl);
    if (put < 0)
        hear_why(s);
    return put;
}

GIOCondition fb_tls_wanted(const FbTlsStream *s, bool sending)
{
    if (!s->up)
        return SSL_want_write(s->ssl) ? G_IO_OUT : G_IO_IN;
    const bool out = s->read_wants_out || (sending && !s->write_wants_in);
    return (s->read_wants_out ? 0 : G_IO_IN) | (out ? G_IO_OUT : 0);
}

bool fb_tls_pending(const FbTlsStream *s)
{
    return SSL_pending(s->ssl) > 0;
}

const char *fb_tls_why(const FbTlsStream *s)
{
    return s->why;
}

FbRole fb_tls_role(const FbTlsStream *s)
{
    const X509 *certificate = SSL_get0_peer_certificate(s->ssl);
    return certificate ? role_of(certificate) : FB_ROLE_NONE;
}

/* What a result of OpenSSL's means, as from recv and send. */
static ssize_t judge(FbTlsStream *s, int result)
{
    if (result > 0)
        return result;
    const int ssl_error = SSL_get_error(s->ssl, result);
    if (ssl_error == SSL_ERROR_WANT_READ || ssl_error == SSL_ERROR_WANT_WRITE)
        return 0;
    s->why = reason(s, ssl_error);
    s->ended = ssl_error != SSL_ERROR_ZERO_RETURN; /* its close_notify is answered */
    return -1;
}

/* ------------------------------------------------------------------------- reasons */

/* The peer's certificate, as this side judges it. */
static const char *verify_reason(long result)
{
    switch (result) {
    case X509_V_ERR_CERT_HAS_EXPIRED:
        return "the peer's certificate has expired: renew it there, or set the clock here";
    case X509_V_ERR_CERT_NOT_YET_VALID:
        return "the peer's certificate is not valid yet: set the clocks";
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
        return "the peer's certificate names another host: connect by a name that it has, or make "
               "one with this name";
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT:
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_UNABLE_TO_VERIFY_LEAF_SIGNATURE:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:
        return "the peer's certificate is not signed by our CA: is this the right machine, and the "
               "right CA file?";
    case X509_V_ERR_INVALID_PURPOSE:
        return "the peer's certificate is for another purpose: a machine needs one of a TLS "
               "server, an agent one of a TLS client";
    default:
        return X509_verify_cert_error_string(result);
    }
}

/* What the peer says of ours, and what is no TLS. */
static const struct {
    int reason;
    const char *why;
} reasons[] = {
    {SSL_R_TLSV1_ALERT_UNKNOWN_CA, "the peer does not know the CA of our certificate: take one "
                                   "that its CA has signed"},
    {SSL_R_SSLV3_ALERT_CERTIFICATE_EXPIRED, "the peer says that our certificate has expired: renew "
                                            "it, or set the clocks"},
    {SSL_R_TLSV13_ALERT_CERTIFICATE_REQUIRED, "the peer wants a certificate of ours"},
    {SSL_R_PEER_DID_NOT_RETURN_A_CERTIFICATE, "the peer has no certificate"},
    {SSL_R_SSLV3_ALERT_BAD_CERTIFICATE, "the peer refuses our certificate"},
    {SSL_R_SSLV3_ALERT_UNSUPPORTED_CERTIFICATE, "our certificate is for another purpose"},
    {SSL_R_TLSV1_ALERT_PROTOCOL_VERSION, "the peer speaks no TLS 1.2 or later"},
    {SSL_R_UNSUPPORTED_PROTOCOL, "the peer speaks no TLS 1.2 or later"},
    {SSL_R_WRONG_VERSION_NUMBER, "the peer speaks no TLS: is this the right port?"},
    {SSL_R_HTTP_REQUEST, "the peer speaks no TLS: is this the right port?"},
};

static const char *reason(const FbTlsStream *s, int ssl_error)
{
    const int code = ERR_GET_REASON(ERR_peek_last_error());
    if (ssl_error != SSL_ERROR_SSL || code == SSL_R_UNEXPECTED_EOF_WHILE_READING)
        return s->up ? "the connection was closed"
                     : "the connection was closed before both sides were known: is this the right "
                       "port?";
    if (code == SSL_R_CERTIFICATE_VERIFY_FAILED)
        return verify_reason(SSL_get_verify_result(s->ssl));
    for (size_t i = 0; i < G_N_ELEMENTS(reasons); i++)
        if (reasons[i].reason == code)
            return reasons[i].why;
    const char *openssl = ERR_reason_error_string(ERR_peek_last_error());
    return openssl ? openssl : "TLS failed";
}

/* ---------------------------------------------------------------------------- role */

/* Exactly one extension that is exactly one UTF8String with a word that we know. */
static FbRole role_of(const X509 *certificate)
{
    FbRole role = FB_ROLE_OBSERVER;
    ASN1_OBJECT *oid = OBJ_txt2obj(FB_TLS_ROLE_OID, 1);
    const int at = X509_get_ext_by_OBJ(certificate, oid, -1);
    const bool one = at >= 0 && X509_get_ext_by_OBJ(certificate, oid, at) < 0;
    ASN1_OBJECT_free(oid);
    if (!one)
        return role;
    const ASN1_OCTET_STRING *value = X509_EXTENSION_get_data(X509_get_ext(certificate, at));
    const unsigned char *from = ASN1_STRING_get0_data(value),
                        *end = from + ASN1_STRING_length(value);
    ASN1_UTF8STRING *text = d2i_ASN1_UTF8STRING(NULL, &from, end - from);
    const size_t n = text ? (size_t)ASN1_STRING_length(text) : 0;
    for (FbRole r = FB_ROLE_OBSERVER; from == end && r <= FB_ROLE_PROGRAMMER; r++) {
        const char *word = fb_role_name(r);
        if (n == strlen(word) && memcmp(ASN1_STRING_get0_data(text), word, n) == 0)
            role = r;
    }
    ASN1_UTF8STRING_free(text);
    return role;
}
