/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/can/seal.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fieldbus/bytes.h"

enum {
    DIGEST_BYTES = 32, /* of SHA-256 */
    FRAME_MAC_AT = 4,  /* of STOP and of the beat: the last four bytes */
    FRAME_MAC_BYTES = 4,
    STOP_BYTE = 6, /* before what STOP's mac is over: no message begins with it */
    FILE_MOST_BYTES = 4096,
};

/* ----------------------------------------------------------------------------- macs */

typedef struct {
    const void *bytes;
    size_t n;
} Part;

static void hmac(uint8_t digest[DIGEST_BYTES], const FbCanKey *key, const Part *parts,
                 size_t n_parts)
{
    gsize n = DIGEST_BYTES;
    GHmac *mac = g_hmac_new(G_CHECKSUM_SHA256, key->bytes, key->n);
    for (size_t i = 0; i < n_parts; i++)
        g_hmac_update(mac, parts[i].bytes, (gssize)parts[i].n);
    g_hmac_get_digest(mac, digest, &n);
    g_hmac_unref(mac);
}

/* In the same time whatever the bytes are, so that a mac cannot be guessed byte by byte. */
static bool same(const uint8_t *a, const uint8_t *b, size_t n)
{
    uint8_t difference = 0;
    for (size_t i = 0; i < n; i++)
        difference |= a[i] ^ b[i];
    return difference == 0;
}

static void derive(FbCanKey *key, const FbCanKey *from, const Part *parts, size_t n_parts)
{
    key->n = DIGEST_BYTES;
    hmac(key->bytes, from, parts, n_parts);
}

void fb_can_derive(FbCanKeys *keys, const FbCanKey *shared, uint16_t id, const uint8_t *nonce_agent,
                   const uint8_t *nonce_machine)
{
    uint8_t id_bytes[2];
    fb_put16(id_bytes, id);
    Part parts[] = {{"agent", 5},
                    {id_bytes, sizeof id_bytes},
                    {nonce_agent, FB_CAN_NONCE_BYTES},
                    {nonce_machine, FB_CAN_NONCE_BYTES}};
    derive(&keys->agent, shared, parts, G_N_ELEMENTS(parts));
    parts[0] = (Part){"machine", 7};
    derive(&keys->machine, shared, parts, G_N_ELEMENTS(parts));
}

/* -------------------------------------------------------------------------- opening */

static void hello_mac(uint8_t digest[DIGEST_BYTES], const uint8_t *hello, const FbCanKey *shared,
                      uint16_t id)
{
    uint8_t id_bytes[2];
    fb_put16(id_bytes, id);
    const Part parts[] = {{hello, FB_CAN_HELLO_BYTES - FB_CAN_MAC_BYTES},
                          {id_bytes, sizeof id_bytes}};
    hmac(digest, shared, parts, G_N_ELEMENTS(parts));
}

size_t fb_can_put_hello(uint8_t *out, const FbCanHello *hello, const FbCanKey *shared, uint16_t id)
{
    uint8_t digest[DIGEST_BYTES];
    out[0] = FB_CAN_HELLO;
    uint8_t *p =
        fb_put32(fb_put16(fb_put16(out + 1, hello->version), hello->flags), hello->session);
    memcpy(p, hello->nonce, FB_CAN_NONCE_BYTES);
    hello_mac(digest, out, shared, id);
    memcpy(p + FB_CAN_NONCE_BYTES, digest, FB_CAN_MAC_BYTES);
    return FB_CAN_HELLO_BYTES;
}

bool fb_can_get_hello(const uint8_t *in, size_t n, const FbCanKey *shared, uint16_t id,
                      FbCanHello *hello)
{
    uint8_t digest[DIGEST_BYTES];
    if (n != FB_CAN_HELLO_BYTES || in[0] != FB_CAN_HELLO)
        return false;
    hello->version = fb_get16(in + 1);
    hello->flags = fb_get16(in + 3);
    hello->session = fb_get32(in + 5);
    memcpy(hello->nonce, in + 9, FB_CAN_NONCE_BYTES);
    hello_mac(digest, in, shared, id);
    return same(in + 25, digest, FB_CAN_MAC_BYTES);
}

