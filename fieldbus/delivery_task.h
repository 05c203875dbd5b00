/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The inside of an FbDelivery, for its two files: delivery.c keeps the connection and asks,
 * delivery_task.c decides by the last status what to ask next.
 */
#ifndef FIELDBUS_DELIVERY_TASK_H
#define FIELDBUS_DELIVERY_TASK_H

#include "fieldbus/delivery.h"

enum { FB_AGAIN_US = 50000 }; /* asking again what is not ready yet */

typedef enum { LINK_DOWN, LINK_CONNECTING, LINK_WAITING, LINK_UP } FbLink;

struct FbDelivery {
    FbDeliveryOptions options;

    FbLink link;
    int64_t deadline_us; /* DOWN: to connect; CONNECTING, WAITING: to give this connection up */
    int64_t lost_us;     /* since when there is no status; meaningless while `fresh` */
    char *why;           /* the last break */
    bool fresh;          /* `status` was read on this connection */
    bool must_look;      /* it may be older than the task: other connections change things, too */
    FbStatus status;
    uint32_t epoch;        /* of the last status */
    uint16_t alarm_serial; /* the texts in `status` belong to it */
    FbRequest request;     /* in flight, or the last one */
    int64_t poll_us, again_us, shown_us;

    bool leased; /* by this session */
    int64_t beat_us;
    uint32_t beats;

    FbOrder order; /* the last command */
    bool asking;   /* it is not answered yet */

    bool busy; /* with `task` */
    FbTask task;
    FbCommand command; /* of TASK_COMMAND */
    int64_t since_us;
    int64_t lapses_us;   /* the refused lease, when first looked at; 0: not yet */
    uint32_t task_epoch; /* another one ends the task; 0: none seen yet */
    bool finishing;      /* the task is over, with `outcome`, but for the release of the lease */
    GError *outcome;

    GBytes *program;
    FbOpen open;
    uint8_t *table;    /* of the gates, as on the wire */
    uint32_t transfer; /* what was delivered, or is on its way */
    bool opened;       /* by this task */
    bool must_open;    /* what the machine holds is of no use */
    uint64_t received; /* seen in this task */
    unsigned damaged;
    bool started;
    uint32_t run;
};

/* delivery.c */

/* A new command: from now on it is sent, with this number, until its answer is known. */
void fb_delivery_ask(FbDelivery *d, FbCommand command, int64_t now_us, FbActions *out);
void fb_delivery_send_order(FbDelivery *d, int64_t now_us, FbActions *out);
void fb_delivery_send_chunk(FbDelivery *d, int64_t now_us, FbActions *out);

/* delivery_task.c */

/* Asks what comes next for the task, waits (again_us), or ends it. The status is fresh. */
void fb_task_next(FbDelivery *d, int64_t now_us, FbActions *out);

/* Whether the machine may have taken the task's START. */
bool fb_task_may_run(const FbDelivery *d);

/* The task is over; NULL: it succeeded. Takes the error. What is left is to release the lease. */
void fb_task_finish(FbDelivery *d, GError *error);

/* Tells the outcome, whatever is left. */
void fb_task_end(FbDelivery *d, FbActions *out);

#endif
