/* SPDX-License-Identifier: Apache-2.0 */
/*
 * FbDelivery: the agent's side of one connection as a state machine. It decides everything from the
 * machine's last status, so that after any break it needs to remember nothing but its task and the
 * one command whose answer it does not know yet. It knows neither sockets nor clocks.
 */
#ifndef FIELDBUS_DELIVERY_H
#define FIELDBUS_DELIVERY_H

#include "fieldbus/wire.h"

typedef enum {
    FB_REQUEST_STATUS,  /* read STATUS */
    FB_REQUEST_ALARM,   /* read ALARM */
    FB_REQUEST_OFFSETS, /* read OFFSETS */
    FB_REQUEST_TOOLS,   /* read a page of TOOLS */
    FB_REQUEST_COMMAND, /* these write their block and read STATUS back */
    FB_REQUEST_CHUNK,
    FB_REQUEST_BEAT,
} FbRequestKind;

typedef struct {
    FbRequestKind kind;
    unsigned page; /* of TOOLS */
    size_t n;      /* of the block that is written */
    uint8_t bytes[FB_BLOCK_BYTES];
} FbRequest;

/* The first register of the block that answers it. */
unsigned fb_request_register(const FbRequest *request);

typedef enum {
    FB_EVENT_TICK,
    FB_EVENT_CONNECTED,
    FB_EVENT_REPLY,
    FB_EVENT_NEWS,  /* the machine says that its status is another one: read it now */
    FB_EVENT_ALIVE, /* it says that it is there: no need to read the status just for that */
    FB_EVENT_BROKEN
} FbEventKind;

typedef struct {
    FbEventKind kind;
    const uint8_t *bytes; /* REPLY, to the oldest request without one: the block read */
    size_t n;
    const char *why; /* BROKEN: also "cannot connect" */
} FbEvent;

/* What to do after a step, in this order. */
typedef struct {
    bool close;
    bool connect;
    const FbRequest *request; /* send it; NULL: nothing. Valid until the next step */
    bool more;                /* step again with TICK before waiting: the window has room */
    bool show;                /* fb_delivery_status is worth showing */
    bool ended;               /* the task, */
    FbTask task;
    GError *error;   /* how; the caller's */
    int64_t wake_us; /* TICK then, at the latest */
} FbActions;

typedef struct {
    uint32_t session; /* random, not 0 */
    uint64_t token;
    int64_t reply_timeout_us, reconnect_us, give_up_us, heartbeat_us;
    uint16_t window; /* requests in flight, at most; 1 … 16 */
    CfgDrip drip;
} FbDeliveryOptions;

typedef struct FbDelivery FbDelivery;

FbDelivery *fb_delivery_new(const FbDeliveryOptions *options, int64_t now_us);
void fb_delivery_free(FbDelivery *delivery);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbDelivery, fb_delivery_free)

uint32_t fb_delivery_session(const FbDelivery *delivery);
void fb_delivery_set_token(FbDelivery *delivery, uint64_t token);

/* No chunk is longer than the carrier can take, whatever the machine publishes. At first
 * FB_CHUNK_BYTES. */
void fb_delivery_limit_chunks(FbDelivery *delivery, uint16_t bytes);

/* Tasks; one at a time: none while fb_delivery_busy. Step with TICK afterwards. */
void fb_delivery_deliver(FbDelivery *delivery, GBytes *program, const uint64_t *gates,
                         size_t n_gates, int64_t now_us);
void fb_delivery_start(FbDelivery *delivery, int64_t now_us);
void fb_delivery_start_stored(FbDelivery *delivery, const FbStored *stored, int64_t now_us);
void fb_delivery_command(FbDelivery *delivery, FbCommand command, const FbArguments *arguments,
                         int64_t asked_us, int64_t now_us); /* asked: when a person did */
void fb_delivery_read_setup(FbDelivery *delivery, int64_t now_us);

/* A stop is asked for on another delivery, or waits for this one: a START, RESTART or RESUME that
 * the machine has not answered yet is not sent any more. As after 3 s the task then ends with what
 * is known of it: REFUSED where it never left, LINK_LOST where its answer was lost. */
void fb_delivery_withdraw(FbDelivery *delivery);
bool fb_delivery_busy(const FbDelivery *delivery);

void fb_delivery_step(FbDelivery *delivery, const FbEvent *event, int64_t now_us, FbActions *out);

/* The last status; UNKNOWN before the first and while there is no connection. */
const FbStatus *fb_delivery_status(const FbDelivery *delivery);

/* Why the connection broke last; NULL: it never did. */
const char *fb_delivery_why(const FbDelivery *delivery);

/* What FB_TASK_SETUP has read; NULL before. */
const FbSetup *fb_delivery_setup(const FbDelivery *delivery);

/* The RELEASE to send before the connection is closed for good, refused where a run is on; NULL
 * where there is none to send: no lease, or no connection. */
const FbRequest *fb_delivery_farewell(FbDelivery *delivery);

#endif