static void welcome_mac(uint8_t digest[DIGEST_BYTES], const uint8_t *welcome,
                        const FbCanKey *shared, uint16_t id, const uint8_t *nonce_agent)
{
    uint8_t id_bytes[2];
    fb_put16(id_bytes, id);
    const Part parts[] = {{welcome, FB_CAN_WELCOME_BYTES - FB_CAN_MAC_BYTES},
                          {nonce_agent, FB_CAN_NONCE_BYTES},
                          {id_bytes, sizeof id_bytes}};
    hmac(digest, shared, parts, G_N_ELEMENTS(parts));
}

size_t fb_can_put_welcome(uint8_t *out, const FbCanWelcome *welcome, const FbCanKey *shared,
                          uint16_t id, const uint8_t *nonce_agent)
{
    uint8_t digest[DIGEST_BYTES];
    out[0] = FB_CAN_WELCOME;
    uint8_t *p = fb_put16(fb_put16(out + 1, welcome->version), welcome->flags);
    p = fb_put32(fb_put32(p, welcome->epoch), welcome->beat_count);
    memcpy(p, welcome->nonce, FB_CAN_NONCE_BYTES);
    welcome_mac(digest, out, shared, id, nonce_agent);
    memcpy(p + FB_CAN_NONCE_BYTES, digest, FB_CAN_MAC_BYTES);
    return FB_CAN_WELCOME_BYTES;
}

bool fb_can_get_welcome(const uint8_t *in, size_t n, const FbCanKey *shared, uint16_t id,
                        const uint8_t *nonce_agent, FbCanWelcome *welcome)
{
    uint8_t digest[DIGEST_BYTES];
    if (n != FB_CAN_WELCOME_BYTES || in[0] != FB_CAN_WELCOME)
        return false;
    welcome->version = fb_get16(in + 1);
    welcome->flags = fb_get16(in + 3);
    welcome->epoch = fb_get32(in + 5);
    welcome->beat_count = fb_get32(in + 9);
    memcpy(welcome->nonce, in + 13, FB_CAN_NONCE_BYTES);
    welcome_mac(digest, in, shared, id, nonce_agent);
    return same(in + 29, digest, FB_CAN_MAC_BYTES);
}

/* ------------------------------------------------------------------- messages, frames */

size_t fb_can_seal(uint8_t *message, size_t n, uint32_t counter, const FbCanKey *key)
{
    uint8_t digest[DIGEST_BYTES];
    uint8_t *end = fb_put32(message + n, counter);
    hmac(digest, key, &(Part){message, n + 4}, 1);
    memcpy(end, digest, FB_CAN_MAC_BYTES);
    return n + FB_CAN_SEAL_BYTES;
}

bool fb_can_unseal(const uint8_t *message, size_t n, const FbCanKey *key, uint32_t *counter)
{
    uint8_t digest[DIGEST_BYTES];
    if (n < 1 + FB_CAN_SEAL_BYTES)
        return false;
    hmac(digest, key, &(Part){message, n - FB_CAN_MAC_BYTES}, 1);
    *counter = fb_get32(message + n - FB_CAN_SEAL_BYTES);
    return same(message + n - FB_CAN_MAC_BYTES, digest, FB_CAN_MAC_BYTES);
}

static void stop_mac(uint8_t digest[DIGEST_BYTES], uint8_t command, uint32_t seq,
                     const FbCanKey *agent)
{
    uint8_t bytes[6] = {STOP_BYTE, command};
    fb_put32(bytes + 2, seq);
    hmac(digest, agent, &(Part){bytes, sizeof bytes}, 1);
}

void fb_can_put_stop(uint8_t *out, FbCommand command, uint32_t seq, const FbCanKey *agent)
{
    uint8_t digest[DIGEST_BYTES];
    fb_put32(out, seq);
    out[0] = (uint8_t)command;
    stop_mac(digest, out[0], seq, agent);
    memcpy(out + FRAME_MAC_AT, digest, FRAME_MAC_BYTES);
}

