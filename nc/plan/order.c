/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/plan/order.h"

#include <string.h>

/* 2-opt looks this far ahead, and goes through the whole order at most so often. */
#define WINDOW 40
#define ROUNDS 8
/* The nearest end is looked for among so many pieces that are left, in order of passes: neighbours
 * lie in neighbouring passes. */
#define LEFT 4000

typedef struct {
    double reach, lift;
} Cost;

static double way(const Cost *cost, SegVec3 a, SegVec3 b)
{
    double d = hypot(b.x - a.x, b.y - a.y);
    return d <= cost->reach ? d : d + cost->lift;
}

static SegVec3 first(const NcPiece *p)
{
    return p->tips[0];
}

static SegVec3 last(const NcPiece *p)
{
    return p->tips[p->n - 1];
}

static void turn(NcPiece *p)
{
    for (size_t i = 0, j = p->n - 1; i < j; i++, j--) {
        SegVec3 tip = p->tips[i];
        p->tips[i] = p->tips[j];
        p->tips[j] = tip;
    }
}

static void nearest_neighbour(GArray *pieces, bool one_way, const Cost *cost)
{
    NcPiece *p = (NcPiece *)pieces->data;
    for (guint i = 0; i + 1 < pieces->len; i++) {
        guint best = i + 1;
        bool turned = false;
        double least = INFINITY;
        for (guint j = i + 1; j < MIN(pieces->len, i + LEFT); j++) {
            double forth = way(cost, last(&p[i]), first(&p[j]));
            double back = one_way ? INFINITY : way(cost, last(&p[i]), last(&p[j]));
            if (fmin(forth, back) < least) {
                least = fmin(forth, back);
                best = j;
                turned = back < forth;
            }
        }
        NcPiece taken = p[best];
        if (turned)
            turn(&taken);
        memmove(&p[i + 2], &p[i + 1], (best - i - 1) * sizeof *p);
        p[i + 1] = taken;
    }
}

/* Reverses the order from i to j, each piece turned, where the two ways at its ends get shorter. */
static bool improve(NcPiece *p, guint n, guint i, guint j, const Cost *cost)
{
    SegVec3 before = last(&p[i - 1]);
    double now = way(cost, before, first(&p[i])), then = way(cost, before, last(&p[j]));
    if (j + 1 < n) {
        now += way(cost, last(&p[j]), first(&p[j + 1]));
        then += way(cost, first(&p[i]), first(&p[j + 1]));
    }
    if (then >= now - 1e-9)
        return false;
    for (guint a = i, b = j; a <= b; a++, b--) {
        NcPiece piece = p[a];
        p[a] = p[b];
        p[b] = piece;
        turn(&p[a]);
        if (a != b)
            turn(&p[b]);
        if (b == 0)
            break;
    }
    return true;
}

void nc_order_pieces(GArray *pieces, bool one_way, double reach_mm, double lift_mm)
{
    Cost cost = {reach_mm, lift_mm};
    nearest_neighbour(pieces, one_way, &cost);
    bool better = !one_way;
    for (int round = 0; round < ROUNDS && better; round++) {
        better = false;
        for (guint i = 1; i < pieces->len; i++)
            for (guint j = i; j < MIN(pieces->len, i + WINDOW); j++)
                better |= improve((NcPiece *)pieces->data, pieces->len, i, j, &cost);
    }
}
