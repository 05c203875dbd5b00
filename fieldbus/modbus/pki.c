/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/modbus/pki.h"

#include <errno.h>
#include <gio/gio.h>
#include <glib/gstdio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>
#include <string.h>

#include "fieldbus/modbus/tls.h"

enum { HOUR_S = 3600, DAY_S = 24 * HOUR_S, SERIAL_BYTES = 16 };

struct FbPki {
    X509 *certificate;
    EVP_PKEY *key;
};

typedef struct {
    char *name; /* of the file */
    char *text;
    bool secret;
} File;

static GPtrArray *make_files(const FbPkiOptions *options, GError **error);
static bool write_file(const char *folder, const File *file, GError **error);
static void remove_file(const char *folder, const File *file);

/* --------------------------------------------------------------------------- files */

static bool check_hosts(const char *const *hosts, GError **error)
{
    for (; *hosts; hosts++) {
        const bool name = **hosts != 0 && strspn(*hosts, G_CSET_a_2_z G_CSET_A_2_Z
                                                 "0123456789.-") == strlen(*hosts);
        if (!name && !g_hostname_is_ip_address(*hosts)) {
            g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                        "'%s' is neither a host's name nor an IP address", *hosts);
            return false;
        }
    }
    return true;
}

bool fb_pki_write(const FbPkiOptions *options, GError **error)
{
    if (!check_hosts(options->hosts, error))
        return false;
    g_autoptr(GPtrArray) files = make_files(options, error);
    if (!files)
        return false;
    for (guint i = 0; i < files->len; i++) {
        const File *file = files->pdata[i];
        g_autofree char *path = g_build_filename(options->folder, file->name, NULL);
        if (g_file_test(path, G_FILE_TEST_EXISTS)) {
            g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS,
                        "%s is there already: choose another folder, or remove what nobody uses "
                        "any more",
                        path);
            return false;
        }
    }
    if (g_mkdir_with_parents(options->folder, 0755) != 0) {
        g_set_error(error, G_FILE_ERROR, (int)g_file_error_from_errno(errno), "%s: %s",
                    options->folder, g_strerror(errno));
        return false;
    }
    guint n = 0;
    while (n < files->len && write_file(options->folder, files->pdata[n], error))
        n++;
    const bool all = n == files->len;
    while (!all && n > 0)
        remove_file(options->folder, files->pdata[--n]);
    return all;
}

static bool write_file(const char *folder, const File *file, GError **error)
{
    g_autofree char *path = g_build_filename(folder, file->name, NULL);
    return g_file_set_contents_full(path, file->text, (gssize)strlen(file->text),
                                    G_FILE_SET_CONTENTS_CONSISTENT, file->secret ? 0600 : 0644,
                                    error);
}

static void remove_file(const char *folder, const File *file)
{
    g_autofree char *path = g_build_filename(folder, file->name, NULL);
    g_unlink(path);
}

static void file_free(void *data)
{
    File *file = data;
    if (file->secret)
        OPENSSL_cleanse(file->text, strlen(file->text));
    g_free(file->name);
    g_free(file->text);
    g_free(file);
}

/* Takes the texts. */
static void add_pair(GPtrArray *files, const char *name, char *certificate, char *key)
{
    const File pair[] = {{g_strconcat(name, ".pem", NULL), certificate, false},
                         {g_strconcat(name, ".key", NULL), key, true}};
    g_ptr_array_add(files, g_memdup2(&pair[0], sizeof *pair));
    g_ptr_array_add(files, g_memdup2(&pair[1], sizeof *pair));
}

