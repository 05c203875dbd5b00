/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/kernel/can_bridge.h"

#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum {
    BATCH = 64,
    SEEN_MOST = 20000,
    DUE_MOST = 20000,
    BUFFER_BYTES = 16 << 20,
    LATE_US = 400000,     /* agents of these tests wait 0.3 s for an answer, */
    STALLED_US = 1500000, /* and the kernel's ISO-TP 1 s for the next frame */
    AWAY_US = 200000,     /* a bus, or the machine */
};

typedef struct {
    size_t n; /* CAN_MTU or CANFD_MTU */
    struct canfd_frame frame;
} Frame;

typedef struct {
    int64_t due_us;
    BridgeSide to;
    Frame frame;
} Due;

typedef struct {
    const char *interface;
    int file;
    bool mute;          /* nothing goes or comes there */
    int64_t stalled_us; /* nothing comes from there before */
    struct mmsghdr out[BATCH];
    struct iovec out_parts[BATCH];
    Frame out_frames[BATCH];
    unsigned n_out;
} Side;

struct Bridge {
    BridgeHands hands;
    Side sides[BRIDGE_N_SIDES];
    BridgeFault fault;
    unsigned at, bit;
    bool struck;
    int64_t end_us; /* of the fault; INT64_MAX: it is none that ends */
    BridgeSeen seen[SEEN_MOST];
    unsigned n_seen;
    Due due[DUE_MOST]; /* in the order in which they came */
    unsigned n_due;
};

static void take(Bridge *b, BridgeSide from, const Frame *frame);
static void strike(Bridge *b, BridgeSide from, const Frame *frame);
static void end_fault(Bridge *b);

const char *bridge_fault_name(BridgeFault fault)
{
    static const char *const names[BRIDGE_N_FAULTS] = {
        "no fault",
        "lost",
        "duplicated",
        "duplicated, the copy late",
        "late, overtaken",
        "late, with all behind it",
        "damaged",
        "the agent's interface down and up",
        "the machine's interface down and up",
        "the agent bus-off",
        "the machine bus-off",
        "the machine rebooted",
        "the agent killed",
    };
    return names[fault];
}

int64_t bridge_now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

/* --------------------------------------------------------------------------- passing */

static void flush(Side *side)
{
    for (unsigned i = 0; i < side->n_out; i++) {
        side->out_parts[i] = (struct iovec){&side->out_frames[i].frame, side->out_frames[i].n};
        side->out[i].msg_hdr = (struct msghdr){.msg_iov = &side->out_parts[i], .msg_iovlen = 1};
    }
    for (unsigned sent = 0; sent < side->n_out;) {
        const int n = sendmmsg(side->file, side->out + sent, side->n_out - sent, MSG_DONTWAIT);
        sent += n > 0 ? (unsigned)n : 1; /* an interface that is down takes nothing */
    }
    side->n_out = 0;
}

static void pass(Bridge *b, BridgeSide to, const Frame *frame)
{
    Side *side = &b->sides[to];
    if (side->mute)
        return;
    if (side->n_out == BATCH)
        flush(side);
    side->out_frames[side->n_out++] = *frame;
}

static void pass_later(Bridge *b, BridgeSide to, const Frame *frame, int64_t due_us)
{
    if (b->n_due == DUE_MOST)
        abort();
    b->due[b->n_due++] = (Due){due_us, to, *frame};
}

static void pass_due(Bridge *b, int64_t now_us)
{
    unsigned left = 0;
    for (unsigned i = 0; i < b->n_due; i++) {
        if (b->due[i].due_us <= now_us)
            pass(b, b->due[i].to, &b->due[i].frame);
        else
            b->due[left++] = b->due[i];
    }
    b->n_due = left;
}

static unsigned receive(Side *side, Frame *frames)
{
    struct iovec parts[BATCH];
    struct mmsghdr messages[BATCH] = {0};
    for (unsigned i = 0; i < BATCH; i++) {
        parts[i] = (struct iovec){&frames[i].frame, sizeof frames[i].frame};
        messages[i].msg_hdr.msg_iov = &parts[i];
        messages[i].msg_hdr.msg_iovlen = 1;
    }
    const int n = recvmmsg(side->file, messages, BATCH, MSG_DONTWAIT, NULL);
    for (int i = 0; i < n; i++)
        frames[i].n = messages[i].msg_len;
    return n > 0 ? (unsigned)n : 0;
}

