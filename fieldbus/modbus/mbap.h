/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One Modbus TCP connection, plain or in TLS, framed: whole ADUs with a possible MBAP header go up,
 * and nothing else. A GSource over a non-blocking socket; everything is bounded, so a peer that
 * sends a byte at a time, or never reads, costs the others nothing. Both sides use it.
 */
#ifndef FIELDBUS_MODBUS_MBAP_H
#define FIELDBUS_MODBUS_MBAP_H

#include "fieldbus/modbus/tls.h"

enum { FB_MBAP_HEADER_BYTES = 7, FB_ADU_BYTES = 260 };

typedef struct FbMbap FbMbap;

/* `ready` is called first, once: the peer is known as far as it will be. It and `adu` may free the
 * connection, `broken` (called once, nothing follows) must; `why` lasts. Never from fb_mbap_new or
 * fb_mbap_send. */
typedef struct {
    void (*ready)(FbMbap *mbap, void *data);
    void (*adu)(FbMbap *mbap, const uint8_t *adu, size_t n, void *data);
    void (*broken)(FbMbap *mbap, const char *why, void *data);
} FbMbapCallbacks;

/* Takes `fd`, a connected socket. `tls` NULL: plain; else a server's, or a client's, which wants
 * the peer's certificate to name `host`. */
FbMbap *fb_mbap_new(int fd, FbTls *tls, const char *host, const FbMbapCallbacks *callbacks,
                    void *data, GMainContext *context);
void fb_mbap_free(FbMbap *mbap); /* closes */
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbMbap, fb_mbap_free)

/* Once it is ready: queues bytes and writes what the socket takes now. A failure is told by
 * `broken`, later. */
void fb_mbap_send(FbMbap *mbap, const uint8_t *adu, size_t n);

/* What the peer may: NONE before it is ready; then by its certificate, or, on plain Modbus, a
 * programmer's. */
FbRole fb_mbap_role(const FbMbap *mbap);

int64_t fb_mbap_heard_us(const FbMbap *mbap); /* when the last whole ADU came, or it was opened */

#endif
