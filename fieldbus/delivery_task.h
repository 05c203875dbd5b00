/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The inside of an FbDelivery, for its two files: delivery.c keeps the connection and asks,
 * delivery_task.c decides by the last status what to ask next.
 */
#ifndef FIELDBUS_DELIVERY_TASK_H
#define FIELDBUS_DELIVERY_TASK_H

#include "fieldbus/delivery.h"

enum {
    FB_AGAIN_US = 50000,  /* asking again what is not ready yet */
    FB_MOVE_US = 3000000, /* START, RESTART and RESUME are sent no later behind the act */
};

typedef enum { LINK_DOWN, LINK_CONNECTING, LINK_UP } FbLink;

/* A request that is on its way; answers come in the order of the requests. */
typedef struct {
    FbRequestKind kind;
    int64_t deadline_us;
} FbFlight;

struct FbDelivery {
    FbDeliveryOptions options;

    uint16_t chunk_most; /* of the carrier */

    FbLink link;
    int64_t deadline_us;              /* DOWN: to connect; CONNECTING: to give this connection up */
    FbFlight flights[FB_WINDOW_MOST]; /* oldest first */
    unsigned n_flights;
    int64_t lost_us; /* since when there is no status; meaningless while `fresh` */
    char *why;       /* the last break */
    bool fresh;      /* `status` was read on this connection */
    bool must_look;  /* it may be older than the task: other connections change things, too */
    FbStatus status;
    uint32_t epoch;         /* of the last status */
    uint16_t alarm_serial;  /* the texts in `status` belong to it */
    FbRequest request;      /* the last one */
    FbRequestKind answered; /* what the last reply was to */
    int64_t poll_us, again_us, shown_us;

    bool leased; /* by this session */
    int64_t beat_us;
    uint32_t beats;

    FbOrder order; /* the last command */
    bool asking;   /* it is not answered yet */

    bool busy; /* with `task` */
    FbTask task;
    FbCommand command; /* of TASK_COMMAND */
    FbArguments arguments;
    int64_t since_us;
    bool withdrawn;      /* a stop was asked for: START, RESTART or RESUME is not sent any more */
    int64_t lapses_us;   /* the refused lease, when first looked at; 0: not yet */
    uint32_t task_epoch; /* another one ends the task; 0: none seen yet */
    bool finishing;      /* the task is over, with `outcome`, but for the release of the lease */
    unsigned farewells;  /* connections that broke meanwhile */
    GError *outcome;     /* of a run that is on: why its rest was refused */

    GBytes *program;
    FbOpen open;
    uint64_t *gates;
    uint8_t *table;       /* of the gates, as on the wire */
    uint64_t table_bytes; /* of it */
    uint64_t sent_to;     /* end of the last chunk in flight; 0: nothing is in flight */
    bool go_back;         /* a chunk was not taken: no more until all are answered */
    uint32_t transfer;    /* what was delivered, or is on its way */
    bool opened;          /* by this task */
    bool must_open;       /* what the machine holds is of no use */
    uint64_t received;    /* seen in this task */
    unsigned damaged;
    bool started;
    uint32_t run;
    bool stored; /* TASK_RUN is of what the machine holds: `wanted` */
    FbStored wanted;
    uint8_t wanted_id[32];

    FbSetup setup;
    unsigned pages;   /* of it that were read; 0: not even the offsets */
    bool setup_known; /* whole */
};

/* delivery.c */

/* A new command: from now on it is sent, with this number, until its answer is known. */
void fb_delivery_ask(FbDelivery *d, FbCommand command, int64_t now_us, FbActions *out);
void fb_delivery_send_order(FbDelivery *d, int64_t now_us, FbActions *out);
void fb_delivery_send_chunk(FbDelivery *d, int64_t now_us, FbActions *out);
void fb_delivery_send_read(FbDelivery *d, FbRequestKind kind, unsigned page, int64_t now_us,
                           FbActions *out);

/* delivery_task.c */

/* Takes the answer to what was asked, if the status has it. The status is fresh, and so is the
 * alarm's text. To be called before anything else is read: the machine then says what it answered
 * last, which may be somebody else's command. */
void fb_task_judge(FbDelivery *d, int64_t now_us);

/* Asks what comes next for the task, waits (again_us), or ends it. The status is fresh. */
void fb_task_next(FbDelivery *d, int64_t now_us, FbActions *out);

/* Whether what comes next is another chunk, and may join those in flight. */
bool fb_task_streams(const FbDelivery *d);

/* What the answer to a chunk means for the task: some say that no other chunk will help. */
void fb_task_judge_chunk(FbDelivery *d);

/* Whether the machine may have taken the task's START. */
bool fb_task_may_run(const FbDelivery *d);

/* The task is over; NULL: it succeeded. Takes the error. What is left is to release the lease. */
void fb_task_finish(FbDelivery *d, GError *error);

/* Without a link a RESUME that was withdrawn ends at once: the stop is next. */
void fb_task_give_way(FbDelivery *d, FbActions *out);

/* Tells the outcome, whatever is left. */
void fb_task_end(FbDelivery *d, FbActions *out);

#endif