static void take_all(Bridge *b, BridgeSide from)
{
    Frame frames[BATCH];
    const unsigned n = receive(&b->sides[from], frames);
    for (unsigned i = 0; i < n; i++)
        take(b, from, &frames[i]);
}

static void take(Bridge *b, BridgeSide from, const Frame *frame)
{
    const Side *side = &b->sides[from];
    const BridgeSide to = BRIDGE_N_SIDES - 1 - from;
    if (side->mute)
        return;
    const unsigned number = b->n_seen;
    if (b->n_seen < SEEN_MOST)
        b->seen[b->n_seen++] = (BridgeSeen){from, (uint16_t)(frame->frame.can_id & CAN_SFF_MASK),
                                            frame->frame.data[0]};
    if (!b->struck && b->fault != BRIDGE_NO_FAULT && number == b->at) {
        b->struck = true;
        strike(b, from, frame);
    } else if (side->stalled_us > 0 && bridge_now_us() < side->stalled_us) {
        pass_later(b, to, frame, side->stalled_us);
    } else {
        pass(b, to, frame);
    }
}

/* Whether something waits for the clock; to ask it costs as much as to pass a frame. */
static bool has_times(const Bridge *b)
{
    return b->n_due > 0 || b->end_us != INT64_MAX;
}

/* How long to wait: for the next that is due, or the end of the fault. */
static int patience_ms(const Bridge *b, int most_ms)
{
    if (!has_times(b))
        return most_ms;
    const int64_t now_us = bridge_now_us();
    int64_t next_us = b->end_us;
    for (unsigned i = 0; i < b->n_due; i++)
        next_us = b->due[i].due_us < next_us ? b->due[i].due_us : next_us;
    if (next_us == INT64_MAX || next_us - now_us > (int64_t)most_ms * 1000)
        return most_ms;
    return next_us <= now_us ? 0 : (int)((next_us - now_us) / 1000 + 1);
}

bool bridge_turn(Bridge *b, int other, int most_ms)
{
    struct pollfd asks[] = {{b->sides[BRIDGE_AGENT].file, POLLIN, 0},
                            {b->sides[BRIDGE_MACHINE].file, POLLIN, 0},
                            {other, POLLIN, 0}};
    const int ready = poll(asks, 3, patience_ms(b, most_ms));
    for (BridgeSide from = 0; from < BRIDGE_N_SIDES; from++)
        if (asks[from].revents != 0) /* an error, too: reading takes it away */
            take_all(b, from);
    if (has_times(b)) {
        const int64_t now_us = bridge_now_us();
        if (now_us >= b->end_us)
            end_fault(b);
        pass_due(b, now_us);
    }
    for (BridgeSide to = 0; to < BRIDGE_N_SIDES; to++)
        flush(&b->sides[to]);
    return ready <= 0 || asks[2].revents != 0;
}

/* ---------------------------------------------------------------------------- faults */

static void set_up(const Side *side, bool up)
{
    struct ifreq request = {0};
    strncpy(request.ifr_name, side->interface, sizeof request.ifr_name - 1);
    if (ioctl(side->file, SIOCGIFFLAGS, &request) != 0)
        abort();
    request.ifr_flags = (short)(up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP);
    if (ioctl(side->file, SIOCSIFFLAGS, &request) != 0)
        abort();
}

static void tell_bus_off(const Side *side)
{
    const struct can_frame frame = {.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF, .len = CAN_ERR_DLC};
    if (send(side->file, &frame, sizeof frame, 0) != (ssize_t)sizeof frame)
        abort();
}

/* That the fault takes away for some time; NULL: none. */
static Side *side_of(Bridge *b)
{
    switch (b->fault) {
    case BRIDGE_AGENT_DOWN:
    case BRIDGE_AGENT_OFF:
    case BRIDGE_KILLED:
        return &b->sides[BRIDGE_AGENT];
    case BRIDGE_MACHINE_DOWN:
    case BRIDGE_MACHINE_OFF:
    case BRIDGE_REBOOTED:
        return &b->sides[BRIDGE_MACHINE];
    default:
        return NULL;
    }
}