static GPtrArray *make_files(const FbPkiOptions *options, GError **error)
{
    const FbPkiSubject subjects[] = {
        {"machine", options->hosts, NULL, options->days},
        {"observer", NULL, fb_role_name(FB_ROLE_OBSERVER), options->days},
        {"operator", NULL, fb_role_name(FB_ROLE_OPERATOR), options->days},
        {"programmer", NULL, fb_role_name(FB_ROLE_PROGRAMMER), options->days},
    };
    g_autoptr(FbPki) pki = fb_pki_new("segmill TEST CA", options->days, error);
    if (!pki)
        return NULL;
    g_autoptr(GPtrArray) files = g_ptr_array_new_with_free_func(file_free);
    add_pair(files, "ca", fb_pki_certificate(pki), fb_pki_key(pki));
    for (size_t i = 0; i < G_N_ELEMENTS(subjects); i++) {
        char *certificate, *key;
        if (!fb_pki_issue(pki, &subjects[i], &certificate, &key, error))
            return NULL;
        add_pair(files, subjects[i].name, certificate, key);
    }
    return g_steal_pointer(&files);
}

/* -------------------------------------------------------------------- certificates */

static bool add_extension(X509 *certificate, int nid, const X509V3_CTX *context, const char *value)
{
    X509_EXTENSION *extension = X509V3_EXT_conf_nid(NULL, (X509V3_CTX *)context, nid, value);
    const bool ok = extension && X509_add_ext(certificate, extension, -1) == 1;
    X509_EXTENSION_free(extension);
    return ok;
}

/* "DNS:mill,IP:192.0.2.7" */
static char *alternative_names(const char *const *hosts)
{
    GString *text = g_string_new(NULL);
    for (; *hosts; hosts++)
        g_string_append_printf(text, "%s%s:%s", text->len ? "," : "",
                               g_hostname_is_ip_address(*hosts) ? "IP" : "DNS", *hosts);
    return g_string_free(text, FALSE);
}

/* The word as a UTF8String, which is what the extension holds. */
static bool add_role(X509 *certificate, const char *role)
{
    unsigned char *der = NULL;
    ASN1_OBJECT *oid = OBJ_txt2obj(FB_TLS_ROLE_OID, 1);
    ASN1_UTF8STRING *text = ASN1_UTF8STRING_new();
    ASN1_OCTET_STRING *value = ASN1_OCTET_STRING_new();
    ASN1_STRING_set(text, role, (int)strlen(role));
    const int n = i2d_ASN1_UTF8STRING(text, &der);
    ASN1_OCTET_STRING_set(value, der, n);
    X509_EXTENSION *extension = X509_EXTENSION_create_by_OBJ(NULL, oid, 0, value);
    const bool ok = n > 0 && extension && X509_add_ext(certificate, extension, -1) == 1;
    X509_EXTENSION_free(extension);
    ASN1_OCTET_STRING_free(value);
    ASN1_UTF8STRING_free(text);
    OPENSSL_free(der);
    ASN1_OBJECT_free(oid);
    return ok;
}

static bool extend(X509 *certificate, X509 *issuer, const FbPkiSubject *subject)
{
    X509V3_CTX context;
    X509V3_set_ctx(&context, issuer, certificate, NULL, NULL, 0);
    bool ok = add_extension(certificate, NID_subject_key_identifier, &context, "hash") &&
              add_extension(certificate, NID_authority_key_identifier, &context, "keyid:always");
    if (!subject)
        return ok &&
               add_extension(certificate, NID_basic_constraints, &context,
                             "critical,CA:TRUE,pathlen:0") &&
               add_extension(certificate, NID_key_usage, &context, "critical,keyCertSign,cRLSign");
    ok = ok && add_extension(certificate, NID_basic_constraints, &context, "critical,CA:FALSE") &&
         add_extension(certificate, NID_key_usage, &context, "critical,digitalSignature") &&
         add_extension(certificate, NID_ext_key_usage, &context,
                       subject->hosts ? "serverAuth" : "clientAuth");
    if (ok && subject->hosts) {
        g_autofree char *names = alternative_names(subject->hosts);
        ok = add_extension(certificate, NID_subject_alt_name, &context, names);
    }
    return ok && (!subject->role || add_role(certificate, subject->role));
}

static bool set_name(X509_NAME *of, const char *name)
{
    return X509_NAME_add_entry_by_txt(of, "CN", MBSTRING_UTF8, (const unsigned char *)name, -1, -1,
                                      0) == 1;
}

