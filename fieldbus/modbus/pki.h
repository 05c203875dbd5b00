/* SPDX-License-Identifier: Apache-2.0 */
/* A test CA and what it signs, in memory; fb_pki_write puts them into files. */
#ifndef FIELDBUS_MODBUS_PKI_H
#define FIELDBUS_MODBUS_PKI_H

#include "fieldbus/fieldbus.h"

typedef struct FbPki FbPki; /* the CA: its certificate and its key */

/* EC P-256, valid from an hour ago (clocks differ) for `days`. NULL only where the kernel has no
 * random numbers or OpenSSL no memory. */
FbPki *fb_pki_new(const char *name, int days, GError **error);
void fb_pki_free(FbPki *pki);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbPki, fb_pki_free)
char *fb_pki_certificate(const FbPki *pki); /* PEM; caller frees */
char *fb_pki_key(const FbPki *pki);

typedef struct {
    const char *name;         /* of the subject */
    const char *const *hosts; /* a machine's names and addresses, NULL-terminated; NULL: an agent */
    const char *role;         /* the word in the role extension; NULL: none */
    int days;                 /* from an hour ago; negative: expired */
} FbPkiSubject;

/* A key and its certificate, as PEM; the caller frees both. */
bool fb_pki_issue(const FbPki *pki, const FbPkiSubject *subject, char **certificate, char **key,
                  GError **error);

#endif
