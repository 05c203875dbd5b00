/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/can/bus.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/isotp.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fieldbus/fieldbus.h"

enum { FRAMES_MOST = 16, FD_FRAME_BYTES = 64 };

G_STATIC_ASSERT(CAN_ERR_BUSOFF == 1 << FB_CAN_ERROR_BUS_OFF);

const char *fb_can_error_name(unsigned error_class)
{
    static const char *const names[FB_CAN_N_ERRORS] = {
        "transmit time-out",  "lost arbitration", "controller", "protocol", "transceiver",
        "no acknowledgement", "bus-off",          "bus error",  "restarted"};
    return error_class < FB_CAN_N_ERRORS ? names[error_class] : "?";
}

/* ------------------------------------------------------------------------- sockets */

static int fail(const char *interface, const char *what, int file, GError **error)
{
    g_set_error(error, FB_ERROR, FB_ERROR_UNREACHABLE, "%s on %s: %s", what, interface,
                g_strerror(errno));
    if (file >= 0)
        close(file);
    return -1;
}

/* A bound socket of an interface that is down has this error at once. */
static bool is_sound(int file)
{
    int pending = 0;
    socklen_t n = sizeof pending;
    if (getsockopt(file, SOL_SOCKET, SO_ERROR, &pending, &n) == 0 && pending != 0)
        errno = pending;
    return pending == 0;
}

static bool bind_to(int file, const char *interface, struct sockaddr_can address)
{
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(interface);
    return address.can_ifindex != 0 &&
           bind(file, (const struct sockaddr *)&address, sizeof address) == 0 && is_sound(file);
}

static bool has_fd(void *data)
{
    struct ifreq request = {0};
    const int file = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    g_strlcpy(request.ifr_name, data, sizeof request.ifr_name);
    const bool has =
        file >= 0 && ioctl(file, SIOCGIFMTU, &request) == 0 && request.ifr_mtu >= (int)CANFD_MTU;
    if (file >= 0)
        close(file);
    return has;
}

static int open_frames(void *data, uint16_t first, unsigned n, GError **error)
{
    const char *interface = data;
    struct can_filter filters[FRAMES_MOST];
    const can_err_mask_t errors = CAN_ERR_MASK;
    g_assert(n <= FRAMES_MOST);
    for (unsigned i = 0; i < n; i++)
        filters[i] = (struct can_filter){.can_id = first + i,
                                         .can_mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
    const int file = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (file < 0 ||
        setsockopt(file, SOL_CAN_RAW, CAN_RAW_FILTER, filters, (socklen_t)(n * sizeof *filters)) ||
        setsockopt(file, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) ||
        !bind_to(file, interface, (struct sockaddr_can){0}))
        return fail(interface, "no plain CAN frames", file, error);
    return file;
}

static int open_messages(void *data, uint16_t sends, uint16_t takes, bool fd, GError **error)
{
    const char *interface = data;
    /* No separation, whatever a flow control says: a damaged one could ask for 127 ms a frame, and
     * a message that is on its way out can neither be ended nor closed. */
    const struct can_isotp_options options = {.flags = CAN_ISOTP_FORCE_TXSTMIN,
                                              .frame_txtime = CAN_ISOTP_FRAME_TXTIME_ZERO};
    const struct can_isotp_ll_options frames = {
        .mtu = CANFD_MTU, .tx_dl = FD_FRAME_BYTES, .tx_flags = CANFD_BRS};
    struct sockaddr_can address = {0};
    address.can_addr.tp.tx_id = sends;
    address.can_addr.tp.rx_id = takes;
    const int file = socket(PF_CAN, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_ISOTP);
    if (file < 0 || setsockopt(file, SOL_CAN_ISOTP, CAN_ISOTP_OPTS, &options, sizeof options) ||
        (fd && setsockopt(file, SOL_CAN_ISOTP, CAN_ISOTP_LL_OPTS, &frames, sizeof frames)) ||
        !bind_to(file, interface, address))
        return fail(interface, "no ISO-TP messages", file, error);
    return file;
}

FbCanBus fb_can_bus_new(const char *interface)
{
    return (FbCanBus){has_fd, open_frames, open_messages, g_free, g_strdup(interface)};
}

void fb_can_bus_clear(FbCanBus *bus)
{
    if (bus->free)
        bus->free(bus->data);
    *bus = (FbCanBus){0};
}

/* ------------------------------------------------------------------- reading, writing */

/* What read() left behind: nothing there; a message that ISO-TP gave up; or the end of it all. */
static FbCanRead why_not(ssize_t n)
{
    if (n == 0)
        errno = EPIPE;
    switch (errno) {
    case EAGAIN:
    case EINTR:
        return FB_CAN_READ_NONE;
    case ECOMM:     /* no flow control in time, */
    case EBADMSG:   /* a wrong one, */
    case EMSGSIZE:  /* or: too long */
    case ETIMEDOUT: /* a consecutive frame did not come, */
    case EILSEQ:    /* or came out of order */
    case ENOBUFS:
        return FB_CAN_READ_TORN;
    default:
        return FB_CAN_READ_BROKEN;
    }
}

FbCanRead fb_can_read_message(int file, uint8_t *bytes, size_t *n)
{
    const ssize_t got = read(file, bytes, *n);
    if (got <= 0)
        return why_not(got);
    *n = (size_t)got;
    return FB_CAN_READ_DONE;
}

FbCanRead fb_can_read_frame(int file, FbCanFrame *frame)
{
    struct can_frame raw = {0};
    const ssize_t got = read(file, &raw, sizeof raw);
    if (got <= 0)
        return why_not(got);
    if (got != (ssize_t)sizeof raw)
        return FB_CAN_READ_TORN;
    *frame = (FbCanFrame){.n = MIN(raw.len, sizeof frame->bytes)};
    if (raw.can_id & CAN_ERR_FLAG)
        frame->errors = raw.can_id & ((1 << FB_CAN_N_ERRORS) - 1);
    else
        frame->id = raw.can_id & CAN_SFF_MASK;
    memcpy(frame->bytes, raw.data, frame->n);
    return FB_CAN_READ_DONE;
}

bool fb_can_write_message(int file, const uint8_t *bytes, size_t n)
{
    return send(file, bytes, n, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)n;
}

bool fb_can_write_frame(int file, uint16_t id, const uint8_t *bytes, size_t n)
{
    struct can_frame raw = {.can_id = id, .len = (uint8_t)n};
    memcpy(raw.data, bytes, n);
    return send(file, &raw, sizeof raw, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)sizeof raw;
}

bool fb_can_is_idle(int file)
{
    struct pollfd ask = {.fd = file, .events = POLLOUT};
    return poll(&ask, 1, 0) == 1 && ask.revents & (POLLOUT | POLLNVAL);
}