static bool set_serial(X509 *certificate)
{
    unsigned char bytes[SERIAL_BYTES];
    if (RAND_bytes(bytes, sizeof bytes) != 1)
        return false;
    bytes[0] = (bytes[0] & 0x7f) | 0x40; /* positive, and always of this length */
    BIGNUM *number = BN_bin2bn(bytes, sizeof bytes, NULL);
    const bool ok = number && BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate));
    BN_free(number);
    return ok;
}

/* Signed by `pki`, or, where that is NULL, a CA of its own; `subject` NULL: a CA. */
static X509 *sign(const FbPki *pki, EVP_PKEY *key, const char *name, int days,
                  const FbPkiSubject *subject)
{
    X509 *certificate = X509_new();
    X509 *issuer = pki ? pki->certificate : certificate;
    if (certificate && X509_set_version(certificate, X509_VERSION_3) == 1 &&
        set_serial(certificate) && set_name(X509_get_subject_name(certificate), name) &&
        X509_set_issuer_name(certificate, X509_get_subject_name(issuer)) == 1 &&
        X509_gmtime_adj(X509_getm_notBefore(certificate), MIN(0, 2L * days * DAY_S) - HOUR_S) &&
        X509_time_adj_ex(X509_getm_notAfter(certificate), days, -HOUR_S, NULL) &&
        X509_set_pubkey(certificate, key) == 1 && extend(certificate, issuer, subject) &&
        X509_sign(certificate, pki ? pki->key : key, EVP_sha256()) > 0)
        return certificate;
    X509_free(certificate);
    return NULL;
}

static bool failed(GError **error, const char *name)
{
    const char *openssl = ERR_reason_error_string(ERR_peek_last_error());
    g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS, "cannot make the certificate of %s: %s",
                name, openssl ? openssl : "OpenSSL does not say why");
    ERR_clear_error();
    return false;
}

FbPki *fb_pki_new(const char *name, int days, GError **error)
{
    g_autoptr(FbPki) pki = g_new0(FbPki, 1);
    ERR_clear_error();
    pki->key = EVP_EC_gen("P-256");
    pki->certificate = pki->key ? sign(NULL, pki->key, name, days, NULL) : NULL;
    return pki->certificate || failed(error, name) ? g_steal_pointer(&pki) : NULL;
}

void fb_pki_free(FbPki *pki)
{
    if (!pki)
        return;
    X509_free(pki->certificate);
    EVP_PKEY_free(pki->key);
    g_free(pki);
}

static char *take_text(BIO *bio)
{
    char *bytes = NULL;
    const long n = BIO_get_mem_data(bio, &bytes);
    char *text = g_strndup(bytes, (gsize)n);
    BIO_free(bio);
    return text;
}

static char *certificate_text(X509 *certificate)
{
    BIO *bio = BIO_new(BIO_s_mem());
    PEM_write_bio_X509(bio, certificate);
    return take_text(bio);
}

static char *key_text(EVP_PKEY *key)
{
    BIO *bio = BIO_new(BIO_s_secmem());
    PEM_write_bio_PrivateKey(bio, key, NULL, NULL, 0, NULL, NULL);
    return take_text(bio);
}

char *fb_pki_certificate(const FbPki *pki)
{
    return certificate_text(pki->certificate);
}

char *fb_pki_key(const FbPki *pki)
{
    return key_text(pki->key);
}

bool fb_pki_issue(const FbPki *pki, const FbPkiSubject *subject, char **certificate, char **key,
                  GError **error)
{
    ERR_clear_error();
    EVP_PKEY *own = EVP_EC_gen("P-256");
    X509 *signed_by_ca = own ? sign(pki, own, subject->name, subject->days, subject) : NULL;
    const bool ok = signed_by_ca || failed(error, subject->name);
    if (ok) {
        *certificate = certificate_text(signed_by_ca);
        *key = key_text(own);
    }
    X509_free(signed_by_ca);
    EVP_PKEY_free(own);
    return ok;
}
