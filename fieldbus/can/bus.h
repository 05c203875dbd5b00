/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A CAN bus as file descriptors that keep message boundaries and never block: one for plain frames,
 * one a channel and kind of frame for ISO-TP messages. bus.c is the only file that knows SocketCAN;
 * whoever has other descriptors that behave so (the tests) puts them in an FbCanBus of his own.
 */
#ifndef FIELDBUS_CAN_BUS_H
#define FIELDBUS_CAN_BUS_H

#include <glib.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    bool (*has_fd)(void *data);

    /* Descriptors, the caller's; -1 with an error. Plain frames (as struct can_frame) with the
     * identifiers first to first + n - 1, and error frames. */
    int (*open_frames)(void *data, uint16_t first, unsigned n, GError **error);

    /* Messages, each a whole one; `fd`: in FD frames only, else in classic ones only. */
    int (*open_messages)(void *data, uint16_t sends, uint16_t takes, bool fd, GError **error);

    void (*free)(void *data);
    void *data;
} FbCanBus;

/* A network interface; looked for at each opening. Errors of the openings: FB_ERROR_UNREACHABLE. */
FbCanBus fb_can_bus_new(const char *interface);
void fb_can_bus_clear(FbCanBus *bus);

typedef enum {
    FB_CAN_READ_NONE,  /* nothing is there */
    FB_CAN_READ_DONE,  /* something came */
    FB_CAN_READ_TORN,  /* a message did not come, or did not go, to its end */
    FB_CAN_READ_BROKEN /* the bus is down or gone: open anew */
} FbCanRead;

/* At most `*n` bytes; then `*n` are those that came. errno says why it is torn or broken. */
FbCanRead fb_can_read_message(int file, uint8_t *bytes, size_t *n);

typedef struct {
    uint16_t id;
    uint16_t errors; /* not 0: an error frame, a bit for each class (fb_can_error_name) */
    uint8_t n;
    uint8_t bytes[8];
} FbCanFrame;

enum { FB_CAN_ERROR_BUS_OFF = 6 }; /* the class that ends everything */

FbCanRead fb_can_read_frame(int file, FbCanFrame *frame);

/* False, with errno, where the bus does not take it. */
bool fb_can_write_message(int file, const uint8_t *bytes, size_t n);
bool fb_can_write_frame(int file, uint16_t id, const uint8_t *bytes, size_t n);

/* Whether closing would not wait: nothing is on its way out. */
bool fb_can_is_idle(int file);

#endif