bool fb_can_get_stop(const uint8_t *in, const FbCanKey *agent, FbCommand *command, uint32_t *seq)
{
    uint8_t digest[DIGEST_BYTES];
    *command = (FbCommand)in[0];
    *seq = fb_get32(in) & FB_CAN_SEQ_MOST;
    stop_mac(digest, in[0], *seq, agent);
    return same(in + FRAME_MAC_AT, digest, FRAME_MAC_BYTES);
}

void fb_can_beat_key(FbCanKey *key, const FbCanKey *shared, uint32_t epoch)
{
    uint8_t epoch_bytes[4];
    fb_put32(epoch_bytes, epoch);
    const Part parts[] = {{"beat", 4}, {epoch_bytes, sizeof epoch_bytes}};
    derive(key, shared, parts, G_N_ELEMENTS(parts));
}

static void beat_mac(uint8_t digest[DIGEST_BYTES], const uint8_t *beat, uint32_t count,
                     const FbCanKey *key)
{
    uint8_t bytes[6] = {beat[0], beat[1]};
    fb_put32(bytes + 2, count);
    hmac(digest, key, &(Part){bytes, sizeof bytes}, 1);
}

void fb_can_put_beat(uint8_t *out, const FbCanMachineBeat *beat, const FbCanKey *key)
{
    uint8_t digest[DIGEST_BYTES];
    out[0] = (uint8_t)beat->state;
    out[1] = beat->flags;
    fb_put16(out + 2, beat->count);
    beat_mac(digest, out, beat->count, key);
    memcpy(out + FRAME_MAC_AT, digest, FRAME_MAC_BYTES);
}

bool fb_can_get_beat(const uint8_t *in, const FbCanKey *key, uint32_t next, FbCanMachineBeat *beat)
{
    uint8_t digest[DIGEST_BYTES];
    const uint16_t ahead = (uint16_t)(fb_get16(in + 2) - next);
    *beat = (FbCanMachineBeat){(FbState)in[0], in[1], next + ahead};
    beat_mac(digest, in, beat->count, key);
    return same(in + FRAME_MAC_AT, digest, FRAME_MAC_BYTES);
}

/* ------------------------------------------------------------------------------ key */

/* What the file holds, NUL-terminated; looked at after it was opened, so that it stays the one that
 * was looked at. A pipe that nobody writes to is not waited for. */
static bool read_secret(const char *path, char text[FILE_MOST_BYTES], char **why)
{
    struct stat about;
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    ssize_t n = -1;
    if (fd >= 0 && fstat(fd, &about) == 0) {
        if (!S_ISREG(about.st_mode))
            *why = g_strdup("it is no file");
        else if ((about.st_mode & (S_IRWXG | S_IRWXO)) == 0)
            n = read(fd, text, FILE_MOST_BYTES - 1);
        else
            *why = g_strdup("others than its owner may open it: chmod 600");
    }
    if (n < 0 && !*why)
        *why = g_strdup(g_strerror(errno));
    if (fd >= 0)
        close(fd);
    text[MAX(n, 0)] = '\0';
    return n >= 0;
}

static bool read_hex(FbCanKey *key, const char *text)
{
    for (key->n = 0; g_ascii_isxdigit(text[0]) && g_ascii_isxdigit(text[1]); text += 2) {
        if (key->n == FB_CAN_KEY_MOST_BYTES)
            return false;
        const int high = g_ascii_xdigit_value(text[0]), low = g_ascii_xdigit_value(text[1]);
        key->bytes[key->n++] = (uint8_t)(high << 4 | low);
    }
    return *text == '\0' && key->n >= FB_CAN_KEY_LEAST_BYTES;
}

bool fb_can_key_load(FbCanKey *key, const char *path, GError **error)
{
    char text[FILE_MOST_BYTES];
    g_autofree char *why = NULL;
    if (read_secret(path, text, &why) && !read_hex(key, g_strstrip(text)))
        why = g_strdup_printf("it must hold %d to %d hexadecimal digits and nothing else: openssl "
                              "rand -hex 32",
                              2 * FB_CAN_KEY_LEAST_BYTES, 2 * FB_CAN_KEY_MOST_BYTES);
    explicit_bzero(text, sizeof text);
    if (why)
        g_set_error(error, FB_ERROR, FB_ERROR_CREDENTIALS, "the CAN key in %s: %s", path, why);
    return !why;
}
