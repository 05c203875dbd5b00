/* SPDX-License-Identifier: Apache-2.0 */
/*
 * TLS for Modbus/TCP Security: at least 1.2, both sides with a certificate, no renegotiation,
 * resumption or compression. docs/protocol.md, section 2.10.
 */
#ifndef FIELDBUS_MODBUS_TLS_H
#define FIELDBUS_MODBUS_TLS_H

#include <sys/types.h>

#include "fieldbus/fieldbus.h"

/* The extension that carries a role: Modbus/TCP Security Protocol, section 8.4. */
#define FB_TLS_ROLE_OID "1.3.6.1.4.1.50316.802.1"

/* Who we are and whom we trust; shared by the connections made of it. */
typedef struct FbTls FbTls;

/* From the three files; FB_ERROR_CREDENTIALS names the one that is of no use and says what to do.
 * A server believes in certificates of clients, a client in those of servers. */
FbTls *fb_tls_new(const CfgTls *files, bool server, GError **error);
FbTls *fb_tls_ref(FbTls *tls);
void fb_tls_unref(FbTls *tls); /* NULL is nothing */
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbTls, fb_tls_unref)

/* One connection over a non-blocking socket, which stays the caller's. `host`, a name or an
 * address, is what a client wants the peer's certificate to name. */
typedef struct FbTlsStream FbTlsStream;
FbTlsStream *fb_tls_stream_new(FbTls *tls, int fd, const char *host);
void fb_tls_stream_free(FbTlsStream *stream); /* says close_notify where it can */

/* Like recv and send: > 0 bytes (the handshake: 1, it is done), 0 would block, -1 ended. Of what
 * was not written at least as much must come again. */
ssize_t fb_tls_handshake(FbTlsStream *stream);
ssize_t fb_tls_read(FbTlsStream *stream, uint8_t *bytes, size_t n);
ssize_t fb_tls_write(FbTlsStream *stream, const uint8_t *bytes, size_t n);

/* Why it ended, and what to do: a text that lasts. */
const char *fb_tls_why(const FbTlsStream *stream);

/* What the socket has to be ready for before it is worth calling again; `sending`: there are bytes
 * to write. */
GIOCondition fb_tls_wanted(const FbTlsStream *stream, bool sending);

/* Bytes are here already that no poll will tell of. */
bool fb_tls_pending(const FbTlsStream *stream);

/* By the peer's certificate, once the handshake is done; an observer's where it names no role. */
FbRole fb_tls_role(const FbTlsStream *stream);

#endif
