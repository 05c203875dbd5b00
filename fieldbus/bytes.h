/* SPDX-License-Identifier: Apache-2.0 */
/* Big-endian numbers in bytes: what fb_put* write is the low bits of `v`, and they return where the
 * next goes; fb_take* step over what they read. */
#ifndef FIELDBUS_BYTES_H
#define FIELDBUS_BYTES_H

#include <stdint.h>

static inline uint8_t *fb_put16(uint8_t *p, uint64_t v)
{
    p[0] = (uint8_t)(v >> 8);
    p[1] = (uint8_t)v;
    return p + 2;
}

static inline uint8_t *fb_put32(uint8_t *p, uint64_t v)
{
    return fb_put16(fb_put16(p, v >> 16), v);
}

static inline uint8_t *fb_put64(uint8_t *p, uint64_t v)
{
    return fb_put32(fb_put32(p, v >> 32), v);
}

static inline uint16_t fb_get16(const uint8_t *p)
{
    return (uint16_t)(p[0] << 8 | p[1]);
}

static inline uint32_t fb_get32(const uint8_t *p)
{
    return (uint32_t)fb_get16(p) << 16 | fb_get16(p + 2);
}

static inline uint16_t fb_take16(const uint8_t **p)
{
    *p += 2;
    return fb_get16(*p - 2);
}

static inline uint32_t fb_take32(const uint8_t **p)
{
    *p += 4;
    return fb_get32(*p - 4);
}

static inline uint64_t fb_take64(const uint8_t **p)
{
    const uint64_t high = fb_take32(p);
    return high << 32 | fb_take32(p);
}

#endif