static void take_away(Bridge *b, Side *side)
{
    flush(side);
    side->mute = true;
    b->end_us = bridge_now_us() + AWAY_US;
    switch (b->fault) {
    case BRIDGE_KILLED:
        b->end_us = INT64_MAX;
        b->hands.kill(b->hands.data);
        break;
    case BRIDGE_REBOOTED:
        b->hands.cut(b->hands.data);
        break;
    case BRIDGE_AGENT_DOWN:
    case BRIDGE_MACHINE_DOWN:
        set_up(side, false);
        break;
    default:
        tell_bus_off(side);
        break;
    }
}

static void end_fault(Bridge *b)
{
    Side *side = side_of(b);
    b->end_us = INT64_MAX;
    if (b->fault == BRIDGE_REBOOTED)
        b->hands.boot(b->hands.data);
    if (b->fault == BRIDGE_AGENT_DOWN || b->fault == BRIDGE_MACHINE_DOWN)
        set_up(side, true);
    if (side)
        side->mute = false;
}

static void strike(Bridge *b, BridgeSide from, const Frame *frame)
{
    const BridgeSide to = BRIDGE_N_SIDES - 1 - from;
    const int64_t now_us = bridge_now_us();
    Frame changed = *frame;
    Side *away = side_of(b);
    if (away) {
        if (b->fault == BRIDGE_KILLED || b->fault == BRIDGE_REBOOTED)
            pass(b, to, frame); /* it is on the bus; to the dead it is nothing */
        take_away(b, away);
        return;
    }
    switch (b->fault) {
    case BRIDGE_TWICE:
        pass(b, to, frame);
        pass(b, to, frame);
        break;
    case BRIDGE_TWICE_LATE:
        pass(b, to, frame);
        pass_later(b, to, frame, now_us + LATE_US);
        break;
    case BRIDGE_LATE:
        pass_later(b, to, frame, now_us + LATE_US);
        break;
    case BRIDGE_STALLED:
        b->sides[from].stalled_us = now_us + STALLED_US;
        pass_later(b, to, frame, now_us + STALLED_US);
        break;
    case BRIDGE_DAMAGED:
        if (changed.frame.len > 0) {
            const unsigned bit = b->bit % (8u * changed.frame.len);
            changed.frame.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        }
        pass(b, to, &changed);
        break;
    default: /* lost */
        break;
    }
}

/* ------------------------------------------------------------------------------ life */

static bool open_side(Side *side, const char *interface)
{
    const int on = 1, bytes = BUFFER_BYTES;
    const struct sockaddr_can address = {.can_family = AF_CAN,
                                         .can_ifindex = (int)if_nametoindex(interface)};
    side->interface = interface;
    side->file = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    return side->file >= 0 && address.can_ifindex != 0 &&
           setsockopt(side->file, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) == 0 &&
           setsockopt(side->file, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) == 0 &&
           setsockopt(side->file, SOL_SOCKET, SO_SNDBUFFORCE, &bytes, sizeof bytes) == 0 &&
           bind(side->file, (const struct sockaddr *)&address, sizeof address) == 0;
}

Bridge *bridge_new(const char *agent, const char *machine, const BridgeHands *hands)
{
    Bridge *b = calloc(1, sizeof *b);
    if (!b || !open_side(&b->sides[BRIDGE_AGENT], agent) ||
        !open_side(&b->sides[BRIDGE_MACHINE], machine)) {
        free(b);
        return NULL;
    }
    b->hands = *hands;
    bridge_reset(b, BRIDGE_NO_FAULT, 0, 0);
    return b;
}

void bridge_reset(Bridge *b, BridgeFault fault, unsigned at, unsigned bit)
{
    Frame frames[BATCH];
    if (b->end_us != INT64_MAX && b->end_us > 0)
        end_fault(b);
    for (BridgeSide i = 0; i < BRIDGE_N_SIDES; i++) {
        while (receive(&b->sides[i], frames) > 0)
            ;
        b->sides[i].mute = false;
        b->sides[i].stalled_us = 0;
        b->sides[i].n_out = 0;
    }
    b->fault = fault;
    b->at = at;
    b->bit = bit;
    b->struck = false;
    b->end_us = INT64_MAX;
    b->n_seen = b->n_due = 0;
}

void bridge_revive(Bridge *b)
{
    if (b->fault == BRIDGE_KILLED)
        b->sides[BRIDGE_AGENT].mute = false;
}

bool bridge_struck(const Bridge *b)
{
    return b->struck;
}

const BridgeSeen *bridge_seen(const Bridge *b, unsigned *n)
{
    *n = b->n_seen;
    return b->seen;
}
